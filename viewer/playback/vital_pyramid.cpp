#include "viewer/playback/vital_pyramid.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "viewer/playback/saved_values.h"

namespace kiroku::playback {
namespace {

/// The whole multiple of `width_ns` at or before the time.
std::int64_t bin_start(std::int64_t time_ns, std::int64_t width_ns) {
  const std::int64_t rest = time_ns % width_ns;
  return time_ns - (rest < 0 ? rest + width_ns : rest);
}

}  // namespace

std::int64_t VitalPyramid::width_for(std::int64_t span_ns, std::size_t bins) {
  const auto wanted = span_ns / static_cast<std::int64_t>(std::clamp<std::size_t>(bins, 1, INT32_MAX));
  std::int64_t width = kFinestNs;
  while (width < wanted && width <= INT64_MAX / 4) width *= 2;
  return width;
}

VitalPyramid::Series* VitalPyramid::series_of(const media::VitalSample& sample) {
  const auto [found, added] =
      by_name_.try_emplace({sample.source, sample.code, sample.unit, sample.is_waveform()}, series_.size());
  if (added) {
    if (series_.size() == kMostSeries) {
      by_name_.erase(found);
      return nullptr;
    }
    Series& series = series_.emplace_back();
    series.described.code = sample.code;
    series.described.unit = sample.unit;
    series.described.source = sample.source;
    series.described.is_wave = sample.is_waveform();
  }
  return &series_[found->second];
}

void VitalPyramid::merge(std::vector<Kept>& level, std::int64_t width_ns, const Kept& more) {
  const std::int64_t start = bin_start(more.last_ns, width_ns);
  auto at = level.end();
  // Nearly always the last one, or one behind it.
  while (at != level.begin() && bin_start(std::prev(at)->last_ns, width_ns) > start) --at;
  if (at == level.begin() || bin_start(std::prev(at)->last_ns, width_ns) < start) {
    level.insert(at, more);
    return;
  }
  Kept& kept = *std::prev(at);
  kept.min = std::min(kept.min, more.min);
  kept.max = std::max(kept.max, more.max);
  kept.questionable = std::max(kept.questionable, more.questionable);
  if (more.last_ns >= kept.last_ns) {
    kept.last_ns = more.last_ns;
    kept.last = more.last;
  }
}

void VitalPyramid::add(const media::VitalSample& sample, std::int64_t from_ns, std::int64_t to_ns) {
  if (!sample.is_waveform() && !sample.value) return;
  // A number that its device calls invalid is none.
  if (sample.quality == media::VitalQuality::kInvalid) return;
  const std::uint64_t questionable = sample.quality == media::VitalQuality::kQuestionable ? 1 : 0;
  Series* const series = series_of(sample);
  if (series == nullptr) return;
  // Neighbours of one bin are put together before they go into the levels.
  std::optional<Kept> run;
  std::int64_t run_start = 0;
  const auto flush = [&] {
    if (!run) return;
    std::int64_t width = finest_ns_;
    for (std::vector<Kept>& level : series->levels) {
      merge(level, width, *run);
      width *= kFactor;
    }
    run.reset();
  };
  const auto take = [&](std::int64_t time_ns, double value) {
    if (series->distances.size() < kJudgedDistances && series->newest_ns != INT64_MIN &&
        time_ns > series->newest_ns) {
      series->distances.push_back(time_ns - series->newest_ns);
    }
    series->newest_ns = std::max(series->newest_ns, time_ns);
    if (time_ns < from_ns || time_ns >= to_ns) return;
    if (run && (time_ns < run->last_ns || time_ns - run_start >= finest_ns_)) flush();
    if (!run) {
      run_start = bin_start(time_ns, finest_ns_);
      run = Kept{time_ns, value, value, value, questionable};
      return;
    }
    run->last_ns = time_ns;
    run->last = value;
    run->min = std::min(run->min, value);
    run->max = std::max(run->max, value);
  };
  if (!sample.is_waveform()) {
    take(sample.time_ns, *sample.value);
  } else {
    longest_block_ns_ = std::max(longest_block_ns_, sample.time_ns - media::waveform_time_ns(sample, 0));
    for (std::size_t i = 0; i < sample.values.size(); ++i) {
      if (!std::isnan(sample.values[i])) take(media::waveform_time_ns(sample, i), sample.values[i]);
    }
  }
  flush();
}

std::vector<VitalSeries> VitalPyramid::view(std::int64_t from_ns, std::int64_t to_ns,
                                            std::int64_t width_ns) const {
  std::size_t level = 0;
  std::int64_t level_width = finest_ns_;
  while (level + 1 < kLevels && level_width * kFactor <= width_ns) {
    ++level;
    level_width *= kFactor;
  }
  std::vector<VitalSeries> views;
  for (const Series& series : series_) {
    VitalSeries& view = views.emplace_back(series.described);
    if (!series.distances.empty()) {
      std::vector<std::int64_t> distances = series.distances;
      std::sort(distances.begin(), distances.end());
      view.every_ns = distances[distances.size() / 2];
    }
    const std::vector<Kept>& bins = series.levels[level];
    const std::int64_t first_start = bin_start(from_ns, width_ns);
    auto bin = std::partition_point(bins.begin(), bins.end(),
                                    [&](const Kept& kept) { return kept.last_ns < first_start; });
    for (; bin != bins.end(); ++bin) {
      const std::int64_t start = bin_start(bin->last_ns, width_ns);
      if (start >= to_ns) break;
      if (view.bins.empty() || view.bins.back().start_ns != start) {
        view.bins.push_back(
            {start, start + width_ns, bin->min, bin->max, bin->last, bin->last_ns, bin->questionable != 0});
        continue;
      }
      VitalBin& wide = view.bins.back();
      wide.min = std::min(wide.min, bin->min);
      wide.max = std::max(wide.max, bin->max);
      wide.is_questionable = wide.is_questionable || bin->questionable != 0;
      wide.last = bin->last;
      wide.last_ns = bin->last_ns;
    }
  }
  return views;
}

std::vector<VitalSeries> VitalPyramid::before(std::int64_t time_ns) const {
  std::vector<VitalSeries> found;
  for (const Series& series : series_) {
    const std::vector<Kept>& bins = series.levels.front();
    const auto after = std::partition_point(bins.begin(), bins.end(),
                                            [&](const Kept& kept) { return kept.last_ns <= time_ns; });
    if (after == bins.begin()) continue;
    const Kept& kept = *std::prev(after);
    const std::int64_t start = bin_start(kept.last_ns, finest_ns_);
    found.push_back(series.described);
    found.back().bins = {
        {start, start + finest_ns_, kept.min, kept.max, kept.last, kept.last_ns, kept.questionable != 0}};
  }
  return found;
}

Bytes VitalPyramid::save() const {
  Saver saver;
  saver.number(finest_ns_);
  saver.number(longest_block_ns_);
  saver.number(series_.size());
  for (const Series& series : series_) {
    saver.text(series.described.source);
    saver.text(series.described.code);
    saver.text(series.described.unit);
    saver.number(series.described.is_wave);
    saver.number(series.newest_ns);
    saver.list(series.distances);
    for (const std::vector<Kept>& level : series.levels) saver.list(level);
  }
  return saver.take();
}

std::optional<VitalPyramid> VitalPyramid::restore(ByteView saved) {
  Restorer restorer(saved);
  VitalPyramid pyramid(restorer.number<std::int64_t>());
  pyramid.longest_block_ns_ = restorer.number<std::int64_t>();
  const auto count = restorer.number<std::size_t>();
  if (!restorer.fits() || count > kMostSeries || pyramid.finest_ns_ < kFinestNs) return std::nullopt;
  for (std::size_t i = 0; i < count; ++i) {
    Series& series = pyramid.series_.emplace_back();
    series.described.source = restorer.text();
    series.described.code = restorer.text();
    series.described.unit = restorer.text();
    series.described.is_wave = restorer.number<bool>();
    series.newest_ns = restorer.number<std::int64_t>();
    series.distances = restorer.list<std::int64_t>();
    for (std::vector<Kept>& level : series.levels) level = restorer.list<Kept>();
    pyramid.by_name_.try_emplace(
        {series.described.source, series.described.code, series.described.unit, series.described.is_wave}, i);
  }
  return restorer.whole() ? std::optional(std::move(pyramid)) : std::nullopt;
}

}  // namespace kiroku::playback
