#include "rig/calibration_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "rig/rig.h"
#include "tests/testing/files.h"

namespace sateen::calibration_record_test {
namespace {

using Json = nlohmann::json;

// Every key that a calibrator writes, as it stands in the file.
constexpr const char* kCalibration =
    R"({"lens":{"board":"charuco:10x7:25mm:18mm","corner_sd_px":0.0625,)"
    R"("coverage":{"cells":[2,1],"corners":[13,0]},"date":"2026-05-04T03:02:01Z",)"
    R"("distortion":[-0.25,0.1,0.001,-0.0008,0.0],"distortion_sd":[0.01,0.02,0.03,0.04,0.05],)"
    R"("focal_error":0.0005,"held_out_rms_px":0.22,"ignored":["notes.txt: no photograph"],)"
    R"("inputs":{"a.png":"0f","b.png":"1e"},"k":[720.0,719.0,322.4,236.1],)"
    R"("k_sd":[0.5,0.6,0.7,0.8],"line_deviation_px":{"after":0.1,"before":4.5},)"
    R"("principal_error_px":0.3,"rms_px":0.2,"schema":"sateen.calibrate.lens/1","seconds":3.0,)"
    R"("size_px":[640,480],"version":"0.1.0","views":[{"corners":54,"edge_px":1.2,)"
    R"("held_out_px":0.3,"name":"a.png","rms_px":0.25,"tilt_deg":30.0,"used":true},)"
    R"({"name":"b.png","reason":"is blurred","used":false}],"warnings":["b.png is not used"]},)"
    R"("lights":{"albedo":0.99,"date":"2026-05-04T03:02:03Z","inputs":{},"lights":[)"
    R"({"direction_error_deg":0.01,"direction_sd_deg":0.02,"flux_error":0.03,)"
    R"("flux_sd":[0.1,0.2,0.3],"model":"led","moved_mm":12.5,"name":"led-0","noise_rms":0.004,)"
    R"("position_error_mm":0.5,"position_sd_mm":[0.6,0.7,0.8],"rungs":[{"held_out_rms":0.1,)"
    R"("iterations":7,"model":"near","residual_rms":0.2}],"samples":900,"samples_left_out":3}],)"
    R"("schema":"sateen.calibrate.lights/1","seconds":1.5,"sheets":[{"blur_px":0.9,"markers":41,)"
    R"("markers_of_border":44,"misfit":0.01,"name":"scans/flat","position_error_mm":0.02,)"
    R"("position_sd_mm":[0.1,0.2,0.3],"table_from_sheet":[1.0,0.0,0.0,0.5,0.0,1.0,0.0,0.25,0.0,)"
    R"(0.0,1.0,0.125,0.0,0.0,0.0,1.0],"tilt_error_deg":0.04,"tilt_sd_deg":0.05}],)"
    R"("version":"0.1.0","warnings":[],"ways":[{"direction_error_deg":2.5,"flat_sheet_deg":6.5,)"
    R"("tilted_sheets_deg":7.5,"way":"ruler"},{"way":"fit"}]},)"
    R"("pose":{"board":"chessboard:9x6:25mm","corners":54,"date":"2026-05-04T03:02:04Z",)"
    R"("edge_sd_mm":0.05,"inputs":{},"lean_deg":8.1,"moved_mm":1.0,"photographs":1,)"
    R"("position_error_mm":0.25,"position_sd_mm":[0.1,0.2,0.3],"rms_px":0.125,)"
    R"("rotation_error_deg":0.01,"rotation_sd_deg":[0.01,0.02,0.03],)"
    R"("schema":"sateen.calibrate.pose/1","seconds":0.5,"table_from_camera":[1.0,0.0,0.0,-8.0,)"
    R"(0.0,-1.0,0.0,61.0,0.0,0.0,-1.0,430.0,0.0,0.0,0.0,1.0],"thickness_mm":3.0,)"
    R"("turned_deg":0.25,"version":"0.1.0","warnings":[]},)"
    R"("response":{"black_dn":600.25,"chart":{"at_mm":[1.5,-2.5],"misfit":0.02,)"
    R"("turned_deg":3.5},"date":"2026-05-04T03:02:05Z","error":{"gain":0.01,"read_noise":null,)"
    R"("saturation":0.02,"white_balance":0.001},"frames":44,"inputs":{},"left_out":[)"
    R"({"light":"led-0","patch":"D2","unevenness":0.1}],"lights":[{"name":"led-0","patches":24,)"
    R"("white_balance":[2.1,1.0,1.6],"white_balance_sd":[0.01,0.0,0.02]}],)"
    R"("linearity":{"blue":{"bins":[{"deviation":0.01,"level_dn":100.5,"sd":0.002}],)"
    R"("departs":true,"fine_to_dn":9000.5,"from_dn":20.5,"saturation_dn":16000.5,)"
    R"("to_dn":15000.5},"green":{"departs":false,"fine_to_dn":null,"from_dn":20.5,)"
    R"("saturation_dn":null,"to_dn":15000.5},"red":{"departs":true,"fine_to_dn":9000.5,)"
    R"("from_dn":20.5,"saturation_dn":16000.5,"to_dn":15000.5}},)"
    R"("noise":{"gain_dn_per_electron":0.4,"gain_rgb":[0.4,0.41,0.42],)"
    R"("gain_rgb_sd":[0.01,0.02,0.03],"gain_sd":0.005,"misfit":1.1,"points":36,)"
    R"("read_noise_dn":3.2,"read_noise_sd":0.1},"saturation_dn":16000.5,)"
    R"("schema":"sateen.calibrate.response/1","seconds":2.5,"tolerance":0.01,)"
    R"("version":"0.1.0","warnings":[],"white_balance":[2.1,1.0,1.6],)"
    R"("white_balance_sd":[0.01,0.0,0.02],"white_dn":15800.5},)"
    R"("spheres":{"date":"2026-05-04T03:02:06Z","highlight":"lamp","inputs":{},"lights":[)"
    R"({"azimuth_deg":10.5,"direction":[0.6,0.0,0.8],"disagreement_deg":0.2,)"
    R"("elevation_deg":53.5,"file":"lamp-0.png","highlights_px":[[10.5,20.5],null],)"
    R"("model":"near","name":"lamp-0","position_mm":[300.5,0.5,400.5],)"
    R"("position_sd_mm":[1.0,2.0,3.0],"spheres":1}],"outlines":"ref.png",)"
    R"("projection":"perspective","radius_mm":30.0,"schema":"sateen.calibrate.spheres/1",)"
    R"("seconds":0.25,"spheres":[{"center_mm":[1.0,2.0,400.0],"center_px":[100.5,90.5],)"
    R"("outline_rms_px":0.1,"outline_seen":0.9,"radius_px":50.5}],"version":"0.1.0",)"
    R"("warnings":[]}})";

Rig RigOf(const std::string& calibration) {
  const testing::TempFolder folder;
  testing::WriteText(folder.Path() / "rig.json",
                     R"({"schema": "sateen.rig/1", "lights": [{"name": "a", "channel": 0,
                         "model": "distant", "direction": [0, 0, 1], "flux_rgb": [1, 1, 1]}],
                         "calibration": )" +
                         calibration + "}");
  return ReadRig(folder.Path() / "rig.json").value();
}

// The text of `calibration` in the rig's file; "" where it has none.
std::string Written(const Rig& rig) {
  const std::string text = RigToJson(rig);
  const std::string key = "  \"calibration\": ";
  const size_t from = text.find(key);
  return from == std::string::npos
             ? ""
             : text.substr(from + key.size(), text.rfind("\n}\n") - from - key.size());
}

TEST(CalibrationRecord, ReadsEachKeyIntoAMember) {
  const CalibrationRecords records = RigOf(kCalibration).calibration;
  EXPECT_EQ(records.lens->rms_px, 0.2);
  EXPECT_EQ(records.lens->views->at(1).reason, "is blurred");
  EXPECT_FALSE(records.lens->views->at(1).corners);
  EXPECT_EQ(records.lens->inputs->at("b.png"), "1e");
  EXPECT_EQ(records.pose->position_sd_mm, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(records.response->noise->value().points, 36U);
  EXPECT_EQ(records.response->linearity->green->fine_to_dn.value(), std::nullopt);
  EXPECT_EQ(records.response->linearity->red->fine_to_dn.value(), 9000.5);
  EXPECT_EQ(records.lights->lights->at(0).rungs->at(0).iterations, 7);
  EXPECT_EQ(records.spheres->lights->at(0).highlights_px->at(0), Eigen::Vector2d(10.5, 20.5));
  EXPECT_EQ(records.spheres->lights->at(0).highlights_px->at(1), std::nullopt);

  // Nothing is left for `other`.
  EXPECT_EQ(records.other, OtherKeys());
  EXPECT_EQ(records.lens->other, OtherKeys());
  EXPECT_EQ(records.lens->views->at(0).other, OtherKeys());
  EXPECT_EQ(records.pose->other, OtherKeys());
  EXPECT_EQ(records.response->other, OtherKeys());
  EXPECT_EQ(records.response->linearity->blue->other, OtherKeys());
  EXPECT_EQ(records.lights->other, OtherKeys());
  EXPECT_EQ(records.lights->lights->at(0).other, OtherKeys());
  EXPECT_EQ(records.lights->sheets->at(0).other, OtherKeys());
  EXPECT_EQ(records.spheres->other, OtherKeys());
  EXPECT_EQ(records.spheres->lights->at(0).other, OtherKeys());
}

TEST(CalibrationRecord, IsWrittenAgainByteForByte) {
  EXPECT_EQ(Written(RigOf(kCalibration)), kCalibration);
}

TEST(CalibrationRecord, ARigWithoutOneHasNoSuchKey) {
  EXPECT_EQ(Written(RigOf("{}")), "");
  EXPECT_EQ(Written(RigOf(R"({"lights":{}})")), R"({"lights":{}})");
  EXPECT_TRUE(RigOf(R"({"lights": {}})").calibration.lights);
  EXPECT_FALSE(RigOf(R"({"lens": {}})").calibration.lights);
}

// Each value in turn becomes one that no calibrator writes there, and each object gets one more
// key.
TEST(CalibrationRecord, KeepsWhatItDoesNotKnow) {
  const Json whole = Json::parse(kCalibration);
  const Json flat = whole.flatten();
  for (const auto& [pointer, value] : flat.items()) {
    Json changed = whole;
    changed[Json::json_pointer(pointer)] = {{"x", {1, nullptr, "y"}}};
    EXPECT_EQ(Json::parse(Written(RigOf(changed.dump()))), changed) << pointer;
    const Json::json_pointer object = Json::json_pointer(pointer).parent_pointer();
    if (whole[object].is_object()) {
      Json grown = whole;
      grown[object]["of the future"] = {1.5, {{"a", false}}};
      EXPECT_EQ(Written(RigOf(grown.dump())), grown.dump()) << pointer;
    }
  }
  const std::string strange = R"({"date":"2025-01-31","lens":3,"lights":null,"pose":[1,2]})";
  EXPECT_EQ(Written(RigOf(strange)), strange);
  EXPECT_FALSE(RigOf(strange).calibration.lens);
}

TEST(CalibrationRecord, OfAnotherTypeIsNotTaken) {
  const Rig rig = RigOf(
      R"({"lens":{"board":7,"k":[1,2,3],"rms_px":"0.2","size_px":[640.5,480],"views":[{"used":1}]},)"
      R"("pose":{"corners":-1}})");
  const LensRecord& lens = rig.calibration.lens.value();
  EXPECT_FALSE(lens.board || lens.k || lens.rms_px || lens.size_px || lens.views->at(0).used);
  EXPECT_FALSE(rig.calibration.pose->corners);
}

TEST(Rig, EqualsARigOfTheSameValuesAlone) {
  const Json whole = Json::parse(kCalibration);
  const Json flat = whole.flatten();
  const Rig rig = RigOf(kCalibration);
  EXPECT_EQ(rig, RigOf(kCalibration));
  for (const auto& [pointer, value] : flat.items()) {
    Json changed = whole;
    Json& place = changed[Json::json_pointer(pointer)];
    place = value.is_number_float()     ? Json(value.get<double>() + 1.0)
            : value.is_number_integer() ? Json(value.get<int>() + 1)
            : value.is_boolean()        ? Json(!value.get<bool>())
                                        : Json("changed");
    EXPECT_NE(rig, RigOf(changed.dump())) << pointer;
  }
}

}  // namespace
}  // namespace sateen::calibration_record_test
