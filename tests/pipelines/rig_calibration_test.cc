#include "pipelines/calibrate/rig_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/files.h"

namespace sateen::rig_calibration_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;

Rig RigOfOneLight() {
  Rig rig;
  rig.lights.push_back({.name = "a"});
  return rig;
}

class RecordAndWriteCase : public ::testing::Test {
 protected:
  RecordAndWriteCase() { BeginCalibration(folder_.Path() / "rig.json", "pose", calibration_); }

  [[nodiscard]] Rig Written() const { return ReadRig(calibration_.output).value(); }

  const testing::TempFolder folder_;
  RigCalibration calibration_{.rig = RigOfOneLight()};
};

TEST_F(RecordAndWriteCase, WritesTheRecordWithItsDate) {
  calibration_.warnings = {"so"};
  calibration_.sha256_of_input = {{"a.png", "0f"}};
  calibration_.seconds = 1.5;
  PoseRecord record;
  FillCommon("pose", calibration_, record);
  record.rms_px = 0.25;
  ASSERT_TRUE(RecordAndWrite(record, &CalibrationRecords::pose, calibration_));

  EXPECT_EQ(calibration_.pictures, folder_.Path() / "rig-pose");
  EXPECT_EQ(Written(), calibration_.rig);
  PoseRecord written = Written().calibration.pose.value();
  EXPECT_EQ(written.schema, "sateen.calibrate.pose/1");
  EXPECT_THAT(written.date.value(), MatchesRegex("20..-..-..T..:..:..Z"));
  written.date.reset();
  EXPECT_EQ(written, record);
  EXPECT_EQ(calibration_.former_output, "");
  EXPECT_THAT(calibration_.warnings, ElementsAre("so"));
}

TEST_F(RecordAndWriteCase, KeepsThePreviousRigAndNamesWhatItAloneHad) {
  Rig before = RigOfOneLight();
  before.calibration.lens.emplace().date = "then";
  before.calibration.pose.emplace().date = "then";
  before.calibration.lights.emplace();  // without a date: by hand
  testing::WriteText(calibration_.output, RigToJson(before));
  ASSERT_TRUE(RecordAndWrite(PoseRecord(), &CalibrationRecords::pose, calibration_));

  EXPECT_EQ(ReadRig(calibration_.former_output).value(), before);
  EXPECT_THAT(calibration_.warnings, ElementsAre(HasSubstr("the calibration of lens in ")));
}

TEST_F(RecordAndWriteCase, OfTheRigItselfLosesNothing) {
  calibration_.rig.calibration.lens.emplace().date = "then";
  testing::WriteText(calibration_.output, RigToJson(calibration_.rig));
  ASSERT_TRUE(RecordAndWrite(PoseRecord(), &CalibrationRecords::pose, calibration_));
  EXPECT_THAT(calibration_.warnings, IsEmpty());
  EXPECT_EQ(Written().calibration.lens.value().date, "then");
}

TEST_F(RecordAndWriteCase, AnInvalidRigIsNotWritten) {
  calibration_.rig.lights.clear();
  EXPECT_EQ(RecordAndWrite(PoseRecord(), &CalibrationRecords::pose, calibration_).error().code,
            ErrorCode::kBadData);
  EXPECT_FALSE(std::filesystem::exists(calibration_.output));
}

}  // namespace
}  // namespace sateen::rig_calibration_test
