#include "scanner/daemon/http/access.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "scanner/daemon/http/listener.h"
#include "tests/testing/files.h"

namespace sateen::access_test {
namespace {

using ::testing::HasSubstr;
using testing::TempFolder;
using testing::WriteText;

const std::string kToken = "0123456789abcdef0123456789abcdef";

int StatusOf(const AccessHeaders& headers) {
  const std::optional<ApiResponse> refused = AccessRules(kToken, 8377).Check(headers);
  return refused ? refused->status : 200;
}

TEST(AccessRules, LetsInWhoHasTheTokenAndNamesThisComputer) {
  for (const std::string host :
       {"localhost:8377", "127.0.0.1:8377", "[::1]:8377", "LocalHost:8377"}) {
    EXPECT_EQ(StatusOf({.host = {host}, .authorization = {"Bearer " + kToken}}), 200) << host;
  }
}

TEST(AccessRules, ForeignHostsAre421) {
  for (const std::vector<std::string>& host :
       std::vector<std::vector<std::string>>{{},
                                             {""},
                                             {"localhost"},
                                             {"localhost:80"},
                                             {"evil.example:8377"},
                                             {"localhost:8377.evil.example"},
                                             {"127.0.0.1.nip.io:8377"},
                                             {"localhost:8377", "evil.example"}}) {
    EXPECT_EQ(StatusOf({.host = host, .authorization = {"Bearer " + kToken}}), 421);
  }
}

TEST(AccessRules, WebPagesAre403) {
  EXPECT_EQ(
      StatusOf(
          {.host = {"localhost:8377"}, .authorization = {"Bearer " + kToken}, .has_origin = true}),
      403);
}

TEST(AccessRules, WrongTokensAre401) {
  for (const std::vector<std::string>& given :
       std::vector<std::vector<std::string>>{{},
                                             {""},
                                             {"Bearer "},
                                             {kToken},
                                             {"Basic " + kToken},
                                             {"Bearer " + kToken + "0"},
                                             {"Bearer " + kToken.substr(1)},
                                             {"Bearer " + std::string(kToken.size(), 'x')},
                                             {"Bearer " + kToken, "Bearer " + kToken}}) {
    EXPECT_EQ(StatusOf({.host = {"localhost:8377"}, .authorization = given}), 401);
  }
}

TEST(AccessRules, TokensAreComparedWhole) {
  EXPECT_TRUE(SameInConstantTime("", ""));
  EXPECT_TRUE(SameInConstantTime("abc", "abc"));
  EXPECT_FALSE(SameInConstantTime("abc", "abd"));
  EXPECT_FALSE(SameInConstantTime("xbc", "abc"));
  EXPECT_FALSE(SameInConstantTime("abc", "abcd"));
}

TEST(ReadTokenFile, TakesTheFirstLineOfAPrivateFile) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "token";
  WriteText(path, kToken + "\n");
  chmod(path.c_str(), 0600);
  ASSERT_TRUE(ReadTokenFile(path)) << ReadTokenFile(path).error().message;
  EXPECT_EQ(*ReadTokenFile(path), kToken);
  for (const mode_t mode : {0640U, 0604U, 0660U, 0666U}) {
    chmod(path.c_str(), mode);
    const Result<std::string> open = ReadTokenFile(path);
    ASSERT_FALSE(open);
    EXPECT_EQ(open.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(open.error().message, HasSubstr("chmod 600"));
  }
}

TEST(ReadTokenFile, RefusesWhatIsNoToken) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "token";
  EXPECT_EQ(ReadTokenFile(path).error().code, ErrorCode::kIo);
  EXPECT_EQ(ReadTokenFile(folder.Path()).error().code, ErrorCode::kIo);
  for (const std::string& text : {std::string(), std::string("short\n"), kToken + " x\n",
                                  "\n" + kToken, std::string(600, 'a')}) {
    WriteText(path, text);
    chmod(path.c_str(), 0600);
    EXPECT_EQ(ReadTokenFile(path).error().code, ErrorCode::kInvalidArgument) << text;
  }
}

TEST(Listener, TcpIsForThisComputerAlone) {
  for (const std::string address : {"0.0.0.0:0", "192.168.1.5:8377", "[::]:0", ":8377", "8377",
                                    "localhost", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:70000"}) {
    const Result<Listener> refused = Listener::OnLoopback(address);
    ASSERT_FALSE(refused) << address;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  }
  const Result<Listener> v4 = Listener::OnLoopback("127.0.0.1:0");
  ASSERT_TRUE(v4) << v4.error().message;
  EXPECT_GT(v4->Port(), 0);
  const Result<Listener> taken = Listener::OnLoopback(fmt::format("localhost:{}", v4->Port()));
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().code, ErrorCode::kIo);
}

TEST(Listener, UnixSocketIsPrivateAndGoesWithItsOwner) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "sateen.sock";
  {
    const Result<Listener> listener = Listener::OnUnixSocket(path);
    ASSERT_TRUE(listener) << listener.error().message;
    struct stat status = {};
    ASSERT_EQ(lstat(path.c_str(), &status), 0);
    EXPECT_TRUE(S_ISSOCK(status.st_mode));
    EXPECT_EQ(status.st_mode & 0777U, 0600U);
    const Result<Listener> second = Listener::OnUnixSocket(path);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, ErrorCode::kDevice);
    EXPECT_THAT(second.error().message, HasSubstr("a daemon is running at"));
    EXPECT_TRUE(std::filesystem::exists(path));
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(Listener, ReplacesTheSocketOfAKilledDaemonAndNothingElse) {
  const TempFolder folder;
  const std::filesystem::path path = folder.Path() / "sateen.sock";
  const std::filesystem::path kept = folder.Path() / "kept.sock";
  {
    const Result<Listener> listener = Listener::OnUnixSocket(path);
    ASSERT_TRUE(listener);
    std::filesystem::create_hard_link(path, kept);  // outlives its daemon, as after kill -9
  }
  std::filesystem::rename(kept, path);
  ASSERT_TRUE(Listener::OnUnixSocket(path)) << Listener::OnUnixSocket(path).error().message;

  WriteText(path, "a file that somebody needs");
  const Result<Listener> file = Listener::OnUnixSocket(path);
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().code, ErrorCode::kIo);
  EXPECT_TRUE(std::filesystem::is_regular_file(path));

  const std::filesystem::path too_long = folder.Path() / std::string(120, 'x');
  EXPECT_EQ(Listener::OnUnixSocket(too_long).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(Listener::OnUnixSocket(folder.Path() / "none/x.sock").error().code, ErrorCode::kIo);
}

}  // namespace
}  // namespace sateen::access_test
