#include <set>
#include <string>
#include <vector>

#include "core/files/file_io.h"
#include "core/json.h"

namespace sateen {
namespace {

using Json = nlohmann::json;

constexpr int kMaxNodes = 1 << 18;  // a session of 10,000 frames has half as many
constexpr int kMaxDepth = 64;  // our formats use 4; writing a deeper one could exhaust the stack

// Reads JSON for what the finished value does not show: keys given twice, deep nesting. Stops at the
// first, before there is a value that could fill memory.
class ParseWatch : public nlohmann::json_sax<Json> {
 public:
  bool null() override { return true; }
  bool boolean(bool /*value*/) override { return true; }
  bool number_integer(number_integer_t /*value*/) override { return true; }
  bool number_unsigned(number_unsigned_t /*value*/) override { return true; }
  bool number_float(number_float_t /*value*/, const string_t& /*text*/) override { return true; }
  bool string(string_t& /*value*/) override { return true; }
  bool binary(binary_t& /*value*/) override { return true; }
  bool start_object(size_t /*elements*/) override {
    keys_.emplace_back();
    return Count() && Descend();
  }
  bool key(string_t& key) override {
    if (!Count()) {
      return false;
    }
    if (!keys_.back().insert(key).second) {
      problem_ = fmt::format("the key \"{}\" is given twice in one object; keep one", key);
    }
    return problem_.empty();
  }
  bool end_object() override {
    keys_.pop_back();
    --depth_;
    return true;
  }
  bool start_array(size_t /*elements*/) override { return Count() && Descend(); }
  bool end_array() override {
    --depth_;
    return true;
  }
  bool parse_error(size_t /*position*/, const std::string& /*token*/,
                   const nlohmann::detail::exception& error) override {
    const std::string what = error.what();
    const size_t end_of_id = what.find("] ");  // "[json.exception.parse_error.101] "
    problem_ =
        "not valid JSON: " + (end_of_id == std::string::npos ? what : what.substr(end_of_id + 2));
    return false;
  }
  [[nodiscard]] const std::string& Problem() const { return problem_; }

 private:
  // Counts what takes far more memory than text.
  bool Count() {
    if (++nodes_ > kMaxNodes) {
      problem_ = fmt::format("has more than {} keys, objects and arrays", kMaxNodes);
    }
    return problem_.empty();
  }
  bool Descend() {
    if (++depth_ > kMaxDepth) {
      problem_ = fmt::format("nested deeper than {} levels", kMaxDepth);
    }
    return problem_.empty();
  }

  std::vector<std::set<std::string>> keys_;  // keys of each open object
  int depth_ = 0;
  int nodes_ = 0;
  std::string problem_;
};

}  // namespace

Result<Json> ParseJson(const std::string& text, const std::string& where) {
  ParseWatch watch;
  if (!Json::sax_parse(text, &watch)) {
    return Fail(ErrorCode::kBadData, "{}: {}", where, watch.Problem());
  }
  return Json::parse(text);
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
