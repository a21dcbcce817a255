#include "tests/support/sample_case.h"

#include <algorithm>
#include <random>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "crypto/encoding.h"
#include "tests/support/nanoseconds.h"
#include "timestamp/request.h"
#include "timestamp/token.h"

namespace kiroku::test {

using archive::Moment;
using archive::Span;

namespace {

constexpr std::int64_t kRoundTrip = 100'000'000;

/// Noise from a fixed seed.
Bytes noise(std::size_t size, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Bytes bytes(size);
  for (std::byte& each : bytes) {
    each = static_cast<std::byte>(random() & 0xFFU);
  }
  return bytes;
}

/// The DER of a PEM text with one certificate.
Bytes der_of(const std::string& pem) {
  std::string base64;
  std::istringstream lines(pem);
  for (std::string line; std::getline(lines, line);) {
    base64 += line.starts_with("-----") ? "" : line;
  }
  return crypto::from_base64(base64, crypto::Base64Padding::kPadded).value();
}

}  // namespace

SampleArchive::SampleArchive()
    : key_(crypto::SigningKey::generate()),
      authority_(timestamp::Authority::create(temporary_ / "authority", "Sample Hospital")) {
  std::filesystem::create_directory(folder());
  for (int i = 0; i < 2; ++i) {
    const crypto::AgeKeyPair pair = crypto::generate_age_key();
    recipients_.push_back(crypto::parse_recipient(pair.recipient));
    identities_.push_back(crypto::parse_identity(pair.identity_text.text()));
  }
  trust_.add_own_authority(bytes_of(authority_.root_pem()), "the sample authority");
  authority_time = [](std::int64_t mono_ns) {
    return opened_at() +
           std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::nanoseconds(mono_ns));
  };
}

crypto::VerifierKey SampleArchive::device() const { return {kDeviceName, key_.public_key()}; }

void SampleArchive::clear() const {
  std::filesystem::remove_all(folder());
  std::filesystem::create_directory(folder());
}

// The authority's certificates are made now; its clock, and so the case, follows them.
UtcTime SampleArchive::opened_at() {
  static const UtcTime kOpened =
      std::chrono::time_point_cast<std::chrono::seconds>(utc_now()) + std::chrono::hours(1);
  return kOpened;
}

Moment SampleArchive::now() const {
  return {
      opened_at() + std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::nanoseconds(now_ns)),
      now_ns};
}

archive::VerifyOptions SampleArchive::options() const {
  archive::VerifyOptions options;
  options.devices = {device()};
  options.trust = &trust_;
  options.log = log_folder();
  options.threads = 2;
  return options;
}

Bytes SampleArchive::stamp(const std::string& note) {
  if (authority_answer) {
    return authority_answer(note, authority_time(now_ns));
  }
  // Set anew each time: one that follows any clock back, for the verifier to judge.
  authority_.set_clock([this] { return authority_time(now_ns); });
  const crypto::Sha256Digest imprint = crypto::sha256(bytes_of(note));
  return authority_.respond(
      timestamp::encode_request(timestamp::make_request(crypto::HashAlgorithm::kSha256, imprint)));
}

archive::TokenEntry SampleArchive::facts_of(ByteView response) {
  std::string explanation;
  const auto parsed = timestamp::parse_response(response, explanation);
  const auto info = parsed ? timestamp::parse_token_info(parsed->token, explanation) : std::nullopt;
  if (!info) {
    throw std::runtime_error("the sample authority gave no token: " + explanation);
  }
  archive::TokenEntry facts;
  facts.gen_time = info->gen_time;
  facts.accuracy_ns = info->accuracy_ns;
  facts.serial = info->serial;
  return facts;
}

SampleCase::SampleCase(SampleArchive& archive, bool log, archive::FileSystem& files) : archive_(&archive) {
  archive.now_ns = 0;
  if (log) {
    log_ =
        archive::ApplianceLog::open(files, archive.log_folder(), archive.key(), SampleArchive::kDeviceName);
  }
  archive::CaseWriter::Options options;
  options.archive = archive.folder();
  options.key = &archive.key();
  options.device_name = SampleArchive::kDeviceName;
  options.streams = {
      {"endoscope", "video", "video/mp2t", "/dev/video0", "mpeg2", "endoscope", {}, "arrival", ""},
      {"vitals", "vitals", "application/jsonl", "synthetic:patient", "jsonl", "monitor", {}, "arrival", ""}};
  options.stream_recipients = {archive.recipients(), archive.recipients()};
  options.subject = to_bytes("{\"patient\":\"sample\"}");
  options.subject_recipients = archive.recipients();
  options.boot_id = "00000000-0000-4000-8000-000000000000";
  options.log = log_.get();
  writer_ = archive::CaseWriter::create(files, options, archive.now());
  writer_->store_authority_chain(SampleArchive::kAuthorityName, {der_of(archive.authority().root_pem())});
}

SampleCase::~SampleCase() = default;

archive::SegmentEntry SampleCase::segment(std::size_t stream, std::uint64_t index, Span span) {
  constexpr std::size_t kVideoBytes = 70'000;  // two chunks
  constexpr std::size_t kVitalsBytes = 500;
  archive::SegmentEntry entry;
  const auto writer = writer_->begin_segment(stream, index);
  writer->write(noise(stream == 0 ? kVideoBytes : kVitalsBytes, index));
  writer->seal();
  entry.stream = stream == 0 ? "endoscope" : "vitals";
  entry.index = index;
  entry.file = writer->commit();
  entry.span = span;
  entry.first_pts = stream == 0 ? span.start_ns / 100'000 * 9 : span.start_ns;
  entry.time_base = stream == 0 ? "1/90000" : "1/1000000000";
  entry.frames = 50;
  entry.counts_samples = stream == 1;
  return entry;
}

void SampleCase::stamp() {
  const archive::StoredCheckpoint checkpoint = writer_->checkpoint(archive_->now(), true);
  archive_->now_ns += kRoundTrip / 2;
  const Bytes response = archive_->stamp(checkpoint.note);
  archive_->now_ns += kRoundTrip / 2;
  writer_->add_token(checkpoint, SampleArchive::kAuthorityName, response, SampleArchive::facts_of(response),
                     archive_->now());
}

void SampleCase::record() {
  stamp();
  writer_->append({archive::ClockEntry{true, 0, 1'000'000, 0}}, archive_->now());
  archive_->now_ns = 4 * kSecond;
  writer_->append({segment(0, 0, {0, 2 * kSecond}), segment(0, 1, {2 * kSecond, 4 * kSecond})},
                  archive_->now());
  writer_->append({archive::MarkEntry{crypto::sha256(bytes_of("mark"))}}, archive_->now());
  archive_->now_ns = 5 * kSecond;
  stamp();
  archive_->now_ns = 6 * kSecond;
  writer_->append({segment(0, 2, {4 * kSecond, 6 * kSecond}), segment(1, 0, {0, 6 * kSecond})},
                  archive_->now());
}

void SampleCase::record_at_once() {
  constexpr std::int64_t kLongest = 10 * kSecond;
  std::uint64_t index = 0;
  for (std::int64_t start_ns = 0; start_ns < archive_->now_ns; start_ns += kLongest, ++index) {
    const archive::Span span{start_ns, std::min(start_ns + kLongest, archive_->now_ns)};
    writer_->append({segment(0, index, span), segment(1, index, span)}, archive_->now());
  }
}

void SampleCase::close() {
  archive_->now_ns = std::max(archive_->now_ns, 7 * kSecond);
  writer_->close("operator", archive_->now());
  stamp();
  writer_->finish(archive_->now());
}

std::filesystem::path SampleCase::write(SampleArchive& archive) {
  SampleCase sample(archive);
  sample.record();
  sample.close();
  return sample.folder();
}

}  // namespace kiroku::test
