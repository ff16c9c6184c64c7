#include "scanner/daemon/file_desk.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/stray_thread.h"
#include "tests/scanner/daemon/daemon_fakes.h"
#include "tests/testing/files.h"

namespace sateen::file_desk_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

// Stands for a disk that has gone: opening it for reading hangs until Release().
class HangingFile {
 public:
  HangingFile() { EXPECT_EQ(mkfifo(path_.c_str(), 0600), 0); }
  HangingFile(const HangingFile&) = delete;
  HangingFile& operator=(const HangingFile&) = delete;
  ~HangingFile() {
    while (StrayThreads() > before_) {  // some may not have come to it yet
      close(open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
      std::this_thread::yield();
    }
  }
  [[nodiscard]] std::function<Status()> Reading() const {
    return [path = path_] {
      std::ifstream file(path);
      return Status();
    };
  }

 private:
  testing::TempFolder folder_;
  std::filesystem::path path_ = folder_.Path() / "gone";
  int before_ = StrayThreads();
};

TEST(FileDesk, ReturnsWhatTheReadingReturns) {
  const FileDesk desk;
  EXPECT_TRUE(desk.Run([] { return Status(); }));
  const Status bad = desk.Run([]() -> Status { return Fail(ErrorCode::kBadData, "no rig"); });
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().message, "no rig");
  const Status thrown = desk.Run([]() -> Status { throw std::runtime_error("no memory"); });
  ASSERT_FALSE(thrown);
  EXPECT_THAT(thrown.error().message, HasSubstr("no memory"));
}

TEST(FileDesk, AReadingThatHangsIsLeftToItself) {
  const HangingFile hanging;
  const FileDesk desk({.patience = milliseconds(20), .most = 2});
  for (int k = 0; k < 2; ++k) {
    const Status late = desk.Run(hanging.Reading());
    ASSERT_FALSE(late);
    EXPECT_EQ(late.error().code, ErrorCode::kTimeout);
    EXPECT_THAT(late.error().message, HasSubstr("within 0.02 s"));
  }
  const Status full = desk.Run([] { return Status(); });
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().code, ErrorCode::kDevice);
  EXPECT_THAT(full.error().message, HasSubstr("2 readings of files hang"));
}

// A disk that sleeps is there all the same.
TEST(FileDesk, WaitsForDisksThatSpinUp) {
  constexpr seconds kSlowSpinUp{10};
  EXPECT_GE(FileDesk::Options().patience, 2 * kSlowSpinUp);
}

TEST(FileDesk, AReadingThatComesBackMakesRoom) {
  const FileDesk desk({.patience = milliseconds(20), .most = 1});
  {
    const HangingFile hanging;
    EXPECT_FALSE(desk.Run(hanging.Reading()));
  }
  EXPECT_TRUE(FileDesk({.most = 1}).Run([] { return Status(); }));
  EXPECT_TRUE(desk.Run([] { return Status(); }));
}

TEST(FileDesk, AClientThatHasLeftIsNotWaitedFor) {
  const HangingFile hanging;
  const FileDesk desk({.patience = testing::kLong});
  const Status left = desk.Run(hanging.Reading(), [] { return true; });
  ASSERT_FALSE(left);
  EXPECT_EQ(left.error().code, ErrorCode::kCancelled);
}

// The end of the daemon does not wait for a solve whose disk has gone.
TEST(RigServiceStop, LeavesAJobThatHangsBehind) {
  const HangingFile hanging;
  testing::FakeRig rig;
  RigService service(rig.Devices(), milliseconds(20));
  JobRequest job = testing::WorkJob([reading = hanging.Reading()](JobContext&) {
    return reading().map([] { return std::string("{}"); });
  });
  job.needs_rig = false;
  const std::uint64_t id = *service.Begin(std::move(job));
  service.Stop();
  const std::vector<JobEvent> events = testing::AllEvents(service, id);
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].type, "failed");
  EXPECT_THAT(events[0].data, HasSubstr("left behind"));
  EXPECT_THAT(events[0].data, HasSubstr("the end of the daemon"));
}

}  // namespace
}  // namespace sateen::file_desk_test
