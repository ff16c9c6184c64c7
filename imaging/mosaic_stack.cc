#include "imaging/mosaic_stack.h"

namespace sateen {

std::span<const uint16_t> RowsOf(const Image<uint16_t>& mosaic, int begin, int end) {
  const size_t first = mosaic.Index(0, begin);
  return std::span(mosaic.pixels).subspan(first, mosaic.Index(0, end) - first);
}

std::span<const uint16_t> MosaicsInMemory::Read(size_t frame, int begin, int end,
                                                std::vector<uint16_t>& /*buffer*/) const {
  return RowsOf(mosaics_[frame], begin, end);
}

}  // namespace sateen
