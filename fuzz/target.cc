#include "fuzz/target.h"

#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>

namespace sateen::fuzz {
namespace {

namespace fs = std::filesystem;

class TempFolder {
 public:
  TempFolder() {
    std::error_code ignored;
    const fs::path memory = "/dev/shm";
    std::string pattern = (fs::is_directory(memory, ignored) ? memory : fs::temp_directory_path()) /
                          "sateen-fuzz-XXXXXX";
    Need(mkdtemp(pattern.data()) != nullptr);
    path_ = pattern;
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  ~TempFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  [[nodiscard]] const fs::path& Path() const { return path_; }

 private:
  fs::path path_;
};

}  // namespace

const fs::path& Folder() {
  static const TempFolder folder;
  return folder.Path();
}

fs::path FileOf(std::string_view name, std::string_view bytes) {
  fs::path path = Folder() / name;
  fs::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  Need(file.good());
  return path;
}

void Need(bool holds) {
  if (!holds) {
    std::abort();
  }
}

}  // namespace sateen::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  sateen::fuzz::Try({reinterpret_cast<const char*>(data), size});
  return 0;
}
