#include "witness/submission.h"

#include <algorithm>
#include <charconv>

#include "crypto/cosignature.h"
#include "crypto/encoding.h"
#include "crypto/note_format.h"

namespace kiroku::witness {
namespace {

constexpr std::string_view kOld = "old ";

std::optional<std::uint64_t> parse_size(std::string_view text) {
  std::uint64_t size = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), size);
  if (failure != std::errc() || end != text.data() + text.size()) return std::nullopt;
  if (text.size() > 1 && text.front() == '0') return std::nullopt;
  return size;
}

}  // namespace

std::string Submission::to_text() const {
  std::string body = std::string(kOld) + std::to_string(old_size) + "\n";
  for (const crypto::Sha256Digest& hash : proof)
    body += crypto::to_base64(hash, crypto::Base64Padding::kPadded) + "\n";
  return body + "\n" + note;
}

ParsedSubmission parse_submission(std::string_view body) {
  const auto refuse = [](std::string why) { return ParsedSubmission{{}, std::move(why)}; };
  Submission submission;
  const auto first = crypto::take_line(body);
  if (!first || !first->starts_with(kOld)) return refuse("its first line is not 'old SIZE'");
  const auto old_size = parse_size(first->substr(kOld.size()));
  if (!old_size) return refuse("the old size is no number");
  submission.old_size = *old_size;
  for (;;) {
    const auto line = crypto::take_line(body);
    if (!line) return refuse("no empty line stands before a checkpoint");
    if (line->empty()) break;
    const auto bytes = crypto::from_base64(*line, crypto::Base64Padding::kPadded);
    crypto::Sha256Digest hash{};
    if (!bytes || bytes->size() != hash.size()) return refuse("a line of the proof is no hash in base64");
    if (submission.proof.size() == kMostProofLines) return refuse("the proof has more than 63 lines");
    std::ranges::copy(*bytes, hash.begin());
    submission.proof.push_back(hash);
  }
  submission.note = body;
  const crypto::NoteParts parts = crypto::parse_note(submission.note);
  if (!parts.why.empty()) return refuse("the checkpoint is no signed note: " + parts.why);
  submission.text = parts.text;
  const auto checkpoint = crypto::parse_extended_checkpoint(parts.text);
  if (!checkpoint) return refuse("the note is no checkpoint");
  submission.checkpoint = *checkpoint;
  return {std::move(submission), {}};
}

}  // namespace kiroku::witness
