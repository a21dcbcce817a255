#include "media/vitals_table.h"

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "base/csv_field.h"
#include "base/error.h"

namespace kiroku::media {
namespace {

constexpr std::size_t kPieceBytes = 256U << 10;

/// Seconds with as many decimals as they need.
void append_seconds(std::string& text, std::int64_t time_ns) {
  constexpr std::uint64_t kSecondNs = 1'000'000'000;
  const bool negative = time_ns < 0;
  const auto magnitude =
      negative ? std::uint64_t{0} - static_cast<std::uint64_t>(time_ns) : static_cast<std::uint64_t>(time_ns);
  text += negative ? "-" : "";
  text += std::to_string(magnitude / kSecondNs);
  std::string decimals = std::to_string(kSecondNs + magnitude % kSecondNs);
  decimals.erase(decimals.find_last_not_of('0') + 1);
  if (decimals.size() > 1) {
    text += '.';
    text += std::string_view(decimals).substr(1);
  }
}

}  // namespace

VitalsTable::VitalsTable(crypto::ByteSink sink, std::int64_t zero_ns)
    : sink_(std::move(sink)),
      zero_ns_(zero_ns),
      text_("time,code,value,unit,quality,source,since_start,device_time\n") {}

void VitalsTable::add(const VitalSample& sample) {
  if (sample.time_ns < last_ns_) {
    throw Error("the vital signs are not in order of time at " + std::to_string(sample.time_ns) +
                " ns; export them as .jsonl to see them as they were recorded");
  }
  last_ns_ = sample.time_ns;
  const auto rest_with = [&](VitalQuality quality) {
    std::string rest;
    rest += csv_field(sample.code);
    for (const std::string_view field :
         {std::string_view(sample.unit), quality_name(quality), std::string_view(sample.source)}) {
      rest += ',';
      rest += csv_field(field);
    }
    return std::make_shared<const std::string>(std::move(rest));
  };
  const std::size_t code_bytes = csv_field(sample.code).size();
  const auto shared = rest_with(sample.quality);
  std::shared_ptr<const std::string> missing;
  if (sample.is_waveform()) {
    for (std::size_t i = 0; i < sample.values.size(); ++i) {
      const double value = sample.values[i];
      if (std::isnan(value) && !missing) {
        missing = rest_with(VitalQuality::kMissing);
      }
      held_.push({waveform_time_ns(sample, i), sequence_++,
                  std::isnan(value) ? std::nullopt : std::optional(value),
                  i + 1 == sample.values.size() ? sample.device_time : std::nullopt,
                  std::isnan(value) ? missing : shared, code_bytes});
    }
  } else {
    held_.push({sample.time_ns, sequence_++, sample.value, sample.device_time, shared, code_bytes});
  }
  // Whatever comes later begins no earlier than this.
  write_until(sample.time_ns - kLongestWaveformNs);
}

void VitalsTable::finish() {
  write_until(std::numeric_limits<std::int64_t>::max());
  flush();
}

void VitalsTable::write_until(std::int64_t time_ns) {
  while (!held_.empty() && held_.top().time_ns < time_ns) {
    write(held_.top());
    held_.pop();
  }
}

void VitalsTable::write(const Row& row) {
  const std::string_view rest = *row.rest;
  append_seconds(text_, row.time_ns);
  text_ += ',';
  text_ += rest.substr(0, row.code_bytes);
  text_ += ',';
  if (row.value) {
    std::array<char, 32> number{};
    text_.append(number.data(), std::to_chars(number.data(), number.data() + number.size(), *row.value).ptr);
  }
  text_ += rest.substr(row.code_bytes);
  text_ += ',';
  append_seconds(text_, row.time_ns - zero_ns_);
  text_ += ',';
  if (row.device_time) text_ += format_utc(*row.device_time);
  text_ += '\n';
  if (text_.size() >= kPieceBytes) {
    flush();
  }
}

void VitalsTable::flush() {
  sink_(bytes_of(text_));
  text_.clear();
}

}  // namespace kiroku::media
