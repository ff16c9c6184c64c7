#pragma once

#include <poll.h>

#include <chrono>
#include <deque>
#include <functional>
#include <list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sateen {

/// Connections for which there is no thread. Each may say within a moment that it turns the lights
/// off. Every other is told `refusal`, and is read for a moment more, so that what it still sends
/// does not take the answer away. Nothing here waits; one thread uses it.
///
/// Where there are too many, the one that has been here longest goes first, so that one that comes
/// now is always heard.
class WaitingRoom {
 public:
  // A connection that turns the lights off, and what has been read of it.
  struct Urgent {
    int fd = -1;
    std::string begun;
  };

  // `is_urgent` looks at a whole head.
  WaitingRoom(std::string refusal, std::function<bool(std::string_view head)> is_urgent);
  WaitingRoom(const WaitingRoom&) = delete;
  WaitingRoom& operator=(const WaitingRoom&) = delete;
  ~WaitingRoom();

  // Takes the descriptor, which must not block.
  void Add(int fd);
  // Takes back one that is urgent and for which there was no thread either.
  void AddUrgent(Urgent urgent) { urgent_.push_front(std::move(urgent)); }
  // Appends what poll() is to look at.
  void AppendTo(std::vector<pollfd>& entries) const;
  // Returns how long poll() may wait; -1: for ever.
  [[nodiscard]] int WaitMs() const;
  // Reads what has come, answers, and closes those whose time has passed.
  void Serve();
  // Returns the urgent one that came first.
  [[nodiscard]] std::optional<Urgent> TakeUrgent();

 private:
  struct Guest {
    int fd = -1;
    std::string begun;
    std::size_t read = 0;   // bytes in all
    bool answered = false;  // only what it still sends is of interest
    std::chrono::steady_clock::time_point until;
  };

  // Both return false where the guest is to leave.
  [[nodiscard]] bool Read(Guest& guest);
  [[nodiscard]] bool TakeBytes(Guest& guest, std::string_view bytes);
  void Refuse(Guest& guest) const;
  void MakeRoom();

  const std::string refusal_;
  const std::function<bool(std::string_view)> is_urgent_;
  std::list<Guest> guests_;  // the latest last
  std::deque<Urgent> urgent_;
};

}  // namespace sateen
