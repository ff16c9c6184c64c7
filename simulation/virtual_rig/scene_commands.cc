#include "simulation/virtual_rig/scene_commands.h"

#include <array>
#include <utility>
#include <vector>

namespace sateen {
namespace {

using Words = std::vector<std::string>;

constexpr double kFarthestPx = 1e5;
constexpr double kBrightest = 1000.0;
constexpr int kMostTimes = 1'000'000;

// The numbers from `words[1]` on, or the first error.
struct Wanted {
  std::string_view what;
  double least;
  double most;
};
Result<std::vector<double>> NumbersOf(const Words& words, const std::vector<Wanted>& wanted) {
  std::vector<double> numbers;
  for (size_t i = 0; i < wanted.size(); ++i) {
    const Wanted& w = wanted[i];
    const Result<double> number = NumberIn(words[i + 1], w.what, w.least, w.most);
    if (!number) {
      return tl::unexpected(number.error());
    }
    numbers.push_back(*number);
  }
  return numbers;
}

Result<int> CountAt(const Words& words, size_t index, std::string_view what) {
  return index < words.size() ? CountIn(words[index], what, 1, kMostTimes) : Result<int>(1);
}

Result<RigAction> ParseCamera(const Words& words, VirtualCamera& camera) {
  if (words[1] == "wake") {
    return RigAction{[&camera] {
      camera.Wake();
      return Status();
    }};
  }
  const Result<CameraFault> fault = CameraFaultNamed(words[1]);
  if (!fault) {
    return Fail(fault.error().code, "{}, or wake", fault.error().message);
  }
  return CountAt(words, 2, "number of captures").map([&](int captures) {
    return RigAction{[&camera, fault = *fault, captures] {
      camera.Inject(fault, captures);
      return Status();
    }};
  });
}

Result<RigAction> ParseTwoLights(const Words& words, SceneCamera& scene) {
  const Result<int> a = scene.ChannelOf(words[1]);
  const Result<int> b = scene.ChannelOf(words[2]);
  if (!a || !b) {
    return tl::unexpected(a ? b.error() : a.error());
  }
  if (*a == *b) {
    return Fail(ErrorCode::kInvalidArgument, "'{} {} {}': need two lights", words[0], words[1],
                words[2]);
  }
  const auto act = words[0] == "swap" ? &SceneCamera::Swap : &SceneCamera::Double;
  return RigAction{[&scene, act, a = *a, b = *b] {
    (scene.*act)(a, b);
    return Status();
  }};
}

Result<RigAction> ParseLight(const Words& words, SceneCamera& scene) {
  const Result<int> channel = scene.ChannelOf(words[1]);
  if (!channel) {
    return tl::unexpected(channel.error());
  }
  return NumberIn(words[2], "factor of the light", 0.0, kBrightest).map([&](double factor) {
    return RigAction{[&scene, channel = *channel, factor] {
      scene.Dim(channel, factor);
      return Status();
    }};
  });
}

Result<RigAction> ParseAmbient(const Words& words, SceneCamera& scene) {
  return NumberIn(words[1], "factor of the ambient light", 0.0, kBrightest).map([&](double factor) {
    return RigAction{[&scene, factor] { return scene.SetAmbient(factor); }};
  });
}

Result<RigAction> ParseNudge(const Words& words, SceneCamera& scene) {
  return NumbersOf(words, {{"DX", -kFarthestPx, kFarthestPx}, {"DY", -kFarthestPx, kFarthestPx}})
      .map([&](const std::vector<double>& by) {
        return RigAction{[&scene, by] {
          scene.Nudge(by[0], by[1]);
          return Status();
        }};
      });
}

Result<RigAction> ParseShade(const Words& words, SceneCamera& scene) {
  const auto numbers = NumbersOf(words, {{"X", -kFarthestPx, kFarthestPx},
                                         {"Y", -kFarthestPx, kFarthestPx},
                                         {"RADIUS", 0.0, kFarthestPx},
                                         {"FACTOR", 0.0, 1.0}});
  if (!numbers) {
    return tl::unexpected(numbers.error());
  }
  const PictureShade shade{(*numbers)[0], (*numbers)[1], (*numbers)[2], (*numbers)[3]};
  return CountAt(words, 5, "number of frames").map([&](int frames) {
    return RigAction{[&scene, shade, frames] {
      scene.Shade(shade, frames);
      return Status();
    }};
  });
}

struct Form {
  std::string_view verb;
  size_t least;  // words after the verb
  size_t most;
  std::string_view usage;
  Result<RigAction> (*parse)(const Words&, SceneCamera&);  // null: "camera"
};

constexpr std::array<Form, 7> kForms = {{
    {"camera", 1, 2, "camera FAULT [N]", nullptr},
    {"ambient", 1, 1, "ambient FACTOR", ParseAmbient},
    {"nudge", 2, 2, "nudge DX DY", ParseNudge},
    {"swap", 2, 2, "swap A B", ParseTwoLights},
    {"double", 2, 2, "double A B", ParseTwoLights},
    {"light", 2, 2, "light K FACTOR", ParseLight},
    {"shade", 4, 5, "shade X Y RADIUS FACTOR [N]", ParseShade},
}};

// A path may have spaces in it.
Result<RigAction> ParseScene(const std::string& line, SceneCamera& scene,
                             std::function<void(const std::string& dir, const Status&)> told) {
  const size_t begin = line.find_first_not_of(" \t", line.find("scene") + 5);
  if (begin == std::string::npos) {
    return Fail(ErrorCode::kInvalidArgument, "'scene' without a folder; need scene DIR");
  }
  const std::string dir = line.substr(begin, line.find_last_not_of(" \t\r") + 1 - begin);
  return RigAction{[&scene, dir, told = std::move(told)] {
    return scene.ChangeScene(dir, [dir, told](const Status& status) { told(dir, status); });
  }};
}

}  // namespace

std::optional<Result<RigAction>> ParseSceneCommand(
    const std::string& line, SceneCamera& scene, VirtualCamera& camera,
    std::function<void(const std::string& dir, const Status&)> scene_read) {
  const Words words = WordsOf(line);
  if (words.empty()) {
    return std::nullopt;
  }
  if (words[0] == "scene") {
    return ParseScene(line, scene, std::move(scene_read));
  }
  for (const Form& form : kForms) {
    if (words[0] == form.verb) {
      const Status count = CheckWordCount(words, form.least + 1, form.most + 1, form.usage);
      if (!count) {
        return tl::unexpected(count.error());
      }
      return form.parse == nullptr ? ParseCamera(words, camera) : form.parse(words, scene);
    }
  }
  return std::nullopt;
}

}  // namespace sateen
