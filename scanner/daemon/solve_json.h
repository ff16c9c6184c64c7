#pragma once

#include <string>

#include "core/error.h"
#include "scanner/daemon/solve_job.h"

// Stands apart from api_json.h, so that clients of the daemon are not compiled again when the solve
// changes.
namespace sateen {

struct PostedSolve {
  std::string client;  // as it calls itself; empty where it does not say
  SolveRequest request;
};

// Reads the request of a solve (docs/api.md).
//
// Errors  kInvalidArgument: an unknown key, a wrong type, a value out of range; the key is named
[[nodiscard]] Result<PostedSolve> SolveFromJson(const std::string& text);

}  // namespace sateen
