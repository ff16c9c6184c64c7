#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

// Reads one JSON object strictly: a missing key, a wrong type, a value out of range and an
// unknown key are each a kBadData that names the file and the key ("rig.json: lights[3].axis").
// The first failure is kept and later reads return defaults, so a reader asks for every key and
// then calls Finish() once. For .cc files only.
class JsonReader {
 public:
  // `where`, the file, opens every message. `object` must outlive the reader.
  JsonReader(const nlohmann::json& object, std::string where);
  JsonReader(nlohmann::json&& object, std::string where) = delete;

  double Number(std::string_view key);
  int Integer(std::string_view key);
  bool Boolean(std::string_view key);
  std::string String(std::string_view key);
  // Reads an array of exactly `count` numbers.
  std::vector<double> Numbers(std::string_view key, size_t count);
  // Reads an object or an array of objects, to be read by readers of their own; the path is
  // extended. After a failure the object is one that has failed too, and the array is empty.
  JsonReader Object(std::string_view key);
  std::vector<JsonReader> Objects(std::string_view key);

  std::optional<double> OptionalNumber(std::string_view key);
  std::optional<int> OptionalInteger(std::string_view key);
  std::optional<std::string> OptionalString(std::string_view key);
  std::optional<std::vector<double>> OptionalNumbers(std::string_view key, size_t count);
  // Reads an array of any length but 0.
  std::optional<std::vector<double>> OptionalNumberList(std::string_view key);
  std::optional<JsonReader> OptionalObject(std::string_view key);
  // Accepts `key` whatever it holds.
  void Ignore(std::string_view key);

  // Fails unless `holds`; `found_needed` says what was found and what was needed ("is 7; need 8").
  void Require(bool holds, std::string_view key, std::string_view found_needed);
  [[nodiscard]] bool Has(std::string_view key) const;
  // Returns the first failure of this reader, or of a key that nobody asked for. Call it for every
  // reader, also those from Object() and Objects().
  [[nodiscard]] Status Finish();

 private:
  JsonReader(const nlohmann::json& object, std::string where, std::string path);

  // Each reads one type; nothing where the key is absent or the reader has failed.
  const nlohmann::json* Find(std::string_view key, bool required, std::string_view needed);
  std::optional<int> FindInteger(std::string_view key, bool required);
  std::optional<double> FindNumber(std::string_view key, bool required);
  std::optional<std::string> FindString(std::string_view key, bool required);
  // Takes any length but 0 where `count` is nothing.
  std::optional<std::vector<double>> FindNumbers(std::string_view key, std::optional<size_t> count,
                                                 bool required);
  std::optional<JsonReader> FindObject(std::string_view key, bool required);
  void FailAt(std::string_view key, std::string_view problem);
  void FailType(std::string_view key, const nlohmann::json& found, std::string_view needed);
  [[nodiscard]] std::string PathOf(std::string_view key) const;

  const nlohmann::json* object_;
  std::string where_;
  std::string path_;  // path of this object in the file: "" or "lights[3]"
  std::set<std::string, std::less<>> asked_;
  std::optional<Error> error_;
};

// Returns the JSON as text, on one line where `indent` is below 0. It is UTF-8 whatever names from
// elsewhere hold: other bytes become U+FFFD.
template <typename AnyJson>
[[nodiscard]] std::string JsonText(const AnyJson& json, int indent = -1) {
  return json.dump(indent, ' ', false, AnyJson::error_handler_t::replace);
}

// Parses text. kBadData, with the place, for what is not JSON, for a key given twice and for deep
// nesting; `where` opens the message.
[[nodiscard]] Result<nlohmann::json> ParseJson(const std::string& text, const std::string& where);

// Takes "schema" out of an object if it is "<name>/<major>". Fails with kBadData if it is another
// or missing.
[[nodiscard]] Status TakeSchema(nlohmann::json& file, const std::string& where,
                                std::string_view name, int major);

// Parses a file whose top level is an object with "schema": "<name>/<major>" and returns it without
// that key. kBadData for text that is not JSON (with the place), for a key given twice, for another
// schema and for an unknown major version.
[[nodiscard]] Result<nlohmann::json> ReadJsonFile(const std::filesystem::path& path,
                                                  std::string_view schema_name, int major);

}  // namespace sateen
