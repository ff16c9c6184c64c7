// Any bytes go into the receiver. What it takes for a frame must be one: encoded again it gives the
// bytes that were received.
#include <cstdint>
#include <cstring>
#include <vector>

#include "firmware/protocol/codec.h"
#include "firmware/protocol/frame.h"
#include "fuzz/target.h"

namespace sateen::fuzz {

void Try(std::string_view bytes) {
  SateenReceiver receiver = {};
  std::vector<std::uint8_t> run;  // since the last delimiter
  for (const char c : bytes) {
    const auto byte = static_cast<std::uint8_t>(c);
    SateenFrame frame = {};
    const int status = SateenReceive(&receiver, byte, &frame);
    if (byte != 0) {
      run.push_back(byte);
      Need(status == SATEEN_FRAME_NONE);
      continue;
    }
    Need(run.empty() == (status == SATEEN_FRAME_NONE));
    if (status == SATEEN_FRAME_GOOD) {
      std::uint8_t wire[SATEEN_MAX_WIRE];
      const std::size_t sent =
          SateenEncodeFrame(frame.sequence, frame.message, frame.payload, frame.length, wire);
      Need(sent == run.size() + 2 && std::memcmp(wire + 1, run.data(), run.size()) == 0);
    }
    run.clear();
  }
}

}  // namespace sateen::fuzz
