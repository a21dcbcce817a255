// What a comparison stands on and who made it, as its document states it (docs/reference/format-plans.md,
// "Comparisons"). Apart from what compares, so that reading needs neither simulation nor OpenCV. Pure
// functions, thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::compare {

/// A file that takes part, by name and hash.
struct NamedFile {
  std::string role, name;
  std::uint64_t bytes = 0;
  crypto::Sha256Digest sha256{};
};

/// A case as it was when it was compared: its ledger's first entries. More may follow (late time-stamps).
struct CaseState {
  std::string case_id;
  std::uint64_t ledger_size = 0;
  crypto::Sha256Digest ledger_root{};
};
/// As it is now; of its first `size` entries where that is given, and then nothing if there are fewer.
/// kiroku::Error for a folder that is no case.
CaseState state_of(const std::filesystem::path& case_folder);
std::optional<crypto::Sha256Digest> root_of_first(const std::filesystem::path& case_folder,
                                                  std::uint64_t size);

/// The CT that a comparison shows, or would.
struct ComparedCt {
  bool of_plan = true;
  std::string series;            // that was asked for, or how its UID ends; "" for none
  std::vector<NamedFile> files;  // where it is none of the plan's, which are listed with the plan
};

/// What a comparison stands on, and who made it.
struct Provenance {
  std::string made_by;  // a person's name, as the machine or the person states it
  UtcTime made_at{};
  std::string program;  // "kiroku 0.1.0"
  CaseState case_state;
  std::string plan;                  // its name
  crypto::Sha256Digest plan_seal{};  // of the seal that these files have, whether or not it was sealed
  bool plan_sealed = false;          // by a seal that lies beside it
  std::vector<NamedFile> plan_files;
  std::optional<bool> case_names_plan;  // whether the case was recorded by this plan; nothing: by none
  std::optional<ComparedCt> ct;         // nothing: neither the plan nor the request names one
  /// Whether CT and case state the same patient's number; nothing where one is not known. The numbers are
  /// told to whoever compares alone: films and documents go to others.
  std::optional<bool> of_one_patient;
  std::vector<NamedFile> outputs;  // the film or page beside the document
};

/// What everybody who sees plan and recording beside each other must be told of them, a sentence each without
/// its full stop; none where there is nothing to say.
std::vector<std::string> cautions_of(const Provenance& made);

inline constexpr const char* kComparisonFormat = "kiroku-comparison/1";

/// The beginning of a comparison's document, by these recorded pictures: all that read_provenance() reads but
/// the outputs.
nlohmann::ordered_json provenance_json(const Provenance& made, const std::string& stream);
nlohmann::ordered_json file_json(const NamedFile& file);
nlohmann::ordered_json files_json(const std::vector<NamedFile>& files);
/// The document's bytes.
std::string document_text(const nlohmann::ordered_json& document);

/// What is read back of a document to check it. kiroku::UsageError, naming `name`, for what is none.
Provenance read_provenance(std::string_view text, const std::string& name);

}  // namespace kiroku::compare
