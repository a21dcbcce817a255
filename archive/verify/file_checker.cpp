#include "archive/verify/file_checker.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "archive/format/age_layout.h"
#include "archive/format/case_layout.h"
#include "archive/format/pointing_stream.h"
#include "archive/format/sealed_file.h"
#include "archive/verify/found_files.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "base/saturated_sum.h"
#include "crypto/age_file.h"
#include "crypto/secret.h"

namespace kiroku::archive {

namespace {

constexpr std::size_t kMostWaiting = 64;
constexpr std::uint64_t kProgressStep = 8U << 20U;

std::string digits(std::uint64_t number) { return std::to_string(number); }

}  // namespace

void report_unopened(FindingList& findings, const Place& place, const FileOpening& opening) {
  const std::string text = place.file + " " + opening.explanation;
  switch (opening.problem) {
    case FileProblem::kMissing:
      findings.add("file-missing", place, place.file + " is named by the ledger and " + opening.explanation);
      break;
    case FileProblem::kNotRegular:
      findings.add("file-not-regular", place, text + ", where a regular file must be");
      break;
    case FileProblem::kUnreadable:
      findings.add("file-unreadable", place, text + "; so it was not checked");
      break;
  }
}

FileChecker::FileChecker(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
                         std::uint64_t total_bytes)
    : folder_(&folder), options_(&options), findings_(&findings), total_bytes_(total_bytes) {
  if (options.identities != nullptr) {
    for (const auto& identity : *options.identities) {
      own_recipients_.insert(identity->recipient());
    }
    own_recipients_.erase("");
  }
  const unsigned count =
      options.threads > 0 ? options.threads : std::max(1U, std::thread::hardware_concurrency());
  for (unsigned i = 0; i < count; ++i) {
    workers_.emplace_back([this] { work(); });
  }
}

FileChecker::~FileChecker() {
  {
    const std::lock_guard lock(mutex_);
    no_more_ = true;
    waiting_.clear();
  }
  changed_.notify_all();
  for (std::thread& worker : workers_) {
    worker.join();
  }
}

void FileChecker::check(FileJob job) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return waiting_.size() < kMostWaiting || failure_; });
  if (failure_) {
    return;  // finish() tells
  }
  waiting_.push_back(std::move(job));
  lock.unlock();
  changed_.notify_all();
}

std::vector<MissingFile> FileChecker::finish() {
  {
    const std::lock_guard lock(mutex_);
    no_more_ = true;
  }
  changed_.notify_all();
  for (std::thread& worker : workers_) {
    worker.join();
  }
  workers_.clear();
  if (failure_) {
    std::rethrow_exception(failure_);
  }
  if (options_->progress) {
    options_->progress(total_bytes_, total_bytes_);
  }
  return std::exchange(missing_, {});
}

std::optional<OpenedContents> FileChecker::contents() const {
  return options_->identities == nullptr ? std::nullopt : std::optional(contents_);
}

void FileChecker::work() {
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !waiting_.empty() || no_more_ || failure_; });
    if (waiting_.empty() || failure_) {
      return;
    }
    const FileJob job = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    changed_.notify_all();
    try {
      check_one(job);
    } catch (...) {
      lock.lock();
      failure_ = std::current_exception();
      lock.unlock();
      changed_.notify_all();
      return;
    }
  }
}

void FileChecker::check_one(const FileJob& job) {
  const Place place{job.expected.file, job.entry};
  const FileOpening opening = folder_->open_file(job.expected.file);
  if (!opening.file) {
    if (opening.problem == FileProblem::kMissing) {
      const std::lock_guard lock(mutex_);
      missing_.push_back({job.expected.file, job.entry, job.stream, job.segment ? job.segment->index : 0});
    } else {
      report_unopened(*findings_, place, opening);
    }
    return;
  }
  try {
    const std::optional<Hashed> hashed = hash_file(job, *opening.file);
    if (!hashed) {
      return;
    }
    if (hashed->fits) {
      if (job.segment) count_held(job);
      judge_form(job, *opening.file);
    }
    if (job.segment && options_->identities != nullptr) {
      const crypto::HashedSource sealed(*opening.file, hashed->trail, job.expected.file, hashed->new_header);
      const std::optional<LookedInside> how_far = look_inside(job, sealed, *hashed);
      if (const auto changed = sealed.changed_at()) {
        report_changed(job, *changed);  // the inspector passed over it
      } else if (how_far) {
        const std::lock_guard lock(mutex_);
        ++contents_.opened;
        ++contents_.opened_of[job.segment->stream];
        contents_.decoded += *how_far == LookedInside::kDecoded ? 1U : 0U;
      }
    } else if (hashed->fits && !job.segment && options_->identities != nullptr &&
               age_form(*opening.file) == AgeForm::kHolding) {
      const crypto::HashedSource sealed(*opening.file, hashed->trail, job.expected.file, {});
      look_inside_subject(job, sealed);
    } else if (!hashed->fits) {
      findings_->add(
          "file-hash-differs", place,
          job.expected.file + " is not the file whose hash entry " + digits(job.entry) + " states");
    } else if (job.rekeyed) {
      report_rekeyed_unopened(job);
    }
  } catch (const crypto::SourceChanged& changed) {
    report_changed(job, changed.offset());
  } catch (const IoError& error) {
    findings_->add("file-unreadable", place, std::string(error.what()) + "; so it was not checked");
  }
}

std::optional<FileChecker::Hashed> FileChecker::hash_file(const FileJob& job, const ReadableFile& file) {
  const Place place{job.expected.file, job.entry};
  Hashed hashed;
  crypto::HashBegin begin;
  std::uint64_t size = file.size();
  if (job.rekeyed) {
    // What the ledger hashed is the original header and the payload behind the new one.
    const FileOpening header = folder_->open_file(job.expected.file + std::string(kOriginalHeaderSuffix));
    if (!header.file) {
      report_unopened(*findings_, {job.expected.file + std::string(kOriginalHeaderSuffix), job.entry},
                      header);
      return std::nullopt;
    }
    const std::optional<std::string> original = read_small(*header.file, kMaximumAgeHeaderBytes);
    std::optional<Bytes> new_header = age_header_text(file);
    if (!original || !new_header || !is_age_header(*original) || !is_age_header(text_of(*new_header))) {
      findings_->add("file-hash-differs", place,
                     job.expected.file + " or the header beside it is no age file");
      return std::nullopt;
    }
    hashed.original_header = to_bytes(*original);
    hashed.new_header = std::move(*new_header);
    begin.before = hashed.original_header;
    begin.offset = hashed.new_header.size();
    size = size - begin.offset + hashed.original_header.size();
  }
  if (size != job.expected.bytes) {
    findings_->add("file-size-differs", place,
                   job.expected.file + " has " + digits(size) + " bytes where entry " + digits(job.entry) +
                       " states " + digits(job.expected.bytes));
    report_progress(file.size());
    return std::nullopt;
  }
  if (!may_be_read(job, file)) {
    report_progress(file.size());
    return std::nullopt;
  }
  std::vector<crypto::Hasher> further;
  for (std::size_t i = 0; !job.rekeyed && i < further_.size(); ++i) {
    further.emplace_back(further_[i]);
  }
  file.expect_sequential_reading();
  hashed.trail = std::make_shared<const crypto::HashTrail>(crypto::HashTrail::of(
      file, begin, [this](std::uint64_t more) { report_progress(more); }, further));
  hashed.fits = hashed.trail->digest() == job.expected.sha256;
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; hashed.fits && i < further.size(); ++i) {
    further_hashes_.emplace(std::pair(job.expected.file, further_[i]), further[i].so_far());
  }
  ++files_;
  bytes_ += hashed.trail->end();
  return hashed;
}

// Whoever holds no key sees a hash that fits, and believes that something can be opened.
void FileChecker::judge_form(const FileJob& job, const ReadableFile& file) {
  const Place place{job.expected.file, job.entry};
  if (!job.segment) {
    if (age_form(file) != AgeForm::kHolding) {
      findings_->add("subject-not-sealed", place,
                     job.expected.file +
                         " is no sealed (age) file with anything in it: what it has of the "
                         "patient anybody can read, or nobody");
    }
    return;
  }
  const SegmentEntry& segment = *job.segment;
  const auto told = [&](const std::string& why) {
    findings_->add("segment-not-sealed", place, job.expected.file + " is no sealed (age) file " + why);
  };
  if (segment.complete && !segment.counted) {
    if (!may_be_found_complete(file, *job.stream)) told("as one is that recovery can have found complete");
  } else if (segment.counted && segment.frames > 0) {
    // Whoever counted what is in one that was cut off saw it begin.
    const AgeForm form = age_form(file);
    if (form != AgeForm::kHolding && (segment.complete || form == AgeForm::kNone)) {
      told("with anything in it, and its entry states " + digits(segment.frames) +
           " frames or samples: no key can open it");
    }
  } else if (segment.complete) {
    const AgeForm form = age_form(file);
    if (form != AgeForm::kHolding && form != AgeForm::kEmpty) told("that anybody sealed: no key can open it");
  }
}

// A file that takes no room on a disk can be as long as one likes, and so can one file under many names: what
// is read must have been written by whoever made the folder.
bool FileChecker::may_be_read(const FileJob& job, const ReadableFile& file) {
  Place place{job.expected.file, job.entry};
  if (file.size() > kMaximumSealedBytes) {
    findings_->add(
        "file-too-large", place,
        job.expected.file + " has " + digits(file.size()) + " bytes, more than 1 GiB: it was not read");
    return false;
  }
  if (const auto inode = file.shared_inode()) {
    const std::lock_guard lock(mutex_);
    if (!shared_inodes_.insert(*inode).second) {
      findings_->add(
          "file-not-regular", place,
          job.expected.file + " is a second name of another file of the case: it was not read again");
      return false;
    }
  }
  const std::optional<std::uint64_t> hole = file.first_hole();
  if (!hole) {
    return true;
  }
  const bool was_sealed = !job.segment || !may_have_holes(*job.segment);
  if (!was_sealed) {
    const std::uint64_t bytes = file.hole_bytes();
    const std::lock_guard lock(mutex_);
    if (bytes <= left_in_holes_) {
      left_in_holes_ -= bytes;
      return true;
    }
  }
  place.offset = hole;
  findings_->add(
      "file-has-hole", place,
      job.expected.file + " has a hole from byte " + digits(*hole) +
          (was_sealed ? " on, where no recorder leaves one: it was not read"
                      : " on, and there are more of them than a power cut leaves: it was not read"));
  return false;
}

FileChecker::Opened FileChecker::try_opening(const FileJob& job, const crypto::HashedSource& sealed,
                                             bool intact, EventLines* lines) const {
  Opened opened;
  try {
    // A damaged file is read as far as it goes, to say where the damage begins.
    const bool whole = intact && job.segment->complete;
    const crypto::AgeFile file = crypto::AgeFile::open(
        sealed, *options_->identities, whole ? crypto::Truncation::kRefuse : crypto::Truncation::kTolerate);
    opened.header = file.header_size();
    file.read_all([&](ByteView piece) {
      opened.plaintext += piece.size();
      if (lines != nullptr) lines->add(piece);
    });
    opened.unreadable = file.unreadable_size();
    const bool whole_chunk_is_bad = opened.unreadable >= kAgeChunkBytes + kAgeTagBytes;
    if (intact && whole_chunk_is_bad && !was_found_cut_off(*job.segment)) {
      opened.failure.emplace(crypto::AgeFailure::kPayloadDamaged,
                             "chunk " + digits(opened.plaintext / kAgeChunkBytes) + " does not authenticate");
    }
    if (!intact && file.is_truncated()) {
      opened.failure.emplace(crypto::AgeFailure::kTruncated, "its last chunk does not decrypt");
    }
  } catch (const crypto::AgeError& error) {
    opened.failure = error;
  }
  return opened;
}

void FileChecker::report_damage(const FileJob& job, const Opened& opened) {
  Place where{job.expected.file, job.entry};
  std::string text = job.expected.file + " is not the file whose hash entry " + digits(job.entry) + " states";
  if (opened.failure && opened.header > 0) {
    const std::uint64_t chunk = opened.plaintext / kAgeChunkBytes;
    where.offset = opened.header + kAgeNonceBytes + chunk * (kAgeChunkBytes + kAgeTagBytes);
    text +=
        ": the 64 KiB chunk " + digits(chunk) + ", at byte " + digits(*where.offset) + ", does not decrypt";
  } else if (opened.failure) {
    where.offset = 0;
    text += ": " + std::string(opened.failure->what());
  } else {
    text += ", yet it decrypts: somebody who knows a recipient made it";
  }
  findings_->add("file-hash-differs", where, text);
}

std::optional<FileChecker::LookedInside> FileChecker::look_inside(const FileJob& job,
                                                                  const crypto::HashedSource& sealed,
                                                                  const Hashed& hashed) {
  const Place place{job.expected.file, job.entry};
  const bool is_of_events = marks_ != nullptr && holds_marks(*job.stream);
  EventLines lines;
  const Opened opened = try_opening(job, sealed, hashed.fits, is_of_events ? &lines : nullptr);
  if (!hashed.fits) {
    report_damage(job, opened);
    return std::nullopt;
  }
  const auto failed_with = [&](crypto::AgeFailure what) {
    return opened.failure && opened.failure->failure() == what;
  };
  if (failed_with(crypto::AgeFailure::kNoMatch)) {
    report_not_decrypted(job);
    return std::nullopt;
  }
  if (job.rekeyed && !new_header_fits(hashed)) {
    findings_->add("rekeyed-key-differs", place,
                   "the new header of " + job.expected.file +
                       " yields another key than the original one: it would open to another film");
    return std::nullopt;
  }
  if (job.rekeyed) {
    const std::lock_guard lock(mutex_);
    ++rekeyed_opened_;
  }
  if (was_found_cut_off(*job.segment) && (opened.failure || opened.unreadable > 0)) {
    report_lost_part(job, opened);
    if (opened.failure) {
      return std::nullopt;
    }
  }
  if (opened.failure) {
    // A power cut can leave less than a header; that it was cut off is said already.
    const bool cut_in_header = !job.segment->complete && (failed_with(crypto::AgeFailure::kHeaderMalformed) ||
                                                          failed_with(crypto::AgeFailure::kTruncated));
    if (!cut_in_header) {
      findings_->add("segment-undecryptable", place,
                     job.expected.file + " does not decrypt: " + opened.failure->what());
    }
    return std::nullopt;
  }
  if (is_of_events) {
    if (job.segment->complete) lines.end();
    marks_->take_lines(lines, job.expected.file);
  }
  if (!options_->inspect) {
    return LookedInside::kDecrypted;
  }
  if (const auto problem = options_->inspect(*job.stream, *job.segment, sealed, *options_->identities)) {
    const std::string text = job.expected.file + ": " + problem->text;
    if (problem->is_late) {
      findings_->add("segment-times-late", place, text);
    } else {
      findings_->add("segment-undecodable", place, text);
    }
    return LookedInside::kDecrypted;
  }
  // Of others nobody states how many frames must come out of them.
  return job.segment->complete && job.segment->counted ? LookedInside::kDecoded : LookedInside::kDecrypted;
}

// The ledger does not say for whom it is sealed: of a case that is carried on it is that of the one before.
void FileChecker::look_inside_subject(const FileJob& job, const crypto::HashedSource& sealed) {
  const Place place{job.expected.file, job.entry};
  Bytes plain;
  bool is_too_long = false;
  try {
    const crypto::AgeFile file = crypto::AgeFile::open(sealed, *options_->identities);
    is_too_long = file.plaintext_size() > kMaximumSubjectBytes;
    file.read_all([&](ByteView piece) {
      if (!is_too_long) plain.insert(plain.end(), piece.begin(), piece.end());
    });
  } catch (const crypto::AgeError& error) {
    crypto::zeroise(plain);
    if (error.failure() == crypto::AgeFailure::kNoMatch) {
      findings_->add("subject-not-decrypted", place,
                     job.expected.file + " was not opened: no identity given is a recipient of it");
    } else {
      findings_->add("subject-undecryptable", place,
                     job.expected.file + " does not decrypt: " + error.what());
    }
    return;
  }
  const bool is_object = !is_too_long && parse_foreign_json(text_of(plain)).is_object();
  crypto::zeroise(plain);
  if (is_too_long) {
    findings_->add("subject-undecodable", place,
                   job.expected.file + " opens to more than " + digits(kMaximumSubjectBytes) +
                       " bytes: it was not looked at");
  } else if (!is_object) {
    findings_->add(
        "subject-undecodable", place,
        job.expected.file + " opens, and holds no JSON object: of whom the case is nobody can read");
  }
}

// The hash fits, so this is what recovery found and signed without a key, and the ledger says so: what does
// not open was lost with the power, or changed before recovery came. Nobody claimed that it opens.
void FileChecker::report_lost_part(const FileJob& job, const Opened& opened) {
  const SegmentEntry& segment = *job.segment;
  Place where{job.expected.file, job.entry};
  std::string what =
      "nothing of " + job.expected.file + ", " + digits(job.expected.bytes) + " bytes, can be opened";
  if (!opened.failure) {
    where.offset = job.expected.bytes - opened.unreadable;
    what = "of the " + digits(job.expected.bytes) + " bytes of " + job.expected.file + " the last " +
           digits(opened.unreadable) + " cannot be opened, from byte " + digits(*where.offset) + " on";
  }
  constexpr std::int64_t kNsPerMs = 1'000'000;
  findings_->add("segment-part-lost", where,
                 what +
                     ": they had not reached the disk when recording was cut off. By the ledger's estimate "
                     "the segment reaches from " +
                     std::to_string(segment.span.start_ns / kNsPerMs) + " ms to " +
                     std::to_string(segment.span.end_ns / kNsPerMs) + " ms");
}

void FileChecker::report_not_decrypted(const FileJob& job) {
  if (job.rekeyed) {
    report_rekeyed_unopened(job);
    return;
  }
  const std::vector<std::string>& named = job.stream->recipients;
  const auto mine = std::ranges::find_if(
      named, [this](const std::string& recipient) { return own_recipients_.contains(recipient); });
  if (mine != named.end()) {
    findings_->add("segment-not-for-recipient", {job.expected.file, job.entry},
                   job.expected.file + " does not open with the identity of " + shortened(*mine) +
                       ", for whom open says that " + job.segment->stream + " is sealed");
    return;
  }
  const std::lock_guard lock(mutex_);
  if (streams_not_decrypted_.insert(job.segment->stream).second) {
    findings_->add(
        "segment-not-decrypted", {job.expected.file, job.entry},
        "the segments of " + job.segment->stream + " were not decrypted: no identity given is a recipient");
  }
}

void FileChecker::count_held(const FileJob& job) {
  const SegmentEntry& segment = *job.segment;
  const std::lock_guard lock(mutex_);
  rekeyed_ += job.rekeyed ? 1U : 0U;
  const auto [entry, first] = held_.try_emplace(segment.stream);
  HeldSegments& held = entry->second;
  held.span.start_ns = first ? segment.span.start_ns : std::min(held.span.start_ns, segment.span.start_ns);
  held.span.end_ns = std::max(first ? segment.span.end_ns : held.span.end_ns, segment.span.end_ns);
  ++held.segments;
  ++contents_.segments;
  held.frames = saturated_sum(held.frames, segment.frames);
  held.dropped = saturated_sum(held.dropped, segment.dropped);
  held.bytes = saturated_sum(held.bytes, segment.file.bytes);
}

bool FileChecker::new_header_fits(const Hashed& hashed) const {
  const auto opened_by = crypto::memory_source(hashed.new_header);
  try {
    return crypto::same_file_key(*opened_by, hashed.original_header, *options_->identities);
  } catch (const crypto::AgeError&) {
    return false;  // one of the headers yields no key at all
  }
}

void FileChecker::report_changed(const FileJob& job, std::uint64_t offset) {
  Place place{job.expected.file, job.entry};
  place.offset = offset;
  findings_->add("file-hash-differs", place,
                 job.expected.file + " changed while it was checked: what stands from byte " +
                     digits(offset) + " on was not hashed, so it is not what entry " + digits(job.entry) +
                     " states");
}

void FileChecker::report_rekeyed_unopened(const FileJob& job) {
  findings_->add(
      "rekeyed-not-opened", {job.expected.file, job.entry},
      job.expected.file +
          " was re-keyed for a new reader; verify with the reader's identity to prove that it opens "
          "to the film that was recorded");
}

void FileChecker::report_progress(std::uint64_t more) {
  if (!options_->progress) {
    return;
  }
  const std::lock_guard lock(progress_mutex_);
  const std::uint64_t before = progress_bytes_ / kProgressStep;
  progress_bytes_ += more;
  if (progress_bytes_ / kProgressStep != before) {
    options_->progress(std::min(progress_bytes_, total_bytes_), total_bytes_);
  }
}

}  // namespace kiroku::archive
