#include <csignal>
#include <exception>
#include <iostream>
#include <new>

#include "cli/program.h"
#include "core/interrupt.h"
#include "core/printable.h"
#include "core/progress_bar.h"

namespace {

constexpr int kInternal = 1;

int Run(int argc, char** argv) {
  sateen::InstallInterruptHandlers();
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error of writing, not an end
  sateen::ProgressBar progress(2);
  const sateen::Task task{.progress = &progress, .cancel = &sateen::InterruptFlag()};
  return sateen::cli::RunProgram(argc, argv, task, std::cout, std::cerr);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc, argv);
  } catch (const std::bad_alloc&) {
    std::cerr << "sateen: error: out of memory; use smaller images or fewer lights at a time\n";
    return kInternal;
  } catch (const std::exception& error) {
    std::cerr << "sateen: internal error: " << sateen::Printable(error.what()) << '\n';
    return kInternal;
  }
}
