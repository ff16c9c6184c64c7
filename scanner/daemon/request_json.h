#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/json.h"

// Parts that the readers of requests have in common. For .cc files of this folder only.
namespace sateen {

inline constexpr std::string_view kRequest = "request";

// Parses one JSON object; an empty body is an object without keys.
[[nodiscard]] Result<nlohmann::json> ParseBody(const std::string& text);
// Closes a reader: a fault of a request is a kInvalidArgument.
[[nodiscard]] Status FinishRequest(JsonReader& json);

// Reads "client": the name that others are told, at most 100 printable bytes.
[[nodiscard]] std::string ReadClient(JsonReader& json);
// Reads an absolute path; empty where the key is absent.
[[nodiscard]] std::filesystem::path ReadPath(JsonReader& json, std::string_view key);
// Reads true or false; false where the key is absent.
[[nodiscard]] bool TakeFlag(JsonReader& json, std::string_view key);

template <typename T>
void Take(const std::optional<T>& found, T& into) {
  if (found) {
    into = *found;
  }
}

}  // namespace sateen
