#pragma once

#include <vector>

#include "calibration/sheet/sheet_sample.h"

namespace sateen {

// One sheet of white paper as each light of a rig shows it, in a grid of blocks of pixels.
struct SheetReadings {
  int columns = 0;  // of the grid
  int rows = 0;
  int blank_blocks = 0;  // blocks inside the sheet's border, which alone have samples; 0: all
  std::vector<std::vector<SheetSample>> samples;  // [light]; empty: no usable frame
  std::vector<std::vector<int>> blocks;  // [light][sample]: its block, counted row by row from 0
};

}  // namespace sateen
