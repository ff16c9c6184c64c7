#include "scanner/sessions/session.h"

#include <nlohmann/json.hpp>

#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::session_test {
namespace {

using testing::FourLightSession;
using testing::IsError;
using testing::TempFolder;
using testing::WriteText;
using Json = nlohmann::json;

Result<Session> ReadText(const std::string& text) {
  const TempFolder temp;
  WriteText(temp.Path() / "session.json", text);
  return ReadSession(temp.Path());
}

Session FullSession() {
  Session session = FourLightSession();
  session.kind = SessionKind::kSheet;
  session.rig_sha256 = std::string(64, 'a');
  session.mask = "mask.png";
  session.table_from_sheet =
      Eigen::Translation3d(1, 2, 3.5) * Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 2) / 3.0);
  for (SessionFrame& frame : session.frames) {
    frame.sha256 = std::string(64, '0');
    frame.exposure_s = 0.0125;
    frame.f_number = 5.6;
    frame.iso = 200;
  }
  session.frames[1].shift_px = Eigen::Vector2d(0.31, -0.125);
  return session;
}

// The error of a full session in which `change` was made.
template <typename Change>
Error FailureAfter(const Change& change) {
  Json json = Json::parse(SessionToJson(FullSession()));
  change(json);
  const Result<Session> session = ReadText(json.dump());
  EXPECT_FALSE(session) << json.dump();
  return session ? Error{} : session.error();
}

TEST(Session, ComesBackAsItWasWritten) {
  const Session written = FullSession();
  const Result<Session> read = ReadText(SessionToJson(written));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(SessionToJson(*read), SessionToJson(written));
  EXPECT_EQ(read->kind, SessionKind::kSheet);
  EXPECT_EQ(read->rig, "../rig.json");
  EXPECT_EQ(read->mask, "mask.png");
  EXPECT_EQ(read->table_from_sheet->matrix(), written.table_from_sheet->matrix());
  ASSERT_EQ(read->frames.size(), 5U);
  EXPECT_EQ(read->frames[1].light, "west");
  EXPECT_EQ(read->frames[1].file, "frames/west.exr");
  EXPECT_EQ(read->frames[1].shift_px, Eigen::Vector2d(0.31, -0.125));
  EXPECT_FALSE(read->frames[0].shift_px);
  EXPECT_EQ(read->frames[4].role, FrameRole::kDark);
  EXPECT_EQ(read->frames[4].f_number, 5.6);
}

TEST(Session, ComesBackWithoutItsOptionalParts) {
  const Result<Session> read = ReadText(SessionToJson(FourLightSession()));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(SessionToJson(*read), SessionToJson(FourLightSession()));
  EXPECT_FALSE(read->table_from_sheet || read->mask || read->rig_sha256);
  EXPECT_FALSE(read->frames[0].exposure_s || read->frames[0].sha256);
}

TEST(Session, TransformIsWrittenByRows) {
  Session session = FourLightSession();
  session.table_from_sheet = Eigen::Translation3d(1, 2, 3) * Eigen::Isometry3d::Identity();
  const Json json = Json::parse(SessionToJson(session));
  EXPECT_EQ(json["table_from_sheet"], Json({1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1}));
}

TEST(Session, AFileNameThatIsNotUtf8DoesNotEndTheRun) {
  Session session = FourLightSession();
  session.frames[0].file = "\xFF.exr";
  EXPECT_THAT(SessionToJson(session), ::testing::HasSubstr(".exr"));
}

TEST(Session, EveryKindHasItsName) {
  for (const SessionKind kind :
       {SessionKind::kFabric, SessionKind::kSheet, SessionKind::kChart, SessionKind::kBoard}) {
    Session session = FourLightSession();
    session.kind = kind;
    EXPECT_EQ(ReadText(SessionToJson(session)).value().kind, kind);
  }
}

TEST(SessionFrame, ExposureFollowsTimeSensitivityAndAperture) {
  EXPECT_EQ(SessionFrame{}.Exposure(), 1.0);
  SessionFrame frame;
  frame.exposure_s = 0.5;
  EXPECT_EQ(frame.Exposure(), 0.5);
  frame.iso = 400;
  EXPECT_EQ(frame.Exposure(), 2.0);
  frame.f_number = 4;
  EXPECT_EQ(frame.Exposure(), 0.125);
}

TEST(Session, RefusesEachKeyThatIsWrong) {
  const auto expect = [](const auto& change, const std::string& part) {
    EXPECT_THAT(FailureAfter(change), IsError(ErrorCode::kBadData, part));
  };
  expect([](Json& j) { j["kind"] = "wool"; },
         "kind is \"wool\"; need one of fabric, sheet, chart, board");
  expect([](Json& j) { j.erase("rig"); }, "rig is missing");
  expect([](Json& j) { j["rig"] = ""; }, "rig is empty");
  expect([](Json& j) { j["rig_sha256"] = "ABC"; }, "rig_sha256 is not a SHA-256");
  expect([](Json& j) { j["frames"] = Json::array(); }, "frames is empty");
  expect([](Json& j) { j["colour"] = 1; }, "colour is not known");
  expect([](Json& j) { j["schema"] = "sateen.session/2"; }, "sateen.session/2");
  expect([](Json& j) { j["table_from_sheet"][0] = 2; }, "table_from_sheet is not a rigid motion");
  expect([](Json& j) { j["table_from_sheet"][15] = 2; }, "table_from_sheet is not a rigid motion");
  expect([](Json& j) { j["table_from_sheet"][3] = 1e30; }, "table_from_sheet moves by 1e+30 mm");
  expect([](Json& j) { j["table_from_sheet"] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; },
         "table_from_sheet is not a rigid motion");  // a mirror
}

TEST(Session, RefusesEachKeyOfAFrameThatIsWrong) {
  const auto expect = [](const auto& change, const std::string& part) {
    EXPECT_THAT(FailureAfter([&](Json& j) { change(j["frames"][2]); }),
                IsError(ErrorCode::kBadData, "frames[2]." + part));
  };
  expect([](Json& f) { f["role"] = "dim"; }, "role is \"dim\"; need one of lit, dark, repeat");
  expect([](Json& f) { f.erase("light"); }, "light is missing");
  expect([](Json& f) { f["light"] = ""; }, "light is empty");
  expect([](Json& f) { f["role"] = "dark"; }, "light is not known");  // a dark frame has no light
  expect([](Json& f) { f["role"] = "repeat", f.erase("light"); }, "light is missing");
  expect([](Json& f) { f["file"] = ""; }, "file is empty");
  expect([](Json& f) { f["sha256"] = std::string(64, 'g'); }, "sha256 is not a SHA-256");
  expect([](Json& f) { f["exposure_s"] = 0; }, "exposure_s is 0; need more than 0");
  expect([](Json& f) { f["f_number"] = -2; }, "f_number is -2; need more than 0");
  expect([](Json& f) { f["iso"] = 1e9; }, "iso is 1000000000");
  expect([](Json& f) { f["shift_px"] = {1, 101}; }, "shift_px is [1, 101]; need at most 100");
  expect([](Json& f) { f["shift_px"] = {1}; }, "shift_px");
  expect([](Json& f) { f["gain"] = 1; }, "gain is not known");
}

TEST(Session, RefusesAFactorThatOnlySomeFramesHave) {
  for (const char* key : {"exposure_s", "f_number", "iso"}) {
    EXPECT_THAT(FailureAfter([&](Json& j) { j["frames"][4].erase(key); }),
                IsError(ErrorCode::kBadData, fmt::format("frames[0] has {} but frames[4]", key)));
  }
}

TEST(Session, SaysThatACaptureWasNotCompleted) {
  const TempFolder temp;
  WriteText(temp.Path() / "journal.jsonl", "{}\n");
  const Result<Session> session = ReadSession(temp.Path());
  ASSERT_FALSE(session);
  EXPECT_THAT(session.error(), IsError(ErrorCode::kBadData, "the capture was not completed"));
  EXPECT_THAT(testing::FailureOf(temp.Path()),
              IsError(ErrorCode::kBadData, "the capture was not completed"));
}

TEST(Session, SaysThatItIsAbsent) {
  const TempFolder temp;
  const Result<Session> session = ReadSession(temp.Path());
  ASSERT_FALSE(session);
  EXPECT_THAT(session.error(), IsError(ErrorCode::kIo, "session.json"));
}

}  // namespace
}  // namespace sateen::session_test
