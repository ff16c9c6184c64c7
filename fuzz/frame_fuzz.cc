// Any bytes go into the receiver. What it takes for a frame must be one: encoded again it gives the
// bytes that were received.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "firmware/protocol/codec.h"
#include "firmware/protocol/frame.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  SateenReceiver receiver = {};
  std::vector<std::uint8_t> run;  // since the last delimiter
  for (std::size_t i = 0; i < size; ++i) {
    SateenFrame frame = {};
    const int status = SateenReceive(&receiver, data[i], &frame);
    if (data[i] != 0) {
      run.push_back(data[i]);
      if (status != SATEEN_FRAME_NONE) {
        std::abort();
      }
      continue;
    }
    if (run.empty() != (status == SATEEN_FRAME_NONE)) {
      std::abort();
    }
    if (status == SATEEN_FRAME_GOOD) {
      std::uint8_t wire[SATEEN_MAX_WIRE];
      const std::size_t sent =
          SateenEncodeFrame(frame.sequence, frame.message, frame.payload, frame.length, wire);
      if (sent != run.size() + 2 || std::memcmp(wire + 1, run.data(), run.size()) != 0) {
        std::abort();
      }
    }
    run.clear();
  }
  return 0;
}
