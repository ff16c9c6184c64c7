#include "core/json.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

namespace sateen {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxShown = 40;

const Json& EmptyObject() {
  static const Json kEmpty = Json::object();
  return kEmpty;
}

std::string Show(const Json& value) {
  if (value.is_object()) {
    return "an object";
  }
  if (value.is_array()) {
    return fmt::format("an array of {}", value.size());
  }
  std::string text = value.dump(-1, ' ', /*ensure_ascii=*/true);
  if (text.size() > kMaxShown) {
    text = text.substr(0, kMaxShown) + "...";
  }
  return text;
}

bool IsFiniteNumber(const Json& value) {
  return value.is_number() && std::isfinite(value.get<double>());
}

}  // namespace

JsonReader::JsonReader(const Json& object, std::string where)
    : JsonReader(object, std::move(where), "") {}

JsonReader::JsonReader(const Json& object, std::string where, std::string path)
    : object_(&object), where_(std::move(where)), path_(std::move(path)) {
  if (!object.is_object()) {
    FailType("", object, "an object");
    object_ = &EmptyObject();
  }
}

double JsonReader::Number(std::string_view key) { return FindNumber(key, true).value_or(0.0); }

std::optional<double> JsonReader::OptionalNumber(std::string_view key) {
  return FindNumber(key, false);
}

std::optional<double> JsonReader::FindNumber(std::string_view key, bool required) {
  constexpr std::string_view kNeeded = "a finite number";
  const Json* value = Find(key, required, kNeeded);
  if (value != nullptr && !IsFiniteNumber(*value)) {
    FailType(key, *value, kNeeded);
    value = nullptr;
  }
  return value == nullptr ? std::nullopt : std::optional(value->get<double>());
}

int JsonReader::Integer(std::string_view key) { return FindInteger(key, true).value_or(0); }

std::optional<int> JsonReader::OptionalInteger(std::string_view key) {
  return FindInteger(key, false);
}

std::optional<int> JsonReader::FindInteger(std::string_view key, bool required) {
  using Limits = std::numeric_limits<int>;
  constexpr std::string_view kNeeded = "a whole number";
  const Json* value = Find(key, required, kNeeded);
  if (value == nullptr) {
    return std::nullopt;
  }
  if (!value->is_number_integer() || value->get<double>() < Limits::min() ||
      value->get<double>() > Limits::max()) {  // as double, where no 64-bit value can wrap
    FailType(key, *value,
             value->is_number_integer() ? "a whole number of at most 2147483647" : kNeeded);
    return std::nullopt;
  }
  return value->get<int>();
}

bool JsonReader::Boolean(std::string_view key) {
  constexpr std::string_view kNeeded = "true or false";
  const Json* value = Find(key, true, kNeeded);
  if (value != nullptr && !value->is_boolean()) {
    FailType(key, *value, kNeeded);
    value = nullptr;
  }
  return value != nullptr && value->get<bool>();
}

std::string JsonReader::String(std::string_view key) { return FindString(key, true).value_or(""); }

std::optional<std::string> JsonReader::OptionalString(std::string_view key) {
  return FindString(key, false);
}

std::optional<std::string> JsonReader::FindString(std::string_view key, bool required) {
  constexpr std::string_view kNeeded = "a string";
  const Json* value = Find(key, required, kNeeded);
  if (value != nullptr && !value->is_string()) {
    FailType(key, *value, kNeeded);
    value = nullptr;
  }
  return value == nullptr ? std::nullopt : std::optional(value->get<std::string>());
}

std::vector<double> JsonReader::Numbers(std::string_view key, size_t count) {
  return FindNumbers(key, count, true).value_or(std::vector<double>(count, 0.0));
}

std::optional<std::vector<double>> JsonReader::OptionalNumbers(std::string_view key, size_t count) {
  return FindNumbers(key, count, false);
}

std::optional<std::vector<double>> JsonReader::OptionalNumberList(std::string_view key) {
  return FindNumbers(key, std::nullopt, false);
}

std::optional<std::vector<double>> JsonReader::FindNumbers(std::string_view key,
                                                           std::optional<size_t> count,
                                                           bool required) {
  const std::string needed = count ? fmt::format("an array of {} finite numbers", *count)
                                   : "an array of finite numbers, at least one";
  const Json* value = Find(key, required, needed);
  if (value == nullptr) {
    return std::nullopt;
  }
  const bool is_long_enough =
      value->is_array() && (count ? value->size() == *count : !value->empty());
  if (!is_long_enough) {
    FailType(key, *value, needed);
    return std::nullopt;
  }
  std::vector<double> numbers;
  numbers.reserve(value->size());
  for (const Json& element : *value) {
    if (!IsFiniteNumber(element)) {
      FailType(fmt::format("{}[{}]", key, numbers.size()), element, "a finite number");
      return std::nullopt;
    }
    numbers.push_back(element.get<double>());
  }
  return numbers;
}

JsonReader JsonReader::Object(std::string_view key) {
  if (std::optional<JsonReader> reader = FindObject(key, true)) {
    return *std::move(reader);
  }
  JsonReader failed(EmptyObject(), where_, PathOf(key));
  failed.error_ = error_;
  return failed;
}

std::optional<JsonReader> JsonReader::OptionalObject(std::string_view key) {
  return FindObject(key, false);
}

std::optional<JsonReader> JsonReader::FindObject(std::string_view key, bool required) {
  constexpr std::string_view kNeeded = "an object";
  const Json* value = Find(key, required, kNeeded);
  if (value != nullptr && !value->is_object()) {
    FailType(key, *value, kNeeded);
    value = nullptr;
  }
  return value == nullptr ? std::nullopt : std::optional(JsonReader(*value, where_, PathOf(key)));
}

std::vector<JsonReader> JsonReader::Objects(std::string_view key) {
  constexpr std::string_view kNeeded = "an array of objects";
  const Json* value = Find(key, true, kNeeded);
  if (value == nullptr) {
    return {};
  }
  if (!value->is_array()) {
    FailType(key, *value, kNeeded);
    return {};
  }
  std::vector<JsonReader> readers;
  for (const Json& element : *value) {
    const std::string element_key = fmt::format("{}[{}]", key, readers.size());
    if (!element.is_object()) {
      FailType(element_key, element, "an object");
      return {};
    }
    readers.push_back(JsonReader(element, where_, PathOf(element_key)));
  }
  return readers;
}

void JsonReader::Ignore(std::string_view key) { asked_.emplace(key); }

void JsonReader::Require(bool holds, std::string_view key, std::string_view found_needed) {
  if (!holds) {
    FailAt(key, found_needed);
  }
}

bool JsonReader::Has(std::string_view key) const { return object_->contains(key); }

Status JsonReader::Finish() {
  for (const auto& [key, value] : object_->items()) {
    if (!asked_.contains(key)) {
      FailAt(key, fmt::format("is not known here; the keys are {}", fmt::join(asked_, ", ")));
    }
  }
  if (error_) {
    return tl::unexpected(*error_);
  }
  return {};
}

const Json* JsonReader::Find(std::string_view key, bool required, std::string_view needed) {
  asked_.emplace(key);
  const auto found = object_->find(key);
  if (found != object_->end()) {
    return error_ ? nullptr : &*found;
  }
  if (required) {
    FailAt(key, fmt::format("is missing; need {}", needed));
  }
  return nullptr;
}

void JsonReader::FailAt(std::string_view key, std::string_view problem) {
  if (!error_) {
    const std::string path = PathOf(key);
    error_ = Error{ErrorCode::kBadData,
                   fmt::format("{}: {} {}", where_, path.empty() ? "top level" : path, problem)};
  }
}

void JsonReader::FailType(std::string_view key, const Json& found, std::string_view needed) {
  FailAt(key, fmt::format("is {}; need {}", Show(found), needed));
}

std::string JsonReader::PathOf(std::string_view key) const {
  return fmt::format("{}{}{}", path_, path_.empty() || key.empty() ? "" : ".", key);
}

}  // namespace sateen
