#include "scanner/devices/find_camera.h"

#include <gmock/gmock.h>

#include "tests/testing/files.h"

namespace sateen::find_camera_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TempFolder;
using testing::WriteText;

class FindCamera : public ::testing::Test {
 protected:
  // A device with one interface, as the kernel shows it, and its node.
  void Plug(const std::string& vendor, const std::string& interface_class, bool node = true) {
    const fs::path device = folders_.sys / "bus/usb/devices/1-2";
    WriteText(device / "idVendor", vendor + "\n");
    WriteText(device / "busnum", "1\n");
    WriteText(device / "devnum", "7\n");
    WriteText(device / "manufacturer", "NIKON\n");
    WriteText(device / "product", "DSC D5100\n");
    WriteText(device / "1-2:1.0" / "bInterfaceClass", interface_class + "\n");
    if (node) {
      WriteText(folders_.dev / "bus/usb/001/007", "");
    }
  }

  const TempFolder folder_;
  const SystemFolders folders_ = {.sys = folder_.Path() / "sys",
                                  .dev = folder_.Path() / "dev",
                                  .proc = folder_.Path() / "proc"};
};

TEST_F(FindCamera, ACameraIsFoundByItsInterface) {
  Plug("04b0", "06");
  const std::vector<UsbCamera> cameras = ListUsbCameras(folders_);
  ASSERT_EQ(cameras.size(), 1U);
  EXPECT_EQ(cameras[0].port, "usb:001,007");
  EXPECT_EQ(cameras[0].description, "NIKON DSC D5100");
  EXPECT_EQ(cameras[0].obstacle, "");
}

TEST_F(FindCamera, EachObstacleHasItsRemedy) {
  Plug("04b0", "06", /*node=*/false);
  EXPECT_THAT(ListUsbCameras(folders_)[0].obstacle, HasSubstr("ATTR{idVendor}==\"04b0\""));
  Plug("04b0", "06");
  WriteText(folders_.proc / "4711" / "comm", "gvfs-gphoto2-vo\n");
  EXPECT_THAT(ListUsbCameras(folders_)[0].obstacle, HasSubstr("gvfs-gphoto2-volume-monitor"));
  Plug("04b0", "08");
  EXPECT_THAT(ListUsbCameras(folders_)[0].obstacle, HasSubstr("set its USB mode to PTP"));
}

TEST_F(FindCamera, OtherDevicesAreNoCameras) {
  Plug("0781", "08");  // a memory stick
  EXPECT_THAT(ListUsbCameras(folders_), IsEmpty());
  Plug("04b0", "03");
  EXPECT_THAT(ListUsbCameras(folders_), IsEmpty());
}

TEST(MakeTetheredCamera, NamesSayWhichKindItIs) {
  const TempFolder folder;
  const auto files = MakeTetheredCamera("folder:" + folder.Path().string());
  ASSERT_TRUE(files);
  EXPECT_EQ((*files)->Open()->profile, "folder");
  EXPECT_TRUE(MakeTetheredCamera("ptpip:127.0.0.1:1:1"));
  EXPECT_TRUE(MakeTetheredCamera(""));
  for (const char* name : {"folder:", "nikon", "/dev/ttyACM0"}) {
    EXPECT_EQ(MakeTetheredCamera(name).error().code, ErrorCode::kInvalidArgument) << name;
  }
}

}  // namespace
}  // namespace sateen::find_camera_test
