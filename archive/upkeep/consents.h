// Written consent to the use of cases, as the appliance log states it (docs/reference/format-recovery.md,
// "Consent"): given, and withdrawn. Functions; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "base/bytes.h"
#include "base/utc_time.h"
#include "crypto/age_recipient.h"
#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// One entry of the log.
struct Consent {
  std::uint64_t entry = 0;
  UtcTime at;  // when it was entered
  bool withdraws = false;
  /// It was signed before another entry followed. What was not gives no consent; it withdraws all the same,
  /// and erases nothing.
  bool is_signed = false;
  ConsentStatement says;
};

/// How a case stands to one purpose.
struct PurposeState {
  bool stands = false;
  std::uint64_t entry = 0;  // the newest that counts
  UtcTime since;
  /// It was withdrawn by an entry that was signed before another followed. Only then anything may be erased
  /// for it: any other line can be made up by whoever can write to the disk.
  bool withdrawal_signed = false;
  /// After the withdrawal it was given again by an entry that nobody signed, or whose checkpoint is gone.
  /// That permits nothing; nor is anything erased while nobody can tell.
  bool doubted = false;
};

struct CaseConsents {
  std::vector<Consent> entries;                  // as they were entered
  std::map<std::string, PurposeState> purposes;  // that were ever consented to
};
using Consents = std::map<std::string, CaseConsents>;  // by case

/// Reads the whole log. A consent counts only with a checkpoint of its own by `device`, a withdrawal with or
/// without one: what somebody adds to the log permits nothing. `device` and `seen` as for read_holds().
/// Throws kiroku::Error where nobody knows what was consented to, as read_stated() does.
Consents read_consents(const std::filesystem::path& log_folder, const crypto::VerifierKey& device,
                       const std::optional<crypto::Checkpoint>& seen = {});

/// "" where a consent of this case to the purpose stands; else why not, a sentence without its beginning: "no
/// consent to teaching was given for case …", "the consent … was withdrawn on …", "entry 12 … withdraws the
/// consent …, and nobody signed that entry in time".
std::string why_not_consented(const Consents& consents, const std::string& case_id,
                              const std::string& purpose);

/// Whether a withdrawal of this case and purpose may be entered: a consent stands, or was withdrawn only by
/// an entry that nobody signed in time.
bool may_be_withdrawn(const PurposeState& state);

/// The signed withdrawal by which this case lost the consent to the purpose; nothing where the consent
/// stands, was never given, or was withdrawn only by an entry that nobody signed in time.
std::optional<std::uint64_t> signed_withdrawal(const Consents& consents, const std::string& case_id,
                                               const std::string& purpose);

/// What stands in a sealed statement.
struct ConsentDocument {
  std::string case_id;
  std::vector<std::string> purposes;
  bool withdraws = false;
  std::string person;  // who consented or withdrew: a name, and as what
  std::string since;   // the day on the form, 2026-08-05
  struct Form {
    std::uint64_t bytes = 0;
    crypto::Sha256Digest sha256{};  // of the scanned form itself
  };
  std::optional<Form> form;
};

/// One line of JSON (docs/reference/schema/consent.json), and back. Throws kiroku::Error for what is none.
std::string to_json(const ConsentDocument& document);
ConsentDocument parse_consent_document(std::string_view json);

/// Seals it and writes it durably into consents/ of the log's folder, under the SHA-256 of what was written,
/// which is returned. Throws kiroku::IoError, and kiroku::UsageError beyond kMaximumConsentBytes.
crypto::Sha256Digest keep_sealed(FileSystem& files, const std::filesystem::path& log_folder,
                                 ByteView plaintext, const crypto::AgeRecipients& recipients);

/// Removes what keep_sealed() wrote for an entry that then could not be made, unless the log names it all the
/// same, or cannot be read: what is named must stay. Never throws: the first error is the one to tell.
void remove_unless_entered(FileSystem& files, const std::filesystem::path& log_folder,
                           const std::vector<crypto::Sha256Digest>& kept) noexcept;

/// The bytes that were sealed. Throws kiroku::Error where the file is not there, is not the one whose hash
/// the entry states or does not open.
Bytes open_sealed(const std::filesystem::path& log_folder, const crypto::Sha256Digest& sha256,
                  const crypto::AgeIdentities& identities);

/// What the statement of an entry says; throws kiroku::Error as open_sealed(), and where it is a statement of
/// another case, of other purposes, or of the other kind: a consent to one case serves no other.
ConsentDocument open_statement(const std::filesystem::path& log_folder, const Consent& consent,
                               const crypto::AgeIdentities& identities);

}  // namespace kiroku::archive
