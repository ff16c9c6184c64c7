#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace sateen {

// Calibration records: the figures of each calibrator, and the files that it read. They are the
// object `calibration` of rig.json and the reports of `sateen calibrate ... --json`.
// rig/calibration_json.cc holds the one table of keys and members, docs/formats.md the meaning of
// each key.
//
// A member is empty where the file lacks its key or holds another type there. `other` keeps the
// rest, so that reading a file and writing it again loses nothing.

// Keys that no member of a record holds, with their values.
class OtherKeys {
 public:
  bool operator==(const OtherKeys&) const = default;

 private:
  friend struct RecordJson;
  std::string json_;  // an object; empty: no such key
};

// Empty where the file lacks the key; holding an empty value where the file says null.
template <typename T>
using Nullable = std::optional<std::optional<T>>;

// Members that the records of all calibrators share.
struct CalibrationRecord {
  std::optional<std::string> schema;   // "sateen.calibrate.lens/1"
  std::optional<std::string> version;  // version of the program
  std::optional<std::string> date;     // UTC, ISO 8601; empty in a report
  std::optional<double> seconds;       // duration of the calibration
  std::optional<std::vector<std::string>> warnings;
  std::optional<std::map<std::string, std::string>> inputs;  // SHA-256 per file
  OtherKeys other;

  bool operator==(const CalibrationRecord&) const = default;
};

struct LineDeviationRecord {
  std::optional<double> before;  // [px]
  std::optional<double> after;
  OtherKeys other;

  bool operator==(const LineDeviationRecord&) const = default;
};

struct CoverageRecord {
  std::optional<std::array<int, 2>> cells;  // columns, rows
  std::optional<std::vector<int>> corners;  // per cell, row by row
  OtherKeys other;

  bool operator==(const CoverageRecord&) const = default;
};

struct LensViewRecord {
  std::optional<std::string> name;
  std::optional<bool> used;
  std::optional<std::string> reason;  // where it is not used
  std::optional<size_t> corners;
  std::optional<double> edge_px;
  std::optional<double> rms_px;
  std::optional<double> held_out_px;
  std::optional<double> tilt_deg;
  OtherKeys other;

  bool operator==(const LensViewRecord&) const = default;
};

struct LensRecord : CalibrationRecord {
  std::optional<std::string> board;
  std::optional<std::array<int, 2>> size_px;
  std::optional<std::array<double, 4>> k;  // fx, fy, cx, cy [px]
  std::optional<std::array<double, 4>> k_sd;
  std::optional<std::array<double, 5>> distortion;  // k1, k2, p1, p2, k3
  std::optional<std::array<double, 5>> distortion_sd;
  std::optional<double> corner_sd_px;
  std::optional<double> rms_px;
  std::optional<double> held_out_rms_px;
  std::optional<LineDeviationRecord> line_deviation_px;
  std::optional<CoverageRecord> coverage;
  std::optional<std::vector<std::string>> ignored;  // files that are no photographs
  std::optional<std::vector<LensViewRecord>> views;
  std::optional<double> focal_error;  // relative, against the truth of a simulated board
  std::optional<double> principal_error_px;

  bool operator==(const LensRecord&) const = default;
};

struct PoseRecord : CalibrationRecord {
  std::optional<std::string> board;
  std::optional<double> thickness_mm;
  std::optional<size_t> photographs;
  std::optional<size_t> corners;
  std::optional<std::array<double, 16>> table_from_camera;  // row by row
  std::optional<double> lean_deg;
  std::optional<double> rms_px;
  std::optional<Eigen::Vector3d> position_sd_mm;
  std::optional<Eigen::Vector3d> rotation_sd_deg;
  std::optional<double> edge_sd_mm;
  std::optional<double> moved_mm;
  std::optional<double> turned_deg;
  std::optional<double> position_error_mm;  // against the truth of a simulated board
  std::optional<double> rotation_error_deg;

  bool operator==(const PoseRecord&) const = default;
};

struct ChartPoseRecord {
  std::optional<Eigen::Vector2d> at_mm;
  std::optional<double> turned_deg;
  std::optional<double> misfit;
  OtherKeys other;

  bool operator==(const ChartPoseRecord&) const = default;
};

struct LinearityBinRecord {
  std::optional<double> level_dn;
  std::optional<double> deviation;
  std::optional<double> sd;
  OtherKeys other;

  bool operator==(const LinearityBinRecord&) const = default;
};

struct ChannelLinearityRecord {
  std::optional<double> from_dn;
  std::optional<double> to_dn;
  std::optional<bool> departs;
  Nullable<double> fine_to_dn;
  Nullable<double> saturation_dn;
  std::optional<std::vector<LinearityBinRecord>> bins;  // in a report; a rig leaves them out
  OtherKeys other;

  bool operator==(const ChannelLinearityRecord&) const = default;
};

struct LinearityRecord {
  std::optional<ChannelLinearityRecord> red;
  std::optional<ChannelLinearityRecord> green;
  std::optional<ChannelLinearityRecord> blue;
  OtherKeys other;

  bool operator==(const LinearityRecord&) const = default;
};

struct NoiseRecord {
  std::optional<double> gain_dn_per_electron;
  std::optional<double> gain_sd;
  std::optional<std::array<double, 3>> gain_rgb;
  std::optional<std::array<double, 3>> gain_rgb_sd;
  std::optional<double> read_noise_dn;
  std::optional<double> read_noise_sd;
  std::optional<double> misfit;
  std::optional<size_t> points;
  OtherKeys other;

  bool operator==(const NoiseRecord&) const = default;
};

struct LightBalanceRecord {
  std::optional<std::string> name;
  std::optional<Eigen::Vector3d> white_balance;
  std::optional<Eigen::Vector3d> white_balance_sd;
  std::optional<size_t> patches;
  OtherKeys other;

  bool operator==(const LightBalanceRecord&) const = default;
};

struct UnevenPatchRecord {
  std::optional<std::string> light;
  std::optional<std::string> patch;
  std::optional<double> unevenness;
  OtherKeys other;

  bool operator==(const UnevenPatchRecord&) const = default;
};

// Relative errors against the truth of a simulated chart.
struct ResponseErrorRecord {
  std::optional<double> white_balance;
  Nullable<double> gain;
  Nullable<double> read_noise;
  Nullable<double> saturation;
  OtherKeys other;

  bool operator==(const ResponseErrorRecord&) const = default;
};

struct ResponseRecord : CalibrationRecord {
  std::optional<size_t> frames;
  std::optional<ChartPoseRecord> chart;
  std::optional<double> black_dn;
  Nullable<double> saturation_dn;
  std::optional<double> white_dn;
  std::optional<double> tolerance;
  std::optional<LinearityRecord> linearity;
  Nullable<NoiseRecord> noise;
  std::optional<Eigen::Vector3d> white_balance;
  std::optional<Eigen::Vector3d> white_balance_sd;
  std::optional<std::vector<LightBalanceRecord>> lights;
  std::optional<std::vector<UnevenPatchRecord>> left_out;
  std::optional<ResponseErrorRecord> error;

  bool operator==(const ResponseRecord&) const = default;
};

struct SheetRecord {
  std::optional<std::string> name;
  std::optional<std::array<double, 16>> table_from_sheet;  // row by row
  std::optional<double> tilt_sd_deg;
  std::optional<Eigen::Vector3d> position_sd_mm;
  std::optional<size_t> markers;  // used
  std::optional<size_t> markers_of_border;
  std::optional<double> misfit;
  std::optional<double> blur_px;
  std::optional<double> tilt_error_deg;  // against the truth of a simulated sheet
  std::optional<double> position_error_mm;
  OtherKeys other;

  bool operator==(const SheetRecord&) const = default;
};

struct RungRecord {
  std::optional<std::string> model;
  std::optional<double> held_out_rms;
  std::optional<double> residual_rms;
  std::optional<int> iterations;
  OtherKeys other;

  bool operator==(const RungRecord&) const = default;
};

struct LightRecord {
  std::optional<std::string> name;
  std::optional<std::string> model;
  std::optional<double> moved_mm;
  std::optional<Eigen::Vector3d> position_sd_mm;
  std::optional<double> direction_sd_deg;
  std::optional<Eigen::Vector3d> flux_sd;
  std::optional<double> noise_rms;
  std::optional<size_t> samples;
  std::optional<size_t> samples_left_out;
  std::optional<std::vector<RungRecord>> rungs;
  std::optional<double> position_error_mm;  // against the truth of a simulated sheet
  std::optional<double> direction_error_deg;
  std::optional<double> flux_error;
  OtherKeys other;

  bool operator==(const LightRecord&) const = default;
};

// How flat the sheets solve with lights from one way of calibrating.
struct WayRecord {
  std::optional<std::string> way;
  std::optional<double> flat_sheet_deg;
  std::optional<double> tilted_sheets_deg;
  std::optional<double> direction_error_deg;
  OtherKeys other;

  bool operator==(const WayRecord&) const = default;
};

struct LightsRecord : CalibrationRecord {
  std::optional<double> albedo;
  std::optional<std::vector<SheetRecord>> sheets;
  std::optional<std::vector<LightRecord>> lights;
  std::optional<std::vector<WayRecord>> ways;

  bool operator==(const LightsRecord&) const = default;
};

struct SphereRecord {
  std::optional<Eigen::Vector2d> center_px;
  std::optional<double> radius_px;
  std::optional<double> outline_seen;
  std::optional<double> outline_rms_px;
  std::optional<Eigen::Vector3d> center_mm;
  OtherKeys other;

  bool operator==(const SphereRecord&) const = default;
};

struct LampRecord {
  std::optional<std::string> name;
  std::optional<std::string> file;
  std::optional<std::string> model;
  std::optional<Eigen::Vector3d> direction;
  std::optional<double> elevation_deg;
  std::optional<double> azimuth_deg;
  std::optional<size_t> spheres;
  std::optional<std::vector<std::optional<Eigen::Vector2d>>> highlights_px;  // per sphere
  std::optional<double> disagreement_deg;
  std::optional<Eigen::Vector3d> position_mm;
  std::optional<Eigen::Vector3d> position_sd_mm;
  OtherKeys other;

  bool operator==(const LampRecord&) const = default;
};

struct SpheresRecord : CalibrationRecord {
  std::optional<std::string> projection;  // "perspective" or "orthographic"
  std::optional<std::string> highlight;   // "lamp" or "median"
  std::optional<std::string> outlines;    // where they come from
  std::optional<double> radius_mm;
  std::optional<std::vector<SphereRecord>> spheres;
  std::optional<std::vector<LampRecord>> lights;

  bool operator==(const SpheresRecord&) const = default;
};

// The records of a rig; empty: never calibrated so.
struct CalibrationRecords {
  std::optional<LensRecord> lens;
  std::optional<PoseRecord> pose;
  std::optional<ResponseRecord> response;
  std::optional<LightsRecord> lights;
  std::optional<SpheresRecord> spheres;
  OtherKeys other;

  bool operator==(const CalibrationRecords&) const = default;
};

}  // namespace sateen
