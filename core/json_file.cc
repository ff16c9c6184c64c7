#include <functional>
#include <set>

#include "core/file_io.h"
#include "core/json.h"

namespace sateen {
namespace {

using Json = nlohmann::json;

constexpr int kMaxDepth = 64;  // our formats use 4; writing a deeper one could exhaust the stack

// Watches the parser for what the finished value does not show: keys given twice, deep nesting.
class ParseWatch {
 public:
  bool operator()(int depth, Json::parse_event_t event, Json& value) {
    if (event == Json::parse_event_t::object_start) {
      keys_.emplace_back();
    } else if (event == Json::parse_event_t::object_end) {
      keys_.pop_back();
    } else if (event == Json::parse_event_t::key) {
      const auto& key = value.get_ref<const std::string&>();
      if (!keys_.back().insert(key).second && problem_.empty()) {
        problem_ = fmt::format("the key \"{}\" is given twice in one object; keep one", key);
      }
    }
    if (depth > kMaxDepth && problem_.empty()) {
      problem_ = fmt::format("nested deeper than {} levels", kMaxDepth);
    }
    return true;
  }
  [[nodiscard]] const std::string& Problem() const { return problem_; }

 private:
  std::vector<std::set<std::string>> keys_;  // keys of each open object
  std::string problem_;
};

}  // namespace

Result<Json> ParseJson(const std::string& text, const std::string& where) {
  ParseWatch watch;
  try {
    Json value = Json::parse(text, std::ref(watch));
    if (!watch.Problem().empty()) {
      return Fail(ErrorCode::kBadData, "{}: {}", where, watch.Problem());
    }
    return value;
  } catch (const Json::exception& e) {
    const std::string what = e.what();
    const size_t end_of_id = what.find("] ");  // "[json.exception.parse_error.101] "
    return Fail(ErrorCode::kBadData, "{}: not valid JSON: {}", where,
                end_of_id == std::string::npos ? what : what.substr(end_of_id + 2));
  }
}

Status TakeSchema(Json& file, const std::string& where, std::string_view name, int major) {
  const std::string needed = fmt::format("{}/{}", name, major);
  if (!file.is_object()) {
    return Fail(ErrorCode::kBadData,
                "{}: top level is of type {}; need an object with \"schema\": \"{}\"", where,
                file.type_name(), needed);
  }
  const auto schema = file.find("schema");
  if (schema == file.end()) {
    return Fail(ErrorCode::kBadData, "{}: schema is missing; need \"schema\": \"{}\"", where,
                needed);
  }
  const std::string found = schema->is_string() ? schema->get<std::string>() : "";
  if (found == needed) {
    file.erase(schema);
    return {};
  }
  if (found.starts_with(fmt::format("{}/", name))) {
    return Fail(ErrorCode::kBadData,
                "{}: schema is {}; this program reads \"{}\" only; use the version that wrote the "
                "file, or write it anew",
                where, schema->dump(), needed);
  }
  return Fail(ErrorCode::kBadData, "{}: schema is {}; need \"{}\": this is another kind of file",
              where, schema->dump(), needed);
}

Result<Json> ReadJsonFile(const std::filesystem::path& path, std::string_view schema_name,
                          int major) {
  const std::string where = path.string();
  const Result<std::string> text = ReadFileBytes(path);
  if (!text) {
    return tl::unexpected(text.error());
  }
  Result<Json> file = ParseJson(*text, where);
  if (!file) {
    return file;
  }
  if (Status status = TakeSchema(*file, where, schema_name, major); !status) {
    return tl::unexpected(status.error());
  }
  return file;
}

}  // namespace sateen
