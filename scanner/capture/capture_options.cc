#include "scanner/capture/capture_options.h"

namespace sateen {

Status CaptureOptions::Validate() const {
  using std::chrono::milliseconds;
  const auto in = [](milliseconds time, milliseconds least, milliseconds most) {
    return time >= least && time <= most;
  };
  if (!(level > 0.0 && level <= 1.0)) {
    return Fail(ErrorCode::kInvalidArgument, "level is {:g} %; need 0.1 % to 100 %", 100.0 * level);
  }
  if (exposure_s && !(*exposure_s > 0.0 && *exposure_s <= 60.0)) {
    return Fail(ErrorCode::kInvalidArgument, "exposure_s is {}; need more than 0 and at most 60",
                *exposure_s);
  }
  if (!(f_number > 0.0 && f_number <= 1000.0 && iso > 0.0 && iso <= 1e7)) {
    return Fail(ErrorCode::kInvalidArgument,
                "f_number is {} and iso {}; need more than 0, and at most 1000 and 1e7", f_number,
                iso);
  }
  if (brackets < 1 || brackets > 3) {
    return Fail(ErrorCode::kInvalidArgument, "brackets is {}; need 1 to 3", brackets);
  }
  if (!in(settle, milliseconds(0), milliseconds(1500))) {
    return Fail(ErrorCode::kInvalidArgument, "settle is {} ms; need 0 to 1500", settle.count());
  }
  if (!in(margin, milliseconds(1), milliseconds(60'000))) {
    return Fail(ErrorCode::kInvalidArgument, "margin is {} ms; need 1 to 60000", margin.count());
  }
  if (deadline < milliseconds(1)) {
    return Fail(ErrorCode::kInvalidArgument, "deadline is {} ms; need at least 1",
                deadline.count());
  }
  if (!in(keep_alive, milliseconds(0), milliseconds(1500))) {
    return Fail(ErrorCode::kInvalidArgument, "keep_alive is {} ms; need 0 to 1500",
                keep_alive.count());
  }
  if (tries < 1) {
    return Fail(ErrorCode::kInvalidArgument, "tries is {}; need at least 1", tries);
  }
  return checks.Validate();
}

}  // namespace sateen
