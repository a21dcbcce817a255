#include "recorder/vitals/signal_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "base/error.h"
#include "crypto/byte_source.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/block_source.h"
#include "recorder/vitals/edf_reader.h"
#include "recorder/vitals/hl7_vitals.h"
#include "recorder/vitals/patient_watch.h"
#include "recorder/vitals/vital_file_reader.h"
#include "recorder/vitals/wfdb_reader.h"

namespace kiroku::recorder {
namespace {

class SignalSource : public BlockSource {
 public:
  explicit SignalSource(std::unique_ptr<SignalReader> reader) : reader_(std::move(reader)) {}
  void hear_patients(std::shared_ptr<PatientWatch> watch) override { watch_ = std::move(watch); }

 private:
  bool read_block(std::vector<VitalLine>& lines) override {
    if (!reader_->read_block(lines)) {
      return false;
    }
    std::ranges::stable_sort(lines, {}, [](const VitalLine& line) { return media::time_ns_of(line); });
    for (VitalLine& line : lines) {
      last_ns_ = std::max(last_ns_, media::time_ns_of(line));
      media::set_time_ns(line, last_ns_);
    }
    if (watch_) watch_->heard(reader_->patient(), last_ns_);
    return true;
  }

  std::unique_ptr<SignalReader> reader_;
  std::shared_ptr<PatientWatch> watch_;
  std::int64_t last_ns_ = 0;
};

}  // namespace

std::unique_ptr<VitalSource> open_signal_source(const SourceAddress& address) {
  address.require_options("speed,zone");
  const std::filesystem::path path = address.location;
  const auto zone = parse_assumed_zone(address.option("zone", "local"), address.stated);
  std::unique_ptr<SignalReader> reader;
  if (path.extension() == ".edf") {
    reader = std::make_unique<EdfReader>(crypto::open_file_source(path), path.filename().string(), zone);
  } else if (path.extension() == ".hea") {
    // The signals stand in other files of the same folder; the header cannot name one elsewhere.
    reader = std::make_unique<WfdbReader>(*crypto::open_file_source(path), path.filename().string(), zone,
                                          [folder = path.parent_path()](const std::string& name) {
                                            return crypto::open_file_source(folder / name);
                                          });
  } else {
    reader = std::make_unique<VitalFileReader>(*crypto::open_file_source(path), path.filename().string());
  }
  return std::make_unique<SignalSource>(std::move(reader));
}

Scaling::Scaling(double gain, double zero) : gain_(gain), zero_(zero) {
  const double digits = 3 - std::floor(std::log10(std::abs(gain)));
  // Beyond what a double can tell apart there is nothing to round.
  precision_ = std::isfinite(digits) && digits < 300 && digits > -300 ? std::pow(10, digits) : 0;
}

double Scaling::operator()(double number) const {
  const double value = gain_ * (number - zero_);
  const double rounded = std::round(value * precision_) / precision_;
  return std::isfinite(rounded) ? rounded : value;
}

VitalSample wave_sample(std::int64_t end_ns, double rate_hz, std::vector<double> values) {
  VitalSample sample;
  sample.time_ns = end_ns;
  for (double& value : values) {
    if (!std::isfinite(value)) {
      value = std::numeric_limits<double>::quiet_NaN();
    }
  }
  const bool none = std::ranges::all_of(values, [](double value) { return std::isnan(value); });
  if (none) {
    sample.quality = media::VitalQuality::kMissing;
  } else if (values.size() == 1 && rate_hz * 60 < 1) {
    sample.value = values.front();
  } else {
    sample.rate_hz = rate_hz;
    sample.values = std::move(values);
  }
  return sample;
}

}  // namespace kiroku::recorder
