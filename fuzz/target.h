#pragma once

#include <filesystem>
#include <string_view>

namespace sateen::fuzz {

// Runs the code that is fuzzed. Each target defines it, and LLVMFuzzerTestOneInput calls it.
void Try(std::string_view bytes);

// Returns a folder for readers that take paths: in memory where the system has /dev/shm, removed at
// the end.
[[nodiscard]] const std::filesystem::path& Folder();

// Writes the bytes into a file of Folder() and returns its path. Ends the program where it cannot.
std::filesystem::path FileOf(std::string_view name, std::string_view bytes);

// Ends the program, which is how a target reports a finding, unless `holds`.
void Need(bool holds);

}  // namespace sateen::fuzz
