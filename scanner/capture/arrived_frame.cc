#include "scanner/capture/arrived_frame.h"

#include <utility>

#include "core/files/file_io.h"
#include "core/files/output_folder.h"

namespace sateen {

ArrivedFrame::ArrivedFrame(std::size_t frame, SessionFrame record, std::filesystem::path path,
                           const std::filesystem::path& session, const Rig& rig,
                           const FrameCheckOptions& checks)
    : frame_(frame), record_(std::move(record)), path_(std::move(path)) {
  const ExposureSettings settings = {record_.exposure_s.value_or(0.0),
                                     record_.f_number.value_or(0.0), record_.iso.value_or(0.0)};
  look_ = std::async(std::launch::async,
                     [rig, checks, settings, role = record_.role, place = session / record_.file,
                      file = FrameFile{path_, record_.Exposure(), std::nullopt, rig.response}] {
                       Result<FrameLook> look = CheckFrame(file, rig, settings, role, checks);
                       const Status flushed = look ? FlushToDisk(file.path, place) : Status{};
                       return flushed ? std::move(look)
                                      : Result<FrameLook>(tl::unexpected(flushed.error()));
                     });
}

}  // namespace sateen
