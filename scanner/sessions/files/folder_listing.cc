#include "scanner/sessions/files/folder_listing.h"

#include <algorithm>
#include <iterator>
#include <map>

#include "imaging/image_io.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// Takes the digits at the front of `text`, without leading zeros.
std::string_view TakeNumber(std::string_view& text) {
  const auto end = std::find_if_not(text.begin(), text.end(), IsDigit);
  std::string_view digits = text.substr(0, static_cast<size_t>(end - text.begin()));
  text.remove_prefix(digits.size());
  digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
  return digits;
}

std::string Plural(size_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

}  // namespace

bool NaturalLess(std::string_view a, std::string_view b) {
  std::string_view rest_a = a;
  std::string_view rest_b = b;
  while (!rest_a.empty() && !rest_b.empty()) {
    if (IsDigit(rest_a[0]) && IsDigit(rest_b[0])) {
      const std::string_view number_a = TakeNumber(rest_a);
      const std::string_view number_b = TakeNumber(rest_b);
      if (number_a.size() != number_b.size()) {
        return number_a.size() < number_b.size();
      }
      if (number_a != number_b) {
        return number_a < number_b;
      }
    } else {
      if (rest_a[0] != rest_b[0]) {
        return rest_a[0] < rest_b[0];
      }
      rest_a.remove_prefix(1);
      rest_b.remove_prefix(1);
    }
  }
  if (rest_a.empty() != rest_b.empty()) {
    return rest_a.empty();
  }
  return a < b;  // they differ in leading zeros at most
}

bool Exists(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

bool LeadsOutOf(const fs::path& dir, const fs::path& name) {
  const auto is_outside = [](const fs::path& relative) {
    return relative.empty() || relative.is_absolute() || *relative.begin() == "..";
  };
  std::error_code failed;
  const fs::path base = fs::weakly_canonical(dir, failed);
  const fs::path place = failed ? base : fs::weakly_canonical(dir / name, failed);
  return failed || is_outside(name.lexically_normal()) ||
         is_outside(place.lexically_relative(base));
}

std::string LowerCase(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) {
    c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return lower;
}

Result<std::vector<std::string>> FilesInNaturalOrder(const fs::path& dir) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(dir, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    std::error_code ignored;  // a link that leads nowhere is no file
    std::string name = entry->path().filename().string();
    if (!name.starts_with('.') && entry->is_regular_file(ignored)) {
      names.push_back(std::move(name));
    }
  }
  if (error) {
    return Fail(ErrorCode::kIo, "{}: the folder cannot be listed: {}", dir.string(),
                error.message());
  }
  std::sort(names.begin(), names.end(), NaturalLess);
  return names;
}

bool IsMaskName(std::string_view name) {
  const std::string lower = LowerCase(name);
  const std::string stem = fs::path(lower).stem().string();
  return IsPhotoName(lower) &&
         (stem == "mask" || stem.ends_with("_mask") || lower.find(".mask.") != std::string::npos);
}

bool IsReferenceName(std::string_view name) {
  const std::string stem = fs::path(LowerCase(name)).stem().string();
  return stem == "ref" || stem == "reference";
}

Result<std::optional<fs::path>> FindMask(const fs::path& dir) {
  const Result<std::vector<std::string>> names = FilesInNaturalOrder(dir);
  if (!names) {
    return tl::unexpected(names.error());
  }
  std::vector<std::string> masks;
  std::copy_if(names->begin(), names->end(), std::back_inserter(masks), IsMaskName);
  if (masks.size() > 1) {
    return Fail(ErrorCode::kBadData,
                "{}: found {} masks, {} and {} among them; need one: name it with --mask",
                dir.string(), masks.size(), masks[0], masks[1]);
  }
  return masks.empty() ? std::nullopt : std::optional(dir / masks[0]);
}

std::optional<fs::path> FindSharedMask(const fs::path& dir) {
  const Result<std::vector<std::string>> names = FilesInNaturalOrder(dir);
  const auto is_shared_mask = [](const std::string& name) {
    return IsMaskName(name) && LowerCase(fs::path(name).stem().string()) == "mask";
  };
  if (names) {
    const auto mask = std::find_if(names->begin(), names->end(), is_shared_mask);
    if (mask != names->end()) {
      return dir / *mask;
    }
  }
  return std::nullopt;
}

std::string DescribeFolder(const fs::path& dir) {
  std::map<std::string, size_t> endings;
  size_t files = 0;
  size_t folders = 0;
  std::error_code error;
  for (fs::directory_iterator entry(dir, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_directory(ignored)) {
      ++folders;
    } else {
      ++files;
      ++endings[LowerCase(entry->path().extension().string())];
    }
  }
  std::string list;
  for (const auto& [ending, count] : endings) {
    list += fmt::format("{}{} {}", list.empty() ? " (" : ", ", count,
                        ending.empty() ? "without extension" : ending);
  }
  return fmt::format("{}{}{}{}", Plural(files, "file"), list, list.empty() ? "" : ")",
                     folders == 0 ? "" : ", " + Plural(folders, "folder"));
}

}  // namespace sateen
