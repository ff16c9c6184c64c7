#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "imaging/image_io.h"
#include "tests/testing/files.h"
#include "tests/testing/places.h"

// What tests need that run the program sateen on whole folders.
namespace sateen::testing {

// Returns the program as something to run in a process of its own, with all that it says in `log`.
inline std::function<int()> Sateen(std::vector<std::string> words,
                                   const std::filesystem::path& log = "/dev/null") {
  words.insert(words.begin(), ProgramDir() + "/sateen");
  return [words = std::move(words), log]() mutable {
    std::vector<char*> argv;
    for (std::string& word : words) {
      argv.push_back(word.data());
    }
    argv.push_back(nullptr);
    const int said = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    dup2(said, 1);
    dup2(said, 2);
    // The search for leaks ends programs that are traced.
    setenv("ASAN_OPTIONS", "detect_leaks=0", 1);
    execv(argv[0], argv.data());
    return 127;
  };
}

// Writes small photographs of two chrome spheres under four far lamps, and circles.txt, into `dir`.
inline void WriteSpheres(const std::filesystem::path& dir) {
  constexpr ImageSize kSize = {160, 80};
  constexpr double kRadius = 32.0;
  const Eigen::Vector2d centers[] = {{40.0, 40.0}, {120.0, 40.0}};
  const Eigen::Vector3d lamps[] = {
      {0.4, 0.2, 0.9}, {-0.5, 0.1, 0.8}, {0.1, -0.5, 0.8}, {-0.2, 0.4, 0.9}};
  std::string circles;
  for (const Eigen::Vector2d& center : centers) {
    circles += fmt::format("{} {} {}\n", center.x(), center.y(), kRadius);
  }
  WriteText(dir / "circles.txt", circles);
  for (const Eigen::Vector3d& lamp : lamps) {
    // It shines where the normal halves the angle between lamp and camera.
    const Eigen::Vector3d normal = (lamp.normalized() + Eigen::Vector3d::UnitZ()).normalized();
    std::array<Image<uint16_t>, 3> planes;
    planes.fill(Image<uint16_t>(kSize, 20000));
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSize.width; ++x) {
        for (const Eigen::Vector2d& center : centers) {
          const Eigen::Vector2d at = (Eigen::Vector2d(x, y) - center) / kRadius;
          const double off = (at - Eigen::Vector2d(normal.x(), -normal.y())).norm();
          for (Image<uint16_t>& plane : planes) {
            if (at.norm() < 1.0) {
              plane.At(x, y) = off < 0.08 ? 65535 : 1000;
            }
          }
        }
      }
    }
    ASSERT_TRUE(WritePng16(dir / fmt::format("lamp-{}.png", &lamp - lamps), planes));
  }
}

}  // namespace sateen::testing
