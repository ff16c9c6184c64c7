#include "scanner/devices/serial_port.h"

#include <libserialport.h>
#include <sys/file.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <thread>
#include <utility>

#include "firmware/protocol/messages.h"

namespace sateen {
namespace {

constexpr unsigned kWriteTimeoutMs = 500;

constexpr SerialPortInfo::UsbId kBoardIds[] = {
    {0x2341, 0x0001}, {0x2341, 0x0043}, {0x2341, 0x0243},  // Arduino Uno
    {0x2a03, 0x0043},                                      // the same, of arduino.org
    {0x0403, 0x6001},                                      // FT232R: Nano
    {0x1a86, 0x7523}, {0x1a86, 0x5523},                    // CH340, CH341: copies
    {0x10c4, 0xea60},                                      // CP2102: copies
};

bool MayBeBoard(const SerialPortInfo::UsbId& usb) {
  return std::ranges::any_of(kBoardIds, [&](const SerialPortInfo::UsbId& known) {
    return known.vendor == usb.vendor && known.product == usb.product;
  });
}

std::string OrEmpty(const char* text) { return text == nullptr ? std::string() : text; }

// Returns the system's words for the call that has just failed.
std::string LastError(sp_return code) {
  if (code == SP_ERR_FAIL) {
    char* text = sp_last_error_message();
    std::string message = OrEmpty(text);
    sp_free_error_message(text);
    return message;
  }
  return code == SP_ERR_ARG ? "no such port" : "not supported";
}

SerialPortInfo Describe(const sp_port* port) {
  SerialPortInfo info = {.name = OrEmpty(sp_get_port_name(port)),
                         .description = OrEmpty(sp_get_port_description(port)),
                         .serial = OrEmpty(sp_get_port_usb_serial(port))};
  SerialPortInfo::UsbId usb;
  if (sp_get_port_usb_vid_pid(port, &usb.vendor, &usb.product) == SP_OK) {
    info.usb = usb;
    info.may_be_board = MayBeBoard(usb);
  }
  return info;
}

class SerialPort : public BytePort {
 public:
  explicit SerialPort(std::string name) : wanted_(std::move(name)), name_(wanted_) {}
  ~SerialPort() override { Close(); }

  [[nodiscard]] std::string Name() const override { return name_.empty() ? "LED board" : name_; }

  [[nodiscard]] Status Open() override {
    Close();
    if (wanted_.empty()) {
      Result<std::string> found = FindBoardPort();
      if (!found) {
        return tl::unexpected(found.error());
      }
      name_ = *std::move(found);
    }
    Status opened = OpenByName();
    if (!opened) {
      Close();
    }
    return opened;
  }

  void Close() noexcept override {
    if (port_ != nullptr) {
      sp_close(port_);  // an error where it was not open is of no interest
      sp_free_port(port_);
      port_ = nullptr;
    }
  }

  [[nodiscard]] Status Write(std::span<const std::uint8_t> bytes) override {
    const sp_return written =
        port_ == nullptr ? SP_ERR_ARG
                         : sp_blocking_write(port_, bytes.data(), bytes.size(), kWriteTimeoutMs);
    if (written < 0 || static_cast<std::size_t>(written) < bytes.size()) {
      return Gone();
    }
    return {};
  }

  [[nodiscard]] Result<std::size_t> Read(std::span<std::uint8_t> buffer,
                                         Duration longest) override {
    // libserialport counts in milliseconds, and 0 is for ever.
    const auto wait = std::max<Duration::rep>(1, (longest.count() + 999) / 1000);
    const sp_return count = port_ == nullptr
                                ? SP_ERR_ARG
                                : sp_blocking_read_next(port_, buffer.data(), buffer.size(),
                                                        static_cast<unsigned>(wait));
    // When a port is gone, some systems read nothing for ever. Its count of bytes is then an error.
    if (count < 0 || (count == 0 && sp_input_waiting(port_) < 0)) {
      return tl::unexpected(Gone().error());
    }
    return static_cast<std::size_t>(count);
  }

  [[nodiscard]] Duration Now() const override {
    return std::chrono::duration_cast<Duration>(
        std::chrono::steady_clock::now().time_since_epoch());
  }

  void Wait(Duration time) override { std::this_thread::sleep_for(time); }

 private:
  Status OpenByName() {
    sp_return code = sp_get_port_by_name(name_.c_str(), &port_);
    if (code != SP_OK) {
      port_ = nullptr;
      return Fail(ErrorCode::kDevice,
                  "{}: {}; 'sateen devices' lists the ports; is the LED board plugged in?", name_,
                  LastError(code));
    }
    code = sp_open(port_, SP_MODE_READ_WRITE);
    if (code != SP_OK) {
      const bool denied = errno == EACCES;
      return Fail(ErrorCode::kDevice, "{}: cannot be opened: {}{}", name_, LastError(code),
                  denied ? "; add yourself to the group that owns it: sudo usermod -aG dialout "
                           "$USER, then log in again"
                         : "");
    }
    if (Status locked = Lock(); !locked) {
      return locked;
    }
    for (const sp_return set :
         {sp_set_baudrate(port_, static_cast<int>(SATEEN_BAUD)), sp_set_bits(port_, 8),
          sp_set_parity(port_, SP_PARITY_NONE), sp_set_stopbits(port_, 1),
          sp_set_flowcontrol(port_, SP_FLOWCONTROL_NONE), sp_flush(port_, SP_BUF_BOTH)}) {
      if (set != SP_OK) {
        return Fail(ErrorCode::kDevice, "{}: cannot be set to {} baud: {}", name_,
                    static_cast<unsigned long>(SATEEN_BAUD), LastError(set));
      }
    }
    return {};
  }

  // Two programs that read one port each get half of the bytes.
  Status Lock() {
    int descriptor = -1;
    if (sp_get_port_handle(port_, &descriptor) == SP_OK &&
        flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      return Fail(ErrorCode::kDevice, "{}: another program uses it; end that first", name_);
    }
    return {};
  }

  [[nodiscard]] Status Gone() const {
    return Fail(ErrorCode::kDevice, "{}: the port is gone", Name());
  }

  std::string wanted_;  // empty: find it
  std::string name_;
  sp_port* port_ = nullptr;
};

}  // namespace

Result<std::vector<SerialPortInfo>> ListSerialPorts() {
  sp_port** list = nullptr;
  const sp_return code = sp_list_ports(&list);
  if (code != SP_OK) {
    return Fail(ErrorCode::kDevice, "the serial ports cannot be listed: {}; name one with --port",
                LastError(code));
  }
  std::vector<SerialPortInfo> ports;
  for (sp_port** port = list; *port != nullptr; ++port) {
    ports.push_back(Describe(*port));
  }
  sp_free_port_list(list);
  std::ranges::sort(ports, {}, &SerialPortInfo::name);
  return ports;
}

Result<std::string> FindBoardPort() {
  const Result<std::vector<SerialPortInfo>> ports = ListSerialPorts();
  if (!ports) {
    return tl::unexpected(ports.error());
  }
  std::vector<std::string> found;
  for (const SerialPortInfo& port : *ports) {
    if (port.may_be_board) {
      found.push_back(port.name);
    }
  }
  if (found.empty()) {
    return Fail(
        ErrorCode::kDevice,
        "no LED board: {} the USB id of an Arduino Uno or Nano; plug it in, or name its port "
        "with --port or SATEEN_PORT",
        ports->empty()       ? "there is no serial port, so none with"
        : ports->size() == 1 ? fmt::format("{} has not", ports->front().name)
                             : fmt::format("none of {} serial ports has", ports->size()));
  }
  if (found.size() > 1) {
    return Fail(ErrorCode::kDevice,
                "{} and {}: {} ports may be the LED board; name one with "
                "--port or SATEEN_PORT",
                found[0], found[1], found.size());
  }
  return found[0];
}

std::unique_ptr<BytePort> MakeSerialPort(std::string name) {
  return std::make_unique<SerialPort>(std::move(name));
}

}  // namespace sateen
