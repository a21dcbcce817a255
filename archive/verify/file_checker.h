// Checks files against what the ledger states of them, on several threads, while the ledger is still being
// walked. One thread gives the work; the callbacks of VerifyOptions are called from the workers.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/limits.h"
#include "archive/verify/case_data.h"
#include "archive/verify/event_marks.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"
#include "crypto/hashed_source.h"

namespace kiroku::archive {

/// One file to check.
struct FileJob {
  FileReference expected;
  std::uint64_t entry = 0;
  std::optional<SegmentEntry> segment;       // set for segments: they may be erased, decrypted, inspected
  std::shared_ptr<const StreamInfo> stream;  // of the segment; shared, since its texts can be long
  bool rekeyed = false;                      // excerpt: the original age header lies beside as NAME.header
};

/// A file that is not there.
struct MissingFile {
  std::string file;
  std::uint64_t entry = 0;
  std::shared_ptr<const StreamInfo> stream;  // of a segment
  std::uint64_t index = 0;                   // likewise
};

/// Segments of one stream whose files have the hash that the ledger states.
struct HeldSegments {
  std::uint64_t segments = 0, frames = 0, dropped = 0, bytes = 0;
  Span span;  // from the first to the last
};

class FileChecker {
 public:
  /// Everything referred to must outlive the object. `total_bytes` is for progress only.
  FileChecker(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
              std::uint64_t total_bytes);
  FileChecker(const FileChecker&) = delete;
  FileChecker& operator=(const FileChecker&) = delete;
  ~FileChecker();

  /// Before the first check(): files are hashed under these too, in the pass in which they are checked.
  void also_hash(std::vector<crypto::HashAlgorithm> algorithms) { further_ = std::move(algorithms); }
  /// Before the first check(): is given the lines of events segments that are opened; must outlive the
  /// object.
  void compare_events(EventMarks& marks) { marks_ = &marks; }
  /// Hands over one file; waits while many are waiting already, so that memory stays bounded.
  void check(FileJob job);
  /// Waits for all work. Rethrows what a worker could not turn into a finding. Returns the files that are not
  /// there: whether that is a finding depends on `erased` entries that come later.
  std::vector<MissingFile> finish();

  [[nodiscard]] std::uint64_t files() const { return files_; }  // after finish()
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// After finish(): by stream. Of a stream without a single sound segment there is nothing.
  [[nodiscard]] const std::map<std::string, HeldSegments>& held() const { return held_; }
  /// After finish(): what also_hash() asked for, of the files that fit their entries and are not re-keyed.
  [[nodiscard]] const FileHashes& further_hashes() const { return further_hashes_; }
  /// After finish(): re-keyed segments whose original header and payload have the entry's hash, and those of
  /// them whose new header yields the same key.
  [[nodiscard]] std::uint64_t rekeyed() const { return rekeyed_; }
  [[nodiscard]] std::uint64_t rekeyed_opened() const { return rekeyed_opened_; }
  /// After finish(): nothing where no identity was given.
  [[nodiscard]] std::optional<OpenedContents> contents() const;

 private:
  /// One file after its bytes were hashed.
  struct Hashed {
    std::shared_ptr<const crypto::HashTrail> trail;
    bool fits = false;                  // the entry's hash
    Bytes original_header, new_header;  // of a re-keyed segment; the first was hashed in place of the second
  };
  /// How far a segment could be decrypted.
  struct Opened {
    std::optional<crypto::AgeError> failure;
    std::uint64_t header = 0;  // bytes; 0: not even the header
    std::uint64_t plaintext = 0;
    std::uint64_t unreadable = 0;  // bytes behind the last chunk that decrypts, where that may be
  };
  void work();
  void check_one(const FileJob& job);
  /// Nothing where it was not compared; a finding says why.
  std::optional<Hashed> hash_file(const FileJob& job, const ReadableFile& file);
  /// Whether reading it takes no longer than writing it took; else a finding says why not.
  bool may_be_read(const FileJob& job, const ReadableFile& file);
  Opened try_opening(const FileJob& job, const crypto::HashedSource& sealed, bool intact,
                     EventLines* lines) const;
  void report_lost_part(const FileJob& job, const Opened& opened);
  void report_damage(const FileJob& job, const Opened& opened);
  void report_not_decrypted(const FileJob& job);
  /// What a segment turned out to be: decrypted to the end; decoded to as many frames as its entry states.
  enum class LookedInside { kDecrypted, kDecoded };
  /// Decrypts what was hashed and no other bytes; throws crypto::SourceChanged. Nothing where it does not
  /// open.
  std::optional<LookedInside> look_inside(const FileJob& job, const crypto::HashedSource& sealed,
                                          const Hashed& hashed);
  /// Whether the subject, whose hash fits, opens to what a subject is.
  void look_inside_subject(const FileJob& job, const crypto::HashedSource& sealed);
  void report_changed(const FileJob& job, std::uint64_t offset);
  void report_rekeyed_unopened(const FileJob& job);
  void count_held(const FileJob& job);
  /// Whether a file that is said to be sealed has the form of what is, with as much in it as is said.
  void judge_form(const FileJob& job, const ReadableFile& file);
  bool new_header_fits(const Hashed& hashed) const;
  void report_progress(std::uint64_t more);

  const CaseFolder* folder_;
  const VerifyOptions* options_;
  FindingList* findings_;
  EventMarks* marks_ = nullptr;
  std::uint64_t total_bytes_;
  std::vector<crypto::HashAlgorithm> further_;  // unchanged once a worker has a file

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<FileJob> waiting_;
  bool no_more_ = false;
  std::exception_ptr failure_;
  std::vector<MissingFile> missing_;
  std::set<std::string> streams_not_decrypted_;
  std::set<std::string> own_recipients_;  // of the identities given; unchanged while workers run
  OpenedContents contents_;
  std::set<std::pair<std::uint64_t, std::uint64_t>> shared_inodes_;  // of files with several names
  std::uint64_t left_in_holes_ = kMostBytesInHoles;
  std::map<std::string, HeldSegments> held_;
  FileHashes further_hashes_;
  std::uint64_t files_ = 0;
  std::uint64_t bytes_ = 0;
  std::uint64_t rekeyed_ = 0, rekeyed_opened_ = 0;

  std::mutex progress_mutex_;
  std::uint64_t progress_bytes_ = 0;
  std::vector<std::thread> workers_;
};

/// Adds the finding for a file that could not be opened.
void report_unopened(FindingList& findings, const Place& place, const FileOpening& opening);

}  // namespace kiroku::archive
