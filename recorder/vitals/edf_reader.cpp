#include "recorder/vitals/edf_reader.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "crypto/utf8.h"
#include "recorder/vitals/hl7_charset.h"
#include "recorder/vitals/hl7_observation.h"
#include "recorder/vitals/mdc_terms.h"

namespace kiroku::recorder {
namespace {

constexpr std::size_t kFixedHeader = 256;
constexpr std::size_t kSignalHeader = 256;
constexpr std::size_t kMostSignals = 512;
constexpr std::uint64_t kLongestRecord = 16U << 20;
constexpr double kLongestFileS = 100.0 * 24 * 3600;
constexpr std::string_view kAnnotations = "EDF Annotations";

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kPadding(" \0", 2);
  const std::size_t begin = std::min(text.find_first_not_of(kPadding), text.size());
  return text.substr(begin, text.find_last_not_of(kPadding) - begin + 1);
}

/// Headers are ASCII by the standard; what is not is shown all the same.
std::string readable(std::string_view text) {
  text = trimmed(text);
  return crypto::is_utf8(text) ? std::string(text) : converted_to_utf8(text, "ISO-8859-1").value_or("");
}

std::optional<std::int64_t> whole_number(std::string_view text) {
  const auto number = parse_decimal(trimmed(text));
  if (!number || std::abs(*number) > 9e15 || *number != std::floor(*number)) {
    return std::nullopt;
  }
  return static_cast<std::int64_t>(*number);
}

std::optional<UtcTime> start_of(std::string_view date, std::string_view time) {
  const auto part = [](std::string_view text, std::size_t index) {
    return text.size() == 8 ? whole_number(text.substr(3 * index, 2)) : std::nullopt;
  };
  const auto day = part(date, 0), month = part(date, 1), year = part(date, 2);
  const auto hour = part(time, 0), minute = part(time, 1), second = part(time, 2);
  if (!day || !month || !year || !hour || !minute || !second || *hour > 23 || *minute > 59 || *second > 59 ||
      std::min({*day, *month, *year, *hour, *minute, *second}) < 0) {
    return std::nullopt;
  }
  // EDF+ 2.1.3.2: 85 is 1985, 84 is 2084.
  const std::chrono::year_month_day calendar{
      std::chrono::year(static_cast<int>(*year) + (*year >= 85 ? 1900 : 2000)),
      std::chrono::month(static_cast<unsigned>(*month)), std::chrono::day(static_cast<unsigned>(*day))};
  if (!calendar.ok()) {
    return std::nullopt;
  }
  return UtcTime(std::chrono::sys_days(calendar)) + std::chrono::hours(*hour) +
         std::chrono::minutes(*minute) + std::chrono::seconds(*second);
}

}  // namespace

EdfReader::EdfReader(std::unique_ptr<crypto::ByteSource> file, std::string name, const AssumedZone& zone)
    : file_(std::move(file)), name_(std::move(name)), zone_(zone) {
  read_header();
}

void EdfReader::fail(const std::string& what) const { throw Error("cannot read " + name_ + ": " + what); }

void EdfReader::notice(const std::string& name, const std::string& text) {
  pending_.emplace_back(media::VitalNotice{0, name, text, name_});
}

std::vector<PatientNumber> EdfReader::patient() const {
  if (patient_.empty()) return {};
  return {{patient_, "", "", "", false}};
}

void EdfReader::read_header() {
  std::string fixed(kFixedHeader, '\0');
  if (file_->read_at(0, std::as_writable_bytes(std::span(fixed))) != fixed.size()) {
    fail("it is shorter than the header of an EDF file");
  }
  const auto field = [&](std::size_t begin, std::size_t size) {
    return trimmed(std::string_view(fixed).substr(begin, size));
  };
  if (static_cast<unsigned char>(fixed[0]) == 0xFF) {
    fail("it is a BDF file (24 bits a value), which is not read; convert it to EDF");
  }
  if (field(0, 8) != "0") {
    fail("it is no EDF file");
  }
  const auto signals = whole_number(field(252, 4));
  const auto header_bytes = whole_number(field(184, 8));
  const auto records = whole_number(field(236, 8));
  const auto duration = parse_decimal(field(244, 8));
  if (!signals || *signals < 1 || *signals > static_cast<std::int64_t>(kMostSignals)) {
    fail("it states no number of signals from 1 to " + std::to_string(kMostSignals));
  }
  if (!duration || *duration < 0 || *duration > kLongestFileS) {
    fail("it states no duration of a record");
  }
  header_bytes_ = kFixedHeader + static_cast<std::uint64_t>(*signals) * kSignalHeader;
  if (header_bytes && static_cast<std::uint64_t>(*header_bytes) != header_bytes_) {
    notice("header-differs", "the header states another length than its signals take");
  }
  record_s_ = *duration;
  if (field(192, 44).starts_with("EDF+")) {
    // Code, sex, birthdate and name; X is not known, and an underscore a space (EDF+, 2.1.3.3).
    const std::string identification(field(8, 80));
    patient_ = identification.substr(0, identification.find(' '));
    if (patient_ == "X") patient_.clear();
    std::ranges::replace(patient_, '_', ' ');
  }
  discontinuous_ = field(192, 44).starts_with("EDF+D");
  start_ = start_of(std::string_view(fixed).substr(168, 8), std::string_view(fixed).substr(176, 8));
  if (start_) {
    start_ = zone_.utc(*start_);
  } else {
    notice("time-unreadable", "the header states no start: '" + readable(field(168, 16)) + "'");
  }
  std::string rest(header_bytes_ - kFixedHeader, '\0');
  if (file_->read_at(kFixedHeader, std::as_writable_bytes(std::span(rest))) != rest.size()) {
    fail("it ends within its header");
  }
  read_signals(rest);
  const std::uint64_t present = (file_->size() - header_bytes_) / record_bytes_;
  const std::uint64_t left_over = (file_->size() - header_bytes_) % record_bytes_;
  records_ = present;
  if (records && *records >= 0 && (static_cast<std::uint64_t>(*records) != present || left_over != 0)) {
    notice("file-length-differs", "the header states " + std::to_string(*records) + " records, there are " +
                                      std::to_string(present) +
                                      (left_over != 0 ? " and a part of one, which is left out" : ""));
  }
  if (static_cast<double>(records_) * record_s_ > kLongestFileS) {
    fail("it is longer than a hundred days");
  }
}

void EdfReader::read_signals(std::string_view header) {
  const std::size_t count = header.size() / kSignalHeader;
  std::size_t column = 0;
  // Each property of all signals, one after the other.
  const auto values = [&](std::size_t width, auto take) {
    for (std::size_t i = 0; i < count; ++i) {
      take(signals_[i], header.substr(column + i * width, width));
    }
    column += count * width;
  };
  signals_.resize(count);
  const auto text = [](std::string Signal::*member) {
    return [member](Signal& signal, std::string_view field) { signal.*member = readable(field); };
  };
  const auto skip = [](Signal&, std::string_view) {};
  values(16, text(&Signal::label));
  values(80, skip);  // transducer
  values(8, text(&Signal::dimension));
  values(8, text(&Signal::physical_minimum));
  values(8, text(&Signal::physical_maximum));
  values(8, text(&Signal::digital_minimum));
  values(8, text(&Signal::digital_maximum));
  values(80, skip);  // filters
  values(8, [this](Signal& signal, std::string_view field) {
    const auto number = whole_number(field);
    if (!number || *number < 0 || static_cast<std::uint64_t>(*number) > kLongestRecord / 2) {
      fail("the signal '" + signal.label + "' states no number of values in a record");
    }
    signal.values = static_cast<std::size_t>(*number);
  });
  for (Signal& signal : signals_) {
    signal.offset = static_cast<std::size_t>(record_bytes_);
    record_bytes_ += signal.values * 2;
    finish_signal(signal);
  }
  if (record_bytes_ == 0 || record_bytes_ > kLongestRecord) {
    fail("its records are empty, or longer than 16 MiB");
  }
}

void EdfReader::finish_signal(Signal& signal) {
  signal.annotations = signal.label == kAnnotations;
  if (signal.annotations) {
    return;
  }
  if (signal.values > 0 && record_s_ <= 0) {
    fail("it has signals, but its records last no time");
  }
  const Quantity quantity = quantity_of_label(signal.label.empty() ? "unnamed" : signal.label);
  const Unit unit = unit_of(std::string_view(signal.dimension));
  signal.like.code = quantity.code;
  signal.like.mdc = quantity.mdc;
  signal.like.unit = unit.unit;
  signal.like.source = name_;
  if (!unit.known) {
    notice("unit-unknown",
           "the unit '" + unit.unit + "' of " + signal.label + " is not known; it was kept as it is");
  }
  const auto digital_minimum = parse_decimal(signal.digital_minimum);
  const auto digital_maximum = parse_decimal(signal.digital_maximum);
  const auto physical_minimum = parse_decimal(signal.physical_minimum);
  const auto physical_maximum = parse_decimal(signal.physical_maximum);
  const bool known = digital_minimum && digital_maximum && physical_minimum && physical_maximum &&
                     *digital_minimum != *digital_maximum && *physical_minimum != *physical_maximum;
  if (!known) {
    signal.like.unit = "1";
    notice("scale-unreadable",
           "the range of " + signal.label + " says nothing; its numbers are recorded as they are");
    return;
  }
  const double gain = (*physical_maximum - *physical_minimum) / (*digital_maximum - *digital_minimum);
  signal.scaling = Scaling(gain, *digital_minimum - *physical_minimum / gain);
}

std::optional<UtcTime> EdfReader::device_time(std::int64_t time_ns) const {
  if (!start_) {
    return std::nullopt;
  }
  const auto zero_us = static_cast<std::int64_t>(std::llround(zero_s_.value_or(0) * 1e6));
  return *start_ + std::chrono::microseconds(zero_us + time_ns / 1000);
}

bool EdfReader::read_block(std::vector<VitalLine>& lines) {
  if (next_record_ == records_) {
    std::ranges::move(std::exchange(pending_, {}), std::back_inserter(lines));
    return !lines.empty();
  }
  record_.resize(record_bytes_);
  const std::uint64_t offset = header_bytes_ + next_record_ * record_bytes_;
  if (file_->read_at(offset, std::as_writable_bytes(std::span(record_))) != record_.size()) {
    fail("it became shorter while it was read");
  }
  const double before_s = record_start_s_;
  record_start_s_ = static_cast<double>(next_record_) * record_s_;
  std::vector<VitalLine> texts;
  bool first = true;
  for (const Signal& signal : signals_) {
    if (signal.annotations) {
      read_annotations(std::string_view(record_).substr(signal.offset, signal.values * 2), first, texts);
      first = false;
    }
  }
  if (record_start_s_ < before_s) {
    record_start_s_ = before_s;
    notice("time-went-back", "record " + std::to_string(next_record_) + " begins before the one before it");
  }
  ++next_record_;
  const auto start_ns = static_cast<std::int64_t>(std::llround(record_start_s_ * 1e9));
  for (VitalLine& line : std::exchange(pending_, {})) {
    media::set_time_ns(line, start_ns);
    lines.push_back(std::move(line));
  }
  std::ranges::move(texts, std::back_inserter(lines));
  for (const Signal& signal : signals_) {
    if (!signal.annotations && signal.values > 0) {
      read_values(signal, lines);
    }
  }
  return true;
}

void EdfReader::read_values(const Signal& signal, std::vector<VitalLine>& lines) {
  const double rate_hz = static_cast<double>(signal.values) / record_s_;
  const auto by_time = static_cast<std::size_t>(std::ceil(record_s_));
  const std::size_t by_size = (signal.values + kMostBlockValues - 1) / kMostBlockValues;
  const std::size_t pieces = std::clamp<std::size_t>(std::max(by_time, by_size), 1, signal.values);
  for (std::size_t piece = 0; piece < pieces; ++piece) {
    const std::size_t begin = signal.values * piece / pieces;
    const std::size_t end = signal.values * (piece + 1) / pieces;
    std::vector<double> values;
    values.reserve(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      const auto low = static_cast<unsigned char>(record_[signal.offset + 2 * i]);
      const auto high = static_cast<unsigned char>(record_[signal.offset + 2 * i + 1]);
      values.push_back(signal.scaling(static_cast<std::int16_t>(low | high << 8)));
    }
    const double end_s = record_start_s_ + static_cast<double>(end) / rate_hz;
    VitalSample sample = wave_sample(std::llround(end_s * 1e9), rate_hz, std::move(values));
    sample.device_time = device_time(sample.time_ns);
    sample.code = signal.like.code;
    sample.mdc = signal.like.mdc;
    sample.unit = signal.like.unit;
    sample.source = signal.like.source;
    lines.emplace_back(std::move(sample));
  }
}

/// Time-stamped annotation lists: "+12.5<15>2<14>words<14>more words<14><0>".
void EdfReader::read_annotations(std::string_view bytes, bool first_signal, std::vector<VitalLine>& texts) {
  bool first = first_signal;
  while (!bytes.empty()) {
    const std::size_t end = std::min(bytes.find('\0'), bytes.size());
    const std::string_view list = bytes.substr(0, end);
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
    if (list.empty()) {
      continue;
    }
    const std::size_t words_begin = std::min(list.find('\x14'), list.size());
    const std::string_view stamp = list.substr(0, words_begin);
    const std::size_t duration_begin = std::min(stamp.find('\x15'), stamp.size());
    const auto onset = parse_decimal(stamp.substr(0, duration_begin));
    if (!onset || std::abs(*onset) > kLongestFileS) {
      notice("annotation-unreadable", "an annotation of record " + std::to_string(next_record_) +
                                          " has no onset: '" + readable(list.substr(0, 60)) + "'");
      continue;
    }
    if (std::exchange(first, false)) {
      // The first of a record says when the record itself began.
      if (!zero_s_) {
        zero_s_ = *onset;
      }
      if (discontinuous_) {
        record_start_s_ = std::max(0.0, *onset - *zero_s_);
      }
    }
    std::string_view rest = list.substr(std::min(words_begin + 1, list.size()));
    while (!rest.empty()) {
      const std::size_t words_end = std::min(rest.find('\x14'), rest.size());
      const std::string words = readable(rest.substr(0, words_end));
      rest.remove_prefix(std::min(words_end + 1, rest.size()));
      if (words.empty()) {
        continue;
      }
      const double time_s = std::max(0.0, *onset - zero_s_.value_or(0));
      media::VitalText text;
      text.time_ns = std::llround(std::clamp(time_s, record_start_s_, record_start_s_ + record_s_) * 1e9);
      text.device_time = device_time(std::llround(time_s * 1e9));
      text.code = "KIROKU_ANNOTATION";
      text.text = words;
      if (duration_begin < stamp.size()) {
        text.text += " [" + readable(stamp.substr(duration_begin + 1)) + " s]";
      }
      text.source = name_;
      texts.emplace_back(std::move(text));
    }
  }
}

}  // namespace kiroku::recorder
