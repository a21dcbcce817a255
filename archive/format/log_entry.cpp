#include "archive/format/log_entry.h"

#include <algorithm>
#include <array>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/consent_layout.h"
#include "archive/format/json_writer.h"
#include "archive/format/strict_json.h"
#include "crypto/tpm_quote.h"

namespace kiroku::archive {

namespace {

constexpr std::size_t kMaximumDepth = 2;
constexpr std::string_view kNoPurpose = "has what is no purpose: 1 to 32 of a-z, 0-9 and '-'";

constexpr std::array<std::string_view, std::variant_size_v<LogEntryBody>> kTypes{"boot",
                                                                                 "shutdown",
                                                                                 "config-changed",
                                                                                 "device-key-changed",
                                                                                 "device-ml-dsa-added",
                                                                                 "device-hardware-added",
                                                                                 "device-attestation-added",
                                                                                 "device-hardware-silent",
                                                                                 "plan-sealed",
                                                                                 "case-opened",
                                                                                 "case-checkpoint",
                                                                                 "case-closed",
                                                                                 "replicated",
                                                                                 "erased",
                                                                                 "access",
                                                                                 "recovered",
                                                                                 "pre-roll-discarded",
                                                                                 "case-held",
                                                                                 "case-released",
                                                                                 "consent-given",
                                                                                 "consent-withdrawn",
                                                                                 "damage-found"};

// -- writing, one function an entry type

void write(JsonWriter& line, const StatedQuote& quote) {
  line.text("quote", quote.attest).text("quote_signature", quote.signature).texts("pcrs", quote.pcrs);
}
void write(JsonWriter& line, const BootEntry& entry) {
  line.text("boot_id", entry.boot_id).text("device", entry.device);
  if (entry.quote) {
    write(line, *entry.quote);
  } else if (entry.no_quote) {
    line.text("no_quote", *entry.no_quote);
  }
}
void write(JsonWriter& /*line*/, const ShutdownEntry& /*entry*/) {}
void write(JsonWriter& line, const ConfigChangedEntry& entry) { line.digest("sha256", entry.sha256); }
void write(JsonWriter& line, const DeviceKeyChangedEntry& entry) { line.text("device", entry.device); }
void write(JsonWriter& line, const DeviceMlDsaEntry& entry) { line.text("ml_dsa", entry.ml_dsa); }
void write(JsonWriter& line, const DeviceHardwareEntry& entry) { line.text("hardware", entry.hardware); }
void write(JsonWriter& line, const DeviceAttestationEntry& entry) {
  line.text("attestation", entry.attestation);
  write(line, entry.quote);
}
void write(JsonWriter& line, const DeviceHardwareSilentEntry& entry) { line.text("why", entry.why); }
void write(JsonWriter& line, const PlanSealedEntry& entry) { line.digest("sha256", entry.sha256); }
void write(JsonWriter& line, const CaseOpenedEntry& entry) {
  line.text("case", entry.case_id).digest("sha256", entry.sha256);
}
void write(JsonWriter& line, const CaseCheckpointEntry& entry) {
  line.text("case", entry.case_id).count("size", entry.size).digest("root", entry.root);
}
void write(JsonWriter& line, const CaseClosedEntry& entry) {
  line.text("case", entry.case_id).count("size", entry.size).digest("root", entry.root);
  if (entry.final_token) {
    line.digest("final_token", *entry.final_token);
  }
}
void write(JsonWriter& line, const ReplicatedEntry& entry) {
  line.text("case", entry.case_id).text("target", entry.target);
}
void write(JsonWriter& line, const CaseErasedEntry& entry) {
  line.text("case", entry.case_id);
  if (entry.stream) {
    line.text("stream", *entry.stream);
  }
  line.text("policy", entry.policy);
}
void write(JsonWriter& line, const AccessEntry& entry) {
  line.text("case", entry.case_id).text("what", entry.what).text("who", entry.who);
  if (entry.purpose) {
    line.text("purpose", *entry.purpose);
  }
}
void write(JsonWriter& line, const LogRecoveredEntry& entry) { line.count("truncated", entry.truncated); }
void write(JsonWriter& line, const LogDamageEntry& entry) {
  line.count("size", entry.size).digest("stated_root", entry.stated_root);
  if (entry.root) {
    line.digest("root", *entry.root);
  }
}
void write(JsonWriter& line, const PreRollDiscardedEntry& entry) {
  line.count("segments", entry.segments);
  if (entry.duration_ns) {
    line.integer("duration_ns", *entry.duration_ns);
  }
}
void write(JsonWriter& line, const CaseHeldEntry& entry) {
  line.text("case", entry.case_id).text("reason", entry.reason).text("who", entry.who);
}
void write(JsonWriter& line, const CaseReleasedEntry& entry) {
  line.text("case", entry.case_id)
      .count("hold", entry.hold)
      .text("reason", entry.reason)
      .text("who", entry.who);
}
void write(JsonWriter& line, const ConsentStatement& entry) {
  line.text("case", entry.case_id).texts("purposes", entry.purposes).digest("statement", entry.statement);
  if (entry.form) {
    line.digest("form", *entry.form);
  }
  line.text("who", entry.who);
}

// -- reading, likewise; each takes every key it knows

std::string read_case_id(JsonFields& fields) {
  std::string id = fields.text("case");
  if (!fields.failed() && !is_case_id(id)) {
    fields.refuse("case", "is not a case identifier such as 20260805T091502Z-3f9c21ab");
  }
  return id;
}

/// A register's number without zeros before it, a colon, and SHA-256 in hex digits.
bool is_pcr_text(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos) return false;
  const std::string_view number = text.substr(0, colon), value = text.substr(colon + 1);
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const bool is_number = (number.size() == 1 && is_digit(number[0])) ||
                         (number.size() == 2 && ((number[0] == '1' && is_digit(number[1])) ||
                                                 (number[0] == '2' && number[1] >= '0' && number[1] <= '3')));
  return is_number && value.size() == 2 * sizeof(crypto::Sha256Digest) &&
         std::all_of(value.begin(), value.end(),
                     [&](char c) { return is_digit(c) || (c >= 'a' && c <= 'f'); });
}

void read(JsonFields& fields, StatedQuote& quote) {
  quote.attest = fields.text("quote");
  quote.signature = fields.text("quote_signature");
  quote.pcrs = fields.texts("pcrs");
  if (!fields.failed() && (quote.pcrs.empty() || quote.pcrs.size() > crypto::kPcrs)) {
    fields.refuse("pcrs", "must be 1 to 24 registers");
  }
  for (const std::string& each : quote.pcrs) {
    if (!fields.failed() && !is_pcr_text(each)) {
      fields.refuse("pcrs", "has what is no register and its value: 0 to 23, ':', 64 lower-case hex digits");
    }
  }
}
void read(JsonFields& fields, BootEntry& entry) {
  entry.boot_id = fields.text("boot_id");
  entry.device = fields.text("device");
  if (fields.has("no_quote")) {
    entry.no_quote = fields.text("no_quote");
  } else if (fields.has("quote") || fields.has("quote_signature") || fields.has("pcrs")) {
    read(fields, entry.quote.emplace());
  }
}
void read(JsonFields& /*fields*/, ShutdownEntry& /*entry*/) {}
void read(JsonFields& fields, ConfigChangedEntry& entry) { entry.sha256 = fields.digest("sha256"); }
void read(JsonFields& fields, DeviceKeyChangedEntry& entry) { entry.device = fields.text("device"); }
void read(JsonFields& fields, DeviceMlDsaEntry& entry) { entry.ml_dsa = fields.text("ml_dsa"); }
void read(JsonFields& fields, DeviceHardwareEntry& entry) { entry.hardware = fields.text("hardware"); }
void read(JsonFields& fields, DeviceAttestationEntry& entry) {
  entry.attestation = fields.text("attestation");
  read(fields, entry.quote);
}
void read(JsonFields& fields, DeviceHardwareSilentEntry& entry) { entry.why = fields.text("why"); }
void read(JsonFields& fields, PlanSealedEntry& entry) { entry.sha256 = fields.digest("sha256"); }
void read(JsonFields& fields, CaseOpenedEntry& entry) {
  entry.case_id = read_case_id(fields);
  entry.sha256 = fields.digest("sha256");
}
void read(JsonFields& fields, CaseCheckpointEntry& entry) {
  entry.case_id = read_case_id(fields);
  entry.size = fields.count("size");
  entry.root = fields.digest("root");
}
void read(JsonFields& fields, CaseClosedEntry& entry) {
  entry.case_id = read_case_id(fields);
  entry.size = fields.count("size");
  entry.root = fields.digest("root");
  if (fields.has("final_token")) {
    entry.final_token = fields.digest("final_token");
  }
}
void read(JsonFields& fields, ReplicatedEntry& entry) {
  entry.case_id = read_case_id(fields);
  entry.target = fields.text("target");
}
void read(JsonFields& fields, CaseErasedEntry& entry) {
  entry.case_id = read_case_id(fields);
  if (fields.has("stream")) {
    entry.stream = fields.text("stream");
  }
  entry.policy = fields.text("policy");
}
void read(JsonFields& fields, AccessEntry& entry) {
  entry.case_id = fields.text("case");
  entry.what = fields.text("what");
  entry.who = fields.text("who");
  if (fields.has("purpose")) {
    entry.purpose = fields.text("purpose");
    if (!fields.failed() && !is_short_name(*entry.purpose)) {
      fields.refuse("purpose", kNoPurpose);
    }
  }
}
void read(JsonFields& fields, LogRecoveredEntry& entry) { entry.truncated = fields.count("truncated"); }
void read(JsonFields& fields, LogDamageEntry& entry) {
  entry.size = fields.count("size");
  entry.stated_root = fields.digest("stated_root");
  if (fields.has("root")) {
    entry.root = fields.digest("root");
  }
}
void read(JsonFields& fields, PreRollDiscardedEntry& entry) {
  entry.segments = fields.count("segments");
  if (fields.has("duration_ns")) {
    entry.duration_ns = fields.integer("duration_ns");
  }
}
void read(JsonFields& fields, CaseHeldEntry& entry) {
  entry.case_id = read_case_id(fields);
  entry.reason = fields.text("reason");
  entry.who = fields.text("who");
}
void read(JsonFields& fields, CaseReleasedEntry& entry) {
  entry.case_id = read_case_id(fields);
  entry.hold = fields.count("hold");
  entry.reason = fields.text("reason");
  entry.who = fields.text("who");
}
void read(JsonFields& fields, ConsentStatement& entry) {
  entry.case_id = read_case_id(fields);
  entry.purposes = fields.texts("purposes");
  if (!fields.failed() && (entry.purposes.empty() || entry.purposes.size() > kMaximumPurposes)) {
    fields.refuse("purposes", "must be 1 to 32 purposes");
  }
  for (const std::string& each : entry.purposes) {
    if (!fields.failed() && !is_short_name(each)) {
      fields.refuse("purposes", kNoPurpose);
    }
    if (!fields.failed() && std::ranges::count(entry.purposes, each) > 1) {
      fields.refuse("purposes", "has one purpose twice");
    }
  }
  entry.statement = fields.digest("statement");
  if (fields.has("form")) {
    entry.form = fields.digest("form");
  }
  entry.who = fields.text("who");
}

/// A body of the type called `type`, its fields still empty.
template <std::size_t Index = 0>
std::optional<LogEntryBody> empty_body(std::string_view type) {
  if constexpr (Index == kTypes.size()) {
    return std::nullopt;
  } else {
    if (kTypes[Index] == type) {
      return LogEntryBody(std::in_place_index<Index>);
    }
    return empty_body<Index + 1>(type);
  }
}

}  // namespace

std::string_view type_of(const LogEntryBody& body) { return kTypes.at(body.index()); }

std::string to_line(const LogEntry& entry) {
  JsonWriter line;
  line.text("type", type_of(entry.body))
      .count("seq", entry.seq)
      .utc("utc", entry.at.utc)
      .integer("mono_ns", entry.at.mono_ns);
  std::visit([&line](const auto& body) { write(line, body); }, entry.body);
  return line.finish();
}

LogEntryParse parse_log_entry(std::string_view line) {
  const JsonParse parsed = parse_json(line, {kMaximumLineBytes, kMaximumDepth});
  if (!parsed.value) {
    return {std::nullopt, parsed.problem};
  }
  std::string problem;
  JsonFields fields(*parsed.value, "log entry", problem);
  LogEntry entry;
  const std::string type = fields.text("type");
  entry.seq = fields.count("seq");
  entry.at.utc = fields.utc("utc");
  entry.at.mono_ns = fields.integer("mono_ns");
  if (problem.empty()) {
    if (std::optional<LogEntryBody> body = empty_body(type)) {
      std::visit([&fields](auto& each) { read(fields, each); }, *body);
      entry.body = std::move(*body);
      fields.no_more();
    } else {
      fields.refuse("type", "has a value that the appliance log does not know");
    }
  }
  if (!problem.empty()) {
    return {std::nullopt, problem};
  }
  return {std::move(entry), {}};
}

}  // namespace kiroku::archive
