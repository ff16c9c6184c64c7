#include "simulation/virtual_rig/camera/ptp_wire.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <cerrno>
#include <string>

namespace sateen::ptp {
namespace {

constexpr size_t kLongestBody = size_t{64} << 20;

bool SendAll(int socket, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) {
      continue;
    }
    if (sent <= 0) {
      return false;
    }
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
  return true;
}

bool ReceiveAll(int socket, std::string& bytes) {
  for (size_t done = 0; done < bytes.size();) {
    const int on = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_QUICKACK, &on, sizeof on);
    const ssize_t got = recv(socket, bytes.data() + done, bytes.size() - done, 0);
    if (got < 0 && errno == EINTR) {
      continue;
    }
    if (got <= 0) {
      return false;
    }
    done += static_cast<size_t>(got);
  }
  return true;
}

}  // namespace

Writer& Writer::PutSized(uint64_t value, size_t size) {
  for (size_t k = 0; k < size; ++k) {
    bytes_.push_back(static_cast<char>(value >> (8 * k) & 0xFF));
  }
  return *this;
}

Writer& Writer::String(std::string_view text) {
  if (text.empty()) {
    return Put(uint8_t{0});
  }
  Put(static_cast<uint8_t>(text.size() + 1));
  return Name(text);
}

Writer& Writer::Name(std::string_view text) {
  for (const char letter : text) {
    Put(static_cast<uint16_t>(static_cast<unsigned char>(letter)));
  }
  return Put(uint16_t{0});
}

uint64_t Read(std::string_view bytes, size_t offset, size_t size) {
  uint64_t value = 0;
  for (size_t k = 0; k < size && offset + k < bytes.size(); ++k) {
    value |= static_cast<uint64_t>(static_cast<unsigned char>(bytes[offset + k])) << (8 * k);
  }
  return value;
}

bool SendPacket(int socket, uint32_t type, std::string_view body) {
  Writer head;
  head.Put(static_cast<uint32_t>(8 + body.size())).Put(type);
  if (body.size() < 4096) {
    return SendAll(socket, head.Raw(body).Bytes());
  }
  return SendAll(socket, head.Bytes()) && SendAll(socket, body);
}

std::optional<Packet> ReceivePacket(int socket) {
  std::string head(8, '\0');
  if (!ReceiveAll(socket, head)) {
    return std::nullopt;
  }
  const uint64_t length = Read(head, 0, 4);
  if (length < 8 || length - 8 > kLongestBody) {
    return std::nullopt;
  }
  Packet packet = {.type = static_cast<uint32_t>(Read(head, 4, 4)),
                   .body = std::string(length - 8, '\0')};
  if (!ReceiveAll(socket, packet.body)) {
    return std::nullopt;
  }
  return packet;
}

}  // namespace sateen::ptp
