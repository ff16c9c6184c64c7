#include "simulation/virtual_rig/camera/virtual_camera.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <utility>

#include "simulation/virtual_rig/camera/ptp_wire.h"

namespace sateen {
namespace {

using std::chrono::steady_clock;

constexpr uint32_t kStore = 0x00010001;
constexpr uint32_t kDcim = 0x10000001;
constexpr uint32_t kFolder = 0x10000002;
constexpr uint32_t kFirstFile = 0x20000001;
constexpr uint32_t kAll = 0xFFFFFFFF;

constexpr std::array<std::pair<std::string_view, CameraFault>, 12> kFaultNames = {
    {{"none", CameraFault::kNone},
     {"busy", CameraFault::kBusy},
     {"no-event", CameraFault::kNoEvent},
     {"late-event", CameraFault::kLateEvent},
     {"gone", CameraFault::kGone},
     {"dropped-mid-file", CameraFault::kDroppedMidFile},
     {"short-transfer", CameraFault::kShortTransfer},
     {"truncated-file", CameraFault::kTruncatedFile},
     {"card-full", CameraFault::kCardFull},
     {"asleep", CameraFault::kAsleep},
     {"wrong-exposure", CameraFault::kWrongExposure},
     {"two-files", CameraFault::kTwoFiles}}};

VirtualCamera::Answer Refuse(uint16_t response) { return {.response = response}; }

VirtualCamera::Answer Data(std::string data) {
  return {.response = ptp::kOk, .data = std::move(data)};
}

uint32_t At(const std::vector<uint32_t>& parameters, size_t index) {
  return index < parameters.size() ? parameters[index] : 0;
}

std::string StorageInfo(bool is_full) {
  ptp::Writer writer;
  writer.Put(uint16_t{4}).Put(uint16_t{3}).Put(uint16_t{0});  // removable, DCIM, read and write
  writer.Put(uint64_t{64} << 30)
      .Put(is_full ? uint64_t{4} << 20 : uint64_t{60} << 30)
      .Put(uint32_t{is_full ? 0U : 9999U});
  return writer.String("SD").String("").Bytes();
}

}  // namespace

Result<CameraFault> CameraFaultNamed(std::string_view name) {
  std::vector<std::string_view> names;
  for (const auto& [known, fault] : kFaultNames) {
    if (known == name) {
      return fault;
    }
    names.push_back(known);
  }
  return Fail(ErrorCode::kInvalidArgument, "'{}' is no fault of the camera; need one of {}", name,
              fmt::join(names, ", "));
}

Result<std::unique_ptr<VirtualCamera>> VirtualCamera::Create(VirtualCameraOptions options) {
  std::optional<ptp::Persona> persona = ptp::PersonaNamed(options.persona);
  if (!persona) {
    return Fail(ErrorCode::kInvalidArgument, "'{}' is no camera; need generic or nikon",
                options.persona);
  }
  if (!options.source) {
    return Fail(ErrorCode::kInvalidArgument, "the virtual camera has no source of frames");
  }
  return std::unique_ptr<VirtualCamera>(new VirtualCamera(std::move(options), *std::move(persona)));
}

VirtualCamera::VirtualCamera(VirtualCameraOptions options, ptp::Persona persona)
    : options_(std::move(options)), persona_(std::move(persona)), next_handle_(kFirstFile) {
  objects_[kDcim] = {.name = "DCIM", .folder = true};
  objects_[kFolder] = {.name = persona_.folder, .parent = kDcim, .folder = true};
}

VirtualCamera::~VirtualCamera() {
  {
    const std::lock_guard lock(mutex_);
    off_ = true;
  }
  stopped_.notify_all();
  if (shutter_.joinable()) {
    shutter_.join();
  }
}

void VirtualCamera::OnEvent(EventSink sink) {
  const std::lock_guard lock(mutex_);
  sink_ = std::move(sink);
}

VirtualCamera::Answer VirtualCamera::Handle(uint16_t operation,
                                            const std::vector<uint32_t>& parameters,
                                            std::string_view data, uint32_t transaction) {
  TellAsked(operation);
  const std::lock_guard lock(mutex_);
  if (asleep_) {
    return {.silent = true};
  }
  switch (operation) {
    case ptp::kGetDeviceInfo:
      return Data(persona_.DeviceInfo());
    case ptp::kOpenSession:
      ++report_.sessions;
      return Refuse(ptp::kOk);
    case ptp::kCloseSession:
    case ptp::kNikonChangeCameraMode:
      return Refuse(ptp::kOk);
    case ptp::kNikonDeviceReady:
      return Refuse(exposing_ ? ptp::kDeviceBusy : ptp::kOk);
    case ptp::kGetStorageIds:
      return Data(ptp::Writer().Array(std::vector<uint32_t>{kStore}).Bytes());
    case ptp::kGetStorageInfo:
      return Data(StorageInfo(card_is_full_));
    case ptp::kInitiateCapture:
    case ptp::kNikonCaptureToMemory:
    case ptp::kNikonCaptureToMedia:
      return InitiateCapture(transaction);
    case ptp::kNikonGetEvent:
      return TakeEvents();
    case ptp::kGetPropertyDescription:
    case ptp::kGetPropertyValue:
    case ptp::kSetPropertyValue:
      return Properties(operation, At(parameters, 0), data);
    default:
      return Files(operation, parameters);
  }
}

void VirtualCamera::TellAsked(uint16_t operation) {
  const bool capture = operation == ptp::kInitiateCapture ||
                       operation == ptp::kNikonCaptureToMemory ||
                       operation == ptp::kNikonCaptureToMedia;
  if (!capture || !options_.asked) {
    return;
  }
  int number = 0;
  {
    const std::lock_guard lock(mutex_);
    if (asleep_ || exposing_) {
      return;
    }
    number = report_.captures + 1;
  }
  options_.asked(number);
}

VirtualCamera::Answer VirtualCamera::Files(uint16_t operation,
                                           const std::vector<uint32_t>& parameters) {
  if (operation == ptp::kGetObjectHandles || operation == ptp::kGetNumObjects) {
    const uint32_t parent = At(parameters, 2);
    std::vector<uint32_t> handles;
    for (const auto& [handle, object] : objects_) {
      if (parent == 0 || object.parent == (parent == kAll ? 0 : parent)) {
        handles.push_back(handle);
      }
    }
    if (operation == ptp::kGetNumObjects) {
      return {.response = ptp::kOk, .parameters = {static_cast<uint32_t>(handles.size())}};
    }
    return Data(ptp::Writer().Array(handles).Bytes());
  }
  const auto found = objects_.find(At(parameters, 0));
  if (found == objects_.end()) {
    return Refuse(ptp::kInvalidObjectHandle);
  }
  switch (operation) {
    case ptp::kGetObjectInfo:
      return Data(ObjectInfo(found->second));
    case ptp::kGetObject:
      return Transfer(found->second, 0, UINT64_MAX);
    case ptp::kGetPartialObject:
      return Transfer(found->second, At(parameters, 1), At(parameters, 2));
    case ptp::kDeleteObject:
      ++report_.deleted;
      objects_.erase(found);
      return Refuse(ptp::kOk);
    default:
      return Refuse(ptp::kOperationNotSupported);
  }
}

VirtualCamera::Answer VirtualCamera::Transfer(Object& object, uint64_t offset, uint64_t longest) {
  if (object.folder) {
    return Refuse(ptp::kInvalidObjectHandle);
  }
  const uint64_t whole = object.bytes->size();
  uint64_t end = std::min(whole, longest > whole ? whole : offset + longest);
  const uint64_t half = whole / 2;
  size_t cut = 0;
  if (end > half && object.fault == CameraFault::kDroppedMidFile) {
    cut = std::max<size_t>(half - std::min(half, offset), 1);
    object.fault = CameraFault::kNone;
  } else if (end > half && object.fault == CameraFault::kShortTransfer) {
    end = std::max(half, offset);
    object.fault = CameraFault::kNone;
  }
  const size_t size = end - std::min(offset, end);
  return {.response = ptp::kOk,
          .parameters = {static_cast<uint32_t>(size)},
          .data = object.bytes->substr(std::min(offset, whole), size),
          .cut_data_at = cut};
}

VirtualCamera::Answer VirtualCamera::Properties(uint16_t operation, uint32_t code,
                                                std::string_view data) {
  ptp::Property* property = Find(code);
  if (property == nullptr) {
    return Refuse(ptp::kPropertyNotSupported);
  }
  if (operation == ptp::kGetPropertyDescription) {
    return Data(property->Description());
  }
  if (operation == ptp::kGetPropertyValue) {
    return Data(ptp::Writer().PutSized(property->value, property->size).Bytes());
  }
  const uint64_t value = ptp::Read(data, 0, property->size);
  if (!property->writable) {
    return Refuse(ptp::kAccessDenied);
  }
  if (!property->choices.empty() && std::ranges::count(property->choices, value) == 0) {
    return Refuse(ptp::kInvalidPropertyValue);
  }
  property->value = value;
  return Refuse(ptp::kOk);
}

VirtualCamera::Answer VirtualCamera::InitiateCapture(uint32_t transaction) {
  if (exposing_) {
    return Refuse(ptp::kDeviceBusy);
  }
  CameraFault fault = CameraFault::kNone;
  if (!faults_.empty()) {
    fault = faults_.front();
    faults_.pop_front();
  }
  card_is_full_ = fault == CameraFault::kCardFull;
  switch (fault) {
    case CameraFault::kBusy:
      return Refuse(ptp::kDeviceBusy);
    case CameraFault::kCardFull:
      return Refuse(ptp::kStoreFull);
    case CameraFault::kGone:
      return {.hang_up = true};
    case CameraFault::kAsleep:
      asleep_ = true;
      return {.silent = true};
    default:
      break;
  }
  if (shutter_.joinable()) {
    shutter_.join();  // it has ended, or is about to without the lock
  }
  exposing_ = true;
  shutter_ = std::thread([this, request = NextFrame(fault), fault, transaction] {
    Expose(request, fault, transaction);
  });
  return Refuse(ptp::kOk);
}

FrameRequest VirtualCamera::NextFrame(CameraFault fault) {
  FrameRequest request = {.number = ++report_.captures,
                          .f_number = static_cast<double>(Find(0x5007)->value) / 100.0,
                          .iso = static_cast<double>(Find(0x500F)->value),
                          .begin = steady_clock::now()};
  request.exposure_s = persona_.ExposureSeconds(Find(persona_.exposure_property)->value) *
                       (fault == CameraFault::kWrongExposure ? 4.0 : 1.0);
  request.end = request.begin + std::chrono::duration_cast<steady_clock::duration>(
                                    std::chrono::duration<double>(request.exposure_s));
  return request;
}

// Runs on a thread of its own.
void VirtualCamera::Expose(FrameRequest request, CameraFault fault, uint32_t transaction) {
  if (!Wait(request.end)) {
    return;
  }
  Result<std::string> bytes = options_.source(request);
  if (fault == CameraFault::kLateEvent && !Wait(request.end + options_.late)) {
    return;
  }
  const std::lock_guard lock(mutex_);
  exposing_ = false;
  if (!bytes) {
    Say(ptp::kStoreFullEvent, kStore);  // nothing else says that there is no file
    return;
  }
  if (fault == CameraFault::kTruncatedFile) {
    bytes->resize(bytes->size() / 2);
  }
  const std::string name = fmt::format("{}{:04d}", persona_.file_prefix, request.number);
  if (fault == CameraFault::kTwoFiles) {
    Say(ptp::kObjectAdded, AddFile(name + "A.DNG", *bytes, fault));
  }
  const uint32_t handle = AddFile(name + ".DNG", *std::move(bytes), fault);
  if (fault != CameraFault::kNoEvent) {
    Say(ptp::kObjectAdded, handle);
    Say(ptp::kCaptureComplete, transaction);
  }
}

uint32_t VirtualCamera::AddFile(const std::string& name, std::string bytes, CameraFault fault) {
  objects_[next_handle_] = {.name = name,
                            .parent = kFolder,
                            .bytes = std::make_shared<const std::string>(std::move(bytes)),
                            .fault = fault};
  return next_handle_++;
}

void VirtualCamera::Say(uint16_t code, uint32_t parameter) {
  if (persona_.polled_events) {
    events_.emplace_back(code, parameter);
  } else if (sink_) {
    sink_(code, parameter);
  }
}

VirtualCamera::Answer VirtualCamera::TakeEvents() {
  ptp::Writer writer;
  writer.Put(static_cast<uint16_t>(events_.size()));
  for (const auto& [code, parameter] : events_) {
    writer.Put(code).Put(parameter);
  }
  events_.clear();
  return Data(writer.Bytes());
}

bool VirtualCamera::Wait(steady_clock::time_point until) {
  std::unique_lock lock(mutex_);
  return !stopped_.wait_until(lock, until, [this] { return off_; });
}

ptp::Property* VirtualCamera::Find(uint32_t code) {
  const auto found = std::ranges::find(persona_.properties, code, &ptp::Property::code);
  return found == persona_.properties.end() ? nullptr : &*found;
}

std::string VirtualCamera::ObjectInfo(const Object& object) const {
  const uint16_t format = object.folder ? 0x3001 : 0x3811;
  const auto size = static_cast<uint32_t>(object.folder ? 0 : object.bytes->size());
  ptp::Writer writer;
  writer.Put(kStore).Put(format).Put(uint16_t{0}).Put(size);
  writer.Put(uint16_t{0}).Put(uint32_t{0}).Put(uint32_t{0}).Put(uint32_t{0});  // no thumbnail
  writer.Put(uint32_t{0}).Put(uint32_t{0}).Put(uint32_t{0}).Put(object.parent);
  writer.Put(static_cast<uint16_t>(object.folder ? 1 : 0)).Put(uint32_t{0}).Put(uint32_t{0});
  writer.String(object.name).String("20260101T120000").String("20260101T120000").String("");
  return writer.Bytes();
}

void VirtualCamera::Inject(CameraFault fault, int captures) {
  const std::lock_guard lock(mutex_);
  for (int k = 0; k < captures; ++k) {
    faults_.push_back(fault);
  }
}

void VirtualCamera::Sleep() {
  const std::lock_guard lock(mutex_);
  asleep_ = true;
}

void VirtualCamera::Wake() {
  const std::lock_guard lock(mutex_);
  asleep_ = false;
}

bool VirtualCamera::Asleep() const {
  const std::lock_guard lock(mutex_);
  return asleep_;
}

bool VirtualCamera::SetProperty(uint16_t code, uint64_t value) {
  const std::lock_guard lock(mutex_);
  ptp::Property* property = Find(code);
  if (property != nullptr) {
    property->value = value;
  }
  return property != nullptr;
}

uint64_t VirtualCamera::PropertyValue(uint16_t code) {
  const std::lock_guard lock(mutex_);
  const ptp::Property* property = Find(code);
  return property != nullptr ? property->value : 0;
}

CameraReport VirtualCamera::Report() const {
  const std::lock_guard lock(mutex_);
  CameraReport report = report_;
  report.on_card = static_cast<int>(objects_.size()) - 2;
  return report;
}

}  // namespace sateen
