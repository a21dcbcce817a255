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
};
/// Of the folder of an appliance log. kiroku::Error where there is no checkpoint, a line cannot be read, or
/// the checkpoint is not of the lines.
LogToShow read_log_to_show(const std::filesystem::path& folder);

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
