#include "rig/calibration_json.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <tuple>

namespace sateen {
namespace {

using Json = nlohmann::json;

template <typename Record, typename Value>
struct Field {
  const char* key;
  std::optional<Value> Record::*member;
};
template <typename Record, typename Value>
Field(const char*, std::optional<Value> Record::*) -> Field<Record, Value>;

// The table of keys and members: one function per record, found by its argument's type.
constexpr auto FieldsOf(const CalibrationRecord& /*type*/) {
  using R = CalibrationRecord;
  return std::tuple(Field{"schema", &R::schema}, Field{"version", &R::version},
                    Field{"date", &R::date}, Field{"seconds", &R::seconds},
                    Field{"warnings", &R::warnings}, Field{"inputs", &R::inputs});
}

template <typename... Fields>
constexpr auto WithCommon(Fields... fields) {
  return std::tuple_cat(FieldsOf(CalibrationRecord()), std::tuple(fields...));
}

constexpr auto FieldsOf(const LineDeviationRecord& /*type*/) {
  using R = LineDeviationRecord;
  return std::tuple(Field{"before", &R::before}, Field{"after", &R::after});
}

constexpr auto FieldsOf(const CoverageRecord& /*type*/) {
  using R = CoverageRecord;
  return std::tuple(Field{"cells", &R::cells}, Field{"corners", &R::corners});
}

constexpr auto FieldsOf(const LensViewRecord& /*type*/) {
  using R = LensViewRecord;
  return std::tuple(Field{"name", &R::name}, Field{"used", &R::used}, Field{"reason", &R::reason},
                    Field{"corners", &R::corners}, Field{"edge_px", &R::edge_px},
                    Field{"rms_px", &R::rms_px}, Field{"held_out_px", &R::held_out_px},
                    Field{"tilt_deg", &R::tilt_deg});
}

constexpr auto FieldsOf(const LensRecord& /*type*/) {
  using R = LensRecord;
  return WithCommon(
      Field{"board", &R::board}, Field{"size_px", &R::size_px}, Field{"k", &R::k},
      Field{"k_sd", &R::k_sd}, Field{"distortion", &R::distortion},
      Field{"distortion_sd", &R::distortion_sd}, Field{"corner_sd_px", &R::corner_sd_px},
      Field{"rms_px", &R::rms_px}, Field{"held_out_rms_px", &R::held_out_rms_px},
      Field{"line_deviation_px", &R::line_deviation_px}, Field{"coverage", &R::coverage},
      Field{"ignored", &R::ignored}, Field{"views", &R::views},
      Field{"focal_error", &R::focal_error}, Field{"principal_error_px", &R::principal_error_px});
}

constexpr auto FieldsOf(const PoseRecord& /*type*/) {
  using R = PoseRecord;
  return WithCommon(
      Field{"board", &R::board}, Field{"thickness_mm", &R::thickness_mm},
      Field{"photographs", &R::photographs}, Field{"corners", &R::corners},
      Field{"table_from_camera", &R::table_from_camera}, Field{"lean_deg", &R::lean_deg},
      Field{"rms_px", &R::rms_px}, Field{"position_sd_mm", &R::position_sd_mm},
      Field{"rotation_sd_deg", &R::rotation_sd_deg}, Field{"edge_sd_mm", &R::edge_sd_mm},
      Field{"moved_mm", &R::moved_mm}, Field{"turned_deg", &R::turned_deg},
      Field{"position_error_mm", &R::position_error_mm},
      Field{"rotation_error_deg", &R::rotation_error_deg});
}

constexpr auto FieldsOf(const ChartPoseRecord& /*type*/) {
  using R = ChartPoseRecord;
  return std::tuple(Field{"at_mm", &R::at_mm}, Field{"turned_deg", &R::turned_deg},
                    Field{"misfit", &R::misfit});
}

constexpr auto FieldsOf(const LinearityBinRecord& /*type*/) {
  using R = LinearityBinRecord;
  return std::tuple(Field{"level_dn", &R::level_dn}, Field{"deviation", &R::deviation},
                    Field{"sd", &R::sd});
}

constexpr auto FieldsOf(const ChannelLinearityRecord& /*type*/) {
  using R = ChannelLinearityRecord;
  return std::tuple(Field{"from_dn", &R::from_dn}, Field{"to_dn", &R::to_dn},
                    Field{"departs", &R::departs}, Field{"fine_to_dn", &R::fine_to_dn},
                    Field{"saturation_dn", &R::saturation_dn}, Field{"bins", &R::bins});
}

constexpr auto FieldsOf(const LinearityRecord& /*type*/) {
  using R = LinearityRecord;
  return std::tuple(Field{"red", &R::red}, Field{"green", &R::green}, Field{"blue", &R::blue});
}

constexpr auto FieldsOf(const NoiseRecord& /*type*/) {
  using R = NoiseRecord;
  return std::tuple(
      Field{"gain_dn_per_electron", &R::gain_dn_per_electron}, Field{"gain_sd", &R::gain_sd},
      Field{"gain_rgb", &R::gain_rgb}, Field{"gain_rgb_sd", &R::gain_rgb_sd},
      Field{"read_noise_dn", &R::read_noise_dn}, Field{"read_noise_sd", &R::read_noise_sd},
      Field{"misfit", &R::misfit}, Field{"points", &R::points});
}

constexpr auto FieldsOf(const LightBalanceRecord& /*type*/) {
  using R = LightBalanceRecord;
  return std::tuple(Field{"name", &R::name}, Field{"white_balance", &R::white_balance},
                    Field{"white_balance_sd", &R::white_balance_sd}, Field{"patches", &R::patches});
}

constexpr auto FieldsOf(const UnevenPatchRecord& /*type*/) {
  using R = UnevenPatchRecord;
  return std::tuple(Field{"light", &R::light}, Field{"patch", &R::patch},
                    Field{"unevenness", &R::unevenness});
}

constexpr auto FieldsOf(const ResponseErrorRecord& /*type*/) {
  using R = ResponseErrorRecord;
  return std::tuple(Field{"white_balance", &R::white_balance}, Field{"gain", &R::gain},
                    Field{"read_noise", &R::read_noise}, Field{"saturation", &R::saturation});
}

constexpr auto FieldsOf(const ResponseRecord& /*type*/) {
  using R = ResponseRecord;
  return WithCommon(Field{"frames", &R::frames}, Field{"chart", &R::chart},
                    Field{"black_dn", &R::black_dn}, Field{"saturation_dn", &R::saturation_dn},
                    Field{"white_dn", &R::white_dn}, Field{"tolerance", &R::tolerance},
                    Field{"linearity", &R::linearity}, Field{"noise", &R::noise},
                    Field{"white_balance", &R::white_balance},
                    Field{"white_balance_sd", &R::white_balance_sd}, Field{"lights", &R::lights},
                    Field{"left_out", &R::left_out}, Field{"error", &R::error});
}

constexpr auto FieldsOf(const SheetRecord& /*type*/) {
  using R = SheetRecord;
  return std::tuple(Field{"name", &R::name}, Field{"table_from_sheet", &R::table_from_sheet},
                    Field{"tilt_sd_deg", &R::tilt_sd_deg},
                    Field{"position_sd_mm", &R::position_sd_mm}, Field{"markers", &R::markers},
                    Field{"markers_of_border", &R::markers_of_border}, Field{"misfit", &R::misfit},
                    Field{"blur_px", &R::blur_px}, Field{"tilt_error_deg", &R::tilt_error_deg},
                    Field{"position_error_mm", &R::position_error_mm});
}

constexpr auto FieldsOf(const RungRecord& /*type*/) {
  using R = RungRecord;
  return std::tuple(Field{"model", &R::model}, Field{"held_out_rms", &R::held_out_rms},
                    Field{"residual_rms", &R::residual_rms}, Field{"iterations", &R::iterations});
}

constexpr auto FieldsOf(const LightRecord& /*type*/) {
  using R = LightRecord;
  return std::tuple(
      Field{"name", &R::name}, Field{"model", &R::model}, Field{"moved_mm", &R::moved_mm},
      Field{"position_sd_mm", &R::position_sd_mm}, Field{"direction_sd_deg", &R::direction_sd_deg},
      Field{"flux_sd", &R::flux_sd}, Field{"noise_rms", &R::noise_rms},
      Field{"samples", &R::samples}, Field{"samples_left_out", &R::samples_left_out},
      Field{"rungs", &R::rungs}, Field{"position_error_mm", &R::position_error_mm},
      Field{"direction_error_deg", &R::direction_error_deg}, Field{"flux_error", &R::flux_error});
}

constexpr auto FieldsOf(const WayRecord& /*type*/) {
  using R = WayRecord;
  return std::tuple(Field{"way", &R::way}, Field{"flat_sheet_deg", &R::flat_sheet_deg},
                    Field{"tilted_sheets_deg", &R::tilted_sheets_deg},
                    Field{"direction_error_deg", &R::direction_error_deg});
}

constexpr auto FieldsOf(const LightsRecord& /*type*/) {
  using R = LightsRecord;
  return WithCommon(Field{"albedo", &R::albedo}, Field{"sheets", &R::sheets},
                    Field{"lights", &R::lights}, Field{"ways", &R::ways});
}

constexpr auto FieldsOf(const SphereRecord& /*type*/) {
  using R = SphereRecord;
  return std::tuple(Field{"center_px", &R::center_px}, Field{"radius_px", &R::radius_px},
                    Field{"outline_seen", &R::outline_seen},
                    Field{"outline_rms_px", &R::outline_rms_px}, Field{"center_mm", &R::center_mm});
}

constexpr auto FieldsOf(const LampRecord& /*type*/) {
  using R = LampRecord;
  return std::tuple(
      Field{"name", &R::name}, Field{"file", &R::file}, Field{"model", &R::model},
      Field{"direction", &R::direction}, Field{"elevation_deg", &R::elevation_deg},
      Field{"azimuth_deg", &R::azimuth_deg}, Field{"spheres", &R::spheres},
      Field{"highlights_px", &R::highlights_px}, Field{"disagreement_deg", &R::disagreement_deg},
      Field{"position_mm", &R::position_mm}, Field{"position_sd_mm", &R::position_sd_mm});
}

constexpr auto FieldsOf(const SpheresRecord& /*type*/) {
  using R = SpheresRecord;
  return WithCommon(Field{"projection", &R::projection}, Field{"highlight", &R::highlight},
                    Field{"outlines", &R::outlines}, Field{"radius_mm", &R::radius_mm},
                    Field{"spheres", &R::spheres}, Field{"lights", &R::lights});
}

constexpr auto FieldsOf(const CalibrationRecords& /*type*/) {
  using R = CalibrationRecords;
  return std::tuple(Field{"lens", &R::lens}, Field{"pose", &R::pose},
                    Field{"response", &R::response}, Field{"lights", &R::lights},
                    Field{"spheres", &R::spheres});
}

template <typename T>
concept Record = requires(T record) {
  FieldsOf(record);
};

}  // namespace

// Walks the table in both directions. Read() returns false, and leaves `value` unspecified, where
// the JSON is not of the value's type.
struct RecordJson {
  static bool Read(const Json& json, double& value) {
    return ReadIf(json.is_number(), json, value);
  }
  static bool Read(const Json& json, bool& value) { return ReadIf(json.is_boolean(), json, value); }
  static bool Read(const Json& json, std::string& value) {
    return ReadIf(json.is_string(), json, value);
  }
  static bool Read(const Json& json, size_t& value) {
    return ReadIf(json.is_number_unsigned(), json, value);
  }
  static bool Read(const Json& json, int& value) {
    using Limits = std::numeric_limits<int>;
    const double number = json.is_number_integer() ? json.get<double>() : std::nan("");
    return ReadIf(number >= Limits::min() && number <= Limits::max(), json, value);
  }

  template <typename T>
  static bool ReadIf(bool is_of_type, const Json& json, T& value) {
    if (is_of_type) {
      value = json.get<T>();
    }
    return is_of_type;
  }

  static bool Read(const Json& json, std::map<std::string, std::string>& value) {
    if (!json.is_object()) {
      return false;
    }
    for (const auto& [key, element] : json.items()) {
      if (!Read(element, value[key])) {
        return false;
      }
    }
    return true;
  }

  template <typename T>
  static bool Read(const Json& json, std::optional<T>& value) {
    return json.is_null() || Read(json, value.emplace());
  }

  template <typename T>
  static bool Read(const Json& json, std::vector<T>& value) {
    value.resize(json.is_array() ? json.size() : 0);
    return json.is_array() && ReadElements(json, value);
  }

  template <typename T, size_t N>
  static bool Read(const Json& json, std::array<T, N>& value) {
    return json.is_array() && json.size() == N && ReadElements(json, value);
  }

  template <int kSize>
  static bool Read(const Json& json, Eigen::Matrix<double, kSize, 1>& value) {
    return json.is_array() && json.size() == kSize && ReadElements(json, value);
  }

  template <typename Elements>
  static bool ReadElements(const Json& json, Elements& values) {
    auto value = values.begin();
    for (const Json& element : json) {
      if (!Read(element, *value)) {
        return false;
      }
      ++value;
    }
    return true;
  }

  template <Record R>
  static bool Read(const Json& json, R& record) {
    if (!json.is_object()) {
      return false;
    }
    Json other = json;
    const auto read = [&](const auto& field) {
      const auto found = json.find(field.key);
      if (found == json.end()) {
        return;
      }
      auto& member = record.*field.member;
      if (Read(*found, member.emplace())) {
        other.erase(field.key);
      } else {
        member.reset();
      }
    };
    std::apply([&](const auto&... fields) { (read(fields), ...); }, FieldsOf(record));
    record.other.json_ = other.empty() ? "" : other.dump();
    return true;
  }

  template <typename T>
  static Json Written(const T& value) {
    return value;
  }

  template <typename T>
  static Json Written(const std::optional<T>& value) {
    return value ? Written(*value) : Json();
  }

  template <typename T>
  static Json Written(const std::vector<T>& values) {
    Json json = Json::array();
    for (const T& value : values) {
      json.push_back(Written(value));
    }
    return json;
  }

  template <int kSize>
  static Json Written(const Eigen::Matrix<double, kSize, 1>& value) {
    return std::vector<double>(value.begin(), value.end());
  }

  template <Record R>
  static Json Written(const R& record) {
    Json json = record.other.json_.empty() ? Json::object() : Json::parse(record.other.json_);
    const auto write = [&](const auto& field) {
      if (const auto& member = record.*field.member) {
        json[field.key] = Written(*member);
      }
    };
    std::apply([&](const auto&... fields) { (write(fields), ...); }, FieldsOf(record));
    return json;
  }
};

CalibrationRecords ReadCalibrationRecords(const Json& object) {
  CalibrationRecords records;
  RecordJson::Read(object, records);
  return records;
}

Json ToJson(const CalibrationRecords& records) { return RecordJson::Written(records); }
Json ToJson(const LensRecord& record) { return RecordJson::Written(record); }
Json ToJson(const PoseRecord& record) { return RecordJson::Written(record); }
Json ToJson(const ResponseRecord& record) { return RecordJson::Written(record); }
Json ToJson(const LightsRecord& record) { return RecordJson::Written(record); }
Json ToJson(const SpheresRecord& record) { return RecordJson::Written(record); }

}  // namespace sateen
