#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/error.h"

// libgphoto2's own names.
struct _Camera;     // NOLINT(bugprone-reserved-identifier)
struct _GPContext;  // NOLINT(bugprone-reserved-identifier)

namespace sateen {

// libgphoto2, one call at a time, as messages. It holds no opinions: what to set, what to check and
// how long to wait is decided by PtpCamera in the program that started this process. Any call may
// block for ever; whoever waits kills this process then.
//
// Each request {"do": ...} has one answer. Where it fails that is {"error": {"code", "text",
// "while"}}, code as libgphoto2 has it; {"error": {"errno", "path"}} where a file of this computer
// cannot be written, which is not the camera's fault.
//
//     do        fields                     answer
//     list                                 cameras [{model, port}]
//     open      port, settle_ms            events of the first settle_ms are thrown away
//     get       name                       value, choices, readonly; or absent
//     set       name, value
//     trigger   wait_ms                    after_ms: start of the try that went well; waits while
//                                          the camera is busy
//     await     wait_ms                    folder, name of a file that has been added, or neither
//     info      folder, name               bytes, as the camera says
//     download  folder, name, path
//     delete    folder, name
//     close
class GphotoSession {
 public:
  GphotoSession();
  GphotoSession(const GphotoSession&) = delete;
  GphotoSession& operator=(const GphotoSession&) = delete;
  ~GphotoSession();

  [[nodiscard]] nlohmann::json Do(const nlohmann::json& request);
  // Returns the answer to what is no request.
  [[nodiscard]] static nlohmann::json Refuse(const Error& error);

 private:
  nlohmann::json List();
  nlohmann::json Open(const std::string& port, int settle_ms);
  nlohmann::json Get(const std::string& name);
  nlohmann::json Set(const std::string& name, const std::string& value);
  nlohmann::json Trigger(int wait_ms);
  bool CardHasRoom();
  nlohmann::json Await(int wait_ms);
  nlohmann::json Info(const std::string& folder, const std::string& name);
  nlohmann::json Download(const std::string& folder, const std::string& name,
                          const std::string& path);
  nlohmann::json Delete(const std::string& folder, const std::string& name);
  nlohmann::json Close();
  // Returns the error of libgphoto2's `code`, with the latest words that it had for it.
  nlohmann::json Failure(int code, const std::string& during);

  _GPContext* context_;
  _Camera* camera_ = nullptr;
  std::string words_;
};

}  // namespace sateen
