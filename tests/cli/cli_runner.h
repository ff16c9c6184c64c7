#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "cli/simulate.h"
#include "cli/solve.h"

// Runs subcommands as the program does: through their command line.
namespace sateen::testing {

struct RunResult {
  int exit_status = 0;  // 2 where the command line itself is wrong
  std::string out;
  std::string log;

  [[nodiscard]] nlohmann::json Json() const { return nlohmann::json::parse(out); }
};

template <typename Args, typename Add, typename Run>
RunResult RunCommand(std::vector<std::string> words, Add add, Run run, const Task& task = {}) {
  CLI::App app;
  Args args;
  add(app, args);
  std::reverse(words.begin(), words.end());  // as CLI11 wants them
  RunResult result;
  try {
    app.parse(words);
  } catch (const CLI::ParseError& error) {
    result.exit_status = 2;
    result.log = error.what();
    return result;
  }
  std::ostringstream out;
  std::ostringstream log;
  result.exit_status = run(args, task, out, log);
  result.out = out.str();
  result.log = log.str();
  return result;
}

inline RunResult Solve(std::vector<std::string> words, const Task& task = {}) {
  words.insert(words.begin(), "solve");
  return RunCommand<cli::SolveArgs>(std::move(words), cli::AddSolve, cli::RunSolve, task);
}

inline RunResult Simulate(std::vector<std::string> words, const Task& task = {}) {
  words.insert(words.begin(), "simulate");
  return RunCommand<cli::SimulateArgs>(std::move(words), cli::AddSimulate, cli::RunSimulate, task);
}

}  // namespace sateen::testing
