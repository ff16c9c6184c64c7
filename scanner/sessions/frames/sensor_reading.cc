#include "scanner/sessions/frames/sensor_reading.h"

#include <algorithm>

namespace sateen {

float SensorReading::Largest() const { return *std::ranges::max_element(balance); }

SensorReading ReadingOf(const FrameFile& file) {
  SensorReading reading;
  if (file.response) {
    for (size_t c = 0; c < 3; ++c) {
      reading.balance[c] =
          static_cast<float>(file.response->white_balance[static_cast<Eigen::Index>(c)]);
    }
  }
  return reading;
}

Result<SensorReading> ReadingOf(const FrameFile& file, const RawMosaic& mosaic) {
  SensorReading reading = ReadingOf(file);
  if (!file.response) {
    return reading;
  }
  const double black = static_cast<double>(mosaic.black);
  const double range = static_cast<double>(mosaic.white) - black;
  const Response& response = *file.response;
  if (response.white <= black || response.black >= static_cast<double>(mosaic.white)) {
    return Fail(ErrorCode::kBadData,
                "{}: its black is {:.0f} DN and its white {:.0f}, but the rig's response has black "
                "{:.0f} and white {:.0f}; the response is of another camera or mode: calibrate it "
                "with frames like this one",
                file.path.string(), black, mosaic.white, response.black, response.white);
  }
  reading.shift = static_cast<float>((black - response.black) / range);                      // (1)
  reading.saturation = static_cast<float>(std::min(1.0, (response.white - black) / range));  // (2)
  return reading;
}

}  // namespace sateen
