#include "tests/support/recorded_case.h"

#include <algorithm>

#include "archive/format/event_line.h"
#include "archive/format/segment_media.h"
#include "archive/storage/file_system.h"
#include "archive/writing/case_writer.h"
#include "crypto/signing_key.h"

namespace kiroku::test {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

std::int64_t start_of(const RecordedStream& stream, std::size_t index) {
  return stream.starts_ns.empty() ? static_cast<std::int64_t>(index) * kSecondNs : stream.starts_ns.at(index);
}

archive::SegmentEntry write_segment(archive::CaseWriter& writer, const std::vector<RecordedStream>& streams,
                                    std::size_t stream_index, std::size_t index) {
  const RecordedStream& stream = streams[stream_index];
  const auto segment = writer.begin_segment(stream_index, index);
  segment->write(stream.segments[index]);
  archive::SegmentEntry entry;
  entry.stream = stream.name;
  entry.index = index;
  entry.complete = !(stream.last_is_cut && index + 1 == stream.segments.size());
  if (entry.complete) {
    segment->seal();
    entry.file = segment->commit();
  } else {
    entry.file = segment->salvage().value();
  }
  const std::int64_t start = start_of(stream, index);
  entry.span = {start, start + kSecondNs};
  const archive::MediaUnit unit = archive::unit_of_media(stream.media);
  entry.time_base = unit.time_base;
  entry.first_pts = stream.first_pts.empty() ? start / kSecondNs * unit.per_second +
                                                   start % kSecondNs * unit.per_second / kSecondNs
                                             : stream.first_pts.at(index);
  entry.frames = stream.units[index];
  entry.counts_samples = stream.kind == "vitals";
  return entry;
}

/// A recorder enters a mark for each event.
void append_marks(std::string_view lines, const std::vector<std::string>& not_entered,
                  std::vector<archive::CaseEntryBody>& bodies) {
  while (!lines.empty()) {
    const std::size_t end = std::min(lines.find('\n'), lines.size() - 1) + 1;
    const auto event = archive::parse_event_line(lines.substr(0, end));
    if (event && std::ranges::find(not_entered, lines.substr(0, end)) == not_entered.end())
      bodies.emplace_back(archive::MarkEntry{event->commitment});
    lines.remove_prefix(end);
  }
}

}  // namespace

Reader make_reader() {
  const crypto::AgeKeyPair pair = crypto::generate_age_key();
  const std::string text(pair.identity_text.text());
  return {{crypto::parse_recipient(pair.recipient)}, {crypto::parse_identity(text)}, text};
}

std::filesystem::path record_case(const std::filesystem::path& archive,
                                  const std::vector<RecordedStream>& streams,
                                  const crypto::AgeRecipients& recipients) {
  std::filesystem::create_directories(archive);
  const crypto::SigningKey key = crypto::SigningKey::generate();
  archive::CaseWriter::Options options;
  options.archive = archive;
  options.key = &key;
  options.device_name = "test";
  options.boot_id = "6f1b1a52-4c9a-4d8c-9a3e-0f0e2f6f7a10";
  options.subject_recipients = recipients;
  for (const RecordedStream& stream : streams) {
    archive::StreamInfo info;
    info.name = stream.name;
    info.kind = stream.kind;
    info.media = stream.media;
    info.source = "synthetic:" + stream.name;
    info.profile = stream.kind != "video" ? "jsonl" : stream.media == "video/mp2t" ? "mpeg2" : "lossless";
    info.purpose = stream.name;
    info.recipients = {recipients.at(0)->to_string()};
    options.streams.push_back(info);
    options.stream_recipients.push_back(recipients);
  }
  const UtcTime opened = *parse_utc("2026-08-05T09:15:02Z");
  const auto moment = [&](std::int64_t mono_ns) {
    return archive::Moment{opened + std::chrono::microseconds(mono_ns / 1000), mono_ns};
  };
  const auto writer = archive::CaseWriter::create(archive::real_file_system(), options, moment(0));
  std::size_t longest = 0;
  for (const RecordedStream& stream : streams) {
    longest = std::max(longest, stream.segments.size());
  }
  std::int64_t latest_ns = 0;
  for (std::size_t index = 0; index < longest; ++index) {
    std::vector<archive::CaseEntryBody> bodies;
    for (std::size_t s = 0; s < streams.size(); ++s) {
      if (index >= streams[s].segments.size()) continue;
      const std::int64_t start = start_of(streams[s], index);
      const std::int64_t before = index == 0 ? 0 : start_of(streams[s], index - 1) + kSecondNs;
      if (start > before) {
        bodies.emplace_back(
            archive::GapEntry{streams[s].name, {before, start}, archive::GapCause::kSignalLost});
      }
      if (streams[s].kind == "events") {
        append_marks(text_of(streams[s].segments[index]), streams[s].not_entered, bodies);
      }
      bodies.emplace_back(write_segment(*writer, streams, s, index));
      latest_ns = std::max(latest_ns, start + kSecondNs);
    }
    writer->append(bodies, moment(latest_ns));
  }
  const archive::Moment end = moment(latest_ns + kSecondNs);
  writer->close("operator", end);
  for (const RecordedStream& stream : streams) {
    if (stream.first_is_erased) {
      writer->append({archive::ErasedEntry{stream.name, 0, 0, "after 30 days"}}, end);
      for (const auto& file :
           std::filesystem::directory_iterator(writer->folder() / "segments" / stream.name)) {
        if (file.path().filename().string().starts_with("00000000.")) {
          std::filesystem::remove(file.path());
          break;
        }
      }
    }
  }
  writer->finish(end);
  return writer->folder();
}

}  // namespace kiroku::test
