// Entries of the appliance log (docs/reference/format.md, "The appliance log"), as values, to and from their
// line. Pure functions, thread-safe.
//
// Every line begins with `type`, `seq`, `utc`, `mono_ns` as a case's does, then:
//
//   boot                 boot_id, device (verifier key), and where the log stated an attestation key before a
//                        quote (base64), quote_signature (base64), pcrs [text...], or no_quote (why there is
//                        none)
//   shutdown
//   config-changed       sha256
//   device-key-changed   device (the new verifier key)
//   device-ml-dsa-added  ml_dsa (the ML-DSA-65 key with which the device signs, too, from here on)
//   device-hardware-added   hardware (the key in hardware with which the device signs, too, from here on)
//   device-attestation-added  attestation (the key by which the device's TPM quotes the boot, from here on),
//                        quote, quote_signature, pcrs
//   device-hardware-silent  why (the hardware did not sign the checkpoint before this entry)
//   plan-sealed          sha256
//   case-opened          case, sha256 (of the bytes of the case's first line, without LF)
//   case-checkpoint      case, size, root
//   case-closed          case, size, root, final_token (SHA-256 of the closing token's file; absent if none
//                        came)
//   replicated           case, target
//   erased               case, stream (absent: the whole case), policy
//   access               case (as it was asked for), what, who, purpose (absent where none was stated)
//   recovered            truncated (bytes of a torn last line that were cut off before this entry)
//   damage-found         size, stated_root (of a checkpoint that this device signed), root (absent: there are
//   fewer
//                        lines): what stands before this entry is not what was signed
//   case-held            case, reason, who
//   case-released        case, hold (the number of its case-held), reason, who
//   consent-given        case, purposes [text...], statement, form (absent where none is kept), who
//   consent-withdrawn    the same
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "archive/format/ledger_entry.h"

namespace kiroku::archive {

/// What a TPM says of the measured boot, in the log's own texts (crypto/tpm_quote.h says what they are).
struct StatedQuote {
  std::string attest, signature;  // base64
  std::vector<std::string> pcrs;  // "<register>:<64 hex digits>", 1 to 24
};
struct BootEntry {
  std::string boot_id;
  std::string device;
  std::optional<StatedQuote> quote = {};
  std::optional<std::string> no_quote = {};  // never beside a quote
};
struct ShutdownEntry {};
struct ConfigChangedEntry {
  crypto::Sha256Digest sha256{};
};
struct DeviceKeyChangedEntry {
  std::string device;
};
struct DeviceMlDsaEntry {
  std::string ml_dsa;  // as crypto::MlDsaVerifierKey writes it
};
struct DeviceHardwareEntry {
  std::string hardware;  // as crypto::HardwareVerifierKey writes it
};
struct DeviceAttestationEntry {
  std::string attestation;  // base64 of TPMT_PUBLIC
  StatedQuote quote;        // of the boot of that moment
};
/// Once for each silence: that checkpoints of log and cases lack the line by hardware, and why.
struct DeviceHardwareSilentEntry {
  std::string why;
};
struct PlanSealedEntry {
  crypto::Sha256Digest sha256{};
};
struct CaseOpenedEntry {
  std::string case_id;
  crypto::Sha256Digest sha256{};
};
struct CaseCheckpointEntry {
  std::string case_id;
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
};
struct CaseClosedEntry {
  std::string case_id;
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
  std::optional<crypto::Sha256Digest> final_token;
};
struct ReplicatedEntry {
  std::string case_id, target;
};
struct CaseErasedEntry {
  std::string case_id;
  std::optional<std::string> stream;  // nothing: the whole case
  std::string policy;
};
struct AccessEntry {
  std::string case_id, what, who;
  /// For which it was asked for: a consent to it must stand then.
  std::optional<std::string> purpose = {};
};
struct LogRecoveredEntry {
  std::uint64_t truncated = 0;
};
/// When the log was opened its lines were not those that its newest checkpoint is over. Whoever goes on
/// signing would else make later checkpoints fit what was changed.
struct LogDamageEntry {
  std::uint64_t size = 0;  // of that checkpoint
  crypto::Sha256Digest stated_root{};
  std::optional<crypto::Sha256Digest> root;  // of the lines; nothing where there are fewer
};
struct PreRollDiscardedEntry {
  std::uint64_t segments = 0;               // that were still there
  std::optional<std::int64_t> duration_ns;  // they covered; nothing where a dead recorder left them
};
/// A legal hold: no retention erases anything of the case.
struct CaseHeldEntry {
  std::string case_id, reason, who;
};
struct CaseReleasedEntry {
  std::string case_id;
  std::uint64_t hold = 0;  // number of the CaseHeldEntry that it ends
  std::string reason, who;
};

/// What a written consent to the use of a case says in the clear, or its withdrawal: no more than its
/// purposes, which are short names of the site's own. Who consented is sealed.
struct ConsentStatement {
  std::string case_id;
  std::vector<std::string> purposes;         // at least one, at most kMaximumPurposes, none twice
  crypto::Sha256Digest statement{};          // of consents/<SHA-256>.age in the log's folder
  std::optional<crypto::Sha256Digest> form;  // likewise, where the scanned form is kept
  std::string who;                           // entered it
};
struct ConsentGivenEntry : ConsentStatement {};
struct ConsentWithdrawnEntry : ConsentStatement {};

using LogEntryBody =
    std::variant<BootEntry, ShutdownEntry, ConfigChangedEntry, DeviceKeyChangedEntry, DeviceMlDsaEntry,
                 DeviceHardwareEntry, DeviceAttestationEntry, DeviceHardwareSilentEntry, PlanSealedEntry,
                 CaseOpenedEntry, CaseCheckpointEntry, CaseClosedEntry, ReplicatedEntry, CaseErasedEntry,
                 AccessEntry, LogRecoveredEntry, PreRollDiscardedEntry, CaseHeldEntry, CaseReleasedEntry,
                 ConsentGivenEntry, ConsentWithdrawnEntry, LogDamageEntry>;

struct LogEntry {
  std::uint64_t seq = 0;
  /// mono_ns is the machine's monotonic clock: it starts anew after each `boot` and never goes back in
  /// between.
  Moment at;
  LogEntryBody body;
};

/// "case-opened".
std::string_view type_of(const LogEntryBody& body);

/// The line, without LF. Throws kiroku::Error for a number of magnitude 2^53 or more.
std::string to_line(const LogEntry& entry);

/// What is wrong with a line, or the entry; as strict as parse_case_entry.
struct LogEntryParse {
  std::optional<LogEntry> entry;
  std::string problem;  // one sentence when there is no entry
};
LogEntryParse parse_log_entry(std::string_view line);

}  // namespace kiroku::archive
