#include "media/export/exporter.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/event_line.h"
#include "archive/format/pointing_stream.h"
#include "archive/format/segment_media.h"
#include "archive/reading/committed_events.h"
#include "base/ascii.h"
#include "base/error.h"
#include "media/export/remux_job.h"
#include "media/output_file.h"
#include "media/plaintext_lines.h"
#include "media/sealed_segment.h"
#include "media/stream_clock.h"
#include "media/transport_times.h"
#include "media/vital_line.h"
#include "media/vitals_table.h"

namespace kiroku::media {
namespace {

constexpr std::size_t kCopyBytes = 16 * 64 * 1024;
constexpr std::string_view kTransportStreamMedia = "video/mp2t";
constexpr std::size_t kLongestLineBytes = kMaximumVitalLineBytes;

enum class Form { kTransportStream, kMatroska, kMp4, kLines, kTable };

Form form_of(const archive::StreamInfo& stream, const std::string& media,
             const std::filesystem::path& output) {
  const std::string ending = lower_case(output.extension().string());
  const bool transport_stream = media == kTransportStreamMedia;
  const bool pictures = transport_stream || media == "video/x-matroska";
  const bool vitals = stream.kind == "vitals";
  const std::string fitting = transport_stream ? ".ts, .mkv or .mp4"
                              : pictures       ? ".mkv or .mp4"
                              : vitals         ? ".jsonl or .csv"
                                               : ".jsonl";
  if (ending == ".dcm") {
    throw UsageError("cannot write " + output.string() +
                     ": DICOM is not among the forms that are written here; "
                     "choose " +
                     fitting);
  }
  if (ending == ".ts" && transport_stream) {
    return Form::kTransportStream;
  }
  if (ending == ".mkv" && pictures) {
    return Form::kMatroska;
  }
  if (ending == ".mp4" && pictures) {
    return Form::kMp4;
  }
  if (ending == ".jsonl" && !pictures) {
    return Form::kLines;
  }
  if (ending == ".csv" && vitals) {
    return Form::kTable;
  }
  throw UsageError("stream '" + stream.name + "' cannot be exported as '" + output.filename().string() +
                   "'; its name must end in " + fitting);
}

/// Beside the pictures a container has a table of them; none is smaller than this.
constexpr std::uint64_t kTables = 64U << 20, kSmallestPicture = 16;

/// A run of bytes that is read from its beginning to its end.
class Run : public crypto::ByteSource {
 public:
  explicit Run(SequentialReader reader) : reader_(std::move(reader)) {}
  [[nodiscard]] std::uint64_t size() const override { return INT64_MAX; }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    if (offset != at_) throw UsageError("a run of bytes is read from its beginning to its end");
    const std::size_t got = reader_(into);
    at_ += got;
    return got;
  }

 private:
  const SequentialReader reader_;
  mutable std::uint64_t at_ = 0;
};

/// One export in the making.
class Export {
 public:
  Export(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
         const ExportOptions& options)
      : recording_(recording),
        identities_(identities),
        options_(options),
        folder_(archive::CaseFolder::open(recording.folder())),
        stream_(recording.stream(options.stream)),
        segments_(segments_of(recording, options)),
        media_(segments_.empty() ? stream_.media : archive::media_of(stream_, segments_.front())),
        form_(form_of(stream_, media_, options.output)) {
    offset_ =
        StreamClock(stream_, recording.segments(options.stream, INT64_MIN, INT64_MAX)).constant_of(media_);
    if (segments_.empty()) {
      throw UsageError("stream '" + options.stream + "' has nothing recorded in that time");
    }
    for (const archive::SegmentEntry& segment : segments_) {
      total_bytes_ += segment.file.bytes;
      result_.incomplete += segment.complete ? 0 : 1;
    }
    result_.segments = segments_.size();
    result_.start_ns = segments_.front().span.start_ns;
    result_.end_ns = segments_.back().span.end_ns;
    result_.zero_ns = options.zero_ns.value_or(export_zero_ns(recording, options.from_ns, options.to_ns));
  }

  ExportResult run() {
    refuse_change_of_profile();
    OutputFile output(options_.output, options_.overwrite);
    switch (form_) {
      case Form::kTransportStream:
        join_transport_stream(output);
        break;
      case Form::kLines:
        join_lines(output);
        break;
      case Form::kMatroska:
        remux(output, Container::kMatroska);
        break;
      case Form::kMp4:
        remux(output, Container::kMp4);
        break;
      case Form::kTable:
        tabulate(output);
        break;
    }
    result_.bytes = output.size();
    output.commit();
    return result_;
  }

 private:
  static std::vector<archive::SegmentEntry> segments_of(const archive::CaseReader& recording,
                                                        const ExportOptions& options) {
    auto segments = recording.segments(options.stream, options.from_ns, options.to_ns);
    if (options.pass_over_erased)
      std::erase_if(segments, [&](const archive::SegmentEntry& each) { return recording.is_erased(each); });
    return segments;
  }

  /// One file has pictures in one form.
  void refuse_change_of_profile() const {
    for (const archive::SegmentEntry& segment : segments_) {
      if (archive::media_of(stream_, segment) == media_) continue;
      throw FormatChanged("cannot join the segments of stream '" + stream_.name +
                              "': its profile was changed while it was recorded; export the times before and "
                              "after the change one by one (--from, --to)",
                          segment.span.start_ns);
    }
  }

  SealedSegment open(const archive::SegmentEntry& segment) {
    try {
      return SealedSegment::open(folder_, segment, identities_, [this](std::uint64_t more) {
        done_bytes_ += more;
        if (options_.progress) {
          options_.progress(done_bytes_, total_bytes_);
        }
      });
    } catch (const Error&) {
      if (const archive::ErasedEntry* const erased = recording_.erasure_of(segment)) {
        throw UsageError("the segment file " + segment.file.file + " was erased under the policy '" +
                         erased->policy + "'; choose a time without it (--from, --to)");
      }
      throw;
    }
  }

  /// How much of a segment is whole: one that a power failure cut short may end within a packet, onto which
  /// nothing can be joined.
  static std::uint64_t whole_packets(const archive::SegmentEntry& entry, const SealedSegment& segment) {
    return entry.complete ? segment.size() : segment.size() - segment.size() % TransportTimes::kPacketBytes;
  }

  void join_lines(OutputFile& output) {
    std::optional<archive::CommittedEvents> events;
    if (stream_.kind == "events" && !archive::is_pointing(stream_)) events.emplace(recording_);
    for (const archive::SegmentEntry& entry : segments_) {
      const SealedSegment segment = open(entry);
      std::string text;
      std::uint64_t left_out = 0;
      for_each_line(segment, entry.file.file, events ? archive::kLongestEventLine : kLongestLineBytes,
                    !entry.complete, [&](std::uint64_t, std::string_view line) {
                      if (events && !events->take(line)) {
                        ++left_out;
                        return;
                      }
                      text += line;
                      text += '\n';
                      if (text.size() < kCopyBytes) return;
                      output.write(bytes_of(text));
                      text.clear();
                    });
      output.write(bytes_of(text));
      count(entry);
      result_.frames -= std::min(entry.frames, left_out);
      result_.left_out += left_out;
    }
  }

  void join_transport_stream(OutputFile& output) {
    const SequentialReader reader = moved_transport_stream();
    Bytes buffer(kCopyBytes);
    while (const std::size_t got = reader(buffer)) output.write(ByteView(buffer).first(got));
    for (const archive::SegmentEntry& entry : segments_) count(entry);
  }

  void count(const archive::SegmentEntry& entry) {
    result_.frames += entry.frames;
    result_.uncounted += entry.counted ? 0 : 1;
  }

  void remux(OutputFile& output, Container container) {
    RemuxTerms terms;
    terms.container = container;
    terms.media = media_;
    terms.stream = "stream '" + stream_.name + "'";
    terms.output = options_.output.string();
    // What is written has the pictures as they were sealed, and tables of them.
    terms.most_bytes = 2 * total_bytes_ + kTables;
    terms.most_pictures = total_bytes_ / kSmallestPicture + kSmallestPicture;
    terms.is_run = media_ == kTransportStreamMedia;
    if (terms.is_run) {
      terms.shift = 0;  // moved already
    } else {
      for (const archive::SegmentEntry& entry : segments_)
        terms.inputs.push_back({entry.file.file, entry.complete});
      const Ticks zero = ticks_of_ns(result_.zero_ns);
      terms.first_at = ticks_of_ns(segments_.front().span.start_ns) - zero;
      if (offset_) terms.shift = -*offset_ - zero;
    }
    const SegmentDoor door = [&](std::uint64_t number) -> std::unique_ptr<crypto::ByteSource> {
      if (terms.is_run && number == 0) return std::make_unique<Run>(moved_transport_stream());
      if (terms.is_run || number >= segments_.size()) throw UsageError("there is no such segment");
      return std::make_unique<SealedSegment>(open(segments_[number]));
    };
    const RemuxResult done = remux_in_box(terms, door, output, on_picture());
    if (done.changed_at) {
      throw FormatChanged(
          done.change + "; export the times before and after the change one by one (--from, --to)",
          segments_[*done.changed_at].span.start_ns);
    }
    result_.frames = done.frames;
  }

  [[nodiscard]] std::function<void(Ticks)> on_picture() const {
    if (!options_.on_picture) return {};
    return [this](Ticks time) { options_.on_picture(ns_of_ticks(time)); };
  }

  /// From a time stamp to the time in the file. Where no entry of the stream states a time stamp, the first
  /// picture is taken to be where its entry estimates it.
  [[nodiscard]] Ticks shift_by(const std::function<std::optional<Ticks>()>& first_stamp) const {
    const Ticks zero = ticks_of_ns(result_.zero_ns);
    if (offset_) return -*offset_ - zero;
    return ticks_of_ns(segments_.front().span.start_ns) - zero - first_stamp().value_or(0);
  }

  /// All segments as one run of bytes with the file's times, each opened when the one before is spent.
  SequentialReader moved_transport_stream() {
    struct State {
      std::size_t next = 0;
      std::optional<SealedSegment> segment;
      std::string name;
      std::uint64_t offset = 0, end = 0;
      std::optional<TransportTimes> times;
      Bytes moved;            // whole packets,
      std::size_t taken = 0;  // of which so many bytes have left
      Bytes begun;            // of the packet that the last read cut
    };
    const auto fill = [this](State& state) {
      while (state.offset == state.end) {
        if (!state.begun.empty()) {
          throw MediaError("the media of " + state.name + " ends within a transport packet");
        }
        if (state.next == segments_.size()) return false;
        const archive::SegmentEntry& entry = segments_[state.next++];
        state.segment.reset();
        state.segment.emplace(open(entry));
        state.name = entry.file.file;
        state.offset = 0;
        state.end = whole_packets(entry, *state.segment);
        if (state.end == 0) continue;
        if (!state.times) {
          const Ticks shift =
              shift_by([&] { return first_stamp_in_box(*state.segment, media_, state.name); });
          const bool tells = form_ == Form::kTransportStream;
          state.times.emplace(shift, "stream '" + stream_.name + "'",
                              tells ? on_picture() : std::function<void(Ticks)>());
        }
        state.times->expect_around(ticks_of_ns(entry.span.start_ns) - ticks_of_ns(result_.zero_ns));
      }
      state.moved = std::move(state.begun);
      const std::size_t kept = state.moved.size();
      const auto wanted =
          static_cast<std::size_t>(std::min<std::uint64_t>(kCopyBytes, state.end - state.offset));
      state.moved.resize(kept + wanted);
      const std::size_t got = state.segment->read_at(state.offset, std::span(state.moved).subspan(kept));
      if (got == 0) throw Error("the segment file " + state.name + " became shorter while it was read");
      state.offset += got;
      const std::size_t whole = (kept + got) / TransportTimes::kPacketBytes * TransportTimes::kPacketBytes;
      state.begun.assign(state.moved.begin() + std::ptrdiff_t(whole),
                         state.moved.begin() + std::ptrdiff_t(kept + got));
      state.moved.resize(whole);
      state.times->move(state.moved);
      state.taken = 0;
      return true;
    };
    return [fill, state = std::make_shared<State>()](std::span<std::byte> into) -> std::size_t {
      while (state->taken == state->moved.size()) {
        if (!fill(*state)) return 0;
      }
      const std::size_t count = std::min(into.size(), state->moved.size() - state->taken);
      std::copy_n(state->moved.begin() + std::ptrdiff_t(state->taken), count, into.begin());
      state->taken += count;
      return count;
    };
  }

  void tabulate(OutputFile& output) {
    VitalsTable table([&output](ByteView bytes) { output.write(bytes); }, result_.zero_ns);
    for (const archive::SegmentEntry& entry : segments_) {
      const SealedSegment segment = open(entry);
      for_each_line(segment, entry.file.file, kLongestLineBytes, !entry.complete,
                    [&](std::uint64_t number, std::string_view line) {
                      const VitalLineParse parse = parse_vital_line_of_any_kind(line);
                      if (!parse.line) {
                        throw Error("line " + std::to_string(number) + " of " + entry.file.file +
                                    " is no vital sign: " + parse.problem);
                      }
                      if (const auto* const sample = std::get_if<VitalSample>(&*parse.line)) {
                        table.add(*sample);
                        ++result_.frames;
                      } else {
                        ++result_.left_out;
                      }
                    });
    }
    table.finish();
  }

  const archive::CaseReader& recording_;
  const crypto::AgeIdentities& identities_;
  const ExportOptions& options_;
  archive::CaseFolder folder_;
  archive::StreamInfo stream_;
  std::vector<archive::SegmentEntry> segments_;
  std::string media_;  // of the first of them
  Form form_;
  std::optional<Ticks> offset_;  // of the stream's time stamps in such media
  std::uint64_t done_bytes_ = 0, total_bytes_ = 0;
  ExportResult result_;
};

}  // namespace

std::int64_t export_zero_ns(const archive::CaseReader& recording, std::int64_t from_ns, std::int64_t to_ns) {
  std::int64_t zero_ns = std::max(from_ns, recording.opening().begins_ns);
  for (const archive::StreamInfo& stream : recording.opening().streams) {
    if (!stream.media.starts_with("video/") && !stream.media.starts_with("audio/")) continue;
    for (const archive::SegmentEntry& segment : recording.segments(stream.name, from_ns, to_ns)) {
      zero_ns = std::min(zero_ns, segment.span.start_ns - (segment.counted ? 0 : kEarliestBeforeEstimateNs));
    }
  }
  return std::max<std::int64_t>(zero_ns, 0);
}

ExportResult export_stream(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                           const ExportOptions& options) {
  return Export(recording, identities, options).run();
}

}  // namespace kiroku::media
