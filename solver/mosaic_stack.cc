#include "solver/mosaic_stack.h"

namespace sateen {

std::span<const uint16_t> MosaicsInMemory::Read(size_t frame, int begin, int end,
                                                std::vector<uint16_t>& /*buffer*/) const {
  const Image<uint16_t>& mosaic = mosaics_[frame];
  const size_t first = mosaic.Index(0, begin);
  return std::span(mosaic.pixels).subspan(first, mosaic.Index(0, end) - first);
}

}  // namespace sateen
