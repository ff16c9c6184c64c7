#include "scanner/daemon/rig_jobs.h"

#include <algorithm>
#include <utility>

#include "core/files/output_folder.h"
#include "scanner/daemon/answer_json.h"
#include "scanner/daemon/device_list.h"

namespace sateen {
namespace {

Result<std::string> DoCapture(const CaptureRequest& request, JobContext& job) {
  const auto observe = [&](const CaptureEvent& event) { job.Report(EventJson(event)); };
  const Result<CaptureSummary> summary = RunCapture(request, job.Devices(), job.GetTask(), observe);
  return summary ? Result<std::string>(SummaryJson(*summary)) : tl::unexpected(summary.error());
}

Result<std::string> DoLight(const LightRequest& request, JobContext& job) {
  const Result<LightBoard*> board = job.Devices().Board();
  if (!board) {
    return tl::unexpected(board.error());
  }
  job.Lit({request.channel});
  const Result<bool> cancelled = KeepLightOn(
      request, **board, job.GetTask(), [&](const LightOn& on) { job.Report(LightOnJson(on)); });
  if (!cancelled) {
    return tl::unexpected(cancelled.error());
  }
  if (*cancelled) {
    return Fail(ErrorCode::kCancelled, "light {} is off again",
                request.name.empty() ? std::to_string(request.channel) : request.name);
  }
  return R"({"cancelled":false})";
}

Result<std::string> DoBoard(const BoardChange& change, JobContext& job) {
  const Result<LightBoard*> board = job.Devices().Board();
  if (!board) {
    return tl::unexpected(board.error());
  }
  const Result<BoardWord> word = ChangeBoard(change, **board);
  return word ? Result<std::string>(BoardJson(*word)) : tl::unexpected(word.error());
}

Result<std::string> DoLightsOff(JobContext& job) {
  // A port that is gone is told at once; after the job it is waited for.
  const Result<LightBoard*> board = job.Devices().Board(std::chrono::milliseconds(0));
  if (!board) {
    return tl::unexpected(board.error());
  }
  return (*board)->AllOff().map(LitJson);
}

// Returns the device at this port; a new one at the end if the system does not show it.
DeviceReply& PlaceOf(std::vector<DeviceReply>& devices, const DeviceReply& named) {
  const auto found = std::ranges::find(devices, named.port, &DeviceReply::port);
  return found != devices.end() ? *found : devices.emplace_back(named);
}

void AskBoard(std::vector<DeviceReply>& devices, RigDevices& rig) {
  const Result<std::vector<SerialPortInfo>> ports = ListSerialPorts();
  const Result<LightBoard*> board = rig.Board();
  for (const SerialPortInfo& port : ports.value_or(std::vector<SerialPortInfo>())) {
    DeviceReply& reply = devices.emplace_back(ReplyOf(port));
    if (port.may_be_board) {
      reply.what = board ? "not asked: the daemon has another board" : board.error().message;
    }
  }
  // Where the system shows nothing that could be it, the daemon's own word tells what is missing.
  const auto may_be_board = [](const SerialPortInfo& port) { return port.may_be_board; };
  if (!board && (!ports || std::ranges::none_of(*ports, may_be_board))) {
    devices.push_back(
        {.port = "-", .description = "the LED board of the daemon", .what = board.error().message});
  }
  if (board) {
    const DeviceReply named = {.port = (*board)->PortName(),
                               .description = "the port of the daemon"};
    TakeBoard(PlaceOf(devices, named), (*board)->Info(), (*board)->Report());
  }
}

void AskCamera(std::vector<DeviceReply>& devices, RigDevices& rig) {
  const std::vector<UsbCamera> cameras = ListUsbCameras();
  const Result<TetheredCamera*> camera = rig.Camera();
  for (const UsbCamera& found : cameras) {
    DeviceReply& reply = devices.emplace_back(ReplyOf(found));
    if (reply.what.empty()) {
      reply.what = camera ? "not asked: the daemon has another camera" : camera.error().message;
    }
  }
  if (!camera && cameras.empty()) {
    devices.push_back({.port = "-",
                       .description = "the camera of the daemon",
                       .is_camera = true,
                       .what = camera.error().message});
  }
  if (camera && rig.OpenCamera()) {
    const DeviceReply named = {.port = rig.OpenCamera()->port,
                               .description = "the camera of the daemon",
                               .is_camera = true};
    TakeCamera(PlaceOf(devices, named), *rig.OpenCamera());
  }
}

}  // namespace

JobRequest CaptureJob(CaptureRequest request, std::string owner) {
  std::string what = request.output.string();
  return {
      .kind = "capture",
      .what = std::move(what),
      .owner = std::move(owner),
      .work = [request = std::move(request)](JobContext& job) { return DoCapture(request, job); }};
}

JobRequest ForecastJob(CaptureRequest request, std::string owner) {
  return {.kind = "dry run",
          .what = request.output.string(),
          .owner = std::move(owner),
          .work = [request = std::move(request)](JobContext& job) {
            return ForecastCapture(request, job.Devices()).map(ForecastToJson);
          }};
}

JobRequest PreviewJob(PreviewRequest request, std::filesystem::path output,
                      std::shared_ptr<std::string> jpeg, std::string owner) {
  return {.kind = "preview",
          .what = request.light.value_or("room light"),
          .owner = std::move(owner),
          .work = [request = std::move(request), output = std::move(output),
                   jpeg = std::move(jpeg)](JobContext& job) {
            return TakePreview(request, job.Devices(), job.GetTask())
                .and_then([&](Preview preview) -> Result<std::string> {
                  std::string text = PreviewJson(preview, output);
                  if (output.empty()) {
                    *jpeg = std::move(preview.jpeg);
                    return text;
                  }
                  return WriteFileWhole(output, preview.jpeg).map([&] { return std::move(text); });
                });
          }};
}

JobRequest LightJob(LightRequest request, std::string owner) {
  std::string what = request.name.empty() ? std::to_string(request.channel) : request.name;
  return {
      .kind = "light",
      .what = std::move(what),
      .owner = std::move(owner),
      .work = [request = std::move(request)](JobContext& job) { return DoLight(request, job); }};
}

JobRequest BoardJob(BoardChange change, std::string owner) {
  return {.kind = "board", .owner = std::move(owner), .work = [change](JobContext& job) {
            return DoBoard(change, job);
          }};
}

JobRequest LightsOffJob(std::string owner) {
  return {.kind = "lights off", .owner = std::move(owner), .urgent = true, .work = DoLightsOff};
}

JobRequest DevicesJob(std::string owner) {
  return {.kind = "devices", .owner = std::move(owner), .work = [](JobContext& job) {
            std::vector<DeviceReply> devices;
            AskBoard(devices, job.Devices());
            if (const Status going = job.GetTask().CheckCancelled(); !going) {
              return Result<std::string>(tl::unexpected(going.error()));
            }
            AskCamera(devices, job.Devices());
            return Result<std::string>(DevicesJson(devices, /*indent=*/-1));
          }};
}

}  // namespace sateen
