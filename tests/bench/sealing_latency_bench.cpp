// What sealing adds to a picture's way to the disk, beside writing it in the clear. Run by
// sealing_latency.sh.
//   sealing_latency_bench FOLDER PROFILE SIZE SECONDS    prints ID=VALUE of each figure, for record.py
//
// Pictures are coded and muxed once, as the recorder does it. Then each segment of two seconds is written
// twice into FOLDER at the pace of its pictures, 30 a second: in the clear, and as the recorder seals it
// (archive/writing/segment_writer.h), which goes first by turns. Both are flushed each quarter of a second
// and at the segment's end, as recorder/stream_output.cpp does. So frames, encoder, file system and order are
// the same, and nothing else is written meanwhile.
//
// Of each picture: how long its write took; from when it was muxed until its last byte was in the kernel
// (ciphertext leaves in chunks of 64 KiB, so the end of a picture waits for the next ones); until it was on
// the disk.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "archive/format/age_layout.h"
#include "archive/storage/file_system.h"
#include "archive/writing/segment_writer.h"
#include "crypto/age_recipient.h"
#include "recorder/clock/case_clock.h"
#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/video_encoder.h"
#include "recorder/source/source.h"

namespace {

namespace fs = std::filesystem;
using namespace kiroku;
using namespace kiroku::recorder;
using Time = std::chrono::steady_clock;
using std::chrono::nanoseconds;

constexpr int kRate = 30, kPicturesOfASegment = 2 * kRate;
constexpr std::chrono::milliseconds kSyncInterval{250};

using Picture = std::vector<Bytes>;  // what the muxer wrote for it, write by write
using Segment = std::vector<Picture>;

/// How long pictures took, in microseconds.
struct Taken {
  std::vector<double> writing, in_kernel, on_disk;
};

double microseconds(Time::duration time) { return std::chrono::duration<double, std::micro>(time).count(); }

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values.at(static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

std::vector<Segment> coded(const std::string& size, Profile profile, int seconds) {
  const CaseClock clock;
  const auto source = open_source(parse_source_address("synthetic:endoscope?size=" + size +
                                                       "&rate=" + std::to_string(kRate) + "&speed=max"),
                                  clock, {});
  VideoProfile video;
  video.profile = profile;
  VideoEncoder encoder(source->format(), source->frame_rate(), video);
  const auto muxer = video.in_transport_stream() ? make_transport_stream_muxer() : make_matroska_muxer();
  std::vector<Segment> segments;
  for (int i = 0; i < seconds * kRate; ++i) {
    const bool first = i % kPicturesOfASegment == 0;
    std::optional<TimedFrame> frame = source->read();
    media::Packet packet = encoder.encode(encoder.prepare(std::move(frame->frame), frame->time_ns), first);
    if (first) {
      if (i > 0) muxer->end();
      segments.emplace_back().emplace_back();
      muxer->begin({encoder.muxed_stream()},
                   [&segments](ByteView bytes) { segments.back().back().push_back(to_bytes(bytes)); });
    } else {
      segments.back().emplace_back();
    }
    muxer->write(std::move(packet), 0);
  }
  muxer->end();
  return segments;
}

/// One segment's file, in one way or the other. Used by one thread but for sync().
class Output {
 public:
  virtual ~Output() = default;
  virtual void write(ByteView bytes) = 0;
  /// Of what was written, so much is in the kernel.
  [[nodiscard]] virtual std::uint64_t in_kernel() const = 0;
  virtual void sync() = 0;
  virtual void commit() = 0;
};

class InTheClear : public Output {
 public:
  explicit InTheClear(fs::path file)
      : path_(std::move(file)), file_(archive::real_file_system().create(path_ += ".part")) {}
  void write(ByteView bytes) override {
    file_->write(bytes);
    written_ += bytes.size();
    if (written_ - behind_ < kWriteBehindBytes) return;
    behind_ = written_;
    file_->write_behind();
  }
  [[nodiscard]] std::uint64_t in_kernel() const override { return written_; }
  void sync() override { file_->sync(); }
  void commit() override {
    file_->sync_all();
    fs::path whole = path_;
    archive::real_file_system().rename(path_, whole.replace_extension());
    archive::real_file_system().sync_folder(path_.parent_path());
  }

 private:
  static constexpr std::uint64_t kWriteBehindBytes = 8U << 20U;  // as segment_writer.cpp
  fs::path path_;
  std::unique_ptr<archive::WritableFile> file_;
  std::uint64_t written_ = 0, behind_ = 0;
};

class Sealed : public Output {
 public:
  Sealed(const fs::path& file, const crypto::AgeRecipients& recipients)
      : writer_(archive::real_file_system(), file, file.filename().string(), recipients),
        header_(writer_.bytes()) {}
  void write(ByteView bytes) override { writer_.write(bytes); }
  [[nodiscard]] std::uint64_t in_kernel() const override {
    constexpr std::uint64_t kTag = 16;
    return (writer_.bytes() - header_) / (archive::kAgeChunkBytes + kTag) * archive::kAgeChunkBytes;
  }
  void sync() override { writer_.sync(); }
  void commit() override {
    writer_.seal();
    static_cast<void>(writer_.commit());
  }

 private:
  archive::SegmentWriter writer_;
  std::uint64_t header_;
};

/// Writes the segment at its pace, and flushes it meanwhile.
void write(const Segment& segment, Output& output, Taken& taken) {
  struct Waiting {
    std::uint64_t end;
    Time::time_point came;
  };
  std::mutex mutex;  // guards the next four
  std::deque<Waiting> for_kernel, for_disk;
  std::uint64_t in_kernel = 0;
  bool over = false;
  const auto mark = [](std::deque<Waiting>& waiting, std::uint64_t until, Time::time_point now,
                       std::vector<double>& into) {
    for (; !waiting.empty() && waiting.front().end <= until; waiting.pop_front())
      into.push_back(microseconds(now - waiting.front().came));
  };
  std::thread syncer([&] {
    for (Time::time_point next = Time::now() + kSyncInterval;; next += kSyncInterval) {
      std::this_thread::sleep_until(next);
      std::uint64_t begun = 0;
      {
        const std::lock_guard guard(mutex);
        if (over) return;
        begun = in_kernel;
      }
      output.sync();
      const std::lock_guard guard(mutex);
      mark(for_disk, begun, Time::now(), taken.on_disk);
    }
  });
  std::uint64_t end = 0;
  const Time::time_point start = Time::now();
  for (std::size_t i = 0; i < segment.size(); ++i) {
    std::this_thread::sleep_until(start + i * nanoseconds(std::chrono::seconds(1)) / kRate);
    const Time::time_point came = Time::now();
    for (const Bytes& bytes : segment[i]) {
      output.write(bytes);
      end += bytes.size();
    }
    const Time::time_point written = Time::now();
    taken.writing.push_back(microseconds(written - came));
    const std::lock_guard guard(mutex);
    for_kernel.push_back({end, came});
    for_disk.push_back({end, came});
    in_kernel = output.in_kernel();
    mark(for_kernel, in_kernel, written, taken.in_kernel);
  }
  {
    const std::lock_guard guard(mutex);
    over = true;
  }
  syncer.join();
  output.commit();
  const Time::time_point now = Time::now();
  mark(for_kernel, end, now, taken.in_kernel);
  mark(for_disk, end, now, taken.on_disk);
}

void print(const std::string& profile, const std::string& what, const std::vector<double>& clear,
           const std::vector<double>& sealed, double unit) {
  for (const auto& [name, share] : {std::pair{"p50", 0.5}, {"p99", 0.99}}) {
    const double without = quantile(clear, share) / unit, with = quantile(sealed, share) / unit;
    std::printf("%s-%s-%s=%.4g %s-%s-%s.peer=%.4g %s-%s-%s-ratio=%.3g\n", profile.c_str(), what.c_str(), name,
                with, profile.c_str(), what.c_str(), name, without, profile.c_str(), what.c_str(), name,
                with / without);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fputs("usage: sealing_latency_bench FOLDER PROFILE SIZE SECONDS\n", stderr);
    return 2;
  }
  const fs::path folder = argv[1];
  const std::string profile = argv[2];
  const crypto::AgeRecipients recipients{crypto::parse_recipient(crypto::generate_age_key().recipient)};
  const std::vector<Segment> segments = coded(argv[3], parse_profile(profile).value(), std::atoi(argv[4]));
  Taken clear, sealed;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const auto write_clear = [&] {
      InTheClear output(folder / ("clear-" + std::to_string(i)));
      write(segments[i], output, clear);
    };
    const auto write_sealed = [&] {
      Sealed output(folder / ("sealed-" + std::to_string(i)), recipients);
      write(segments[i], output, sealed);
    };
    if (i % 2 == 0) {
      write_clear();
      write_sealed();
    } else {
      write_sealed();
      write_clear();
    }
  }
  std::vector<double> added;
  for (std::size_t i = 0; i < clear.writing.size(); ++i)
    added.push_back(sealed.writing[i] - clear.writing[i]);
  std::printf("%s-pictures=%zu\n", profile.c_str(), added.size());
  std::printf("%s-added-p50=%.4g %s-added-p99=%.4g\n", profile.c_str(), quantile(added, 0.5), profile.c_str(),
              quantile(added, 0.99));
  print(profile, "write", clear.writing, sealed.writing, 1);
  print(profile, "kernel", clear.in_kernel, sealed.in_kernel, 1000);
  print(profile, "disk", clear.on_disk, sealed.on_disk, 1000);
  return 0;
}
