// Comparisons that are kept for the viewer, beside the archive and apart from the case:
//
//   FOLDER/<case>/<name>.comparison.json.age         the document (docs/reference/format-plans.md,
//   "Comparisons")
//                 <name>.replay.mp4.age              the plan as a film, where its CT was at hand
//                 <name>.radiographs.mp4.age       the plan's radiographs, where the case has fluoroscopy
//                 <name>.comparison.<authority>.tsr  tokens of the document
//                 <name>.seal.<authority>.tsr        tokens of the plan's seal
//
// Document and film tell of the patient, so they are sealed (age) for whoever can open the case; tokens are
// about their plaintext. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "archive/reading/case_reader.h"
#include "base/bytes.h"
#include "base/check.h"
#include "crypto/age_file.h"
#include "crypto/age_recipient.h"
#include "crypto/hash_trails.h"
#include "timestamp/token_verifier.h"
#include "viewer/kept/log_of_case.h"
#include "viewer/kept/provenance.h"

namespace kiroku::compare {

/// Names of comparisons: [a-z0-9][a-z0-9-]{0,31}.
bool is_comparison_name(std::string_view name);

/// Where the files of one comparison lie. `document` and `seal` are no files: tokens are named after them.
struct KeptPlace {
  std::filesystem::path folder;
  std::string name;
  [[nodiscard]] std::filesystem::path document() const { return folder / (name + ".comparison.json"); }
  [[nodiscard]] std::filesystem::path sealed_document() const { return folder / (document_name() + ".age"); }
  [[nodiscard]] std::filesystem::path sealed_replay() const { return folder / (replay_name() + ".age"); }
  [[nodiscard]] std::filesystem::path sealed_radiographs() const {
    return folder / (radiographs_name() + ".age");
  }
  [[nodiscard]] std::filesystem::path seal() const { return folder / (name + ".seal.json"); }
  /// Where it lies unsealed while it is made.
  [[nodiscard]] std::filesystem::path making() const { return folder / (".making-" + name); }
  [[nodiscard]] std::string document_name() const { return name + ".comparison.json"; }
  [[nodiscard]] std::string replay_name() const { return film_name("replay"); }
  [[nodiscard]] std::string radiographs_name() const { return film_name("radiographs"); }
  /// Of an output's role.
  [[nodiscard]] std::string film_name(const std::string& role) const { return name + "." + role + ".mp4"; }
};
KeptPlace kept_place(const std::filesystem::path& comparisons, const std::string& case_id,
                     const std::string& name);
/// Names of those of a case that have a document, in order. None where there is no folder.
std::vector<std::string> kept_names(const std::filesystem::path& comparisons, const std::string& case_id);

/// The plaintext of a sealed file of at most `most_bytes`. crypto::AgeError; kiroku::IoError where it cannot
/// be read; kiroku::Error where it is larger.
Bytes open_kept(const std::filesystem::path& sealed, const crypto::AgeIdentities& identities,
                std::uint64_t most_bytes);
inline constexpr std::uint64_t kLargestDocument = std::uint64_t{32} << 20;

/// A film of a kept comparison, decrypted where it is read: the one that the comparison's document names by
/// its hash, or nothing. Thread-safe.
class KeptFilm {
 public:
  /// `role` is that of the document's output. The film is hashed as a whole, unless `hashed` remembers it,
  /// and each block again when it is read. As open_kept(), and kiroku::Error for a film that the document
  /// does not name, or another one.
  KeptFilm(const KeptPlace& place, const std::string& role, const crypto::AgeIdentities& identities,
           crypto::HashTrails& hashed);
  ~KeptFilm();
  KeptFilm(const KeptFilm&) = delete;
  KeptFilm& operator=(const KeptFilm&) = delete;
  [[nodiscard]] std::uint64_t size() const;
  /// Fills all of `into`; kiroku::Error where the film ends before, or is no longer what was hashed.
  void read_at(std::uint64_t offset, std::span<std::byte> into) const;

 private:
  class Plaintext;
  std::unique_ptr<const Plaintext> plaintext_;
  std::optional<crypto::HashedSource> film_;
};

/// Who reads everything that a comparison of `stream` tells of: recipients that its stream, the vital signs
/// and the marks have in common. kiroku::Error in a sentence where there is none.
crypto::AgeRecipients recipients_in_common(const archive::OpenEntry& open, const std::string& stream);

/// By what a comparison is judged. What is pointed to outlives the call.
struct KeptEvidence {
  const archive::CaseReader* recording = nullptr;
  const LogOfCase* log = nullptr;
  std::string device;                            // whose log it is, a verifier key
  const timestamp::TrustStore* trust = nullptr;  // null: tokens cannot be judged
};

struct KeptComparison {
  std::string name;
  std::string document;  // its exact text
  Provenance made;
  bool has_replay = false, has_radiographs = false;
  std::string entered_by;  // who made it, as the appliance log says; "" where it does not know it
  /// Whether it is as it was made: `what` is "document" (its hash in the appliance log), "time" (tokens of
  /// it), "case" (the ledger as it was compared), "replay", "radiographs".
  std::vector<Check> checks;
  /// Whether its plan was sealed before the first picture: "named" (by the case), "order" (in the appliance
  /// log), "ahead" (of a case that was recorded ahead), "time" (tokens of the seal).
  std::vector<Check> plan_checks;
};
/// Opens, reads and judges. As open_kept(), and kiroku::UsageError for a document that is none.
KeptComparison read_kept(const KeptPlace& place, const crypto::AgeIdentities& identities,
                         const KeptEvidence& evidence);

}  // namespace kiroku::compare
