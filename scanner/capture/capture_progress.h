#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "core/stopwatch.h"
#include "scanner/capture/session_store.h"

namespace sateen {

// Progress of a capture.
struct CaptureEvent {
  std::string stage;             // "metering", "capturing", "checking"
  std::size_t done = 0;          // frames that are done
  std::size_t frames = 0;        // frames of the plan; 0 until there is one
  std::string light;             // light of the frame that is being taken, or "dark"
  double exposure_s = 0.0;       // exposure time of that frame
  double peak = 0.0;             // SignalLevels::peak of the latest frame
  std::optional<double> left_s;  // time left
};

// Is told of every change, from the thread of the capture.
using CaptureObserver = std::function<void(const CaptureEvent&)>;

// Counts and times what a capture does from when this is made, and tells an observer.
class CaptureProgress {
 public:
  void SetObserver(CaptureObserver observer) { observer_ = std::move(observer); }
  void SetPeak(double peak) { peak_ = peak; }
  void AddCameraTime(double seconds) { camera_s_ += seconds; }
  // Counts a frame that was kept, also if it is rejected later. The time left is estimated from the
  // kept frames.
  void AddFrame() { ++frames_; }

  // Tells the observer the state of the store and which frame is being taken.
  void Tell(const SessionStore& store, const char* stage, const std::string& light = "",
            double exposure_s = 0.0) const;

  [[nodiscard]] double Seconds() const { return started_.Seconds(); }
  [[nodiscard]] double CameraSeconds() const { return camera_s_; }

 private:
  CaptureObserver observer_;
  Stopwatch started_;
  double camera_s_ = 0.0;
  double peak_ = 0.0;
  int frames_ = 0;
};

}  // namespace sateen
