#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/testing/places.h"

namespace sateen::testing {

// Where the real data sets lie that tests use when present: $SATEEN_DATA or ../shared/data.
inline std::filesystem::path DataDir() {
  const char* from_environment = std::getenv("SATEEN_DATA");
  return from_environment != nullptr
             ? std::filesystem::path(from_environment)
             : std::filesystem::path(testing::SourceDir()).parent_path() / "shared" / "data";
}

// A folder of its own for one test, removed at the end.
class TempFolder {
 public:
  TempFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "sateen-test-XXXXXX").string();
    path_ = mkdtemp(pattern.data());
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& Path() const { return path_; }

 private:
  std::filesystem::path path_;
};

inline void WriteText(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

// Keeps the first `bytes` of a file, as a copy that broke off would.
inline void CutShort(const std::filesystem::path& path, std::uintmax_t bytes) {
  std::filesystem::resize_file(path, bytes);
}

}  // namespace sateen::testing

// Skips the test, saying so, where the data set `name` is not on this machine.
#define SATEEN_NEEDS_DATA(name)                                                               \
  if (!std::filesystem::exists(sateen::testing::DataDir() / (name))) {                        \
    GTEST_SKIP() << "data set '" << (name) << "' is not under " << sateen::testing::DataDir() \
                 << "; set SATEEN_DATA to the data folder";                                   \
  }                                                                                           \
  static_assert(true)
