// How fast a recorded case is watched. Run by playback.sh, which makes the cases.
//   playback_bench pieces CASE STREAM IDENTITY    every piece in order, then pieces at random, made and
//   cached playback_bench first CASE STREAM IDENTITY     from nothing to the first piece of the case's middle
//   playback_bench vitals                         eight waveforms of 500 Hz and a number over ten hours
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "archive/storage/file_system.h"
#include "archive/writing/case_writer.h"
#include "crypto/age_recipient.h"
#include "crypto/signing_key.h"
#include "media/vital_line.h"
#include "tests/support/temporary_folder.h"
#include "viewer/playback/case_playback.h"

namespace {

namespace fs = std::filesystem;
using namespace kiroku;
using namespace kiroku::playback;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

crypto::AgeIdentities identities_of(const char* file) {
  return crypto::load_identity_file(file, [](const std::string&) -> crypto::Secret {
    throw std::runtime_error("the identity has a passphrase");
  });
}

std::shared_ptr<EncryptedCache> make_cache(const test::TemporaryFolder& folder, const std::string& name) {
  return std::make_shared<EncryptedCache>(folder / name, std::uint64_t{4} << 30);
}

/// Of all threads of this program: tells the same while others use the machine.
double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The value that a share of the others do not exceed, in milliseconds.
double quantile_ms(std::vector<double> seconds, double share) {
  std::sort(seconds.begin(), seconds.end());
  return 1e3 * seconds[static_cast<std::size_t>(share * static_cast<double>(seconds.size() - 1))];
}

void measure_pieces(const fs::path& folder, const std::string& stream, const char* identity) {
  const test::TemporaryFolder scratch;
  const auto recording = archive::CaseReader::open(folder);
  const auto pieces = static_cast<std::uint64_t>((recording.duration_ns() + kPieceNs - 1) / kPieceNs);
  {
    CasePlayback playback(recording, identities_of(identity), make_cache(scratch, "in-order"));
    (void)playback.init_segment(stream);
    const auto start = Clock::now();
    const double used_before = processor_seconds();
    std::uint64_t bytes = 0;
    for (std::uint64_t number = 0; number < pieces; ++number) bytes += playback.piece(stream, number).size();
    const double taken = seconds_since(start);
    const double used = processor_seconds() - used_before;
    const double recorded = static_cast<double>(recording.duration_ns()) / 1e9;
    std::printf(
        "all %llu pieces in order: %.1f s recorded in %.2f s (%.2f times real time) and %.2f s of processors "
        "(%.2f times), %.1f Mbit/s\n",
        static_cast<unsigned long long>(pieces), recorded, taken, recorded / taken, used, recorded / used,
        static_cast<double>(bytes) * 8e-6 / recorded);
  }
  CasePlayback playback(recording, identities_of(identity), make_cache(scratch, "sought"));
  (void)playback.init_segment(stream);
  std::vector<std::uint64_t> order(pieces);
  for (std::uint64_t i = 0; i < pieces; ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  for (const char* state : {"not cached", "cached"}) {
    std::vector<double> seconds, thumbnails;
    for (const std::uint64_t number : order) {
      const auto start = Clock::now();
      (void)playback.piece(stream, number);
      seconds.push_back(seconds_since(start));
      // A person looks for a moment; what is made ahead meanwhile is part of the system.
      if (std::strcmp(state, "not cached") == 0) std::this_thread::sleep_for(std::chrono::seconds(1));
    }
    std::printf("seek, %s: median %.0f ms, 95 %% %.0f ms, worst %.0f ms (%zu seeks)\n", state,
                quantile_ms(seconds, 0.5), quantile_ms(seconds, 0.95), quantile_ms(seconds, 1),
                seconds.size());
  }
  std::vector<double> thumbnails, steps;
  for (const std::uint64_t number : order) {
    const auto start = Clock::now();
    (void)playback.thumbnail(stream, number);
    thumbnails.push_back(seconds_since(start));
  }
  std::int64_t at_ns = 0;
  for (int i = 0; i < 60; ++i) {
    const auto start = Clock::now();
    if (const auto picture = playback.archived_picture(stream, at_ns, Step::kAfter)) at_ns = picture->time_ns;
    steps.push_back(seconds_since(start));
  }
  std::printf(
      "thumbnail: median %.1f ms, 95 %% %.1f ms; step to the next archived picture: median %.1f ms, 95 %% "
      "%.1f ms\n",
      quantile_ms(thumbnails, 0.5), quantile_ms(thumbnails, 0.95), quantile_ms(steps, 0.5),
      quantile_ms(steps, 0.95));
}

void measure_first(const fs::path& folder, const std::string& stream, const char* identity) {
  const test::TemporaryFolder scratch;
  const auto start = Clock::now();
  const double used_before = processor_seconds();
  CasePlayback playback(archive::CaseReader::open(folder), identities_of(identity),
                        make_cache(scratch, "cache"));
  const double opened = seconds_since(start);
  const auto middle = static_cast<std::uint64_t>(playback.recording().duration_ns() / kPieceNs / 2);
  const std::size_t bytes =
      playback.init_segment(stream).bytes.size() + playback.piece(stream, middle).size();
  const double first = seconds_since(start);
  const double used = processor_seconds() - used_before;
  const auto lined = Clock::now();
  const Timeline timeline = timeline_of(playback.recording());
  std::printf(
      "%.1f hours, %zu segments: opened %.0f ms, first piece after %.0f ms (%.0f ms of processors, %zu "
      "bytes), "
      "time line %.0f ms\n",
      static_cast<double>(playback.recording().duration_ns()) / 3.6e12, timeline.segments.size(),
      1e3 * opened, 1e3 * first, 1e3 * used, bytes, 1e3 * seconds_since(lined));
}

/// Ten hours of a monitor, in segments of 0.9 s, on memory: what is measured is reading.
fs::path record_vitals(const fs::path& archive, const crypto::AgeRecipients& recipients) {
  constexpr int kWaves = 8, kRate = 500, kBlock = 450;
  constexpr std::int64_t kSegmentNs = 900'000'000, kSegments = 40'000;
  fs::create_directories(archive);
  const auto key = crypto::SigningKey::generate();
  archive::CaseWriter::Options options;
  options.archive = archive;
  options.key = &key;
  options.device_name = "bench";
  options.boot_id = "b1";
  archive::StreamInfo info;
  info.name = info.kind = info.purpose = "vitals";
  info.media = "application/jsonl";
  info.profile = "jsonl";
  info.source = "bench";
  info.recipients = {recipients.at(0)->to_string()};
  options.streams = {info};
  options.stream_recipients = {recipients};
  options.subject_recipients = recipients;
  const UtcTime opened = *parse_utc("2026-08-05T09:15:02Z");
  const auto writer = archive::CaseWriter::create(archive::real_file_system(), options, {opened, 0});
  for (std::int64_t index = 0; index < kSegments; ++index) {
    const std::int64_t end_ns = (index + 1) * kSegmentNs;
    std::string lines;
    for (int wave = 0; wave < kWaves; ++wave) {
      media::VitalSample sample;
      sample.time_ns = end_ns - 1;
      sample.code = "KIROKU_WAVE_" + std::to_string(wave);
      sample.rate_hz = kRate;
      sample.unit = "mV";
      for (int i = 0; i < kBlock; ++i) {
        const double at_s = static_cast<double>(index * kBlock + i) / kRate;
        sample.values.push_back(std::round(1000 * std::sin(at_s * (1 + wave)) + 20 * std::sin(97 * at_s)) /
                                1000);
      }
      lines += to_json_line(sample) + "\n";
    }
    media::VitalSample heart_rate;
    heart_rate.time_ns = end_ns - 1;
    heart_rate.code = "MDC_ECG_HEART_RATE";
    heart_rate.value = 60 + static_cast<double>(index % 40);
    heart_rate.unit = "/min";
    lines += to_json_line(heart_rate) + "\n";
    const auto segment = writer->begin_segment(0, static_cast<std::uint64_t>(index));
    segment->write(bytes_of(lines));
    segment->seal();
    archive::SegmentEntry entry;
    entry.stream = "vitals";
    entry.index = static_cast<std::uint64_t>(index);
    entry.file = segment->commit();
    entry.span = {index * kSegmentNs, end_ns};
    entry.time_base = "1/1000000000";
    entry.first_pts = entry.span.start_ns;
    entry.frames = kWaves + 1;
    entry.counts_samples = true;
    writer->append({entry}, {opened + std::chrono::microseconds(end_ns / 1000), end_ns});
  }
  return writer->folder();
}

void measure_vitals() {
  const test::TemporaryFolder scratch(test::quick_parent());
  const crypto::AgeKeyPair pair = crypto::generate_age_key();
  auto start = Clock::now();
  const fs::path folder = record_vitals(scratch / "archive", {crypto::parse_recipient(pair.recipient)});
  std::printf("recorded in %.0f s\n", seconds_since(start));
  const auto cache = make_cache(scratch, "cache");
  const crypto::AgeIdentities identities{crypto::parse_identity(pair.identity_text.text())};
  constexpr std::int64_t kTenHoursNs = 36'000'000'000'000;
  const auto ask = [&](CasePlayback& playback, std::int64_t from_ns, std::int64_t to_ns, const char* what) {
    std::vector<double> seconds;
    std::size_t bins = 0;
    const double used_before = processor_seconds();
    for (int i = 0; i < 20; ++i) {
      const auto begun = Clock::now();
      const VitalsView view = playback.vitals("vitals").view(from_ns, to_ns, 1000, 1'000'000);
      seconds.push_back(seconds_since(begun));
      bins = 0;
      for (const VitalSeries& series : view.series) bins += series.bins.size();
    }
    std::printf("%s at 1000 bins: median %.1f ms, worst %.1f ms, %.1f ms of processors (%zu bins)\n", what,
                quantile_ms(seconds, 0.5), quantile_ms(seconds, 1),
                1e3 * (processor_seconds() - used_before) / static_cast<double>(seconds.size()), bins);
  };
  {
    CasePlayback playback(archive::CaseReader::open(folder), identities, cache);
    start = Clock::now();
    const double used_before = processor_seconds();
    (void)playback.vitals("vitals").view(0, kTenHoursNs, 1000, 1'000'000);
    std::printf("pyramid of 144 million values built in %.1f s (%.1f s of processors)\n",
                seconds_since(start), processor_seconds() - used_before);
    ask(playback, 0, kTenHoursNs, "ten hours");
    ask(playback, kTenHoursNs / 2, kTenHoursNs / 2 + 600'000'000'000, "ten minutes");
    ask(playback, kTenHoursNs / 2, kTenHoursNs / 2 + 60'000'000'000, "one minute");
    ask(playback, kTenHoursNs / 2, kTenHoursNs / 2 + 2'000'000'000, "two seconds");
  }
  CasePlayback again(archive::CaseReader::open(folder), identities, cache);
  start = Clock::now();
  (void)again.vitals("vitals").view(0, kTenHoursNs, 1000, 1'000'000);
  std::printf("again, from the cache (%llu MiB): %.0f ms\n",
              static_cast<unsigned long long>(cache->bytes() >> 20), 1e3 * seconds_since(start));
}

}  // namespace

int main(int count, char** words) {
  const std::string what = count > 1 ? words[1] : "";
  try {
    if (what == "pieces" && count == 5) {
      measure_pieces(words[2], words[3], words[4]);
    } else if (what == "first" && count == 5) {
      measure_first(words[2], words[3], words[4]);
    } else if (what == "vitals" && count == 2) {
      measure_vitals();
    } else {
      std::fprintf(stderr, "usage: playback_bench pieces|first CASE STREAM IDENTITY | vitals\n");
      return 2;
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "playback_bench: %s\n", error.what());
    return 1;
  }
  return 0;
}
