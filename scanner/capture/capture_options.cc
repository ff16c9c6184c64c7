#include "scanner/capture/capture_options.h"

#include "core/option_range.h"

namespace sateen {

Status CaptureOptions::Validate() const {
  using std::chrono::milliseconds;
  if (!(level > 0.0 && level <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "level is {:g} %; need 0.1 % to 100 %", 100.0 * level);
  }
  if (exposure_s && !(*exposure_s > 0.0 && *exposure_s <= 60.0)) {
    return OutOfRange("exposure_s", *exposure_s, "more than 0 and at most 60");
  }
  if (!(f_number > 0.0 && f_number <= 1000.0)) {
    return OutOfRange("f_number", f_number, "more than 0 and at most 1000");
  }
  if (!(iso > 0.0 && iso <= 1e7)) {
    return OutOfRange("iso", iso, "more than 0 and at most 1e7");
  }
  if (deadline < milliseconds(1)) {
    return OutOfRange("deadline_ms", static_cast<double>(deadline.count()), "at least 1");
  }
  if (tries < 1) {
    return OutOfRange("tries", tries, "at least 1");
  }
  const auto check_ms = [](const char* name, milliseconds time, int min, int max) {
    return CheckRange(name, static_cast<double>(time.count()), min, max);
  };
  return CheckRange("brackets", brackets, 1, 3)
      .and_then([&] { return check_ms("settle_ms", settle, 0, 1500); })
      .and_then([&] { return check_ms("margin_ms", margin, 1, 60'000); })
      .and_then([&] { return check_ms("keep_alive_ms", keep_alive, 0, 1500); })
      .and_then([&] { return checks.Validate(); });
}

}  // namespace sateen
