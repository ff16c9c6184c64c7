#pragma once

#include <functional>

#include "core/error.h"
#include "core/task.h"

namespace sateen {

// Calls body(begin, end) for consecutive pieces of [0, count), each `grain` long but the last, on
// task.ThreadCount() threads. The pieces do not depend on the number of threads, so a body that
// writes only what belongs to its piece gives the same bits on any number. Advances
// task.progress by end - begin after each piece. Stops early with kCancelled.
[[nodiscard]] Status ParallelFor(int count, int grain, const Task& task,
                                 const std::function<void(int begin, int end)>& body);

}  // namespace sateen
