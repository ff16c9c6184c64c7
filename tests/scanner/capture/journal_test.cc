#include "scanner/capture/journal.h"

#include <gmock/gmock.h>
#include <sys/file.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>

#include "core/files/file_io.h"
#include "core/notice.h"
#include "tests/scanner/sessions/dataset_files.h"
#include "tests/testing/files.h"
#include "tests/testing/full_disk.h"

namespace {

int lock_error = 0;  // errno of every lock; 0: the disk has locks

}  // namespace

// Replaced in this program alone.
extern "C" int flock(int file, int operation) {
  if (lock_error != 0) {
    errno = lock_error;
    return -1;
  }
  return static_cast<int>(syscall(SYS_flock, file, operation));
}

namespace sateen::journal_test {
namespace {

using ::testing::HasSubstr;
using testing::IsError;
using testing::TempFolder;
using testing::WriteText;

const std::string kHash(64, 'a');

JournalBegun Begun() {
  return {.kind = SessionKind::kSheet,
          .rig = "rig.json",
          .rig_sha256 = kHash,
          .exposure_s = 0.1,
          .f_number = 5.6,
          .iso = 200.0,
          .level = 0.5,
          .brackets = 2};
}

FramePlan Planned() {
  return {{.role = FrameRole::kDark, .exposure_s = 0.1},
          {.role = FrameRole::kLit, .light = "east", .exposure_s = 0.1},
          {.role = FrameRole::kRepeat, .light = "east", .exposure_s = 0.1}};
}

SessionFrame Done(const SessionFrame& planned) {
  SessionFrame frame = planned;
  frame.file = "frames/" + planned.light + ".dng";
  frame.sha256 = kHash;
  frame.exposure_s = 1.0 / 3.0;
  frame.f_number = 8.0;
  frame.iso = 100.0;
  return frame;
}

Status WriteAll(JournalWriter& writer) {
  Status status =
      writer.Begin(Begun()).and_then([&] { return writer.Planned(Planned(), "as asked"); });
  for (size_t frame = 0; frame < 3 && status; ++frame) {
    status = writer.FrameBegun(frame).and_then(
        [&] { return writer.FrameDone(frame, Done(Planned()[frame])); });
  }
  return status.and_then([&] { return writer.Complete(); });
}

std::string WholeText() {
  const TempFolder temp;
  Result<JournalWriter> writer = JournalWriter::Open(temp.Path());
  EXPECT_TRUE(writer && WriteAll(*writer));
  return *ReadFileBytes(temp.Path() / kJournalFile);
}

// The lines of a journal, without their newlines.
std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    lines.push_back(line);
  }
  return lines;
}

Error FailureOfLines(const std::vector<std::string>& lines) {
  const auto journal = ParseJournal(testing::Lines(lines), "journal.jsonl");
  EXPECT_FALSE(journal) << testing::Lines(lines);
  return journal ? Error{ErrorCode::kDevice, ""} : journal.error();
}

// The latest exposure that was asked for counts, until another is.
TEST(Journal, APlanMayChangeTheExposureThatIsAskedFor) {
  const TempFolder temp;
  Result<JournalWriter> writer = JournalWriter::Open(temp.Path());
  ASSERT_TRUE(writer && writer->Begin(Begun()) && writer->Planned(Planned(), "as asked"));
  const auto asked = [&] { return (*ReadJournal(temp.Path()))->begun.exposure_s; };
  EXPECT_EQ(asked(), 0.1);
  ASSERT_TRUE(writer->Planned(Planned(), "anew", {.is_new = true, .exposure_s = 0.05}));
  EXPECT_EQ(asked(), 0.05);
  ASSERT_TRUE(writer->Planned(Planned(), "a brighter light"));
  EXPECT_EQ(asked(), 0.05);
  ASSERT_TRUE(writer->Planned(Planned(), "anew", {.is_new = true}));
  EXPECT_EQ(asked(), std::nullopt);
}

TEST(Journal, GivesBackWhatWasWritten) {
  const TempFolder temp;
  {
    Result<JournalWriter> writer = JournalWriter::Open(temp.Path());
    ASSERT_TRUE(writer) << writer.error().message;
    ASSERT_TRUE(writer->Begin(Begun()));
    ASSERT_TRUE(writer->Planned(Planned(), "as asked"));
    ASSERT_TRUE(writer->FrameBegun(1));
    ASSERT_TRUE(writer->FrameDone(1, Done(Planned()[1])));
    ASSERT_TRUE(writer->FrameBegun(0));
    ASSERT_TRUE(writer->FrameRejected(0, "is clipped"));
  }
  const auto read = ReadJournal(temp.Path());
  ASSERT_TRUE(read) << read.error().message;
  const Journal& journal = read->value();
  EXPECT_EQ(journal.begun.kind, SessionKind::kSheet);
  EXPECT_EQ(journal.begun.rig_sha256, kHash);
  EXPECT_EQ(journal.begun.exposure_s, 0.1);
  EXPECT_EQ(journal.begun.f_number, 5.6);
  EXPECT_EQ(journal.begun.iso, 200.0);
  EXPECT_EQ(journal.begun.level, 0.5);
  EXPECT_EQ(journal.begun.brackets, 2);
  ASSERT_EQ(journal.plan.size(), 3U);
  EXPECT_EQ(journal.plan[2].role, FrameRole::kRepeat);
  EXPECT_EQ(journal.plan[2].light, "east");
  EXPECT_EQ(journal.plan[2].exposure_s, 0.1);
  EXPECT_FALSE(journal.done[0]);
  ASSERT_TRUE(journal.done[1]);
  EXPECT_EQ(journal.done[1]->exposure_s, 1.0 / 3.0);  // to the last bit
  EXPECT_EQ(journal.done[1]->sha256, kHash);
  EXPECT_EQ(journal.rejected, 1);
  EXPECT_FALSE(journal.complete);
  EXPECT_EQ(journal.whole_bytes, std::filesystem::file_size(temp.Path() / kJournalFile));
}

// Wherever the power goes, what was on the disk before counts, and nothing else.
TEST(Journal, IsReadWhereverItsLastLineWasTorn) {
  const std::string text = WholeText();
  for (size_t bytes = 0; bytes <= text.size(); ++bytes) {
    const auto read = ParseJournal(text.substr(0, bytes), "j");
    ASSERT_TRUE(read) << bytes << ": " << read.error().message;
    const size_t whole = text.rfind('\n', bytes == 0 ? 0 : bytes - 1);
    const bool none = bytes == 0 || whole == std::string::npos;
    ASSERT_EQ(read->has_value(), !none) << bytes;
    if (!none) {
      EXPECT_EQ((*read)->whole_bytes, whole + 1);
      EXPECT_EQ((*read)->complete, bytes == text.size());
    }
  }
}

TEST(Journal, GoesOnBehindATornLine) {
  const TempFolder temp;
  const std::vector<std::string> lines = LinesOf(WholeText());
  WriteText(temp.Path() / kJournalFile, testing::Lines({lines[0], lines[1], lines[2]}) + "{\"rec");
  const auto torn = ReadJournal(temp.Path());
  ASSERT_TRUE(torn && *torn);
  {
    Result<JournalWriter> writer = JournalWriter::Open(temp.Path());
    ASSERT_TRUE(writer && writer->Keep((*torn)->whole_bytes));
    ASSERT_TRUE(writer->FrameDone(0, Done(Planned()[0])));
  }
  EXPECT_EQ(LinesOf(*ReadFileBytes(temp.Path() / kJournalFile)),
            (std::vector<std::string>{lines[0], lines[1], lines[2], lines[3]}));
}

// Each damage is an error of the line where it is.
TEST(Journal, NamesTheLineOfWhatDoesNotParse) {
  const std::vector<std::string> lines = LinesOf(WholeText());
  const auto expect = [&](const std::function<void(std::vector<std::string>&)>& change,
                          const std::string& part) {
    std::vector<std::string> changed = lines;
    change(changed);
    EXPECT_THAT(FailureOfLines(changed), IsError(ErrorCode::kBadData, part));
  };
  const auto replace = [&](size_t line, const std::string& from, const std::string& to) {
    return [=](std::vector<std::string>& changed) {
      const size_t at = changed[line].find(from);
      ASSERT_NE(at, std::string::npos) << from;
      changed[line].replace(at, from.size(), to);
    };
  };
  expect([](auto& l) { l[3].pop_back(); }, "journal.jsonl: line 4: not valid JSON");
  expect([](auto& l) { l[3] = ""; }, "line 4: not valid JSON");
  expect(replace(0, "journal/1", "journal/2"), "line 1: schema is \"sateen.journal/2\"");
  expect(replace(0, "begun", "complete"), "line 1: record is not begun");
  expect(replace(0, "\"level\":0.5", "\"level\":1.5"), "line 1: level is 1.5");
  expect(replace(0, "\"iso\":200.0", "\"iso\":0"), "line 1: iso is 0");
  expect(replace(0, "\"iso\"", "\"ISO\""), "line 1: iso is missing");
  expect(replace(0, "\"level\"", "\"gain\":1,\"level\""), "line 1: gain is not known");
  expect(replace(0, "\"brackets\":2", "\"brackets\":0"), "line 1: brackets is 0");
  expect(replace(0, "\"exposure_s\":0.1", "\"exposure_s\":0.0"), "line 1: exposure_s is not");
  expect(replace(1, "\"role\":\"dark\"", "\"role\":\"dark\",\"light\":\"x\""),
         "light is not known");
  expect(replace(1, "as asked", ""), "line 2: reason is empty");
  expect(replace(1, "0.1}]", "0}]"), "exposure_s is 0");
  expect([](auto& l) { l.erase(l.begin() + 1); }, "line 2: frame is 0; the plan has 0 frames");
  expect(replace(0, "\"rig_sha256\":\"a", "\"rig_sha256\":\"g"), "rig_sha256 is not a SHA-256");
  expect(replace(2, "\"frame\":0", "\"frame\":3"),
         "line 3: frame is 3; the plan has 3 frames, from 0");
  expect(replace(2, "\"frame\":0", "\"frame\":-1"), "line 3: frame is -1");
  expect(replace(2, "frame begun", "frame lost"), "line 3: record is \"frame lost\"");
  expect(replace(2, "}", ",\"why\":1}"), "line 3: why is not known");
  expect(replace(3, "\"is\"", "\"was\""), "line 4: is is missing");
  expect(replace(3, "\"sha256\"", "\"sha\""), "line 4: is.sha256 is missing");
  expect(replace(3, "\"iso\":100.0", "\"hue\":1"), "line 4: is.exposure_s or f_number or iso");
  expect(replace(5, "east", "west"), "line 6: is.role and light are not those of the plan");
  expect([](auto& l) { l.erase(l.begin() + 2); }, "line 3: frame is done, but was not begun");
  expect([](auto& l) { l.insert(l.begin() + 4, l[2]); }, "line 5: frame is begun again");
  expect([](auto& l) { l.insert(l.begin() + 4, l[3]); },
         "line 5: frame is done, but was not begun");
  expect([](auto& l) { l.erase(l.begin() + 6, l.begin() + 8); }, "line 7: record is complete, but");
  expect([](auto& l) { l.push_back(l[2]); }, "line 10: record follows the complete one");
  expect([](auto& l) { l.push_back(l[0]); }, "line 10: ");
  expect([](auto& l) { l[2] = R"({"record":"frame rejected","frame":0,"reason":"r"})"; },
         "line 3: frame is rejected, but was not begun");
  expect([](auto& l) { l[3] = R"({"record":"frame rejected","frame":0,"reason":""})"; },
         "line 4: reason is empty");
}

// A new plan makes every frame open again.
TEST(Journal, ALaterPlanCountsAlone) {
  std::vector<std::string> lines = LinesOf(WholeText());
  lines.insert(lines.begin() + 4, lines[1]);
  EXPECT_THAT(FailureOfLines(lines), IsError(ErrorCode::kBadData, "not every frame is done"));
  lines.insert(lines.begin() + 5, {lines[2], lines[3]});
  const auto journal = ParseJournal(testing::Lines(lines), "j");
  ASSERT_TRUE(journal) << journal.error().message;
  EXPECT_TRUE((*journal)->complete);
}

// A frame that was done and is rejected has to be taken again.
TEST(Journal, ARejectedFrameIsOpenAgain) {
  std::vector<std::string> lines = LinesOf(WholeText());
  lines.insert(lines.begin() + 4, R"({"record":"frame rejected","frame":0,"reason":"moved"})");
  EXPECT_THAT(FailureOfLines(lines), IsError(ErrorCode::kBadData, "not every frame is done"));
  lines.insert(lines.begin() + 5, {lines[2], lines[2], lines[3]});  // begun twice: killed once
  const auto journal = ParseJournal(testing::Lines(lines), "j");
  ASSERT_TRUE(journal) << journal.error().message;
  EXPECT_TRUE((*journal)->complete);
}

TEST(Journal, HasOneWriterAtATime) {
  const TempFolder temp;
  const Result<JournalWriter> first = JournalWriter::Open(temp.Path());
  ASSERT_TRUE(first);
  const Result<JournalWriter> second = JournalWriter::Open(temp.Path());
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error(), IsError(ErrorCode::kIo, "another program is capturing"));
}

TEST(Journal, IsWrittenWithoutALockWhereTheDiskHasNone) {
  const TempFolder temp;
  std::vector<std::string> notices;
  const NoticesTo here([&](const std::string& text) { notices.push_back(text); });
  for (const int reason : {ENOLCK, EOPNOTSUPP, ENOSYS}) {
    notices.clear();
    lock_error = reason;
    Result<JournalWriter> writer = JournalWriter::Open(temp.Path());
    lock_error = 0;
    ASSERT_TRUE(writer) << writer.error().message;
    EXPECT_TRUE(writer->Begin(Begun()));
    ASSERT_EQ(notices.size(), 1U);
    EXPECT_THAT(notices[0], HasSubstr(temp.Path().string() + ": this disk has no file locks"));
    EXPECT_THAT(notices[0], HasSubstr("let only one do so"));
  }
}

TEST(Journal, NamesTheReasonWhyItCannotBeLocked) {
  const TempFolder temp;
  for (const int reason : {EIO, EACCES}) {  // a conflict may be EACCES on a Windows share
    lock_error = reason;
    const Result<JournalWriter> writer = JournalWriter::Open(temp.Path());
    lock_error = 0;
    ASSERT_FALSE(writer);
    EXPECT_THAT(writer.error(), IsError(ErrorCode::kIo, "journal.jsonl: cannot be locked: " +
                                                            SystemReason(reason)));
  }
}

TEST(Journal, AFullDiskLeavesTheRecordsBefore) {
  const TempFolder temp;
  Result<JournalWriter> writer = JournalWriter::Open(temp.Path());
  ASSERT_TRUE(writer && writer->Begin(Begun()) && writer->Planned(Planned(), "as asked"));
  const std::string before = *ReadFileBytes(temp.Path() / kJournalFile);
  {
    const testing::FullDisk full(before.size() + 10);
    const Status failed = writer->FrameBegun(0);
    ASSERT_FALSE(failed);
    EXPECT_THAT(failed.error(), IsError(ErrorCode::kIo, "File too large"));
  }
  EXPECT_EQ(*ReadFileBytes(temp.Path() / kJournalFile), before);
  EXPECT_FALSE(writer->FrameBegun(0));  // not behind what may be torn
  EXPECT_EQ(*ReadFileBytes(temp.Path() / kJournalFile), before);
}

}  // namespace
}  // namespace sateen::journal_test
