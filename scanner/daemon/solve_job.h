#pragma once

#include <string>

#include "pipelines/solve/solve_options.h"
#include "scanner/daemon/job.h"

namespace sateen {

struct SolveRequest {
  SolveOptions options;
  int threads = 0;  // 0: one for each core
};

// Makes a job that solves a session into a folder of maps, without the rig. Result: the text of
// solve.json. Progress: {"stage": "reading", "done": 3, "total": 10}, at most 20 of each stage.
[[nodiscard]] JobRequest SolveJob(SolveRequest request, std::string owner);

}  // namespace sateen
