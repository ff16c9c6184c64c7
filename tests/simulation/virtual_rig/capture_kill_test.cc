#include <fcntl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

#include "core/files/file_io.h"
#include "scanner/capture/session_proof.h"
#include "tests/simulation/virtual_rig/capture_fakes.h"

// A capture that is killed, or whose disk is full, at each call that changes a file. The calls are
// replaced below, in this program alone; each run is a process of its own.
namespace {

enum class Fault { kNone, kKill, kFullDisk };

struct Plan {
  Fault fault = Fault::kNone;
  int at = -1;    // the point, or of a full disk the write, at which it strikes
  int point = 0;  // points passed so far
  int write = 0;  // writes so far
};
Plan* plan = nullptr;  // null: calls are let through; else in memory shared with the parent

// A frame is flushed by another thread than the one that writes the journal.
int Passed(int& count) { return std::atomic_ref(count).fetch_add(1); }

// Whether the process is killed here.
bool Kills() {
  return plan != nullptr && Passed(plan->point) == plan->at && plan->fault == Fault::kKill;
}
bool DiskIsFull() {
  return plan != nullptr && Passed(plan->write) == plan->at && plan->fault == Fault::kFullDisk;
}

[[noreturn]] void Die() {
  syscall(SYS_exit_group, 77);
  std::abort();
}

template <typename Call>
auto KillAround(const Call& call) {
  if (Kills()) {
    Die();
  }
  const auto result = call();
  if (Kills()) {
    Die();
  }
  return result;
}

}  // namespace

extern "C" {

// A write can be cut off in the middle, or find the disk full.
ssize_t write(int fd, const void* bytes, size_t count) {
  const bool kills = fd > 2 && Kills();
  const bool full = fd > 2 && DiskIsFull();
  if (kills || full) {
    syscall(SYS_write, fd, bytes, count / 2);
    if (kills) {
      Die();
    }
    errno = ENOSPC;
    return -1;
  }
  const ssize_t written = syscall(SYS_write, fd, bytes, count);
  if (fd > 2 && Kills()) {
    Die();
  }
  return written;
}

int fsync(int) {  // writes of a test may be lost with the power
  return KillAround([] { return 0; });
}

int rename(const char* from, const char* to) {
  return KillAround([&] { return static_cast<int>(syscall(SYS_rename, from, to)); });
}

}  // extern "C"

namespace sateen::testing::capture_kill_test {
namespace {

namespace fs = std::filesystem;

constexpr int kWhole = 0;
constexpr int kKilled = 77;
constexpr int kOtherwise = 1;
constexpr int kStride = 5;  // step between the points that are tried; every kind of call comes up
constexpr int kFullDisks = 20;

class CaptureKill : public BoardTest {
 protected:
  CaptureKill() : rig_(CaptureRig()), images_(LightImages(rig_)) {
    WriteText(rig_file_, RigToJson(rig_));
    plan_ = static_cast<Plan*>(
        mmap(nullptr, sizeof(Plan), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  }
  ~CaptureKill() override { munmap(plan_, sizeof(Plan)); }

  // Runs `body` in a process of its own; its exit status, or kOtherwise.
  template <typename Body>
  static int InChild(const Body& body) {
    const pid_t child = fork();
    if (child == 0) {
      _exit(body());
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : kOtherwise;
  }

  // Goes on where a journal was begun, else begins.
  Result<CaptureSummary> Capture(const fs::path& dir) {
    LightBoard host(std::make_unique<SimulatedPort>(*board_));
    LitCamera camera(*board_, images_);
    const bool begun =
        fs::exists(dir / kJournalFile) && ReadJournal(dir).value_or(std::nullopt).has_value();
    Result<CaptureSession> session = begun ? CaptureSession::Resume(dir, QuickCapture())
                                           : CaptureSession::Begin(dir, rig_file_, QuickCapture());
    if (!session) {
      return tl::unexpected(session.error());
    }
    constexpr std::size_t kFrames = 13;  // frames of a capture that has no plan yet
    const std::size_t open = session->Record().plan.empty() ? kFrames : session->Open().size();
    Result<CaptureSummary> summary = session->Run(host, camera, {.threads = 1});
    if (summary && static_cast<std::size_t>(camera.captures) > open + 1) {
      return Fail(ErrorCode::kBadData, "{} captures for {} open frames", camera.captures, open);
    }
    return summary;
  }

  static int Report(const Status& status) {
    if (!status) {
      fmt::print(stderr, "{}\n", status.error().message);
    }
    return status ? kWhole : kOtherwise;
  }

  // With every call let through.
  int Whole(const fs::path& dir) {
    return InChild([&] {
      plan = nullptr;
      return Report(Capture(dir).and_then(
          [&](const CaptureSummary&) { return VerifySession(dir, {}).map([](int) {}); }));
    });
  }

  void ExpectSame(const fs::path& dir, const fs::path& other, int point) {
    for (const auto& entry : fs::directory_iterator(other / "frames")) {
      const fs::path name = entry.path().filename();
      EXPECT_EQ(Sha(dir / "frames" / name), Sha(entry.path())) << name << " at point " << point;
    }
    EXPECT_EQ(*ReadFileBytes(dir / "session.json"), *ReadFileBytes(other / "session.json"));
  }
  static std::string Sha(const fs::path& path) { return ReadFileBytes(path).value_or("absent"); }

  // Every point of an undisturbed capture, which goes to `dir`.
  int CountPoints(const fs::path& dir) {
    *plan_ = {};
    EXPECT_EQ(InChild([&] {
                plan = plan_;
                return Report(Capture(dir).map([](const CaptureSummary&) {}));
              }),
              kWhole);
    return plan_->point;
  }

  TempFolder temp_;
  fs::path rig_file_ = temp_.Path() / "rig.json";
  Rig rig_;
  std::vector<Image3> images_;
  Plan* plan_ = nullptr;
};

TEST_F(CaptureKill, GoesOnFromEveryPoint) {
  const fs::path undisturbed = temp_.Path() / "undisturbed";
  const int points = CountPoints(undisturbed);
  int tried = 0;
  for (int point = 0; point < points; point += kStride) {
    const fs::path dir = temp_.Path() / fmt::format("killed-{}", point);
    *plan_ = {.fault = Fault::kKill, .at = point};
    ASSERT_EQ(InChild([&] {
                plan = plan_;
                return Report(Capture(dir).map([](const CaptureSummary&) {}));
              }),
              kKilled)
        << point;
    ASSERT_EQ(Whole(dir), kWhole) << "after a kill at point " << point;
    ExpectSame(dir, undisturbed, point);
    fs::remove_all(dir);
    ++tried;
  }
  fmt::print("killed at {} of {} points: every session resumed, verified and is the same\n", tried,
             points);
  EXPECT_GE(tried, 60);
}

TEST_F(CaptureKill, AFullDiskIsAnErrorAtEveryWrite) {
  const fs::path undisturbed = temp_.Path() / "undisturbed";
  CountPoints(undisturbed);
  const int writes = plan_->write;
  const int stride = std::max(1, writes / kFullDisks);
  int full = 0;
  for (int at = 0; at < writes; at += stride, ++full) {
    const fs::path dir = temp_.Path() / fmt::format("full-{}", at);
    *plan_ = {.fault = Fault::kFullDisk, .at = at};
    ASSERT_EQ(InChild([&] {
                plan = plan_;
                const Result<CaptureSummary> summary = Capture(dir);
                return !summary && summary.error().code == ErrorCode::kIo
                           ? kWhole
                           : Report(Fail(ErrorCode::kBadData, "{}",
                                         summary ? "no error" : summary.error().message));
              }),
              kWhole)
        << at;
    EXPECT_FALSE(fs::exists(dir / "session.json")) << at;
    ASSERT_EQ(Whole(dir), kWhole) << "after a full disk at write " << at;
    ExpectSame(dir, undisturbed, at);
    fs::remove_all(dir);
  }
  fmt::print("disk full at {} of {} writes: an error each time, and every session was resumed\n",
             full, writes);
  EXPECT_GE(full, 15);
}

}  // namespace
}  // namespace sateen::testing::capture_kill_test
