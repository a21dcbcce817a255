#include "recorder/devices/camera_query.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <tuple>

#include "base/descriptor.h"
#include "base/error.h"

namespace kiroku::recorder {
namespace {

/// Of what a driver lists, so much is looked at: one may go on for ever.
constexpr std::uint32_t kMostListed = 256;

struct FormatName {
  std::uint32_t code;
  const char* name;
};
/// As libavdevice calls them (libavdevice/v4l2-common.c), those compressed least first.
constexpr std::array<FormatName, 15> kFormats{{{V4L2_PIX_FMT_RGB24, "rgb24"},
                                               {V4L2_PIX_FMT_BGR24, "bgr24"},
                                               {V4L2_PIX_FMT_YUV422P, "yuv422p"},
                                               {V4L2_PIX_FMT_YUYV, "yuyv422"},
                                               {V4L2_PIX_FMT_UYVY, "uyvy422"},
                                               {V4L2_PIX_FMT_YUV420, "yuv420p"},
                                               {V4L2_PIX_FMT_YVU420, "yuv420p"},
                                               {V4L2_PIX_FMT_NV12, "nv12"},
                                               {V4L2_PIX_FMT_GREY, "gray"},
                                               {V4L2_PIX_FMT_Y16, "gray16le"},
                                               {V4L2_PIX_FMT_MJPEG, "mjpeg"},
                                               {V4L2_PIX_FMT_JPEG, "mjpeg"},
                                               {V4L2_PIX_FMT_H264, "h264"},
                                               {V4L2_PIX_FMT_HEVC, "hevc"},
                                               {V4L2_PIX_FMT_MPEG4, "mpeg4"}}};

int ask(const Descriptor& device, unsigned long what, void* answer) {
  int result = 0;
  do {
    result = ::ioctl(device.number(), what, answer);
  } while (result < 0 && errno == EINTR);
  return result;
}

template <std::size_t size>
std::string text_of(const std::uint8_t (&field)[size]) {  // NOLINT(*-avoid-c-arrays): the kernel's
  const auto* const end = std::find(std::begin(field), std::end(field), std::uint8_t{0});
  return {std::begin(field), end};
}

std::string characters_of(std::uint32_t code) {
  std::string text;
  for (unsigned shift = 0; shift < 32; shift += 8) text += static_cast<char>(code >> shift & 0x7fU);
  return text;
}

/// Of the intervals between pictures the shortest, turned round.
CameraRate greatest_rate(const Descriptor& device, std::uint32_t code, std::uint32_t width,
                         std::uint32_t height) {
  CameraRate greatest;
  v4l2_frmivalenum interval{};
  for (interval.index = 0; interval.index < kMostListed; ++interval.index) {
    interval.pixel_format = code;
    interval.width = width;
    interval.height = height;
    if (ask(device, VIDIOC_ENUM_FRAMEINTERVALS, &interval) < 0) break;
    const bool discrete = interval.type == V4L2_FRMIVAL_TYPE_DISCRETE;
    const v4l2_fract& shortest = discrete ? interval.discrete : interval.stepwise.min;
    if (shortest.numerator > 0 && shortest.denominator > 0) {
      const CameraRate rate{shortest.denominator, shortest.numerator};
      if (rate.value() > greatest.value()) greatest = rate;
    }
    if (!discrete) break;
  }
  return greatest;
}

/// Sizes of one format; of a range its greatest.
void add_sizes(const Descriptor& device, std::uint32_t code, std::vector<CameraMode>& modes) {
  CameraMode mode;
  mode.format = camera_format_name(code);
  mode.readable = !mode.format.empty();
  if (!mode.readable) mode.format = characters_of(code);
  v4l2_frmsizeenum size{};
  for (size.index = 0; size.index < kMostListed; ++size.index) {
    size.pixel_format = code;
    if (ask(device, VIDIOC_ENUM_FRAMESIZES, &size) < 0) break;
    const bool discrete = size.type == V4L2_FRMSIZE_TYPE_DISCRETE;
    mode.width = discrete ? size.discrete.width : size.stepwise.max_width;
    mode.height = discrete ? size.discrete.height : size.stepwise.max_height;
    mode.rate = greatest_rate(device, code, mode.width, mode.height);
    modes.push_back(mode);
    if (!discrete) break;
  }
}

/// What a device gives as it is set, for one that lists no sizes.
void add_present(const Descriptor& device, std::vector<CameraMode>& modes) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (ask(device, VIDIOC_G_FMT, &format) < 0) return;
  const v4l2_pix_format& pictures = format.fmt.pix;
  CameraMode mode;
  mode.format = camera_format_name(pictures.pixelformat);
  mode.readable = !mode.format.empty();
  if (!mode.readable) mode.format = characters_of(pictures.pixelformat);
  mode.width = pictures.width;
  mode.height = pictures.height;
  v4l2_streamparm stream{};
  stream.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (ask(device, VIDIOC_G_PARM, &stream) == 0) {
    const v4l2_fract& interval = stream.parm.capture.timeperframe;
    if (interval.numerator > 0) mode.rate = {interval.denominator, interval.numerator};
  }
  modes.push_back(mode);
}

}  // namespace

std::string CameraRate::to_string() const {
  return pictures % seconds == 0 ? std::to_string(pictures / seconds)
                                 : std::to_string(pictures) + "/" + std::to_string(seconds);
}

std::string camera_format_name(std::uint32_t code) {
  const auto* const found = std::find_if(kFormats.begin(), kFormats.end(),
                                         [code](const FormatName& format) { return format.code == code; });
  return found == kFormats.end() ? "" : found->name;
}

CameraAbility ask_camera(const std::string& node) {
  const Descriptor device(::open(node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (!device) throw IoError("open", node, errno);
  v4l2_capability capability{};
  if (ask(device, VIDIOC_QUERYCAP, &capability) < 0) {
    throw Error(node + " is no camera: it does not answer as a V4L2 device (" + std::strerror(errno) + ")");
  }
  CameraAbility ability;
  ability.driver = text_of(capability.driver);
  ability.card = text_of(capability.card);
  ability.bus = text_of(capability.bus_info);
  const std::uint32_t of_node = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                    ? capability.device_caps
                                    : capability.capabilities;
  // libavdevice reads no device that has several planes to a picture.
  ability.captures = (of_node & V4L2_CAP_VIDEO_CAPTURE) != 0;
  if (!ability.captures) return ability;
  v4l2_fmtdesc format{};
  for (format.index = 0; format.index < kMostListed; ++format.index) {
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (ask(device, VIDIOC_ENUM_FMT, &format) < 0) break;
    add_sizes(device, format.pixelformat, ability.modes);
  }
  if (ability.modes.empty()) add_present(device, ability.modes);
  return ability;
}

std::optional<CameraMode> best_mode(const std::vector<CameraMode>& modes) {
  const auto worth = [](const CameraMode& mode) {
    constexpr double kSmooth = 23.9, kEnough = 60;
    const auto* const format = std::find_if(
        kFormats.begin(), kFormats.end(), [&](const FormatName& known) { return known.name == mode.format; });
    return std::tuple(mode.readable, mode.rate.value() >= kSmooth, std::uint64_t{mode.width} * mode.height,
                      std::min(mode.rate.value(), kEnough), kFormats.end() - format);
  };
  const auto best = std::max_element(modes.begin(), modes.end(), [&](const auto& one, const auto& other) {
    return worth(one) < worth(other);
  });
  if (best == modes.end() || !best->readable) return {};
  return *best;
}

std::string options_of(const CameraMode& mode) {
  std::string options = "?size=" + std::to_string(mode.width) + "x" + std::to_string(mode.height);
  if (mode.rate.pictures > 0) options += "&rate=" + mode.rate.to_string();
  return options + "&format=" + mode.format;
}

}  // namespace kiroku::recorder
