#pragma once

#include <Eigen/Core>
#include <charconv>
#include <string_view>
#include <system_error>
#include <vector>

namespace sateen {

// Returns the parts of "charuco:10x7:25mm:18mm" between its colons.
[[nodiscard]] std::vector<std::string_view> FieldsOf(std::string_view text);

// Reads the whole of `text` as a number; false if it is not a number.
template <typename T>
[[nodiscard]] bool ReadWhole(std::string_view text, T& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

// Reads "10x7".
[[nodiscard]] bool ReadGrid(std::string_view text, int& columns, int& rows);

// Reads "25mm".
[[nodiscard]] bool ReadLength(std::string_view text, double& length_mm);

// Reads "200x150mm".
[[nodiscard]] bool ReadSize(std::string_view text, Eigen::Vector2d& size_mm);

}  // namespace sateen
