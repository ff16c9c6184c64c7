#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "core/json.h"
#include "scanner/sessions/session.h"

// Common parts of session.json and journal.jsonl. For .cc files only.
namespace sateen {

[[nodiscard]] SessionKind ReadSessionKind(JsonReader& json, std::string_view key);
// Reads 64 lower-case hexadecimal digits; nothing where the key is absent.
[[nodiscard]] std::optional<std::string> ReadHash(JsonReader& json, std::string_view key);
// Reads a file name that is not empty.
[[nodiscard]] std::string ReadFileName(JsonReader& json, std::string_view key);
// Role, and light of all but a dark frame.
void ReadRoleAndLight(JsonReader& json, SessionFrame& frame);
// Reads a frame as session.json has it; the caller calls Finish().
[[nodiscard]] SessionFrame ReadSessionFrame(JsonReader& json);

[[nodiscard]] nlohmann::ordered_json RoleAndLightToJson(const SessionFrame& frame);
[[nodiscard]] nlohmann::ordered_json SessionFrameToJson(const SessionFrame& frame);

template <typename T>
void PutIfKnown(nlohmann::ordered_json& json, const char* key, const std::optional<T>& value) {
  if (value) {
    json[key] = *value;
  }
}

}  // namespace sateen
