#include "scanner/capture/session_store.h"

#include <gmock/gmock.h>

#include "core/sha256.h"
#include "scanner/capture/session_folder.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::session_store_test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::IsError;

class SessionStoreTest : public ::testing::Test {
 protected:
  SessionStoreTest() { testing::WriteText(rig_file_, RigToJson(testing::FourLights())); }

  SessionStore Begin() {
    SessionStore store = SessionStore::Begin(dir_, rig_file_, {}).value();
    EXPECT_TRUE(store.SetPlan(PlanOf(store.GetRig(), {0.1}), "as asked"));
    return store;
  }
  // Delivers a file and keeps it as the frame.
  static void Keep(SessionStore& store, size_t frame) {
    const std::string text = fmt::format("frame {}", frame);
    const fs::path delivered = store.Incoming() / fmt::format("{:02}", frame) / "DSC.DNG";
    testing::WriteText(delivered, text);
    SessionFrame record = store.Record().plan[frame];
    record.file = FileNameOf(frame, record, delivered);
    record.sha256 = Sha256(text);
    record.f_number = 8.0;
    record.iso = 100.0;
    ASSERT_TRUE(store.BeginFrame(frame));
    ASSERT_TRUE(store.KeepFrame(frame, record, delivered));
  }
  static void KeepAll(SessionStore& store) {
    for (const size_t frame : store.Open()) {
      Keep(store, frame);
    }
  }

  testing::TempFolder temp_;
  fs::path dir_ = temp_.Path() / "s";
  fs::path rig_file_ = temp_.Path() / "rig.json";
};

TEST_F(SessionStoreTest, KeepsFramesAndResumesWithThem) {
  {
    SessionStore store = Begin();
    Keep(store, 0);
    Keep(store, 2);
    EXPECT_THAT(store.Open(), ElementsAre(1, 3, 4, 5, 6));
    EXPECT_EQ(store.Taken(), 2);
  }
  EXPECT_TRUE(fs::exists(dir_ / "frames/02-west.dng"));
  EXPECT_FALSE(fs::exists(dir_ / kIncoming / "02"));
  const Result<SessionStore> resumed = SessionStore::Resume(dir_);
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_THAT(resumed->Open(), ElementsAre(1, 3, 4, 5, 6));
  EXPECT_EQ(resumed->Taken(), 0);
}

TEST_F(SessionStoreTest, OpensFramesThatAreRejectedOrWhoseFilesChanged) {
  SessionStore store = Begin();
  KeepAll(store);
  EXPECT_THAT(store.Open(), IsEmpty());
  EXPECT_TRUE(store.RejectFrame(3, "too dark"));
  testing::WriteText(dir_ / "frames/01-east.dng", "another");
  EXPECT_TRUE(store.VerifyDone());
  EXPECT_THAT(store.Open(), ElementsAre(1, 3));
  EXPECT_EQ(store.Rejected(), 2);
}

TEST_F(SessionStoreTest, CompletesWithSessionJsonAndNothingElse) {
  {
    SessionStore store = Begin();
    KeepAll(store);
    testing::WriteText(dir_ / "frames/99-led-7.dng", "of an earlier plan");
    EXPECT_FALSE(store.HasSessionJson());
    EXPECT_TRUE(store.Complete(SessionOf(store.Record())));
    EXPECT_TRUE(store.HasSessionJson());
    EXPECT_FALSE(fs::exists(dir_ / "frames/99-led-7.dng"));
    EXPECT_FALSE(fs::exists(store.Incoming()));
  }
  testing::WriteText(dir_ / "frames/01-east.dng", "another");
  SessionStore complete = SessionStore::Resume(dir_).value();
  EXPECT_THAT(complete.VerifyDone().error(),
              IsError(ErrorCode::kBadData, "restore the file, or capture again"));
  EXPECT_THAT(CheckBegin(dir_, rig_file_, {}).error(),
              IsError(ErrorCode::kInvalidArgument, "holds a session already"));
}

TEST_F(SessionStoreTest, ANewPlanOpensAllFramesAndRecordsItsExposure) {
  {
    SessionStore store = Begin();
    KeepAll(store);
    EXPECT_TRUE(store.SetPlan(PlanOf(store.GetRig(), {0.2}), "as asked",
                              {.is_new = true, .exposure_s = 0.2}));
    EXPECT_EQ(store.Open().size(), 7U);
    EXPECT_EQ(store.Record().begun.exposure_s, 0.2);
  }
  EXPECT_EQ(SessionStore::Resume(dir_)->Record().begun.exposure_s, 0.2);
}

TEST_F(SessionStoreTest, IsLockedWhileItLives) {
  const SessionStore store = Begin();
  EXPECT_THAT(SessionStore::Resume(dir_).error(),
              IsError(ErrorCode::kIo, "another program is capturing"));
}

}  // namespace
}  // namespace sateen::session_store_test
