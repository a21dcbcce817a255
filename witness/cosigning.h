// A log asks witnesses for cosignatures on its newest checkpoint. Used by one thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "crypto/merkle_tree.h"
#include "crypto/witness_policy.h"
#include "witness/submission.h"

namespace kiroku::witness {

/// A ledger as its witnesses are shown it: the hashes of its lines, and its newest checkpoint.
struct LogToShow {
  crypto::MerkleTree tree;
  std::string note;  // over the first checkpoint.size lines
  crypto::Checkpoint checkpoint;
  std::uint64_t behind = 0;     // lines that follow these
  std::uint64_t unsigned_ = 0;  // of them those that a checkpoint was to follow at once
  std::vector<std::string> others =
      {};  // files under larger numbers that are no checkpoints of this log; some
};
/// Of the folder of an appliance log. Its newest checkpoint is the one over the most lines that states the
/// size that its file's name does and that `device` signed for its log: whoever can write to the folder can
/// put any file under any number. kiroku::Error where there is none, a line cannot be read, or the checkpoint
/// is not of the lines.
LogToShow read_log_to_show(const std::filesystem::path& folder, const crypto::VerifierKey& device);

/// What the log has beyond what is shown of it, a sentence each; none where all of it is shown.
std::vector<std::string> words_of_rest(const LogToShow& log);
/// Whether more is beyond it than a recorder leaves that writes just now, or was stopped in between.
bool is_rest_unsigned(const LogToShow& log);

/// How a witness is reached: the body of a request to its add-checkpoint in, its answer out. Throws
/// kiroku::Error where there is none.
struct WitnessReply {
  long status = 0;
  std::string body;
};
using AskWitness = std::function<WitnessReply(const std::string& url, const std::string& body)>;
/// Over HTTP, by libcurl. Answers of more than 64 KiB are refused, redirects are not followed.
AskWitness ask_over_http(std::chrono::milliseconds time_limit = std::chrono::seconds(10));

/// What one witness said.
struct CosigningOutcome {
  std::string witness;  // its key's name
  std::string line;     // its signature line; empty where there is none
  std::string why;      // there is none, in half a sentence
};
/// Asks each witness of the policy that has an address; one that knows another size of the log is shown how
/// the log went on from there. A line counts only if it is that witness's cosignature.
std::vector<CosigningOutcome> cosign_log(const LogToShow& log, const crypto::WitnessPolicy& policy,
                                         const AskWitness& ask);
/// The log's note with the lines that came.
std::string cosigned_note(const LogToShow& log, const std::vector<CosigningOutcome>& outcomes);

}  // namespace kiroku::witness
