#include "tests/support/recorded_case.h"

#include <algorithm>

#include "archive/case_writer.h"
#include "archive/file_system.h"
#include "crypto/signing_key.h"

namespace kiroku::test {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

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
  const auto start = static_cast<std::int64_t>(index) * kSecondNs;
  entry.span = {start, start + kSecondNs};
  entry.time_base = "1/90000";
  entry.first_pts = static_cast<std::int64_t>(index) * 90'000;
  entry.frames = stream.units[index];
  entry.counts_samples = stream.kind == "vitals";
  return entry;
}

}  // namespace

Reader make_reader() {
  const crypto::AgeKeyPair pair = crypto::generate_age_key();
  return {{crypto::parse_recipient(pair.recipient)}, {crypto::parse_identity(pair.identity_text.text())}};
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
    info.profile = stream.kind == "video" ? "mpeg2" : "jsonl";
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
  for (std::size_t index = 0; index < longest; ++index) {
    std::vector<archive::CaseEntryBody> bodies;
    for (std::size_t s = 0; s < streams.size(); ++s) {
      if (index < streams[s].segments.size()) {
        bodies.emplace_back(write_segment(*writer, streams, s, index));
      }
    }
    writer->append(bodies, moment(static_cast<std::int64_t>(index + 1) * kSecondNs));
  }
  const archive::Moment end = moment(static_cast<std::int64_t>(longest + 1) * kSecondNs);
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
