#include "core/quantity.h"

#include <gmock/gmock.h>

namespace sateen::quantity_test {
namespace {

using std::chrono::milliseconds;

TEST(Quantity, ReadsLevels) {
  EXPECT_DOUBLE_EQ(*ParseLevel("50%"), 0.5);
  EXPECT_DOUBLE_EQ(*ParseLevel("0.5"), 0.5);
  EXPECT_DOUBLE_EQ(*ParseLevel("100%"), 1.0);
  EXPECT_DOUBLE_EQ(*ParseLevel("0"), 0.0);
  EXPECT_DOUBLE_EQ(*ParseLevel("1.0"), 1.0);
  for (const char* wrong :
       {"", "%", "50", "1", "101%", "-1%", "1.01", "50 %", "50%%", "nan", "inf"}) {
    ASSERT_FALSE(ParseLevel(wrong)) << wrong;
    EXPECT_EQ(ParseLevel(wrong).error().code, ErrorCode::kInvalidArgument);
  }
}

TEST(Quantity, ReadsDurations) {
  EXPECT_EQ(*ParseDuration("500ms"), milliseconds(500));
  EXPECT_EQ(*ParseDuration("2s"), milliseconds(2000));
  EXPECT_EQ(*ParseDuration("1.5s"), milliseconds(1500));
  for (const char* wrong :
       {"", "500", "ms", "0ms", "0.4ms", "3601s", "-1s", "2 s", "1m", "1e3ms"}) {
    EXPECT_FALSE(ParseDuration(wrong)) << wrong;
  }
}

TEST(Quantity, WritesThemForPeople) {
  EXPECT_EQ(DurationText(milliseconds(500)), "500 ms");
  EXPECT_EQ(DurationText(milliseconds(1250)), "1.25 s");
  EXPECT_EQ(DurationText(milliseconds(60000)), "60 s");
  EXPECT_EQ(LevelText(0.5), "50 %");
  EXPECT_EQ(LevelText(0.125), "12.5 %");
}

}  // namespace
}  // namespace sateen::quantity_test
