#include "simulation/virtual_rig/rig_action.h"

#include <charconv>
#include <cmath>
#include <sstream>

namespace sateen {

std::vector<std::string> WordsOf(std::string_view line) {
  std::istringstream stream{std::string(line)};
  std::vector<std::string> words;
  for (std::string word; stream >> word;) {
    words.push_back(word);
  }
  return words;
}

Result<double> NumberIn(const std::string& word, std::string_view what, double least, double most) {
  double value = 0.0;
  const char* const end = word.data() + word.size();
  const auto [rest, failed] = std::from_chars(word.data(), end, value);
  if (failed != std::errc() || rest != end || !(value >= least && value <= most)) {
    return Fail(ErrorCode::kInvalidArgument, "{} is '{}'; need a number from {:g} to {:g}", what,
                word, least, most);
  }
  return value;
}

Result<int> CountIn(const std::string& word, std::string_view what, int least, int most) {
  const Result<double> value = NumberIn(word, what, least, most);
  if (!value || *value != std::floor(*value)) {
    return Fail(ErrorCode::kInvalidArgument, "{} is '{}'; need a whole number from {} to {}", what,
                word, least, most);
  }
  return static_cast<int>(*value);
}

Status CheckWordCount(const std::vector<std::string>& words, size_t least, size_t most,
                      std::string_view usage) {
  if (words.size() < least || words.size() > most) {
    return Fail(ErrorCode::kInvalidArgument, "'{}' with {} words after it; need {}", words.front(),
                words.size() - 1, usage);
  }
  return {};
}

}  // namespace sateen
