#include "pipelines/calibrate/rig_record.h"

#include <ctime>

#include "core/files/file_io.h"
#include "core/files/output_folder.h"

namespace sateen {
std::string TimeText(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), format, &utc));
  return text;
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

Result<std::filesystem::path> ReplaceFile(const std::filesystem::path& path,
                                          const std::string& text) {
  std::filesystem::path former;
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    const Result<std::string> kept = ReadFileBytes(path);
    if (!kept) {
      return tl::unexpected(kept.error());
    }
    const std::string stem = path.stem().string() + "-" + TimeText("%Y%m%dT%H%M%SZ");
    former = path;
    former.replace_filename(stem + path.extension().string());
    const auto is_taken = [&] {  // by a link that leads nowhere, too
      return std::filesystem::symlink_status(former, error).type() !=
             std::filesystem::file_type::not_found;
    };
    for (int again = 2; is_taken(); ++again) {
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
