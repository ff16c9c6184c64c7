#pragma once

#include <chrono>
#include <functional>
#include <memory>

#include "core/error.h"
#include "scanner/daemon/job.h"

namespace sateen {

/// Reads files that clients name, each in a thread of its own. A file that never comes, as on a
/// network disk that has gone, then takes no connection and does not hold up the daemon's end.
class FileDesk {
 public:
  struct Options {
    // Longest wait for one reading: twice what a disk that spins up or an automount takes.
    std::chrono::milliseconds patience{20'000};
    // Readings that may hang at once.
    int most = 16;
  };

  FileDesk();
  explicit FileDesk(const Options& options);

  /// Runs `reading`, which must own all that it uses, and waits for its end. One that has not ended
  /// in time is left to itself.
  ///
  /// Errors   as the reading; kTimeout: it has not ended in time; kDevice: too many hang already;
  ///          kCancelled: the client has left
  [[nodiscard]] Status Run(std::function<Status()> reading, const ClientLeft& left = {}) const;

 private:
  struct Readings;
  Options options_;
  std::shared_ptr<Readings> readings_;
};

}  // namespace sateen
