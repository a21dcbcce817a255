#include "media/exporter.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "archive/case_folder.h"
#include "base/error.h"
#include "media/output_file.h"
#include "media/plaintext_lines.h"
#include "media/remuxer.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/vital_line.h"
#include "media/vitals_table.h"

namespace kiroku::media {
namespace {

constexpr std::size_t kCopyBytes = 16 * 64 * 1024;
constexpr std::size_t kTransportPacketBytes = 188;
constexpr std::size_t kLongestLineBytes = kMaximumVitalLineBytes;

enum class Form { kTransportStream, kMatroska, kMp4, kLines, kTable };

Form form_of(const archive::StreamInfo& stream, const std::filesystem::path& output) {
  std::string ending = output.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  const bool transport_stream = stream.media == "video/mp2t";
  const bool pictures = transport_stream || stream.media == "video/x-matroska";
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
        form_(form_of(stream_, options.output)),
        segments_(recording.segments(options.stream, options.from_ns, options.to_ns)) {
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
  }

  ExportResult run() {
    OutputFile output(options_.output, options_.overwrite);
    switch (form_) {
      case Form::kTransportStream:
      case Form::kLines:
        join(output);
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

  /// How much of a segment is whole: a segment cut short by a power failure may end within a packet or line,
  /// onto which nothing can be joined.
  std::uint64_t whole_bytes(const archive::SegmentEntry& entry, const SealedSegment& segment) const {
    if (form_ != Form::kLines) {
      return entry.complete ? segment.size() : segment.size() - segment.size() % kTransportPacketBytes;
    }
    std::uint64_t bytes = 0;
    for_each_line(segment, entry.file.file, kLongestLineBytes, !entry.complete,
                  [&](std::uint64_t, std::string_view line) { bytes += line.size() + 1; });
    return bytes;
  }

  void join(OutputFile& output) {
    Bytes buffer(kCopyBytes);
    for (const archive::SegmentEntry& entry : segments_) {
      const SealedSegment segment = open(entry);
      const std::uint64_t end = whole_bytes(entry, segment);
      for (std::uint64_t offset = 0; offset < end;) {
        const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(end - offset, buffer.size()));
        const std::size_t count = segment.read_at(offset, std::span(buffer).first(wanted));
        if (count == 0) {
          throw Error("the segment file " + entry.file.file + " became shorter while it was read");
        }
        output.write(ByteView(buffer).first(count));
        offset += count;
      }
      result_.frames += entry.frames;
      result_.uncounted += entry.counted ? 0 : 1;
    }
  }

  void remux(OutputFile& output, Container container) {
    Remuxer remuxer(output, container, options_.output.string());
    if (stream_.media == "video/mp2t") {
      SegmentInput input(joined_plaintext(), stream_.media, "stream '" + stream_.name + "'");
      remuxer.copy(input);
    } else {
      for (const archive::SegmentEntry& entry : segments_) {
        const SealedSegment segment = open(entry);
        copy_segment(remuxer, entry, segment);
      }
    }
    remuxer.finish();
    result_.frames = remuxer.frames();
  }

  void copy_segment(Remuxer& remuxer, const archive::SegmentEntry& entry, const SealedSegment& segment) {
    std::optional<SegmentInput> input;
    try {
      input.emplace(segment, stream_.media, entry.file.file);
    } catch (const MediaError&) {
      if (entry.complete) {
        throw;
      }
      return;  // cut before its first picture
    }
    remuxer.copy(*input, !entry.complete);
  }

  /// All segments as one run of bytes, each opened when the one before is spent.
  SequentialReader joined_plaintext() {
    struct State {
      std::size_t next = 0;
      std::optional<SealedSegment> segment;
      std::uint64_t offset = 0, end = 0;
    };
    return [this, state = std::make_shared<State>()](std::span<std::byte> into) -> std::size_t {
      while (state->offset == state->end) {
        if (state->next == segments_.size()) {
          return 0;
        }
        const archive::SegmentEntry& entry = segments_[state->next++];
        state->segment.reset();
        state->segment.emplace(open(entry));
        state->offset = 0;
        state->end = whole_bytes(entry, *state->segment);
      }
      const auto wanted =
          static_cast<std::size_t>(std::min<std::uint64_t>(into.size(), state->end - state->offset));
      const std::size_t count = state->segment->read_at(state->offset, into.first(wanted));
      if (count == 0) {
        throw Error("a segment of stream '" + stream_.name + "' became shorter while it was read");
      }
      state->offset += count;
      return count;
    };
  }

  void tabulate(OutputFile& output) {
    VitalsTable table([&output](ByteView bytes) { output.write(bytes); });
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
  Form form_;
  std::vector<archive::SegmentEntry> segments_;
  std::uint64_t done_bytes_ = 0, total_bytes_ = 0;
  ExportResult result_;
};

}  // namespace

ExportResult export_stream(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                           const ExportOptions& options) {
  return Export(recording, identities, options).run();
}

}  // namespace kiroku::media
