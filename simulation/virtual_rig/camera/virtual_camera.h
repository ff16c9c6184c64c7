#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/error.h"
#include "simulation/virtual_rig/camera/camera_persona.h"

namespace sateen {

// Settings and times of a frame that the virtual camera is to show.
struct FrameRequest {
  int number = 0;  // number of the frame, from 1
  double exposure_s = 0.0;
  double f_number = 0.0;
  double iso = 0.0;
  // When the shutter opened and closed.
  std::chrono::steady_clock::time_point begin;
  std::chrono::steady_clock::time_point end;
};

// The bytes of the RAW file. Called from a thread of the camera when the shutter has closed.
using FrameSource = std::function<Result<std::string>(const FrameRequest&)>;

// Faults of one capture.
enum class CameraFault {
  kNone,
  kBusy,            // the camera answers that it is busy and takes nothing
  kNoEvent,         // the file is on the card, but the camera never says so
  kLateEvent,       // the file appears `late` after it should
  kGone,            // the connection breaks when the capture is asked for
  kDroppedMidFile,  // the connection breaks in the middle of the first download of the file
  kShortTransfer,   // the first download of the file ends half way, as if that were all
  kTruncatedFile,   // the file itself is cut in half
  kCardFull,
  kAsleep,         // from now on no answer to anything, until it is woken
  kWrongExposure,  // exposed four times as long as was set
  kTwoFiles        // the file and another one beside it
};

// Returns the fault by its name in commands: "busy", "no-event", "late-event", "gone",
// "dropped-mid-file", "short-transfer", "truncated-file", "card-full", "asleep", "wrong-exposure",
// "two-files", "none". kInvalidArgument lists them.
[[nodiscard]] Result<CameraFault> CameraFaultNamed(std::string_view name);

struct VirtualCameraOptions {
  std::string persona = "generic";  // or "nikon"
  FrameSource source;
  std::chrono::milliseconds late{1000};
  // Told when a capture is asked for, before anything comes of it, with the number that its frame
  // would have. From a thread of the camera; may Inject().
  std::function<void(int number)> asked = {};
};

// Counts of what the camera has been through.
struct CameraReport {
  int captures = 0;  // frames exposed
  int deleted = 0;   // files deleted by the host
  int on_card = 0;
  int sessions = 0;  // sessions that hosts have opened
};

// Behaves as a camera without its wire: properties, files, exposures. ptp_responder.h connects it.
// All calls may come from any thread.
class VirtualCamera {
 public:
  struct Answer {
    uint16_t response = 0;
    std::vector<uint32_t> parameters;
    std::optional<std::string> data;
    size_t cut_data_at = 0;  // break the connection after so many bytes of `data`, where not 0
    bool silent = false;     // no answer at all
    bool hang_up = false;    // break the connection instead
  };
  // Told of every event, from a thread of the camera.
  using EventSink = std::function<void(uint16_t code, uint32_t parameter)>;

  // Fails with kInvalidArgument for an unknown persona or without a source.
  static Result<std::unique_ptr<VirtualCamera>> Create(VirtualCameraOptions options);
  VirtualCamera(const VirtualCamera&) = delete;
  VirtualCamera& operator=(const VirtualCamera&) = delete;
  ~VirtualCamera();

  void OnEvent(EventSink sink);
  [[nodiscard]] Answer Handle(uint16_t operation, const std::vector<uint32_t>& parameters,
                              std::string_view data, uint32_t transaction);

  // Makes the next `captures` captures that are asked for go wrong so.
  void Inject(CameraFault fault, int captures = 1);
  void Sleep();
  void Wake();
  [[nodiscard]] bool Asleep() const;
  // Sets a property as with the camera's own dials. Returns false if it has no such property.
  bool SetProperty(uint16_t code, uint64_t value);
  [[nodiscard]] uint64_t PropertyValue(uint16_t code);
  [[nodiscard]] CameraReport Report() const;

 private:
  struct Object {
    std::string name;
    uint32_t parent = 0;
    bool folder = false;
    std::shared_ptr<const std::string> bytes;
    CameraFault fault = CameraFault::kNone;
  };

  explicit VirtualCamera(VirtualCameraOptions options, ptp::Persona persona);
  Answer Files(uint16_t operation, const std::vector<uint32_t>& parameters);
  Answer Transfer(Object& object, uint64_t offset, uint64_t longest);
  Answer Properties(uint16_t operation, uint32_t code, std::string_view data);
  void TellAsked(uint16_t operation);
  Answer InitiateCapture(uint32_t transaction);
  Answer TakeEvents();
  void Expose(FrameRequest request, CameraFault fault, uint32_t transaction);
  [[nodiscard]] FrameRequest NextFrame(CameraFault fault);
  uint32_t AddFile(const std::string& name, std::string bytes, CameraFault fault);
  void Say(uint16_t code, uint32_t parameter);
  // Returns false if the camera is switched off meanwhile.
  bool Wait(std::chrono::steady_clock::time_point until);
  [[nodiscard]] ptp::Property* Find(uint32_t code);
  [[nodiscard]] std::string ObjectInfo(const Object& object) const;

  const VirtualCameraOptions options_;
  mutable std::mutex mutex_;  // guards all below
  ptp::Persona persona_;
  std::map<uint32_t, Object> objects_;
  std::deque<CameraFault> faults_;
  std::deque<std::pair<uint16_t, uint32_t>> events_;  // polled ones
  EventSink sink_;
  CameraReport report_;
  uint32_t next_handle_;
  bool asleep_ = false;
  bool exposing_ = false;
  bool card_is_full_ = false;  // at the latest capture that was asked for
  std::condition_variable stopped_;
  bool off_ = false;
  std::thread shutter_;
};

}  // namespace sateen
