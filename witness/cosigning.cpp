#include "witness/cosigning.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "crypto/note_format.h"
#include "witness/http_exchange.h"

namespace kiroku::witness {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestAnswer = 64U << 10;
constexpr long kOk = 200, kConflict = 409;

/// Entries of these kinds wait for the next one, which is signed.
constexpr std::array<std::string_view, 8> kFollowedByNone{"boot",
                                                          "config-changed",
                                                          "device-ml-dsa-added",
                                                          "device-hardware-added",
                                                          "device-attestation-added",
                                                          "device-hardware-silent",
                                                          "recovered",
                                                          "damage-found"};

std::vector<std::uint64_t> sizes_in(const fs::path& folder) {
  return archive::note_sizes(archive::CaseFolder::open(folder).list());
}

/// A note that the device signed for its log, of the size that its file's name states; nothing: the file is
/// another. Throws kiroku::Error where it cannot be read.
std::optional<std::pair<std::string, crypto::Checkpoint>> own_note(const fs::path& folder, std::uint64_t size,
                                                                   const crypto::VerifierKey& device) {
  const std::string name = archive::note_path(size);
  const archive::FileOpening opening = archive::CaseFolder::open(folder).open_file(name);
  if (!opening.file && opening.problem == archive::FileProblem::kUnreadable)
    throw Error("cannot read " + (folder / name).string() + ": it " + opening.explanation);
  std::optional<std::string> text =
      opening.file ? archive::read_small(*opening.file, archive::kMaximumNoteBytes) : std::nullopt;
  if (!text) return std::nullopt;
  const crypto::OpenedNote opened = crypto::open_note(*text, {device});
  auto checkpoint = crypto::Checkpoint::parse(opened.text);
  const bool is_own = checkpoint && checkpoint->size == size &&
                      checkpoint->origin == archive::log_origin(device.name()) &&
                      crypto::is_signed_for_log(opened, device, size);
  if (!is_own) return std::nullopt;
  return std::pair(std::move(*text), std::move(*checkpoint));
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

LogToShow read_log_to_show(const fs::path& folder, const crypto::VerifierKey& device) {
  constexpr std::size_t kMostOthers = 3;
  // A recorder may go on meanwhile: what came since may be over lines that were not read.
  const std::vector<std::uint64_t> before = sizes_in(folder);
  if (before.empty())
    throw Error("the log in " + folder.string() + " has no checkpoint that could be cosigned");
  crypto::MerkleTree all;
  std::vector<std::uint64_t> to_be_followed;  // lines
  archive::for_each_log_line(folder, [&](const archive::LogLine& line) {
    all.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    if (std::ranges::find(kFollowedByNone, line.type) == kFollowedByNone.end())
      to_be_followed.push_back(line.seq);
  });
  std::vector<std::uint64_t> sizes = sizes_in(folder);
  std::erase_if(sizes, [&](std::uint64_t size) {
    return size > all.size() && !std::ranges::binary_search(before, size);
  });
  LogToShow log;
  std::ranges::reverse(sizes);
  for (const std::uint64_t size : sizes) {
    auto own = own_note(folder, size, device);
    if (!own) {
      if (log.others.size() < kMostOthers) log.others.push_back(archive::note_path(size));
      continue;
    }
    if (size > all.size() || all.root(size) != own->second.root) {
      throw Error(
          "the log in " + folder.string() +
          " is not the one that its newest checkpoint was signed of; 'kiroku log --verify' says more");
    }
    log.note = std::move(own->first);
    log.checkpoint = std::move(own->second);
    for (std::uint64_t i = 0; i < size; ++i) log.tree.append(all.leaf(i));
    log.behind = all.size() - size;
    log.unsigned_ =
        static_cast<std::uint64_t>(to_be_followed.end() - std::ranges::lower_bound(to_be_followed, size));
    return log;
  }
  // They may have been taken away while the log was read.
  throw Error("no checkpoint of the log in " + folder.string() + " is by " + printable(device.name()) +
              " for its log" + (log.others.empty() ? "" : ": " + log.others.front() + " is none") +
              "; 'kiroku log --verify' says more");
}

bool is_rest_unsigned(const LogToShow& log) { return log.unsigned_ > 1; }

std::vector<std::string> words_of_rest(const LogToShow& log) {
  std::vector<std::string> words;
  if (log.behind > 0) {
    words.push_back("The log goes on beyond that: " + counted(log.behind, "entry has", "entries have") +
                    " no checkpoint yet" +
                    (is_rest_unsigned(log) ? ", where one was to follow each. 'kiroku log --verify' says more"
                                           : std::string()) +
                    ".");
  }
  for (const std::string& other : log.others)
    words.push_back(other +
                    " in the log's folder is no checkpoint by this device over as many entries: it "
                    "was not taken. 'kiroku log --verify' says more.");
  return words;
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
