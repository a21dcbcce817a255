#include "archive/verify/boot_rules.h"

#include <algorithm>
#include <utility>

#include "archive/format/boot_quote.h"
#include "archive/format/case_layout.h"
#include "crypto/encoding.h"

namespace kiroku::archive {

namespace {

Place in_log(std::uint64_t number) { return {std::string(kLedgerFile), number}; }

std::string at_entry(std::uint64_t number) { return "entry " + std::to_string(number); }

/// How far a count of the TPM went on; negative where it went back. To each count the TPM adds a number of
/// its own, so that it may pass 2^32.
std::int64_t went_on(std::uint32_t from, std::uint32_t to) { return static_cast<std::int32_t>(to - from); }

bool are_those_of(const crypto::TpmQuote& said, const std::vector<crypto::PcrValue>& pcrs) {
  const bool same =
      std::equal(said.pcrs.begin(), said.pcrs.end(), pcrs.begin(), pcrs.end(),
                 [](unsigned index, const crypto::PcrValue& each) { return index == each.index; });
  return same && said.pcr_digest == crypto::digest_of_pcrs(pcrs);
}

/// The names of the registers that are not the same in both.
std::string changed_registers(const std::vector<crypto::PcrValue>& before,
                              const std::vector<crypto::PcrValue>& now) {
  std::string names;
  for (unsigned index = 0; index < crypto::kPcrs; ++index) {
    const auto has_index = [index](const crypto::PcrValue& each) { return each.index == index; };
    const auto then = std::find_if(before.begin(), before.end(), has_index);
    const auto later = std::find_if(now.begin(), now.end(), has_index);
    const bool in_both = then != before.end() && later != now.end();
    const bool in_none = then == before.end() && later == now.end();
    if (!in_none && (!in_both || then->value != later->value)) {
      names += (names.empty() ? "" : ", ") + pcr_name(index);
    }
  }
  return names;
}

}  // namespace

bool BootRules::quotes(const LogEntryBody& body) {
  const auto* boot = std::get_if<BootEntry>(&body);
  return std::holds_alternative<DeviceAttestationEntry>(body) || (boot != nullptr && boot->quote);
}

void BootRules::take(const LogEntryBody& body, std::uint64_t number,
                     const std::optional<crypto::Sha256Digest>& root_before) {
  if (const auto* boot = std::get_if<BootEntry>(&body)) {
    take_boot(*boot, number, root_before);
  } else if (const auto* added = std::get_if<DeviceAttestationEntry>(&body)) {
    take_key(*added, number, root_before);
  } else if (const auto* changed = std::get_if<DeviceKeyChangedEntry>(&body)) {
    device_ = changed->device;
    forget_key();
  }
}

void BootRules::forget_key() {
  key_text_.clear();
  key_.reset();
  last_.reset();
}

void BootRules::take_boot(const BootEntry& boot, std::uint64_t number,
                          const std::optional<crypto::Sha256Digest>& root_before) {
  if (std::exchange(device_, boot.device) != boot.device) {
    forget_key();
  }
  boot_id_ = boot.boot_id;
  ++since_held_;
  if (boot.quote) {
    judge(*boot.quote, number, root_before);
  } else if (boot.no_quote) {
    ++silent_;
    last_silent_ = number;
    last_why_ = *boot.no_quote;
  } else {
    take_unquoted(number);
  }
}

void BootRules::take_unquoted(std::uint64_t number) {
  if (key_) {
    add_of_log("boot-quote-missing", number,
               at_entry(number) +
                   " tells of a boot that the TPM did not quote, and not why, though the log states an "
                   "attestation key: a program from before wrote it, or somebody took the quote away");
  } else if (had_key_) {
    ++silent_;
    last_silent_ = number;
    last_why_ = "the device has another key since, and the log states no attestation key beside that";
  }
}

void BootRules::take_key(const DeviceAttestationEntry& added, std::uint64_t number,
                         const std::optional<crypto::Sha256Digest>& root_before) {
  std::string problem = "it is no base64";
  const auto area = crypto::from_base64(added.attestation, crypto::Base64Padding::kPadded);
  std::optional<crypto::AttestationKey> key;
  if (area) {
    key = crypto::parse_attestation_key(*area, problem);
  }
  if (!key) {
    findings_->add("device-invalid", in_log(number),
                   at_entry(number) + " of the log states no attestation key: " + problem);
    return;
  }
  if (key_ && key_text_ != added.attestation) {
    add_forged("device-attestation-differs", number,
               "states another attestation key than the log stated before, which no recorder does");
    return;
  }
  key_text_ = added.attestation;
  key_ = std::move(key);
  had_key_ = true;
  judge(added.quote, number, root_before);
}

void BootRules::judge(const StatedQuote& stated, std::uint64_t number,
                      const std::optional<crypto::Sha256Digest>& root_before) {
  const auto quote = from_stated(stated);
  std::string problem = "texts that are no base64, or registers out of their order";
  const auto said = quote ? crypto::parse_tpm_quote(quote->attest, problem) : std::nullopt;
  if (!said) {
    add_forged("boot-quote-malformed", number, "has no quote that a TPM could have made: " + problem);
    return;
  }
  if (!key_ || said->qualified_signer != key_->qualified_name ||
      !crypto::verify_ecdsa_p256(key_->key, quote->attest, quote->signature)) {
    add_forged("boot-quote-signature-invalid", number,
               key_ ? "has a quote that the attestation key stated by the log did not sign"
                    : "has a quote, and the log states no attestation key before it");
    return;
  }
  bool holds = true;
  if (!are_those_of(*said, quote->pcrs)) {
    holds = false;
    add_forged("boot-pcrs-differ", number, "states other registers, or values of them, than the TPM quoted");
  }
  if (root_before) {
    const crypto::Sha256Digest asked = qualifying_data({device_, number, *root_before, boot_id_});
    if (!std::equal(asked.begin(), asked.end(), said->qualifying_data.begin(), said->qualifying_data.end())) {
      holds = false;
      add_forged("boot-quote-of-elsewhere", number,
                 "has a quote that the TPM made for another entry, another boot or another log");
    }
  }
  if (holds) {
    compare({number, boot_id_, *said, quote->pcrs});
  }
}

void BootRules::compare(const Held& now) {
  if (last_) {
    const crypto::TpmQuote& before = last_->said;
    const std::int64_t resets = went_on(before.resets, now.said.resets);
    const bool same_power = resets == 0 && went_on(before.restarts, now.said.restarts) == 0;
    const bool went_back = resets < 0 || (resets == 0 && went_on(before.restarts, now.said.restarts) < 0) ||
                           ((now.said.clock_is_safe || same_power) && now.said.clock_ms < before.clock_ms);
    if (went_back) {
      add_forged("boot-clock-went-back", now.entry,
                 "has a quote that the TPM made before that of " + at_entry(last_->entry) +
                     ", by its count of resets and its clock");
      return;
    }
    if (resets > 0 && static_cast<std::uint64_t>(resets) > since_held_) {
      further_resets_ += static_cast<std::uint64_t>(resets) - since_held_;
      last_further_ = now.entry;
    }
    if (same_power && now.boot_id != last_->boot_id) {
      ++without_reset_;
      last_without_reset_ = now.entry;
    }
    const std::string changed = changed_registers(last_->pcrs, now.pcrs);
    if (!changed.empty()) {
      add_of_log("measured-boot-changed", now.entry,
                 "the measured boot of " + at_entry(now.entry) + " is not that of " + at_entry(last_->entry) +
                     ": " + changed +
                     ". An update or a change of settings does that; so does whoever starts other software");
    }
  }
  if (!unmeasured_registers(now.pcrs).empty()) {
    ++unmeasured_;
    last_unmeasured_ = now.entry;
    last_empty_ = unmeasured_registers(now.pcrs);
  }
  ++held_;
  since_held_ = 0;
  last_ = now;
}

void BootRules::finish() {
  if (held_ > 0) {
    add_of_log("boot-quotes-hold", last_ ? last_->entry : 0,
               "the TPM quoted the measured boot " + std::to_string(held_) +
                   " times by the attestation key that the log states, and these quotes hold");
  }
  if (unmeasured_ > 0) {
    add_of_log("boot-not-measured", last_unmeasured_,
               "the TPM quoted " + std::to_string(unmeasured_) + " boots, the last one in " +
                   at_entry(last_unmeasured_) +
                   ", of which nothing was measured into all registers that firmware uses (there " +
                   last_empty_ +
                   "): whoever starts the machine can still put in what they like, and these quotes say "
                   "nothing of what was started");
  }
  if (without_reset_ > 0) {
    add_of_log("boot-without-reset", last_without_reset_,
               std::to_string(without_reset_) + " boots, the last one in " + at_entry(last_without_reset_) +
                   ", are others than the ones quoted before them, and by its counts the TPM was not started "
                   "anew between them: the running kernel started another one, which nothing measures, or "
                   "somebody made the boot up");
  }
  if (silent_ > 0) {
    add_of_log(
        "boot-not-quoted", last_silent_,
        "the TPM did not quote " + std::to_string(silent_) + " boots, the last one since: " + last_why_);
  }
  if (further_resets_ > 0) {
    add_of_log("boots-not-entered", last_further_,
               "by the TPM's count the machine was started " + std::to_string(further_resets_) +
                   " times more than the log tells of, the last time before " + at_entry(last_further_) +
                   ": without the recorder, or with other software");
  }
}

void BootRules::add_forged(CodeName code, std::uint64_t number, const std::string& what) {
  findings_->add(code, in_log(number), at_entry(number) + " of the log " + what);
}

void BootRules::add_of_log(CodeName code, std::uint64_t number, const std::string& text) {
  if (log_itself_) {
    findings_->add(code, in_log(number), text);
  }
}

}  // namespace kiroku::archive
