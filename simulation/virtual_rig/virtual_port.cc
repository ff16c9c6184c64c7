#include "simulation/virtual_rig/virtual_port.h"

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "core/files/file_io.h"
#include "simulation/virtual_rig/board/line_speed.h"

namespace sateen {
namespace fs = std::filesystem;
namespace {

constexpr const char* kDevice = "devices/usb1/1-1";
constexpr const char* kTty = "ttyACM0";
// Receivers of UARTs tell bits apart up to about four per cent.
constexpr double kSpeedTolerance = 0.04;

// Returns the byte as a receiver at another speed reads it: wrong, and the same each time.
uint8_t Garble(uint8_t byte) { return static_cast<uint8_t>(byte << 1 ^ byte >> 3 ^ 0x5A); }

Status Describe(const fs::path& folder, const UsbIdentity& identity) {
  const fs::path interface = folder / kDevice / "1-1:1.0";
  std::error_code failed;
  fs::create_directories(interface / "tty" / kTty, failed);
  fs::create_directories(folder / "class" / "tty", failed);
  fs::create_directories(folder / "dev", failed);
  fs::create_symlink("../../../1-1:1.0", interface / "tty" / kTty / "device", failed);
  if (failed) {
    return Fail(ErrorCode::kIo, "{}: {}; is the disk full?", folder.string(), failed.message());
  }
  const std::pair<const char*, std::string> files[] = {{"busnum", "1"},
                                                       {"devnum", "2"},
                                                       {"idVendor", identity.vendor_id},
                                                       {"idProduct", identity.product_id},
                                                       {"manufacturer", identity.manufacturer},
                                                       {"product", identity.product},
                                                       {"serial", identity.serial_number}};
  for (const auto& [name, text] : files) {
    const fs::path path = folder / kDevice / name;
    if (Status written = WriteBytes(path, text + "\n", path); !written) {
      return written;
    }
  }
  return {};
}

bool LeadsToTerminal(const fs::path& link) {
  std::error_code ignored;
  return fs::read_symlink(link, ignored).string().starts_with("/dev/pts/");
}

}  // namespace

Result<VirtualPort> VirtualPort::Open(const UsbIdentity& identity,
                                      std::optional<std::string> link) {
  Result<OwnFolder> folder = MakeScratchFolder("virtual-rig");
  if (!folder) {
    return tl::unexpected(folder.error());
  }
  VirtualPort port(*std::move(folder));
  port.link_ = std::move(link);
  if (const Status described = Describe(port.Folder(), identity); !described) {
    return tl::unexpected(described.error());
  }
  if (const Status plugged = port.Plug(); !plugged) {
    return tl::unexpected(plugged.error());
  }
  return port;
}

VirtualPort::VirtualPort(VirtualPort&& other) noexcept
    : folder_(std::move(other.folder_)),
      link_(std::move(other.link_)),
      terminal_(std::move(other.terminal_)),
      master_(std::exchange(other.master_, -1)),
      in_use_(other.in_use_),
      bytes_lost_(other.bytes_lost_) {}

VirtualPort::~VirtualPort() { Unplug(); }

Status VirtualPort::Plug() {
  if (Plugged()) {
    return {};
  }
  // As libserialport will set it anyway: bytes pass as they are, and none is echoed.
  termios raw = {};
  cfmakeraw(&raw);
  std::array<char, 64> name = {};
  int slave = -1;
  if (openpty(&master_, &slave, name.data(), &raw, nullptr) != 0) {
    master_ = -1;
    return Fail(ErrorCode::kIo, "no pseudo terminal to be had: {}; is /dev/pts there?",
                SystemReason(errno));
  }
  // Closed once, the terminal says of itself whether somebody has it open.
  close(slave);
  fcntl(master_, F_SETFL, O_NONBLOCK);
  fcntl(master_, F_SETFD, FD_CLOEXEC);
  terminal_ = name.data();
  std::error_code failed;
  fs::create_symlink(terminal_, Folder() / "dev" / kTty, failed);
  fs::create_symlink(fs::path("../..") / kDevice / "1-1:1.0/tty" / kTty,
                     Folder() / "class/tty" / kTty, failed);
  if (!failed && link_) {
    if (fs::is_symlink(*link_) && LeadsToTerminal(*link_)) {  // left by a rig that was killed
      fs::remove(*link_, failed);
    }
    fs::create_symlink(terminal_, *link_, failed);
  }
  if (failed) {
    const std::string at = link_.value_or(Folder().string());
    Unplug();
    return Fail(ErrorCode::kIo, "{}: no link to the port can be made: {}; choose another path", at,
                failed.message());
  }
  return {};
}

void VirtualPort::Unplug() {
  if (!Plugged()) {
    return;
  }
  std::error_code ignored;
  fs::remove(Folder() / "class/tty" / kTty, ignored);
  fs::remove(Folder() / "dev" / kTty, ignored);
  if (link_ && fs::is_symlink(*link_) && fs::read_symlink(*link_, ignored) == terminal_) {
    fs::remove(*link_, ignored);
  }
  close(std::exchange(master_, -1));
  terminal_.clear();
  in_use_ = false;
}

std::vector<uint8_t> VirtualPort::Receive(std::chrono::microseconds longest, double board_baud) {
  const timespec wait = {.tv_sec = longest.count() / 1'000'000,
                         .tv_nsec = longest.count() % 1'000'000 * 1000};
  pollfd event = {.fd = master_, .events = POLLIN, .revents = 0};
  if (!Plugged() || (ppoll(&event, 1, &wait, nullptr) == 1 && (event.revents & POLLIN) == 0)) {
    // Nobody has the port open, which poll() reports at once: the wait is still owed.
    in_use_ = false;
    nanosleep(&wait, nullptr);
    return {};
  }
  in_use_ = true;
  std::vector<uint8_t> bytes(256);
  const ssize_t count = read(master_, bytes.data(), bytes.size());
  bytes.resize(count > 0 ? static_cast<size_t>(count) : 0);
  if (!bytes.empty() && SpeedsDiffer(board_baud)) {
    for (uint8_t& byte : bytes) {
      byte = Garble(byte);
    }
  }
  return bytes;
}

void VirtualPort::Send(const std::vector<uint8_t>& bytes, double board_baud) {
  if (bytes.empty()) {
    return;
  }
  std::vector<uint8_t> sent = bytes;
  if (Plugged() && in_use_ && SpeedsDiffer(board_baud)) {
    for (uint8_t& byte : sent) {
      byte = Garble(byte);
    }
  }
  const ssize_t count = Plugged() && in_use_ ? write(master_, sent.data(), sent.size()) : 0;
  bytes_lost_ += sent.size() - static_cast<size_t>(count > 0 ? count : 0);
}

bool VirtualPort::SpeedsDiffer(double board_baud) const {
  return std::abs(LineSpeed(master_) / board_baud - 1) > kSpeedTolerance;
}

}  // namespace sateen
