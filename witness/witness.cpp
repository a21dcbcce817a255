#include "witness/witness.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "crypto/merkle_tree.h"
#include "crypto/note_format.h"
#include "witness/submission.h"

namespace kiroku::witness {
namespace {

Answer refuse(int status, std::string why) {
  return {status, "text/plain; charset=utf-8", std::move(why) + "\n"};
}

Answer other_size(std::uint64_t size) { return {409, "text/x.tlog.size", std::to_string(size) + "\n"}; }

/// Whether the checkpoint goes on from what is known of the log.
bool is_consistent(const Submission& submission, const std::optional<Latest>& latest) {
  const crypto::Checkpoint& next = submission.checkpoint;
  if (next.size == 0 && next.root != crypto::MerkleFrontier().root()) return false;
  if (submission.old_size == 0) return submission.proof.empty();
  return crypto::verify_consistency(latest->size, latest->root, next.size, next.root, submission.proof);
}

/// The checkpoint with those of its signature lines that are of the log's known keys: all others are ignored.
std::string note_of_log(const Submission& submission, const KnownLog& log) {
  std::string note = submission.text + "\n";
  for (const crypto::SignatureLine& line : crypto::parse_note(submission.note).lines) {
    const bool of_log = std::ranges::any_of(log.keys, [&](const crypto::VerifierKey& key) {
      return key.name() == line.name && key.key_id() == line.key_id;
    });
    if (of_log) note += crypto::signature_line(line.name, line.key_id, line.signature);
  }
  return note;
}

/// The witness's line on what it cosigned less than a minute ago, if that is asked for again: whoever saw a
/// checkpoint can ask without end, and each answer would cost a signature and a flush of the disk.
std::optional<std::string> recent_cosignature(const Submission& submission, const Latest& latest,
                                              const crypto::CosignerKey& cosigner, std::uint64_t now_s) {
  constexpr std::uint64_t kRecentS = 60;
  const crypto::NoteParts kept = crypto::parse_note(latest.note);
  if (kept.text != submission.text) return std::nullopt;
  const crypto::CosignatureCheck check = crypto::check_cosignature(kept, cosigner);
  if (check.state != crypto::CosignatureCheck::State::kValid) return std::nullopt;
  if (check.time_s > now_s || now_s - check.time_s >= kRecentS) return std::nullopt;
  const auto line = std::ranges::find_if(kept.lines, [&](const crypto::SignatureLine& each) {
    return each.name == cosigner.name() && each.key_id == cosigner.key_id();
  });
  return crypto::signature_line(line->name, line->key_id, line->signature);
}

}  // namespace

Witness::Witness(Store& store, const std::string& name, const crypto::CosigningKey& key, const Clock& time)
    : store_(store), key_(key), public_key_(key.public_key(name)), time_(time) {}

Answer Witness::add_checkpoint(std::string_view body) {
  const ParsedSubmission parsed = parse_submission(body);
  if (!parsed.submission) return refuse(400, "this is no checkpoint to be cosigned: " + parsed.why);
  const Submission& submission = *parsed.submission;
  const crypto::Checkpoint& next = submission.checkpoint;
  const std::optional<KnownLog> log = store_.log(next.origin);
  if (!log) return refuse(404, "the log is unknown here; ask the witness's operator to take it in");
  const std::string note = note_of_log(submission, *log);
  const crypto::OpenedNote opened = crypto::open_note(note, log->keys);
  if (opened.failure) {
    const bool is_signed = opened.failure == crypto::NoteFailure::kBadSignature;
    return refuse(403, is_signed ? "the log's signature does not hold: " + opened.explanation
                                 : "no key of the log signed the checkpoint");
  }
  if (public_key_.algorithm() == crypto::CosignatureAlgorithm::kMlDsa44 &&
      !crypto::can_cosign_by_ml_dsa(submission.text))
    return refuse(400,
                  "the log's name has more than 255 bytes, which a cosignature by ML-DSA-44 cannot state");
  if (submission.old_size > next.size) return refuse(400, "the old size is larger than the checkpoint's");
  const std::uint64_t known_size = log->latest ? log->latest->size : 0;
  if (submission.old_size != known_size) return other_size(known_size);
  if (!is_consistent(submission, log->latest))
    return refuse(422, "the checkpoint does not go on from the one of size " + std::to_string(known_size) +
                           ": the consistency proof does not hold");
  const auto now = std::chrono::duration_cast<std::chrono::seconds>(time_.utc().time_since_epoch());
  const auto now_s = static_cast<std::uint64_t>(now.count());
  if (log->latest) {
    if (const auto recent = recent_cosignature(submission, *log->latest, public_key_, now_s))
      return {200, "text/plain; charset=utf-8", *recent};
  }
  const std::string cosignature = key_.cosign(submission.text, public_key_.name(), now_s);
  if (!store_.advance(next.origin, submission.old_size, {next.size, next.root, note + cosignature})) {
    // Somebody else's request came in between.
    const std::optional<KnownLog> changed = store_.log(next.origin);
    return other_size(changed && changed->latest ? changed->latest->size : 0);
  }
  return {200, "text/plain; charset=utf-8", cosignature};
}

Answer Witness::checkpoint(const std::string& origin_hash) const {
  const std::optional<KnownLog> log = store_.log_of_hash(origin_hash);
  if (!log || !log->latest) return refuse(404, "no checkpoint of this log was cosigned here");
  return {200, "text/plain; charset=utf-8", log->latest->note};
}

}  // namespace kiroku::witness
