#pragma once

#include <filesystem>
#include <string>

#include "core/error.h"
#include "scanner/capture/capture_request.h"
#include "scanner/capture/preview.h"
#include "scanner/daemon/board_job.h"
#include "scanner/daemon/light_job.h"

// Requests to the daemon, to JSON and back; docs/api.md has the keys. To give a request a new key,
// add it to its two functions here. Readers are strict: an unknown key, a wrong type and a value
// out of range are each a kInvalidArgument that names the key.
namespace sateen {

// `client`, in all of them, is who asks, as it calls itself; empty where it does not say.
struct PostedCapture {
  std::string client;
  CaptureRequest request;
  bool dry_run = false;  // only what it would do
};
// Returns "capture", "preview" or "solve"; empty where the text does not say.
[[nodiscard]] std::string KindOfJob(const std::string& text);
// Reads a capture request. Absent keys are as in `defaults`.
[[nodiscard]] Result<PostedCapture> CaptureFromJson(const std::string& text,
                                                    const CaptureOptions& defaults);
[[nodiscard]] std::string CaptureToJson(const CaptureRequest& request, const std::string& client,
                                        bool dry_run = false);

struct PostedPreview {
  std::string client;
  PreviewRequest request;
  std::filesystem::path output;  // where the daemon puts the picture; empty: it is the answer
};
[[nodiscard]] Result<PostedPreview> PreviewFromJson(const std::string& text);
[[nodiscard]] std::string PreviewToJson(const PreviewRequest& request,
                                        const std::filesystem::path& output,
                                        const std::string& client);

struct PostedLight {
  std::string client;
  LightRequest request;
};
[[nodiscard]] Result<PostedLight> LightFromJson(const std::string& text, int channel);
[[nodiscard]] std::string LightToJson(const LightRequest& request, const std::string& client);

struct PostedBoardChange {
  std::string client;
  BoardChange change;
};
[[nodiscard]] Result<PostedBoardChange> BoardChangeFromJson(const std::string& text);
[[nodiscard]] std::string BoardChangeToJson(const BoardChange& change, const std::string& client);

}  // namespace sateen
