#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

// A line that holds something, without the blanks around it.
struct TextLine {
  int number = 0;  // from 1
  std::string text;
};

// Numbers, and where they stand, for messages: "lights.txt:3".
struct NumberRow {
  std::string place;
  std::vector<double> values;
};

// Reads the lines of a text file that are not blank; LF or CRLF, with or without a UTF-8 byte order
// mark. Adds the file's hash to `sha256_of_input`. kIo where the file cannot be read.
[[nodiscard]] Result<std::vector<TextLine>> ReadTextLines(
    const std::filesystem::path& path, std::map<std::string, std::string>& sha256_of_input);

// Returns the words of a line, which blanks and tabs divide.
[[nodiscard]] std::vector<std::string_view> SplitWords(std::string_view line);

// kBadData names the first word that is not a finite number.
[[nodiscard]] Result<NumberRow> ParseNumbers(const std::vector<std::string_view>& words,
                                             std::string place);

// Reads a file of numbers, one row for each line that is not blank.
[[nodiscard]] Result<std::vector<NumberRow>> ReadNumberRows(
    const std::filesystem::path& path, std::map<std::string, std::string>& sha256_of_input);

[[nodiscard]] std::string PlaceOf(const std::filesystem::path& path, int line_number);

}  // namespace sateen
