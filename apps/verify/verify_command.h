// `kiroku verify` and the whole of `kiroku-verify`: the same code, so that an expert who reads the small
// program has read what the large one does.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "archive/verify/verifier.h"

namespace kiroku::apps {

/// What is trusted where the person named nothing.
struct VerifyDefaults {
  std::vector<crypto::VerifierKey> devices;
  std::vector<std::filesystem::path> trust;          // PEM files: roots of outside authorities,
  std::vector<std::filesystem::path> own_authority;  // and of the recorder's own
  std::optional<std::filesystem::path> log;          // appliance log that should know the case
  /// The log's newest checkpoint that witnesses cosigned; asked for where a policy of witnesses is.
  std::optional<archive::OutsideNote> witnessed_note;
};

/// How a case was verified, for whoever remembers verdicts.
struct HowVerified {
  bool decrypted = false;    // an identity was used
  bool by_defaults = false;  // by `defaults` alone: nobody named keys, roots, a log, a record or a policy
};

/// The light of a display in a case's pictures, beside the ledger (light/light_judge.h).
struct LightQuestion {
  std::filesystem::path folder;
  std::optional<crypto::Sha256Digest> lines_root;  // of the lines that were judged
  /// The case reads as tampered: its ledger does not hold, and what agrees with it proves nothing.
  bool is_tampered = false;
  /// Before which moment no line can have been written, by tokens that hold; of an outside authority, or of
  /// the recorder's own. None of a case that reads as tampered.
  std::vector<archive::Bracket> brackets;
  bool by_outside_clocks = false;
  std::vector<std::string> identities, streams;  // files; names, none: every stream of pictures
};
struct LightOutcome {
  int status = 0;          // kDone, kAnswerIsNo, kNoAnswer
  std::string text, json;  // for people; one object
};
using ReadLight = std::function<LightOutcome(const LightQuestion& question)>;

/// What a program with a home and decoders adds; every member may be empty.
struct VerifyExtras {
  /// Folder of a case that was named by its identifier.
  std::function<std::filesystem::path(const std::string& named)> find_case;
  std::function<VerifyDefaults(const std::filesystem::path& case_folder)> defaults;
  archive::SegmentInspector inspect;
  ReadLight read_light;
  /// Called after each verification.
  std::function<void(const std::filesystem::path& case_folder, const archive::VerificationReport& report,
                     const HowVerified& how)>
      verified;
};

/// Gives `command` its options and action. `extras` is copied.
void make_verify_command(Command& command, const VerifyExtras& extras);

/// Keys in the text of a device.pub, one C2SP verifier key a line, '#' comments skipped; or the key of a
/// device.identity (crypto/device_identity.h), with its ML-DSA key. Throws kiroku::UsageError naming
/// `name_for_errors`.
std::vector<crypto::VerifierKey> parse_device_keys(std::string_view text, const std::string& name_for_errors);
/// The same from a file, or from the key itself ("or-3+1a2b3c4d+A…").
std::vector<crypto::VerifierKey> load_device_keys(const std::string& file_or_key);

}  // namespace kiroku::apps
