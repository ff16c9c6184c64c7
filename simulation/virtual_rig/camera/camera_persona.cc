#include "simulation/virtual_rig/camera/camera_persona.h"

#include <utility>

#include "simulation/virtual_rig/camera/ptp_wire.h"

namespace sateen::ptp {
namespace {

constexpr uint16_t kNikonExposureTime = 0xD100;

std::string DescribeChoices(const Property& property) {
  Writer writer;
  writer.Put(uint8_t{2}).Put(static_cast<uint16_t>(property.choices.size()));
  for (const uint64_t choice : property.choices) {
    writer.PutSized(choice, property.size);
  }
  return writer.Bytes();
}

// Settings that PTP itself defines: what both personas have.
std::vector<Property> StandardProperties(std::vector<uint64_t> exposures) {
  return {{.code = 0x5001, .size = 1, .writable = false, .value = 93},       // battery, %
          {.code = 0x5004, .size = 1, .value = 4, .choices = {0, 1, 2, 4}},  // quality; 4: RAW
          {.code = 0x5007, .value = 800, .choices = {280, 400, 560, 800, 1100, 1600}},  // f, 1/100
          {.code = 0x500A, .writable = false, .value = 1, .choices = {1, 2}},  // focus; 1: manual
          {.code = 0x500D, .size = 4, .value = 200, .choices = std::move(exposures)},  // 0.1 ms
          {.code = 0x500E, .writable = false, .value = 1, .choices = {1, 2, 3, 4}},    // 1: manual
          {.code = 0x500F, .value = 100, .choices = {100, 200, 400, 800, 1600, 3200}}};
}

Persona Generic() {
  Persona persona{
      .name = "generic",
      .manufacturer = "Sateen",
      .model = "Virtual Camera",
      .operations = {kGetDeviceInfo, kOpenSession, kCloseSession, kGetStorageIds, kGetStorageInfo,
                     kGetNumObjects, kGetObjectHandles, kGetObjectInfo, kGetObject, kDeleteObject,
                     kInitiateCapture, kGetPropertyDescription, kGetPropertyValue,
                     kSetPropertyValue, kGetPartialObject},
      .exposure_property = 0x500D,
      .folder = "100SCAN_",
      .file_prefix = "SCAN"};
  persona.properties = StandardProperties({1,    2,    5,     10,    20,    40,    50,     80,
                                           100,  125,  166,   200,   333,   500,   1000,   2000,
                                           2500, 5000, 10000, 20000, 40000, 80000, 150000, 300000});
  return persona;
}

Persona Nikon() {
  Persona persona = Generic();
  persona.name = "nikon";
  persona.manufacturer = "Nikon Corporation";
  persona.model = "D5100";
  persona.vendor_extension = 0xA;
  persona.polled_events = true;
  persona.folder = "100D5100";
  persona.file_prefix = "DSC_";
  persona.exposure_property = kNikonExposureTime;
  for (const uint16_t operation : {kNikonCaptureToMemory, kNikonChangeCameraMode, kNikonGetEvent,
                                   kNikonDeviceReady, kNikonCaptureToMedia}) {
    persona.operations.push_back(operation);
  }
  for (Property& property : persona.properties) {
    if (property.code == 0x5004) {
      property.choices = {0, 1, 2, 4, 5, 6, 7};  // 4: NEF; 5 to 7: with a JPEG beside it
    }
  }
  // Ratios: 1/1000 ... 1/60, 1/50 ... 1/4, 10/25 ... 30 s, bulb. What the D5100 lists, thinned.
  const std::vector<uint64_t> ratios = {66536,  66036,  65786,  65661,   65636,     65616, 65596,
                                        65586,  65576,  65566,  65561,   65556,     65551, 65546,
                                        65544,  65541,  65540,  655385,  65538,     65537, 131073,
                                        262145, 524289, 983041, 1966081, 4294967295};
  for (Property property :
       {Property{.code = kNikonExposureTime, .size = 4, .value = 65586, .choices = ratios},
        {.code = 0xD054, .size = 1, .value = 0, .choices = {0, 1}},  // automatic ISO
        {.code = 0xD10B, .size = 1, .value = 1, .choices = {0, 1}},  // 0: card, 1: memory
        {.code = 0xD161, .size = 1, .writable = false, .value = 3, .choices = {0, 1, 2, 3, 4}}}) {
    persona.properties.push_back(std::move(property));
  }
  return persona;
}

}  // namespace

std::string Property::Description() const {
  const uint16_t type = size == 1 ? 2 : size == 2 ? 4 : 6;
  Writer writer;
  writer.Put(code).Put(type).Put(static_cast<uint8_t>(writable ? 1 : 0));
  writer.PutSized(value, size).PutSized(value, size);
  return choices.empty() ? writer.Put(uint8_t{0}).Bytes()
                         : writer.Raw(DescribeChoices(*this)).Bytes();
}

std::string Persona::DeviceInfo() const {
  constexpr uint16_t kJpeg = 0x3801;
  constexpr uint16_t kDng = 0x3811;
  constexpr uint16_t kFolder = 0x3001;
  std::vector<uint16_t> codes;
  for (const Property& property : properties) {
    codes.push_back(property.code);
  }
  Writer writer;
  writer.Put(uint16_t{100}).Put(vendor_extension).Put(uint16_t{100}).String("");
  writer.Put(uint16_t{0}).Array(operations);
  writer.Array(std::vector<uint16_t>{kObjectAdded, kStoreFullEvent, kCaptureComplete});
  writer.Array(codes).Array(std::vector<uint16_t>{kJpeg, kDng});
  writer.Array(std::vector<uint16_t>{kJpeg, kDng, kFolder});
  writer.String(manufacturer).String(model).String("1.0").String("VIRTUAL0001");
  return writer.Bytes();
}

double Persona::ExposureSeconds(uint64_t value) const {
  if (exposure_property != kNikonExposureTime) {
    return static_cast<double>(value) * 1e-4;
  }
  return static_cast<double>(value >> 16) / static_cast<double>(value & 0xFFFF);
}

std::optional<Persona> PersonaNamed(std::string_view name) {
  if (name == "generic") {
    return Generic();
  }
  return name == "nikon" ? std::optional(Nikon()) : std::nullopt;
}

}  // namespace sateen::ptp
