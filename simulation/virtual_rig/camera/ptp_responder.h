#pragma once

#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/error.h"
#include "simulation/virtual_rig/camera/virtual_camera.h"

namespace sateen {

namespace ptp {
struct Packet;
}

// A camera on PTP/IP: the virtual camera at a port of the loopback interface, for libgphoto2 as it
// is. Commands and events are two connections to the same port, which libgphoto2 has to be told
// ("ptpip:127.0.0.1:PORT:PORT": by itself it looks for events at port 15740 whatever the first is).
// A thread waits for connections, another one serves each.
class PtpResponder {
 public:
  // Starts at any free port. Fails as VirtualCamera::Create(), and with kIo if the system refuses a
  // port.
  static Result<std::unique_ptr<PtpResponder>> Start(VirtualCameraOptions options);
  PtpResponder(const PtpResponder&) = delete;
  PtpResponder& operator=(const PtpResponder&) = delete;
  // Ends all connections.
  ~PtpResponder();

  // Returns the port by which libgphoto2 finds it.
  [[nodiscard]] std::string PortName() const;
  [[nodiscard]] VirtualCamera& Camera() { return *camera_; }

 private:
  PtpResponder(std::unique_ptr<VirtualCamera> camera, int listener, int port);
  void Accept();
  void Serve(int socket);
  void ServeCommands(int socket);
  // Returns false if the connection is to end.
  bool Answer(int socket, const ptp::Packet& request);
  void SendEvent(uint16_t code, uint32_t parameter);
  void HangUp();

  std::unique_ptr<VirtualCamera> camera_;
  int listener_;
  int port_;
  std::mutex mutex_;  // guards the next four
  std::set<int> sockets_;
  int event_socket_ = -1;
  int event_connection_ = -1;  // the command connection that it belongs to
  std::vector<std::thread> servers_;
  std::thread acceptor_;
};

}  // namespace sateen
