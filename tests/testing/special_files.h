#pragma once

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace sateen::testing {

// A path at which no file can be read, and the words with which that is said.
struct SpecialFile {
  std::filesystem::path path;
  std::string reason;
};

// Makes one of each kind in `folder`, which exists. A file without permission is among them only
// where permissions count: root reads everything.
inline std::vector<SpecialFile> MakeSpecialFiles(const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  std::vector<SpecialFile> files;
  const auto add = [&](const char* name, const char* reason) {
    return files.emplace_back(SpecialFile{folder / name, reason}).path;
  };
  mkfifo(add("pipe", "is a pipe; need a file").c_str(), 0600);
  const fs::path device = add("endless-device", "is a device; need a file");
  if (mknod(device.c_str(), S_IFCHR | 0600, makedev(1, 5)) != 0) {  // for root alone
    fs::create_symlink("/dev/zero", device);
  }
  fs::create_symlink("/dev/tty", add("terminal", "is a device; need a file"));
  fs::create_directory(add("folder", "is a folder; need a file"));
  fs::create_symlink("loop", add("loop", "its links lead in a circle"));
  fs::create_symlink("nowhere", add("dangling", "no such file"));
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  const std::string socket_path = add("socket", "is a socket; need a file");
  std::strncpy(address.sun_path, socket_path.c_str(), sizeof(address.sun_path) - 1);
  const int server = socket(AF_UNIX, SOCK_STREAM, 0);
  static_cast<void>(bind(server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)));
  close(server);
  if (geteuid() != 0) {
    const fs::path secret = add("secret", "get permission to read it");
    std::ofstream(secret) << "{}";
    fs::permissions(secret, fs::perms::none);
  }
  return files;
}

}  // namespace sateen::testing
