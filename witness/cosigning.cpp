#include "witness/cosigning.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/note_format.h"
#include "witness/http_exchange.h"

namespace kiroku::witness {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestAnswer = 64U << 10;
constexpr long kOk = 200, kConflict = 409;

/// The newest note of a log.
std::string newest_note(const fs::path& folder) {
  const archive::CaseFolder log = archive::CaseFolder::open(folder);
  const std::vector<std::uint64_t> sizes = archive::note_sizes(log.list());
  if (sizes.empty())
    throw Error("the log in " + folder.string() + " has no checkpoint that could be cosigned");
  const std::string name = archive::note_path(sizes.back());
  const archive::FileOpening opening = log.open_file(name);
  std::optional<std::string> text =
      opening.file ? archive::read_small(*opening.file, archive::kMaximumNoteBytes) : std::nullopt;
  if (!text) {
    throw Error("cannot read " + (folder / name).string() + ": it " +
                (opening.file ? "is far too long" : opening.explanation));
  }
  return *text;
}

/// The size that a witness says it knows.
std::optional<std::uint64_t> size_of(const std::string& body) {
  std::uint64_t size = 0;
  const auto [end, failure] = std::from_chars(body.data(), body.data() + body.size(), size);
  if (failure != std::errc() || end == body.data() || std::string_view(end) != "\n") return std::nullopt;
  return size;
}

std::string first_line(const std::string& body) {
  constexpr std::size_t kMost = 200;
  return printable(body.substr(0, std::min(body.find('\n'), kMost)));
}

Submission submission_from(const LogToShow& log, std::uint64_t old_size) {
  Submission submission;
  submission.old_size = old_size;
  submission.note = log.note;
  if (old_size > 0) submission.proof = log.tree.consistency_proof(old_size, log.checkpoint.size);
  return submission;
}

std::string url_of(const crypto::WitnessPolicy::Witness& witness) {
  return witness.url + (witness.url.ends_with('/') ? "" : "/") + "add-checkpoint";
}

/// The line of an answer that is this witness's cosignature on the note; "" where there is none. An answer
/// with a blank line would end the note's text elsewhere, and its lines would sign another text.
std::string cosignature_in(const std::string& answer, const std::string& note,
                           const crypto::CosignerKey& cosigner) {
  const crypto::NoteParts parts = crypto::parse_note(note + answer);
  if (parts.text != crypto::parse_note(note).text) return "";
  if (crypto::check_cosignature(parts, cosigner).state != crypto::CosignatureCheck::State::kValid) return "";
  const auto line = std::ranges::find_if(parts.lines, [&](const crypto::SignatureLine& each) {
    return each.name == cosigner.name() && each.key_id == cosigner.key_id();
  });
  return crypto::signature_line(line->name, line->key_id, line->signature);
}

/// Of one witness, which knows the log up to `known`.
CosigningOutcome outcome_of(const LogToShow& log, const crypto::WitnessPolicy::Witness& witness,
                            const AskWitness& ask) {
  CosigningOutcome outcome{witness.key.name(), {}, {}};
  std::uint64_t known = 0;
  // Asked with 0 first, it says what it knows; once more where somebody else asked in between.
  for (int tries = 0; tries < 3; ++tries) {
    const WitnessReply reply = ask(url_of(witness), submission_from(log, known).to_text());
    if (reply.status == kConflict) {
      const auto size = size_of(reply.body);
      if (!size) {
        outcome.why = "answered 409 without a size";
        return outcome;
      }
      if (*size > log.checkpoint.size) {
        outcome.why = "knows this log with " + std::to_string(*size) + " entries, and here are " +
                      std::to_string(log.checkpoint.size) +
                      ": this is a copy from before, or entries were taken away";
        return outcome;
      }
      known = *size;
      continue;
    }
    if (reply.status != kOk) {
      outcome.why = "answered " + std::to_string(reply.status) + ": " + first_line(reply.body);
      return outcome;
    }
    outcome.line = cosignature_in(reply.body, log.note, witness.key);
    if (outcome.line.empty()) outcome.why = "answered with something that is not its cosignature";
    return outcome;
  }
  outcome.why = "names another size each time it is asked";
  return outcome;
}

}  // namespace

LogToShow read_log_to_show(const fs::path& folder) {
  LogToShow log;
  log.note = newest_note(folder);
  const auto checkpoint = crypto::Checkpoint::parse(crypto::parse_note(log.note).text);
  if (!checkpoint) throw Error("the newest note of the log in " + folder.string() + " is no checkpoint");
  log.checkpoint = *checkpoint;
  archive::for_each_log_line(folder, [&](const archive::LogLine& line) {
    if (log.tree.size() < log.checkpoint.size) log.tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
  });
  if (log.tree.size() != log.checkpoint.size || log.tree.root(log.checkpoint.size) != log.checkpoint.root) {
    throw Error("the log in " + folder.string() +
                " is not the one that its newest checkpoint was signed of; 'kiroku log --verify' says more");
  }
  return log;
}

AskWitness ask_over_http(std::chrono::milliseconds time_limit) {
  return [time_limit](const std::string& url, const std::string& body) -> WitnessReply {
    HttpReply reply = HttpExchange(time_limit).post(url, body, kLargestAnswer);
    return {reply.status, std::move(reply.body)};
  };
}

std::vector<CosigningOutcome> cosign_log(const LogToShow& log, const crypto::WitnessPolicy& policy,
                                         const AskWitness& ask) {
  std::vector<CosigningOutcome> outcomes;
  for (const crypto::WitnessPolicy::Witness& witness : policy.witnesses()) {
    if (witness.url.empty()) continue;
    try {
      outcomes.push_back(outcome_of(log, witness, ask));
    } catch (const Error& error) {
      outcomes.push_back({witness.key.name(), {}, error.what()});
    }
  }
  return outcomes;
}

std::string cosigned_note(const LogToShow& log, const std::vector<CosigningOutcome>& outcomes) {
  std::string note = log.note;
  for (const CosigningOutcome& outcome : outcomes) note += outcome.line;
  return note;
}

}  // namespace kiroku::witness
