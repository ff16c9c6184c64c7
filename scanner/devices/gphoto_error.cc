#include "scanner/devices/gphoto_error.h"

#include <fmt/format.h>

#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/files/file_io.h"

namespace sateen {
namespace {

using nlohmann::json;

// libgphoto2's codes that a person has to be told something about.
constexpr int kIoInProgress = -110;
constexpr int kIoUsbClaim = -53;
constexpr int kModelNotFound = -105;
constexpr int kNoSpace = -115;
constexpr int kIo = -7;
constexpr int kUnspecified = -1;

Error OfDisk(int error_number, const std::string& path) {
  const bool full = error_number == ENOSPC || error_number == EDQUOT;
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return {ErrorCode::kIo,
          fmt::format("{}: cannot write: {}; {}", path, SystemReason(error_number),
                      full ? "make room" : fmt::format("check that {} can be written to", folder))};
}

}  // namespace

bool CardIsFull(const json& error) {
  return error.value("code", 0) == kNoSpace ||
         error.value("text", "").find("Store Full") != std::string::npos;
}

Error FromLibrary(const json& error, const std::string& port) {
  if (error.contains("errno")) {
    return OfDisk(error.value("errno", 0), error.value("path", ""));
  }
  const int code = error.value("code", 0);
  const std::string text = error.value("text", "");
  std::string remedy = "; check that it is on and connected";
  if (code == kIoInProgress) {
    remedy = "; it is busy: wait, or switch it off and on";
  } else if (code == kIoUsbClaim) {
    remedy = "; another program holds it: sateen devices says which";
  } else if (code == kModelNotFound) {
    remedy = "; there is no camera: sateen devices lists them";
  } else if (CardIsFull(error)) {
    return {
        ErrorCode::kDevice,
        fmt::format("camera at {}: the camera's memory card is full; delete files or change the "
                    "card",
                    port)};
  }
  return {ErrorCode::kDevice,
          fmt::format("camera at {}: {}: {}{}", port, error.value("while", ""), text, remedy)};
}

bool ConnectionIsGone(const json& error) {
  const int code = error.value("code", 0);
  return code == kIo || (code <= -30 && code > -70) || (code == kUnspecified && !CardIsFull(error));
}

}  // namespace sateen
