#include "cli/rig_record.h"

#include <ctime>

#include "core/file_io.h"
#include "core/output_folder.h"

namespace sateen::cli {
namespace {

std::string TimeAs(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), format, &utc));
  return text;
}

}  // namespace

void RecordCalibration(Rig& rig, std::string_view kind, nlohmann::json figures,
                       const std::map<std::string, std::string>& sha256_of_input) {
  nlohmann::json all = nlohmann::json::object();
  if (!rig.calibration_json.empty()) {
    all = nlohmann::json::parse(rig.calibration_json, nullptr, /*allow_exceptions=*/false);
  }
  figures["date"] = TimeAs("%Y-%m-%dT%H:%M:%SZ");
  figures["version"] = SATEEN_VERSION;
  figures["inputs"] = sha256_of_input;
  all[std::string(kind)] = std::move(figures);
  rig.calibration_json = all.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Result<std::filesystem::path> ReplaceRig(const std::filesystem::path& path, const Rig& rig) {
  std::filesystem::path former;
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    const Result<std::string> text = ReadFileBytes(path);
    if (!text) {
      return tl::unexpected(text.error());
    }
    const std::string stem = path.stem().string() + "-" + TimeAs("%Y%m%dT%H%M%SZ");
    former = path;
    former.replace_filename(stem + path.extension().string());
    for (int again = 2; std::filesystem::exists(former, error); ++again) {
      former.replace_filename(fmt::format("{}-{}{}", stem, again, path.extension().string()));
    }
    if (Status status = WriteFileWhole(former, *text); !status) {
      return tl::unexpected(status.error());
    }
  }
  if (Status status = WriteFileWhole(path, RigToJson(rig)); !status) {
    return tl::unexpected(status.error());
  }
  return former;
}

}  // namespace sateen::cli
