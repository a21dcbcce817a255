#include "archive/format/ledger_entry.h"

#include <algorithm>
#include <array>
#include <set>
#include <type_traits>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/json_writer.h"
#include "archive/format/strict_json.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

constexpr std::size_t kMaximumDepth = 4;  // entry, streams, stream, recipients

template <typename Value>
using Names = std::pair<Value, std::string_view>;

constexpr std::array<Names<GapCause>, 8> kGapCauses{{{GapCause::kSignalLost, "signal-lost"},
                                                     {GapCause::kOverload, "overload"},
                                                     {GapCause::kDiskFull, "disk-full"},
                                                     {GapCause::kDeviceRemoved, "device-removed"},
                                                     {GapCause::kFormatChange, "format-change"},
                                                     {GapCause::kPaused, "paused"},
                                                     {GapCause::kSuspended, "suspended"},
                                                     {GapCause::kInterrupted, "interrupted"}}};
constexpr std::array<std::string_view, 4> kKinds{"video", "audio", "vitals", "events"};
constexpr std::array<std::string_view, 3> kPictureProfiles{"mpeg2", "uncompressed", "lossless"};
constexpr std::array<std::string_view, 2> kTimings{"arrival", "source"};
constexpr std::array<std::string_view, 2> kRecoveryReasons{"power-loss", "crash"};

template <std::size_t Size>
bool one_of(const std::array<std::string_view, Size>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool all_digits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool is_hex(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
  });
}

bool is_time_base(std::string_view text) {
  const std::size_t slash = text.find('/');
  return slash != std::string_view::npos && slash <= kMaximumTimeBaseDigits &&
         text.size() - slash - 1 <= kMaximumTimeBaseDigits && all_digits(text.substr(0, slash)) &&
         all_digits(text.substr(slash + 1)) && text[0] != '0' && text[slash + 1] != '0';
}

// -- reading: one function an entry type, each taking every key it knows

std::string read_one_of(JsonFields& fields, std::string_view key, const auto& names) {
  std::string name = fields.text(key);
  if (!fields.failed() && !one_of(names, name)) {
    fields.refuse(key, "has a value that format 1 does not know");
  }
  return name;
}

std::string read_short_name(JsonFields& fields, std::string_view key) {
  std::string name = fields.text(key);
  if (!fields.failed() && !is_short_name(name)) {
    fields.refuse(key, "is not a short name (a-z, 0-9, '-', at most 32)");
  }
  return name;
}

Span read_span(JsonFields& fields) {
  Span span;
  span.start_ns = fields.integer("start_ns");
  span.end_ns = fields.integer("end_ns");
  if (span.start_ns < 0) {
    fields.refuse("start_ns", "is negative");
  }
  if (span.end_ns < span.start_ns) {
    fields.refuse("end_ns", "is before start_ns");
  }
  return span;
}

FileReference read_file(JsonFields& fields) {
  FileReference file;
  file.file = fields.text("file");
  file.bytes = fields.count("bytes");
  file.sha256 = fields.digest("sha256");
  return file;
}

StreamInfo read_stream(JsonFields fields) {
  StreamInfo stream;
  stream.name = read_short_name(fields, "name");
  stream.kind = read_one_of(fields, "kind", kKinds);
  stream.media = fields.text("media");
  stream.source = fields.text("source");
  stream.profile = fields.text("profile");
  stream.purpose = fields.text("purpose");
  stream.recipients = fields.texts("recipients");
  stream.timing = read_one_of(fields, "timing", kTimings);
  if (!fields.failed()) {
    const std::optional<std::string_view> extension = extension_of_media(stream.media);
    if (!extension) {
      fields.refuse("media", "is a media type that format 1 does not know");
    } else {
      stream.extension = *extension;
    }
  }
  fields.no_more();
  return stream;
}

OpenEntry read_open(JsonFields& fields) {
  OpenEntry open;
  const std::string format = fields.text("format");
  if (!fields.failed() && format != OpenEntry::kFormat) {
    fields.refuse("format", "is not \"" + std::string(OpenEntry::kFormat) + "\"");
  }
  open.case_id = fields.text("case");
  if (!fields.failed() && !is_case_id(open.case_id)) {
    fields.refuse("case", "is not a case identifier such as 20260805T091502Z-3f9c21ab");
  }
  open.device = fields.text("device");
  open.boot_id = fields.text("boot_id");
  std::set<std::string> names;
  for (const JsonFields& stream : fields.objects("streams")) {
    if (open.streams.size() == kMaximumStreams) {
      fields.refuse("streams", "names more than " + std::to_string(kMaximumStreams) + " streams");
    }
    open.streams.push_back(read_stream(stream));
    if (!names.insert(open.streams.back().name).second) {
      fields.refuse("streams", "names a stream twice");
    }
    if (fields.failed()) {
      break;  // the list may hold as many wrong ones as fit into a line
    }
  }
  if (fields.has("subject")) {
    JsonFields subject = fields.object("subject");
    open.subject = read_file(subject);
    subject.no_more();
    if (!fields.failed() && open.subject->file != kSubjectFile) {
      fields.refuse("subject", "does not name " + std::string(kSubjectFile));
    }
  }
  if (fields.has("plan")) {
    open.plan = fields.digest("plan");
  }
  if (fields.has("begins_ns")) {
    open.begins_ns = fields.integer("begins_ns");
    if (!fields.failed() && open.begins_ns <= 0) {
      fields.refuse("begins_ns", "is not after 0, where it would not be written");
    }
  }
  JsonFields log = fields.object("appliance_log");
  open.appliance_log_size = log.count("size");
  open.appliance_log_root = log.digest("root");
  log.no_more();
  return open;
}

SegmentEntry read_segment(JsonFields& fields) {
  SegmentEntry segment;
  segment.stream = read_short_name(fields, "stream");
  segment.index = fields.count("index");
  segment.file = read_file(fields);
  segment.span = read_span(fields);
  segment.complete = fields.flag("complete");
  if (fields.has("profile")) segment.profile = read_one_of(fields, "profile", kPictureProfiles);
  // All that only the recorder knew is there, or nothing of it.
  segment.counted = fields.has("first_pts") || fields.has("time_base") || fields.has("frames") ||
                    fields.has("samples") || fields.has("dropped");
  if (!segment.counted) {
    return segment;
  }
  segment.first_pts = fields.integer("first_pts");
  segment.time_base = fields.text("time_base");
  if (!fields.failed() && !is_time_base(segment.time_base)) {
    fields.refuse("time_base", "is not a fraction such as 1/90000");
  }
  segment.counts_samples = fields.has("samples");
  segment.frames = fields.count(segment.counts_samples ? "samples" : "frames");
  segment.dropped = fields.count("dropped");
  return segment;
}

constexpr std::string_view kOfSound = "sound";

GapEntry read_gap(JsonFields& fields) {
  GapEntry gap;
  gap.stream = read_short_name(fields, "stream");
  gap.span = read_span(fields);
  const std::string name = fields.text("cause");
  const auto* cause = std::find_if(kGapCauses.begin(), kGapCauses.end(),
                                   [&](const auto& known) { return known.second == name; });
  if (cause == kGapCauses.end()) {
    fields.refuse("cause", "has a value that format 1 does not know");
  } else {
    gap.cause = cause->first;
  }
  if (fields.has("of")) {
    gap.of_sound = fields.text("of") == kOfSound;
    if (!fields.failed() && !gap.of_sound) {
      fields.refuse("of", "has a value that format 1 does not know");
    }
  }
  return gap;
}

ClockEntry read_clock(JsonFields& fields) {
  ClockEntry clock;
  clock.synchronised = fields.flag("synchronised");
  clock.offset_ns = fields.integer("offset_ns");
  clock.error_ns = fields.integer("error_ns");
  clock.step_ns = fields.integer("step_ns");
  if (fields.has("rate_ppb")) {
    clock.rate_ppb = fields.integer("rate_ppb");
  }
  return clock;
}

TokenEntry read_token(JsonFields& fields) {
  TokenEntry token;
  token.checkpoint = fields.count("checkpoint");
  token.authority = read_short_name(fields, "authority");
  token.file = fields.text("file");
  token.sha256 = fields.digest("sha256");
  token.gen_time = fields.utc("gen_time");
  token.accuracy_ns = fields.integer("accuracy_ns");
  if (token.accuracy_ns < 0) {
    fields.refuse("accuracy_ns", "is negative");
  }
  token.serial = fields.text("serial");
  if (!fields.failed() && !is_hex(token.serial)) {
    fields.refuse("serial", "is not a number in lower-case hex digits");
  }
  if (fields.has("asked_ns") || fields.has("answered_ns")) {
    const std::int64_t asked_ns = fields.integer("asked_ns");
    const std::int64_t answered_ns = fields.integer("answered_ns");
    if (asked_ns < 0) {
      fields.refuse("asked_ns", "is negative");
    }
    if (answered_ns < asked_ns) {
      fields.refuse("answered_ns", "is before asked_ns");
    }
    token.exchange = TokenEntry::Exchange{asked_ns, answered_ns};
  }
  return token;
}

TokenMissedEntry read_token_missed(JsonFields& fields) {
  TokenMissedEntry missed;
  missed.checkpoint = fields.count("checkpoint");
  missed.authority = read_short_name(fields, "authority");
  missed.cause = fields.text("cause");
  return missed;
}

RecoveredEntry read_recovered(JsonFields& fields) {
  RecoveredEntry recovered;
  recovered.boot_id = fields.text("boot_id");
  recovered.after = read_one_of(fields, "after", kRecoveryReasons);
  recovered.truncated = fields.text("truncated");
  return recovered;
}

CloseEntry read_close(JsonFields& fields) {
  CloseEntry close;
  close.reason = fields.text("reason");
  for (auto& [stream, total] : fields.object("totals").members()) {
    StreamTotal& sum = close.totals[stream];
    sum.segments = total.count("segments");
    sum.frames = total.count("frames");
    sum.dropped = total.count("dropped");
    sum.bytes = total.count("bytes");
    total.no_more();
  }
  return close;
}

ErasedEntry read_erased(JsonFields& fields) {
  ErasedEntry erased;
  erased.stream = read_short_name(fields, "stream");
  erased.first_index = fields.count("first_index");
  erased.last_index = fields.count("last_index");
  if (erased.last_index < erased.first_index) {
    fields.refuse("last_index", "is before first_index");
  }
  erased.policy = fields.text("policy");
  return erased;
}

MarkEntry read_mark(JsonFields& fields) { return {fields.digest("commitment")}; }

std::optional<CaseEntryBody> read_body(const std::string& type, JsonFields& fields) {
  if (type == type_of(OpenEntry{})) {
    return read_open(fields);
  }
  if (type == type_of(SegmentEntry{})) {
    return read_segment(fields);
  }
  if (type == type_of(GapEntry{})) {
    return read_gap(fields);
  }
  if (type == type_of(ClockEntry{})) {
    return read_clock(fields);
  }
  if (type == type_of(TokenEntry{})) {
    return read_token(fields);
  }
  if (type == type_of(TokenMissedEntry{})) {
    return read_token_missed(fields);
  }
  if (type == type_of(MarkEntry{})) {
    return read_mark(fields);
  }
  if (type == type_of(RecoveredEntry{})) {
    return read_recovered(fields);
  }
  if (type == type_of(CloseEntry{})) {
    return read_close(fields);
  }
  if (type == type_of(ErasedEntry{})) {
    return read_erased(fields);
  }
  return std::nullopt;
}

// -- writing

void write_span(JsonWriter& line, const Span& span) {
  line.integer("start_ns", span.start_ns).integer("end_ns", span.end_ns);
}

void write_file(JsonWriter& line, const FileReference& file) {
  line.text("file", file.file).count("bytes", file.bytes).digest("sha256", file.sha256);
}

std::string stream_json(const StreamInfo& stream) {
  JsonWriter json;
  json.text("name", stream.name)
      .text("kind", stream.kind)
      .text("media", stream.media)
      .text("source", stream.source)
      .text("profile", stream.profile)
      .text("purpose", stream.purpose)
      .texts("recipients", stream.recipients)
      .text("timing", stream.timing);
  return json.finish();
}

void write(JsonWriter& line, const OpenEntry& open) {
  if (open.streams.size() > kMaximumStreams) {
    throw Error("a case cannot have " + std::to_string(open.streams.size()) + " streams where at most " +
                std::to_string(kMaximumStreams) + " are allowed; record fewer sources");
  }
  line.text("format", OpenEntry::kFormat)
      .text("case", open.case_id)
      .text("device", open.device)
      .text("boot_id", open.boot_id);
  std::vector<std::string> streams;
  for (const StreamInfo& stream : open.streams) {
    streams.push_back(stream_json(stream));
  }
  line.json("streams", json_array(streams));
  if (open.subject) {
    JsonWriter subject;
    write_file(subject, *open.subject);
    line.json("subject", subject.finish());
  }
  if (open.plan) {
    line.digest("plan", *open.plan);
  }
  if (open.begins_ns > 0) {
    line.integer("begins_ns", open.begins_ns);
  }
  JsonWriter log;
  log.count("size", open.appliance_log_size).digest("root", open.appliance_log_root);
  line.json("appliance_log", log.finish());
}

void write(JsonWriter& line, const SegmentEntry& segment) {
  line.text("stream", segment.stream).count("index", segment.index);
  write_file(line, segment.file);
  write_span(line, segment.span);
  if (segment.counted) {
    line.integer("first_pts", segment.first_pts)
        .text("time_base", segment.time_base)
        .count(segment.counts_samples ? "samples" : "frames", segment.frames)
        .count("dropped", segment.dropped);
  }
  line.flag("complete", segment.complete);
  if (!segment.profile.empty()) line.text("profile", segment.profile);
}

void write(JsonWriter& line, const GapEntry& gap) {
  line.text("stream", gap.stream);
  write_span(line, gap.span);
  line.text("cause", gap_cause_name(gap.cause));
  if (gap.of_sound) {
    line.text("of", kOfSound);
  }
}

void write(JsonWriter& line, const ClockEntry& clock) {
  line.flag("synchronised", clock.synchronised)
      .integer("offset_ns", clock.offset_ns)
      .integer("error_ns", clock.error_ns)
      .integer("step_ns", clock.step_ns);
  if (clock.rate_ppb) {
    line.integer("rate_ppb", *clock.rate_ppb);
  }
}

void write(JsonWriter& line, const TokenEntry& token) {
  line.count("checkpoint", token.checkpoint)
      .text("authority", token.authority)
      .text("file", token.file)
      .digest("sha256", token.sha256)
      .utc("gen_time", token.gen_time)
      .integer("accuracy_ns", token.accuracy_ns)
      .text("serial", token.serial);
  if (token.exchange) {
    line.integer("asked_ns", token.exchange->asked_ns).integer("answered_ns", token.exchange->answered_ns);
  }
}

void write(JsonWriter& line, const TokenMissedEntry& missed) {
  line.count("checkpoint", missed.checkpoint).text("authority", missed.authority).text("cause", missed.cause);
}

void write(JsonWriter& line, const MarkEntry& mark) { line.digest("commitment", mark.commitment); }

void write(JsonWriter& line, const RecoveredEntry& recovered) {
  line.text("boot_id", recovered.boot_id)
      .text("after", recovered.after)
      .text("truncated", recovered.truncated);
}

void write(JsonWriter& line, const CloseEntry& close) {
  JsonWriter totals;
  for (const auto& [stream, sum] : close.totals) {
    JsonWriter total;
    total.count("segments", sum.segments)
        .count("frames", sum.frames)
        .count("dropped", sum.dropped)
        .count("bytes", sum.bytes);
    totals.json(stream, total.finish());
  }
  line.text("reason", close.reason).json("totals", totals.finish());
}

void write(JsonWriter& line, const ErasedEntry& erased) {
  line.text("stream", erased.stream)
      .count("first_index", erased.first_index)
      .count("last_index", erased.last_index)
      .text("policy", erased.policy);
}

}  // namespace

bool meets(const Span& span, std::int64_t from_ns, std::int64_t to_ns) {
  const std::int64_t end_ns = std::max(span.end_ns, span.start_ns + 1);
  return span.start_ns < to_ns && from_ns < end_ns;
}

std::string_view gap_cause_name(GapCause cause) {
  return std::find_if(kGapCauses.begin(), kGapCauses.end(),
                      [&](const auto& known) { return known.first == cause; })
      ->second;
}

std::string_view type_of(const CaseEntryBody& body) {
  constexpr std::array<std::string_view, 10> kTypes{
      "open", "segment", "gap", "clock", "token", "token-missed", "mark", "recovered", "close", "erased"};
  static_assert(kTypes.size() == std::variant_size_v<CaseEntryBody>);
  return kTypes[body.index()];
}

std::string to_line(const CaseEntry& entry) {
  JsonWriter line;
  line.text("type", type_of(entry.body))
      .count("seq", entry.seq)
      .utc("utc", entry.at.utc)
      .integer("mono_ns", entry.at.mono_ns);
  std::visit([&](const auto& body) { write(line, body); }, entry.body);
  std::string text = line.finish();
  if (text.size() > kMaximumLineBytes) {
    throw Error("cannot write entry " + std::to_string(entry.seq) + ": its line takes " +
                std::to_string(text.size()) + " bytes where a ledger line has at most " +
                std::to_string(kMaximumLineBytes) + "; shorten the texts in it");
  }
  return text;
}

EntryParse parse_case_entry(std::string_view line) {
  EntryParse result;
  const JsonParse json = parse_json(line, {kMaximumLineBytes, kMaximumDepth});
  if (!json.value) {
    result.problem = json.problem;
    result.position = json.position;
    return result;
  }
  JsonFields fields(*json.value, "entry", result.problem);
  const std::string type = fields.text("type");
  const std::uint64_t seq = fields.count("seq");
  Moment at;
  at.utc = fields.utc("utc");
  at.mono_ns = static_cast<std::int64_t>(fields.count("mono_ns"));
  if (!fields.failed()) {
    std::optional<CaseEntryBody> body = read_body(type, fields);
    if (!body) {
      fields.refuse("type", "has a value that format 1 does not know");
    }
    if (const auto* open = body ? std::get_if<OpenEntry>(&*body) : nullptr;
        open != nullptr && !fields.failed() && open->begins_ns > at.mono_ns) {
      fields.refuse("begins_ns", "is after the entry itself was made");
    }
    fields.no_more();
    if (!fields.failed()) {
      result.entry = CaseEntry{seq, at, std::move(*body)};
    }
  }
  return result;
}

}  // namespace kiroku::archive
