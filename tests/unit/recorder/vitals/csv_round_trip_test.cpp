// The table that an export writes is one that the recorder reads.
#include <cmath>
#include <fstream>
#include <limits>
#include <map>

#include <gtest/gtest.h>

#include "base/error.h"
#include "media/vitals_table.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/vital_source.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

struct Point {
  std::int64_t time_ns = 0;
  std::optional<double> value;
  std::string unit;
  media::VitalQuality quality = media::VitalQuality::kGood;
  bool operator==(const Point&) const = default;
};

/// Samples by code, waveforms value by value.
std::map<std::string, std::vector<Point>> points_of(const std::vector<VitalSample>& samples) {
  std::map<std::string, std::vector<Point>> points;
  for (const VitalSample& sample : samples) {
    auto& of_code = points[sample.code];
    if (!sample.is_waveform()) {
      of_code.push_back({sample.time_ns, sample.value, sample.unit, sample.quality});
    }
    for (std::size_t i = 0; i < sample.values.size(); ++i) {
      const double value = sample.values[i];
      Point point{waveform_time_ns(sample, i), value, sample.unit, sample.quality};
      if (std::isnan(value)) {
        point.value.reset();
        point.quality = media::VitalQuality::kMissing;
      }
      of_code.push_back(point);
    }
  }
  return points;
}

std::vector<VitalSample> through_a_table(const std::vector<VitalSample>& samples) {
  const test::TemporaryFolder folder;
  const std::string path = (folder / "vitals.csv").string();
  {
    std::ofstream file(path, std::ios::binary);
    media::VitalsTable table([&](ByteView bytes) { file << text_of(bytes); }, 0);
    for (const VitalSample& sample : samples) {
      table.add(sample);
    }
    table.finish();
  }
  const CaseClock clock;
  const auto source = open_vital_source(parse_source_address(path), clock);
  std::vector<VitalSample> read;
  while (auto line = source->next()) {
    read.push_back(std::get<VitalSample>(std::move(*line)));
  }
  return read;
}

TEST(CsvRoundTrip, KeepsAPatientsEveryPoint) {
  const CaseClock clock;
  const auto patient = open_vital_source(parse_source_address("synthetic:patient?seed=9&flash=7"), clock);
  std::vector<VitalSample> samples;
  while (samples.size() < 2000) {
    samples.push_back(std::get<VitalSample>(*patient->next()));
  }
  EXPECT_EQ(points_of(through_a_table(samples)), points_of(samples));
}

TEST(CsvRoundTrip, KeepsMissingValuesQualitiesAndAwkwardNames) {
  std::vector<VitalSample> samples(4);
  samples[0].code = "a, \"b\" c";
  samples[0].unit = "10*9/L";
  samples[0].quality = media::VitalQuality::kMissing;
  samples[1].code = "HR";
  samples[1].time_ns = 1;
  samples[1].value = -1.5e-300;
  samples[1].quality = media::VitalQuality::kInvalid;
  samples[2] = samples[1];
  samples[2].time_ns = 9'000'000'000'000'001;
  samples[2].quality = media::VitalQuality::kQuestionable;
  samples[3] = samples[2];
  samples[3].code = "wave";
  samples[3].value.reset();
  samples[3].rate_hz = 2;
  samples[3].values = {7, std::numeric_limits<double>::quiet_NaN()};
  EXPECT_EQ(points_of(through_a_table(samples)), points_of(samples));
}

TEST(CsvRoundTrip, ShowsALineBreakOfANameAsASpace) {
  std::vector<VitalSample> samples(1);
  samples[0].code = "a\nb";
  samples[0].value = 1;
  std::vector<VitalSample> shown = samples;
  shown[0].code = "a b";
  EXPECT_EQ(points_of(through_a_table(samples)), points_of(shown));
}

TEST(CsvRoundTrip, RefusesSamplesOutOfOrder) {
  media::VitalsTable table([](ByteView) {}, 0);
  VitalSample sample;
  sample.code = "HR";
  sample.value = 1;
  sample.time_ns = 5;
  table.add(sample);
  sample.time_ns = 4;
  EXPECT_THROW(table.add(sample), Error);
}

}  // namespace
}  // namespace kiroku::recorder
