#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

enum class SessionKind { kFabric, kSheet, kChart, kBoard };
// kRepeat: a light again, at the end, to measure drift. It is not part of the stack.
enum class FrameRole { kLit, kDark, kRepeat };

[[nodiscard]] std::string_view Name(SessionKind kind);
[[nodiscard]] std::string_view Name(FrameRole role);

// One exposure of a session.
struct SessionFrame {
  FrameRole role = FrameRole::kLit;
  std::string light;  // name of the rig's light; empty for a dark frame
  std::string file;   // relative to the session's folder
  std::optional<std::string> sha256;
  // Absent where not known; each is known for every frame or for none.
  std::optional<double> exposure_s;
  std::optional<double> f_number;
  std::optional<double> iso;
  // Shift of its picture from the first lit frame's, where camera or fabric moved a little: a point
  // at x there is at x + shift_px here. [px right, px down]
  std::optional<Eigen::Vector2d> shift_px;

  /// Returns H, by which a file's value is divided to give radiance:
  ///
  ///     H = exposure_s (iso / 100) / f_number^2,        an unknown factor is 1     (1)
  [[nodiscard]] double Exposure() const;
};

/// Record of one session on disk, session.json. A plain value.
///
///     {"schema": "sateen.session/1",
///      "kind": "fabric",                    fabric, sheet, chart or board
///      "rig": "../rig.json",                relative to the session's folder
///      "rig_sha256": "9f86...",             optional: 64 lower-case hexadecimal digits
///      "frames": [
///        {"role": "lit",                    lit, dark or repeat
///         "light": "led-0",                 name of the rig's light; not of a dark frame
///         "file": "frames/led-0.exr",       relative to the session's folder
///         "sha256": "60303...",             optional
///         "exposure_s": 0.0125,             optional, > 0; for every frame or for none
///         "f_number": 8,                    optional, likewise
///         "iso": 100,                       optional, likewise
///         "shift_px": [0.31, -0.12]}],      optional: right, down; at most 100 each
///      "table_from_sheet": [16 numbers],    optional: rigid, row-major, millimetres
///      "mask": "mask.png",                  optional: relative to the session's folder
///      "journal": "journal.jsonl"}          optional: the capture's journal, beside this file
struct Session {
  SessionKind kind = SessionKind::kFabric;
  std::string rig;
  std::optional<std::string> rig_sha256;
  std::vector<SessionFrame> frames;
  std::optional<Eigen::Isometry3d> table_from_sheet;
  std::optional<std::string> mask;
  bool has_journal = false;  // written by a capture
};

/// Reads session.json in `dir`.
///
/// Errors   kIo: absent or unreadable
///          kBadData: another schema, a key missing, unknown or out of range; only journal.jsonl
///          is there, so the capture was not completed
[[nodiscard]] Result<Session> ReadSessionRecord(const std::filesystem::path& dir);

// Reads session.json without its repeats, which are not solved.
[[nodiscard]] Result<Session> ReadSession(const std::filesystem::path& dir);

// Returns the text of session.json, from which ReadSessionRecord() gives the same value back.
[[nodiscard]] std::string SessionToJson(const Session& session);

}  // namespace sateen
