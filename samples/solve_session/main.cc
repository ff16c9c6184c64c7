// Solves a session into a folder of maps.

#include <iostream>

#include "pipelines/solve/solve.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: solve_session SESSION MAPS\n";
    return 2;
  }
  sateen::SolveOptions options;
  options.capture = argv[1];
  options.output = argv[2];

  const auto outcome = sateen::SolveSession(
      options, {}, [](const std::string& warning) { std::cerr << "warning: " << warning << '\n'; });

  if (!outcome) {
    std::cerr << "error: " << outcome.error().message << '\n';
    return sateen::ExitStatus(outcome.error());
  }
  const sateen::SolveSummary& summary = outcome->field.summary;
  std::cout << summary.solved << " of " << summary.pixels << " pixels solved\n";
  if (const auto& error = outcome->evaluation.angular_error_deg) {
    std::cout << "mean angular error " << error->mean << " degrees\n";
  }
  return 0;
}
