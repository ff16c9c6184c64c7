#include "scanner/capture/capture_progress.h"

namespace sateen {

void CaptureProgress::Tell(const SessionStore& store, const char* stage, const std::string& light,
                           double exposure_s) const {
  if (!observer_) {
    return;
  }
  const std::size_t frames = store.Record().done.size();
  const std::size_t open = store.Open().size();
  CaptureEvent event{.stage = stage,
                     .done = frames - open,
                     .frames = frames,
                     .light = light,
                     .exposure_s = exposure_s,
                     .peak = peak_};
  if (frames_ > 0) {
    event.left_s = Seconds() / frames_ * static_cast<double>(open);
  }
  observer_(event);
}

}  // namespace sateen
