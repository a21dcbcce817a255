#include "tests/support/recording.h"

#include <sstream>

#include "crypto/age_file.h"
#include "crypto/byte_source.h"

namespace kiroku::test {

RecordedCase::RecordedCase(const std::filesystem::path& folder, crypto::AgeIdentities identities)
    : folder_(folder), identities_(std::move(identities)) {
  archive::CaseReader::open(folder).for_each(
      [&](const archive::CaseEntry& entry) { entries_.push_back(entry); });
}

std::vector<archive::SegmentEntry> RecordedCase::segments(const std::string& stream) const {
  std::vector<archive::SegmentEntry> found;
  for (const auto& segment : all<archive::SegmentEntry>()) {
    if (segment.stream == stream) found.push_back(segment);
  }
  return found;
}

std::vector<archive::GapEntry> RecordedCase::gaps(const std::string& stream) const {
  std::vector<archive::GapEntry> found;
  for (const auto& gap : all<archive::GapEntry>()) {
    if (gap.stream == stream) found.push_back(gap);
  }
  return found;
}

std::vector<archive::GapEntry> RecordedCase::gaps_but_overload(const std::string& stream) const {
  std::vector<archive::GapEntry> left = gaps(stream);
  std::erase_if(left, [](const archive::GapEntry& gap) { return gap.cause == archive::GapCause::kOverload; });
  return left;
}

Bytes RecordedCase::plaintext(const archive::SegmentEntry& segment) const {
  const auto source = crypto::open_file_source(folder_ / segment.file.file);
  Bytes plain;
  crypto::AgeFile::open(*source, identities_,
                        segment.complete ? crypto::Truncation::kRefuse : crypto::Truncation::kTolerate)
      .read_all([&](ByteView bytes) { append(plain, bytes); });
  return plain;
}

Bytes RecordedCase::joined(const std::string& stream) const {
  Bytes all_bytes;
  for (const auto& segment : segments(stream)) append(all_bytes, plaintext(segment));
  return all_bytes;
}

std::vector<std::string> RecordedCase::lines(const std::string& stream) const {
  std::istringstream text{std::string(text_of(joined(stream)))};
  std::vector<std::string> found;
  for (std::string line; std::getline(text, line);) found.push_back(line);
  return found;
}

std::string RecordedCase::subject() const {
  const auto& file = std::get<archive::OpenEntry>(entries_.front().body).subject;
  if (!file) return "";
  const auto source = crypto::open_file_source(folder_ / file->file);
  Bytes plain;
  crypto::AgeFile::open(*source, identities_, crypto::Truncation::kRefuse).read_all([&](ByteView bytes) {
    append(plain, bytes);
  });
  return std::string(text_of(plain));
}

std::vector<std::string> RecordedCase::broken_rules() const {
  constexpr std::int64_t kLongestNs = 10'000'000'000;
  std::vector<std::string> broken;
  for (const archive::StreamInfo& stream : std::get<archive::OpenEntry>(entries_.front().body).streams) {
    std::uint64_t index = 0;
    std::int64_t until_ns = -1;
    for (const archive::SegmentEntry& segment : segments(stream.name)) {
      const std::string what = stream.name + " " + std::to_string(segment.index);
      if (segment.index != index++) broken.push_back(what + " is out of order");
      if (segment.span.end_ns <= segment.span.start_ns) broken.push_back(what + " spans nothing");
      if (segment.span.end_ns - segment.span.start_ns > kLongestNs && stream.kind == "video") {
        broken.push_back(what + " is too long");
      }
      if (until_ns >= 0 && segment.span.start_ns < until_ns)
        broken.push_back(what + " overlaps the one before");
      if (until_ns >= 0 && segment.span.start_ns > until_ns) {
        bool stated = false;
        for (const archive::GapEntry& gap : gaps(stream.name)) {
          stated |= gap.span.start_ns <= until_ns && gap.span.end_ns >= segment.span.start_ns;
        }
        if (!stated) broken.push_back(what + " follows a hole that no gap states");
      }
      until_ns = segment.span.end_ns;
    }
  }
  return broken;
}

RecorderBench::RecorderBench()
    : key_(crypto::SigningKey::generate()),
      authority_(timestamp::Authority::create(folder_ / "authority", "Test")),
      stamps_(timestamp::embedded_stamp_source(authority_)) {
  const crypto::AgeKeyPair pair = crypto::generate_age_key();
  recipients_ = {crypto::parse_recipient(pair.recipient)};
  identities_ = {crypto::parse_identity(pair.identity_text.text())};
  trust_.add_own_authority(bytes_of(authority_.root_pem()), "the embedded authority");
  std::filesystem::create_directory(folder_ / "archive");
}

recorder::SessionOptions RecorderBench::options() const {
  recorder::SessionOptions options;
  options.archive = folder_ / "archive";
  options.key = &key_;
  options.device_name = "test";
  options.event_recipients = recipients_;
  options.authorities = {{"embedded", stamps_}};
  options.trust = &trust_;
  options.segment_duration = std::chrono::milliseconds(200);
  options.stamp_interval = std::chrono::seconds(1);
  return options;
}

recorder::StreamRequest RecorderBench::stream(const std::string& name, const std::string& source,
                                              recorder::Profile profile) const {
  recorder::StreamRequest request;
  request.name = name;
  request.source = source;
  request.purpose = name;
  request.video.profile = profile;
  request.recipients = recipients_;
  return request;
}

RecordedCase RecorderBench::record(recorder::SessionOptions options) const {
  recorder::Session session(std::move(options));
  return read(session.run().folder);
}

std::size_t RecorderBench::cases() const {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "archive")) {
    count += entry.is_directory() && !entry.path().filename().string().starts_with('.') ? 1U : 0U;
  }
  return count;
}

}  // namespace kiroku::test
