#include "archive/upkeep/consents.h"

#include <array>
#include <set>
#include <string_view>

#include "archive/format/case_folder.h"
#include "archive/format/consent_layout.h"
#include "archive/format/json_writer.h"
#include "archive/format/strict_json.h"
#include "archive/upkeep/stated_log.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "crypto/age_file.h"
#include "crypto/encoding.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostStatementBytes = 16U << 10U;

void take(Consents& consents, Consent consent) {
  CaseConsents& of_case = consents[consent.says.case_id];
  for (const std::string& purpose : consent.says.purposes) {
    const auto known = of_case.purposes.find(purpose);
    if (!consent.withdraws) {
      if (consent.is_signed && (known == of_case.purposes.end() || !known->second.stands)) {
        of_case.purposes[purpose] = {true, consent.entry, consent.at};
      } else if (!consent.is_signed && known != of_case.purposes.end() && !known->second.stands) {
        known->second.doubted = true;
      }
    } else if (known != of_case.purposes.end() && (known->second.stands || consent.is_signed)) {
      // A withdrawal of what was never given states nothing of the purpose. What nobody signed takes nothing
      // back from a withdrawal that somebody did.
      known->second = {false, consent.entry, consent.at, consent.is_signed};
    }
  }
  of_case.entries.push_back(std::move(consent));
}

void make_folder_unless_there(FileSystem& files, const fs::path& folder) {
  if (!files.exists(folder)) {
    files.make_folder(folder);
    files.sync_folder(folder.parent_path());
  }
}

}  // namespace

Consents read_consents(const fs::path& log_folder, const crypto::VerifierKey& device,
                       const std::optional<crypto::Checkpoint>& seen) {
  constexpr std::array<std::string_view, 2> kTypes{"consent-given", "consent-withdrawn"};
  Consents consents;
  read_stated(log_folder, device, seen,
              {"what was consented to", kTypes, [&](const StatedEntry& stated) {
                 Consent consent;
                 consent.entry = stated.number;
                 consent.at = stated.entry.at.utc;
                 consent.is_signed = stated.is_signed();
                 if (const auto* given = std::get_if<ConsentGivenEntry>(&stated.entry.body)) {
                   consent.says = *given;
                 } else {
                   consent.says = std::get<ConsentWithdrawnEntry>(stated.entry.body);
                   consent.withdraws = true;
                 }
                 take(consents, std::move(consent));
               }});
  return consents;
}

std::string why_not_consented(const Consents& consents, const std::string& case_id,
                              const std::string& purpose) {
  const PurposeState* state = nullptr;
  if (const auto of_case = consents.find(case_id); of_case != consents.end()) {
    const auto found = of_case->second.purposes.find(purpose);
    state = found == of_case->second.purposes.end() ? nullptr : &found->second;
  }
  if (state == nullptr) {
    return "no consent to the purpose " + purpose + " was given for case " + case_id;
  }
  if (state->stands) {
    return "";
  }
  // Anybody who can write to the disk may have made it up: that the patient withdrew is not said of it.
  if (!state->withdrawal_signed) {
    return "entry " + std::to_string(state->entry) +
           " of the appliance log withdraws the consent to the purpose " + purpose + " for case " + case_id +
           ", and nobody signed that entry in time";
  }
  return "the consent to the purpose " + purpose + " was withdrawn for case " + case_id + " on " +
         format_utc(state->since) + " (entry " + std::to_string(state->entry) + " of the appliance log)";
}

bool may_be_withdrawn(const PurposeState& state) { return state.stands || !state.withdrawal_signed; }

std::optional<std::uint64_t> signed_withdrawal(const Consents& consents, const std::string& case_id,
                                               const std::string& purpose) {
  const auto of_case = consents.find(case_id);
  if (of_case == consents.end()) {
    return std::nullopt;
  }
  const auto state = of_case->second.purposes.find(purpose);
  const bool withdrawn = state != of_case->second.purposes.end() && !state->second.stands;
  return withdrawn && state->second.withdrawal_signed && !state->second.doubted
             ? std::optional(state->second.entry)
             : std::nullopt;
}

std::string to_json(const ConsentDocument& document) {
  JsonWriter line;
  line.text("case", document.case_id)
      .text("kind", document.withdraws ? "withdrawn" : "given")
      .texts("purposes", document.purposes)
      .text("person", document.person)
      .text("since", document.since);
  if (document.form) {
    JsonWriter form;
    form.count("bytes", document.form->bytes).digest("sha256", document.form->sha256);
    line.json("form", form.finish());
  }
  return line.finish();
}

ConsentDocument parse_consent_document(std::string_view json) {
  constexpr std::size_t kDepth = 2;
  const JsonParse parsed = parse_json(json, {kMostStatementBytes, kDepth});
  std::string problem = parsed.problem;
  ConsentDocument document;
  if (parsed.value) {
    JsonFields fields(*parsed.value, "statement", problem);
    document.case_id = fields.text("case");
    const std::string kind = fields.text("kind");
    document.withdraws = kind == "withdrawn";
    if (!document.withdraws && kind != "given") fields.refuse("kind", "must be given or withdrawn");
    document.purposes = fields.texts("purposes");
    document.person = fields.text("person");
    document.since = fields.text("since");
    if (fields.has("form")) {
      JsonFields form = fields.object("form");
      document.form = ConsentDocument::Form{form.count("bytes"), form.digest("sha256")};
      form.no_more();
    }
    fields.no_more();
  }
  if (!problem.empty()) throw Error("it is no statement of consent: " + problem);
  return document;
}

crypto::Sha256Digest keep_sealed(FileSystem& files, const fs::path& log_folder, ByteView plaintext,
                                 const crypto::AgeRecipients& recipients) {
  const Bytes sealed = crypto::seal_bytes(plaintext, recipients);
  if (sealed.size() > kMaximumConsentBytes) {
    throw UsageError("it has more than the 64 MiB that may be kept sealed beside the log");
  }
  const crypto::Sha256Digest hash = crypto::sha256(sealed);
  make_folder_unless_there(files, log_folder / kConsentsFolder);
  files.write_durably(log_folder / consent_path(hash), sealed);
  return hash;
}

void remove_unless_entered(FileSystem& files, const fs::path& log_folder,
                           const std::vector<crypto::Sha256Digest>& kept) noexcept {
  try {
    std::set<crypto::Sha256Digest> unnamed(kept.begin(), kept.end());
    for_each_log_line(log_folder, [&](const LogLine& line) {
      for (const crypto::Sha256Digest& each : kept) {
        if (line.json.find(crypto::to_hex(each)) != std::string::npos) unnamed.erase(each);
      }
    });
    for (const crypto::Sha256Digest& each : unnamed) {
      files.remove(log_folder / consent_path(each));
    }
    if (!unnamed.empty()) files.sync_folder(log_folder / kConsentsFolder);
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): the first error is the one to tell
  }
}

Bytes open_sealed(const fs::path& log_folder, const crypto::Sha256Digest& sha256,
                  const crypto::AgeIdentities& identities) {
  const std::string path = consent_path(sha256);
  const std::optional<std::string> sealed =
      CaseFolder::open(log_folder).read_if_there(path, kMaximumConsentBytes);
  const std::string name = (log_folder / path).string();
  if (!sealed) {
    throw Error(name + " is not there: what it said is lost, and that it was entered stays");
  }
  if (crypto::sha256(bytes_of(*sealed)) != sha256) {
    throw Error(name + " is not the file that was entered: its SHA-256 is another");
  }
  return crypto::unseal_bytes(bytes_of(*sealed), identities);
}

ConsentDocument open_statement(const fs::path& log_folder, const Consent& consent,
                               const crypto::AgeIdentities& identities) {
  const Bytes bytes = open_sealed(log_folder, consent.says.statement, identities);
  ConsentDocument document = parse_consent_document(text_of(bytes));
  if (document.case_id != consent.says.case_id || document.purposes != consent.says.purposes ||
      document.withdraws != consent.withdraws) {
    throw Error("the statement that entry " + std::to_string(consent.entry) +
                " of the appliance log names was made for another case, for other purposes, or says the "
                "opposite: it is none of this entry");
  }
  return document;
}

}  // namespace kiroku::archive
