#include "scanner/devices/ptp_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "imaging/raw.h"
#include "scanner/devices/frame_file.h"
#include "scanner/devices/gphoto_error.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

std::string Neighbours(const std::vector<double>& choices, double wanted) {
  const auto above = std::ranges::upper_bound(choices, wanted);
  if (choices.empty()) {
    return "the camera does not say what can be set";
  }
  if (above == choices.begin()) {
    return fmt::format("the smallest is {:.4g}", choices.front());
  }
  if (above == choices.end()) {
    return fmt::format("the largest is {:.4g}", choices.back());
  }
  return fmt::format("the nearest are {:.4g} and {:.4g}", *std::prev(above), *above);
}

}  // namespace

struct PtpCamera::Setting {
  std::string name;
  std::string value;
  std::vector<std::string> choices;
  bool readonly = false;
};

struct PtpCamera::FileOnCamera {
  std::string folder;
  std::string name;
};

class PtpCamera::Deadline {
 public:
  explicit Deadline(milliseconds longest) : end_(steady_clock::now() + longest) {}
  [[nodiscard]] milliseconds Left() const {
    return std::max(std::chrono::ceil<milliseconds>(end_ - steady_clock::now()), milliseconds(0));
  }

 private:
  steady_clock::time_point end_;
};

Status PtpCameraOptions::Validate() const {
  if (answer_timeout < milliseconds(1)) {
    return Fail(ErrorCode::kInvalidArgument, "answer_timeout is {} ms; need at least 1",
                answer_timeout.count());
  }
  if (settle < milliseconds(0)) {
    return Fail(ErrorCode::kInvalidArgument, "settle is {} ms; need at least 0", settle.count());
  }
  return {};
}

PtpCamera::PtpCamera(PtpCameraOptions options) : options_(std::move(options)) {}

PtpCamera::~PtpCamera() { Close(); }

Result<CameraInfo> PtpCamera::Open() {
  if (Status valid = options_.Validate(); !valid) {
    return tl::unexpected(valid.error());
  }
  Close();
  Result<CameraInfo> opened = Connect();
  if (!opened) {
    worker_.reset();
    state_ = State::kClosed;
  }
  return opened;
}

Result<CameraInfo> PtpCamera::Connect() {
  std::string port = options_.port;
  if (port.empty()) {
    const Result<std::vector<FoundCamera>> found = ListPtpCameras(options_.worker);
    if (!found) {
      return tl::unexpected(found.error());
    }
    if (found->size() != 1) {
      return Fail(
          ErrorCode::kDevice,
          "found {} cameras but one is needed; sateen devices lists them and says what is missing",
          found->size());
    }
    port = found->front().port;
  }
  info_ = {.port = port};
  Result<WorkerProcess> worker = WorkerProcess::Start(
      options_.worker.empty() ? WorkerProcess::DefaultProgram() : options_.worker);
  if (!worker) {
    return tl::unexpected(worker.error());
  }
  worker_ = *std::move(worker);
  state_ = State::kOpen;
  const milliseconds settle = frame_owing_ ? options_.settle : milliseconds(0);
  if (auto opened = Ask({{"do", "open"}, {"port", port}, {"settle_ms", settle.count()}},
                        4 * options_.answer_timeout + settle);
      !opened) {
    return tl::unexpected(opened.error());
  }
  frame_owing_ = false;
  const auto maker = Find({"manufacturer"});
  const auto model = Find({"cameramodel"});
  if (!maker || !model) {
    return tl::unexpected(maker ? model.error() : maker.error());
  }
  profile_ = &ProfileFor(*maker ? (*maker)->value : "");
  info_.model = *model ? (*model)->value : "unknown";
  info_.profile = profile_->name;
  for (const RequiredSetting& required : profile_->required) {
    if (Status has = Require(required); !has) {
      return tl::unexpected(has.error());
    }
  }
  return ReadExposureTimes().map([this] { return info_; });
}

Status PtpCamera::ReadExposureTimes() {
  const auto times = Find(profile_->exposure_time);
  if (!times) {
    return tl::unexpected(times.error());
  }
  exposure_times_.clear();
  for (const std::string& word : *times ? (*times)->choices : std::vector<std::string>{}) {
    if (const std::optional<double> time = SettingValue(word)) {
      exposure_times_.push_back(*time);
    }
  }
  std::ranges::sort(exposure_times_);
  return {};
}

Result<json> PtpCamera::Ask(const json& request, milliseconds longest) {
  if (state_ != State::kOpen) {
    return Fail(ErrorCode::kDevice, "the camera is not connected");
  }
  Result<json> answer = worker_->Ask(request, longest);
  if (!answer) {
    state_ = State::kLost;
    const ErrorCode code = answer.error().code;
    return Fail(code, "camera at {}: {}{}", info_.port, answer.error().message,
                code == ErrorCode::kTimeout
                    ? fmt::format(" ({} ms, '{}'); it may be asleep: wake it, and switch off its "
                                  "automatic power-off",
                                  longest.count(), request.value("do", ""))
                    : "; connect again");
  }
  if (answer->contains("error")) {
    card_is_full_ = CardIsFull((*answer)["error"]);
    if (ConnectionIsGone((*answer)["error"])) {
      state_ = State::kLost;
    }
    return tl::unexpected(FromLibrary((*answer)["error"], info_.port));
  }
  return answer;
}

Result<std::optional<PtpCamera::Setting>> PtpCamera::Find(const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const Result<json> answer = Ask({{"do", "get"}, {"name", name}}, options_.answer_timeout);
    if (!answer) {
      return tl::unexpected(answer.error());
    }
    if (!answer->contains("absent")) {
      return Setting{.name = name,
                     .value = answer->value("value", ""),
                     .choices = answer->value("choices", std::vector<std::string>{}),
                     .readonly = answer->value("readonly", false)};
    }
  }
  return std::nullopt;
}

// A camera without the setting cannot be asked; what it delivers is looked at then.
Status PtpCamera::Require(const RequiredSetting& required) {
  const auto found = Find(required.names);
  if (!found) {
    return tl::unexpected(found.error());
  }
  if (!*found || std::ranges::count(required.values, (*found)->value) > 0) {
    return {};
  }
  const Setting& setting = **found;
  const auto value = std::ranges::find_if(required.values, [&](const std::string& wanted) {
    return std::ranges::count(setting.choices, wanted) > 0;
  });
  if (!setting.readonly && value != required.values.end()) {
    const auto set =
        Ask({{"do", "set"}, {"name", setting.name}, {"value", *value}}, options_.answer_timeout);
    const auto now = set ? Find({setting.name}) : tl::unexpected(set.error());
    if (now && *now && (*now)->value == *value) {
      return {};
    }
    if (state_ != State::kOpen) {
      return tl::unexpected(now ? set.error() : now.error());
    }
  }
  return Fail(ErrorCode::kDevice,
              "{} at {}: {} is '{}', and it cannot be set from here; need {}: {}", info_.model,
              info_.port, setting.name, setting.value, required.what, required.remedy);
}

// Sets the number. Returns the number that the camera has afterwards; nothing if it does not say.
Result<std::optional<double>> PtpCamera::SetNumber(const std::vector<std::string>& names,
                                                   double wanted, const char* what) {
  auto found = Find(names);
  if (!found) {
    return tl::unexpected(found.error());
  }
  if (!*found) {
    return std::optional<double>();
  }
  const Setting& setting = **found;
  std::optional<double> value = SettingValue(setting.value);
  if (value && IsSameSetting(*value, wanted)) {
    return value;
  }
  std::vector<double> choices;
  const std::string* nearest = nullptr;
  double distance = kSameSetting * wanted;
  for (const std::string& choice : setting.choices) {
    if (const std::optional<double> number = SettingValue(choice)) {
      choices.push_back(*number);
      if (IsSameSetting(*number, wanted) && std::abs(*number - wanted) <= distance) {
        nearest = &choice;
        distance = std::abs(*number - wanted);
      }
    }
  }
  std::ranges::sort(choices);
  if (setting.readonly || nearest == nullptr) {
    return Fail(ErrorCode::kInvalidArgument,
                "{} at {}: {} {:.4g} cannot be set: the camera's {} is '{}'{}; {}", info_.model,
                info_.port, what, wanted, setting.name, setting.value,
                setting.readonly ? " and is set on the camera itself" : "",
                Neighbours(choices, wanted));
  }
  const auto set =
      Ask({{"do", "set"}, {"name", setting.name}, {"value", *nearest}}, options_.answer_timeout);
  if (!set) {
    return tl::unexpected(set.error());
  }
  found = Find({setting.name});
  if (!found) {
    return tl::unexpected(found.error());
  }
  value = *found ? SettingValue((*found)->value) : std::nullopt;
  if (!value || !IsSameSetting(*value, wanted)) {
    return Fail(ErrorCode::kDevice,
                "{} at {}: {} was set to {} and reads '{}'; set it on the camera itself",
                info_.model, info_.port, what, *nearest, *found ? (*found)->value : "");
  }
  return value;
}

Result<ExposureSettings> PtpCamera::Configure(const ExposureSettings& settings) {
  if (state_ != State::kOpen) {
    return Fail(ErrorCode::kDevice, "the camera is not connected");
  }
  set_.reset();
  ExposureSettings now = settings;
  const auto apply = [&](const std::vector<std::string>& names, double& value, const char* what) {
    const auto has = SetNumber(names, value, what);
    if (has && *has) {
      value = **has;
    }
    return has ? Status() : Status(tl::unexpected(has.error()));
  };
  if (Status done = apply(profile_->iso, now.iso, "ISO"); !done) {
    return tl::unexpected(done.error());
  }
  if (Status done = apply(profile_->f_number, now.f_number, "aperture f/"); !done) {
    return tl::unexpected(done.error());
  }
  if (Status done = apply(profile_->exposure_time, now.exposure_s, "exposure [s]"); !done) {
    return tl::unexpected(done.error());
  }
  set_ = now;
  return now;
}

Status PtpCamera::DropLeftovers() {
  while (true) {
    const auto file = Ask({{"do", "await"}, {"wait_ms", 0}}, options_.answer_timeout);
    if (!file) {
      return tl::unexpected(file.error());
    }
    if (!file->contains("name")) {
      return {};
    }
  }
}

Result<PtpCamera::FileOnCamera> PtpCamera::Expose(const Deadline& deadline) {
  if (Status clean = DropLeftovers(); !clean) {
    return tl::unexpected(clean.error());
  }
  const auto asked = steady_clock::now();
  const auto triggered = Ask({{"do", "trigger"}, {"wait_ms", deadline.Left().count()}},
                             deadline.Left() + options_.answer_timeout);
  if (!triggered) {
    return tl::unexpected(triggered.error());
  }
  frame_owing_ = true;
  // A Nikon answers when the exposure is over, others when it begins. Cameras' times are powers of
  // two: 1/60 s is 1/64 s.
  const auto released = asked + milliseconds(triggered->value("after_ms", 0));
  const auto shortest = std::chrono::duration<double>(set_ ? 0.9 * set_->exposure_s : 0.0);
  while (deadline.Left() > milliseconds(0)) {
    const auto wait = std::min(deadline.Left(), milliseconds(500));
    const auto file =
        Ask({{"do", "await"}, {"wait_ms", wait.count()}}, wait + options_.answer_timeout);
    if (!file) {
      return tl::unexpected(file.error());
    }
    if (file->contains("name") && steady_clock::now() - released >= shortest) {
      frame_owing_ = false;
      return FileOnCamera{.folder = file->value("folder", ""), .name = file->value("name", "")};
    }
  }
  // Its file may still come, and must not be taken for a later frame.
  worker_->Kill();
  state_ = State::kLost;
  return Fail(
      ErrorCode::kTimeout,
      "{} at {}: the shutter was released but no file arrived in time; connect again and take "
      "the frame again",
      info_.model, info_.port);
}

Result<CapturedFile> PtpCamera::Capture(const fs::path& folder, milliseconds longest) {
  if (state_ != State::kOpen) {
    return Fail(ErrorCode::kDevice, "the camera is not connected");
  }
  card_is_full_ = false;
  const Deadline deadline(longest);
  const Result<FileOnCamera> file = Expose(deadline);
  if (!file) {
    return tl::unexpected(file.error());
  }
  Result<CapturedFile> captured = Fetch(*file, folder, deadline);
  if (!captured) {
    return captured;
  }
  const auto second = Ask({{"do", "await"}, {"wait_ms", 0}}, options_.answer_timeout);
  if (second && !second->contains("name")) {
    return captured;
  }
  std::error_code ignored;
  fs::remove(captured->path, ignored);
  if (!second) {
    return tl::unexpected(second.error());
  }
  return Fail(
      ErrorCode::kDevice,
      "{} at {}: two files, {} and {}, arrived for one frame, and it is not known which is right; "
      "set RAW alone and single shots, and take the frame again",
      info_.model, info_.port, file->name, second->value("name", ""));
}

Result<CapturedFile> PtpCamera::Fetch(const FileOnCamera& file, const fs::path& folder,
                                      const Deadline& deadline) {
  if (file.name.find('/') != std::string::npos) {
    return Fail(ErrorCode::kDevice, "{} at {}: '{}' is no name of a file; take the frame again",
                info_.model, info_.port, file.name);
  }
  if (!IsRawName(file.name)) {
    return Fail(ErrorCode::kDevice, "{} at {}: {} is not a RAW file; set the image quality to RAW",
                info_.model, info_.port, file.name);
  }
  const fs::path part = folder / fmt::format(".{}.part", file.name);
  std::error_code failed;
  Status whole = Download(file, part, deadline);
  if (!whole && whole.error().code == ErrorCode::kBadData && state_ == State::kOpen) {
    whole = Download(file, part, deadline);
  }
  if (!whole) {
    fs::remove(part, failed);
    return tl::unexpected(whole.error());
  }
  const uint64_t bytes = fs::file_size(part, failed);
  const Result<fs::path> place = PlaceAnew(part, folder, file.name);
  if (!place) {
    return tl::unexpected(place.error());
  }
  // It is here whatever becomes of the one there; a connection that broke shows at the next call.
  const auto deleted = Ask({{"do", "delete"}, {"folder", file.folder}, {"name", file.name}},
                           options_.answer_timeout);
  if (!deleted && state_ == State::kOpen) {
    fs::remove(*place, failed);
    return tl::unexpected(deleted.error());
  }
  return CapturedFile{.path = *place, .name_on_camera = file.name, .bytes = bytes};
}

Status PtpCamera::Download(const FileOnCamera& file, const fs::path& path,
                           const Deadline& deadline) {
  std::error_code failed;
  fs::remove(path, failed);
  const auto info =
      Ask({{"do", "info"}, {"folder", file.folder}, {"name", file.name}}, options_.answer_timeout);
  if (!info) {
    return tl::unexpected(info.error());
  }
  const auto done = Ask(
      {{"do", "download"}, {"folder", file.folder}, {"name", file.name}, {"path", path.string()}},
      std::max(deadline.Left(), milliseconds(1)));
  if (!done) {
    return tl::unexpected(done.error());
  }
  const uint64_t bytes = fs::file_size(path, failed);
  if (const uint64_t needed = info->value("bytes", bytes); failed || bytes != needed) {
    return Fail(ErrorCode::kBadData, "{} at {}: {}: {} of {} bytes arrived; take the frame again",
                info_.model, info_.port, file.name, failed ? 0 : bytes, needed);
  }
  return options_.decode
             ? CheckRawFrame(path, fmt::format("{} at {}: {}", info_.model, info_.port, file.name),
                             set_)
             : Status();
}

void PtpCamera::Close() noexcept {
  try {
    if (state_ == State::kOpen && worker_) {
      static_cast<void>(worker_->Ask({{"do", "close"}}, options_.answer_timeout));
    }
  } catch (const std::exception&) {
    // The process is killed all the same.
  }
  worker_.reset();
  set_.reset();
  exposure_times_.clear();
  state_ = State::kClosed;
}

Result<std::vector<FoundCamera>> ListPtpCameras(const fs::path& program) {
  Result<WorkerProcess> worker =
      WorkerProcess::Start(program.empty() ? WorkerProcess::DefaultProgram() : program);
  if (!worker) {
    return tl::unexpected(worker.error());
  }
  const Result<json> answer = worker->Ask({{"do", "list"}}, std::chrono::seconds(20));
  if (!answer) {
    return Fail(answer.error().code, "looking for cameras: {}", answer.error().message);
  }
  if (answer->contains("error")) {
    return tl::unexpected(FromLibrary((*answer)["error"], "usb"));
  }
  std::vector<FoundCamera> cameras;
  for (const json& camera : answer->value("cameras", json::array())) {
    cameras.push_back({.model = camera.value("model", ""), .port = camera.value("port", "")});
  }
  return cameras;
}

}  // namespace sateen
