#include "scanner/daemon/request_json.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace sateen {

Result<nlohmann::json> ParseBody(const std::string& text) {
  Result<nlohmann::json> json = ParseJson(text.empty() ? "{}" : text, std::string(kRequest));
  if (!json) {
    return Fail(ErrorCode::kInvalidArgument, "{}", json.error().message);
  }
  if (!json->is_object()) {
    return Fail(ErrorCode::kInvalidArgument,
                "request is a JSON {}; need an object, as {{\"rig\": "
                "\"/home/me/rig.json\"}}",
                json->type_name());
  }
  return json;
}

Status FinishRequest(JsonReader& json) {
  const Status status = json.Finish();
  return status ? Status{} : Fail(ErrorCode::kInvalidArgument, "{}", status.error().message);
}

std::string ReadClient(JsonReader& json) {
  std::string client = json.OptionalString("client").value_or("");
  const bool printable = std::ranges::none_of(
      client, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
  json.Require(client.size() <= 100 && printable, "client",
               "is longer than 100 bytes or not printable; need a short name");
  return client;
}

std::filesystem::path ReadPath(JsonReader& json, std::string_view key) {
  const std::string text = json.OptionalString(key).value_or("");
  json.Require(text.empty() || text.front() == '/', key,
               fmt::format("is '{}'; need an absolute path, as /home/me/scans/twill", text));
  json.Require(text.find('\0') == std::string::npos, key, "has a zero byte in it; need a path");
  return text;
}

bool TakeFlag(JsonReader& json, std::string_view key) { return json.Has(key) && json.Boolean(key); }

}  // namespace sateen
