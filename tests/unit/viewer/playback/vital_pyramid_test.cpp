#include "viewer/playback/vital_pyramid.h"

#include <cmath>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::playback {
namespace {

using media::VitalSample;
using testing::IsEmpty;
using testing::SizeIs;

VitalSample number(std::int64_t time_ns, double value, const std::string& code = "HR") {
  VitalSample sample;
  sample.time_ns = time_ns;
  sample.code = code;
  sample.value = value;
  return sample;
}

VitalSample wave(std::int64_t time_ns, double rate_hz, std::vector<double> values) {
  VitalSample sample;
  sample.time_ns = time_ns;
  sample.code = "ECG";
  sample.rate_hz = rate_hz;
  sample.values = std::move(values);
  return sample;
}

/// One wave of 250 Hz in blocks of 0.9 s and one number each second for ten minutes, with two minutes
/// missing and now and then no value.
std::vector<VitalSample> ten_minutes() {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-5, 5);
  std::vector<VitalSample> samples;
  for (int block = 1; block <= 666; ++block) {
    const std::int64_t end_ns = block * std::int64_t{900'000'000};
    if (end_ns > 200'000'000'000 && end_ns < 320'000'000'000) continue;
    std::vector<double> values(225);
    for (double& value : values) {
      value = random() % 50 == 0 ? std::numeric_limits<double>::quiet_NaN() : uniform(random);
    }
    values[0] = uniform(random);
    samples.push_back(wave(end_ns + static_cast<std::int64_t>(random() % 3'000'000), 250, values));
    samples.push_back(number(end_ns + 7, uniform(random)));
  }
  return samples;
}

/// What the values come to one by one.
std::vector<VitalBin> brute_force(const std::vector<VitalSample>& samples, const std::string& code,
                                  std::int64_t from_ns, std::int64_t to_ns, std::int64_t width_ns) {
  const auto floor = [&](std::int64_t time_ns) {
    return static_cast<std::int64_t>(
               std::floor(static_cast<double>(time_ns) / static_cast<double>(width_ns))) *
           width_ns;
  };
  std::map<std::int64_t, VitalBin> bins;
  const auto take = [&](std::int64_t time_ns, double value) {
    const std::int64_t start = floor(time_ns);
    if (start + width_ns <= floor(from_ns) || start < floor(from_ns) || start >= to_ns) return;
    const auto [at, added] =
        bins.try_emplace(start, VitalBin{start, start + width_ns, value, value, value, time_ns});
    if (added) return;
    at->second.min = std::min(at->second.min, value);
    at->second.max = std::max(at->second.max, value);
    if (time_ns >= at->second.last_ns) {
      at->second.last_ns = time_ns;
      at->second.last = value;
    }
  };
  for (const VitalSample& sample : samples) {
    if (sample.code != code) continue;
    if (!sample.is_waveform()) take(sample.time_ns, *sample.value);
    for (std::size_t i = 0; i < sample.values.size(); ++i) {
      if (!std::isnan(sample.values[i])) take(media::waveform_time_ns(sample, i), sample.values[i]);
    }
  }
  std::vector<VitalBin> found;
  for (const auto& [start, bin] : bins) found.push_back(bin);
  return found;
}

TEST(VitalPyramid, IsWhatTheValuesComeToAtEveryWidth) {
  const std::vector<VitalSample> samples = ten_minutes();
  VitalPyramid pyramid;
  for (const VitalSample& sample : samples) pyramid.add(sample);
  struct Question {
    std::int64_t from_ns, to_ns;
    std::size_t bins;
  };
  for (const Question& asked :
       {Question{0, 600'000'000'000, 1000}, Question{0, 600'000'000'000, 100},
        Question{0, 600'000'000'000, 7}, Question{0, 600'000'000'000, 1},
        Question{123'456'789'012, 345'678'901'234, 300}, Question{-5'000'000'000, 1'000'000'000, 4}}) {
    const std::int64_t width = VitalPyramid::width_for(asked.to_ns - asked.from_ns, asked.bins);
    ASSERT_GE(width, VitalPyramid::kBaseNs);
    const std::vector<VitalSeries> series = pyramid.view(asked.from_ns, asked.to_ns, width);
    ASSERT_THAT(series, SizeIs(2));
    for (const VitalSeries& one : series) {
      EXPECT_EQ(one.bins, brute_force(samples, one.code, asked.from_ns, asked.to_ns, width)) << one.code;
      EXPECT_LE(one.bins.size(), asked.bins + 2);
    }
  }
}

TEST(VitalPyramid, OfShortStretchesItShowsEachValue) {
  VitalPyramid pyramid(VitalPyramid::kFinestNs);
  pyramid.add(wave(1'000'000'000, 500, {1, 2, 3, 4}), 994'000'000, 998'000'000);
  const auto series = pyramid.view(990'000'000, 1'000'000'000, VitalPyramid::kFinestNs);
  ASSERT_THAT(series, SizeIs(1));
  ASSERT_THAT(series[0].bins, SizeIs(2)) << "the others lie outside";
  EXPECT_EQ(series[0].bins[0].last_ns, 994'000'000);
  EXPECT_EQ(series[0].bins[0].min, 2);
  EXPECT_EQ(series[0].bins[1].last, 3);
  EXPECT_EQ(series[0].every_ns, 2'000'000);
  EXPECT_EQ(pyramid.longest_block_ns(), 8'000'000);
}

TEST(VitalPyramid, WhatWasMissingIsNoValue) {
  VitalPyramid pyramid;
  VitalSample missing = number(1, 0);
  missing.value.reset();
  missing.quality = media::VitalQuality::kMissing;
  pyramid.add(missing);
  EXPECT_THAT(pyramid.view(0, 10, VitalPyramid::kBaseNs), IsEmpty());
}

TEST(VitalPyramid, SaysWhatIsQuestionableAndShowsNothingInvalid) {
  VitalPyramid pyramid;
  const auto add = [&](std::int64_t second, double value, media::VitalQuality quality) {
    VitalSample sample = number(second * 1'000'000'000, value);
    sample.quality = quality;
    pyramid.add(sample);
  };
  add(0, 70, media::VitalQuality::kGood);
  add(1, 18, media::VitalQuality::kQuestionable);
  add(2, 300, media::VitalQuality::kInvalid);
  add(3, 71, media::VitalQuality::kGood);
  for (const auto& known : {pyramid, VitalPyramid::restore(pyramid.save()).value()}) {
    const auto fine = known.view(0, 4'000'000'000, VitalPyramid::kBaseNs).at(0).bins;
    ASSERT_THAT(fine, SizeIs(3));
    EXPECT_FALSE(fine[0].is_questionable);
    EXPECT_TRUE(fine[1].is_questionable);
    EXPECT_FALSE(fine[2].is_questionable);
    const auto wide = known.view(0, 4'000'000'000, 16 * VitalPyramid::kBaseNs).at(0).bins;
    ASSERT_THAT(wide, SizeIs(1));
    EXPECT_TRUE(wide[0].is_questionable) << "some of it is";
    EXPECT_EQ(wide[0].max, 71);
    EXPECT_TRUE(known.before(2'500'000'000).at(0).bins.at(0).is_questionable);
  }
  VitalSample invalid = wave(9'000'000'000, 100, {1, 2});
  invalid.quality = media::VitalQuality::kInvalid;
  pyramid.add(invalid);
  EXPECT_THAT(pyramid.view(0, 10'000'000'000, VitalPyramid::kBaseNs), SizeIs(1));
}

TEST(VitalPyramid, KnowsTheNewestValueBeforeATime) {
  VitalPyramid pyramid;
  pyramid.add(number(1'000'000'000, 60));
  pyramid.add(number(2'000'000'000, 61));
  pyramid.add(number(9'000'000'000, 37, "T"));
  const auto values = pyramid.before(5'000'000'000);
  ASSERT_THAT(values, SizeIs(1));
  EXPECT_EQ(values[0].bins.at(0).last, 61);
  EXPECT_EQ(values[0].bins.at(0).last_ns, 2'000'000'000);
  EXPECT_THAT(pyramid.before(0), IsEmpty());
}

TEST(VitalPyramid, ComesBackFromWhatWasSaved) {
  VitalPyramid pyramid;
  for (const VitalSample& sample : ten_minutes()) pyramid.add(sample);
  const Bytes saved = pyramid.save();
  const auto restored = VitalPyramid::restore(saved);
  ASSERT_TRUE(restored);
  const std::int64_t width = VitalPyramid::width_for(600'000'000'000, 500);
  const auto before = pyramid.view(0, 600'000'000'000, width);
  const auto after = restored->view(0, 600'000'000'000, width);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(after[i].bins, before[i].bins);
    EXPECT_EQ(after[i].code, before[i].code);
    EXPECT_EQ(after[i].every_ns, before[i].every_ns);
  }
  for (const std::size_t length : {std::size_t{0}, std::size_t{8}, saved.size() / 2, saved.size() - 1}) {
    EXPECT_FALSE(VitalPyramid::restore(ByteView(saved).first(length))) << length;
  }
}

TEST(VitalPyramid, HoldsNoMoreQuantitiesThanATheatreHas) {
  VitalPyramid pyramid;
  for (std::size_t i = 0; i < VitalPyramid::kMostSeries + 9; ++i)
    pyramid.add(number(1, 1, std::to_string(i)));
  EXPECT_THAT(pyramid.view(0, 10, VitalPyramid::kBaseNs), SizeIs(VitalPyramid::kMostSeries));
}

}  // namespace
}  // namespace kiroku::playback
