#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sateen::ptp {

// A setting of the virtual camera, as PTP's device properties are.
struct Property {
  uint16_t code = 0;
  size_t size = 2;  // bytes of its value: UINT8, UINT16 or UINT32
  bool writable = true;
  uint64_t value = 0;
  std::vector<uint64_t> choices;  // any value, where empty

  // Returns the dataset that GetDevicePropDesc returns.
  [[nodiscard]] std::string Description() const;
};

// The camera that the virtual camera imitates.
struct Persona {
  std::string name;
  std::string manufacturer;
  std::string model;
  uint32_t vendor_extension = 0;
  bool polled_events = false;  // Nikon: the host asks for events
  std::vector<uint16_t> operations;
  std::vector<Property> properties;
  // The one that the exposure is taken from, and how.
  uint16_t exposure_property = 0;
  std::string folder;       // folder of its files, below DCIM
  std::string file_prefix;  // "SCAN" of SCAN0001.DNG

  [[nodiscard]] std::string DeviceInfo() const;
  // Returns the exposure time [s] for the exposure property's value: 0.1 ms units, or a ratio of
  // two 16-bit numbers.
  [[nodiscard]] double ExposureSeconds(uint64_t value) const;
};

// Returns "generic", with PTP's own properties, or "nikon", a D5100 by what such a camera says of
// itself.
[[nodiscard]] std::optional<Persona> PersonaNamed(std::string_view name);

}  // namespace sateen::ptp
