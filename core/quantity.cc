#include "core/quantity.h"

#include <charconv>
#include <cmath>
#include <optional>

namespace sateen {
namespace {

struct Quantity {
  double value = 0.0;
  std::string_view unit;
};

// Splits the text into a plain decimal number and what follows it.
std::optional<Quantity> Split(std::string_view text) {
  Quantity quantity;
  const char* end = text.data() + text.size();
  const auto [rest, error] =
      std::from_chars(text.data(), end, quantity.value, std::chars_format::fixed);
  if (error != std::errc() || !std::isfinite(quantity.value)) {
    return std::nullopt;
  }
  quantity.unit = std::string_view(rest, static_cast<std::size_t>(end - rest));
  return quantity;
}

}  // namespace

Result<double> ParseLevel(std::string_view text) {
  const std::optional<Quantity> quantity = Split(text);
  if (quantity && (quantity->unit == "%" || quantity->unit.empty())) {
    const double level = quantity->unit.empty() ? quantity->value : quantity->value / 100.0;
    if (quantity->unit.empty() && text == "1") {
      return Fail(ErrorCode::kInvalidArgument, "level '1' may mean 1% or 100%; say which");
    }
    if (level >= 0.0 && level <= 1.0) {
      return level;
    }
  }
  return Fail(ErrorCode::kInvalidArgument,
              "level '{}'; needs 0.1% to 100%, or 0% for off, as 50% or 0.5", text);
}

Result<std::chrono::milliseconds> ParseDuration(std::string_view text) {
  const std::optional<Quantity> quantity = Split(text);
  if (quantity && (quantity->unit == "ms" || quantity->unit == "s")) {
    const double ms = std::round(quantity->value * (quantity->unit == "s" ? 1000.0 : 1.0));
    if (ms >= 1.0 && ms <= 3600e3) {
      return std::chrono::milliseconds(static_cast<std::int64_t>(ms));
    }
  }
  return Fail(ErrorCode::kInvalidArgument,
              "time '{}'; needs a number with its unit, as 500ms or 2s, from 1ms to 3600s", text);
}

Result<double> ParseExposure(std::string_view text) {
  const bool is_fraction = text.starts_with("1/");
  const std::optional<Quantity> quantity = Split(is_fraction ? text.substr(2) : text);
  if (quantity && (quantity->unit.empty() || quantity->unit == "s" ||
                   (quantity->unit == "ms" && !is_fraction))) {
    const double value = quantity->value * (quantity->unit == "ms" ? 1e-3 : 1.0);
    const double exposure_s = is_fraction ? 1.0 / value : value;
    if (exposure_s >= 1e-5 && exposure_s <= 60.0) {
      return exposure_s;
    }
  }
  return Fail(ErrorCode::kInvalidArgument,
              "exposure '{}'; needs 1/100000 to 60 s, as 1/50, 20ms or 0.5s", text);
}

std::string ExposureText(double exposure_s) {
  return exposure_s < 0.3 ? fmt::format("1/{:.4g} s", 1.0 / exposure_s)
                          : fmt::format("{:.4g} s", exposure_s);
}

std::string DurationText(std::chrono::milliseconds time) {
  if (time < std::chrono::seconds(1)) {
    return fmt::format("{} ms", time.count());
  }
  return fmt::format("{:.6g} s", static_cast<double>(time.count()) / 1000.0);
}

std::string LevelText(double level) { return fmt::format("{:.4g} %", 100.0 * level); }

}  // namespace sateen
