#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace sateen::ptp {

// The numbers of PTP (ISO 15740) and PTP/IP (CIPA DC-005) that the virtual camera uses.
enum PacketType : uint32_t {
  kInitCommandRequest = 1,
  kInitCommandAck = 2,
  kInitEventRequest = 3,
  kInitEventAck = 4,
  kCommandRequest = 6,
  kCommandResponse = 7,
  kEvent = 8,
  kStartData = 9,
  kData = 10,
  kEndData = 12
};

enum Operation : uint16_t {
  kGetDeviceInfo = 0x1001,
  kOpenSession = 0x1002,
  kCloseSession = 0x1003,
  kGetStorageIds = 0x1004,
  kGetStorageInfo = 0x1005,
  kGetNumObjects = 0x1006,
  kGetObjectHandles = 0x1007,
  kGetObjectInfo = 0x1008,
  kGetObject = 0x1009,
  kDeleteObject = 0x100B,
  kInitiateCapture = 0x100E,
  kGetPropertyDescription = 0x1014,
  kGetPropertyValue = 0x1015,
  kSetPropertyValue = 0x1016,
  kGetPartialObject = 0x101B,
  kNikonCaptureToMemory = 0x90C0,
  kNikonChangeCameraMode = 0x90C2,
  kNikonGetEvent = 0x90C7,
  kNikonDeviceReady = 0x90C8,
  kNikonCaptureToMedia = 0x9207
};

enum Response : uint16_t {
  kOk = 0x2001,
  kOperationNotSupported = 0x2005,
  kInvalidObjectHandle = 0x2009,
  kPropertyNotSupported = 0x200A,
  kStoreFull = 0x200C,
  kAccessDenied = 0x200F,
  kDeviceBusy = 0x2019,
  kInvalidPropertyValue = 0x201C
};

enum Event : uint16_t {
  kObjectAdded = 0x4002,
  kStoreFullEvent = 0x400A,
  kCaptureComplete = 0x400D
};

// Little-endian values, one after the other.
class Writer {
 public:
  template <typename T>
  Writer& Put(T value) {
    static_assert(std::is_integral_v<T>);
    for (size_t k = 0; k < sizeof(T); ++k) {
      bytes_.push_back(static_cast<char>(static_cast<uint64_t>(value) >> (8 * k) & 0xFF));
    }
    return *this;
  }
  // Puts the low `size` bytes of `value`.
  Writer& PutSized(uint64_t value, size_t size);
  // Puts a count of UTF-16 units with the closing zero, then the units; ASCII only. 0 if empty.
  Writer& String(std::string_view text);
  // Puts the same without a count, as PTP/IP has names.
  Writer& Name(std::string_view text);
  template <typename T>
  Writer& Array(const std::vector<T>& values) {
    Put(static_cast<uint32_t>(values.size()));
    for (const T value : values) {
      Put(value);
    }
    return *this;
  }
  Writer& Raw(std::string_view bytes) {
    bytes_ += bytes;
    return *this;
  }
  [[nodiscard]] const std::string& Bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// Reads `size` bytes at `offset`, little-endian; bytes beyond the end are 0.
[[nodiscard]] uint64_t Read(std::string_view bytes, size_t offset, size_t size);

struct Packet {
  uint32_t type = 0;
  std::string body;
};

// Sockets; false and nothing where the other end is gone. Bodies above 64 MiB end the connection.
[[nodiscard]] bool SendPacket(int socket, uint32_t type, std::string_view body);
// Acknowledges at once what it reads: the library waits for it after each half of a request.
[[nodiscard]] std::optional<Packet> ReceivePacket(int socket);

}  // namespace sateen::ptp
