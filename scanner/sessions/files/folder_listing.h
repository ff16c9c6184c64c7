#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace sateen {

// Numbers inside names compare by value: cat.2 before cat.10. A total order.
[[nodiscard]] bool NaturalLess(std::string_view a, std::string_view b);

// Names of the files in `dir` (no folders, none that begin with a dot), in natural order.
[[nodiscard]] Result<std::vector<std::string>> FilesInNaturalOrder(
    const std::filesystem::path& dir);

// Returns whether it is a mask, as mask.png, cat.mask.tga, cat_mask.png: photographs by their
// ending, masks by their name.
[[nodiscard]] bool IsMaskName(std::string_view name);

// Returns whether it is a picture by room light beside the photographs, as ref.jpg, reference.png.
[[nodiscard]] bool IsReferenceName(std::string_view name);

// Finds the one mask in `dir`; kBadData where several could be meant.
[[nodiscard]] Result<std::optional<std::filesystem::path>> FindMask(
    const std::filesystem::path& dir);

// Finds the first mask.* in `dir`, a folder that need not be ours: nothing where it cannot be
// listed.
[[nodiscard]] std::optional<std::filesystem::path> FindSharedMask(const std::filesystem::path& dir);

// Describes the contents of the folder for messages: "12 files (10 .png, 2 .txt), 1 folder".
[[nodiscard]] std::string DescribeFolder(const std::filesystem::path& dir);

// Returns false also where the path cannot be looked at; reading it will then say why.
[[nodiscard]] bool Exists(const std::filesystem::path& path);

// Returns whether `name`, relative to `dir`, names or leads to something outside of `dir`: an
// absolute path, one with too many "..", or a link on the way.
[[nodiscard]] bool LeadsOutOf(const std::filesystem::path& dir, const std::filesystem::path& name);

// Converts ASCII only: enough for the file name endings and words that we look for.
[[nodiscard]] std::string LowerCase(std::string_view text);

}  // namespace sateen
