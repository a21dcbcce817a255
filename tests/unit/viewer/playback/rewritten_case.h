// A recorded case written anew with something missing: what a gap, a crash or retention leaves.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "archive/storage/file_system.h"
#include "archive/writing/case_writer.h"
#include "crypto/signing_key.h"
#include "tests/support/recorded_case.h"
#include "tests/support/recording.h"

namespace kiroku::test {

enum class Fate {
  kKept,
  kLeftOut,   // a gap is stated in its place
  kErased,    // removed by retention
  kFoundCut,  // found by recovery: half of it, without counts and with estimated times
};

/// Segments keep their bytes, times and names; `fate_of` says what becomes of each.
inline std::filesystem::path rewrite_case(const std::filesystem::path& archive, const RecordedCase& recorded,
                                          const crypto::AgeRecipients& recipients,
                                          const std::function<Fate(const archive::SegmentEntry&)>& fate_of) {
  std::filesystem::create_directories(archive);
  const auto key = crypto::SigningKey::generate();
  archive::CaseWriter::Options options;
  options.archive = archive;
  options.key = &key;
  options.device_name = "test";
  options.boot_id = "b1";
  options.subject_recipients = recipients;
  options.streams = std::get<archive::OpenEntry>(recorded.entries().front().body).streams;
  options.stream_recipients.assign(options.streams.size(), recipients);
  const archive::Moment opened = recorded.entries().front().at;
  const auto writer = archive::CaseWriter::create(archive::real_file_system(), options, opened);
  archive::Moment now = opened;
  std::vector<std::uint64_t> next(options.streams.size());
  for (const auto& recorded_entry : recorded.all<archive::SegmentEntry>()) {
    archive::SegmentEntry entry = recorded_entry;
    now.mono_ns = std::max(now.mono_ns, entry.span.end_ns);
    const Fate fate = fate_of(entry);
    if (fate == Fate::kLeftOut) {
      writer->append({archive::GapEntry{entry.stream, entry.span, archive::GapCause::kSignalLost}}, now);
      continue;
    }
    std::size_t stream = 0;
    while (options.streams[stream].name != entry.stream) ++stream;
    const Bytes plain = recorded.plaintext(recorded_entry);
    entry.index = next[stream]++;
    const auto segment = writer->begin_segment(stream, entry.index);
    if (fate == Fate::kFoundCut) {
      segment->write(ByteView(plain).first(plain.size() * 2 / 3));
      entry.file = segment->salvage().value();
      entry.complete = entry.counted = false;
      entry.first_pts = 0;
      entry.frames = entry.dropped = 0;
      entry.time_base.clear();
      entry.span.start_ns -= 40'000'000;  // where the stream was accounted for
      writer->append({archive::RecoveredEntry{"b2", "power-loss", ""}}, now);
    } else {
      segment->write(plain);
      segment->seal();
      entry.file = segment->commit();
    }
    writer->append({entry}, now);
    if (fate == Fate::kErased) {
      writer->append({archive::ErasedEntry{entry.stream, entry.index, entry.index, "after 30 days"}}, now);
      std::filesystem::remove(writer->folder() / entry.file.file);
    }
  }
  return writer->folder();
}

}  // namespace kiroku::test
