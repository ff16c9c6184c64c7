#include "core/progress_bar.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

namespace sateen::progress_bar_test {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

// Collects what is written to a terminal; a thread reads it, as a terminal's buffer is small.
class Terminal {
 public:
  Terminal() : reader_fd_(posix_openpt(O_RDWR | O_NOCTTY)) {
    EXPECT_EQ(grantpt(reader_fd_), 0);
    EXPECT_EQ(unlockpt(reader_fd_), 0);
    fd_ = open(ptsname(reader_fd_), O_RDWR | O_NOCTTY);
    reader_ = std::thread([this] {
      std::array<char, 4096> piece = {};
      ssize_t count = 0;
      while ((count = read(reader_fd_, piece.data(), piece.size())) > 0) {  // until it is closed
        text_.append(piece.data(), static_cast<size_t>(count));
      }
    });
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  ~Terminal() { Text(); }

  [[nodiscard]] int Fd() const { return fd_; }
  // Ends the terminal.
  const std::string& Text() {
    if (reader_.joinable()) {
      close(fd_);
      reader_.join();
      close(reader_fd_);
    }
    return text_;
  }

 private:
  int reader_fd_ = -1;
  int fd_ = -1;
  std::thread reader_;
  std::string text_;
};

TEST(ProgressBar, DrawsNothingAfterClearUntilTheNextStage) {
  Terminal terminal;
  ProgressBar bar(terminal.Fd());
  bar.BeginStage("solving", 2);

  bar.Clear();
  std::this_thread::sleep_for(std::chrono::milliseconds(110));  // so that it may draw again
  bar.Advance(1);

  EXPECT_THAT(terminal.Text(), EndsWith("\r"));  // the cleared line is the last that was written
}

TEST(ProgressBar, DrawsOnATerminalAndClearsItsLine) {
  Terminal terminal;
  {
    ProgressBar bar(terminal.Fd());
    bar.BeginStage("solving", 4);
    bar.BeginStage("writing", 2);
  }
  const std::string& text = terminal.Text();

  EXPECT_THAT(text, StartsWith("\rsolving "));
  EXPECT_THAT(text, HasSubstr("\rwriting "));
  EXPECT_THAT(text, HasSubstr("]   0 %"));
  const size_t longest = 63;  // the drawn line: what clears it must be as long
  EXPECT_THAT(text, EndsWith("\r" + std::string(longest, ' ') + "\r"));
}

TEST(ProgressBar, ShowsTheShareThatIsDone) {
  Terminal terminal;
  {
    ProgressBar bar(terminal.Fd());
    bar.BeginStage("solving", 4);
    bar.Advance(1);
  }
  // A quarter of the 30 places of the bar.
  EXPECT_THAT(terminal.Text(), HasSubstr(" [#######" + std::string(23, ' ') + "]  25 %"));
}

TEST(ProgressBar, LinesAreOfOneWidthWhateverTheNameAndTheSteps) {
  Terminal terminal;
  {
    ProgressBar bar(terminal.Fd());
    bar.BeginStage("a name that is far too long for the line", 0);
    bar.BeginStage("short", 1);
  }
  std::string text = terminal.Text();
  std::replace(text.begin(), text.end(), '\r', '\n');
  EXPECT_THAT(text, ::testing::MatchesRegex("(\n[^\n]{63})+\n {63}\n"));
}

TEST(ProgressBar, RedrawsFarLessOftenThanItAdvances) {
  constexpr int kThreads = 4;
  constexpr int kSteps = 50'000;
  Terminal terminal;
  {
    ProgressBar bar(terminal.Fd());
    bar.BeginStage("solving", kThreads * kSteps);
    std::vector<std::thread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&] {
        for (int i = 0; i < kSteps; ++i) {
          bar.Advance(1);
        }
      });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
  }
  const std::string& text = terminal.Text();
  // Ten draws per second: this many only if the loop above took over half an hour.
  EXPECT_LT(std::count(text.begin(), text.end(), '\r'), kThreads * kSteps / 10);
}

TEST(ProgressBar, SilentWhereThereIsNoTerminal) {
  std::array<int, 2> ends = {};
  ASSERT_EQ(pipe(ends.data()), 0);
  {
    ProgressBar bar(ends[1]);
    bar.BeginStage("solving", 2);
    bar.Advance(2);
  }
  close(ends[1]);
  char byte = 0;
  EXPECT_EQ(read(ends[0], &byte, 1), 0);  // the end of the stream, with nothing before it
  close(ends[0]);
}

TEST(ProgressBar, NothingIsClearedWhereNothingWasDrawn) {
  Terminal terminal;
  { const ProgressBar bar(terminal.Fd()); }
  EXPECT_THAT(terminal.Text(), IsEmpty());
}

}  // namespace
}  // namespace sateen::progress_bar_test
