#include "scanner/daemon/http/waiting_room.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "scanner/daemon/http/http_message.h"

namespace sateen {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// How long a guest may take to say what it wants, and then to read its answer.
constexpr milliseconds kToAsk{500};
constexpr milliseconds kToLeave{500};
constexpr std::size_t kMaxGuests = 128;
constexpr std::size_t kMaxUrgent = 64;
constexpr std::size_t kMaxWaitingHead = 16'384;  // bytes
constexpr std::size_t kMaxRead = 1'048'576;      // bytes of one guest
constexpr std::size_t kMaxReadAtOnce = 262'144;  // bytes, before the next guest's turn

}  // namespace

WaitingRoom::WaitingRoom(std::string refusal, std::function<bool(std::string_view)> is_urgent)
    : refusal_(std::move(refusal)), is_urgent_(std::move(is_urgent)) {}

WaitingRoom::~WaitingRoom() {
  for (const Guest& guest : guests_) {
    close(guest.fd);
  }
  for (const Urgent& urgent : urgent_) {
    close(urgent.fd);
  }
}

void WaitingRoom::Add(int fd) {
  MakeRoom();
  guests_.push_back({.fd = fd, .until = steady_clock::now() + kToAsk});
}

// The first to go is one that has its answer.
void WaitingRoom::MakeRoom() {
  if (guests_.size() < kMaxGuests) {
    return;
  }
  auto oldest = std::ranges::find_if(guests_, &Guest::answered);
  if (oldest == guests_.end()) {
    oldest = guests_.begin();
    Refuse(*oldest);
  }
  close(oldest->fd);
  guests_.erase(oldest);
}

void WaitingRoom::AppendTo(std::vector<pollfd>& entries) const {
  for (const Guest& guest : guests_) {
    entries.push_back({.fd = guest.fd, .events = POLLIN, .revents = 0});
  }
}

int WaitingRoom::WaitMs() const {
  if (guests_.empty()) {
    return -1;
  }
  const auto first = std::ranges::min_element(guests_, {}, &Guest::until);
  const auto left =
      std::chrono::duration_cast<milliseconds>(first->until - steady_clock::now()).count();
  return static_cast<int>(std::max<milliseconds::rep>(left + 1, 0));
}

void WaitingRoom::Serve() {
  for (auto guest = guests_.begin(); guest != guests_.end();) {
    bool stays = Read(*guest);
    if (stays && steady_clock::now() >= guest->until) {
      stays = !guest->answered;
      if (stays) {
        Refuse(*guest);
      }
    }
    if (!stays && guest->fd >= 0) {
      close(guest->fd);
    }
    guest = stays ? std::next(guest) : guests_.erase(guest);
  }
}

bool WaitingRoom::Read(Guest& guest) {
  std::array<char, 16'384> bytes = {};
  for (std::size_t read = 0; read < kMaxReadAtOnce;) {
    const ssize_t count = recv(guest.fd, bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (count < 0) {
      return errno == EAGAIN || errno == EINTR;
    }
    if (count == 0) {
      if (!guest.answered && !guest.begun.empty()) {
        Refuse(guest);  // it may have ended only its own side
      }
      return false;
    }
    read += static_cast<std::size_t>(count);
    if (!TakeBytes(guest, {bytes.data(), static_cast<std::size_t>(count)})) {
      return false;
    }
  }
  return true;
}

bool WaitingRoom::TakeBytes(Guest& guest, std::string_view bytes) {
  guest.read += bytes.size();
  if (guest.answered) {
    return guest.read < kMaxRead;
  }
  const std::size_t searched = guest.begun.size();
  guest.begun.append(bytes);
  const std::optional<std::size_t> head = HeadSize(guest.begun, searched);
  if (head && urgent_.size() < kMaxUrgent &&
      is_urgent_(std::string_view(guest.begun).substr(0, *head))) {
    urgent_.push_back({.fd = std::exchange(guest.fd, -1), .begun = std::move(guest.begun)});
    return false;
  }
  if (head || guest.begun.size() >= kMaxWaitingHead) {
    Refuse(guest);
  }
  return true;
}

void WaitingRoom::Refuse(Guest& guest) const {
  // Short enough for the socket's own buffer, and a client that does not read it does without.
  [[maybe_unused]] const ssize_t sent =
      send(guest.fd, refusal_.data(), refusal_.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  shutdown(guest.fd, SHUT_WR);
  guest.begun.clear();
  guest.answered = true;
  guest.until = steady_clock::now() + kToLeave;
}

std::optional<WaitingRoom::Urgent> WaitingRoom::TakeUrgent() {
  if (urgent_.empty()) {
    return std::nullopt;
  }
  Urgent urgent = std::move(urgent_.front());
  urgent_.pop_front();
  return urgent;
}

}  // namespace sateen
