#include "apps/verify/judging.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "apps/common/file.h"
#include "apps/common/progress.h"
#include "apps/common/terminal.h"
#include "base/error.h"

namespace kiroku::apps {
namespace {

unsigned parse_threads(const std::optional<std::string>& text) {
  if (!text) return 0;
  if (text->empty() || text->size() > 4 || text->find_first_not_of("0123456789") != std::string::npos) {
    throw UsageError("--threads is '" + *text + "', which is no number of threads: give 1 or more");
  }
  return unsigned(std::stoul(*text));
}

constexpr const char* kAlgorithms = "the policy of algorithms";
constexpr const char* kWitnesses = "the policy of witnesses";

/// A policy, and the hash of what it was read from.
template <typename Policy>
std::pair<Policy, crypto::Sha256Digest> take_policy(const std::filesystem::path& file, const char* what) {
  const Bytes text = read_small_file(file, what);
  return {Policy::parse(text_of(text), file.string()), crypto::sha256(text)};
}

}  // namespace

evidence::Policy read_policy(const std::filesystem::path& file) {
  return take_policy<evidence::Policy>(file, kAlgorithms).first;
}

crypto::WitnessPolicy read_witnesses(const std::filesystem::path& file) {
  return take_policy<crypto::WitnessPolicy>(file, kWitnesses).first;
}

void add_judging_options(Command& command, JudgingRequest& request, const VerifyExtras& extras) {
  const bool home = bool(extras.defaults);
  command.option(
      "--device", "FILE", request.devices,
      home ? "trusted device: a device.identity, a device.pub (then Ed25519 alone is checked) or that "
             "key itself; instead of the home's"
           : "trusted device: a device.identity, a device.pub (then Ed25519 alone is checked) or "
             "that key itself");
  command.option("--trust", "PEM", request.trust,
                 home ? "roots of outside time-stamping authorities that are trusted; instead of the home's"
                      : "roots of outside time-stamping authorities that are trusted");
  command.option("--own-authority", "PEM", request.own_authority,
                 home ? "roots of the recorder's own authority, whose time is self-issued; instead of the "
                        "home's"
                      : "roots of the recorder's own authority, whose time is self-issued");
  command.option("--untrusted", "PEM", request.untrusted,
                 "certificates that help to build a chain without being trusted");
  command.option("--log", "DIR", request.log, "appliance log that must know the case",
                 home ? "the home's, for cases in its archive" : "");
  command.option("--against", "NOTE", request.against,
                 "checkpoint kept outside, or a copy of the folder from before: tells what was cut off or "
                 "rewritten since");
  command.option(
      "--proof", "FILE", request.log_proof,
      "a .tlog-proof of the case's end in the appliance log, which 'kiroku log prove' writes: says "
      "without the log whether the case ended as the device entered it there");
  command.option(
      "--witnesses", "FILE", request.witnesses,
      home ? "a policy of witnesses; says who cosigned the log's checkpoint that holds the case, of "
             "--proof, of --against, or as the home keeps it"
           : "a policy of witnesses; says who cosigned the log's checkpoint that holds the case, of "
             "--proof or of --against");
  command.option("--evidence", "FILE", request.evidence, "evidence record that must hold for the case",
                 "evidence/<case>.ers beside it, if it is there");
  command.option("--policy", "FILE", request.policy, "TOML file that says until when algorithms count",
                 "no algorithm ends");
  command.option(
      "-i,--identity", "FILE", request.identities,
      extras.inspect ? "also decrypts every segment and decodes it" : "also decrypts every segment");
  command.option("--threads", "N", request.threads, "how many threads hash", "one a core");
}

Judge::Judge(const JudgingRequest& request, const VerifyExtras& extras) : request_(request), extras_(extras) {
  for (const std::string& device : request.devices) {
    for (crypto::VerifierKey& key : load_device_keys(device)) devices_.push_back(std::move(key));
  }
  for (const std::string& file : request.identities) {
    for (auto& identity : crypto::load_identity_file(file, ask_passphrase)) {
      identities_.push_back(std::move(identity));
    }
  }
  if (request.opened != nullptr)
    identities_.insert(identities_.end(), request.opened->begin(), request.opened->end());
  against_ = load_kept_outside(request.against);
  if (request.log_proof) {
    log_proof_ = {*request.log_proof,
                  std::string(text_of(read_small_file(*request.log_proof, "the proof from the log")))};
  }
  if (request.policy)
    std::tie(policy_, policy_hash_) = take_policy<evidence::Policy>(*request.policy, kAlgorithms);
  if (request.witnesses)
    std::tie(witnesses_, witnesses_hash_) =
        take_policy<crypto::WitnessPolicy>(*request.witnesses, kWitnesses);
  threads_ = parse_threads(request.threads);
}

std::optional<archive::OutsideNote> Judge::home_note(const VerifyDefaults& defaults) const {
  return witnesses_ && !request_.log ? defaults.witnessed_note : std::nullopt;
}

timestamp::TrustStore Judge::trust_by(const VerifyDefaults& defaults, Judged& judged) const {
  const bool by_default = request_.trust.empty() && request_.own_authority.empty();
  timestamp::TrustStore trust;
  const auto take = [&](const std::vector<std::string>& given,
                        const std::vector<std::filesystem::path>& usual, auto add,
                        std::vector<TakenFile>& taken) {
    const std::vector<std::filesystem::path> named(given.begin(), given.end());
    for (const std::filesystem::path& file : by_default ? usual : named) {
      const Bytes bytes = read_small_file(file, "certificates from");
      (trust.*add)(bytes, file.string());
      taken.push_back({file, crypto::sha256(bytes)});
    }
  };
  take(request_.trust, defaults.trust, &timestamp::TrustStore::add_trusted, judged.roots);
  take(request_.own_authority, defaults.own_authority, &timestamp::TrustStore::add_own_authority,
       judged.own_roots);
  for (const std::string& file : request_.untrusted) trust.add_untrusted_file(file);
  return trust;
}

void Judge::with_rules(const std::filesystem::path& folder,
                       const std::function<void(const evidence::JudgingRules&)>& work) const {
  const VerifyDefaults defaults = extras_.defaults ? extras_.defaults(folder) : VerifyDefaults{};
  Judged ignored;
  const timestamp::TrustStore trust = trust_by(defaults, ignored);
  work({.trust = trust.has_trusted() ? &trust : nullptr,
        .policy = policy_ ? &*policy_ : nullptr,
        .now = utc_now()});
}

Judged Judge::judge(const std::filesystem::path& folder) const {
  const VerifyDefaults defaults = extras_.defaults ? extras_.defaults(folder) : VerifyDefaults{};
  Judged judged;
  const timestamp::TrustStore trust = trust_by(defaults, judged);
  judged.policy = policy_hash_;
  judged.witnesses = witnesses_hash_;

  archive::VerifyOptions options;
  options.devices = judged.devices = request_.devices.empty() ? defaults.devices : devices_;
  if (trust.has_trusted()) options.trust = &trust;
  options.log = judged.log =
      request_.log ? std::optional<std::filesystem::path>(*request_.log) : defaults.log;
  options.against = against_.notes;
  options.copies = against_.copies;
  judged.against = against_.newest(options.devices);
  if (const auto note = home_note(defaults)) {
    options.against.push_back(*note);
    judged.against.push_back(*note);
  }
  options.log_proof = judged.log_proof = log_proof_;
  if (witnesses_) options.witnesses = &*witnesses_;
  if (request_.evidence) options.evidence = *request_.evidence;
  if (policy_) options.policy = &*policy_;
  if (!identities_.empty()) {
    options.identities = &identities_;
    options.inspect = extras_.inspect;
  }
  options.threads = threads_;
  options.files = request_.files;
  Progress progress("verifying");
  options.progress = [&progress](std::uint64_t done, std::uint64_t total) { progress.update(done, total); };
  judged.report =
      request_.as_log ? archive::verify_log(folder, options) : archive::verify_case(folder, options);
  judged.device_trusted =
      std::any_of(options.devices.begin(), options.devices.end(),
                  [&](const crypto::VerifierKey& key) { return key.to_string() == judged.report.device; });
  if (request_.as_log && witnesses_) {
    const auto device =
        std::ranges::find(options.devices, judged.report.device, &crypto::VerifierKey::to_string);
    WitnessJudgement& witnesses = judged.log_witnesses.emplace();
    if (device == options.devices.end()) {
      witnesses.unused.emplace_back("nobody can have cosigned it for certain: its device is not trusted");
    } else {
      witnesses = judge_log_witnesses(folder, *device, *witnesses_, judged.against, options);
    }
  }
  if (extras_.verified && !request_.as_log) {
    extras_.verified(folder, judged.report,
                     {.decrypted = !identities_.empty(), .by_defaults = request_.names_nothing()});
  }
  return judged;
}

}  // namespace kiroku::apps
