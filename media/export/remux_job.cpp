#include "media/export/remux_job.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

extern "C" {
#include <libavcodec/packet.h>
#include <libavformat/avformat.h>
}

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/printable.h"
#include "media/borrowed_source.h"
#include "media/segment_input.h"

namespace kiroku::media {
namespace {

using nlohmann::json;

constexpr const char* kRemuxJob = "remux";
constexpr const char* kFirstStampJob = "first-stamp";
constexpr const char* kRole = "remuxing";
constexpr std::chrono::seconds kSilence{60};
constexpr std::size_t kTimesAtOnce = 4096, kLongestPiece = std::size_t{1} << 20, kLongestText = 2000;

/// Before each piece of what the box gives.
struct PieceHead {
  enum class Kind : std::uint64_t { kBytes = 1, kTimes };
  Kind kind{};
  std::uint64_t position = 0;  // of bytes, in the file
  std::uint64_t bytes = 0;     // that follow; times have eight each
};

// --- in the box --------------------------------------------------------------------------------------------

/// A file as the muxer sees it, which the other end writes.
class GivenFile : public OutputBytes {
 public:
  explicit GivenFile(JobSegments& to) : to_(to) {}

  void write(ByteView bytes) override {
    for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), kLongestPiece))) {
      const ByteView piece = bytes.first(std::min(bytes.size(), kLongestPiece));
      give({PieceHead::Kind::kBytes, position_, piece.size()}, piece);
      position_ += piece.size();
      size_ = std::max(size_, position_);
    }
  }
  void seek(std::uint64_t position) override { position_ = position; }
  [[nodiscard]] std::uint64_t size() const override { return size_; }

  void note_picture(Ticks time) {
    times_.push_back(time);
    if (times_.size() == kTimesAtOnce) give_times();
  }
  void give_times() {
    if (times_.empty()) return;
    const ByteView bytes = std::as_bytes(std::span(times_));
    give({PieceHead::Kind::kTimes, 0, bytes.size()}, bytes);
    times_.clear();
  }

 private:
  void give(const PieceHead& head, ByteView bytes) {
    to_.give(std::as_bytes(std::span(&head, 1)));
    to_.give(bytes);
  }
  JobSegments& to_;
  std::uint64_t position_ = 0, size_ = 0;
  std::vector<std::int64_t> times_;
};

std::optional<Ticks> first_stamp_of(const crypto::ByteSource& segment, const std::string& media,
                                    const std::string& name) {
  SegmentInput input(segment, media, name);
  const AVStream& pictures = input.video();
  const Packet packet = make_packet();
  for (; input.read(*packet); av_packet_unref(packet.get())) {
    if (packet->stream_index != pictures.index || packet->pts == AV_NOPTS_VALUE) continue;
    return av_rescale_q(packet->pts, pictures.time_base, {1, int{kTicksPerSecond}});
  }
  return std::nullopt;
}

json remux(const json& with, JobSegments& segments) {
  GivenFile file(segments);
  const std::string media = with.at("media");
  const auto container = with.at("matroska").get<bool>() ? Container::kMatroska : Container::kMp4;
  Remuxer remuxer(file, container, with.at("output"), [&file](Ticks time) { file.note_picture(time); });
  if (with.at("run").get<bool>()) {
    const std::unique_ptr<crypto::ByteSource> run = segments.open(0);
    std::uint64_t offset = 0;
    SegmentInput input(
        [&](std::span<std::byte> into) {
          const std::size_t got = run->read_at(offset, into);
          offset += got;
          return got;
        },
        media, with.at("stream"));
    remuxer.copy(input, with.at("shift").get<Ticks>());
  } else {
    std::optional<Ticks> shift;
    if (with.at("shift").is_number()) shift = with.at("shift").get<Ticks>();
    for (std::size_t i = 0; i < with.at("inputs").size(); ++i) {
      const json& each = with.at("inputs").at(i);
      const std::string name = each.at("name");
      const bool complete = each.at("complete");
      const std::unique_ptr<crypto::ByteSource> segment = segments.open(i);
      std::optional<SegmentInput> input;
      try {
        input.emplace(*segment, media, name);
      } catch (const MediaError&) {
        if (complete) throw;
        continue;  // cut before its first picture
      }
      if (!shift)
        shift = with.at("first_at").get<Ticks>() - first_stamp_of(*segment, media, name).value_or(0);
      if (const std::string change = remuxer.change(*input); !change.empty())
        return {{"changed_at", i}, {"change", change}};
      remuxer.copy(*input, *shift, !complete);
    }
  }
  remuxer.finish();
  file.give_times();
  return {{"frames", remuxer.frames()}};
}

// --- outside -----------------------------------------------------------------------------------------------

/// What the box gives, piece by piece, as far as it can be believed.
class Pieces {
 public:
  Pieces(OutputFile& output, const std::function<void(Ticks)>& on_picture, const RemuxTerms& terms)
      : output_(output), on_picture_(on_picture), terms_(terms) {}

  /// False where it cannot be.
  bool take(ByteView bytes) {
    while (!bytes.empty()) {
      if (head_bytes_ < sizeof head_) {
        const std::size_t count = std::min(bytes.size(), sizeof head_ - head_bytes_);
        std::memcpy(reinterpret_cast<std::byte*>(&head_) + head_bytes_, bytes.data(), count);
        head_bytes_ += count;
        bytes = bytes.subspan(count);
        if (head_bytes_ == sizeof head_ && !begin()) return false;
        continue;
      }
      const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), head_.bytes - done_));
      if (head_.kind == PieceHead::Kind::kTimes) {
        append(times_, bytes.first(count));
      } else {
        output_.write(bytes.first(count));
      }
      done_ += count;
      bytes = bytes.subspan(count);
      if (done_ == head_.bytes) end();
    }
    return true;
  }
  [[nodiscard]] bool is_whole() const { return head_bytes_ == 0; }

 private:
  bool begin() {
    done_ = 0;
    if (head_.bytes == 0 || head_.bytes > kLongestPiece) return false;
    if (head_.kind == PieceHead::Kind::kTimes) {
      pictures_ += head_.bytes / sizeof(std::int64_t);
      return head_.bytes % sizeof(std::int64_t) == 0 && pictures_ <= terms_.most_pictures;
    }
    written_ += head_.bytes;
    if (head_.kind != PieceHead::Kind::kBytes || head_.position > terms_.most_bytes ||
        head_.bytes > terms_.most_bytes - head_.position || written_ > 2 * terms_.most_bytes)
      return false;
    output_.seek(head_.position);
    return true;
  }
  void end() {
    head_bytes_ = 0;
    for (std::size_t at = 0; at < times_.size(); at += sizeof(std::int64_t)) {
      std::int64_t time = 0;
      std::memcpy(&time, times_.data() + at, sizeof time);
      if (on_picture_) on_picture_(time);
    }
    times_.clear();
  }

  OutputFile& output_;
  const std::function<void(Ticks)>& on_picture_;
  const RemuxTerms& terms_;
  PieceHead head_;
  std::size_t head_bytes_ = 0;
  std::uint64_t done_ = 0, written_ = 0, pictures_ = 0;
  Bytes times_;
};

/// A disk or a machine so slow that a MiB takes a second, and ten minutes more.
std::chrono::seconds longest_job(std::uint64_t bytes) {
  return std::chrono::minutes(10) + std::chrono::seconds(bytes >> 20);
}

[[noreturn]] void refuse_answer(const std::string& name) {
  throw MediaError(name + " cannot be exported: its decoder says what cannot be");
}

}  // namespace

RemuxResult remux_in_box(const RemuxTerms& terms, const SegmentDoor& door, OutputFile& output,
                         const std::function<void(Ticks)>& on_picture) {
  json inputs = json::array();
  for (const RemuxTerms::Input& input : terms.inputs)
    inputs.push_back({{"name", input.name}, {"complete", input.complete}});
  const json asked{{"matroska", terms.container == Container::kMatroska},
                   {"media", terms.media},
                   {"stream", terms.stream},
                   {"output", terms.output},
                   {"inputs", std::move(inputs)},
                   {"run", terms.is_run},
                   {"shift", terms.shift ? json(*terms.shift) : json(nullptr)},
                   {"first_at", terms.first_at}};
  Pieces pieces(output, on_picture, terms);
  BoxedJobs box(kSilence, kRole);
  const json answer =
      box.ask(kRemuxJob, asked, door, terms.stream, [&](ByteView bytes) { return pieces.take(bytes); },
              {.whole = longest_job(terms.most_bytes)});
  RemuxResult result;
  try {
    if (answer.contains("changed_at")) {
      result.changed_at = answer.at("changed_at").get<std::size_t>();
      result.change = printable(answer.at("change").get<std::string>().substr(0, kLongestText));
      if (*result.changed_at >= terms.inputs.size()) refuse_answer(terms.stream);
      return result;
    }
    result.frames = answer.at("frames").get<std::uint64_t>();
  } catch (const json::exception&) {
    refuse_answer(terms.stream);
  }
  if (!pieces.is_whole() || result.frames > terms.most_pictures) refuse_answer(terms.stream);
  return result;
}

std::optional<Ticks> first_stamp_in_box(const crypto::ByteSource& segment, const std::string& media,
                                        const std::string& name) {
  BoxedJobs box(kSilence, kRole);
  const json answer = box.ask(kFirstStampJob, {{"media", media}, {"name", name}},
                              [&](std::uint64_t) { return std::make_unique<BorrowedSource>(segment); }, name,
                              nullptr, {.whole = longest_job(0)});
  if (!answer.contains("stamp")) return std::nullopt;
  try {
    const Ticks stamp = answer.at("stamp").get<Ticks>();
    constexpr Ticks kMost = Ticks{1} << 48;
    if (stamp > -kMost && stamp < kMost) return stamp;
  } catch (const json::exception&) {  // see below
  }
  refuse_answer(name);
}

Jobs remux_jobs() {
  Jobs jobs;
  jobs[kRemuxJob] = remux;
  jobs[kFirstStampJob] = [](const json& with, JobSegments& segments) {
    const std::unique_ptr<crypto::ByteSource> segment = segments.open(0);
    const std::optional<Ticks> stamp = first_stamp_of(*segment, with.at("media"), with.at("name"));
    return stamp ? json{{"stamp", *stamp}} : json::object();
  };
  return jobs;
}

}  // namespace kiroku::media
