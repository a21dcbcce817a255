// What a verification is given beside the folder: keys, anchors, the log, notes kept outside.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/file_reading.h"
#include "archive/format/ledger_entry.h"
#include "crypto/age_recipient.h"
#include "crypto/byte_source.h"
#include "crypto/signed_note.h"
#include "crypto/witness_policy.h"
#include "evidence/policy.h"
#include "timestamp/token_verifier.h"

namespace kiroku::archive {

/// What does not hold of a segment that decrypts.
struct InspectionProblem {
  std::string text;  // one sentence
  /// Its pictures are stamped later than a recorder stamps them, and an older one may have
  /// (archive/verify/segment_times.h): `segment-times-late`, not `segment-undecodable`.
  bool is_late = false;
};

/// Decrypts and looks at one segment: returns what does not decode to what the entry states. Only
/// bytes whose hash the entry states come out of `sealed`, which throws crypto::SourceChanged otherwise.
/// Given by the full program, which has decoders; the small verifier has none. Called from several threads.
using SegmentInspector = std::function<std::optional<InspectionProblem>(
    const StreamInfo&, const SegmentEntry&, const crypto::ByteSource& sealed, const crypto::AgeIdentities&)>;

/// A signed note that somebody kept outside what is verified, and what it is called in findings.
struct OutsideNote {
  std::string name, text;
};

/// An earlier copy of what is verified, that somebody kept outside: all checkpoints in it, as their texts
/// state them. Which of them is the newest no file's name says: whoever could write to the folder before it
/// was copied may have put an old one under a large number.
struct OutsideCopy {
  struct Note {
    std::string file;  // in the folder
    crypto::Checkpoint checkpoint;
  };
  std::filesystem::path folder;
  std::vector<Note> notes;   // by the size that their texts state; judged by nobody yet
  std::uint64_t others = 0;  // files in a checkpoint's place that are none, or state another size than named
  std::string first_other;
};

struct VerifyOptions {
  std::vector<crypto::VerifierKey> devices;  // trusted; empty: unproven
  const timestamp::TrustStore* trust = nullptr;
  std::optional<std::filesystem::path> log;  // appliance log folder
  std::vector<OutsideNote> against;          // of what is verified: notes of the case, or of the log
  std::vector<OutsideCopy> copies;           // likewise
  std::optional<OutsideNote> log_proof;      // a .tlog-proof of the case's end in the log
  /// Who must have cosigned the log's checkpoint that holds the case's entries; null: nobody is asked about.
  const crypto::WitnessPolicy* witnesses = nullptr;
  /// The case's evidence record, which then must hold; nothing: it is looked for beside the case's folder.
  std::optional<std::filesystem::path> evidence;
  /// Until when algorithms count; null: none ends.
  const evidence::Policy* policy = nullptr;
  std::optional<UtcTime> now;  // nothing: this machine's clock
  const crypto::AgeIdentities* identities = nullptr;
  SegmentInspector inspect;
  unsigned threads = 0;  // 0: one a core
  /// How the case's own folder is read, or the log's that is verified alone; null: as the operating system
  /// does. Must outlive the verification.
  const FileReading* files = nullptr;
  std::function<void(std::uint64_t done_bytes, std::uint64_t total_bytes)>
      progress;  // from any thread, serialised
};

}  // namespace kiroku::archive
