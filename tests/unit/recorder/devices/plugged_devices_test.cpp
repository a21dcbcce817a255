// Trees of /sys, /proc and /dev as the kernel and udev make them.
#include "recorder/devices/plugged_devices.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;

class PluggedDevices : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file) << text;
  }
  void link(const std::string& name, const std::string& target) const {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    fs::create_symlink(target, file);
  }
  void camera(int number, const std::string& name, int index) const {
    const std::string place = "sys/class/video4linux/video" + std::to_string(number);
    write(place + "/name", name + "\n");
    write(place + "/index", std::to_string(index) + "\n");
  }
  [[nodiscard]] DeviceFolders folders() const { return {folder_ / "sys", folder_ / "proc", folder_ / "dev"}; }
  [[nodiscard]] std::string dev(const std::string& name) const {
    return (folder_ / ("dev/" + name)).string();
  }

  test::TemporaryFolder folder_;
};

TEST_F(PluggedDevices, AreNoneWhereTheKernelTellsOfNone) {
  EXPECT_THAT(camera_nodes(folders()), IsEmpty());
  EXPECT_THAT(sound_inputs(folders()), IsEmpty());
  EXPECT_THAT(serial_ports(folders()), IsEmpty());
}

TEST_F(PluggedDevices, NamesCamerasInTheOrderOfTheirNumbersWithTheLinkThatLasts) {
  camera(10, "USB Capture HDMI: USB Capture HDMI", 0);
  camera(2, "HD Pro Webcam C920", 0);
  camera(3, "HD Pro Webcam C920", 1);
  write("sys/class/video4linux/v4l-subdev0/name", "ov5640 1-003c\n");
  write("sys/class/video4linux/vbi0/name", "a tuner\n");
  link("dev/v4l/by-id/usb-046d_HD_Pro_Webcam_C920_5B0EBA2F-video-index0", "../../video2");
  link("dev/v4l/by-id/usb-046d_HD_Pro_Webcam_C920_5B0EBA2F-video-index1", "../../video3");
  link("dev/v4l/by-path/pci-0000:00:14.0-usb-0:2:1.0-video-index0", "../../video2");
  const auto found = camera_nodes(folders());
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].node, dev("video2"));
  EXPECT_EQ(found[0].name, "HD Pro Webcam C920");
  EXPECT_EQ(found[0].lasting, dev("v4l/by-id/usb-046d_HD_Pro_Webcam_C920_5B0EBA2F-video-index0"));
  EXPECT_EQ(found[1].lasting, dev("v4l/by-id/usb-046d_HD_Pro_Webcam_C920_5B0EBA2F-video-index1"));
  EXPECT_EQ(found[2].node, dev("video10"));
  EXPECT_EQ(found[2].lasting, "") << "udev made none";
}

TEST_F(PluggedDevices, TellsTwoCamerasWithoutSerialNumbersApartByTheirPlugs) {
  camera(0, "USB Video: USB Video", 0);
  camera(1, "USB Video: USB Video", 1);
  camera(2, "USB Video: USB Video", 0);
  camera(3, "USB Video: USB Video", 1);
  // Both have one name, so udev's link leads to whichever came last.
  link("dev/v4l/by-id/usb-MACROSILICON_USB_Video-video-index0", "../../video2");
  link("dev/v4l/by-id/usb-MACROSILICON_USB_Video-video-index1", "../../video3");
  link("dev/v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0", "../../video0");
  link("dev/v4l/by-path/pci-0000:00:14.0-usb-0:4:1.0-video-index0", "../../video2");
  const auto found = camera_nodes(folders());
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0].lasting, dev("v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0"));
  EXPECT_EQ(found[2].lasting, dev("v4l/by-path/pci-0000:00:14.0-usb-0:4:1.0-video-index0"));
}

TEST_F(PluggedDevices, ReadsWhatTakesSoundIn) {
  write("proc/asound/cards",
        " 0 [PCH            ]: HDA-Intel - HDA Intel PCH\n"
        "                      HDA Intel PCH at 0xd1044000 irq 126\n"
        " 1 [C920           ]: USB-Audio - HD Pro Webcam C920\n"
        "                      HD Pro Webcam C920 at usb-0000:00:14.0-2, high speed\n");
  write("proc/asound/pcm",
        "00-00: ALC221 Analog : ALC221 Analog : playback 1 : capture 1\n"
        "00-03: HDMI 0 : HDMI 0 : playback 1\n"
        "01-00: USB Audio : USB Audio : capture 1\n");
  const auto found = sound_inputs(folders());
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].device, "hw:CARD=PCH,DEV=0");
  EXPECT_EQ(found[0].name, "HDA Intel PCH: ALC221 Analog");
  EXPECT_EQ(found[1].node, dev("snd/pcmC1D0c"));
  EXPECT_EQ(found[1].device, "hw:CARD=C920,DEV=0");
  EXPECT_EQ(found[1].name, "HD Pro Webcam C920: USB Audio");
}

TEST_F(PluggedDevices, SaysOfNoSoundWhereThereIsNoCard) {
  write("proc/asound/cards", "--- no soundcards ---\n");
  write("proc/asound/pcm", "");
  EXPECT_THAT(sound_inputs(folders()), IsEmpty());
}

TEST_F(PluggedDevices, NamesSerialPortsWithHardwareBehindThem) {
  for (const char* port : {"ttyS0", "ttyS1", "ttyUSB0", "ttyACM0", "tty0", "ptmx", "console"}) {
    fs::create_directories(folder_ / ("sys/class/tty/" + std::string(port)));
  }
  write("sys/class/tty/ttyS0/type", "4\n");
  write("sys/class/tty/ttyS1/type", "0\n");
  fs::create_directories(folder_ / "sys/bus/pnp/drivers/serial");
  link("sys/class/tty/ttyS0/device/driver", "../../../../bus/pnp/drivers/serial");
  const std::string usb = "sys/devices/pci0000:00/usb1/1-3";
  write(usb + "/manufacturer", "FTDI\n");
  write(usb + "/product", "FT232R USB UART\n");
  fs::create_directories(folder_ / (usb + "/1-3:1.0/ttyUSB0"));
  link("sys/class/tty/ttyUSB0/device", (folder_ / (usb + "/1-3:1.0/ttyUSB0")).string());
  link("dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0", "../../ttyUSB0");
  const auto found = serial_ports(folders());
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].node, dev("ttyS0"));
  EXPECT_EQ(found[0].name, "serial");
  EXPECT_EQ(found[1].node, dev("ttyACM0"));
  EXPECT_EQ(found[2].node, dev("ttyUSB0"));
  EXPECT_EQ(found[2].name, "FTDI FT232R USB UART");
  EXPECT_EQ(found[2].lasting, dev("serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0"));
}

TEST_F(PluggedDevices, LacksNoGroupForWhatMayBeOpenedOrIsNoDevice) {
  EXPECT_EQ(missing_group("/dev/null"), std::nullopt);
  EXPECT_EQ(missing_group(folder_ / "nothing"), std::nullopt);
}

}  // namespace
}  // namespace kiroku::recorder
