#include "core/parallel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <mutex>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

namespace sateen::parallel_test {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

using Pieces = std::set<std::pair<int, int>>;

class CountingProgress : public Progress {
 public:
  void BeginStage(std::string_view /*name*/, int /*total*/) override {}
  void Clear() override {}
  void Advance(int steps) override { sum += steps; }

  std::atomic<int> sum = 0;
};

Pieces PiecesOn(int threads, int count, int grain) {
  Pieces pieces;
  std::mutex mutex;
  const Status done = ParallelFor(count, grain, {.threads = threads}, [&](int begin, int end) {
    const std::lock_guard lock(mutex);
    EXPECT_TRUE(pieces.emplace(begin, end).second);
  });
  EXPECT_TRUE(done);
  return pieces;
}

TEST(ParallelFor, CutsTheRangeIntoPiecesOfTheGrain) {
  EXPECT_THAT(PiecesOn(1, 7, 3), ElementsAre(std::pair(0, 3), std::pair(3, 6), std::pair(6, 7)));
  EXPECT_THAT(PiecesOn(1, 6, 3), ElementsAre(std::pair(0, 3), std::pair(3, 6)));
  EXPECT_THAT(PiecesOn(1, 2, 100), ElementsAre(std::pair(0, 2)));
  EXPECT_THAT(PiecesOn(1, 0, 3), ElementsAre());
}

TEST(ParallelFor, PiecesDoNotDependOnTheNumberOfThreads) {
  const Pieces expected = PiecesOn(1, 1000, 7);
  for (const int threads : {0, 2, 3, 16}) {
    EXPECT_EQ(PiecesOn(threads, 1000, 7), expected) << threads << " threads";
  }
}

TEST(ParallelFor, VisitsEveryIndexOnce) {
  std::vector<int> visits(100'003, 0);
  const Status done =
      ParallelFor(static_cast<int>(visits.size()), 64, {.threads = 4}, [&](int begin, int end) {
        for (int i = begin; i < end; ++i) {
          ++visits[static_cast<size_t>(i)];
        }
      });
  ASSERT_TRUE(done);
  EXPECT_THAT(visits, Each(1));
}

TEST(ParallelFor, RangeMayBeAsLargeAsAnInt) {
  constexpr int kCount = std::numeric_limits<int>::max();
  EXPECT_THAT(PiecesOn(2, kCount, kCount - 1),
              ElementsAre(std::pair(0, kCount - 1), std::pair(kCount - 1, kCount)));
}

TEST(ParallelFor, ProgressSumsToTheCount) {
  CountingProgress progress;
  const Status done = ParallelFor(1001, 10, {.threads = 4, .progress = &progress}, [](int, int) {});
  ASSERT_TRUE(done);
  EXPECT_EQ(progress.sum, 1001);
}

TEST(ParallelFor, CancelledBeforehandRunsNothing) {
  const std::atomic<bool> cancel = true;
  std::atomic<int> pieces = 0;

  const Status done = ParallelFor(100, 1, {.cancel = &cancel}, [&](int, int) { ++pieces; });

  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kCancelled);
  EXPECT_EQ(pieces, 0);
}

TEST(ParallelFor, CancelledMidwayRunsOnlyWhatHadBegun) {
  constexpr int kThreads = 4;
  std::atomic<bool> cancel = false;
  std::atomic<int> pieces = 0;
  CountingProgress progress;

  const Status done = ParallelFor(
      100'000, 1, {.threads = kThreads, .progress = &progress, .cancel = &cancel}, [&](int, int) {
        ++pieces;
        cancel = true;
      });

  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kCancelled);
  EXPECT_LE(pieces, kThreads);  // each thread may have looked at `cancel` before it was set
  EXPECT_EQ(progress.sum, pieces);
}

TEST(Task, ThreadCountIsAtLeastOne) {
  EXPECT_GE(Task{}.ThreadCount(), 1);
  EXPECT_EQ(Task{.threads = 3}.ThreadCount(), 3);
}

}  // namespace
}  // namespace sateen::parallel_test
