#include "viewer/kept/kept_comparison.h"

#include <algorithm>

#include "archive/storage/file_stamps.h"
#include "base/error.h"
#include "crypto/age_file.h"
#include "crypto/byte_source.h"
#include "crypto/hash.h"

namespace kiroku::compare {
namespace {

namespace fs = std::filesystem;
using Answer = Check::Answer;

constexpr std::string_view kDocumentEnding = ".comparison.json.age";

Check check_document(const KeptEvidence& evidence, const crypto::Sha256Digest& digest,
                     std::string& entered_by) {
  const auto record = evidence.log->comparisons.find(digest);
  if (record == evidence.log->comparisons.end()) {
    return {"document", Answer::kUnknown,
            "the appliance log does not know this comparison: it was made by another appliance, or changed "
            "since"};
  }
  const auto& [seq, utc, who, is_signed] = record->second;
  if (!is_signed) {
    return {"document", Answer::kUnknown,
            "entry " + std::to_string(seq) +
                " of the appliance log states this comparison, and nobody signed it when it was written: the "
                "machine stopped at that moment, or somebody made it up"};
  }
  entered_by = who;
  return {"document",
          Answer::kHolds,
          "entered by " + who + " at " + format_utc(utc) + ", entry " + std::to_string(seq),
          seq,
          {},
          utc,
          who};
}

Check check_case(const KeptEvidence& evidence, const CaseState& stated) {
  Check check{"case", Answer::kDiffers, {}, {}, stated.ledger_size};
  if (evidence.recording->opening().case_id != stated.case_id) {
    check.text = "it compares another case, " + stated.case_id;
    return check;
  }
  const auto root = root_of_first(evidence.recording->folder(), stated.ledger_size);
  if (!root) {
    check.text = "the case's ledger has lost entries since";
  } else if (*root != stated.ledger_root) {
    check.text = "the case's ledger was changed since";
  } else {
    check.answer = Answer::kHolds;
    check.text =
        "the first " + std::to_string(stated.ledger_size) + " ledger entries are as they were compared";
  }
  return check;
}

crypto::Sha256Digest plaintext_hash(const fs::path& sealed, const crypto::AgeIdentities& identities) {
  const auto source = crypto::open_file_source(sealed);
  crypto::Sha256 hash;
  crypto::AgeFile::open(*source, identities).read_all([&](ByteView piece) { hash.update(piece); });
  return hash.finish();
}

/// A film of the plan; `called` in sentences.
Check check_film(const fs::path& sealed, const crypto::AgeIdentities& identities, const NamedFile& stated,
                 const std::string& called) {
  try {
    const bool same = plaintext_hash(sealed, identities) == stated.sha256;
    return {stated.role, same ? Answer::kHolds : Answer::kDiffers,
            called + (same ? " is as it was made" : " was changed since")};
  } catch (const IoError& error) {
    return {stated.role, Answer::kUnknown, error.what()};
  } catch (const crypto::AgeError& error) {
    return {stated.role, Answer::kDiffers, error.what()};
  }
}

std::vector<Check> check_tokens(const fs::path& file, const crypto::Sha256Digest& digest,
                                const timestamp::TrustStore* trust) {
  const timestamp::TrustStore none;
  try {
    return archive::check_tokens_beside(file, digest, trust == nullptr ? none : *trust);
  } catch (const Error& error) {
    return {{"time", Answer::kUnknown, error.what()}};
  }
}

Check check_named(const archive::OpenEntry& open, const crypto::Sha256Digest& seal) {
  if (!open.plan) return {"named", Answer::kUnknown, "the case names no plan"};
  if (*open.plan != seal) return {"named", Answer::kDiffers, "the case was recorded by another plan"};
  return {"named", Answer::kHolds, "the case's first entry names this plan"};
}

}  // namespace

bool is_comparison_name(std::string_view name) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); };
  return !name.empty() && name.size() <= 32 && is_letter(name.front()) &&
         std::ranges::all_of(name, [&](char c) { return is_letter(c) || c == '-'; });
}

KeptPlace kept_place(const fs::path& comparisons, const std::string& case_id, const std::string& name) {
  return {comparisons / case_id, name};
}

std::vector<std::string> kept_names(const fs::path& comparisons, const std::string& case_id) {
  std::vector<std::string> names;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(comparisons / case_id, failed)) {
    const std::string file = entry.path().filename().string();
    if (!file.ends_with(kDocumentEnding)) continue;
    const std::string name = file.substr(0, file.size() - kDocumentEnding.size());
    if (is_comparison_name(name)) names.push_back(name);
  }
  std::ranges::sort(names);
  return names;
}

Bytes open_kept(const fs::path& sealed, const crypto::AgeIdentities& identities, std::uint64_t most_bytes) {
  const auto source = crypto::open_file_source(sealed);
  const crypto::AgeFile file = crypto::AgeFile::open(*source, identities);
  if (file.plaintext_size() > most_bytes)
    throw Error(sealed.filename().string() + " is too large to be shown");
  Bytes bytes(file.plaintext_size());
  bytes.resize(file.read_at(0, bytes));
  return bytes;
}

class KeptFilm::Plaintext final : public crypto::ByteSource {
 public:
  Plaintext(const fs::path& sealed, const crypto::AgeIdentities& identities)
      : sealed_(crypto::open_file_source(sealed)), film_(crypto::AgeFile::open(*sealed_, identities)) {}
  [[nodiscard]] std::uint64_t size() const override { return film_.plaintext_size(); }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    return film_.read_at(offset, into);
  }

 private:
  std::unique_ptr<crypto::ByteSource> sealed_;
  crypto::AgeFile film_;
};

KeptFilm::KeptFilm(const KeptPlace& place, const std::string& role, const crypto::AgeIdentities& identities,
                   crypto::HashTrails& hashed) {
  const Bytes text = open_kept(place.sealed_document(), identities, kLargestDocument);
  const Provenance made = read_provenance(std::string(text_of(text)), place.document_name());
  const auto stated = std::ranges::find(made.outputs, role, &NamedFile::role);
  if (stated == made.outputs.end())
    throw Error("the comparison '" + place.name + "' names no such film: " + role);
  const std::string name = place.film_name(role);
  plaintext_ = std::make_unique<const Plaintext>(place.folder / (name + ".age"), identities);
  auto trail = hashed.find(stated->sha256);
  if (!trail) {
    trail = std::make_shared<const crypto::HashTrail>(crypto::HashTrail::of(*plaintext_));
    if (trail->digest() != stated->sha256)
      throw Error(name + " is not the film that the comparison '" + place.name +
                  "' was made with; it is not shown");
    hashed.add(trail);
  }
  film_.emplace(*plaintext_, trail, name);
}

KeptFilm::~KeptFilm() = default;

std::uint64_t KeptFilm::size() const { return film_->size(); }

void KeptFilm::read_at(std::uint64_t offset, std::span<std::byte> into) const {
  if (film_->read_at(offset, into) != into.size()) throw Error("a film became shorter while it was read");
}

crypto::AgeRecipients recipients_in_common(const archive::OpenEntry& open, const std::string& stream) {
  std::optional<std::vector<std::string>> common;
  for (const archive::StreamInfo& each : open.streams) {
    if (each.name != stream && each.kind != "vitals" && each.kind != "events") continue;
    if (!common) {
      common = each.recipients;
    } else {
      std::erase_if(*common,
                    [&](const std::string& one) { return std::ranges::count(each.recipients, one) == 0; });
    }
  }
  if (!common || common->empty()) {
    throw Error(
        "nobody can open the pictures, the vital signs and the marks of this case alike, so a comparison "
        "that "
        "tells of all of them cannot be kept for anybody; write it to a file of your own with -o");
  }
  crypto::AgeRecipients recipients;
  for (const std::string& each : *common) recipients.push_back(crypto::parse_recipient(each));
  return recipients;
}

KeptComparison read_kept(const KeptPlace& place, const crypto::AgeIdentities& identities,
                         const KeptEvidence& evidence) {
  const Bytes text = open_kept(place.sealed_document(), identities, kLargestDocument);
  KeptComparison kept{place.name, std::string(text_of(text)), {}, false, false, {}, {}, {}};
  kept.made = read_provenance(kept.document, place.document_name());
  const crypto::Sha256Digest digest = crypto::sha256(text);
  kept.checks.push_back(check_document(evidence, digest, kept.entered_by));
  std::ranges::move(check_tokens(place.document(), digest, evidence.trust), std::back_inserter(kept.checks));
  kept.checks.push_back(check_case(evidence, kept.made.case_state));
  for (const NamedFile& output : kept.made.outputs) {
    if (output.role == "replay") {
      kept.has_replay = true;
      kept.checks.push_back(check_film(place.sealed_replay(), identities, output, "the plan's film"));
    } else if (output.role == "radiographs") {
      kept.has_radiographs = true;
      kept.checks.push_back(
          check_film(place.sealed_radiographs(), identities, output, "the film of the plan's radiographs"));
    }
  }
  const archive::OpenEntry& open = evidence.recording->opening();
  kept.plan_checks = {check_named(open, kept.made.plan_seal)};
  const archive::CaseReader& recording = *evidence.recording;
  std::ranges::move(
      check_sealed_before(*evidence.log, evidence.device,
                          {open, recording.opened_at(), recording.opening_sha256()}, kept.made.plan_seal),
      std::back_inserter(kept.plan_checks));
  std::ranges::move(check_tokens(place.seal(), kept.made.plan_seal, evidence.trust),
                    std::back_inserter(kept.plan_checks));
  return kept;
}

}  // namespace kiroku::compare
