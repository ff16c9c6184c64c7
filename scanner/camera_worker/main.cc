#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "scanner/camera_worker/gphoto_session.h"
#include "scanner/devices/worker_message.h"

// sateen-camera-worker: started by PtpCamera with a socket as its standard input, so that a call of
// libgphoto2 that never returns hangs this process and not the capture.
namespace {

// Waits until the program that started this one has ended, in whatever way. Then this process lets
// go of the camera. It ends even if the library hangs just then.
void EndWithParent() {
  pollfd parent = {.fd = STDIN_FILENO, .events = POLLRDHUP, .revents = 0};
  while (poll(&parent, 1, -1) <= 0) {
  }
  std::this_thread::sleep_for(std::chrono::seconds(1));
  _exit(1);
}

}  // namespace

int main() {
  // The terminal's Ctrl-C is for the program that started this one, which then closes the socket.
  std::signal(SIGINT, SIG_IGN);
  int type = 0;
  socklen_t size = sizeof type;
  if (getsockopt(STDIN_FILENO, SOL_SOCKET, SO_TYPE, &type, &size) != 0) {
    constexpr char kText[] = "sateen-camera-worker is started by sateen, not by hand\n";
    return write(STDERR_FILENO, kText, sizeof kText - 1) > 0 ? 2 : 1;
  }
  std::thread(EndWithParent).detach();
  sateen::GphotoSession session;
  while (true) {
    const auto request = sateen::ReceiveMessage(STDIN_FILENO, std::nullopt);
    if (!request && request.error().code != sateen::ErrorCode::kBadData) {
      break;
    }
    const nlohmann::json answer =
        request ? session.Do(*request) : sateen::GphotoSession::Refuse(request.error());
    if (!sateen::SendMessage(STDIN_FILENO, answer)) {
      break;
    }
  }
  return 0;
}
