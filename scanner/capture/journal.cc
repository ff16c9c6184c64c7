#include "scanner/capture/journal.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/check.h"
#include "core/files/file_io.h"
#include "core/json.h"
#include "core/notice.h"
#include "scanner/sessions/session_json.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

double ReadSetting(JsonReader& json, std::string_view key) {
  const double value = json.Number(key);
  json.Require(value > 0.0, key, fmt::format("is {}; need more than 0", value));
  return value;
}

Result<JournalBegun> ReadBegun(JsonReader& json) {
  JournalBegun begun;
  begun.kind = ReadSessionKind(json, "kind");
  begun.rig = ReadFileName(json, "rig");
  begun.rig_sha256 = ReadHash(json, "rig_sha256").value_or("");
  json.Require(!begun.rig_sha256.empty(), "rig_sha256", "is missing; need the rig's hash");
  begun.exposure_s = json.OptionalNumber("exposure_s");
  json.Require(begun.exposure_s.value_or(1.0) > 0.0, "exposure_s", "is not above 0");
  begun.f_number = ReadSetting(json, "f_number");
  begun.iso = ReadSetting(json, "iso");
  begun.level = ReadSetting(json, "level");
  json.Require(begun.level <= 1.0, "level", fmt::format("is {}; need at most 1", begun.level));
  begun.brackets = json.Integer("brackets");
  json.Require(begun.brackets >= 1, "brackets",
               fmt::format("is {}; need at least 1", begun.brackets));
  if (const Status status = json.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  return begun;
}

Result<FramePlan> ReadFramePlan(JsonReader& json) {
  json.Require(!json.String("reason").empty(), "reason", "is empty; need the reason");
  std::vector<JsonReader> frames = json.Objects("plan");
  json.Require(!frames.empty(), "plan", "is empty; need at least one frame");
  if (const Status status = json.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  FramePlan plan;
  for (JsonReader& planned : frames) {
    SessionFrame frame;
    ReadRoleAndLight(planned, frame);
    frame.exposure_s = ReadSetting(planned, "exposure_s");
    if (const Status status = planned.Finish(); !status) {
      return tl::unexpected(status.error());
    }
    plan.push_back(std::move(frame));
  }
  return plan;
}

Result<SessionFrame> ReadDone(JsonReader& json, const SessionFrame& planned) {
  JsonReader is = json.Object("is");
  SessionFrame frame = ReadSessionFrame(is);
  is.Require(frame.role == planned.role && frame.light == planned.light, "role",
             "and light are not those of the plan");
  is.Require(fs::path(frame.file).parent_path() == "frames" && frame.file != "frames/..", "file",
             fmt::format("is \"{}\"; need a file in frames/", frame.file));
  is.Require(frame.sha256.has_value(), "sha256", "is missing; need the file's hash");
  is.Require(frame.exposure_s && frame.f_number && frame.iso, "exposure_s",
             "or f_number or iso is missing; need all three as the camera had them");
  if (const Status status = is.Finish(); !status) {
    return tl::unexpected(status.error());
  }
  return frame;
}

// Follows the records one by one.
class JournalReader {
 public:
  Status Take(nlohmann::json record, const std::string& where) {
    if (!journal_) {
      return TakeBegun(std::move(record), where);
    }
    JsonReader json(record, where);
    const std::string name = json.String("record");
    json.Require(!journal_->complete, "record", "follows the complete one; need nothing after it");
    if (name == "planned") {
      return TakePlanned(json);
    }
    if (name == "complete") {
      const bool all_done =
          !journal_->plan.empty() &&
          std::ranges::all_of(journal_->done, [](const auto& frame) { return frame.has_value(); });
      json.Require(all_done, "record", "is complete, but not every frame is done");
      journal_->complete = true;
      return json.Finish();
    }
    return TakeOfFrame(json, name);
  }

  std::optional<Journal> Finish() { return std::move(journal_); }

 private:
  Status TakeBegun(nlohmann::json record, const std::string& where) {
    if (Status schema = TakeSchema(record, where, "sateen.journal", 1); !schema) {
      return schema;
    }
    JsonReader json(record, where);
    json.Require(json.String("record") == "begun", "record",
                 "is not begun, the first of a journal");
    Result<JournalBegun> begun = ReadBegun(json);
    if (!begun) {
      return tl::unexpected(begun.error());
    }
    journal_.emplace();
    journal_->begun = *std::move(begun);
    return {};
  }

  Status TakePlanned(JsonReader& json) {
    const std::optional<double> exposure_s = json.OptionalNumber("exposure_s");
    json.Require(exposure_s.value_or(0.0) >= 0.0, "exposure_s", "is below 0");
    Result<FramePlan> plan = ReadFramePlan(json);
    if (!plan) {
      return tl::unexpected(plan.error());
    }
    if (exposure_s) {
      journal_->begun.exposure_s = *exposure_s > 0.0 ? exposure_s : std::nullopt;
    }
    journal_->plan = *std::move(plan);
    journal_->done.assign(journal_->plan.size(), std::nullopt);
    is_begun_.assign(journal_->plan.size(), false);
    return {};
  }

  Status TakeOfFrame(JsonReader& json, const std::string& name) {
    const int place = json.Integer("frame");
    const size_t count = journal_->done.size();
    json.Require(place >= 0 && static_cast<size_t>(place) < count, "frame",
                 fmt::format("is {}; the plan has {} frames, from 0", place, count));
    if (place < 0 || static_cast<size_t>(place) >= count) {
      return Finished(json);
    }
    const auto frame = static_cast<size_t>(place);
    std::optional<SessionFrame>& done = journal_->done[frame];
    if (name == "frame begun") {
      json.Require(!done, "frame", "is begun again, but it is done");
      is_begun_[frame] = true;
      journal_->begun_names.insert(FileNameOf(frame, journal_->plan[frame], {}));
    } else if (name == "frame done") {
      json.Require(is_begun_[frame] && !done, "frame", "is done, but was not begun");
      Result<SessionFrame> is = ReadDone(json, journal_->plan[frame]);
      if (!is) {
        return tl::unexpected(is.error());
      }
      journal_->done_names.insert(is->file);
      done = *std::move(is);
      is_begun_[frame] = false;
    } else if (name == "frame rejected") {
      json.Require(is_begun_[frame] || done, "frame", "is rejected, but was not begun");
      json.Require(!json.String("reason").empty(), "reason", "is empty; need the reason");
      done.reset();
      is_begun_[frame] = false;
      ++journal_->rejected;
    } else {
      json.Require(
          false, "record",
          fmt::format(
              "is \"{}\"; need planned, frame begun, frame done, frame rejected or complete",
              name));
    }
    return json.Finish();
  }

  // Returns the first failure of a record that has failed.
  static Status Finished(JsonReader& json) {
    Status status = json.Finish();
    SATEEN_CHECK(!status);
    return status;
  }

  std::optional<Journal> journal_;
  std::vector<bool> is_begun_;
};

std::string LineOf(const nlohmann::ordered_json& record) { return JsonText(record) + "\n"; }

nlohmann::ordered_json OfFrame(const char* record, std::size_t frame) {
  return {{"record", record}, {"frame", frame}};
}

// Locks the journal where the disk can. Some network disks cannot: then a notice says so.
Status LockJournal(int file, const fs::path& dir) {
  if (flock(file, LOCK_EX | LOCK_NB) == 0) {
    return {};
  }
  const int error_number = errno;
  if (error_number == EWOULDBLOCK) {
    return Fail(ErrorCode::kIo,
                "{}: another program is capturing into this folder; wait until it has ended, or "
                "choose another folder",
                dir.string());
  }
  if (error_number == ENOLCK || error_number == EOPNOTSUPP || error_number == ENOSYS) {
    Notice(
        fmt::format("{}: this disk has no file locks ({}), so a second program that captures "
                    "into this folder would not be noticed; let only one do so",
                    dir.string(), SystemReason(error_number)));
    return {};
  }
  return Fail(ErrorCode::kIo,
              "{}: cannot be locked: {}; does another program capture into this folder? Else "
              "choose another folder",
              (dir / kJournalFile).string(), SystemReason(error_number));
}

}  // namespace

Result<std::optional<Journal>> ParseJournal(const std::string& text, const std::string& where) {
  JournalReader reader;
  size_t begin = 0;
  int line = 0;
  for (size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', begin)) {
    const std::string at = fmt::format("{}: line {}", where, ++line);
    Result<nlohmann::json> record = ParseJson(text.substr(begin, end - begin), at);
    if (!record) {
      return tl::unexpected(record.error());
    }
    if (const Status taken = reader.Take(*std::move(record), at); !taken) {
      return tl::unexpected(taken.error());
    }
    begin = end + 1;
  }
  std::optional<Journal> journal = reader.Finish();
  if (journal) {
    journal->whole_bytes = begin;
  }
  return journal;
}

Result<std::optional<Journal>> ReadJournal(const fs::path& dir) {
  const fs::path path = dir / kJournalFile;
  const Result<std::string> text = ReadFileBytes(path);
  if (!text) {
    return tl::unexpected(text.error());
  }
  return ParseJournal(*text, path.string());
}

Result<JournalWriter> JournalWriter::Open(const fs::path& dir) {
  JournalWriter writer;
  writer.path_ = dir / kJournalFile;
  writer.fd_ = open(writer.path_.c_str(),
                    O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
  if (writer.fd_ < 0) {
    return Fail(ErrorCode::kIo, "{}: cannot write: {}", writer.path_.string(), SystemReason(errno));
  }
  struct stat found {};
  if (fstat(writer.fd_, &found) != 0 || !S_ISREG(found.st_mode)) {
    return Fail(ErrorCode::kIo, "{}: is a device or a pipe; move it away", writer.path_.string());
  }
  const Status ready = LockJournal(writer.fd_, dir).and_then([&] { return FlushToDisk(dir, dir); });
  if (!ready) {
    return tl::unexpected(ready.error());
  }
  return writer;
}

Status JournalWriter::Keep(std::uint64_t bytes) {
  if (ftruncate(fd_, static_cast<off_t>(bytes)) != 0) {
    return Fail(ErrorCode::kIo, "{}: cannot cut off its torn last line: {}", path_.string(),
                SystemReason(errno));
  }
  bytes_ = bytes;
  return {};
}

JournalWriter::JournalWriter(JournalWriter&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      bytes_(other.bytes_),
      has_failed_(other.has_failed_) {}

JournalWriter::~JournalWriter() {
  if (fd_ >= 0) {
    close(fd_);
  }
}

Status JournalWriter::Append(const std::string& line) {
  int error_number = has_failed_ ? EIO : 0;  // or a torn line could come to lie in the middle
  for (size_t written = 0; written < line.size() && error_number == 0;) {
    const ssize_t count = write(fd_, line.data() + written, line.size() - written);
    error_number = count < 0 && errno != EINTR ? errno : 0;
    written += count > 0 ? static_cast<size_t>(count) : 0;
  }
  if (error_number == 0 && fsync(fd_) != 0 && errno != EINVAL) {  // EINVAL: nothing to flush here
    error_number = errno;
  }
  if (error_number != 0) {
    has_failed_ = true;
    // Where that fails too, the rest is a torn last line, which readers drop.
    [[maybe_unused]] const int ignored = ftruncate(fd_, static_cast<off_t>(bytes_));
    return Fail(ErrorCode::kIo, "{}: cannot write: {}; what was captured before is whole{}",
                path_.string(), SystemReason(error_number),
                error_number == ENOSPC || error_number == EDQUOT ? "; make room" : "");
  }
  bytes_ += line.size();
  return {};
}

Status JournalWriter::Begin(const JournalBegun& begun) {
  nlohmann::ordered_json record = {{"schema", "sateen.journal/1"},
                                   {"record", "begun"},
                                   {"kind", Name(begun.kind)},
                                   {"rig", begun.rig},
                                   {"rig_sha256", begun.rig_sha256}};
  PutIfKnown(record, "exposure_s", begun.exposure_s);
  record["f_number"] = begun.f_number;
  record["iso"] = begun.iso;
  record["level"] = begun.level;
  record["brackets"] = begun.brackets;
  return Append(LineOf(record));
}

Status JournalWriter::Planned(const FramePlan& plan, const std::string& reason,
                              const PlannedExposure& exposure) {
  nlohmann::ordered_json record = {{"record", "planned"}, {"reason", reason}};
  if (exposure.is_new) {
    record["exposure_s"] = exposure.exposure_s.value_or(0.0);
  }
  record["plan"] = nlohmann::ordered_json::array();
  for (const SessionFrame& frame : plan) {
    record["plan"].push_back(RoleAndLightToJson(frame));
    PutIfKnown(record["plan"].back(), "exposure_s", frame.exposure_s);
  }
  return Append(LineOf(record));
}

Status JournalWriter::FrameBegun(std::size_t frame) {
  return Append(LineOf(OfFrame("frame begun", frame)));
}

Status JournalWriter::FrameDone(std::size_t frame, const SessionFrame& done) {
  nlohmann::ordered_json record = OfFrame("frame done", frame);
  record["is"] = SessionFrameToJson(done);
  return Append(LineOf(record));
}

Status JournalWriter::FrameRejected(std::size_t frame, const std::string& reason) {
  nlohmann::ordered_json record = OfFrame("frame rejected", frame);
  record["reason"] = reason;
  return Append(LineOf(record));
}

Status JournalWriter::Complete() { return Append(LineOf({{"record", "complete"}})); }

}  // namespace sateen
