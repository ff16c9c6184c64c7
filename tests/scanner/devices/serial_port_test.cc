#include "scanner/devices/serial_port.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>

namespace sateen::serial_port_test {
namespace {

using ::testing::HasSubstr;

TEST(SerialPort, ThatIsNotThereSaysWhatToDo) {
  const std::unique_ptr<BytePort> port = MakeSerialPort("/dev/sateen-no-such-port");
  EXPECT_EQ(port->Name(), "/dev/sateen-no-such-port");
  const Status opened = port->Open();
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kDevice);
  EXPECT_THAT(opened.error().message, HasSubstr("/dev/sateen-no-such-port"));
  EXPECT_THAT(opened.error().message, HasSubstr("sateen devices"));
}

TEST(SerialPort, ThatIsNotOpenNeitherReadsNorWrites) {
  const std::unique_ptr<BytePort> port = MakeSerialPort("/dev/sateen-no-such-port");
  std::array<std::uint8_t, 4> bytes{};
  const Status written = port->Write(bytes);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kDevice);
  const Result<std::size_t> read = port->Read(bytes, std::chrono::milliseconds(1));
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kDevice);
  port->Close();
}

// Whatever this computer has: in order, and only what is USB may be a board.
TEST(SerialPort, ListsPortsByName) {
  const Result<std::vector<SerialPortInfo>> ports = ListSerialPorts();
  if (!ports) {
    EXPECT_EQ(ports.error().code, ErrorCode::kDevice);
    return;
  }
  EXPECT_TRUE(std::ranges::is_sorted(*ports, {}, &SerialPortInfo::name));
  for (const SerialPortInfo& port : *ports) {
    EXPECT_TRUE(port.usb || !port.may_be_board) << port.name;
  }
}

}  // namespace
}  // namespace sateen::serial_port_test
