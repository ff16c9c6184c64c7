#include "rig/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "rig/projection.h"
#include "tests/testing/files.h"

namespace sateen::rig_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using Json = nlohmann::json;

// A rig with a light of every model and every key.
Json FullRig() {
  return Json::parse(R"({
    "schema": "sateen.rig/1",
    "camera": {"model": "Canon EOS 80D", "size_px": [6000, 4000], "k": [8000, 8010, 2999, 2001],
               "distortion": [-0.1, 0.02, 0.001, -0.0005, 0.003],
               "table_from_camera": [1, 0, 0, 5, 0, -0.8, 0.6, 7, 0, -0.6, -0.8, 500, 0, 0, 0, 1]},
    "response": {"black": 512, "white": 15800, "white_balance": [2.1, 1, 1.6],
                 "read_noise_dn": 3.2, "gain_dn_per_electron": 0.4},
    "lights": [
      {"name": "a", "channel": 0, "model": "distant", "direction": [0.6, 0, 0.8],
       "direction_sd_deg": 0.4, "flux_rgb": [1, 1.1, 0.9], "irradiance_sd": 0.01},
      {"name": "b", "channel": 5, "model": "near", "position_mm": [100, -20, 350.5],
       "position_sd_mm": [0.1, 0.2, 0.3], "flux_rgb": [1, 2, 3]},
      {"name": "c", "channel": 2, "model": "led", "position_mm": [100, 20, 350],
       "axis": [0, -0.6, -0.8], "anisotropy": 0.7, "flux_rgb": [1, 2, 3]},
      {"name": "d", "channel": 3, "model": "led+field", "position_mm": [-100, 20, 350],
       "axis": [0, 0.6, -0.8], "anisotropy": 0.5, "flux_rgb": [1, 2, 3],
       "field": {"origin_mm": [-90, -60.5], "spacing_mm": 45, "columns": 5, "rows": 4,
                 "gain": [1, 1.01, 1.02, 1.03, 1.04, 1, 1, 1, 1, 1, 0.9, 0.9, 0.9, 0.9, 0.9,
                          1, 1, 1, 1, 0.3333333333333333]}}],
    "calibration": {"date": "2025-01-31", "figures": {"held_out": [0.01, {"x": null}]}}})");
}

Result<Rig> Read(const std::string& text) {
  const testing::TempFolder folder;
  testing::WriteText(folder.Path() / "rig.json", text);
  return ReadRig(folder.Path() / "rig.json");
}

// Returns ReadRig's message about FullRig() with a change at one place, without the file's path.
std::string MessageWith(const std::string& pointer, const Json& value) {
  Json rig = FullRig();
  rig[Json::json_pointer(pointer)] = value;
  const Result<Rig> read = Read(rig.dump());
  if (read) {
    return "";
  }
  EXPECT_EQ(read.error().code, ErrorCode::kBadData);
  const size_t end_of_path = read.error().message.find("rig.json: ");
  EXPECT_NE(end_of_path, std::string::npos) << read.error().message;
  return read.error().message.substr(end_of_path);
}

std::string MessageWithout(const std::string& pointer) {
  const Json::json_pointer place(pointer);
  Json rig = FullRig();
  rig[place.parent_pointer()].erase(place.back());
  const Result<Rig> read = Read(rig.dump());
  return read ? "" : read.error().message;
}

TEST(ReadRig, ReadsEveryKey) {
  const Result<Rig> read = Read(FullRig().dump());
  ASSERT_TRUE(read) << read.error().message;
  const Rig& rig = *read;

  ASSERT_TRUE(rig.camera && rig.response);
  EXPECT_EQ(rig.camera->model, "Canon EOS 80D");
  EXPECT_EQ(rig.camera->size_px, (ImageSize{6000, 4000}));
  EXPECT_EQ(rig.camera->fx, 8000);
  EXPECT_EQ(rig.camera->fy, 8010);
  EXPECT_EQ(rig.camera->cx, 2999);
  EXPECT_EQ(rig.camera->cy, 2001);
  EXPECT_EQ(rig.camera->distortion, (std::array<double, 5>{-0.1, 0.02, 0.001, -0.0005, 0.003}));
  EXPECT_EQ(rig.camera->table_from_camera.translation(), Eigen::Vector3d(5, 7, 500));
  EXPECT_EQ(rig.camera->table_from_camera(1, 2), 0.6);  // row-major
  EXPECT_EQ(rig.response->black, 512);
  EXPECT_EQ(rig.response->white, 15800);
  EXPECT_EQ(rig.response->white_balance, Eigen::Vector3d(2.1, 1, 1.6));
  EXPECT_EQ(rig.response->read_noise_dn, 3.2);
  EXPECT_EQ(rig.response->gain_dn_per_electron, 0.4);
  EXPECT_EQ(Json::parse(RigToJson(rig)).at("calibration"), FullRig().at("calibration"));
}

TEST(ReadRig, ReadsALightOfEachModel) {
  const Lights lights = Read(FullRig().dump()).value().lights;
  ASSERT_EQ(lights.size(), 4U);
  EXPECT_EQ(lights[0].name, "a");
  EXPECT_EQ(lights[0].model, LightModel::kDistant);
  EXPECT_EQ(lights[0].direction, Eigen::Vector3d(0.6, 0, 0.8));
  EXPECT_EQ(lights[0].flux_rgb, Eigen::Vector3d(1, 1.1, 0.9));
  EXPECT_EQ(lights[1].model, LightModel::kNear);
  EXPECT_EQ(lights[1].channel, 5);
  EXPECT_EQ(lights[1].position_mm, Eigen::Vector3d(100, -20, 350.5));
  EXPECT_EQ(lights[0].direction_sd_deg, 0.4);
  EXPECT_EQ(lights[0].irradiance_sd, 0.01);
  EXPECT_EQ(lights[1].position_sd_mm, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_FALSE(lights[1].direction_sd_deg || lights[1].irradiance_sd || lights[0].position_sd_mm);
  EXPECT_EQ(lights[2].model, LightModel::kLed);
  EXPECT_EQ(lights[2].axis, Eigen::Vector3d(0, -0.6, -0.8));
  EXPECT_EQ(lights[2].anisotropy, 0.7);
  EXPECT_EQ(lights[3].model, LightModel::kLedField);
  EXPECT_EQ(lights[3].field.origin_mm, Eigen::Vector2d(-90, -60.5));
  EXPECT_EQ(lights[3].field.spacing_mm, 45);
  EXPECT_EQ(lights[3].field.columns, 5);
  EXPECT_EQ(lights[3].field.rows, 4);
  EXPECT_EQ(lights[3].field.gain[4], 1.04);
  EXPECT_EQ(lights[3].field.gain[10], 0.9);
}

TEST(RigToJson, RoundTripsToTheLastBit) {
  Json file = FullRig();
  const double third = 1.0 / 3.0;
  file["lights"][0]["direction"] = {0.5774, 0.5773, 0.5774};  // normalised on reading
  for (int k = 0; k < 100; ++k) {  // enough for some whose length is not 1 to the last bit
    Json light = file["lights"][0];
    light["name"] = fmt::format("d{}", k);
    light["direction"] = {std::round(6e3 * std::cos(k)) / 1e4, std::round(6e3 * std::sin(k)) / 1e4,
                          0.8};
    file["lights"].push_back(light);
  }
  file["lights"][2]["axis"] = {0, -0.6001, -0.8};
  file["lights"][1]["flux_rgb"] = {third, std::numbers::pi, 1.2345678901234567e-9};
  file["camera"]["table_from_camera"][5] = -0.8000001;  // made orthonormal on reading

  const std::string once = RigToJson(Read(file.dump()).value());
  const Rig rig = Read(once).value();

  EXPECT_EQ(RigToJson(rig), once);
  EXPECT_EQ(rig.lights[1].flux_rgb,
            Eigen::Vector3d(third, std::numbers::pi, 1.2345678901234567e-9));
  EXPECT_NEAR(rig.lights[0].direction.norm(), 1.0, 1e-15);
  EXPECT_NEAR(rig.lights[2].axis.norm(), 1.0, 1e-15);
  const Eigen::Matrix3d r = rig.camera->table_from_camera.linear();
  EXPECT_LT((r.transpose() * r - Eigen::Matrix3d::Identity()).norm(), 1e-14);
}

TEST(RigToJson, KeepsEveryKeyOfTheFile) {
  EXPECT_EQ(Json::parse(RigToJson(Read(FullRig().dump()).value())), FullRig());
}

TEST(RigToJson, AbsentPartsStayAbsent) {
  Json file = FullRig();
  file.erase("camera");
  file.erase("response");
  file.erase("calibration");
  file["lights"] = {file["lights"][0]};
  EXPECT_EQ(Json::parse(RigToJson(Read(file.dump()).value())), file);
}

TEST(ReadRig, NormalisedVectorsMustBeNearlyUnit) {
  EXPECT_THAT(MessageWith("/lights/0/direction", {0.6, 0, 0.9}),
              HasSubstr("rig.json: lights[0]: direction [0.6, 0, 0.9] has length 1.08"));
  EXPECT_THAT(MessageWith("/lights/2/axis", {0, 0, -1.01}), HasSubstr("lights[2]: axis"));
  EXPECT_THAT(MessageWith("/lights/0/direction", {0.6, 0.0005, 0.8}), IsEmpty());
}

TEST(ReadRig, LightsMustBeAboveTheTable) {
  EXPECT_THAT(MessageWith("/lights/0/direction", {0.6, 0, -0.8}),
              HasSubstr("lights[0].direction has z = -0.8; need z > 0"));
  EXPECT_THAT(MessageWith("/lights/1/position_mm", {0, 0, -5}),
              HasSubstr("lights[1]: position_mm"));
}

TEST(ReadRig, NumbersThatNoRigHasAreNamed) {
  EXPECT_THAT(MessageWith("/camera/k", {1e15, 1e15, 320, 240}),
              HasSubstr("camera.k: fx or fy is 1e+15; need 0.1 to 1e+08 px"));
  EXPECT_THAT(MessageWith("/camera/distortion", {0, 0, 1.5, 0, 0}),
              HasSubstr("camera.distortion: p1 or p2 is 1.5; need -1 to 1"));
  EXPECT_THAT(MessageWith("/lights/1/position_mm", {0, 1e8, 5}),
              HasSubstr("lights[1]: position_mm: x or y is 1e+08; need -1e+07 to 1e+07 mm"));
  EXPECT_THAT(MessageWith("/lights/1/flux_rgb", {1e30, 1e30, 1e30}),
              HasSubstr("lights[1]: flux_rgb is"));
  EXPECT_THAT(MessageWith("/lights/1/flux_rgb", {1e-40, 1, 1}), HasSubstr("flux_rgb"));
  EXPECT_THAT(MessageWith("/response/gain_dn_per_electron", 1e30),
              HasSubstr("response.gain_dn_per_electron is 1e+30; need 1e-09 to 1e+09"));
  EXPECT_THAT(MessageWith("/lights/0/channel", 65536), HasSubstr("channel is 65536; need 0 to"));
}

TEST(ReadRig, OnlyTheKeysOfTheModelAreAllowed) {
  EXPECT_EQ(MessageWith("/lights/0/position_mm", {0, 0, 1}),
            "rig.json: lights[0].position_mm is not known here; the keys are channel, direction, "
            "direction_sd_deg, flux_rgb, irradiance_sd, model, name");
  EXPECT_THAT(MessageWith("/lights/1/axis", {0, 0, -1}), HasSubstr("lights[1].axis is not known"));
  EXPECT_THAT(MessageWith("/lights/2/direction", {0, 0, 1}), HasSubstr("lights[2].direction is"));
  EXPECT_THAT(MessageWith("/lights/0/model", "spot"),
              HasSubstr("lights[0].model is \"spot\"; need \"distant\", \"near\", \"led\" or "
                        "\"led+field\""));
}

TEST(ReadRig, AFieldIsOfItsModelAloneAndChecked) {
  EXPECT_THAT(MessageWith("/lights/2/field", {{"grid", {1, 1}}}),
              StartsWith("rig.json: lights[2].field"));  // not of the light's model
  EXPECT_THAT(MessageWith("/lights/3/field/spacing_mm", -1), HasSubstr("spacing_mm is -1; need"));
  EXPECT_THAT(MessageWith("/lights/3/field/columns", 2000000000), HasSubstr("lights[3].field"));
  EXPECT_THAT(MessageWith("/lights/3/field/gain/7", 0), HasSubstr("a gain is 0; need above 0"));
  EXPECT_THAT(MessageWith("/lights/3/field/unit", "mm"), HasSubstr("lights[3].field.unit"));
  EXPECT_THAT(MessageWithout("/lights/3/field"), HasSubstr("lights[3].field"));
}

TEST(ReadRig, UnknownKeysAreErrorsAtEveryLevel) {
  EXPECT_THAT(MessageWith("/lamps", 1), StartsWith("rig.json: lamps is not known here"));
  EXPECT_THAT(MessageWith("/camera/iso", 1), StartsWith("rig.json: camera.iso is not known here"));
  EXPECT_THAT(MessageWith("/response/gamma", 1), StartsWith("rig.json: response.gamma is not"));
  EXPECT_THAT(MessageWith("/calibration/anything", 1), IsEmpty());
}

TEST(ReadRig, MissingKeysAreNamed) {
  for (const char* pointer :
       {"/camera/model", "/camera/size_px", "/camera/k", "/camera/distortion", "/response/black",
        "/response/white", "/response/white_balance", "/lights/0/name", "/lights/0/channel",
        "/lights/0/model", "/lights/0/direction", "/lights/1/position_mm", "/lights/2/axis",
        "/lights/2/anisotropy", "/lights/2/flux_rgb"}) {
    const std::string key = std::filesystem::path(pointer).filename();
    EXPECT_THAT(MessageWithout(pointer), HasSubstr("." + key + " is missing; need")) << pointer;
  }
  EXPECT_THAT(MessageWithout("/lights"), HasSubstr("rig.json: lights is missing"));
  EXPECT_THAT(MessageWithout("/response/read_noise_dn"), IsEmpty());
  EXPECT_THAT(MessageWithout("/response/gain_dn_per_electron"), IsEmpty());
}

TEST(ReadRig, CameraIsNeededUnlessAllLightsAreDistant) {
  EXPECT_THAT(MessageWithout("/camera"), HasSubstr("camera is missing, but lights[1] is \"near\""));
}

// `calibrate lens` writes such a rig without one to begin from, and `calibrate pose` completes it.
TEST(ReadRig, ACameraIsEnoughAndItsPoseMayCome) {
  Json json = FullRig();
  json["lights"] = Json::array();
  ASSERT_TRUE(Read(json.dump()).value().RequirePose("a.json"));
  json["camera"].erase("table_from_camera");
  const Rig rig = Read(json.dump()).value();
  EXPECT_FALSE(rig.camera->has_pose);
  EXPECT_THAT(rig.RequirePose("a.json").error().message,
              HasSubstr("a.json: the rig's camera has a lens but no pose yet"));
  EXPECT_THAT(Rig().RequirePose("a.json").error().message, HasSubstr("the rig has no camera"));
  EXPECT_EQ(RigToJson(Read(RigToJson(rig)).value()), RigToJson(rig));

  EXPECT_THAT(MessageWithout("/camera/table_from_camera"),
              HasSubstr("no table_from_camera, but lights[1] is \"near\""));
  json.erase("camera");
  EXPECT_THAT(Read(json.dump()).error().message,
              HasSubstr("lights is empty; need at least one light, or a camera"));
}

TEST(ReadRig, ValuesOutOfRangeAreNamed) {
  EXPECT_THAT(MessageWith("/camera/size_px", {6000.5, 4000}),
              HasSubstr("camera.size_px is [6000.5, 4000]; need two whole numbers"));
  EXPECT_THAT(MessageWith("/camera/size_px", {1e300, 4000}), HasSubstr("camera.size_px"));
  EXPECT_THAT(MessageWith("/camera/table_from_camera/0", 2),
              HasSubstr("rig.json: camera.table_from_camera: the rotation"));
  EXPECT_THAT(MessageWith("/response/black", 20000), HasSubstr("need 0 <= black < white"));
  EXPECT_THAT(MessageWith("/response/white_balance", {1, 0, 1}),
              HasSubstr("white_balance is [1, 0"));
  EXPECT_THAT(MessageWith("/response/read_noise_dn", -1), HasSubstr("read_noise_dn is -1"));
  EXPECT_THAT(MessageWith("/response/gain_dn_per_electron", 0), HasSubstr("electron is 0"));
  EXPECT_THAT(MessageWith("/lights/1/channel", -1), HasSubstr("lights[1]: channel is -1"));
  EXPECT_THAT(MessageWith("/lights/1/name", "a"), HasSubstr("the name \"a\" is taken"));
  EXPECT_THAT(MessageWith("/lights/1/name", ""), HasSubstr("lights[1].name is \"\"; need a name"));
  EXPECT_THAT(MessageWith("/calibration", 3), HasSubstr("calibration is 3; need an object"));
}

TEST(ReadRig, OtherFilesAreRefused) {
  EXPECT_THAT(MessageWith("/schema", "sateen.session/1"), HasSubstr("need \"sateen.rig/1\""));
  EXPECT_THAT(MessageWith("/schema", "sateen.rig/2"), HasSubstr("sateen.rig/2"));
  EXPECT_EQ(ReadRig("/nowhere/rig.json").error().code, ErrorCode::kIo);
}

// Light at a point of space, told from two table planes.
TEST(Lifted, RigGivesEveryPointTheSameLightAndEveryPixelTheSameRay) {
  const Rig rig = Read(FullRig().dump()).value();
  constexpr double kHeightMm = 12.5;
  const Rig lifted = Lifted(rig, kHeightMm).value();

  for (const Eigen::Vector3d& x :
       {Eigen::Vector3d(3.0, 4.0, 12.5), Eigen::Vector3d(-60.0, 20.0, 0.0),
        Eigen::Vector3d(40.0, -70.0, 31.0)}) {
    const Eigen::Vector3d from_lifted = x - Eigen::Vector3d(0.0, 0.0, kHeightMm);
    for (size_t k = 0; k < rig.lights.size(); ++k) {
      const Incident expected = IncidentAt(rig.lights[k], x);
      const Incident found = IncidentAt(lifted.lights[k], from_lifted);
      EXPECT_LT((found.l - expected.l).norm(), 1e-14) << rig.lights[k].name;
      EXPECT_LT((found.e_rgb - expected.e_rgb).norm(), 1e-12 * expected.e_rgb.norm())
          << rig.lights[k].name;
    }
  }
  const Eigen::Vector3d expected = TablePointOfPixel(*rig.camera, 100.0, 3000.0, kHeightMm).value();
  const Eigen::Vector3d found = TablePointOfPixel(*lifted.camera, 100.0, 3000.0).value();
  EXPECT_LT((found + Eigen::Vector3d(0.0, 0.0, kHeightMm) - expected).norm(), 1e-9);
}

TEST(Lifted, RefusesASurfaceThatIsNotBelowLightsAndCamera) {
  const Rig rig = Read(FullRig().dump()).value();
  EXPECT_THAT(Lifted(rig, 350.25).error().message,
              HasSubstr("the surface is at 350.25 mm, but lights[2] is at 350 mm"));
  EXPECT_THAT(Lifted(rig, 500.0).error().message, HasSubstr("but the camera is at 500 mm"));
  EXPECT_THAT(Lifted(rig, std::nan("")).error().message, HasSubstr("need a number"));
}

}  // namespace
}  // namespace sateen::rig_test
