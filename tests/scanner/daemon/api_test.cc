#include "scanner/daemon/api.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "imaging/dng.h"
#include "scanner/daemon/api_json.h"
#include "scanner/daemon/device_list.h"
#include "simulation/rigs.h"
#include "tests/scanner/daemon/daemon_fakes.h"
#include "tests/testing/files.h"

namespace sateen::api_test {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using testing::FakeDaemon;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kLong;

// A rig for one preview, whose camera delivers a frame when it is let.
class PreviewRig {
 public:
  std::unique_ptr<RigDevices> Devices() {
    return std::make_unique<RigDevices>(std::make_unique<Port>(*this),
                                        std::make_unique<Camera>(*this));
  }
  [[nodiscard]] bool Exposes() const { return exposes_; }
  void LetDeliver() { may_deliver_ = true; }
  // Waits until the job has made its picture and only its end is missing.
  void AwaitPicture() const {
    while (!finished_) {
      std::this_thread::yield();
    }
  }

 private:
  class Camera : public testing::FakeCamera {
   public:
    explicit Camera(PreviewRig& rig) : rig_(rig) {}
    Result<CapturedFile> Capture(const std::filesystem::path& folder,
                                 milliseconds /*deadline*/) override {
      rig_.exposes_ = true;
      while (!rig_.may_deliver_) {
        std::this_thread::yield();
      }
      const std::filesystem::path path = folder / "frame.dng";
      EXPECT_TRUE(WriteDng(path, Image<uint16_t>(96, 64, 20'000), {}));
      rig_.frame_ = path;
      rig_.delivered_ = true;
      return CapturedFile{.path = path, .name_on_camera = "frame.dng"};
    }

   private:
    PreviewRig& rig_;
  };
  // The first command after the frame has been removed turns the lights off after the job.
  class Port : public testing::FakePort {
   public:
    explicit Port(PreviewRig& rig) : FakePort(rig.board_), rig_(rig) {}
    [[nodiscard]] Status Write(std::span<const std::uint8_t> bytes) override {
      if (rig_.delivered_ && !std::filesystem::exists(rig_.frame_)) {
        rig_.finished_ = true;
      }
      return FakePort::Write(bytes);
    }

   private:
    PreviewRig& rig_;
  };

  testing::FakeBoard board_;
  std::filesystem::path frame_;  // read once `delivered_` is set
  std::atomic<bool> exposes_ = false;
  std::atomic<bool> may_deliver_ = false;
  std::atomic<bool> delivered_ = false;
  std::atomic<bool> finished_ = false;
};

json Body(const ApiResponse& response) { return json::parse(response.body); }

std::string Message(const ApiResponse& response) {
  return Body(response)["error"]["message"].get<std::string>();
}

TEST(Api, StateTellsBoardJobAndLights) {
  FakeDaemon daemon;
  json state = Body(daemon.Ask("GET", "/v1/state"));
  EXPECT_EQ(state["schema"], "sateen.state/1");
  EXPECT_EQ(state["version"], "1.2.3");
  EXPECT_TRUE(state["job"].is_null());
  EXPECT_EQ(state["lights"]["lit"], json::array());

  const std::uint64_t id = daemon.TurnOn(3, "alice");
  state = Body(daemon.Ask("GET", "/v1/state"));
  EXPECT_EQ(state["job"]["id"], id);
  EXPECT_EQ(state["job"]["owner"], "alice");
  EXPECT_EQ(state["lights"]["lit"], json::array({3}));

  daemon.service.Cancel(id, "a test");
  daemon.service.WaitIdle(kLong);
  state = Body(daemon.Ask("GET", "/v1/state"));
  EXPECT_TRUE(state["job"].is_null());
  EXPECT_EQ(state["last_job"]["error"]["code"], "cancelled");
  EXPECT_EQ(state["board"]["firmware"], "fakefake");
  EXPECT_EQ(state["lights"]["lit"], json::array());
}

TEST(Api, ALightIsAJobOfItsOwn) {
  FakeDaemon daemon;
  daemon.rig.held = false;
  const ApiResponse begun = daemon.Ask("POST", "/v1/lights/5",
                                       R"({"level": 0.25, "for_ms": 700, "client": "photo desk"})");
  ASSERT_EQ(begun.status, 202) << begun.body;
  daemon.service.WaitIdle(kLong);
  const json job =
      Body(daemon.Ask("GET", fmt::format("/v1/jobs/{}", Body(begun)["id"].get<std::uint64_t>())));
  EXPECT_EQ(job["state"], "done") << job;
  EXPECT_EQ(job["owner"], "photo desk (a test)");
  ASSERT_EQ(daemon.rig.board.lights_set.size(), 1U);
  EXPECT_EQ(daemon.rig.board.lights_set[0].channel, 5);
  EXPECT_EQ(daemon.rig.board.lights_set[0].level_permille, 250);
  EXPECT_EQ(daemon.rig.board.lights_set[0].on_ms, 700);
  EXPECT_THAT(daemon.rig.board.lit, IsEmpty());
}

TEST(Api, BusyIs409WithWhoAndSinceWhen) {
  FakeDaemon daemon;
  const std::uint64_t id = daemon.TurnOn(3, "alice");
  for (const auto& [method, path, body] : std::vector<std::array<std::string, 3>>{
           {"POST", "/v1/lights/4", "{}"},
           {"POST", "/v1/jobs", R"({"kind":"capture","rig":"/r.json","output":"/s"})"},
           {"GET", "/v1/devices", ""},
           {"GET", "/v1/board", ""},
           {"POST", "/v1/board", "{}"}}) {
    const ApiResponse busy = daemon.Ask(method, path, body);
    EXPECT_EQ(busy.status, 409) << path;
    EXPECT_EQ(Body(busy)["error"]["code"], "device");
    EXPECT_EQ(Body(busy)["error"]["job"]["owner"], "alice");
    EXPECT_EQ(Body(busy)["error"]["job"]["id"], id);
    EXPECT_THAT(Message(busy), HasSubstr("by alice since "));
  }
}

TEST(Api, DeletingAJobCancelsIt) {
  FakeDaemon daemon;
  daemon.TurnOn(3);
  EXPECT_EQ(daemon.Ask("DELETE", "/v1/jobs/1", "", "bob").status, 202);
  daemon.service.WaitIdle(kLong);
  EXPECT_THAT(daemon.rig.board.lit, IsEmpty());
  const ApiResponse again = daemon.Ask("DELETE", "/v1/jobs/1");
  EXPECT_EQ(again.status, 200);
  EXPECT_THAT(Message(again), HasSubstr("cancelled by bob"));
}

TEST(Api, LightsOffIsAlwaysAllowedAndCancels) {
  FakeDaemon daemon;
  daemon.TurnOn(3);
  const ApiResponse off = daemon.Ask("POST", "/v1/lights/off", "", "bob");
  EXPECT_EQ(off.status, 200) << off.body;
  EXPECT_THAT(daemon.rig.board.lit, IsEmpty());
  EXPECT_EQ(daemon.service.Find(1)->error->code, ErrorCode::kCancelled);
  EXPECT_EQ(daemon.Ask("POST", "/v1/lights/off").status, 200);  // and when none runs
}

TEST(Api, AJobThatDoesNotHearIsToldOfInLightsOff) {
  FakeDaemon daemon;
  const Api hasty(daemon.service, {.off_wait = milliseconds(1)});
  std::atomic<bool> go = false;
  ASSERT_TRUE(daemon.service.Begin(testing::WorkJob([&](JobContext&) -> Result<std::string> {
    while (!go) {
      std::this_thread::yield();
    }
    return "{}";
  })));
  const ApiResponse off = hasty.Handle({.method = "POST", .path = "/v1/lights/off"});
  EXPECT_EQ(off.status, 202);
  EXPECT_EQ(Body(off)["state"], "running");
  go = true;
}

TEST(Api, BoardIsAskedAndChanged) {
  FakeDaemon daemon;
  const Result<BoardWord> word = BoardFromJson(daemon.Ask("GET", "/v1/board").body);
  ASSERT_TRUE(word) << word.error().message;
  EXPECT_EQ(word->info.build_id, "fakefake");
  EXPECT_EQ(word->info.lights.size(), 14U);
  EXPECT_EQ(word->info.lights[3].max_on, milliseconds(10000));
  EXPECT_EQ(word->report.state.armed, -1);
  EXPECT_GT(word->report.frames, 0U);
  const ApiResponse changed = daemon.Ask(
      "POST", "/v1/board",
      BoardChangeToJson({.channel = 3, .max_on = milliseconds(20000), .max_lit = 2}, "bob"));
  EXPECT_EQ(changed.status, 200) << changed.body;
  EXPECT_EQ(daemon.rig.board.executed[SATEEN_LIMIT_LIGHT], 1);
  EXPECT_EQ(daemon.rig.board.executed[SATEEN_CONFIGURE], 1);
  EXPECT_EQ(BoardFromJson(changed.body)->info.settings.max_lit, 2);
}

TEST(Api, AChannelThatTheBoardHasNotChangesNothing) {
  FakeDaemon daemon;
  for (const int channel : {-1, 14, 99}) {
    for (const BoardChange& change :
         {BoardChange{.channel = channel},
          BoardChange{.clear_fault = true, .channel = channel, .max_level = 0.5},
          BoardChange{.channel = channel, .max_on = milliseconds(100), .max_lit = 2}}) {
      const ApiResponse refused = daemon.Ask("POST", "/v1/board", BoardChangeToJson(change, "bob"));
      EXPECT_EQ(refused.status, 400) << refused.body;
      EXPECT_THAT(Message(refused), HasSubstr("the board has lights 0 to 13"));
    }
  }
  EXPECT_EQ(daemon.Ask("POST", "/v1/board", R"({"channel":13})").status, 200);
  EXPECT_EQ(daemon.rig.board.executed[SATEEN_LIMIT_LIGHT], 0);
  EXPECT_EQ(daemon.rig.board.executed[SATEEN_CONFIGURE], 0);
  EXPECT_EQ(daemon.rig.board.executed[SATEEN_CLEAR_FAULT], 0);
}

// The board's own time-out turns them off; who asks is told so at once, and not after the 3 s for
// which the daemon waits for the port.
TEST(Api, LightsOffWithTheBoardUnpluggedSaysSoBeforeThePortIsWaitedFor) {
  FakeDaemon daemon;
  const std::uint64_t light =
      *daemon.service.Begin(testing::WorkJob([&](JobContext& job) -> Result<std::string> {
        EXPECT_TRUE((*job.Devices().Board())->SetLight(3, 0.5, std::chrono::seconds(10)));
        daemon.rig.board.Unplug();  // the port's clock stands still: it is waited for without end
        while (!job.GetTask().Cancelled()) {
          std::this_thread::yield();
        }
        return Fail(ErrorCode::kDevice, "lost");
      }));
  for (int k = 0; k < 2; ++k) {
    const ApiResponse off = daemon.Ask("POST", "/v1/lights/off");
    EXPECT_EQ(off.status, 503) << off.body;
    EXPECT_THAT(Message(off), HasSubstr("it turns them off by itself"));
    EXPECT_EQ(daemon.service.Find(light)->state, JobState::kRunning);
  }
  EXPECT_THAT(daemon.service.State().lights_fault, HasSubstr("did not confirm"));
  daemon.rig.held = false;
  ASSERT_TRUE(daemon.service.WaitIdle(testing::kLong));
  // Also where it was lost before.
  daemon.rig.held = true;
  EXPECT_EQ(daemon.Ask("POST", "/v1/lights/off").status, 503);
  daemon.rig.held = false;
  ASSERT_TRUE(daemon.service.WaitIdle(testing::kLong));
  daemon.rig.board.Replug();
  daemon.rig.board.plugged = true;
  EXPECT_EQ(daemon.Ask("POST", "/v1/lights/off").status, 200);
  EXPECT_EQ(daemon.service.State().lights_fault, "");
}

TEST(Api, DevicesAreTheDaemonsOwn) {
  FakeDaemon daemon;
  const ApiResponse answer = daemon.Ask("GET", "/v1/devices");
  const Result<std::vector<DeviceReply>> devices = DevicesFromJson(answer.body);
  ASSERT_TRUE(devices) << answer.body;
  const auto board = std::ranges::find(*devices, "fake", &DeviceReply::port);
  ASSERT_NE(board, devices->end());
  EXPECT_TRUE(board->answers);
  EXPECT_EQ(board->lights, 14);
  const auto camera = std::ranges::find(*devices, "fake:", &DeviceReply::port);
  ASSERT_NE(camera, devices->end());
  EXPECT_TRUE(camera->is_camera && camera->answers);
  EXPECT_EQ(camera->model, "fake camera");
  EXPECT_EQ(Body(daemon.Ask("GET", "/v1/state"))["camera"]["model"], "fake camera");
}

TEST(Api, DevicesTellWhatIsMissing) {
  FakeDaemon daemon;
  daemon.rig.board.plugged = false;
  const Result<std::vector<DeviceReply>> devices =
      DevicesFromJson(daemon.Ask("GET", "/v1/devices").body);
  ASSERT_TRUE(devices) << devices.error().message;
  EXPECT_TRUE(std::ranges::any_of(*devices, [](const DeviceReply& device) {
    return !device.is_camera && device.what == "fake: not there";
  }));
}

TEST(ApiJson, DevicesSurviveThereAndBack) {
  const std::vector<DeviceReply> devices = {
      {.port = "/dev/ttyACM0",
       .usb = "2341:0043",
       .description = "Arduino Uno",
       .serial = "7",
       .answers = true,
       .what = "LED board",
       .firmware = "1a2b",
       .protocol = "1.0",
       .lights = 14},
      {.port = "/dev/ttyS0", .what = "not asked"},
      {.port = "usb:001,004", .is_camera = true, .answers = true, .model = "D5100"}};
  const std::string text = DevicesJson(devices, -1);
  const Result<std::vector<DeviceReply>> back = DevicesFromJson(text);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(DevicesJson(*back, -1), text);
  EXPECT_EQ(back->at(0).usb, "2341:0043");
}

TEST(Api, AMissingBoardIs503WithItsMessage) {
  FakeDaemon daemon;
  daemon.rig.board.plugged = false;
  const ApiResponse answer = daemon.Ask("GET", "/v1/board");
  EXPECT_EQ(answer.status, 503);
  EXPECT_EQ(ErrorFromJson(answer.body).code, ErrorCode::kDevice);
  EXPECT_THAT(Message(answer), HasSubstr("not there"));
}

TEST(Api, UnknownPathsAndMethodsAreRefused) {
  FakeDaemon daemon;
  for (const std::string path :
       {"", "/", "/v1", "/v2/state", "/v1/state/", "/v1/jobs/", "/v1/jobs/1/events/x",
        "/v1/jobs//events", "/v1/jobs/9", "/v1/jobs/-1", "/v1/jobs/99999999999999999999"}) {
    EXPECT_EQ(daemon.Ask("GET", path).status, 404) << path;
  }
  EXPECT_EQ(daemon.Ask("POST", "/v1/lights/x").status, 404);
  EXPECT_EQ(daemon.Ask("POST", "/v1/lights/3x").status, 404);
  EXPECT_EQ(daemon.Ask("GET", "/v1/jobs/9/events").status, 404);
  EXPECT_EQ(daemon.Ask("DELETE", "/v1/jobs/9").status, 404);
  const ApiResponse wrong = daemon.Ask("PUT", "/v1/jobs");
  EXPECT_EQ(wrong.status, 405);
  EXPECT_EQ(wrong.allow, "GET, POST");
  EXPECT_EQ(daemon.Ask("POST", "/v1/state").allow, "GET");
  EXPECT_EQ(daemon.Ask("GET", "/v1/lights/off").allow, "POST");
}

TEST(Api, WrongBodiesAre400AndNameTheKey) {
  FakeDaemon daemon;
  const auto capture = [](const std::string& more) {
    return R"({"kind":"capture","rig":"/r.json","output":"/s")" + more + "}";
  };
  for (const auto& [path, body, says] : std::vector<std::array<std::string, 3>>{
           {"/v1/jobs", "", "kind"},
           {"/v1/jobs", "{", "request"},
           {"/v1/jobs", "[]", "array"},
           {"/v1/jobs", R"({"kind":"weave"})", "weave"},
           {"/v1/jobs", R"({"kind":"solve"})", "capture"},
           {"/v1/jobs", R"({"kind":"capture","rig":"/r.json"})", "output"},
           {"/v1/jobs", R"({"kind":"capture","output":"/s"})", "rig"},
           {"/v1/jobs", R"({"kind":"capture","rig":"r.json","output":"/s"})", "absolute"},
           {"/v1/jobs", capture(R"(,"resume":true)"), "rig"},
           {"/v1/jobs", capture(R"(,"exposure":1)"), "exposure"},
           {"/v1/jobs", capture(R"(,"exposure_s":"1")"), "exposure_s"},
           {"/v1/jobs", capture(R"(,"exposure_s":-1)"), "exposure_s"},
           {"/v1/jobs", capture(R"(,"session_kind":"cat")"), "session_kind"},
           {"/v1/jobs", capture(R"(,"settle_ms":-1)"), "settle_ms"},
           {"/v1/jobs", capture(R"(,"checks":{"max_cats":1})"), "max_cats"},
           {"/v1/jobs", capture(R"(,"level":0.5,"level":0.5)"), "level"},
           {"/v1/lights/3", R"({"level":1.5})", "level"},
           {"/v1/lights/3", R"({"for_ms":0})", "for_ms"},
           {"/v1/lights/3", R"({"client":"a\nb"})", "client"},
           {"/v1/board", R"({"max_lit":"two"})", "max_lit"}}) {
    const ApiResponse refused = daemon.Ask("POST", path, body);
    EXPECT_EQ(refused.status, 400) << path << " " << body << " " << refused.body;
    EXPECT_EQ(Body(refused)["error"]["code"], "invalid-argument");
    EXPECT_THAT(Message(refused), HasSubstr(says)) << body;
  }
  EXPECT_TRUE(daemon.service.Jobs().empty());
}

// In the words of the command line, and without a job.
TEST(Api, AJobThatCannotBeginIsRefusedAtOnce) {
  const testing::TempFolder folder;
  const std::string dir = folder.Path().string();
  testing::WriteText(folder.Path() / "bad.json", "{}");
  testing::WriteText(folder.Path() / "rig.json", RigToJson(RingRig({96, 64}, LightModel::kLed)));
  std::filesystem::create_directory(folder.Path() / "full");
  testing::WriteText(folder.Path() / "full" / "session.json", "{}");
  FakeDaemon daemon;
  EXPECT_EQ(daemon.Ask("GET", "/v1/board").status, 200);
  const std::size_t jobs = daemon.service.Jobs().size();
  const auto capture = [&](const std::string& rig, const std::string& output) {
    return fmt::format(R"({{"kind":"capture","rig":"{0}/{1}","output":"{0}/{2}"}})", dir, rig,
                       output);
  };
  for (const auto& [path, body, status, says] :
       std::vector<std::tuple<std::string, std::string, int, std::string>>{
           {"/v1/jobs", capture("none.json", "s"), 422, "none.json"},
           {"/v1/jobs", capture("bad.json", "s"), 422, "bad.json"},
           {"/v1/jobs", capture("rig.json", "full"), 400, "holds a session already"},
           {"/v1/jobs", R"({"kind":"capture","resume":true,"output":")" + dir + R"("})", 422,
            "nothing was captured"},
           {"/v1/jobs", R"({"kind":"preview","light":3})", 400, "output"},
           {"/v1/preview", R"({"rig":")" + dir + R"(/none.json"})", 422, "none.json"},
           {"/v1/preview", R"({"light":"led-3"})", 422, "led-3"},
           {"/v1/preview", R"({"output":"/tmp/look.png"})", 400, ".jpg"},
           {"/v1/lights/14", "{}", 400, "the board has lights 0 to 13"}}) {
    const ApiResponse refused = daemon.Ask("POST", path, body);
    EXPECT_EQ(refused.status, status) << body << refused.body;
    EXPECT_THAT(Message(refused), HasSubstr(says)) << body;
  }
  EXPECT_EQ(daemon.service.Jobs().size(), jobs);
}

// Also the first light of all: the board is asked how many it has.
TEST(Api, ALightThatTheBoardHasNotIsRefusedByAnIdleDaemon) {
  FakeDaemon daemon;
  EXPECT_EQ(daemon.Ask("POST", "/v1/lights/14").status, 400);
  EXPECT_TRUE(daemon.rig.board.lights_set.empty());
}

TEST(Api, APreviewIsThePicture) {
  PreviewRig rig;
  RigService service(rig.Devices());
  const Api api(service, {});
  rig.LetDeliver();
  const ApiResponse answer =
      api.Handle({.method = "POST", .path = "/v1/preview", .body = R"({"exposure_s": 0.02})"});
  EXPECT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(answer.content_type, "image/jpeg");
  EXPECT_THAT(answer.body, ::testing::StartsWith("\xff\xd8"));
}

// The client leaves when the picture is there and its job has not ended: it may still be written.
TEST(Api, ThePictureOfAJobThatRunsIsNotTouched) {
  PreviewRig rig;
  RigService service(rig.Devices());
  const Api api(service, {});
  const auto client_left = [&] {
    if (rig.Exposes()) {
      rig.LetDeliver();
      rig.AwaitPicture();
    }
    return rig.Exposes();
  };
  const ApiResponse answer = api.Handle({.method = "POST",
                                         .path = "/v1/preview",
                                         .body = R"({"exposure_s": 0.02})",
                                         .client_left = client_left});
  EXPECT_EQ(answer.content_type, "application/json");
  EXPECT_EQ(answer.body, "");
}

TEST(Api, ADryRunTellsWhatACaptureWouldDo) {
  const testing::TempFolder folder;
  testing::WriteText(folder.Path() / "rig.json", RigToJson(RingRig({96, 64}, LightModel::kLed)));
  FakeDaemon daemon;
  CaptureRequest request = {.rig = folder.Path() / "rig.json", .output = folder.Path() / "twill"};
  request.options.exposure_s = 0.02;
  request.options.level = 0.5;  // as this board allows
  const ApiResponse answer =
      daemon.Ask("POST", "/v1/jobs", CaptureToJson(request, "", /*dry_run=*/true));
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(Body(answer)["frames"], 13);
  const Result<CaptureForecast> forecast = ForecastFromJson(answer.body);
  ASSERT_TRUE(forecast) << forecast.error().message;
  EXPECT_TRUE(forecast->exposure_known);
  EXPECT_EQ(forecast->firmware, "fakefake");
  EXPECT_EQ(forecast->camera.model, "fake camera");
  EXPECT_EQ(forecast->settings.exposure_s, 0.02);
  EXPECT_GT(forecast->bytes, 0U);
  EXPECT_FALSE(std::filesystem::exists(request.output));
}

TEST(ApiJson, AnIntegerNamesTheLightOfAPreview) {
  const Result<PostedPreview> posted = PreviewFromJson(R"({"light": 3})");
  ASSERT_TRUE(posted) << posted.error().message;
  EXPECT_EQ(posted->request.light, "3");
  EXPECT_FALSE(PreviewFromJson(R"({"light": 3.5})"));
}

TEST(ApiJson, ACaptureSurvivesThereAndBack) {
  CaptureRequest request = {.rig = "/rigs/rig.json", .output = "/scans/twill"};
  request.options.kind = SessionKind::kSheet;
  request.options.exposure_s = 0.125;
  request.options.f_number = 5.6;
  request.options.iso = 200.0;
  request.options.brackets = 2;
  request.options.level = 0.75;
  request.options.settle = milliseconds(17);
  request.options.margin = milliseconds(1800);
  request.options.deadline = milliseconds(45000);
  request.options.tries = 5;
  request.options.checks.max_drift = 0.07;
  const std::string text = CaptureToJson(request, "bob");
  const Result<PostedCapture> posted = CaptureFromJson(text, {});
  ASSERT_TRUE(posted) << posted.error().message;
  EXPECT_EQ(posted->client, "bob");
  EXPECT_EQ(CaptureToJson(posted->request, "bob"), text);
  EXPECT_EQ(posted->request.options.checks.max_drift, 0.07);
  EXPECT_EQ(posted->request.options.settle, milliseconds(17));
  EXPECT_EQ(posted->request.options.exposure_s, 0.125);
  EXPECT_EQ(posted->request.options.brackets, 2);
  request.options.exposure_s.reset();  // to be found
  EXPECT_FALSE(CaptureFromJson(CaptureToJson(request, ""), {})->request.options.exposure_s);
  const Result<PostedCapture> resumed =
      CaptureFromJson(R"({"kind":"capture","output":"/s","resume":true})", request.options);
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_TRUE(resumed->request.resume);
  EXPECT_EQ(resumed->request.options.tries, 5);  // the daemon's default, where the request has none
}

TEST(ApiJson, EventsAndSummariesSurviveThereAndBack) {
  const CaptureEvent event = {.stage = "capturing",
                              .done = 3,
                              .frames = 13,
                              .light = "led-2",
                              .exposure_s = 0.02,
                              .peak = 0.8,
                              .left_s = 7.5};
  EXPECT_EQ(EventJson(*CaptureEventFromJson(EventJson(event))), EventJson(event));
  CaptureSummary summary = {
      .taken = 13, .kept = 1, .rejected = 2, .seconds = 9.5, .camera_seconds = 7.0};
  summary.check.levels = {1.0, 0.5};
  summary.check.notes = {"first light drifted"};
  summary.check.drift = 0.04;
  summary.check.shifts = {{.px = {0.0, 0.0}}, {.px = {0.25, -0.5}}};
  const Result<CaptureSummary> back = SummaryFromJson(SummaryJson(summary));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(SummaryJson(*back), SummaryJson(summary));
  EXPECT_EQ(back->check.shifts.at(1).px.y(), -0.5);
  EXPECT_EQ(SummaryJson(*SummaryFromJson(SummaryJson({}))), SummaryJson({}));
}

TEST(ApiJson, EveryErrorCodeSurvives) {
  for (int code = 0; code <= static_cast<int>(ErrorCode::kCancelled); ++code) {
    const Error error = {static_cast<ErrorCode>(code), "what \"happened\"\xff"};
    const Error back = ErrorFromJson(ErrorJson(error));
    EXPECT_EQ(back.code, error.code);
    EXPECT_THAT(back.message, HasSubstr("what \"happened\""));
    EXPECT_GE(HttpStatus(error.code), 400);
  }
  EXPECT_EQ(ErrorFromJson("<html>").code, ErrorCode::kBadData);
}

// Any bytes as a body: an answer each, and nothing lit.
TEST(Api, AnyBytesGetAnAnswer) {
  FakeDaemon daemon;
  daemon.rig.held = false;
  std::mt19937_64 random(1);
  const std::string seed = R"({"kind":"capture","level":0.5,"for_ms":20,"checks":{"max_drift":1}})";
  const std::vector<std::string> paths = {"/v1/lights/3", "/v1/jobs", "/v1/board"};
  for (int round = 0; round < 3000; ++round) {
    std::string body = seed;
    for (std::uint64_t edits = random() % 6; edits > 0; --edits) {
      body[random() % body.size()] = static_cast<char>(random());
    }
    body.resize(random() % (body.size() + 1));
    const ApiResponse answer = daemon.Ask("POST", paths[random() % paths.size()], body);
    EXPECT_TRUE(json::accept(answer.body));
    EXPECT_THAT(answer.status, ::testing::AnyOf(200, 202, 400, 409)) << answer.body;
  }
  daemon.service.Stop();
  EXPECT_THAT(daemon.rig.board.lit, IsEmpty());
}

}  // namespace
}  // namespace sateen::api_test
