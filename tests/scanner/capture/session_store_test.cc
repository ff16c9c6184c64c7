#include "scanner/capture/session_store.h"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/notice.h"
#include "core/sha256.h"
#include "scanner/capture/session_folder.h"
#include "tests/scanner/sessions/dataset_files.h"
#include "tests/testing/tree.h"

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
    ASSERT_TRUE(store.BeginFrame(frame));
    const Status kept = KeepBegun(store, frame, "DSC.DNG");
    ASSERT_TRUE(kept) << kept.error().message;
  }
  static Status KeepBegun(SessionStore& store, size_t frame, const std::string& name) {
    const std::string text = fmt::format("frame {}", frame);
    const fs::path delivered = store.Incoming() / fmt::format("{:02}", frame) / name;
    testing::WriteText(delivered, text);
    SessionFrame record = store.Record().plan[frame];
    record.file = FileNameOf(frame, record, delivered);
    record.sha256 = Sha256(text);
    record.f_number = 8.0;
    record.iso = 100.0;
    return store.KeepFrame(frame, record, delivered);
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
    EXPECT_FALSE(fs::exists(store.Incoming() / "02"));
  }
  EXPECT_TRUE(fs::exists(dir_ / "frames/02-west.dng"));
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
    const fs::path incoming = store.Incoming();
    EXPECT_TRUE(fs::is_directory(incoming));
    EXPECT_FALSE(store.HasSessionJson());
    EXPECT_TRUE(store.Complete(SessionOf(store.Record())));
    EXPECT_TRUE(store.HasSessionJson());
    EXPECT_FALSE(fs::exists(incoming));
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

// Plans of several exposures have other names, and more of them.
TEST_F(SessionStoreTest, CompletingRemovesFramesOfEarlierPlans) {
  {
    SessionStore store = SessionStore::Begin(dir_, rig_file_, {}).value();
    ASSERT_TRUE(store.SetPlan(PlanOf(store.GetRig(), {0.1, 0.8}), "found"));
    KeepAll(store);
    ASSERT_TRUE(fs::exists(dir_ / "frames/09-east-again.dng"));
  }
  SessionStore store = SessionStore::Resume(dir_).value();
  ASSERT_TRUE(store.SetPlan(PlanOf(store.GetRig(), {0.1}), "as asked"));
  KeepAll(store);

  ASSERT_TRUE(store.Complete(SessionOf(store.Record())));

  EXPECT_THAT(testing::Listing(dir_ / "frames"),
              ElementsAre("00-dark.dng", "01-east.dng", "02-west.dng", "03-north.dng",
                          "04-south.dng", "05-east-again.dng", "06-dark.dng"));
}

TEST_F(SessionStoreTest, WhatItsJournalDidNotBeginIsNamedOnceAndLeft) {
  std::vector<std::string> notices;
  const NoticesTo here([&](const std::string& text) { notices.push_back(text); });
  const fs::path far = temp_.Path() / "far";
  testing::WriteText(far / "03-north.dng", "mine");
  SessionStore store = Begin();
  const fs::path frames = dir_ / "frames";
  testing::WriteText(frames / "notes.txt", "mine");
  testing::WriteText(frames / "99-led-7.dng", "mine");
  testing::WriteText(frames / "00-dark.jpg", "mine");
  testing::WriteText(frames / "folder/01-east.dng", "mine");
  fs::create_symlink(far / "03-north.dng", frames / "07-north.dng");
  fs::create_directory_symlink(far, frames / "link");
  KeepAll(store);

  ASSERT_TRUE(store.Complete(SessionOf(store.Record())));

  EXPECT_THAT(notices,
              ElementsAre(frames.string() +
                          ": 6 entries are not of this capture and left alone: 00-dark.jpg, "
                          "07-north.dng, 99-led-7.dng, folder, link and 1 more"));
  EXPECT_EQ(testing::Listing(frames).size(), 7 + 7U);
  EXPECT_EQ(testing::ReadText(far / "03-north.dng"), "mine");
}

TEST_F(SessionStoreTest, AFrameDoesNotTakeThePlaceOfAnotherFile) {
  SessionStore store = Begin();
  const fs::path place = dir_ / "frames/01-east.dng";
  testing::WriteText(place, "mine");
  EXPECT_THAT(store.BeginFrame(1).error(),
              IsError(ErrorCode::kInvalidArgument,
                      place.string() +
                          ": is not of this capture and has the place of its frame 2; move it"));
  fs::remove(place);
  testing::WriteText(temp_.Path() / "far", "mine");
  fs::create_symlink(temp_.Path() / "far", place);
  EXPECT_THAT(store.BeginFrame(1).error(), IsError(ErrorCode::kInvalidArgument, "not of this"));
  fs::remove(place);
  ASSERT_TRUE(store.BeginFrame(1));
  fs::create_symlink(temp_.Path() / "far", place);  // between the begin and the end of it
  SessionFrame record = store.Record().plan[1];
  record.file = "frames/01-east.dng";
  EXPECT_THAT(store.KeepFrame(1, record, store.Incoming() / "01/DSC.DNG").error(),
              IsError(ErrorCode::kInvalidArgument, "01-east.dng: is a link or a folder where"));
  EXPECT_EQ(testing::ReadText(temp_.Path() / "far"), "mine");
}

// A person has converted frames beside them: the stem is the capture's, the file is not.
TEST_F(SessionStoreTest, AFileBesideAFrameThatWasDoneIsNamedAndLeft) {
  std::vector<std::string> notices;
  const NoticesTo here([&](const std::string& text) { notices.push_back(text); });
  const fs::path frames = dir_ / "frames";
  {
    SessionStore store = SessionStore::Begin(dir_, rig_file_, {}).value();
    ASSERT_TRUE(store.SetPlan(PlanOf(store.GetRig(), {0.1, 0.8}), "found"));
    KeepAll(store);
    testing::WriteText(frames / "01-east.nef", "mine");
    testing::WriteText(frames / "09-east-again.nef", "mine");  // a frame of this plan alone
  }
  SessionStore store = SessionStore::Resume(dir_).value();
  ASSERT_TRUE(store.SetPlan(PlanOf(store.GetRig(), {0.1}), "as asked"));
  KeepAll(store);
  testing::WriteText(frames / "02-west.cr2", "mine");
  ASSERT_TRUE(store.RejectFrame(2, "moved"));
  Keep(store, 2);

  ASSERT_TRUE(store.Complete(SessionOf(store.Record())));

  EXPECT_THAT(testing::Listing(frames),
              ElementsAre("00-dark.dng", "01-east.dng", "01-east.nef", "02-west.cr2", "02-west.dng",
                          "03-north.dng", "04-south.dng", "05-east-again.dng", "06-dark.dng",
                          "09-east-again.nef"));
  EXPECT_THAT(notices,
              ElementsAre(frames.string() + ": 3 entries are not of this capture and left alone: "
                                            "01-east.nef, 02-west.cr2, 09-east-again.nef"));
}

TEST_F(SessionStoreTest, AFrameOfAnotherEndingDoesNotTakeThePlaceOfAFileBesideIt) {
  SessionStore store = Begin();
  Keep(store, 1);
  const fs::path beside = dir_ / "frames/01-east.nef";
  testing::WriteText(beside, "mine");
  ASSERT_TRUE(store.RejectFrame(1, "too dark"));
  ASSERT_TRUE(store.BeginFrame(1));
  EXPECT_THAT(KeepBegun(store, 1, "DSC.NEF").error(),  // from another camera
              IsError(ErrorCode::kInvalidArgument, beside.string() + ": is not of this capture"));
  EXPECT_EQ(testing::ReadText(beside), "mine");
  EXPECT_TRUE(KeepBegun(store, 1, "DSC.DNG"));
}

TEST_F(SessionStoreTest, BeginningAgainLeavesAFileBesideAFrameThatWasDone) {
  {
    SessionStore store = Begin();
    Keep(store, 0);
    testing::WriteText(dir_ / "frames/00-dark.nef", "mine");
    ASSERT_TRUE(store.RejectFrame(0, "not dark"));
  }
  SessionStore store = Begin();
  EXPECT_THAT(testing::Listing(dir_ / "frames"), ElementsAre("00-dark.nef"));
}

// Killed after the first frame was put in place and before the journal said so.
TEST_F(SessionStoreTest, BeginningAgainRemovesWhatTheFormerJournalBegan) {
  {
    SessionStore store = Begin();
    ASSERT_TRUE(store.BeginFrame(0));
    testing::WriteText(dir_ / "frames/00-dark.dng", "half");
    testing::WriteText(store.Incoming() / "00-1/DSC.DNG", "half");
  }
  SessionStore store = Begin();
  EXPECT_FALSE(fs::exists(dir_ / "frames/00-dark.dng"));
  Keep(store, 0);
}

// Killed after session.json had its name and before the hidden folders were gone.
TEST_F(SessionStoreTest, ResumingACompleteSessionRemovesWhatAKilledRunLeft) {
  {
    SessionStore store = Begin();
    KeepAll(store);
    ASSERT_TRUE(store.Complete(SessionOf(store.Record())));
  }
  const std::vector<std::string> complete = testing::Listing(dir_);
  const pid_t child = fork();
  if (child == 0) {
    const OwnFolder staging = OwnFolder::Make(dir_, ".sateen-").value();
    const OwnFolder incoming = OwnFolder::Make(dir_, ".sateen-incoming-").value();
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  ASSERT_EQ(testing::Listing(dir_).size(), complete.size() + 4);

  ASSERT_TRUE(SessionStore::Resume(dir_));

  EXPECT_EQ(testing::Listing(dir_), complete);
}

TEST_F(SessionStoreTest, LinksInPlaceOfItsOwnFilesAreRefused) {
  const fs::path far = temp_.Path() / "far";
  testing::WriteText(far / "file", "");
  for (const char* name : {"frames", "journal.jsonl", "session.json", "rig.json"}) {
    fs::create_directories(dir_);
    fs::create_symlink(name == std::string("frames") ? far : far / "new", dir_ / name);
    const std::string words = (dir_ / name).string() + ": is a link, and a session holds its own";
    EXPECT_THAT(CheckBegin(dir_, rig_file_, {}).error(),
                IsError(ErrorCode::kInvalidArgument, words));
    EXPECT_THAT(CheckResume(dir_).error(), IsError(ErrorCode::kInvalidArgument, words));
    EXPECT_THAT(JournalWriter::Open(dir_).has_value(), name != std::string("journal.jsonl"));
    fs::remove_all(dir_);
  }
  EXPECT_THAT(testing::Listing(far), ElementsAre("file"));
}

TEST_F(SessionStoreTest, AnotherRigInTheFolderIsNotReplaced) {
  const fs::path there = dir_ / "rig.json";
  Rig another = testing::FourLights();
  another.lights.pop_back();
  testing::WriteText(there, RigToJson(another));
  EXPECT_THAT(SessionStore::Begin(dir_, rig_file_, {}).error(),
              IsError(ErrorCode::kInvalidArgument,
                      there.string() + ": is another rig than " + rig_file_.string()));
  EXPECT_EQ(testing::ReadText(there), RigToJson(another));
  EXPECT_THAT(testing::Listing(dir_), ElementsAre("rig.json"));

  EXPECT_TRUE(SessionStore::Begin(dir_, there, {})) << "the very rig that is there";
  EXPECT_TRUE(SessionStore::Begin(dir_, rig_file_, {})) << "the copy of a capture without a frame";
  EXPECT_EQ(testing::ReadText(there), testing::ReadText(rig_file_));
}

TEST_F(SessionStoreTest, IsLockedWhileItLives) {
  const SessionStore store = Begin();
  EXPECT_THAT(SessionStore::Resume(dir_).error(),
              IsError(ErrorCode::kIo, "another program is capturing"));
}

}  // namespace
}  // namespace sateen::session_store_test
