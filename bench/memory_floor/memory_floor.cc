#include "bench/memory_floor/memory_floor.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bench/memory_floor/memory_floor.cc"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/highway.h>

#include <vector>

#include "core/parallel.h"
#include "solver/least_squares/fast_rows.h"

HWY_BEFORE_NAMESPACE();
namespace sateen::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Leaves out the values after the last whole vector.
void TouchSpanImpl(const std::vector<const float*>& planes, size_t count,
                   const std::vector<float*>& floats, const std::vector<uint8_t*>& bytes) {
  using D = hn::ScalableTag<float>;
  const D d;
  const hn::Rebind<uint8_t, D> du8;
  for (size_t p = 0; p + hn::Lanes(d) <= count; p += hn::Lanes(d)) {
    auto sum = hn::Zero(d);
    for (const float* const plane : planes) {
      sum = hn::Add(sum, hn::LoadU(d, plane + p));
    }
    for (float* const to : floats) {
      hn::StoreU(sum, d, to + p);
    }
    for (uint8_t* const to : bytes) {
      hn::StoreU(hn::Set(du8, 1), du8, to + p);
    }
  }
}

}  // namespace
}  // namespace sateen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sateen {

HWY_EXPORT(TouchSpanImpl);

void TouchRows(const LightStack& stack, int begin, int end, NormalField& field) {
  const size_t first = field.reason.Index(0, begin);
  std::vector<const float*> planes;
  for (const LightFrame& frame : stack) {
    for (const Image<float>& plane : frame.rgb.planes) {
      planes.push_back(plane.pixels.data() + first);
    }
  }
  std::vector<float*> floats = {field.residual.pixels.data() + first};
  for (size_t c = 0; c < 3; ++c) {
    floats.push_back(field.normal[c].pixels.data() + first);
    floats.push_back(field.albedo[c].pixels.data() + first);
  }
  HWY_DYNAMIC_DISPATCH(TouchSpanImpl)
  (planes, field.reason.Index(0, end) - first, floats,
   {field.samples.pixels.data() + first, field.reason.pixels.data() + first});
}

Status TouchAllRows(const LightStack& stack, const Task& task, NormalField& field) {
  const ImageSize size = stack[0].rgb.Size();
  field.Resize(size);
  return ParallelFor(size.height, RowsPerPiece(size), task,
                     [&](int begin, int end) { TouchRows(stack, begin, end, field); });
}

size_t BytesPerPixel(size_t light_count) {
  return (3 * light_count + 7) * sizeof(float) + 2 * sizeof(uint8_t);
}

}  // namespace sateen
#endif  // HWY_ONCE
