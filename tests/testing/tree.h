#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

namespace sateen::testing {

inline std::string ReadText(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// Every file, link and folder below `dir`, sorted, hidden ones too. Links are not followed.
inline std::vector<std::string> Listing(const std::filesystem::path& dir) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(dir)) {
    names.push_back(entry.path().lexically_relative(dir).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

// The same with what each is: the bytes of a file, where a link leads, or the kind.
inline std::map<std::string, std::string> Tree(const std::filesystem::path& dir) {
  std::map<std::string, std::string> tree;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(dir)) {
    const std::string name = entry.path().lexically_relative(dir).string();
    tree[name] = entry.is_symlink()        ? "link to " + read_symlink(entry.path()).string()
                 : entry.is_directory()    ? "folder"
                 : entry.is_regular_file() ? "file " + ReadText(entry.path())
                                           : "special";
  }
  return tree;
}

}  // namespace sateen::testing
