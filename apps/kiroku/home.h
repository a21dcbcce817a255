// A home: the folder that holds what one recorder is (docs/reference/format.md does not depend on it; a case
// can be judged without any home). Layout:
//
//   kiroku.toml      how it records            device.key   signing key, PKCS#8, mode 0600
//   recipients.txt   who can open recordings   device.pub   its C2SP verifier key
//   device-ml-dsa.key  ML-DSA-65 key that signs beside, PKCS#8, mode 0600 (homes from before have none)
//   device-hardware.json  where the key in hardware is that signs beside; no secret (homes without have none)
//   boot-approvals/  approved states of the boot, of a TPM key that is sealed to them (boot_approval.h); no
//                    secret
//   device.identity  all public keys, signed by all (crypto/device_identity.h)
//   trust.pem        roots of outside time-stamping authorities
//   own-authority.pem  roots of the embedded one, former ones too; authority/  that authority
//   archive/<case>/  the recordings            archive/log/ the appliance log
//   catalogue.sqlite                           users.sqlite, viewer.pem, viewer.key of the viewer
//   stamping.sqlite  time-stamps still wanted  identity.txt only with --demo
//   shipping-*.sqlite  what is in a store      store-credentials  the store's keys, mode 0600
//   comparisons/<case>/  plans beside recordings (viewer/kept/kept_comparison.h)
//   witnessed/log.note  the appliance log's newest checkpoint that witnesses cosigned
//   newest-log.note  the appliance log's newest checkpoint, beside the archive's disk (kept_log.h)
//   search/<case>.json  by what cases can be found, where [search] asks for it; its key: mode 0600
//   last-signed.note  its last one, for the home's other processes: nothing needs it after a power cut
//   plans/           sealed plans, a folder each, for comparisons that are made on the viewer's page
//
// Immutable; thread-safe.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/configuration/configuration.h"
#include "crypto/age_recipient.h"
#include "crypto/signed_note.h"
#include "crypto/signing_key.h"
#include "recorder/device_key/hardware_description.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {

/// Hears what recording goes on without, and why.
using TellWithout = std::function<void(const std::string& sentence)>;

/// Where everything of a home lies.
class Home {
 public:
  /// Names the places; nothing needs to be there yet.
  explicit Home(std::filesystem::path folder);
  /// $KIROKU_HOME, else $XDG_DATA_HOME/kiroku, else ~/.local/share/kiroku. Throws kiroku::UsageError where
  /// the environment names none of them.
  static std::filesystem::path default_folder();
  /// The home of --home or the default one; throws kiroku::UsageError where there is none.
  static Home open(const std::optional<std::string>& asked);
  /// The same; nothing if none was asked for and there is no default one.
  static std::optional<Home> find(const std::optional<std::string>& asked);

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] std::filesystem::path configuration_file() const { return folder_ / "kiroku.toml"; }
  [[nodiscard]] std::filesystem::path device_key_file() const { return folder_ / "device.key"; }
  [[nodiscard]] std::filesystem::path device_file() const { return folder_ / "device.pub"; }
  [[nodiscard]] std::filesystem::path ml_dsa_key_file() const { return folder_ / "device-ml-dsa.key"; }
  [[nodiscard]] std::filesystem::path hardware_file() const { return folder_ / "device-hardware.json"; }
  [[nodiscard]] std::filesystem::path boot_approvals_folder() const { return folder_ / "boot-approvals"; }
  [[nodiscard]] std::filesystem::path device_identity_file() const { return folder_ / "device.identity"; }
  [[nodiscard]] std::filesystem::path trust_file() const { return folder_ / "trust.pem"; }
  [[nodiscard]] std::filesystem::path own_authority_file() const { return folder_ / "own-authority.pem"; }
  [[nodiscard]] std::filesystem::path recipients_file() const { return folder_ / "recipients.txt"; }
  [[nodiscard]] std::filesystem::path authority_folder() const { return folder_ / "authority"; }
  /// By what this appliance reports to its hospital (fleet/reports/report_client.h); mode 0600.
  [[nodiscard]] std::filesystem::path reporting_file() const { return folder_ / "reporting.json"; }
  [[nodiscard]] std::filesystem::path identity_file() const { return folder_ / "identity.txt"; }
  [[nodiscard]] std::filesystem::path archive() const { return folder_ / "archive"; }
  [[nodiscard]] std::filesystem::path log_folder() const { return archive() / "log"; }
  /// The newest checkpoint of the log that witnesses cosigned.
  [[nodiscard]] std::filesystem::path newest_witnessed_note() const {
    return folder_ / "witnessed" / "log.note";
  }
  /// The newest checkpoint that was signed of the log.
  [[nodiscard]] std::filesystem::path newest_log_note() const { return folder_ / "newest-log.note"; }
  [[nodiscard]] std::filesystem::path comparisons_folder() const { return folder_ / "comparisons"; }
  [[nodiscard]] std::filesystem::path plans_folder() const { return folder_ / "plans"; }
  [[nodiscard]] std::filesystem::path catalogue_file() const { return folder_ / "catalogue.sqlite"; }
  [[nodiscard]] std::filesystem::path stamping_file() const { return folder_ / "stamping.sqlite"; }
  /// What of this home is in the store with this name for it.
  [[nodiscard]] std::filesystem::path shipping_file(const std::string& store) const {
    return folder_ / ("shipping-" + store + ".sqlite");
  }
  /// The appliance log's tree as it is published in the store.
  [[nodiscard]] std::filesystem::path published_log() const { return folder_ / "published-log"; }
  /// By what cases can be found, a note each, where [search] asks for them.
  [[nodiscard]] std::filesystem::path search_notes() const { return folder_ / "search"; }

  /// Where a recorder that runs on this home is spoken to.
  [[nodiscard]] std::filesystem::path control_socket(const Configuration& configuration) const;

  [[nodiscard]] Configuration configuration() const;
  /// With its keys beside Ed25519, if the home has an identity file.
  [[nodiscard]] crypto::VerifierKey device() const;
  /// Asks for the passphrase if the key has one, which is that of both keys. With the ML-DSA key and the
  /// one in hardware, if their files are there; the hardware is not asked.
  [[nodiscard]] crypto::SigningKey signing_key() const;
  /// The same where the passphrase was asked for already; nothing for keys without.
  [[nodiscard]] crypto::SigningKey signing_key(const std::optional<crypto::Secret>& passphrase) const;
  /// Asks for the passphrase of the device key, if it has one.
  [[nodiscard]] std::optional<crypto::Secret> key_passphrase() const;
  /// What hardware_file() says; kiroku::Error where it is not there or says nothing of the kind.
  [[nodiscard]] recorder::HardwareDescription hardware() const;
  /// What signs by it; nothing is asked of the hardware yet. Throws as hardware().
  [[nodiscard]] std::shared_ptr<const crypto::HardwareSigner> hardware_signer() const;
  /// trust.pem, where it holds any certificate: `kiroku init` writes one without.
  [[nodiscard]] std::vector<std::filesystem::path> outside_root_files() const;
  /// own-authority.pem and the embedded authority's own certificate, as far as they are there. Homes that
  /// were made before there was an own-authority.pem have that root in trust.pem: by this certificate, and by
  /// the name of every embedded authority, it counts as the home's own all the same.
  [[nodiscard]] std::vector<std::filesystem::path> own_root_files() const;
  /// All of them. With `without` a file that cannot be used is left out, and told to it in a sentence:
  /// whoever records goes on, and misses the time-stamps that no other root vouches for. Else throws
  /// kiroku::Error.
  [[nodiscard]] timestamp::TrustStore trust(const TellWithout& without = {}) const;
  /// Whether the folder is a case of this home's archive, links resolved.
  [[nodiscard]] bool holds(const std::filesystem::path& case_folder) const;

 private:
  [[nodiscard]] std::vector<std::filesystem::path> possible_own_root_files() const;
  std::filesystem::path folder_;
};

/// recipients.txt or another file of recipients.
crypto::AgeRecipients load_recipients(const std::filesystem::path& file);

/// The case a person named: a folder, or the identifier (or its beginning, if only one has it) of a case in
/// the home's archive. Throws kiroku::UsageError.
std::filesystem::path find_case(const std::optional<Home>& home, const std::string& named);

/// Writes an `access` entry into the appliance log where the case is this home's. What was asked for goes on
/// even if that fails: then a warning on standard error says so.
void log_access(const std::optional<Home>& home, const std::filesystem::path& case_folder,
                const std::string& what);

/// Identities of the files given, or of the demonstration home's identity.txt if none was. Throws
/// kiroku::UsageError if there is neither.
crypto::AgeIdentities load_identities(const std::vector<std::string>& files, const std::optional<Home>& home);

}  // namespace kiroku::apps
