#include "recorder/vitals/csv_source.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <fstream>
#include <utility>
#include <vector>

#include "base/ascii.h"
#include "base/error.h"
#include "base/utc_time.h"
#include "media/vital_codes.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/csv_reader.h"

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kLongestTableUs = std::int64_t{100} * 24 * 3600 * 1'000'000;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t";
  const std::size_t begin = std::min(text.find_first_not_of(kBlanks), text.size());
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

/// A whole number of 1 to `most_digits` digits at the start of `text`, which is shortened by it.
std::optional<std::int64_t> take_digits(std::string_view& text, std::size_t most_digits) {
  const std::size_t count = std::min(text.find_first_not_of("0123456789"), text.size());
  if (count == 0 || count > most_digits) {
    return std::nullopt;
  }
  std::int64_t number = 0;
  std::from_chars(text.data(), text.data() + count, number);
  text.remove_prefix(count);
  return number;
}

/// Seconds, optionally with up to nine decimals, that end the text; in nanoseconds.
std::optional<std::int64_t> parse_seconds(std::string_view text) {
  auto whole = take_digits(text, 9);
  if (!whole) {
    return std::nullopt;
  }
  std::int64_t fraction = 0;
  if (!text.empty()) {
    if (text[0] != '.') {
      return std::nullopt;
    }
    text.remove_prefix(1);
    const std::size_t digits = text.size();
    const auto decimals = take_digits(text, 9);
    if (!decimals || !text.empty()) {
      return std::nullopt;
    }
    fraction = *decimals;
    for (std::size_t i = digits; i < 9; ++i) {
      fraction *= 10;
    }
  }
  return *whole * kSecondNs + fraction;
}

std::optional<std::int64_t> parse_clock(std::string_view text) {
  const auto hours = take_digits(text, 4);
  if (!hours || !text.starts_with(':')) {
    return std::nullopt;
  }
  text.remove_prefix(1);
  const bool two_minute_digits = text.find(':') == 2;
  const auto minutes = take_digits(text, 2);
  if (!two_minute_digits || !minutes || *minutes > 59) {
    return std::nullopt;
  }
  text.remove_prefix(1);
  const bool two_second_digits = std::min(text.find('.'), text.size()) == 2;
  const auto seconds_ns = parse_seconds(text);
  if (!two_second_digits || !seconds_ns || *seconds_ns >= 60 * kSecondNs) {
    return std::nullopt;
  }
  return (*hours * 60 + *minutes) * 60 * kSecondNs + *seconds_ns;
}

enum class TimeForm { kSeconds, kClock, kUtc };

TimeForm form_of(std::string_view text) {
  return text.find('T') != std::string_view::npos   ? TimeForm::kUtc
         : text.find(':') != std::string_view::npos ? TimeForm::kClock
                                                    : TimeForm::kSeconds;
}

std::string_view describe(TimeForm form) {
  switch (form) {
    case TimeForm::kSeconds:
      return "seconds such as 12.5";
    case TimeForm::kClock:
      return "a time such as 00:00:12.5";
    case TimeForm::kUtc:
      return "a UTC time such as 2026-08-05T09:15:02.5Z";
  }
  return "";
}

class CsvSource : public VitalSource {
 public:
  explicit CsvSource(const SourceAddress& address)
      : path_(address.location), input_(open(path_)), reader_(input_, path_) {
    address.require_options("speed,zero");
    const std::string zero = address.option("zero", "start");
    if (zero != "start" && zero != "first") {
      throw UsageError("source '" + address.stated + "': zero can only be 'start' or 'first'");
    }
    count_from_first_ = zero == "first";
    read_header();
    first_ = read_sample();
  }

  std::optional<VitalLine> next() override {
    if (interrupted_ || ended_) {
      return std::nullopt;
    }
    if (first_) {
      return std::exchange(first_, std::nullopt);
    }
    ended_ = true;  // also if reading fails
    std::optional<VitalSample> sample = read_sample();
    ended_ = !sample;
    return sample;
  }
  void interrupt() noexcept override { interrupted_ = true; }

 private:
  enum Column : std::size_t { kTime, kCode, kValue, kUnit, kQuality, kColumns };
  static constexpr std::array<std::string_view, kColumns> kColumnNames{"time", "code", "value", "unit",
                                                                       "quality"};
  static constexpr std::size_t kAbsent = SIZE_MAX;

  static std::ifstream open(const std::string& path) {
    std::ifstream input(path, std::ios::binary);
    if (!input) {
      throw IoError("open", path, errno);
    }
    return input;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error("cannot read " + path_ + ": line " + std::to_string(reader_.line()) + what);
  }
  [[noreturn]] void fail(Column column, const std::string& what) const {
    fail(", column " + std::string(kColumnNames[column]) + ": " + what);
  }

  void read_header() {
    std::vector<std::string> names;
    if (!reader_.next(names)) {
      throw Error("cannot read " + path_ +
                  ": it is empty; its first line must name the columns time,code,value,unit");
    }
    places_.fill(kAbsent);
    for (std::size_t place = 0; place < names.size(); ++place) {
      const auto* const known =
          std::find(kColumnNames.begin(), kColumnNames.end(), lower_case(trimmed(names[place])));
      if (known == kColumnNames.end()) {
        continue;
      }
      std::size_t& slot = places_[static_cast<std::size_t>(known - kColumnNames.begin())];
      if (slot != kAbsent) {
        fail(" names the column " + std::string(*known) + " twice");
      }
      slot = place;
    }
    for (const Column column : {kTime, kCode, kValue, kUnit}) {
      if (places_[column] == kAbsent) {
        fail(" names no column " + std::string(kColumnNames[column]) + "; it must name time,code,value,unit");
      }
    }
    width_ = names.size();
  }

  std::optional<VitalSample> read_sample() {
    if (!reader_.next(fields_)) {
      return std::nullopt;
    }
    if (fields_.size() != width_) {
      fail(" has " + std::to_string(fields_.size()) + " fields, the first line names " +
           std::to_string(width_) + " columns");
    }
    VitalSample sample;
    read_time(sample);
    sample.code = field(kCode);
    sample.unit = field(kUnit);
    if (sample.code.empty()) {
      fail(kCode, "is empty");
    }
    if (const media::VitalCode* known = media::find_vital_code(sample.code)) {
      sample.mdc = known->mdc;
      if (sample.unit.empty()) {
        sample.unit = known->unit;
      }
    }
    read_value(sample);
    if (const std::string problem = media::problem_of(sample); !problem.empty()) {
      fail(": " + problem);
    }
    return sample;
  }

  void read_time(VitalSample& sample) {
    const std::string_view text = field(kTime);
    if (!form_) {
      form_ = form_of(text);
    }
    std::optional<std::int64_t> time_ns;
    if (*form_ == TimeForm::kUtc) {
      sample.device_time = parse_utc(text);
      if (sample.device_time) {
        if (!first_utc_) {
          first_utc_ = sample.device_time;
        }
        const std::int64_t elapsed_us = (*sample.device_time - *first_utc_).count();
        if (elapsed_us > kLongestTableUs) {
          fail(kTime, "'" + std::string(text) + "' is more than a hundred days after the first row");
        }
        time_ns = elapsed_us < 0 ? -1 : elapsed_us * 1000;
      }
    } else {
      time_ns = *form_ == TimeForm::kClock ? parse_clock(text) : parse_seconds(text);
      if (time_ns && count_from_first_) {
        if (!first_ns_) {
          first_ns_ = *time_ns;
        }
        *time_ns -= *first_ns_;
      }
    }
    if (!time_ns) {
      fail(kTime, "'" + std::string(text) + "' is not " + std::string(describe(*form_)));
    }
    if (*time_ns < last_ns_) {
      fail(kTime, "'" + std::string(text) + "' is before the row above; rows must be in order of time");
    }
    last_ns_ = *time_ns;
    sample.time_ns = *time_ns;
  }

  void read_value(VitalSample& sample) {
    const std::string_view text = field(kValue);
    if (!text.empty()) {
      double value = 0;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
      if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
        fail(kValue, "'" + std::string(text) + "' is not a number such as 97.5");
      }
      sample.value = value;
    } else {
      sample.quality = media::VitalQuality::kMissing;
    }
    const std::string_view quality = places_[kQuality] == kAbsent ? "" : field(kQuality);
    if (quality.empty()) {
      return;
    }
    const auto known = media::parse_quality(quality);
    if (!known) {
      fail(kQuality,
           "'" + std::string(quality) + "' is none of good, questionable, invalid, missing, or nothing");
    }
    if (text.empty() != (*known == media::VitalQuality::kMissing)) {
      fail(kQuality, "'" + std::string(quality) + "' does not go with the value '" + std::string(text) + "'");
    }
    sample.quality = *known;
  }

  [[nodiscard]] std::string_view field(Column column) const { return trimmed(fields_[places_[column]]); }

  std::string path_;
  std::ifstream input_;
  CsvReader reader_;
  std::array<std::size_t, kColumns> places_{};
  std::size_t width_ = 0;
  std::vector<std::string> fields_;
  bool count_from_first_ = false;
  std::optional<TimeForm> form_;
  std::optional<UtcTime> first_utc_;
  std::optional<std::int64_t> first_ns_;
  std::int64_t last_ns_ = 0;
  std::optional<VitalSample> first_;  // read at opening, so that a wrong table is told then
  bool ended_ = false;
  std::atomic<bool> interrupted_ = false;
};

}  // namespace

std::unique_ptr<VitalSource> open_csv_source(const SourceAddress& address) {
  return std::make_unique<CsvSource>(address);
}

}  // namespace kiroku::recorder
