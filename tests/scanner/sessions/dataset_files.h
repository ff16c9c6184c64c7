#pragma once

#include <gmock/gmock.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "imaging/image_io.h"
#include "scanner/sessions/dataset.h"
#include "tests/testing/files.h"

namespace sateen::testing {

inline constexpr ImageSize kSize = {4, 3};
// Four directions with digits that divide evenly: exact in every layout.
inline const std::vector<std::string> kDirections = {"0.6 0 0.8", "-0.6 0 0.8", "0 0.6 0.8",
                                                     "0 -0.6 0.8"};

inline void WriteFlat(const std::filesystem::path& path, float value, ImageSize size = kSize) {
  std::filesystem::create_directories(path.parent_path());
  ASSERT_TRUE(WriteExr(path, Image3(size, value)));
}

inline void WriteFlatPng16(const std::filesystem::path& path, uint16_t value) {
  const Image<uint16_t> plane(kSize, value);
  ASSERT_TRUE(WritePng16(path, {plane, plane, plane}));
}

inline void WriteMask(const std::filesystem::path& path, ImageSize size = kSize,
                      uint8_t corner = 255) {
  Image<uint8_t> mask(size);
  mask.At(0, 0) = corner;
  ASSERT_TRUE(WritePng8(path, mask));
}

// Normals along z, but unknown at the last pixel.
inline Image3 LevelNormals(ImageSize size = kSize) {
  Image3 normal(size);
  normal[2] = Image<float>(size, 1.0F);
  normal[2].pixels.back() = 0.0F;
  return normal;
}

inline std::string Lines(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) {
    text += line + "\n";
  }
  return text;
}

// A folder with lights.txt and four frames of 0.1, 0.2, 0.3, 0.4.
inline void WriteLightsFolder(const std::filesystem::path& dir) {
  WriteText(dir / "lights.txt", Lines(kDirections));
  for (int k = 0; k < 4; ++k) {
    WriteFlat(dir / fmt::format("im.{}.exr", k + 8), 0.1F * static_cast<float>(k + 1));
  }
}

// The same as a DiLiGenT folder; light k has the intensity k + 1 in red, twice that in green ...
inline void WriteDiligent(const std::filesystem::path& dir) {
  WriteText(dir / "light_directions.txt", Lines(kDirections));
  WriteText(dir / "light_intensities.txt", "1 2 3\n2 4 6\n3 6 9\n4 8 12\n");
  WriteText(dir / "filenames.txt", "b.exr\na.exr\nd.exr\nc.exr\n");
  float value = 0.1F;
  for (const char* name : {"b.exr", "a.exr", "d.exr", "c.exr"}) {
    WriteFlat(dir / name, value);
    value += 0.1F;
  }
}

// Four distant lights "east", "west", "north", "south".
inline Rig FourLights() {
  Rig rig;
  const std::vector<std::pair<std::string, Eigen::Vector3d>> lights = {{"east", {0.6, 0, 0.8}},
                                                                       {"west", {-0.6, 0, 0.8}},
                                                                       {"north", {0, 0.6, 0.8}},
                                                                       {"south", {0, -0.6, 0.8}}};
  for (const auto& [name, direction] : lights) {
    Light light;
    light.name = name;
    light.channel = static_cast<int>(rig.lights.size());
    light.direction = direction;
    light.flux_rgb = Eigen::Vector3d::Constant(1.0 + light.channel);
    rig.lights.push_back(light);
  }
  return rig;
}

// Returns the record of WriteSession(): frames of east to south, then one dark frame.
inline Session FourLightSession() {
  Session session;
  session.rig = "../rig.json";
  for (const char* name : {"east", "west", "north", "south", ""}) {
    SessionFrame frame;
    frame.role = *name == '\0' ? FrameRole::kDark : FrameRole::kLit;
    frame.light = name;
    frame.file = fmt::format("frames/{}.exr", *name == '\0' ? "dark" : name);
    session.frames.push_back(frame);
  }
  return session;
}

// `dir` with session.json, frames of 0.1, 0.2, 0.3, 0.4, a dark frame of 0.05; rig.json beside it.
inline void WriteSession(const std::filesystem::path& dir, const Session& session) {
  WriteText(dir.parent_path() / "rig.json", RigToJson(FourLights()));
  WriteText(dir / "session.json", SessionToJson(session));
  float value = 0.1F;
  for (const char* name : {"east", "west", "north", "south"}) {
    WriteFlat(dir / "frames" / fmt::format("{}.exr", name), value);
    value += 0.1F;
  }
  WriteFlat(dir / "frames" / "dark.exr", 0.05F);
}

// The dataset; ends the test with the message where it cannot be read.
inline Dataset MustRead(const std::filesystem::path& path, const ReadDatasetOptions& options = {},
                        const Task& task = {}) {
  Result<Dataset> dataset = ReadDataset(path, options, task);
  if (!dataset) {
    throw std::runtime_error(dataset.error().message);
  }
  return *std::move(dataset);
}

// The error that reading gives; fails the test where it gives none.
inline Error FailureOf(const std::filesystem::path& path, const ReadDatasetOptions& options = {}) {
  const Result<Dataset> dataset = ReadDataset(path, options);
  EXPECT_FALSE(dataset) << path << " was read";
  return dataset ? Error{ErrorCode::kDevice, ""} : dataset.error();
}

MATCHER_P2(IsError, code, part, "") {
  *result_listener << arg.message;
  return arg.code == code && arg.message.find(part) != std::string::npos;
}

}  // namespace sateen::testing
