#include "recorder/vitals/wfdb_reader.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "crypto/utf8.h"
#include "recorder/vitals/hl7_charset.h"
#include "recorder/vitals/hl7_observation.h"
#include "recorder/vitals/mdc_terms.h"

namespace kiroku::recorder {
namespace {

constexpr std::size_t kLongestHeader = 1U << 20;
constexpr std::size_t kMostSignals = 512;
constexpr std::size_t kMostPerFrame = 10'000;
constexpr double kHighestRate = 1e6;
constexpr double kLongestRecordS = 100.0 * 24 * 3600;

/// Bits a value takes, and the number that means that there is none.
struct Format {
  int number;
  unsigned bits;
  std::int32_t missing;
};
constexpr std::array<Format, 6> kFormats{{{16, 16, -32768},
                                          {24, 24, -8'388'608},
                                          {32, 32, std::numeric_limits<std::int32_t>::min()},
                                          {61, 16, -32768},
                                          {80, 8, -128},
                                          {212, 12, -2048}}};

const Format* format_of(int number) {
  const auto* const found = std::ranges::find(kFormats, number, &Format::number);
  return found == kFormats.end() ? nullptr : found;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (;;) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t\r"), line.size()));
    if (line.empty()) {
      return words;
    }
    const std::size_t end = std::min(line.find_first_of(" \t\r"), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

std::optional<std::int64_t> whole_number(std::string_view text) {
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && !text.empty() ? std::optional(number)
                                                                                   : std::nullopt;
}

/// Takes the number that follows `mark` off a word such as "212x4:2+512"; `otherwise` if there is no mark.
std::optional<std::int64_t> take_number(std::string_view& text, char mark, std::int64_t otherwise) {
  if (!text.starts_with(mark)) {
    return otherwise;
  }
  text.remove_prefix(1);
  const std::size_t end = std::min(text.find_first_not_of("0123456789"), text.size());
  const auto number = whole_number(text.substr(0, end));
  text.remove_prefix(end);
  return number;
}

/// "17:27:45.5" and "15/08/1994".
std::optional<UtcTime> start_of(std::string_view time, std::string_view date) {
  std::array<std::string_view, 3> clock, calendar;
  const auto cut = [](std::string_view text, char mark, std::array<std::string_view, 3>& parts) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t end = i == 2 ? text.size() : text.find(mark);
      if (end == std::string_view::npos) {
        return false;
      }
      parts[i] = text.substr(0, end);
      text.remove_prefix(std::min(end + 1, text.size()));
    }
    return true;
  };
  if (!cut(time, ':', clock) || !cut(date, '/', calendar)) {
    return std::nullopt;
  }
  const auto hour = whole_number(clock[0]), minute = whole_number(clock[1]);
  const auto second = parse_decimal(clock[2]);
  const auto day = whole_number(calendar[0]), month = whole_number(calendar[1]),
             year = whole_number(calendar[2]);
  if (!hour || !minute || !second || !day || !month || !year || *hour < 0 || *hour > 23 || *minute < 0 ||
      *minute > 59 || *second < 0 || *second >= 60 || *day < 1 || *day > 31 || *month < 1 || *month > 12 ||
      *year < 1850 || *year > 9999) {
    return std::nullopt;
  }
  const std::chrono::year_month_day ymd{std::chrono::year(static_cast<int>(*year)),
                                        std::chrono::month(static_cast<unsigned>(*month)),
                                        std::chrono::day(static_cast<unsigned>(*day))};
  if (!ymd.ok()) {
    return std::nullopt;
  }
  return UtcTime(std::chrono::sys_days(ymd)) + std::chrono::hours(*hour) + std::chrono::minutes(*minute) +
         std::chrono::microseconds(std::llround(*second * 1e6));
}

bool is_plain_name(std::string_view name) {
  return !name.empty() && name != "-" && name != "." && name != ".." &&
         name.find_first_of(std::string_view("/\\\0", 3)) == std::string_view::npos && crypto::is_utf8(name);
}

}  // namespace

WfdbReader::WfdbReader(const crypto::ByteSource& header, std::string name, const AssumedZone& zone,
                       const OpenFile& open)
    : name_(std::move(name)), zone_(zone) {
  if (header.size() > kLongestHeader) {
    fail("the header is longer than 1 MiB");
  }
  std::string text(header.size(), '\0');
  text.resize(header.read_at(0, std::as_writable_bytes(std::span(text))));
  if (!crypto::is_utf8(text)) {
    text = converted_to_utf8(text, "ISO-8859-1").value_or("");
  }
  read_header(text, open);
}

void WfdbReader::fail(const std::string& what) const { throw Error("cannot read " + name_ + ": " + what); }

void WfdbReader::notice(const std::string& name, const std::string& text) {
  pending_.emplace_back(media::VitalNotice{0, name, text, name_});
}

void WfdbReader::read_header(std::string_view text, const OpenFile& open) {
  bool has_record_line = false;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string line(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::vector<std::string_view> words = words_of(line);
    if (words.empty() || words.front().starts_with('#')) {
      continue;
    }
    if (!std::exchange(has_record_line, true)) {
      read_record_line(words);
    } else if (signals_read_ < signals_stated_) {
      read_signal_line(line, words, open);
    }
  }
  if (!has_record_line || signals_read_ < signals_stated_) {
    fail("the header names " + std::to_string(signals_read_) + " signals and promises " +
         std::to_string(signals_stated_));
  }
  frames_ = std::numeric_limits<std::uint64_t>::max();
  for (File& file : files_) {
    finish_file(file);
    frames_ = std::min(frames_, file.frames);
  }
  if (frames_stated_ && *frames_stated_ != frames_) {
    if (frames_ < *frames_stated_) {
      notice("file-length-differs", "the header promises " + std::to_string(*frames_stated_) +
                                        " frames, the files hold " + std::to_string(frames_));
    }
    frames_ = std::min(frames_, *frames_stated_);
  }
  if (static_cast<double>(frames_) / frames_a_second_ > kLongestRecordS) {
    fail("it is longer than a hundred days");
  }
}

void WfdbReader::read_record_line(const std::vector<std::string_view>& words) {
  if (words[0].find('/') != std::string_view::npos) {
    fail("it is a record of several segments; give the header of one of them");
  }
  const auto signals = words.size() > 1 ? whole_number(words[1]) : std::nullopt;
  if (!signals || *signals < 1 || *signals > static_cast<std::int64_t>(kMostSignals)) {
    fail("its first line names no number of signals from 1 to " + std::to_string(kMostSignals));
  }
  signals_stated_ = static_cast<std::size_t>(*signals);
  if (words.size() > 2) {
    const auto rate = parse_decimal(words[2].substr(0, words[2].find_first_of("/(")));
    if (!rate || *rate <= 0 || *rate > kHighestRate) {
      fail("its first line states no sampling frequency: '" + std::string(words[2]) + "'");
    }
    frames_a_second_ = *rate;
  }
  if (words.size() > 3) {
    const auto frames = whole_number(words[3]);
    if (!frames || *frames < 0) {
      fail("its first line states no number of samples: '" + std::string(words[3]) + "'");
    }
    if (*frames > 0) {
      frames_stated_ = static_cast<std::uint64_t>(*frames);
    }
  }
  if (words.size() > 5) {
    start_ = start_of(words[4], words[5]);
    if (start_) {
      start_ = zone_.utc(*start_);
    } else {
      notice("time-unreadable",
             "the header states no start: '" + std::string(words[4]) + " " + std::string(words[5]) + "'");
    }
  }
}

void WfdbReader::read_signal_line(const std::string& line, const std::vector<std::string_view>& words,
                                  const OpenFile& open) {
  const std::string which = "signal " + std::to_string(++signals_read_);
  if (words.size() < 2 || !is_plain_name(words[0])) {
    fail(which + " names no signal file of the record's folder: '" + line + "'");
  }
  std::string_view form = words[1];
  const std::size_t digits = std::min(form.find_first_not_of("0123456789"), form.size());
  const auto number = whole_number(form.substr(0, digits));
  form.remove_prefix(digits);
  const auto per_frame = take_number(form, 'x', 1);
  const auto skew = take_number(form, ':', 0);
  const auto prologue = take_number(form, '+', 0);
  if (!number || !per_frame || !skew || !prologue || !form.empty() || *per_frame < 1 ||
      *per_frame > static_cast<std::int64_t>(kMostPerFrame) || *skew > 1'000'000 || *prologue > (1LL << 40)) {
    fail(which + " states no format: '" + std::string(words[1]) + "'");
  }
  if (*number > 1000 || format_of(static_cast<int>(*number)) == nullptr) {
    fail(which + " is of format " + std::to_string(*number) + "; 16, 24, 32, 61, 80 and 212 are read");
  }
  Signal signal;
  signal.per_frame = static_cast<std::size_t>(*per_frame);
  signal.skew = static_cast<std::size_t>(*skew);
  // gain(baseline)/units
  double gain = 0;
  std::optional<double> baseline;
  std::string units = "mV";
  if (words.size() > 2) {
    std::string_view text = words[2];
    const std::size_t slash = text.find('/');
    if (slash != std::string_view::npos) {
      units = std::string(text.substr(slash + 1));
    }
    text = text.substr(0, slash);
    const std::size_t bracket = text.find('(');
    const auto stated = parse_decimal(text.substr(0, bracket));
    if (!stated) {
      fail(which + " states no gain: '" + std::string(words[2]) + "'");
    }
    gain = *stated;
    if (bracket != std::string_view::npos && text.ends_with(')')) {
      baseline = parse_decimal(text.substr(bracket + 1, text.size() - bracket - 2));
    }
  }
  const double zero = baseline.value_or(words.size() > 4 ? parse_decimal(words[4]).value_or(0) : 0);
  if (words.size() > 6) {
    signal.checksum = whole_number(words[6]);
  }
  std::string label;
  for (std::size_t i = 8; i < words.size(); ++i) {
    label += (label.empty() ? "" : " ") + std::string(words[i]);
  }
  const Quantity quantity = quantity_of_label(label.empty() ? which : label);
  const Unit unit = unit_of(std::string_view(units));
  signal.like.code = quantity.code;
  signal.like.mdc = quantity.mdc;
  signal.like.unit = unit.unit;
  signal.like.source = name_;
  if (!unit.known) {
    notice("unit-unknown", "the unit '" + units + "' of " + label + " is not known; it was kept as it is");
  }
  if (gain == 0) {
    // header(5): 200 units a millivolt are assumed where nothing was calibrated. Here nothing is assumed.
    signal.like.unit = "1";
    signal.scaling = Scaling(1, 0);
    notice("not-calibrated",
           "the signal " + signal.like.code + " is not calibrated; its numbers are recorded as they are");
  } else {
    signal.scaling = Scaling(1 / gain, zero);
  }
  if (files_.empty() || files_.back().name != words[0]) {
    File file;
    file.name = std::string(words[0]);
    file.format = static_cast<int>(*number);
    file.prologue = static_cast<std::uint64_t>(*prologue);
    file.bytes = open(file.name);
    files_.push_back(std::move(file));
  }
  File& file = files_.back();
  if (file.format != *number) {
    fail(which + " is of another format than the others of " + file.name);
  }
  signal.offset = file.per_frame;
  file.per_frame += signal.per_frame;
  file.longest_skew = std::max(file.longest_skew, signal.skew);
  if (signal.skew > 0) {
    notice("signal-skewed", "the first " + std::to_string(signal.skew) + " frames of " + signal.like.code +
                                " lie before the record's beginning and are left out");
  }
  file.signals.push_back(std::move(signal));
}

void WfdbReader::finish_file(File& file) {
  const std::uint64_t size = file.bytes->size();
  const std::uint64_t bytes = size > file.prologue ? size - file.prologue : 0;
  const unsigned bits = format_of(file.format)->bits;
  file.frames = bytes / bits * 8 + bytes % bits * 8 / bits;  // values, without running over
  file.frames /= file.per_frame;
}

std::vector<std::int32_t> WfdbReader::read_values(const File& file, std::uint64_t begin,
                                                  std::uint64_t end) const {
  const Format& format = *format_of(file.format);
  const std::uint64_t first = begin * file.per_frame;
  const std::uint64_t count = (std::min(end, file.frames) - std::min(begin, file.frames)) * file.per_frame;
  if (count == 0) {
    return {};
  }
  // Of 12-bit values two share three bytes: begin at a pair.
  const std::uint64_t aligned = first - (format.number == 212 ? first % 2 : 0);
  const std::uint64_t byte_begin = aligned * format.bits / 8;
  const std::uint64_t byte_end = ((first + count) * format.bits + 7) / 8;
  std::vector<std::uint8_t> bytes(byte_end - byte_begin);
  const std::size_t got =
      file.bytes->read_at(file.prologue + byte_begin, std::as_writable_bytes(std::span(bytes)));
  bytes.resize(bytes.size() + 4);  // the last value may be read beyond its bytes; nothing of that counts
  if (got + 4 < bytes.size()) {
    fail(file.name + " became shorter while it was read");
  }
  std::vector<std::int32_t> values(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t index = first - aligned + i;
    const std::uint64_t at = format.number == 212 ? index / 2 * 3 : index * format.bits / 8;
    const auto byte = [&](std::uint64_t offset) { return std::uint32_t{bytes[at + offset]}; };
    switch (format.number) {
      case 16:
        values[i] = static_cast<std::int16_t>(byte(0) | byte(1) << 8U);
        break;
      case 61:
        values[i] = static_cast<std::int16_t>(byte(1) | byte(0) << 8U);
        break;
      case 24:
        values[i] = static_cast<std::int32_t>((byte(0) | byte(1) << 8U | byte(2) << 16U) << 8U) >> 8;
        break;
      case 32:
        values[i] = static_cast<std::int32_t>(byte(0) | byte(1) << 8U | byte(2) << 16U | byte(3) << 24U);
        break;
      case 80:
        values[i] = static_cast<std::int32_t>(byte(0)) - 128;
        break;
      default: {
        const bool first_of_pair = index % 2 == 0;
        const auto raw = static_cast<std::int32_t>(first_of_pair ? byte(0) | (byte(1) & 0x0FU) << 8U
                                                                 : byte(2) | (byte(1) & 0xF0U) << 4U);
        values[i] = raw >= 2048 ? raw - 4096 : raw;
      }
    }
  }
  return values;
}

bool WfdbReader::read_block(std::vector<VitalLine>& lines) {
  if (next_frame_ >= frames_ && !std::exchange(checked_, true)) {
    check_sums();
  }
  const double now_s = static_cast<double>(std::min(next_frame_, frames_)) / frames_a_second_;
  for (VitalLine& line : std::exchange(pending_, {})) {
    media::set_time_ns(line, std::llround(now_s * 1e9));
    lines.push_back(std::move(line));
  }
  if (next_frame_ >= frames_) {
    return !lines.empty();
  }
  std::size_t per_frame = 1;
  for (const File& file : files_) {
    per_frame = std::max(per_frame, file.per_frame);
  }
  const auto second = static_cast<std::uint64_t>(std::max(1.0, std::round(frames_a_second_)));
  const std::uint64_t most = std::max<std::uint64_t>(1, kMostBlockValues / per_frame);
  const std::uint64_t end = std::min(frames_, next_frame_ + std::min(second, most));
  for (File& file : files_) {
    read_file(file, next_frame_, end, lines);
  }
  next_frame_ = end;
  return true;
}

void WfdbReader::read_file(File& file, std::uint64_t begin, std::uint64_t end,
                           std::vector<VitalLine>& lines) {
  const std::vector<std::int32_t> values = read_values(file, begin, end + file.longest_skew);
  const std::uint64_t frames = values.size() / file.per_frame;
  const std::int32_t missing = format_of(file.format)->missing;
  for (Signal& signal : file.signals) {
    std::vector<double> wave;
    wave.reserve((end - begin) * signal.per_frame);
    for (std::uint64_t frame = 0; frame < end - begin; ++frame) {
      for (std::size_t i = 0; i < signal.per_frame; ++i) {
        const std::uint64_t place = frame * file.per_frame + signal.offset + i;
        if (frame < frames) {
          // The sum of all samples modulo 2^16.
          signal.sum = static_cast<std::uint16_t>(signal.sum + static_cast<std::uint16_t>(values[place]));
        }
        const std::uint64_t shifted = place + signal.skew * file.per_frame;
        const bool there = shifted < values.size() && values[shifted] != missing;
        wave.push_back(there ? signal.scaling(values[shifted]) : std::numeric_limits<double>::quiet_NaN());
      }
    }
    const double end_s = static_cast<double>(end) / frames_a_second_;
    VitalSample sample = wave_sample(
        std::llround(end_s * 1e9), frames_a_second_ * static_cast<double>(signal.per_frame), std::move(wave));
    if (start_) {
      sample.device_time = *start_ + std::chrono::microseconds(sample.time_ns / 1000);
    }
    sample.code = signal.like.code;
    sample.mdc = signal.like.mdc;
    sample.unit = signal.like.unit;
    sample.source = signal.like.source;
    lines.emplace_back(std::move(sample));
  }
}

void WfdbReader::check_sums() {
  for (const File& file : files_) {
    for (const Signal& signal : file.signals) {
      const bool whole = frames_stated_ && *frames_stated_ == frames_ && signal.checksum;
      if (whole && signal.sum != static_cast<std::uint16_t>(*signal.checksum)) {
        notice("checksum-differs", "the values of " + signal.like.code + " in " + file.name +
                                       " do not have the sum that the header states");
      }
    }
  }
}

}  // namespace kiroku::recorder
