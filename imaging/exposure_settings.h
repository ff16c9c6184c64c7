#pragma once

namespace sateen {

// Settings with which a camera exposes a frame.
struct ExposureSettings {
  double exposure_s = 0.02;
  double f_number = 8.0;
  double iso = 100.0;
};

}  // namespace sateen
