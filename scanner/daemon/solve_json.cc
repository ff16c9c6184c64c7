#include "scanner/daemon/solve_json.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "imaging/encoding_name.h"
#include "scanner/daemon/request_json.h"

namespace sateen {
namespace {

// Reads one of `choices` by its name; what the request does not say stays.
template <typename Value>
void TakeChoice(JsonReader& json, std::string_view key, const std::vector<Value>& choices,
                Value& into) {
  const std::optional<std::string> text = json.OptionalString(key);
  if (!text) {
    return;
  }
  std::string names;
  for (const Value& choice : choices) {
    if (*text == Name(choice)) {
      into = choice;
      return;
    }
    names += fmt::format("{}{}", names.empty() ? "" : ", ", Name(choice));
  }
  json.Require(false, key, fmt::format("is '{}'; need one of {}", *text, names));
}

std::vector<int> ReadLights(JsonReader& json) {
  std::vector<int> lights;
  for (const double number : json.OptionalNumberList("lights").value_or(std::vector<double>())) {
    const bool is_index = number >= 0.0 && number < 1e6 && number == std::floor(number);
    json.Require(is_index, "lights", fmt::format("has {}; need indices from 0", number));
    lights.push_back(is_index ? static_cast<int>(number) : 0);
  }
  return lights;
}

void ReadMethod(JsonReader& json, SolveOptions& options) {
  LambertianOptions& solver = options.least_squares;
  TakeChoice(json, "backend",
             {Backend::kAuto, Backend::kFast, Backend::kJacobiSvd, Backend::kQr, Backend::kLdlt},
             solver.backend);
  TakeChoice(json, "robust",
             {std::optional(LadderMode::kAuto), std::optional(LadderMode::kLeastSquares),
              std::optional(LadderMode::kConsensus), std::optional<LadderMode>()},
             options.robust);
  TakeChoice(json, "domain", {Domain::kAuto, Domain::kRaw, Domain::kRgb}, options.domain);
  TakeChoice(json, "encoding", {Encoding::kAuto, Encoding::kLinear, Encoding::kSrgb},
             options.encoding);
  TakeChoice(json, "normal_y", {NormalY::kUp, NormalY::kDown}, options.normal_y);
  Take(json.OptionalNumber("shadow_level"), solver.shadow_level);
  Take(json.OptionalNumber("clip_level"), solver.clip_level);
  Take(json.OptionalNumber("dark_level"), solver.dark_level);
  Take(json.OptionalNumber("max_condition"), solver.max_condition);
  Take(json.OptionalNumber("height_mm"), options.height_mm);
  options.relief = TakeFlag(json, "relief");
  options.undistort = TakeFlag(json, "undistort");
  options.fail_above_deg = json.OptionalNumber("fail_above_deg");
  const double limit_deg = options.fail_above_deg.value_or(180.0);
  json.Require(limit_deg > 0.0 && limit_deg <= 180.0, "fail_above_deg",
               fmt::format("is {}; need an angle in (0, 180] degrees", limit_deg));
}

}  // namespace

Result<PostedSolve> SolveFromJson(const std::string& text) {
  const Result<nlohmann::json> parsed = ParseBody(text);
  if (!parsed) {
    return tl::unexpected(parsed.error());
  }
  JsonReader json(*parsed, std::string(kRequest));
  PostedSolve posted = {.client = ReadClient(json)};
  SolveOptions& options = posted.request.options;
  json.Ignore("kind");
  options.capture = ReadPath(json, "capture");
  json.Require(!options.capture.empty(), "capture",
               "is missing; need the folder of a session, an absolute path");
  options.output = ReadPath(json, "output");
  json.Require(!options.output.empty(), "output",
               "is missing; need the folder for the maps, an absolute path");
  options.rig_file = ReadPath(json, "rig");
  options.mask_file = ReadPath(json, "mask");
  options.truth_dir = ReadPath(json, "truth");
  options.lights = ReadLights(json);
  ReadMethod(json, options);
  Take(json.OptionalInteger("threads"), posted.request.threads);
  json.Require(posted.request.threads >= 0 && posted.request.threads <= 1024, "threads",
               fmt::format("is {}; need 0 to 1024", posted.request.threads));
  Status status = FinishRequest(json);
  if (const Status valid = options.least_squares.Validate(); status && !valid) {
    status = Fail(ErrorCode::kInvalidArgument, "request: {}", valid.error().message);
  }
  return status ? Result<PostedSolve>(std::move(posted)) : tl::unexpected(status.error());
}

}  // namespace sateen
