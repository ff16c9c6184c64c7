#include "core/sha256.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/files.h"

namespace sateen::sha256_test {
namespace {

using ::testing::HasSubstr;

// The answers are the examples of FIPS 180-4.
constexpr std::string_view kOfNothing =
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr std::string_view kOfAbc =
    "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr std::string_view kOfAMillionA =
    "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";

TEST(Sha256, GivesThePublishedDigests) {
  EXPECT_EQ(Sha256(""), kOfNothing);
  EXPECT_EQ(Sha256("abc"), kOfAbc);
  EXPECT_EQ(Sha256(std::string(1'000'000, 'a')), kOfAMillionA);
}

TEST(Sha256OfFile, IsThatOfItsBytes) {
  const testing::TempFolder folder;
  const std::string bytes(3'000'000, 'b');  // more than one piece of reading
  testing::WriteText(folder.Path() / "abc", "abc");
  testing::WriteText(folder.Path() / "large", bytes);

  EXPECT_EQ(Sha256OfFile(folder.Path() / "abc").value(), kOfAbc);
  EXPECT_EQ(Sha256OfFile(folder.Path() / "large").value(), Sha256(bytes));
}

TEST(Sha256OfFile, NamesTheFileThatIsMissing) {
  const Result<std::string> digest = Sha256OfFile("/nowhere/rig.json");

  ASSERT_FALSE(digest);
  EXPECT_EQ(digest.error().code, ErrorCode::kIo);
  EXPECT_THAT(digest.error().message, HasSubstr("/nowhere/rig.json: no such file"));
}

}  // namespace
}  // namespace sateen::sha256_test
