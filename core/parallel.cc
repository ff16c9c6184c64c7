#include "core/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "core/check.h"

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace sateen {
namespace {

// Tell the thread sanitizer what oneTBB, which is not instrumented, makes sure of: what happened
// before Release has happened for who comes from Acquire. Global, as there is nothing else that a
// thread may read before Acquire.
[[maybe_unused]] char loop_begins;
[[maybe_unused]] char piece_ends;
void Release([[maybe_unused]] char* event) {
#ifdef __SANITIZE_THREAD__
  __tsan_release(event);
#endif
}
void Acquire([[maybe_unused]] char* event) {
#ifdef __SANITIZE_THREAD__
  __tsan_acquire(event);
#endif
}

}  // namespace

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
  Release(&loop_begins);
  arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<int>(0, pieces, 1),
        [&](const tbb::blocked_range<int>& range) {
          Acquire(&loop_begins);
          for (int piece = range.begin(); piece < range.end(); ++piece) {
            run_piece(piece);
          }
          Release(&piece_ends);
        },
        tbb::simple_partitioner());
  });
  Acquire(&piece_ends);
  return task.CheckCancelled();
}

}  // namespace sateen
