#include "core/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "core/check.h"

namespace sateen {

Status ParallelFor(int count, int grain, const Task& task,
                   const std::function<void(int begin, int end)>& body) {
  SATEEN_CHECK(count >= 0 && grain > 0);
  const int pieces = count / grain + (count % grain != 0 ? 1 : 0);
  const auto run_piece = [&](int piece) {
    if (task.Cancelled()) {
      return;
    }
    const int begin = piece * grain;
    const int end = begin + std::min(grain, count - begin);
    body(begin, end);
    task.Advance(end - begin);
  };
  // oneTBB would not go beyond the cores otherwise.
  const tbb::global_control limit(
      tbb::global_control::max_allowed_parallelism,
      static_cast<size_t>(std::max(task.ThreadCount(), Task().ThreadCount())));
  tbb::task_arena arena(task.ThreadCount());
  arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<int>(0, pieces, 1),
        [&](const tbb::blocked_range<int>& range) {
          for (int piece = range.begin(); piece < range.end(); ++piece) {
            run_piece(piece);
          }
        },
        tbb::simple_partitioner());
  });
  return task.CheckCancelled();
}

}  // namespace sateen
