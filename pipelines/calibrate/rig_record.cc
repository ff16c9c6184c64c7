#include "pipelines/calibrate/rig_record.h"

#include <ctime>

#include "core/file_io.h"
#include "core/output_folder.h"
#include "core/version.h"

namespace sateen {
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
  for (const char* key : {"output", "former_rig", "pictures"}) {
    figures.erase(key);  // names of one machine, and of one moment
  }
  if (const auto linearity = figures.find("linearity"); linearity != figures.end()) {
    for (nlohmann::json& channel : *linearity) {
      channel.erase("bins");  // a picture's worth
    }
  }
  figures["date"] = TimeAs("%Y-%m-%dT%H:%M:%SZ");
  figures["version"] = Version();
  figures["inputs"] = sha256_of_input;
  all[std::string(kind)] = std::move(figures);
  rig.calibration_json = all.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Result<Rig> RigToBeginWith(const std::filesystem::path& rig_file,
                           const std::filesystem::path& output) {
  const std::filesystem::path& path = rig_file.empty() ? output : rig_file;
  std::error_code error;
  if (rig_file.empty() && !std::filesystem::exists(output, error)) {
    return Rig();
  }
  return ReadRig(path);
}

std::optional<std::filesystem::path> RigFileToBeginWith(const std::filesystem::path& rig_file,
                                                        const std::filesystem::path& output) {
  const std::filesystem::path& path = rig_file.empty() ? output : rig_file;
  std::error_code error;
  if (rig_file.empty() && !std::filesystem::exists(output, error)) {
    return std::nullopt;
  }
  return path;
}

nlohmann::json RecordedFigure(const Rig& rig, const std::string& kind, const std::string& figure) {
  const nlohmann::json all =
      nlohmann::json::parse(rig.calibration_json, nullptr, /*allow_exceptions=*/false);
  const auto of_kind = all.is_object() ? all.find(kind) : all.end();
  if (!all.is_object() || of_kind == all.end() || !of_kind->is_object()) {
    return nullptr;
  }
  return of_kind->value(figure, nlohmann::json(nullptr));
}

Result<std::filesystem::path> ReplaceFile(const std::filesystem::path& path,
                                          const std::string& text) {
  std::filesystem::path former;
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    const Result<std::string> kept = ReadFileBytes(path);
    if (!kept) {
      return tl::unexpected(kept.error());
    }
    const std::string stem = path.stem().string() + "-" + TimeAs("%Y%m%dT%H%M%SZ");
    former = path;
    former.replace_filename(stem + path.extension().string());
    for (int again = 2; std::filesystem::exists(former, error); ++again) {
      former.replace_filename(fmt::format("{}-{}{}", stem, again, path.extension().string()));
    }
    if (Status status = WriteFileWhole(former, *kept); !status) {
      return tl::unexpected(status.error());
    }
  }
  if (Status status = WriteFileWhole(path, text); !status) {
    return tl::unexpected(status.error());
  }
  return former;
}

Result<std::filesystem::path> ReplaceRig(const std::filesystem::path& path, const Rig& rig) {
  if (Status status = rig.Validate(path.string()); !status) {
    return tl::unexpected(status.error());
  }
  return ReplaceFile(path, RigToJson(rig));
}

}  // namespace sateen
