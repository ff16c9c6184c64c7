#include "simulation/virtual_rig/camera/ptp_responder.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "core/files/file_io.h"
#include "simulation/virtual_rig/camera/ptp_wire.h"

namespace sateen {
namespace {

constexpr size_t kPacketBytes = size_t{256} << 10;

bool SendData(int socket, uint32_t transaction, const std::string& data, size_t cut_at) {
  ptp::Writer start;
  start.Put(transaction).Put(static_cast<uint64_t>(data.size()));
  if (!ptp::SendPacket(socket, ptp::kStartData, start.Bytes())) {
    return false;
  }
  size_t offset = 0;
  do {
    const size_t size = std::min(kPacketBytes, data.size() - offset);
    const bool last = offset + size == data.size();
    if (cut_at != 0 && offset + size >= cut_at) {
      // A part of a packet, and then no more.
      ptp::Writer head;
      head.Put(static_cast<uint32_t>(12 + size)).Put(uint32_t{ptp::kData}).Put(transaction);
      head.Raw(std::string_view(data).substr(offset, size / 2));
      send(socket, head.Bytes().data(), head.Bytes().size(), MSG_NOSIGNAL);
      return false;
    }
    ptp::Writer body;
    body.Put(transaction).Raw(std::string_view(data).substr(offset, size));
    if (!ptp::SendPacket(socket, last ? ptp::kEndData : ptp::kData, body.Bytes())) {
      return false;
    }
    offset += size;
  } while (offset < data.size());
  return true;
}

std::optional<std::string> ReceiveData(int socket) {
  std::string data;
  for (std::optional<ptp::Packet> packet; (packet = ptp::ReceivePacket(socket));) {
    if (packet->type == ptp::kStartData) {
      continue;
    }
    data += packet->body.substr(std::min<size_t>(4, packet->body.size()));
    if (packet->type == ptp::kEndData) {
      return data;
    }
  }
  return std::nullopt;
}

}  // namespace

Result<std::unique_ptr<PtpResponder>> PtpResponder::Start(VirtualCameraOptions options) {
  Result<std::unique_ptr<VirtualCamera>> camera = VirtualCamera::Create(std::move(options));
  if (!camera) {
    return tl::unexpected(camera.error());
  }
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
  socklen_t size = sizeof address;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  if (listener < 0 || bind(listener, generic, size) != 0 || listen(listener, 8) != 0 ||
      getsockname(listener, generic, &size) != 0) {
    const int reason = errno;
    if (listener >= 0) {
      close(listener);
    }
    return Fail(ErrorCode::kIo, "no port for the virtual camera: {}", SystemReason(reason));
  }
  return std::unique_ptr<PtpResponder>(
      new PtpResponder(*std::move(camera), listener, ntohs(address.sin_port)));
}

PtpResponder::PtpResponder(std::unique_ptr<VirtualCamera> camera, int listener, int port)
    : camera_(std::move(camera)), listener_(listener), port_(port) {
  camera_->OnEvent([this](uint16_t code, uint32_t parameter) { SendEvent(code, parameter); });
  acceptor_ = std::thread([this] { Accept(); });
}

PtpResponder::~PtpResponder() {
  shutdown(listener_, SHUT_RDWR);
  acceptor_.join();
  HangUp();
  for (std::thread& server : servers_) {
    server.join();
  }
  camera_->OnEvent(nullptr);
  close(listener_);
}

std::string PtpResponder::PortName() const {
  return fmt::format("ptpip:127.0.0.1:{}:{}", port_, port_);
}

void PtpResponder::Accept() {
  while (true) {
    const int socket = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (socket < 0) {
      if (errno == EINTR || errno == ECONNABORTED) {
        continue;
      }
      return;
    }
    const int on = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    const std::lock_guard lock(mutex_);
    sockets_.insert(socket);
    servers_.emplace_back([this, socket] { Serve(socket); });
  }
}

void PtpResponder::Serve(int socket) {
  const std::optional<ptp::Packet> first = ptp::ReceivePacket(socket);
  if (first && first->type == ptp::kInitCommandRequest && !camera_->Asleep()) {
    ptp::Writer answer;
    answer.Put(static_cast<uint32_t>(socket))
        .Put(uint64_t{0x5361746565})
        .Put(uint64_t{1});  // connection, GUID
    answer.Name("Sateen virtual camera").Put(uint32_t{0x10000});
    if (ptp::SendPacket(socket, ptp::kInitCommandAck, answer.Bytes())) {
      ServeCommands(socket);
    }
  } else if (first && first->type == ptp::kInitEventRequest) {
    {
      const std::lock_guard lock(mutex_);
      event_socket_ = socket;
      event_connection_ = static_cast<int>(ptp::Read(first->body, 0, 4));
    }
    if (ptp::SendPacket(socket, ptp::kInitEventAck, "")) {
      while (ptp::ReceivePacket(socket)) {
      }
    }
  } else if (first) {
    while (ptp::ReceivePacket(socket)) {  // asleep: connected, and nothing more
    }
  }
  const std::lock_guard lock(mutex_);
  if (event_socket_ == socket) {
    event_socket_ = -1;
  }
  sockets_.erase(socket);
  close(socket);
}

void PtpResponder::ServeCommands(int socket) {
  while (const std::optional<ptp::Packet> request = ptp::ReceivePacket(socket)) {
    if (request->type == ptp::kCommandRequest && !Answer(socket, *request)) {
      break;
    }
  }
  shutdown(socket, SHUT_RDWR);
  const std::lock_guard lock(mutex_);
  if (event_socket_ >= 0 && event_connection_ == socket) {
    shutdown(event_socket_, SHUT_RDWR);
  }
}

bool PtpResponder::Answer(int socket, const ptp::Packet& request) {
  const uint64_t phase = ptp::Read(request.body, 0, 4);
  const auto operation = static_cast<uint16_t>(ptp::Read(request.body, 4, 2));
  const auto transaction = static_cast<uint32_t>(ptp::Read(request.body, 6, 4));
  std::vector<uint32_t> parameters;
  for (size_t offset = 10; offset + 4 <= request.body.size(); offset += 4) {
    parameters.push_back(static_cast<uint32_t>(ptp::Read(request.body, offset, 4)));
  }
  std::string data;
  if (phase == 2) {
    std::optional<std::string> received = ReceiveData(socket);
    if (!received) {
      return false;
    }
    data = *std::move(received);
  }
  const VirtualCamera::Answer answer = camera_->Handle(operation, parameters, data, transaction);
  if (answer.silent || answer.hang_up) {
    return !answer.hang_up;
  }
  if (answer.data && !SendData(socket, transaction, *answer.data, answer.cut_data_at)) {
    return false;
  }
  ptp::Writer response;
  response.Put(answer.response).Put(transaction);
  for (const uint32_t parameter : answer.parameters) {
    response.Put(parameter);
  }
  return ptp::SendPacket(socket, ptp::kCommandResponse, response.Bytes());
}

void PtpResponder::SendEvent(uint16_t code, uint32_t parameter) {
  ptp::Writer event;
  event.Put(code).Put(uint32_t{0xFFFFFFFF}).Put(parameter);
  const std::lock_guard lock(mutex_);
  if (event_socket_ >= 0 && !ptp::SendPacket(event_socket_, ptp::kEvent, event.Bytes())) {
    shutdown(event_socket_, SHUT_RDWR);
  }
}

void PtpResponder::HangUp() {
  const std::lock_guard lock(mutex_);
  for (const int socket : sockets_) {
    shutdown(socket, SHUT_RDWR);
  }
}

}  // namespace sateen
