#include "crypto/tlog_proof.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include "crypto/cosignature.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "crypto/note_format.h"
#include "crypto/note_signers.h"

namespace kiroku::crypto {
namespace {

constexpr std::string_view kFirstLine = "c2sp.org/tlog-proof@v1";
constexpr std::string_view kExtra = "extra ";
constexpr std::string_view kIndex = "index ";

std::optional<std::uint64_t> decimal(std::string_view text) {
  std::uint64_t number = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool is_whole = failure == std::errc() && end == text.data() + text.size();
  return is_whole && (text.size() == 1 || text.front() != '0') ? std::optional(number) : std::nullopt;
}

}  // namespace

std::string TlogProof::to_text() const {
  std::string text = std::string(kFirstLine) + "\n";
  if (extra) text += std::string(kExtra) + to_base64(*extra, Base64Padding::kPadded) + "\n";
  text += std::string(kIndex) + std::to_string(index) + "\n";
  for (const Sha256Digest& hash : path) text += to_base64(hash, Base64Padding::kPadded) + "\n";
  return text + "\n" + note;
}

ParsedTlogProof parse_tlog_proof(std::string_view text) {
  std::size_t number = 0;
  const auto refuse = [&](const std::string& why) {
    return ParsedTlogProof{std::nullopt, "line " + std::to_string(number) + " " + why};
  };
  const auto next = [&] {
    ++number;
    return take_line(text);
  };
  if (text.size() > TlogProof::kMostBytes) return {std::nullopt, "it has more than 2 MiB"};
  TlogProof proof;
  auto line = next();
  if (line != kFirstLine) return refuse("is not '" + std::string(kFirstLine) + "'");
  line = next();
  if (line && line->starts_with(kExtra)) {
    proof.extra = from_base64(line->substr(kExtra.size()), Base64Padding::kPadded);
    if (!proof.extra) return refuse("has no base64 behind 'extra'");
    line = next();
  }
  if (!line || !line->starts_with(kIndex)) return refuse("is not 'index NUMBER'");
  const auto index = decimal(line->substr(kIndex.size()));
  if (!index) return refuse("has no number behind 'index'");
  proof.index = *index;
  for (;;) {
    line = next();
    if (!line) return refuse("is not there: an empty line and a checkpoint follow the hashes");
    if (line->empty()) break;
    const auto bytes = from_base64(*line, Base64Padding::kPadded);
    Sha256Digest hash{};
    if (!bytes || bytes->size() != hash.size()) return refuse("is no SHA-256 hash in base64");
    if (proof.path.size() == TlogProof::kMostHashes)
      return refuse("is one hash more than any tree's proof has");
    std::ranges::copy(*bytes, hash.begin());
    proof.path.push_back(hash);
  }
  if (text.empty()) {
    ++number;
    return refuse("is not there: a checkpoint follows the empty line");
  }
  proof.note = text;
  return {std::move(proof), {}};
}

VerifiedTlogProof verify_tlog_proof(const TlogProof& proof, ByteView entry,
                                    const std::vector<VerifierKey>& log_keys, std::string_view origin) {
  VerifiedTlogProof verified;
  const OpenedNote unjudged = open_note(proof.note, {});
  const auto checkpoint = parse_extended_checkpoint(unjudged.text);
  if (!checkpoint) {
    verified.why = "its checkpoint is none" + (unjudged.text.empty() ? ": " + unjudged.explanation : "");
    return verified;
  }
  if (checkpoint->origin != origin) {
    verified.why = "its checkpoint is of another log, \"" + checkpoint->origin + "\"";
    return verified;
  }
  const OpenedNote opened = open_note(proof.note, log_keys);
  if (opened.failure) {
    verified.unknown_signer = opened.failure == NoteFailure::kUnknownKey;
    verified.why = verified.unknown_signer ? "no key that was given for the log signed its checkpoint"
                                           : "its checkpoint does not hold: " + opened.explanation;
    return verified;
  }
  for (const std::size_t place : signers_among(proof.note, log_keys))
    verified.signers.push_back(log_keys[place]);
  if (proof.index >= checkpoint->size || !verify_inclusion(merkle_leaf_hash(entry), proof.index,
                                                           checkpoint->size, proof.path, checkpoint->root)) {
    verified.why = "its hashes do not lead from the entry to the checkpoint's root";
    return verified;
  }
  verified.checkpoint = checkpoint;
  verified.why.clear();
  return verified;
}

}  // namespace kiroku::crypto
