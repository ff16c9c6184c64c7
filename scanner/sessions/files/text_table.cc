#include "scanner/sessions/files/text_table.h"

#include <charconv>
#include <cmath>

#include "core/files/file_io.h"
#include "core/sha256.h"

namespace sateen {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr size_t kMaxShown = 40;
constexpr uint64_t kMaxTableBytes = uint64_t{2} << 20;  // 50,000 lights

// Returns the word as a message can show it, whatever bytes a wrong file holds.
std::string Show(std::string_view word) {
  std::string shown(word.substr(0, kMaxShown));
  for (char& c : shown) {
    c = c >= ' ' && c <= '~' ? c : '?';
  }
  return shown + (word.size() > kMaxShown ? "..." : "");
}

std::string_view Trim(std::string_view text) {
  const size_t begin = text.find_first_not_of(kBlanks);
  return begin == std::string_view::npos
             ? std::string_view()
             : text.substr(begin, text.find_last_not_of(kBlanks) + 1 - begin);
}

Result<double> ParseNumber(std::string_view word, std::string_view place) {
  std::string_view digits = word;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') {
    digits.remove_prefix(1);  // std::from_chars takes no plus sign
  }
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(value)) {
    return Fail(ErrorCode::kBadData, "{}: found '{}'; need a finite number", place, Show(word));
  }
  return value;
}

}  // namespace

std::string PlaceOf(const std::filesystem::path& path, int line_number) {
  return fmt::format("{}:{}", path.string(), line_number);
}

Result<std::vector<TextLine>> ReadTextLines(const std::filesystem::path& path,
                                            std::map<std::string, std::string>& sha256_of_input) {
  const Result<std::string> bytes = ReadFileBytes(path, kMaxTableBytes);
  if (!bytes) {
    return tl::unexpected(bytes.error());
  }
  sha256_of_input[path.string()] = Sha256(*bytes);
  std::string_view rest = *bytes;
  if (rest.starts_with(kByteOrderMark)) {
    rest.remove_prefix(kByteOrderMark.size());
  }
  std::vector<TextLine> lines;
  for (int number = 1; !rest.empty(); ++number) {
    const size_t length = std::min(rest.find('\n'), rest.size());
    if (const std::string_view text = Trim(rest.substr(0, length)); !text.empty()) {
      lines.push_back({number, std::string(text)});
    }
    rest.remove_prefix(std::min(length + 1, rest.size()));
  }
  return lines;
}

std::vector<std::string_view> SplitWords(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::string_view rest = Trim(line); !rest.empty(); rest = Trim(rest)) {
    const size_t length = std::min(rest.find_first_of(kBlanks), rest.size());
    words.push_back(rest.substr(0, length));
    rest.remove_prefix(length);
  }
  return words;
}

Result<NumberRow> ParseNumbers(const std::vector<std::string_view>& words, std::string place) {
  NumberRow row{std::move(place), {}};
  row.values.reserve(words.size());
  for (const std::string_view word : words) {
    const Result<double> value = ParseNumber(word, row.place);
    if (!value) {
      return tl::unexpected(value.error());
    }
    row.values.push_back(*value);
  }
  return row;
}

Result<std::vector<NumberRow>> ReadNumberRows(const std::filesystem::path& path,
                                              std::map<std::string, std::string>& sha256_of_input) {
  const Result<std::vector<TextLine>> lines = ReadTextLines(path, sha256_of_input);
  if (!lines) {
    return tl::unexpected(lines.error());
  }
  std::vector<NumberRow> rows;
  rows.reserve(lines->size());
  for (const TextLine& line : *lines) {
    Result<NumberRow> row = ParseNumbers(SplitWords(line.text), PlaceOf(path, line.number));
    if (!row) {
      return tl::unexpected(row.error());
    }
    rows.push_back(*std::move(row));
  }
  return rows;
}

}  // namespace sateen
