#include "archive/verify/log_proof.h"

#include <algorithm>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "crypto/merkle_tree.h"
#include "crypto/note_format.h"

namespace kiroku::archive {

Bytes LogProofExtra::to_bytes() const {
  Bytes bytes;
  append(bytes, bytes_of(line));
  for (const crypto::Sha256Digest& hash : consistency) {
    if (bytes.size() == line.size()) append(bytes, bytes_of("\n"));
    append(bytes, hash);
  }
  return bytes;
}

// A line has no LF, so the first one ends it.
std::optional<LogProofExtra> LogProofExtra::parse(ByteView bytes) {
  const std::string_view text = text_of(bytes);
  const std::size_t end = std::min(text.find('\n'), text.size());
  if (end > kMaximumLineBytes) {
    return std::nullopt;
  }
  LogProofExtra extra{std::string(text.substr(0, end)), {}};
  if (end == text.size()) {
    return extra;
  }
  const ByteView hashes = bytes.subspan(end + 1);
  constexpr std::size_t kHash = std::tuple_size_v<crypto::Sha256Digest>;
  const std::size_t count = hashes.size() / kHash;
  if (count == 0 || hashes.size() % kHash != 0 || count > crypto::TlogProof::kMostHashes) {
    return std::nullopt;
  }
  for (std::size_t i = 0; i < count; ++i) {
    crypto::Sha256Digest hash{};
    std::ranges::copy(hashes.subspan(i * kHash, kHash), hash.begin());
    extra.consistency.push_back(hash);
  }
  return extra;
}

namespace {

/// The checkpoint over an entry alone and those before it was signed while it was the newest. A later one is
/// over whatever stood there: a recorder of before signed over lines of others, too.
std::string words_of_signing(const crypto::Checkpoint& checkpoint, std::uint64_t entry) {
  return checkpoint.size == entry + 1
             ? ". The device signed that entry before another followed"
             : ". Only the log shows whether the device signed that entry before another followed, and "
               "under whose name it stood";
}

}  // namespace

LogProof::LogProof(const VerifyOptions& options, FindingList& findings) : findings_(&findings) {
  if (options.log_proof) {
    judge(*options.log_proof, options.devices);
  } else {
    answered_ = true;
  }
}

void LogProof::judge(const OutsideNote& given, const std::vector<crypto::VerifierKey>& devices) {
  name_ = given.name;
  crypto::ParsedTlogProof parsed = crypto::parse_tlog_proof(given.text);
  if (!parsed.proof) {
    return refuse("it is no tlog-proof: " + parsed.why);
  }
  const std::optional<LogProofExtra> extra =
      parsed.proof->extra ? LogProofExtra::parse(*parsed.proof->extra) : std::nullopt;
  const LogEntryParse entry = extra ? parse_log_entry(extra->line) : LogEntryParse{};
  if (!entry.entry || !std::holds_alternative<CaseClosedEntry>(entry.entry->body)) {
    return refuse("its extra data is not the line of a log that says how a case ended");
  }
  // A device speaks for its own log: which one the proof is of, the checkpoint's origin says.
  const auto checkpoint = crypto::Checkpoint::parse(crypto::open_note(parsed.proof->note, {}).text);
  std::vector<crypto::VerifierKey> keys;
  std::ranges::copy_if(devices, std::back_inserter(keys), [&](const crypto::VerifierKey& device) {
    return checkpoint && checkpoint->origin == log_origin(device.name());
  });
  if (!checkpoint) {
    return refuse("it holds no checkpoint of an appliance log");
  }
  const crypto::VerifiedTlogProof verified =
      crypto::verify_tlog_proof(*parsed.proof, bytes_of(extra->line), keys, checkpoint->origin);
  if (!verified.checkpoint) {
    return refuse(verified.unknown_signer
                      ? "no trusted device signed its checkpoint of \"" + printable(checkpoint->origin) +
                            "\", and anybody can write such a proof"
                      : verified.why);
  }
  if (entry.entry->seq != parsed.proof->index) {
    return refuse("the entry says that it is number " + std::to_string(entry.entry->seq) +
                  " of the log, and the proof is of number " + std::to_string(parsed.proof->index));
  }
  entry_ = std::get<CaseClosedEntry>(entry.entry->body);
  checkpoint_ = verified.checkpoint;
  signers_ = verified.signers;
  consistency_ = extra->consistency;
  proof_ = std::move(parsed.proof);
}

void LogProof::refuse(const std::string& why) {
  answered_ = true;
  findings_->add("log-proof-not-used", {}, name_ + " was not used: " + why);
}

void LogProof::reached(std::uint64_t size, const RootTest& fits) {
  if (entry_ && size == entry_->size) {
    root_fits_ = fits(entry_->root);
  }
}

bool LogProof::is_of(const OfCase& of) {
  if (entry_->case_id != of.id) {
    refuse("it is of case " + entry_->case_id);
    return false;
  }
  // Another device's key, which the verifier trusts for that one's cases, must neither accuse nor vouch.
  if (!of.device || checkpoint_->origin != log_origin(of.device->name())) {
    refuse("it is of the log \"" + printable(checkpoint_->origin) +
           "\", which is not that of the case's device");
    return false;
  }
  if (std::ranges::find(signers_, *of.device) == signers_.end()) {
    refuse("another trusted key of the name " + printable(of.device->name()) + ", " +
           printable(signers_.front().to_string()) +
           ", signed its checkpoint: it is of another device's log than that of the case's");
    return false;
  }
  signer_ = known_device(*of.device, signers_);
  return true;
}

EntriesBy LogProof::vouched_by(EntriesBy known) const {
  if (proved_ && proved_->signer.ml_dsa()) known.ml_dsa = std::max(known.ml_dsa, proved_->entries);
  return known;
}

void LogProof::hold(std::uint64_t entries, const std::string& of_what) {
  proved_ = Proved{name_, proof_->index, entries, *entry_, *checkpoint_, proof_->note, *signer_};
  findings_->add("log-proof-holds", {},
                 name_ + " holds: entry " + std::to_string(proof_->index) +
                     " of the appliance log says that the case ended with " +
                     counted(entry_->size, "entry", "entries") + ", " + of_what +
                     ". The device signed the log's first " + counted(checkpoint_->size, "entry", "entries") +
                     words_of_signing(*checkpoint_, proof_->index));
}

void LogProof::finish(const OfCase& of, std::uint64_t entries, bool read) {
  if (std::exchange(answered_, true) || !is_of(of)) {
    return;
  }
  if (root_fits_ == true) {
    return hold(entry_->size, "and these are the ones that are here");
  }
  if (root_fits_ == false) {
    findings_->add("log-proof-differs", {std::string(kLedgerFile), entry_->size - 1},
                   "the first " + counted(entry_->size, "entry", "entries") +
                       " are not those with which, by " + name_ +
                       ", the case ended: the device signed another history of it" +
                       words_of_signing(*checkpoint_, proof_->index));
  } else if (read && entries < entry_->size) {
    findings_->add("log-proof-differs", {std::string(kLedgerFile), entries},
                   "by " + name_ + " the case ended with " + counted(entry_->size, "entry", "entries") +
                       ", and there are " + std::to_string(entries) + ": the end of the ledger was removed" +
                       words_of_signing(*checkpoint_, proof_->index));
  } else {
    refuse("what is here does not show the root of " + counted(entry_->size, "entry", "entries"));
  }
}

void LogProof::finish_part(const OfCase& of, std::uint64_t size,
                           const std::optional<crypto::Sha256Digest>& root) {
  if (std::exchange(answered_, true) || !is_of(of)) {
    return;
  }
  if (!root) {
    return refuse("the excerpt shows no root of its case");
  }
  const std::uint64_t end = entry_->size;
  const bool leads = size <= end ? crypto::verify_consistency(size, *root, end, entry_->root, consistency_)
                                 : crypto::verify_consistency(end, entry_->root, size, *root, consistency_);
  if (leads) {
    return hold(std::min(size, end),
                size <= end ? "and the first " + std::to_string(size) + " of them are those of the excerpt"
                            : "with which the excerpt's case begins");
  }
  // A wrong path shows nothing, whoever made it. Another root of the very same size is a statement.
  if (size == end && *root != entry_->root) {
    findings_->add("log-proof-differs", {},
                   "the excerpt is not of the case that, by " + name_ + ", ended with " +
                       counted(end, "entry", "entries") + ": the device signed two histories of it" +
                       words_of_signing(*checkpoint_, proof_->index));
    return;
  }
  refuse(consistency_.empty()
             ? "it says nothing of this excerpt: 'kiroku log prove' makes one of the excerpt's folder"
             : "its extra data does not lead from the excerpt's entries to the case's end");
}

}  // namespace kiroku::archive
