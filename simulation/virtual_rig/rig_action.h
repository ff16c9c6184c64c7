#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

// Something that can be done to the virtual rig, understood and not done yet.
struct RigAction {
  std::function<Status()> act;
  bool on_board = false;  // by the thread that runs the board, and no other
};

// Splits a line of commands into words.
[[nodiscard]] std::vector<std::string> WordsOf(std::string_view line);

// Fails with kInvalidArgument unless `word` is a number from `least` to `most`; `what` names it.
[[nodiscard]] Result<double> NumberIn(const std::string& word, std::string_view what, double least,
                                      double most);
[[nodiscard]] Result<int> CountIn(const std::string& word, std::string_view what, int least,
                                  int most);

// Fails with kInvalidArgument unless `words`, the verb first, are from `least` to `most` words;
// `usage` is how the command is written.
[[nodiscard]] Status CheckWordCount(const std::vector<std::string>& words, size_t least,
                                    size_t most, std::string_view usage);

}  // namespace sateen
