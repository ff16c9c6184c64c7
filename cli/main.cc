#include <csignal>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <new>

#include "cli/program.h"
#include "core/interrupt.h"
#include "core/printable.h"
#include "core/progress_bar.h"
#include "core/stray_thread.h"

namespace {

constexpr int kInternal = 1;

int Run(int argc, char** argv) {
  sateen::InstallInterruptHandlers();
  // A file that may not grow, or a reader that has gone, is an error of writing, not an end.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  sateen::ProgressBar progress(2);
  const sateen::Task task{.progress = &progress, .cancel = &sateen::InterruptFlag()};
  return sateen::cli::RunProgram(argc, argv, task, std::cout, std::cerr);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const int status = Run(argc, argv);
    if (sateen::StrayThreads() > 0) {
      std::cout.flush();
      std::cerr.flush();
      std::_Exit(status);  // what a thread still uses that hangs is left as it is
    }
    return status;
  } catch (const std::bad_alloc&) {
    std::cerr << "sateen: error: out of memory; use smaller images or fewer lights at a time\n";
    return kInternal;
  } catch (const std::exception& error) {
    std::cerr << "sateen: internal error: " << sateen::Printable(error.what()) << '\n';
    return kInternal;
  }
}
