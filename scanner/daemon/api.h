#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "scanner/capture/capture_options.h"
#include "scanner/daemon/file_desk.h"
#include "scanner/daemon/rig_service.h"

namespace sateen {

// A request that was let in, without its transport.
struct ApiRequest {
  std::string method;
  std::string path;  // decoded, without a query
  std::string body;
  std::string who;                             // client as the transport knows it
  std::optional<std::uint64_t> last_event_id;  // value of Last-Event-ID
  ClientLeft client_left;                      // ends waiting for a job or a file
};

struct ApiResponse {
  // Events of a job, which the transport sends as they come instead of a body.
  struct Events {
    std::uint64_t job = 0;
    std::uint64_t after = 0;
  };

  int status = 200;
  std::string body;
  std::string content_type = "application/json";
  std::string allow;  // methods of the path, of a 405
  std::optional<Events> events;
};

// Returns whether this call turns all lights off: it is never refused, and needs no body.
[[nodiscard]] bool IsLightsOff(const std::string& method, const std::string& path);

// Returns the answer to a refused request: the status, and an error in JSON.
[[nodiscard]] ApiResponse Refused(int status, const Error& error);
// Returns 400, 422, 500, 503 or 504.
[[nodiscard]] int HttpStatus(ErrorCode code);
// Returns the answer for an argument with which no job could begin: 400, or 422 for a file that is
// bad or cannot be read. Where that is not known, because the file does not come, as HttpStatus.
[[nodiscard]] ApiResponse RefusedUnbegun(const Error& error);

struct ApiOptions {
  std::string version;
  CaptureOptions capture;  // defaults for what a capture request does not say
  FileDesk::Options files;
  // How long turning the lights off waits for the job that it has cancelled.
  std::chrono::milliseconds off_wait{10'000};
};

/// The daemon's interface, version 1, as a function of a request: docs/api.md. Calls may come from
/// any thread; those that ask a device wait for it.
class Api {
 public:
  Api(RigService& service, ApiOptions options);

  [[nodiscard]] ApiResponse Handle(const ApiRequest& request) const;

 private:
  struct Route;
  static const std::vector<Route>& Routes();
  using Parameter = const std::string&;  // value of a route's place {}

  [[nodiscard]] ApiResponse GetState(const ApiRequest& request, Parameter none) const;
  [[nodiscard]] ApiResponse GetDevices(const ApiRequest& request, Parameter none) const;
  [[nodiscard]] ApiResponse GetBoard(const ApiRequest& request, Parameter none) const;
  [[nodiscard]] ApiResponse PostBoard(const ApiRequest& request, Parameter none) const;
  [[nodiscard]] ApiResponse GetJobs(const ApiRequest& request, Parameter none) const;
  [[nodiscard]] ApiResponse PostJob(const ApiRequest& request, Parameter none) const;
  [[nodiscard]] ApiResponse GetJob(const ApiRequest& request, Parameter id) const;
  [[nodiscard]] ApiResponse DeleteJob(const ApiRequest& request, Parameter id) const;
  [[nodiscard]] ApiResponse GetEvents(const ApiRequest& request, Parameter id) const;
  [[nodiscard]] ApiResponse PostLightsOff(const ApiRequest& request, Parameter none) const;
  [[nodiscard]] ApiResponse PostPreview(const ApiRequest& request, Parameter none) const;
  [[nodiscard]] ApiResponse PostLight(const ApiRequest& request, Parameter channel) const;

  [[nodiscard]] ApiResponse PostPreviewJob(const ApiRequest& request) const;
  [[nodiscard]] ApiResponse PostSolveJob(const ApiRequest& request) const;
  // Returns the immediate error of a job that reads files of the client. `check` reads them, beside
  // the connection, and owns all that it uses. Returns nothing if the job may begin or another job
  // has the rig.
  [[nodiscard]] std::optional<ApiResponse> CannotBegin(const ApiRequest& request,
                                                       std::function<Status()> check) const;
  [[nodiscard]] ApiResponse Begin(JobRequest job) const;  // 202, or 409
  // 200, 409, or the job's error
  [[nodiscard]] ApiResponse RunToEnd(const ApiRequest& request, JobRequest job) const;

  RigService& service_;
  ApiOptions options_;
  FileDesk files_;
};

}  // namespace sateen
