#pragma once

#include <cstdint>
#include <string>

#include "core/error.h"
#include "imaging/image.h"

namespace sateen {

// Returns where the ArUco dictionary of this name, such as "DICT_4X4_50", stands in OpenCV's list.
// kInvalidArgument names those there are.
[[nodiscard]] Result<int> DictionaryNumber(const std::string& dictionary);

// Returns how many markers the dictionary, such as "DICT_4X4_50", has. Fails with kInvalidArgument
// if there is none of that name.
[[nodiscard]] Result<int> MarkerCount(const std::string& dictionary);

// Returns the smallest dictionary with `bits` x `bits` cells, 4 to 7, that has `count` markers; the
// largest one if none has.
[[nodiscard]] std::string DictionaryFor(int bits, int count);

// Returns the marker's cells with its black border, 0 black and 1 white, row by row from the top
// left.
[[nodiscard]] Image<uint8_t> MarkerCells(const std::string& dictionary, int id);

}  // namespace sateen
