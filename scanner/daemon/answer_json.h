#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "scanner/capture/capture_request.h"
#include "scanner/capture/preview.h"
#include "scanner/daemon/board_job.h"
#include "scanner/daemon/light_job.h"
#include "scanner/daemon/rig_service.h"

// Answers of the daemon, to JSON and back; docs/api.md has the keys. Texts are one line.
namespace sateen {

[[nodiscard]] std::string StateJson(const RigState& state, const std::string& version);
[[nodiscard]] std::string JobJson(const JobRecord& job);
[[nodiscard]] std::string JobsJson(const std::vector<JobRecord>& jobs);
// Writes {"id": 7, "events": "/v1/jobs/7/events"}.
[[nodiscard]] std::string BegunJson(std::uint64_t id);
[[nodiscard]] Result<std::uint64_t> BegunFromJson(const std::string& text);

// Writes {"error": {"code": "device", "message": ...}}, and the job that has the rig, if any.
[[nodiscard]] std::string ErrorJson(const Error& error,
                                    const std::optional<JobRecord>& holder = std::nullopt);
// Reads the error from such a text. Another text is itself a kBadData.
[[nodiscard]] Error ErrorFromJson(const std::string& text);
// Returns "invalid-argument", "bad-data", "degenerate", "io", "device", "timeout" or "cancelled".
[[nodiscard]] std::string_view Name(ErrorCode code);
// Returns "the rig is in use: capture of scans/twill by ... since 06:31:07 (job 7); ..."
[[nodiscard]] std::string BusyText(const JobRecord& holder);

// Writes {"text": ...}: what is neither result nor error of a job, as core/notice.h has it.
[[nodiscard]] std::string NoteJson(const std::string& text);
[[nodiscard]] Result<std::string> NoteFromJson(const std::string& text);

[[nodiscard]] std::string EventJson(const CaptureEvent& event);
[[nodiscard]] Result<CaptureEvent> CaptureEventFromJson(const std::string& text);
// Writes the summary without the session, which is on disk in session.json.
[[nodiscard]] std::string SummaryJson(const CaptureSummary& summary);
// Reads the summary. Its session is not filled in.
[[nodiscard]] Result<CaptureSummary> SummaryFromJson(const std::string& text);

// Writes the forecast without request and plan, which the client knows.
[[nodiscard]] std::string ForecastToJson(const CaptureForecast& forecast);
[[nodiscard]] Result<CaptureForecast> ForecastFromJson(const std::string& text);

// Writes the preview without the picture, and where the picture was written, if it was.
[[nodiscard]] std::string PreviewJson(const Preview& preview, const std::filesystem::path& output);
[[nodiscard]] Result<Preview> PreviewAnswerFromJson(const std::string& text);

[[nodiscard]] std::string LightOnJson(const LightOn& on);
[[nodiscard]] Result<LightOn> LightOnFromJson(const std::string& text);

// Writes {"lit": [...]}: the lights that the board says are on.
[[nodiscard]] std::string LitJson(const BoardState& state);
// Fails unless the daemon's answer is that no light is on.
[[nodiscard]] Status NoneLitFromJson(const std::string& text);

[[nodiscard]] std::string BoardJson(const BoardWord& board);
[[nodiscard]] Result<BoardWord> BoardFromJson(const std::string& text);

}  // namespace sateen
