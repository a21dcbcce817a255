#include "recorder/vitals/vital_file_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <new>
#include <utility>
#include <zlib.h>

#include "base/error.h"
#include "crypto/utf8.h"
#include "media/vital_codes.h"
#include "recorder/vitals/hl7_charset.h"
#include "recorder/vitals/hl7_observation.h"
#include "recorder/vitals/mdc_terms.h"

namespace kiroku::recorder {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers of a .vital file are read as they stand");

constexpr std::size_t kMostTracks = 10'000;
constexpr std::size_t kMostRecords = 20'000'000;
constexpr std::size_t kBlockRecords = 256;
constexpr std::int64_t kLongestRecordingUs = std::int64_t{100} * 24 * 3600 * 1'000'000;
constexpr double kLatestS = 1e10;
constexpr std::size_t kLongestText = 100'000;

/// Bytes of a value in each of the file's number formats: float, double, then signed and unsigned of 1, 2, 4
/// bytes.
constexpr std::array<std::size_t, 9> kFormatBytes{0, 4, 8, 1, 1, 2, 2, 4, 4};

/// What Vital Recorder calls the monitor's parameter, where that says without doubt what it is.
constexpr std::array<std::pair<int, std::string_view>, 19> kParameters{{
    {2, "MDC_ECG_HEART_RATE"},
    {4, "MDC_PRESS_BLD_ART_ABP"},
    {5, "MDC_PRESS_BLD_ART_ABP_SYS"},
    {6, "MDC_PRESS_BLD_ART_ABP_DIA"},
    {7, "MDC_PRESS_BLD_ART_ABP_MEAN"},
    {8, "MDC_PULS_OXIM_PLETH"},
    {9, "MDC_PULS_OXIM_PULS_RATE"},
    {10, "MDC_PULS_OXIM_SAT_O2"},
    {11, "MDC_RESP"},
    {12, "MDC_RESP_RATE"},
    {16, "MDC_PRESS_BLD_NONINV_SYS"},
    {17, "MDC_PRESS_BLD_NONINV_DIA"},
    {18, "MDC_PRESS_BLD_NONINV_MEAN"},
    {19, "MDC_TEMP_BODY"},
    {20, "MDC_PRESS_BLD_VEN_CENT"},
    {21, "MDC_PRESS_BLD_VEN_CENT_MEAN"},
    {76, "MDC_PRESS_BLD_ART_PULM_SYS"},
    {77, "MDC_PRESS_BLD_ART_PULM_MEAN"},
    {78, "MDC_PRESS_BLD_ART_PULM_DIA"},
}};

std::string readable(std::string_view text) {
  return crypto::is_utf8(text) ? std::string(text) : converted_to_utf8(text, "ISO-8859-1").value_or("");
}

/// The decimal that a float was written for: 97.3, not 97.30000305.
double decimal_of(float number) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
  double value = number;
  std::from_chars(text.data(), end, value);
  return value;
}

}  // namespace

/// Reads a packet from its start; where too little is left, a number is 0, a text empty, and it has failed.
class VitalFileReader::Cursor {
 public:
  explicit Cursor(std::string_view bytes) : bytes_(bytes) {}

  template <typename Number>
  Number number() {
    Number value{};
    if (bytes_.size() - position_ < sizeof value) {
      failed_ = true;
      position_ = bytes_.size();
      return value;
    }
    std::memcpy(&value, bytes_.data() + position_, sizeof value);
    position_ += sizeof value;
    return value;
  }
  std::string_view text() {
    const auto size = number<std::uint32_t>();
    if (bytes_.size() - position_ < size) {
      failed_ = true;
      position_ = bytes_.size();
      return {};
    }
    const std::string_view text = bytes_.substr(position_, size);
    position_ += size;
    return text;
  }
  void go_to(std::size_t position) {
    failed_ = failed_ || position > bytes_.size();
    position_ = std::min(position, bytes_.size());
  }
  [[nodiscard]] std::size_t position() const { return position_; }
  [[nodiscard]] std::size_t left() const { return bytes_.size() - position_; }
  [[nodiscard]] bool failed() const { return failed_; }

 private:
  std::string_view bytes_;
  std::size_t position_ = 0;
  bool failed_ = false;
};

VitalFileReader::VitalFileReader(const crypto::ByteSource& file, std::string name) : name_(std::move(name)) {
  unpack(file);
  read_packets();
  std::ranges::stable_sort(records_, {}, &Record::end_us);
  // What lies far from the rest has a wrong time.
  if (!records_.empty()) {
    const std::int64_t middle_us = records_[records_.size() / 2].end_us;
    left_out_ += std::erase_if(records_, [&](const Record& record) {
      return std::abs(record.end_us - middle_us) > kLongestRecordingUs / 2;
    });
  }
  if (left_out_ > 0) {
    notice("records-left-out",
           std::to_string(left_out_) +
               " records have no track, no values, no rate or a time far from the others, and are "
               "left out");
  }
}

void VitalFileReader::fail(const std::string& what) const {
  throw Error("cannot read " + name_ + ": " + what);
}

void VitalFileReader::notice(const std::string& name, const std::string& text) {
  pending_.emplace_back(media::VitalNotice{0, name, text, name_});
}

void VitalFileReader::unpack(const crypto::ByteSource& file) {
  struct Inflater {
    z_stream stream{};
    Inflater() {
      constexpr int kGzipOnly = 15 + 16;
      if (inflateInit2(&stream, kGzipOnly) != Z_OK) {
        throw std::bad_alloc();
      }
    }
    ~Inflater() { inflateEnd(&stream); }
    Inflater(const Inflater&) = delete;
    Inflater& operator=(const Inflater&) = delete;
  } inflater;
  z_stream& stream = inflater.stream;
  std::array<std::byte, 64U << 10> in{};
  std::array<char, 64U << 10> out{};
  std::uint64_t offset = 0;
  int result = Z_OK;
  bool whole = false;
  while (result == Z_OK || result == Z_BUF_ERROR || result == Z_STREAM_END) {
    if (stream.avail_in == 0) {
      const std::size_t count = file.read_at(offset, in);
      if (count == 0) {
        break;
      }
      offset += count;
      stream.next_in = reinterpret_cast<Bytef*>(in.data());
      stream.avail_in = static_cast<uInt>(count);
    }
    if (result == Z_STREAM_END) {
      inflateReset(&stream);  // another member follows, as where recording was taken up again
      whole = false;
    }
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    result = inflate(&stream, Z_NO_FLUSH);
    bytes_.append(out.data(), out.size() - stream.avail_out);
    whole = result == Z_STREAM_END;
    if (bytes_.size() > kMostBytes) {
      fail("unpacked it is larger than " + std::to_string(kMostBytes >> 20U) + " MiB; split it");
    }
  }
  if (!bytes_.starts_with("VITA")) {
    fail("it is no recording of Vital Recorder");
  }
  if (!whole) {
    notice("file-cut", "the file's compression is cut short or damaged; it is read up to there");
  }
}

void VitalFileReader::read_packets() {
  Cursor file(bytes_);
  file.go_to(8);  // "VITA", version
  const auto header_bytes = file.number<std::uint16_t>();
  file.go_to(file.position() + header_bytes);
  std::uint64_t unknown = 0;
  while (file.left() > 0 && !file.failed()) {
    const auto type = file.number<std::uint8_t>();
    const auto size = file.number<std::uint32_t>();
    if (file.failed() || file.left() < size) {
      notice("file-cut", "the file ends within a packet; it is read up to there");
      break;
    }
    const std::size_t begin = file.position();
    const Cursor packet(std::string_view(bytes_).substr(begin, size));
    switch (type) {
      case 0:
        read_track(packet);
        break;
      case 1:
        read_record(packet, begin);
        break;
      case 6:   // commands to the viewer
      case 10:  // raw bytes of a device's line
        break;
      case 9:
        read_device(packet);
        break;
      default:
        ++unknown;
    }
    file.go_to(begin + size);
  }
  if (unknown > 0) {
    notice("packets-unknown", std::to_string(unknown) + " packets are of a kind that is not known");
  }
}

void VitalFileReader::read_device(Cursor packet) {
  const auto id = packet.number<std::uint32_t>();
  const std::string type = readable(packet.text());
  const std::string name = packet.left() > 0 ? readable(packet.text()) : "";
  if (devices_.size() < kMostTracks) {
    devices_[id] = name.empty() ? type : name;
  }
}

void VitalFileReader::read_track(Cursor packet) {
  const auto id = packet.number<std::uint16_t>();
  const auto kind = packet.number<std::uint8_t>();
  const auto format = packet.number<std::uint8_t>();
  const std::string name = readable(packet.text());
  if (packet.failed() || tracks_.size() >= kMostTracks) {
    ++left_out_;
    return;
  }
  Track track;
  track.format = format;
  const std::string unit = packet.left() > 0 ? readable(packet.text()) : "";
  packet.number<float>();  // range and colour of the display
  packet.number<float>();
  packet.number<std::uint32_t>();
  track.rate_hz = packet.left() > 0 ? decimal_of(packet.number<float>()) : 0;
  track.gain = packet.left() > 0 ? packet.number<double>() : 1;
  track.offset = packet.left() > 0 ? packet.number<double>() : 0;
  const int parameter = packet.left() > 0 ? packet.number<std::uint8_t>() : 0;
  const auto device = packet.left() > 0 ? packet.number<std::uint32_t>() : std::uint32_t{0};
  if ((kind != 1 && kind != 2 && kind != 5) || (kind != 5 && (format < 1 || format > 8))) {
    notice("track-unknown", "the track '" + name + "' is of a kind or number format that is not known");
    by_id_.erase(id);
    return;
  }
  track.kind = static_cast<Kind>(kind);
  const auto known = devices_.find(device);
  track.source = name_ + (known == devices_.end() || known->second.empty() ? "" : "/" + known->second);
  const auto* const mapped =
      std::ranges::find(kParameters, parameter, &std::pair<int, std::string_view>::first);
  Quantity quantity = quantity_of_label(name.empty() ? "track " + std::to_string(id) : name);
  if (mapped != kParameters.end()) {
    quantity = {std::string(mapped->second), media::find_vital_code(mapped->second)->mdc, ""};
  }
  // Two tracks of a device must not become one.
  const auto [place, first] = names_.try_emplace({track.source, quantity.code}, name);
  if (!first && place->second != name) {
    quantity = {name, 0, ""};
  }
  track.code = quantity.code.empty() ? "track " + std::to_string(id) : quantity.code;
  track.mdc = quantity.mdc;
  const Unit ucum = unit_of(std::string_view(unit));
  track.unit = ucum.unit;
  if (!ucum.known) {
    notice("unit-unknown", "the unit '" + unit + "' of " + name + " is not known; it was kept as it is");
  }
  by_id_[id] = tracks_.size();
  tracks_.push_back(std::move(track));
}

void VitalFileReader::read_record(Cursor packet, std::size_t begin) {
  const auto info_bytes = packet.number<std::uint16_t>();
  const auto start_s = packet.number<double>();
  const auto id = packet.number<std::uint16_t>();
  packet.go_to(2 + std::size_t{info_bytes});
  const auto found = by_id_.find(id);
  if (packet.failed() || found == by_id_.end() || !(start_s > 0) || start_s > kLatestS ||
      records_.size() >= kMostRecords) {
    ++left_out_;
    return;
  }
  const std::size_t index = found->second;
  const Track& track = tracks_[index];
  const auto start_us = static_cast<std::int64_t>(std::llround(start_s * 1e6));
  if (track.kind == Kind::kText) {
    packet.number<std::uint32_t>();
    const std::string_view text = packet.text();
    if (packet.failed() || text.size() > kLongestText) {
      ++left_out_;
      return;
    }
    records_.push_back({start_us, index, begin + packet.position() - text.size(), text.size()});
    return;
  }
  const std::size_t value_bytes = kFormatBytes.at(static_cast<std::size_t>(track.format));
  if (track.kind == Kind::kNumber) {
    if (packet.left() < value_bytes) {
      ++left_out_;
      return;
    }
    records_.push_back({start_us, index, begin + packet.position(), 1});
    return;
  }
  const std::size_t count = packet.number<std::uint32_t>();
  if (packet.failed() || packet.left() / value_bytes < count || count == 0 || !(track.rate_hz > 0) ||
      track.rate_hz > 1e6) {
    ++left_out_;
    return;
  }
  add_wave(track, index, start_s, begin + packet.position(), count);
}

void VitalFileReader::add_wave(const Track& track, std::size_t index, double start_s, std::size_t begin,
                               std::size_t count) {
  // In pieces of a second, so that a long one takes its place among the others.
  const auto piece = static_cast<std::size_t>(
      std::clamp(std::round(track.rate_hz), 1.0, static_cast<double>(kMostBlockValues)));
  const std::size_t value_bytes = kFormatBytes.at(static_cast<std::size_t>(track.format));
  for (std::size_t first = 0; first < count; first += piece) {
    const std::size_t values = std::min(piece, count - first);
    const double end_s = start_s + static_cast<double>(first + values) / track.rate_hz;
    if (end_s > kLatestS || records_.size() >= kMostRecords) {
      ++left_out_;
      return;
    }
    records_.push_back({std::llround(end_s * 1e6), index, begin + first * value_bytes, values});
  }
}

double VitalFileReader::value_at(const Track& track, std::size_t at) const {
  const auto number = [&]<typename Number>(Number value) {
    std::memcpy(&value, bytes_.data() + at, sizeof value);
    return value;
  };
  switch (track.format) {
    case 1:
      return decimal_of(number(float{}));
    case 2:
      return number(double{});
    case 3:
      return number(std::int8_t{});
    case 4:
      return number(std::uint8_t{});
    case 5:
      return number(std::int16_t{});
    case 6:
      return number(std::uint16_t{});
    case 7:
      return number(std::int32_t{});
    default:
      return number(std::uint32_t{});
  }
}

VitalLine VitalFileReader::line_of(const Record& record) const {
  const Track& track = tracks_[record.track];
  const std::int64_t time_ns = (record.end_us - records_.front().end_us) * 1000;
  const UtcTime device_time{std::chrono::microseconds(record.end_us)};
  if (track.kind == Kind::kText) {
    media::VitalText text;
    text.time_ns = time_ns;
    text.device_time = device_time;
    text.code = track.code;
    text.mdc = track.mdc;
    text.text = readable(std::string_view(bytes_).substr(record.begin, record.count));
    text.source = track.source;
    return text;
  }
  const std::size_t value_bytes = kFormatBytes.at(static_cast<std::size_t>(track.format));
  VitalSample sample;
  if (track.kind == Kind::kWave) {
    // Numbers of a converter: value = gain * number + offset. Floats are values already.
    const bool counts = track.format > 2 && track.gain != 0;
    const Scaling scaling = counts ? Scaling(track.gain, -track.offset / track.gain) : Scaling();
    std::vector<double> values(record.count);
    for (std::size_t i = 0; i < record.count; ++i) {
      const double number = value_at(track, record.begin + i * value_bytes);
      values[i] = counts ? scaling(number) : number;
    }
    sample = wave_sample(time_ns, track.rate_hz, std::move(values));
  } else {
    const double value = value_at(track, record.begin);
    sample.time_ns = time_ns;
    if (std::isfinite(value) && !means_missing(value)) {
      sample.value = value;
    } else {
      sample.quality = media::VitalQuality::kMissing;
    }
  }
  sample.device_time = device_time;
  sample.code = track.code;
  sample.mdc = track.mdc;
  sample.unit = track.unit;
  sample.source = track.source;
  return sample;
}

bool VitalFileReader::read_block(std::vector<VitalLine>& lines) {
  std::ranges::move(std::exchange(pending_, {}), std::back_inserter(lines));
  for (std::size_t i = 0; i < kBlockRecords && next_ < records_.size(); ++i) {
    lines.push_back(line_of(records_[next_++]));
  }
  return !lines.empty();
}

}  // namespace kiroku::recorder
