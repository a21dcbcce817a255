#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <iostream>
#include <memory>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/approval_key_file.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/output_file.h"
#include "archive/catalogue/catalogue.h"
#include "archive/storage/file_system.h"
#include "archive/storage/recording_lock.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/age_file.h"
#include "crypto/device_identity.h"
#include "crypto/pkcs8.h"
#include "recorder/device_key/boot_approval.h"
#include "recorder/device_key/hardware_description.h"
#include "recorder/device_key/tpm_key.h"
#include "timestamp/authority.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::size_t kFewestRecipients = 2;
constexpr std::string_view kTrustText =
    "# Roots of outside time-stamping authorities (PEM), one after the other: time under them is external.\n"
    "# The root of this home's own authority stands in own-authority.pem and never here.\n";

struct Request {
  std::optional<std::string> home, device_name;
  std::vector<std::string> recipients, recipient_files, new_identities;
  bool demo = false, no_passphrase = false, passphrase = false;
  bool ml_dsa = false, add_ml_dsa = false, json = false;
  bool tpm = false, add_tpm = false;
  std::optional<std::string> tcti, pkcs11, add_pkcs11, approval_key, pcrs;
  [[nodiscard]] bool adds() const { return add_ml_dsa || add_tpm || add_pkcs11; }
};

constexpr fs::perms kOwnersAlone{0600}, kForAll{0644};

/// Which hardware is asked for, if any; kiroku::UsageError for two.
struct WantedHardware {
  recorder::HardwareDescription::Kind kind;
  std::string address;
};
std::optional<WantedHardware> hardware_of(const Request& request) {
  using Kind = recorder::HardwareDescription::Kind;
  const bool tpm = request.tpm || request.add_tpm;
  const std::optional<std::string>& token = request.pkcs11 ? request.pkcs11 : request.add_pkcs11;
  if (tpm && token) throw UsageError("a home has one key in hardware: give --tpm or --pkcs11, not both");
  if (request.tcti && !tpm) throw UsageError("--tcti is about a TPM: give --tpm or --add-tpm, too");
  if (tpm) return WantedHardware{Kind::kTpm, request.tcti.value_or(recorder::kDefaultTcti)};
  if (token) return WantedHardware{Kind::kPkcs11, *token};
  return std::nullopt;
}

/// To what a TPM's key shall be sealed, if to anything. Kept while the home is made: it approves the state
/// that the machine is in.
struct WantedSeal {
  crypto::ApprovalKey key;
  std::vector<unsigned> pcrs;
};
std::optional<WantedSeal> seal_of(const Request& request) {
  if (!request.approval_key) {
    if (request.pcrs) throw UsageError("--pcrs is about a key that is sealed: give --seal-to-boot, too");
    return std::nullopt;
  }
  if (!request.tpm && !request.add_tpm) {
    throw UsageError(
        "--seal-to-boot is about a key in a TPM: give --tpm, or --add-tpm for a home that is there");
  }
  std::vector<unsigned> pcrs = recorder::kUsualSealedPcrs;
  if (request.pcrs) {
    std::string problem;
    auto given = crypto::parse_pcr_list(*request.pcrs, problem);
    if (!given) throw UsageError("--pcrs " + *request.pcrs + ": " + problem);
    pcrs = std::move(*given);
  }
  recorder::require_sealable(pcrs);
  return WantedSeal{load_approval_key(*request.approval_key), std::move(pcrs)};
}

/// A seal over registers with nothing in them holds nothing off: whoever starts the machine can measure into
/// them what they like.
void require_measured(const std::vector<crypto::PcrValue>& state) {
  constexpr unsigned kMeasuredByFirmware = 8;  // 0 to 7, each of them (archive/format/boot_quote.h)
  std::vector<unsigned> empty, measured;
  for (const crypto::PcrValue& each : state)
    (each.value == crypto::Sha256Digest{} ? empty : measured).push_back(each.index);
  if (empty.empty()) return;
  const bool lacks_firmware = empty.front() < kMeasuredByFirmware;  // ascending
  throw UsageError(
      "nothing was measured into register " + crypto::pcr_list(empty) +
      " when this machine started, so that a seal to it holds nothing off: " +
      (lacks_firmware
           ? "switch on the TPM's SHA-256 bank in the firmware's settings and start by UEFI"
           : "give --pcrs " + crypto::pcr_list(measured) +
                 ", if that is enough (docs/how-to/keep-a-key-in-hardware.md, \"The registers\")"));
}

/// Has the hardware make the home's key. One that is sealed has the present state approved before it is
/// described anywhere, so that no home has a key that never signs.
recorder::HardwareDescription make_key(const WantedHardware& wanted, const std::optional<WantedSeal>& seal,
                                       const Home& home, const std::string& device) {
  if (!seal) return recorder::make_hardware_key(wanted.kind, wanted.address);
  const auto pcrs = recorder::read_registers(wanted.address, seal->pcrs);
  require_measured(pcrs);
  auto made = recorder::make_sealed_key(wanted.address, seal->key.public_key(), seal->pcrs);
  const auto approval = recorder::approve({device, *made.seal, pcrs}, seal->key);
  keep_approval(home.boot_approvals_folder(), approval);
  return made;
}

/// Has a TPM's description name its attestation key, where the TPM quotes by one. Why it does not, one
/// sentence; nothing is lost with it but what quotes tell of the boot.
std::string take_attestation_key(recorder::HardwareDescription& description) {
  if (description.kind != recorder::HardwareDescription::Kind::kTpm) return {};
  try {
    description.attestation_key = recorder::find_attestation_key(description);
    return {};
  } catch (const Error& error) {
    return error.what();
  }
}

/// What was made so far, taken away again unless all of it succeeds.
class Undo {
 public:
  ~Undo() {
    std::error_code ignored;
    for (const fs::path& path : made_) fs::remove_all(path, ignored);
  }
  Undo() = default;
  Undo(const Undo&) = delete;
  Undo& operator=(const Undo&) = delete;
  void made(fs::path path) { made_.push_back(std::move(path)); }
  void keep_all() { made_.clear(); }

 private:
  std::vector<fs::path> made_;
};

/// A new file with exactly these bytes; refuses one that exists.
void write_new_file(const fs::path& file, ByteView bytes, mode_t mode, Undo& undo) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  if (descriptor < 0 && errno == EEXIST)
    throw UsageError(file.string() + " is there already and is not overwritten: name another file");
  if (descriptor < 0) throw IoError("write", file, errno);
  undo.made(file);
  try {
    write_all(descriptor, bytes, file);
    if (::fsync(descriptor) != 0) throw IoError("make durable", file, errno);
  } catch (...) {
    ::close(descriptor);
    throw;
  }
  ::close(descriptor);
}

void make_folder(const fs::path& folder) {
  if (::mkdir(folder.c_str(), 0755) != 0) throw IoError("make the folder", folder, errno);
}

/// This machine's name with what a key name may not hold left out.
std::string default_device_name() {
  std::string name(256, '\0');
  if (::gethostname(name.data(), name.size() - 1) != 0) return "kiroku";
  name.resize(name.find('\0'));
  std::string out;
  for (const char c : name) {
    if (c > ' ' && c < 127 && c != '+' && c != '/') out += c;
  }
  return out.empty() ? "kiroku" : out;
}

/// An identity file as age-keygen writes it.
crypto::Secret identity_file_text(const crypto::AgeKeyPair& pair) {
  const std::string head = "# created: " + format_utc(utc_now()) + "\n# public key: " + pair.recipient + "\n";
  crypto::Secret text(head.size() + pair.identity_text.size() + 1);
  auto at = std::copy_n(bytes_of(head).begin(), head.size(), text.bytes().begin());
  at = std::copy_n(pair.identity_text.bytes().begin(), pair.identity_text.size(), at);
  *at = std::byte('\n');
  return text;
}

/// Makes identities where the operator said and returns their recipients.
std::vector<std::string> make_identities(const Request& request, Undo& undo) {
  std::vector<std::string> recipients;
  for (const std::string& file : request.new_identities) {
    const crypto::AgeKeyPair pair = crypto::generate_age_key();
    const crypto::Secret text = identity_file_text(pair);
    if (request.no_passphrase) {
      write_new_file(file, text.bytes(), 0600, undo);
    } else {
      const crypto::Secret passphrase = ask_new_passphrase("the identity " + file);
      const Bytes sealed = crypto::seal_bytes(text.bytes(), {crypto::passphrase_recipient(passphrase)});
      write_new_file(file, sealed, 0600, undo);
    }
    recipients.push_back(pair.recipient);
  }
  return recipients;
}

std::string recipients_text(const std::vector<std::string>& recipients) {
  std::string text = "# Who can open what this home records, one age recipient a line.\n";
  for (const std::string& recipient : recipients) text += recipient + "\n";
  return text;
}

/// Recipients that exist already, each checked.
std::vector<std::string> given_recipients(const Request& request) {
  std::vector<std::string> out;
  for (const std::string& text : request.recipients)
    out.push_back(crypto::parse_recipient(text)->to_string());
  for (const std::string& file : request.recipient_files) {
    for (const auto& recipient : load_recipients(file)) out.push_back(recipient->to_string());
  }
  return out;
}

void require_enough_recipients(const Request& request, std::size_t given) {
  if (request.demo || given + request.new_identities.size() >= kFewestRecipients) return;
  throw UsageError(
      "a home needs at least two recipients, so that one lost identity does not lose every recording: "
      "give two of --recipient age1... and --new-identity FILE, or --demo to try things out");
}

/// What mkfs leaves at the root of a disk.
bool is_lost_and_found(const fs::directory_entry& entry) {
  struct stat facts {};
  return entry.path().filename() == "lost+found" && ::lstat(entry.path().c_str(), &facts) == 0 &&
         S_ISDIR(facts.st_mode) && facts.st_uid == 0;
}

/// Whether nobody put anything there: empty, or the root of a new disk.
bool is_unused(const fs::path& folder) {
  std::error_code failed;
  const fs::directory_iterator entries(folder, failed);
  return !failed && std::all_of(begin(entries), end(entries), is_lost_and_found);
}

/// A folder that has to stay where it is: a disk is mounted there.
bool is_root_of_disk(const fs::path& folder) {
  struct stat its {
  }, above{};
  return ::lstat(folder.c_str(), &its) == 0 &&
         ::stat(fs::absolute(folder).lexically_normal().parent_path().c_str(), &above) == 0 &&
         its.st_dev != above.st_dev;
}

void require_free_place(const fs::path& folder) {
  std::error_code ignored;
  const fs::file_status status = fs::status(folder, ignored);
  if (!fs::exists(status)) return;
  if (fs::exists(folder / "device.pub", ignored)) {
    throw UsageError(folder.string() + " is a home already and stays as it is: name another with --home DIR");
  }
  if (!fs::is_directory(status) || !is_unused(folder)) {
    throw UsageError(folder.string() + " is there and not empty: name a new folder with --home DIR");
  }
}

struct Filled {
  crypto::VerifierKey device;
  std::string not_attested;  // why the home's TPM does not quote the boot, if it has one
};
/// Everything of a home in `home`, which exists and is empty.
Filled fill(const Home& home, const Request& request, const std::optional<WantedSeal>& seal,
            const std::vector<std::string>& recipients, Undo& undo) {
  const std::string name = request.device_name.value_or(default_device_name());
  require_printable(name, "--device-name");
  crypto::SigningKey key = crypto::SigningKey::generate();
  if (request.ml_dsa) {
    key = std::move(key).with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  }
  std::string not_attested;
  if (const auto wanted = hardware_of(request)) {
    auto made = make_key(*wanted, seal, home, name);
    not_attested = take_attestation_key(made);
    write_new_file(home.hardware_file(), bytes_of(made.to_json()), 0644, undo);
    key = std::move(key).with_hardware(recorder::hardware_signer(made, home.boot_approvals_folder()));
  }
  const crypto::VerifierKey device = crypto::verifier_key_of(name, key);
  std::optional<crypto::Secret> passphrase;
  if (request.passphrase) passphrase = ask_new_passphrase("the device key");
  const crypto::Secret* const its = passphrase ? &*passphrase : nullptr;
  write_new_file(home.device_key_file(), key.to_pem(its).bytes(), 0600, undo);
  if (request.ml_dsa) {
    write_new_file(home.ml_dsa_key_file(), crypto::ml_dsa_pem(*key.ml_dsa(), its).bytes(), 0600, undo);
  }
  if (device.ml_dsa() || device.hardware()) {
    write_new_file(home.device_identity_file(), bytes_of(crypto::write_device_identity(name, key, {})), 0644,
                   undo);
  }
  write_new_file(home.device_file(), bytes_of(device.to_string() + "\n"), 0644, undo);
  write_new_file(home.recipients_file(), bytes_of(recipients_text(recipients)), 0644, undo);
  write_new_file(home.configuration_file(), bytes_of(default_configuration_text()), 0644, undo);
  const timestamp::Authority authority = timestamp::Authority::create(home.authority_folder(), name);
  write_new_file(home.own_authority_file(), bytes_of(authority.root_pem()), 0644, undo);
  write_new_file(home.trust_file(), bytes_of(kTrustText), 0644, undo);
  make_folder(home.archive());
  const auto log = open_log(home, key);
  log->config_changed(crypto::sha256(bytes_of(default_configuration_text())));
  log->checkpoint();
  archive::Catalogue::open(home.catalogue_file());
  if (not_attested.empty()) not_attested = log->stated_keys().not_attested;
  return {device, not_attested};
}

/// The new home is filled beside its place and renamed there when it is whole; inside it where the folder is
/// there and no other can take its place: it is the root of a disk, or this user may write nothing beside it
/// (a service's folder below /var/lib).
fs::path make_place(const fs::path& folder, Undo& undo) {
  const fs::path beside = fs::absolute(folder).lexically_normal().parent_path();
  std::error_code ignored;
  const bool inside = fs::is_directory(folder) && (::access(beside.c_str(), W_OK) != 0 ||
                                                   !fs::is_empty(folder, ignored) || is_root_of_disk(folder));
  const fs::path parent = inside ? folder : beside;
  std::error_code failed;
  fs::create_directories(parent, failed);
  if (failed) throw IoError("make the folder", parent, failed.value());
  std::string name = (parent / ".kiroku-init-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw IoError("make a folder in", parent, errno);
  undo.made(name);
  return name;
}

/// Gives the filled place its name. What makes a folder a home, the device key's public half, comes last.
void settle(const Home& place, const fs::path& folder) {
  std::error_code absent;
  if (!fs::equivalent(place.folder().parent_path(), folder, absent)) {
    if (::rename(place.folder().c_str(), folder.c_str()) != 0) throw IoError("make the home", folder, errno);
    return;
  }
  const auto move_up = [&](const fs::path& entry) {
    const fs::path target = folder / entry.filename();
    if (::rename(entry.c_str(), target.c_str()) != 0) throw IoError("make the home", target, errno);
  };
  std::vector<fs::path> entries;
  for (const fs::directory_entry& entry : fs::directory_iterator(place.folder()))
    entries.push_back(entry.path());
  for (const fs::path& entry : entries) {
    if (entry != place.device_file()) move_up(entry);
  }
  archive::real_file_system().sync_folder(folder);
  move_up(place.device_file());
  std::error_code ignored;
  fs::remove(place.folder(), ignored);
  archive::real_file_system().sync_folder(folder);
}

/// What a person is told who had a key sealed.
void print_sealed(const Request& request, const Home& home) {
  if (!request.approval_key) return;
  const crypto::BootSeal seal = home.hardware().seal.value();
  std::cout
      << "The TPM's key signs only in approved states of the boot: registers " << crypto::pcr_list(seal.pcrs)
      << " of the SHA-256 bank. The present state is approved.\nIts seal is " << crypto::seal_name(seal)
      << ": write that down, since whoever approves a state compares it.\nKeep "
      << printable(*request.approval_key)
      << " away from this machine, and a copy of it elsewhere: after each update of firmware, boot loader or "
         "kernel it approves the new state ('kiroku boot --help'). Without it, what is recorded after the "
         "next update is unproven for good.\n";
}

/// The same for a program.
void tell_seal(const Request& request, const Home& home, ordered_json& told) {
  if (request.approval_key) told["seal"] = crypto::seal_name(home.hardware().seal.value());
}

/// What a person is told who made a home with a TPM that quotes no boot.
void print_not_attested(const std::string& why) {
  if (why.empty()) return;
  std::cout << "The TPM does not quote the measured boot, so that the log will say nothing of it: " << why
            << "\nWhat is recorded is not affected. 'kiroku init --add-tpm' tries again.\n";
}

void print_result(const Request& request, const fs::path& folder, const Filled& filled,
                  const std::vector<std::string>& recipients) {
  const crypto::VerifierKey& device = filled.device;
  const Home home(folder);
  std::vector<std::string> identities = request.new_identities;
  if (request.demo) identities.push_back(home.identity_file().string());
  if (request.json) {
    ordered_json told{{"home", folder.string()},
                      {"device", device.to_string()},
                      {"recipients", recipients},
                      {"identities", identities},
                      {"demo", request.demo}};
    tell_seal(request, home, told);
    print_json(told);
    return;
  }
  std::cout << "The home " << printable(folder.string()) << " is ready.\n\n"
            << "  device key   " << device.to_string() << "\n"
            << "               Give this line (or " << printable(home.device_file().string())
            << ") to whoever shall verify; it proves nothing if it comes with the recording.\n";
  if (device.ml_dsa() || device.hardware()) {
    std::cout
        << "  all keys     " << printable(home.device_identity_file().string())
        << "\n               Rather give this file: it holds the keys that sign beside, and only with it "
           "are all signatures asked for.\n";
  }
  for (const std::string& recipient : recipients) std::cout << "  recipient    " << recipient << "\n";
  for (const std::string& identity : identities) std::cout << "  identity     " << identity << "\n";
  if (request.demo) {
    std::cout << "               For demonstration only: whoever has this folder can open its recordings.\n";
  } else if (!identities.empty()) {
    std::cout << "               Whoever has one of these can open the recordings; lose all of them and "
                 "nobody can.\n";
  }
  std::cout << "\nNext: kiroku record --endoscope synthetic:endoscope --room synthetic:room --vitals "
               "synthetic:patient --duration 20s\n"
            << "Time-stamps come from the home's own authority until "
            << printable(home.configuration_file().string())
            << " names outside ones.\nWhoever verifies elsewhere needs its root, "
            << printable(home.own_authority_file().string()) << ", as --own-authority.\n";
  print_sealed(request, home);
  print_not_attested(filled.not_attested);
}

/// Writes a file in the place of the one that may be there, or leaves that as it is.
void replace_file(archive::FileSystem& files, const fs::path& file, ByteView bytes, fs::perms perms) {
  Undo undo;
  const fs::path beside = file.string() + ".part";
  std::error_code ignored;
  fs::remove(beside, ignored);  // of an attempt that was cut off: nothing was signed with it
  write_new_file(beside, bytes, static_cast<mode_t>(perms), undo);
  files.rename(beside, file);
  files.sync_folder(file.parent_path());
  undo.keep_all();
}

/// What of a home's keys beside Ed25519 its identity does not state yet.
bool lacks_a_key(const crypto::VerifierKey& known, const crypto::VerifierKey& all) {
  return (all.ml_dsa() && !known.ml_dsa()) || (all.hardware() && !known.hardware());
}

/// The key of a home stays as it was made: kiroku::UsageError where it is not sealed, or otherwise.
void require_sealed_so(const Home& home, const WantedSeal& wanted) {
  const recorder::HardwareDescription description = home.hardware();
  const std::string instead =
      "; a home keeps its key: one that is sealed so needs a new home "
      "(docs/how-to/keep-a-key-in-hardware.md)";
  if (!description.seal) {
    throw UsageError("the key in hardware that " + home.hardware_file().string() +
                     " names signs in every state of the boot" + instead);
  }
  if (description.seal->approver != wanted.key.public_key())
    throw UsageError("this home's key is sealed to another approval key" + instead);
  if (description.seal->pcrs != wanted.pcrs) {
    throw UsageError("this home's key is sealed to the registers " +
                     crypto::pcr_list(description.seal->pcrs) + ", not to " + crypto::pcr_list(wanted.pcrs) +
                     instead);
  }
}

/// Gives a home that is there a key with which it signs from now on, too. Whatever breaks off, the same
/// command brings to its end: the key comes first, then the log states it, then the identity is written.
int add_keys(const Request& request) {
  if (request.demo || request.no_passphrase || request.passphrase || request.ml_dsa || request.tpm ||
      request.pkcs11 || request.device_name || !request.recipients.empty() ||
      !request.recipient_files.empty() || !request.new_identities.empty()) {
    throw UsageError(
        "--add-ml-dsa, --add-tpm and --add-pkcs11 are about a home that is there, and take --home, --tcti, "
        "--seal-to-boot, --pcrs and --json alone");
  }
  const std::optional<WantedSeal> seal = seal_of(request);
  const Home home = Home::open(request.home);
  archive::FileSystem& files = archive::real_file_system();
  const archive::RecordingLock lock = archive::RecordingLock::take(files, home.archive());
  const crypto::VerifierKey known = home.device();
  const std::string name = known.name();
  const std::optional<crypto::Secret> passphrase = home.key_passphrase();
  std::error_code ignored;
  if (seal && fs::exists(home.hardware_file(), ignored)) require_sealed_so(home, *seal);
  if (request.add_ml_dsa && !fs::exists(home.ml_dsa_key_file(), ignored)) {
    const auto ml_dsa = crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65);
    replace_file(files, home.ml_dsa_key_file(),
                 crypto::ml_dsa_pem(ml_dsa, passphrase ? &*passphrase : nullptr).bytes(), kOwnersAlone);
  }
  if (const auto wanted = hardware_of(request); wanted && !fs::exists(home.hardware_file(), ignored)) {
    const crypto::SigningKey key = home.signing_key(passphrase);
    if (open_kept_log(home, key).log->stated_keys().hardware) {
      throw UsageError("the log of this home states a key in hardware, and " + home.hardware_file().string() +
                       " is not there: put it back from the backup; another key needs a new home "
                       "(docs/how-to/keep-a-key-in-hardware.md)");
    }
    replace_file(files, home.hardware_file(), bytes_of(make_key(*wanted, seal, home, name).to_json()),
                 kForAll);
  }
  std::string not_attested;
  if (request.add_tpm) {
    // Also of a home whose TPM key is from before its boot was quoted.
    recorder::HardwareDescription description = home.hardware();
    if (description.attestation_key.empty()) {
      not_attested = take_attestation_key(description);
      if (not_attested.empty())
        replace_file(files, home.hardware_file(), bytes_of(description.to_json()), kForAll);
    }
  }
  const crypto::SigningKey key = home.signing_key(passphrase);
  const crypto::VerifierKey all = crypto::verifier_key_of(name, key);
  const auto log = open_log(home, key);
  const archive::ApplianceLog::StatedKeys stated = log->state_keys();
  const bool is_new = lacks_a_key(known, all);
  if (is_new) {
    crypto::SignsSince since{known.ml_dsa() ? known.ml_dsa_since() : stated.ml_dsa.value_or(0),
                             known.hardware() ? known.hardware_since() : stated.hardware.value_or(0),
                             known.log_root_before_hardware()};
    if (!known.hardware() && since.hardware > 0) {
      since.log_root_before_hardware = archive::root_of_log(home.log_folder(), since.hardware);
    }
    replace_file(files, home.device_identity_file(),
                 bytes_of(crypto::write_device_identity(name, key, since)), kForAll);
  }
  const crypto::VerifierKey device = home.device();
  if (device.ml_dsa() != all.ml_dsa() || device.hardware() != all.hardware()) {
    throw Error(home.device_identity_file().string() + " is of other keys than " +
                home.ml_dsa_key_file().string() + " and " + home.hardware_file().string() +
                ": put the files back that belong to it");
  }
  const std::uint64_t entry = (request.add_ml_dsa ? stated.ml_dsa : stated.hardware).value_or(0);
  const std::string what = request.add_ml_dsa ? "an ML-DSA-65 key" : "a key in hardware";
  if (request.json) {
    ordered_json told{{"home", home.folder().string()},
                      {"device", device.to_string()},
                      {"identity", home.device_identity_file().string()},
                      {"log_entry", entry},
                      {"added", is_new}};
    tell_seal(request, home, told);
    print_json(told);
    return kDone;
  }
  if (not_attested.empty()) not_attested = stated.not_attested;
  if (!is_new) {
    std::cout << "The home " << printable(home.folder().string()) << " signs with " << what << " already.\n";
  } else {
    std::cout << "The home " << printable(home.folder().string()) << " signs with " << what
              << " beside Ed25519 from now on. Its log says so in entry " << entry << ".\nGive "
              << printable(home.device_identity_file().string())
              << " to whoever verifies: only with it are all signatures asked for.";
    if (request.add_ml_dsa) {
      std::cout << " Back up " << printable(home.ml_dsa_key_file().string()) << " as you do the device key.";
    } else {
      std::cout << " That key cannot be backed up: what is recorded while its hardware is away is unproven.";
    }
    std::cout << " Start whatever runs on this home anew.\n";
    print_sealed(request, home);
  }
  if (request.add_tpm && stated.attestation) {
    std::cout << "Its TPM quotes the measured boot into the log: entry " << *stated.attestation
              << " states the key for that.\n";
  }
  print_not_attested(not_attested);
  return kDone;
}

int run(const Request& request) {
  if (request.adds()) return add_keys(request);
  const fs::path folder = request.home ? fs::path(*request.home) : Home::default_folder();
  require_free_place(folder);
  const std::optional<WantedSeal> seal = seal_of(request);
  std::vector<std::string> recipients = given_recipients(request);
  require_enough_recipients(request, recipients.size());
  if (request.no_passphrase && request.new_identities.empty()) {
    throw UsageError(
        "--no-passphrase is about identities made with --new-identity FILE: name one, or leave it out");
  }
  Undo undo;
  const Home place(make_place(folder, undo));
  for (std::string& recipient : make_identities(request, undo)) recipients.push_back(std::move(recipient));
  if (request.demo) {
    const crypto::AgeKeyPair pair = crypto::generate_age_key();
    write_new_file(place.identity_file(), identity_file_text(pair).bytes(), 0600, undo);
    recipients.push_back(pair.recipient);
  }
  const Filled filled = fill(place, request, seal, recipients, undo);
  archive::real_file_system().sync_folder(place.folder());
  settle(place, folder);
  undo.keep_all();
  archive::real_file_system().sync_folder(fs::absolute(folder).lexically_normal().parent_path());
  print_result(request, folder, filled, recipients);
  return kDone;
}

}  // namespace

void add_init_command(Command& program) {
  Command& command = program.add_command("init", "makes a home: keys, recipients, authority, archive");
  const auto request = std::make_shared<Request>();
  add_home_option(command, request->home);
  command.writes("--home");
  command.flag("--demo", request->demo,
               "makes an identity without passphrase inside the home, to try things out; never for patients");
  command.option("-r,--recipient", "KEY", request->recipients,
                 "an existing age1... recipient who can open recordings");
  command.option("-R,--recipients-file", "FILE", request->recipient_files, "a file of them, one a line");
  command.option(
      "--new-identity", "FILE", request->new_identities,
      "makes a new identity in FILE, sealed with a passphrase that is asked for, and its recipient");
  command.writes("--new-identity");
  command.flag("--no-passphrase", request->no_passphrase,
               "new identities lie open in their files (mode 0600)");
  command.option("--device-name", "NAME", request->device_name, "how this recorder signs",
                 "this machine's name");
  command.flag("--passphrase", request->passphrase,
               "protects the device key with a passphrase, which every 'kiroku record' then needs");
  command.flag("--ml-dsa", request->ml_dsa,
               "signs checkpoints by ML-DSA-65, too, which quantum computers are not known to forge");
  command.flag("--add-ml-dsa", request->add_ml_dsa,
               "makes no home: gives one that is there, whose recorder is stopped, such a key");
  command.flag("--tpm", request->tpm,
               "signs checkpoints by a key in this machine's TPM 2.0, too, which cannot be copied");
  command.flag("--add-tpm", request->add_tpm,
               "makes no home: gives one that is there, whose recorder is stopped, such a key");
  command.option("--tcti", "TCTI", request->tcti, "the way to the TPM, as tpm2-tss has it",
                 recorder::kDefaultTcti);
  command.option(
      "--seal-to-boot", "KEY", request->approval_key,
      "the TPM's key signs only in states of the boot that this approval key approved ('kiroku boot "
      "new-key' makes one); the present state is approved at once");
  command.option("--pcrs", "LIST", request->pcrs,
                 "the registers of the SHA-256 bank that make up a state, among 0 to 9 and 14",
                 crypto::pcr_list(recorder::kUsualSealedPcrs));
  command.option("--pkcs11", "URI", request->pkcs11,
                 "the same with a PKCS#11 token (RFC 7512, with module-path, and pin-source=file:FILE)");
  command.option("--add-pkcs11", "URI", request->add_pkcs11, "as --add-tpm, with such a token");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "At least two recipients are needed, except with --demo. Keep identities away from the recorder: it "
      "needs none "
      "of them. Passphrases are asked on the terminal or taken from KIROKU_PASSPHRASE. If anything fails, "
      "nothing is "
      "left behind.");
  command.example("kiroku init --demo", "a home to try things out");
  command.example(
      "kiroku init --new-identity /media/stick-a/surgeon.txt --new-identity /media/stick-b/archive.txt",
      "a home whose recordings either stick opens");
  command.example("kiroku init --home /srv/kiroku -R recipients.txt --device-name or-3",
                  "a home for known recipients");
  command.example("kiroku init --add-ml-dsa --home /srv/kiroku",
                  "a home that is there signs with two keys from now on");
  command.example("kiroku init --add-tpm --home /srv/kiroku",
                  "a home that is there signs by this machine's TPM, too");
  command.example("kiroku init --add-tpm --seal-to-boot /media/stick/approval.pem",
                  "the same, in approved states of the boot alone");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
