#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/task.h"
#include "scanner/devices/light_board.h"

namespace sateen {

// One light, on for a while.
struct LightRequest {
  int channel = 0;
  std::string name;    // name in messages; empty: its channel
  double level = 0.5;  // [0, 1]; 0: off
  std::optional<std::chrono::milliseconds>
      on_time;  // absent: until cancelled, or the board's limit
};

// The board's settings for the request.
struct LightOn {
  double level = 0.0;
  std::chrono::milliseconds on_time{0};  // time after which it goes off by itself
};

/// Turns the light on and stays with it, since the board turns off when it hears nothing, until it
/// goes off or the task is cancelled; then the light is off. `began` is called once it is on.
/// It is not called for level 0.
///
/// Errors   kDevice: a fault of the board; another light is on; the light went off long before its
///          time; the light's limit came before anybody cancelled, where no time was asked for;
///          kInvalidArgument, kTimeout as LightBoard
/// Returns  whether it was cancelled
[[nodiscard]] Result<bool> KeepLightOn(const LightRequest& request, LightBoard& board,
                                       const Task& task,
                                       const std::function<void(const LightOn&)>& began);

}  // namespace sateen
