#include <algorithm>
#include <chrono>
#include <cmath>
#include <fcntl.h>
#include <functional>
#include <iostream>
#include <memory>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <unistd.h>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/configuration/room_overlap.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/group_advice.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/output_file.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kiroku/store.h"
#include "apps/kiroku/stream_silence.h"
#include "archive/format/boot_quote.h"
#include "archive/search/search_key.h"
#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"
#include "crypto/pkcs8.h"
#include "crypto/secret.h"
#include "crypto/signing_key.h"
#include "crypto/tpm_quote.h"
#include "fleet/shipper.h"
#include "recorder/clock/clock_watch.h"
#include "recorder/control/control_client.h"
#include "recorder/daemon/disk_hours.h"
#include "recorder/device_key/boot_approval.h"
#include "recorder/procedure/worklist.h"
#include "recorder/source/boxed_source.h"
#include "recorder/source/source.h"
#include "recorder/vitals/vital_source.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr std::size_t kTrialBytes = 256U << 20;
constexpr std::size_t kTrialStep = 1U << 20;
constexpr double kBytesPerMegabyte = 1e6;
constexpr rlim_t kWantedLockedBytes = 8U << 20;
constexpr std::chrono::seconds kSourcePatience{5};

struct Request {
  std::optional<std::string> home;
  bool json = false;
};

enum class Health { kGood, kWarning, kBad };

struct Check {
  Health health = Health::kGood;
  std::string subject;  // "disk"
  std::string finding;  // one sentence
  std::string advice;   // what to do; "" if nothing
};

/// Looks at one thing after the other and keeps what was found.
class Examination {
 public:
  explicit Examination(bool print) : print_(print) {}
  void add(Check check) {
    if (print_) show(check);
    checks_.push_back(std::move(check));
  }
  /// What `look` throws is bad, with `advice`.
  void examine(const std::string& subject, const std::string& advice, const std::function<Check()>& look) {
    try {
      add(look());
    } catch (const std::exception& error) {
      add({Health::kBad, subject, error.what(), advice});
    }
  }
  [[nodiscard]] const std::vector<Check>& checks() const { return checks_; }
  [[nodiscard]] std::size_t count(Health health) const {
    return static_cast<std::size_t>(std::count_if(
        checks_.begin(), checks_.end(), [&](const Check& check) { return check.health == health; }));
  }

 private:
  static void show(const Check& check) {
    const std::string word = check.health == Health::kGood      ? paint(Colour::kGreen, "good   ")
                             : check.health == Health::kWarning ? paint(Colour::kYellow, "WARNING")
                                                                : paint(Colour::kRed, "BAD    ");
    std::cout << word << "  " << check.subject << ": " << printable(check.finding) << "\n";
    if (!check.advice.empty()) std::cout << "         → " << check.advice << "\n";
    std::cout << std::flush;
  }
  bool print_;
  std::vector<Check> checks_;
};

Check check_clock() {
  const recorder::CaseClock now;
  const auto state = recorder::ClockWatch(now).check();
  if (state->synchronised) {
    const double milliseconds = static_cast<double>(state->error_ns) / 1e6;
    char text[96];
    std::snprintf(text, sizeof text, "the kernel calls it synchronised, error at most %.1f ms", milliseconds);
    return {Health::kGood, "clock", text, ""};
  }
  return {Health::kWarning, "clock",
          "it is not synchronised, so that times in cases are only this machine's opinion",
          "apt install chrony, or allow NTP (UDP 123) to the hospital's time server"};
}

Check check_permissions(const Home& home, const Configuration& configuration) {
  std::vector<std::pair<std::string, fs::path>> secrets{{"device key", home.device_key_file()}};
  std::error_code ignored;
  if (fs::exists(home.ml_dsa_key_file(), ignored)) secrets.emplace_back("ML-DSA key", home.ml_dsa_key_file());
  if (const std::string& token = configuration.daemon.hook_token_file; !token.empty()) {
    secrets.emplace_back("hook token", home.folder() / token);
  }
  for (const auto& [subject, file] : secrets) {
    if (!is_open_to_others(file)) continue;
    return {Health::kBad, subject, file.string() + " can be read by others than its owner",
            "chmod 600 " + file.string() + (subject == "hook token" ? ", and take another token" : "")};
  }
  if (::access(home.archive().c_str(), W_OK) != 0) {
    return {Health::kBad, "archive", home.archive().string() + " cannot be written by this user",
            "run as the user that records (sudo -u kiroku kiroku doctor), or give it the folder"};
  }
  return {Health::kGood, "permissions", "secrets are their owner's alone, the archive can be written", ""};
}

/// Whether the home signs with both keys, and verifiers can know. The keys are not opened: they may have a
/// passphrase.
Check check_signatures(const Home& home) {
  const std::string subject = "signatures";
  std::error_code ignored;
  const bool has_key = fs::exists(home.ml_dsa_key_file(), ignored);
  const bool has_identity = home.device().ml_dsa().has_value();
  if (!has_key && has_identity) {
    return {Health::kBad, subject,
            home.device_identity_file().string() + " says that this device signs with an ML-DSA key, and " +
                home.ml_dsa_key_file().string() + " is not there: what is signed now counts as forged",
            "put device-ml-dsa.key back from the backup before anything is recorded"};
  }
  if (!has_key) {
    return {Health::kGood, subject,
            "checkpoints are signed without ML-DSA, so that a quantum computer could forge them; kiroku init "
            "--add-ml-dsa adds a key",
            ""};
  }
  if (!has_identity) {
    return {Health::kWarning, subject,
            "there is an ML-DSA key, and verifiers cannot know it: device.identity does not state it",
            "stop the recorder, then kiroku init --add-ml-dsa --home " + home.folder().string() +
                ", and give device.identity to whoever verifies"};
  }
  const crypto::VerifierKey device = home.device();
  const crypto::Secret pem =
      crypto::Secret::copy_of(read_small_file(home.ml_dsa_key_file(), "the ML-DSA key"));
  if (!crypto::SigningKey::pem_is_encrypted(pem.text())) {
    const auto key = crypto::ml_dsa_of_pem(crypto::MlDsaSet::k65, pem.text(), nullptr);
    if (!key || key->public_key() != device.ml_dsa().value().key()) {
      return {Health::kBad, subject,
              home.ml_dsa_key_file().string() + " is not the ML-DSA key that " +
                  home.device_identity_file().string() + " states: what is signed with it counts as forged",
              "put the key back from the backup before anything is recorded"};
    }
  }
  return {Health::kGood, subject,
          "checkpoints are signed by Ed25519 and ML-DSA-65" +
              (device.ml_dsa_since() == 0
                   ? std::string()
                   : ", since entry " + std::to_string(device.ml_dsa_since()) + " of the appliance log"),
          ""};
}

/// To what a TPM's key that signs now is sealed.
std::string seal_sentence(const recorder::HardwareDescription& description) {
  if (!description.seal) return "; it is not sealed: it signs in every state of the boot";
  return "; it is sealed to registers " + crypto::pcr_list(description.seal->pcrs) +
         " of the boot, whose state is approved; whether that of the next boot is cannot be known before it: "
         "after an update of firmware, boot loader or kernel it is another";
}

/// Whether the key in hardware signs now. What it does not sign is unproven.
Check check_hardware(const Home& home) {
  const std::string subject = "key in hardware";
  std::error_code ignored;
  const std::optional<crypto::HardwareVerifierKey> stated = home.device().hardware();
  if (!fs::exists(home.hardware_file(), ignored)) {
    if (stated) {
      return {Health::kBad, subject,
              home.device_identity_file().string() +
                  " says that this device signs with a key in hardware, and " +
                  home.hardware_file().string() + " is not there: what is recorded now is unproven",
              "put device-hardware.json back from the backup; it holds no secret"};
    }
    return {
        Health::kGood, subject,
        "there is none: whoever copies device.key can sign as this device; kiroku init --add-tpm adds one",
        ""};
  }
  const recorder::HardwareDescription description = home.hardware();
  const std::string address = description.kind == recorder::HardwareDescription::Kind::kTpm
                                  ? "the TPM at " + description.address
                                  : "the PKCS#11 token";
  if (!stated || stated->key() != description.public_key) {
    return {Health::kBad, subject,
            home.hardware_file().string() +
                " names a key that device.identity does not state: verifiers cannot "
                "know it",
            "stop the recorder, then kiroku init --add-" +
                std::string(description.kind == recorder::HardwareDescription::Kind::kTpm ? "tpm"
                                                                                          : "pkcs11 URI") +
                " --home " + home.folder().string() + ", and give device.identity to whoever verifies"};
  }
  constexpr std::string_view kQuestion = "kiroku doctor\n";
  const auto begin = std::chrono::steady_clock::now();
  const auto signer = home.hardware_signer();
  const auto answer = signer->sign(bytes_of(kQuestion));
  const auto took =
      std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() - begin);
  if (answer.signature.empty() ||
      !crypto::verify_ecdsa_p256(description.public_key, bytes_of(kQuestion), answer.signature)) {
    return {Health::kBad, subject,
            address + " does not sign, so that what is recorded now is unproven: " +
                (answer.why.empty() ? "its signature is another key's" : answer.why),
            description.seal ? "'kiroku boot state' tells whether the state of the boot is approved, and "
                               "what to do; if the TPM "
                               "cannot be asked, see whether this user may use it (group tss)"
                             : "see whether this user may use it (a TPM: group tss) and whether it is the "
                               "one of the ceremony"};
  }
  std::string signs =
      address + " signs checkpoints beside Ed25519; it answered in " + std::to_string(took.count()) + " ms";
  if (description.kind == recorder::HardwareDescription::Kind::kTpm) signs += seal_sentence(description);
  if (description.kind != recorder::HardwareDescription::Kind::kTpm) {
    return {Health::kGood, subject, signs, ""};
  }
  if (description.seal) {
    const auto approvals = recorder::read_approvals(home.boot_approvals_folder(), *description.seal);
    if (!approvals.problems.empty()) {
      return {Health::kWarning, subject, signs + "; " + approvals.problems.front(),
              "take that approval in again with 'kiroku boot accept', or remove the file"};
    }
  }
  if (signer->attester() == nullptr) {
    return {Health::kWarning, subject, signs + "; the log does not have it quote the measured boot",
            "stop the recorder, then kiroku init --add-tpm --home " + home.folder().string()};
  }
  const auto quoted = signer->attester()->quote(crypto::sha256(bytes_of(kQuestion)));
  if (!quoted.quote) {
    return {Health::kWarning, subject, signs + "; it does not quote the measured boot: " + quoted.why,
            "recording is not affected; look into the machine's TPM settings"};
  }
  if (const std::string empty = archive::unmeasured_registers(quoted.quote->pcrs); !empty.empty()) {
    return {
        Health::kWarning, subject,
        signs + "; its quotes say nothing of the boot, as the firmware measures nothing into register " +
            empty,
        "recording is not affected; switch on the TPM's SHA-256 bank in the firmware's settings, and start "
        "the machine by UEFI"};
  }
  return {Health::kGood, subject, signs + ", and quotes the measured boot", ""};
}

Check check_recipients(const Home& home, const Configuration& configuration) {
  const RecipientChoice recipients(home, configuration, {});
  recipients.require_all_files();
  if (const std::vector<std::string> idle = idle_recipients(configuration); !idle.empty()) {
    return {Health::kWarning, "recipients", joined(idle, "; "),
            "write the name of what is recorded; or take the line away, if `kiroku record` is not used here"};
  }
  std::error_code ignored;
  if (fs::exists(home.identity_file(), ignored)) {
    return {Health::kWarning, "recipients",
            "this home holds an identity that opens what it records (made by init --demo)",
            "for real cases make a home with --new-identity on a stick that is kept elsewhere"};
  }
  return {Health::kGood, "recipients",
          std::to_string(recipients.usual().size()) + " can open what is recorded, none of them this machine",
          ""};
}

Check check_retention(const Configuration& configuration) {
  const std::vector<std::string> doubts = doubtful_retention(configuration);
  if (!doubts.empty()) {
    return {
        Health::kWarning, "retention", joined(doubts, "; "),
        "look at names and times of [[retention]] in kiroku.toml; leave a rule that cases of before need"};
  }
  return {Health::kGood, "retention",
          std::to_string(configuration.retention.rules.size()) + " rule(s), each for what is recorded here",
          ""};
}

Check check_rooms(const Configuration& configuration) {
  const std::vector<std::string> shared = shared_by_rooms(configuration.rooms);
  if (shared.empty()) return {Health::kGood, "rooms", "no room has what is another's", ""};
  return {Health::kWarning, "rooms", joined(shared, "; "),
          "look at [[room]] in kiroku.toml, and leave it if that is meant"};
}

Check check_decoders() {
  const std::string why = recorder::why_unboxed();
  if (why.empty())
    return {Health::kGood, "decoders", "each source is decoded in a box, by a process without keys", ""};
  return {Health::kBad, "decoders",
          "sources are decoded beside the device key, and cases are not shown: " + why,
          "install Kiroku anew; its kernel needs seccomp, as Debian's has (docs/how-to/operations.md)"};
}

/// Writes and flushes a trial file as recording would.
double trial_megabytes_per_second(const fs::path& archive) {
  const fs::path trial = archive / ".doctor-trial";
  const int descriptor = ::open(trial.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (descriptor < 0) throw IoError("write", trial, errno);
  ::unlink(trial.c_str());  // goes with the descriptor, whatever becomes of this process
  const Bytes block(kTrialStep, std::byte{0x5A});
  const auto begin = std::chrono::steady_clock::now();
  int failed = 0;
  try {
    for (std::size_t done = 0; done < kTrialBytes; done += kTrialStep) write_all(descriptor, block, trial);
    if (::fdatasync(descriptor) != 0) failed = errno;
  } catch (...) {
    ::close(descriptor);
    throw;
  }
  ::close(descriptor);
  if (failed != 0) throw IoError("flush", trial, failed);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  return static_cast<double>(kTrialBytes) / kBytesPerMegabyte / took.count();
}

std::uint64_t free_bytes(const Home& home) {
  struct statvfs disk {};
  if (::statvfs(home.archive().c_str(), &disk) != 0)
    throw IoError("ask for the free space of", home.archive(), errno);
  return std::uint64_t(disk.f_bavail) * disk.f_frsize;
}

Check check_disk(const Home& home) {
  const std::uint64_t free = free_bytes(home);
  if (free < 2 * kTrialBytes) {
    return {Health::kBad, "disk", "only " + format_bytes(free) + " are free in " + home.archive().string(),
            "make room before anything is recorded"};
  }
  const double speed = trial_megabytes_per_second(home.archive());
  std::string finding = format_bytes(free) + " free, writes " + std::to_string(std::lround(speed)) + " MB/s";
  constexpr double kSlow = 20;
  if (speed < kSlow) {
    return {Health::kWarning, "disk", finding,
            "too slow for anything but MPEG-2; look at its cable, its file system, its age"};
  }
  return {Health::kGood, "disk", finding, ""};
}

/// Another disk in the place of the archive's, or none, has another log.
Check check_log(const Home& home) {
  const std::string why = why_another_log(home);
  if (why.empty())
    return {Health::kGood, "appliance log", "it goes on from the newest checkpoint that the home keeps", ""};
  return {Health::kBad, "appliance log", why,
          "mount the archive's disk, or put the log back, and start kirokud"};
}

Check check_locked_memory() {
  rlimit limit{};
  ::getrlimit(RLIMIT_MEMLOCK, &limit);
  if (limit.rlim_cur >= kWantedLockedBytes || ::geteuid() == 0) {
    return {Health::kGood, "memory", "keys can be kept out of the swap", ""};
  }
  return {Health::kWarning, "memory",
          "only " + format_bytes(limit.rlim_cur) + " can be locked, so that keys may reach the swap",
          "set LimitMEMLOCK=64M (the unit has it), or ulimit -l 65536"};
}

Check check_authority(const recorder::NamedAuthority& authority, const timestamp::TrustStore& trust) {
  const std::string subject = "authority " + authority.name;
  const auto begin = std::chrono::steady_clock::now();
  const UtcTime before = utc_now();
  const timestamp::TokenJudgement judgement = ask_for_time(authority, trust);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
  if (judgement.code != timestamp::TokenCode::kValid) {
    return {Health::kBad, subject, judgement.explanation,
            "its tokens prove nothing here: add its root to trust.pem, or ask another authority"};
  }
  const double offset_s = std::chrono::duration<double>(judgement.info->gen_time - before).count();
  char text[128];
  const bool own = judgement.authority == timestamp::TimeAuthority::kOwn;
  std::snprintf(text, sizeof text, "answers in %.0f ms; its clock is %+.1f s from this machine's%s",
                took.count(), offset_s, own ? "; self-issued" : "");
  constexpr double kFarOff = 5;
  if (std::abs(offset_s) > kFarOff)
    return {Health::kWarning, subject, text, "one of the two clocks is wrong: look at NTP first"};
  return {Health::kGood, subject, text, ""};
}

/// Roots that an older `kiroku init` put among the outside ones, or a person.
Check check_roots(const Home& home, const timestamp::TrustStore& trust) {
  const std::vector<std::string> own = trust.own_among_outside();
  if (own.empty())
    return {Health::kGood, "roots", "the home's own authority is not among the outside ones", ""};
  return {Health::kWarning, "roots",
          home.trust_file().string() + " holds a root of this recorder's own authority, " + own.front() +
              ": time under it is self-issued all the same",
          "move it to " + home.own_authority_file().string()};
}

Check not_examined(const std::string& subject, const GroupAdvice& group) {
  return {Health::kWarning, subject, group.finding, group.advice};
}

Check check_footswitch(const RoomConfiguration& room, const recorder::FootswitchOptions& options) {
  const std::string subject = "footswitch " + room.name + ", " + options.device;
  try {
    recorder::try_footswitch(options);
  } catch (const IoError& error) {
    // One that is looked for by its name may be any of them.
    const bool by_name = options.device.starts_with("name:");
    const std::string device = by_name ? "/dev/input/event0" : options.device;
    const auto group = group_advice(device);
    if (error.error_number() == EACCES && group) return not_examined(subject, *group);
    throw;
  }
  return {Health::kGood, subject, "is there and has the key", ""};
}

Check check_source(const RoomConfiguration& room, const StreamConfiguration& stream) {
  const std::string subject = "source " + room.name + "/" + stream.name;
  const recorder::SourceAddress address = recorder::parse_source_address(stream.source);
  if (const auto group = group_advice(address.location)) return not_examined(subject, *group);
  const recorder::CaseClock clock;
  if (!stream.is_video) {
    static_cast<void>(recorder::open_vital_source(address, clock));
    const bool of_all_beds =
        address.kind == recorder::SourceKind::kMonitors && !address.options.contains("locations");
    return {Health::kGood, subject,
            "'" + address.stated + "' can be opened" +
                (of_all_beds ? "; what comes there of any bed is recorded, as no locations= is named" : ""),
            ""};
  }
  recorder::OpeningTerms terms;
  terms.patience = kSourcePatience;
  const auto source = recorder::open_source(address, clock, terms);
  const recorder::Rational rate = source->frame_rate();
  char text[64];
  std::snprintf(text, sizeof text, "%.4g pictures a second",
                double(rate.numerator) / double(rate.denominator));
  return {Health::kGood, subject, source->format().to_string() + ", " + text, ""};
}

Check check_microphone(const RoomConfiguration& room, const StreamConfiguration& stream) {
  const std::string subject = "microphone " + room.name + "/" + stream.name;
  const char* const devices = "/dev/snd/timer";  // of the group that all of ALSA's have
  if (const auto group = group_advice(devices)) return not_examined(subject, *group);
  const recorder::CaseClock clock;
  recorder::OpeningTerms terms;
  terms.patience = kSourcePatience;
  const auto source = recorder::open_source(recorder::parse_source_address(stream.microphone), clock, terms);
  if (!source->read()) throw Error("'" + stream.microphone + "' gives nothing");
  return {Health::kGood, subject, source->input(), ""};
}

/// A case begins without it: never worse than a warning.
Check check_worklist(const RoomConfiguration& room) {
  const std::string subject = "worklist of " + room.name;
  const recorder::WorklistAnswer answer = recorder::ask_worklist(*room.procedure.worklist, utc_now());
  if (!answer.problem.empty()) {
    return {
        Health::kWarning, subject, answer.problem,
        "look at address and titles in kiroku.toml, and whether the worklist knows calling_ae; cases begin "
        "without it"};
  }
  const std::string lists = "lists " + std::to_string(answer.items.size()) + " steps of these days";
  if (const std::string left_out = recorder::left_out_of(answer); !left_out.empty()) {
    return {Health::kWarning, subject, lists + "; " + left_out,
            answer.not_asked_for > 0 || answer.is_cut
                ? "look at station_ae and modality in kiroku.toml; have whoever keeps the worklist compare "
                  "both; a case whose step cannot be chosen needs its patient typed in"
                : "have whoever keeps the worklist shorten these steps, or state their times; a case for one "
                  "of them needs its patient typed in"};
  }
  return {Health::kGood, subject, lists, ""};
}

/// An object of a minute tells whether the store's locks hold.
Check check_store(const Home& home) {
  const StoreConfiguration of = store_of(home);
  const std::string bucket = "bucket '" + of.bucket + "' of " + of.endpoint;
  fleet::ObjectStore store = open_store(home, of);
  try {
    const fleet::LockProbe found = fleet::probe_lock(store, of.appliance);
    if (!found.fails() && !found.holds()) {
      return {Health::kWarning, "store",
              bucket +
                  " removes nothing for this access key, locked or not: whether its locks hold was not shown",
              "such a key is well; 'kiroku ship --probe' with one that may remove objects shows it, once"};
    }
    if (found.fails()) {
      return {Health::kBad, "store", bucket + " did not hold an object for the minute that it was locked",
              "what is there can be removed: 'kiroku ship --probe' says how; have it put right, or take "
              "another store"};
    }
  } catch (const fleet::StoreError& error) {
    return {Health::kWarning, "store", error.what(),
            "cases are recorded without it, and go there once it takes them"};
  }
  return {Health::kGood, "store", bucket + " holds what it locks", ""};
}

/// Recording waits for none of it.
Check check_search_key(const Home& home, const Configuration& configuration) {
  constexpr const char* kSubject = "search key";
  try {
    const search::ApplianceKey key = search::ApplianceKey::read(home.folder() / configuration.search.key);
    const bool ships = configuration.store.has_value();
    if (ships && store_of(home).appliance != key.appliance)
      return {Health::kWarning, kSubject,
              "is of the appliance " + key.appliance + ", and this one ships as " + store_of(home).appliance,
              "nobody finds its cases by patient or procedure: have one made for that name"};
    if (key.step >= search::kMostSteps)
      return {Health::kWarning, kSubject, "has made all notes that it can", "have another one made"};
    return {Health::kGood, kSubject, "has made " + counted(key.step, "note", "notes"), ""};
  } catch (const Error& error) {
    return {Health::kWarning, kSubject, error.what(),
            "cases are recorded all the same, and nobody finds them by patient or procedure"};
  }
}

/// What `kiroku status` and doctor say of the disk is one figure: kirokud's where it runs, which knows what
/// rooms really write, else by what they are configured for.
struct SpaceLeft {
  recorder::DiskHours hours;
  std::uint64_t bytes_free = 0;
};
SpaceLeft space_left(const Home& home, const Configuration& configuration,
                     const std::optional<nlohmann::json>& status) {
  SpaceLeft left;
  if (status) {
    const nlohmann::json& disk = status->at("disk");
    if (!disk.is_object()) throw Error("kirokud cannot look at the archive");
    left.bytes_free = disk.at("free_bytes").get<std::uint64_t>();
    if (disk.at("hours_left").is_number()) left.hours.hours = disk.at("hours_left").get<double>();
    left.hours.are_at_most = disk.value("hours_at_most", false);
    left.hours.assumes = disk.value("hours_assume", "");
    return left;
  }
  std::vector<recorder::RoomRate> rates;
  for (const RoomConfiguration& room : configuration.rooms) {
    std::vector<recorder::ConfiguredVideo> videos;
    for (const StreamConfiguration& stream : room.streams) {
      if (stream.is_video) videos.push_back({stream.video, stream.source});
      if (stream.also) {
        videos.push_back({stream.video, stream.source});
        videos.back().video.profile = *stream.also;
      }
    }
    rates.push_back(recorder::rate_of(room.name, 0, 0, recorder::configured_bytes_per_second(videos)));
  }
  left.bytes_free = free_bytes(home);
  left.hours = recorder::disk_hours(left.bytes_free, rates);
  return left;
}

Check check_hours(const Home& home, const Configuration& configuration,
                  const std::optional<nlohmann::json>& status) {
  const auto& [left, bytes_free] = space_left(home, configuration, status);
  std::string finding;
  if (left.hours) {
    char hours[32];
    std::snprintf(hours, sizeof hours, "%s %.1f", left.are_at_most ? "at most" : "about", *left.hours);
    finding = std::string(hours) + " if every room records (" + left.assumes + ")";
  } else {
    finding = format_bytes(bytes_free) + " are free, for how long is not known yet: " + left.assumes;
  }
  const std::string subject = "hours of disk";
  const double least = configuration.storage.warn_below_hours;
  if (!recorder::is_short(left, bytes_free, configuration.rooms.size(), least))
    return {Health::kGood, subject, finding, ""};
  return {Health::kWarning, subject, finding, "make room, or replicate and erase what may be erased"};
}

/// The status of the recorder that runs on this home, which then holds the sources; nothing where none runs.
std::optional<nlohmann::json> running_recorder(const Home& home, const Configuration& configuration,
                                               Examination& out) {
  try {
    auto status = recorder::ask_recorder(home.control_socket(configuration), {{"do", "status"}});
    out.add({Health::kGood, "kirokud",
             "runs since " + format_duration(status.value("uptime_s", std::int64_t{0}) * 1'000'000'000), ""});
    return status;
  } catch (const Error&) {
    if (!configuration.rooms.empty()) {
      out.add({Health::kWarning, "kirokud", "does not run on this home",
               "systemctl start kirokud, or kirokud --home DIR"});
    }
    return {};
  }
}

/// `is_taken`: whether a recorder holds them by now, as a case has begun meanwhile.
void examine_sources(const RoomConfiguration& room, const std::function<bool()>& is_taken, Examination& out) {
  const auto unless_taken = [&](const std::string& subject, const std::function<Check()>& check) {
    try {
      return check();
    } catch (const Error&) {
      if (is_taken()) return Check{Health::kGood, subject, "a case has begun: kirokud holds it now", ""};
      throw;
    }
  };
  for (const StreamConfiguration& stream : room.streams) {
    const std::string source = "source " + room.name + "/" + stream.name;
    out.examine(source, "look at cable, power and address; a case begins without it and states the gap",
                [&] { return unless_taken(source, [&] { return check_source(room, stream); }); });
    if (stream.microphone.empty()) continue;
    const std::string microphone = "microphone " + room.name + "/" + stream.name;
    out.examine(microphone,
                "look at its plug, and at its name in kiroku.toml ('kiroku devices'); pictures are recorded "
                "without it",
                [&] { return unless_taken(microphone, [&] { return check_microphone(room, stream); }); });
  }
}

void examine_footswitches(const RoomConfiguration& room, Examination& out) {
  for (const recorder::FootswitchOptions& footswitch : room.footswitches) {
    out.examine("footswitch " + room.name + ", " + footswitch.device,
                "look at its plug and at the device's name in kiroku.toml; cases can be started without it",
                [&] { return check_footswitch(room, footswitch); });
  }
}

/// What the recorder's status says of a room; empty where it does not have it.
nlohmann::json room_of(const nlohmann::json& status, const std::string& name) {
  for (const nlohmann::json& room : status.value("rooms", nlohmann::json::array())) {
    if (room.value("room", "") == name) return room;
  }
  return {};
}

/// Of a room that records, or records ahead: kirokud holds its sources, and says which of them deliver.
void examine_held_sources(const RoomConfiguration& room, const nlohmann::json& told, Examination& out) {
  const std::string state = told.value("state", "") == "standby" ? "records ahead" : "records";
  for (const nlohmann::json& stream : told.value("streams", nlohmann::json::array())) {
    const std::string source = "source " + room.name + "/" + printable(stream.value("name", ""));
    const std::string age = format_duration(stream.value("age_ms", std::int64_t{0}) * 1'000'000);
    if (is_silent(stream)) {
      out.add({Health::kBad, source, "the room " + state + ", and it delivers nothing since " + age,
               "look at cable, power and address; the gap is stated in a case, which begins without it"});
    } else if (!stream.value("live", false)) {
      out.add({Health::kWarning, source, "the room " + state + ", and it delivers nothing yet",
               "it is being opened: ask again in some seconds"});
    } else {
      out.add({Health::kGood, source, "the room " + state + ", and it delivers", ""});
    }
  }
}

/// Of a room of the recorder that runs: what it says itself. An idle one holds no source, and can tell of
/// none.
void examine_running_room(const RoomConfiguration& room, const nlohmann::json& told, Examination& out) {
  const std::string state = told.value("state", ""), problem = told.value("problem", "");
  if (holds_sources(state)) {
    examine_held_sources(room, told, out);
  } else if (state != "idle") {
    out.add({Health::kGood, "sources of " + room.name,
             "the room is " + state + ", and kirokud holds them: 'kiroku status' tells how they are", ""});
  }
  if (!problem.empty()) {
    out.add({Health::kWarning, "room " + room.name, printable(problem), "'kiroku status' tells more"});
  }
  for (const nlohmann::json& way : told.value("procedure", nlohmann::json::array())) {
    if (way.value("well", true)) continue;
    out.add({Health::kBad, way.value("name", "") + " of " + room.name, printable(way.value("state", "")),
             "until it is well a person says whom a case is about: look at [room.procedure] of kiroku.toml"});
  }
  for (const nlohmann::json& footswitch : told.value("footswitches", nlohmann::json::array())) {
    if (footswitch.value("well", true)) continue;
    out.add({Health::kWarning, "footswitch " + room.name + ", " + footswitch.value("device", ""),
             printable(footswitch.value("state", "")), "look at its plug; cases can be started without it"});
  }
}

void examine_all(const Home& home, const Configuration& configuration, Examination& out) {
  const timestamp::TrustStore trust = home.trust();
  out.add({Health::kGood, "configuration",
           home.configuration_file().string() + " is good, " + std::to_string(configuration.rooms.size()) +
               " room(s)",
           ""});
  out.examine("permissions", "make the home anew with kiroku init, or restore it",
              [&] { return check_permissions(home, configuration); });
  out.examine("signatures", "put device.pub, device.identity and the keys back from the backup",
              [&] { return check_signatures(home); });
  out.examine("key in hardware", "put device-hardware.json and device.identity back from the backup",
              [&] { return check_hardware(home); });
  out.examine("recipients", "without recipients nothing can be recorded: kiroku init --help",
              [&] { return check_recipients(home, configuration); });
  if (!configuration.retention.rules.empty()) out.add(check_retention(configuration));
  if (configuration.rooms.size() > 1) out.add(check_rooms(configuration));
  out.examine("disk", "look at the disk of the archive", [&] { return check_disk(home); });
  out.examine("appliance log", "look at the disk of the archive", [&] { return check_log(home); });
  out.add(check_locked_memory());
  out.add(check_clock());
  out.add(check_decoders());
  out.add(check_roots(home, trust));
  const Authorities authorities(home, configuration, {});
  for (const recorder::NamedAuthority& authority : authorities.named()) {
    out.examine("authority " + authority.name,
                "give it another path in kiroku.toml (proxy, or another interface such as a mobile link), or "
                "another authority",
                [&] { return check_authority(authority, trust); });
  }
  for (const RoomConfiguration& room : configuration.rooms) {
    if (room.procedure.worklist) out.add(check_worklist(room));
  }
  if (configuration.store) {
    out.examine("store", "look at [store] of kiroku.toml and at its file of credentials",
                [&] { return check_store(home); });
  }
  if (!configuration.search.key.empty()) out.add(check_search_key(home, configuration));
  const std::optional<nlohmann::json> status = running_recorder(home, configuration, out);
  if (!configuration.rooms.empty()) {
    out.examine("hours of disk", "look at the disk of the archive",
                [&] { return check_hours(home, configuration, status); });
  }
  for (const RoomConfiguration& room : configuration.rooms) {
    const nlohmann::json told = status ? room_of(*status, room.name) : nlohmann::json();
    if (!told.empty()) examine_running_room(room, told, out);
    const auto is_taken = [&] {
      if (told.empty()) return false;
      const auto now = recorder::ask_recorder(home.control_socket(configuration), {{"do", "status"}});
      return room_of(now, room.name).value("state", "idle") != "idle";
    };
    if (told.empty() || told.value("state", "") == "idle") examine_sources(room, is_taken, out);
    // A recorder that runs holds these, also between cases.
    if (told.empty()) examine_footswitches(room, out);
  }
}

ordered_json checks_json(const Examination& examination) {
  ordered_json checks = ordered_json::array();
  for (const Check& check : examination.checks()) {
    const char* health = check.health == Health::kGood      ? "good"
                         : check.health == Health::kWarning ? "warning"
                                                            : "bad";
    checks.push_back({{"subject", check.subject},
                      {"health", health},
                      {"finding", check.finding},
                      {"advice", check.advice}});
  }
  return {{"checks", checks}};
}

int run(const Request& request) {
  const Home home = Home::open(request.home);
  const Configuration configuration = home.configuration();
  Examination examination(!request.json);
  examine_all(home, configuration, examination);
  if (request.json) {
    print_json(checks_json(examination));
  } else {
    std::cout << examination.count(Health::kGood) << " good, " << examination.count(Health::kWarning)
              << " warnings, " << examination.count(Health::kBad) << " bad\n";
  }
  return examination.count(Health::kBad) == 0 ? kDone : kAnswerIsNo;
}

}  // namespace

void add_doctor_command(Command& program) {
  Command& command = program.add_command("doctor", "looks whether this machine is ready to record");
  const auto request = std::make_shared<Request>();
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Looks at configuration, permissions, recipients, disk, clock, time-stamping authorities, worklists "
      "and sources, and says what to do about what is not good. Where kirokud runs it opens the sources of "
      "idle "
      "rooms alone, not while a case may begin; of rooms that record, or record ahead, kirokud says which "
      "deliver. Writes a trial file of 256 MB into the "
      "archive "
      "and removes it. Exit status "
      "1 if anything is bad.");
  command.example("kiroku doctor", "before the first case of the day");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
