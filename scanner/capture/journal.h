#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"
#include "scanner/capture/frame_plan.h"
#include "scanner/sessions/session.h"

namespace sateen {

// First record of a journal: the options that decide about the frames.
struct JournalBegun {
  SessionKind kind = SessionKind::kFabric;
  std::string rig;  // relative to the session's folder
  std::string rig_sha256;
  std::optional<double> exposure_s;  // asked for most recently; absent: to be found
  double f_number = 8.0;
  double iso = 100.0;
  double level = 1.0;  // level of the lights
  int brackets = 3;    // largest number of exposures per light where they are to be found
};

// Exposure that was asked for with a plan.
struct PlannedExposure {
  bool is_new = false;               // false: as before
  std::optional<double> exposure_s;  // absent: to be found
};

/// journal.jsonl of a session that is being captured, one JSON object per line, each on the disk
/// before the capture goes on:
///
///     {"schema": "sateen.journal/1", "record": "begun", "kind", "rig", "rig_sha256", "exposure_s",
///      "f_number", "iso", "level", "brackets"}           exposure_s: absent if it is to be found
///     {"record": "planned", "reason": "...", "exposure_s",
///      "plan": [{"role", "light", "exposure_s"}, ...]}
///                                                       all frames of an earlier plan are open
///                                                       again; exposure_s: from here on instead of
///                                                       begun's, 0 where it is to be found;
///                                                       absent: as before
///     {"record": "frame begun", "frame": 3}             3: its place in the plan, from 0
///     {"record": "frame done", "frame": 3, "is": {...}}           as in session.json, all keys
///     {"record": "frame rejected", "frame": 3, "reason": "..."}   begun or done before
///     {"record": "complete"}                            all frames are done and checked
///
///     state of a frame   begun      done       rejected
///     open               -> begun   error      error
///     begun              -> begun   -> done    -> open       begun again: the program was killed
///     done               error      error      -> open
struct Journal {
  JournalBegun begun;
  FramePlan plan;                                 // empty until it is made
  std::vector<std::optional<SessionFrame>> done;  // one for each of the plan
  // Every frame that was ever begun, of earlier plans too: "frames/03-led-2", no extension.
  std::set<std::filesystem::path> begun_names;
  // Every file that ever was a frame that is done, of earlier plans too: "frames/03-led-2.nef".
  std::set<std::filesystem::path> done_names;
  int rejected = 0;  // records of it
  bool complete = false;
  // Length of the whole lines. A part of a line beyond them was being written when the power went.
  // It does not count.
  std::uint64_t whole_bytes = 0;
};

/// Reads journal.jsonl in `dir`; nothing where not even its first line is whole.
///
/// Errors   kIo: absent or unreadable
///          kBadData, naming the line: not JSON, a key missing, unknown or out of range, a record
///          that cannot follow the ones before it. Only a last line without its newline is dropped.
[[nodiscard]] Result<std::optional<Journal>> ReadJournal(const std::filesystem::path& dir);

// Reads the same from text. `where` opens messages.
[[nodiscard]] Result<std::optional<Journal>> ParseJournal(const std::string& text,
                                                          const std::string& where);

/// Appends to journal.jsonl. One program at a time: the file is locked while this lives. On a disk
/// without file locks a notice asks for that. After an append the record is on the disk; after an
/// error the file is as before, and takes nothing more.
///
/// Errors   kIo: the file cannot be written or flushed; another program captures into this folder
class JournalWriter {
 public:
  // Locks the file, which is created where it is missing, and leaves it as it is. kIo also where it
  // is a link, a device or a pipe.
  [[nodiscard]] static Result<JournalWriter> Open(const std::filesystem::path& dir);
  // Cuts off what is beyond these bytes; before the first append.
  [[nodiscard]] Status Keep(std::uint64_t bytes);
  JournalWriter(JournalWriter&& other) noexcept;
  JournalWriter& operator=(JournalWriter&&) = delete;
  JournalWriter(const JournalWriter&) = delete;
  JournalWriter& operator=(const JournalWriter&) = delete;
  ~JournalWriter();

  [[nodiscard]] Status Begin(const JournalBegun& begun);
  [[nodiscard]] Status Planned(const FramePlan& plan, const std::string& reason,
                               const PlannedExposure& exposure = {});
  [[nodiscard]] Status FrameBegun(std::size_t frame);
  [[nodiscard]] Status FrameDone(std::size_t frame, const SessionFrame& done);
  [[nodiscard]] Status FrameRejected(std::size_t frame, const std::string& reason);
  [[nodiscard]] Status Complete();

 private:
  JournalWriter() = default;
  [[nodiscard]] Status Append(const std::string& line);

  std::filesystem::path path_;
  int fd_ = -1;
  std::uint64_t bytes_ = 0;
  bool has_failed_ = false;
};

inline constexpr const char* kJournalFile = "journal.jsonl";

}  // namespace sateen
