#include "recorder/vitals/hl7_vitals.h"

#include <algorithm>
#include <utility>

#include "base/ascii.h"
#include "base/bytes.h"
#include "base/error.h"
#include "recorder/vitals/hl7_refusal.h"

namespace kiroku::recorder {
namespace {

/// As a field's text: separators, and what would end a segment, escaped.
std::string escaped(std::string_view text, const Hl7Separators& separators) {
  std::string result;
  const auto add = [&](char name) {
    if (separators.escape != '\0') {
      result += separators.escape;
      result += name;
      result += separators.escape;
    } else {
      result += ' ';
    }
  };
  for (const char c : text) {
    if (c == separators.field) {
      add('F');
    } else if (c == separators.component) {
      add('S');
    } else if (c == separators.repetition) {
      add('R');
    } else if (c == separators.subcomponent) {
      add('T');
    } else if (c == separators.escape && c != '\0') {
      add('E');
    } else {
      result += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return result;
}

/// Who sends stands in every line that is made of a message, and is remembered with its identifier. HL7 gives
/// them 227 bytes each and 199.
constexpr std::size_t kLongestSender = 500, kLongestIdentifier = 200, kLongestPlace = 200;

/// Why the message is not read, or "".
std::string problem_of_names(const Hl7Message& message) {
  if (message.sender().size() > kLongestSender) {
    return "the message names its sender (MSH-3, MSH-4) with more than " + std::to_string(kLongestSender) +
           " bytes";
  }
  if (message.control_id().size() > kLongestIdentifier) {
    return "the identifier of the message (MSH-10) is longer than " + std::to_string(kLongestIdentifier) +
           " bytes";
  }
  if (message.type().size() > kLongestIdentifier) {
    return "the type of the message (MSH-9) is longer than " + std::to_string(kLongestIdentifier) + " bytes";
  }
  return "";
}

/// Why what the message says of patients cannot be told apart, or "".
std::string problem_of_parts(const std::vector<PatientPart>& parts) {
  if (parts.size() > Hl7Vitals::kMostPatients) {
    return "the message is of more than " + std::to_string(Hl7Vitals::kMostPatients) + " patients";
  }
  if (std::ranges::any_of(parts, [](const PatientPart& part) { return part.place.size() > kLongestPlace; })) {
    return "the message names a place (PV1-3) with more than " + std::to_string(kLongestPlace) + " bytes";
  }
  return "";
}

std::optional<crypto::Sha256Digest> hash_of(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional(crypto::sha256(bytes_of(text)));
}

std::string counted(std::string_view sentence, std::uint64_t count) {
  return std::string(sentence) + "; " + std::to_string(count) + " such messages so far";
}

}  // namespace

AssumedZone parse_assumed_zone(const std::string& text, const std::string& source) {
  if (text == "UTC") {
    return std::chrono::minutes(0);
  }
  if (text == "local") {
    return AssumedZone::local();
  }
  const auto time = parse_hl7_time("20260101000000" + text);
  if (!time || !time->zone || text.empty()) {
    throw UsageError("source '" + source +
                     "': zone must be as +05:30 or -0800, UTC, or 'local' for this machine's own");
  }
  return *time->zone;
}

std::string make_acknowledgement(const Hl7Message* message, std::string_view code, std::string_view text,
                                 UtcTime now) {
  const Hl7Separators separators = message != nullptr ? message->separators() : Hl7Separators();
  const auto raw = [&](std::size_t number) {
    return message != nullptr ? message->header().field(number).raw() : std::string_view();
  };
  if (raw(15) == "NE" && raw(16) == "NE") {
    return "";
  }
  // A line that was taken to go on with the header tore its field: repeated, it would end the answer's header
  // or begin a segment in it.
  const auto torn = [&](std::size_t number) {
    return std::ranges::any_of(raw(number), [](char c) { return static_cast<unsigned char>(c) < 0x20; });
  };
  const bool addressed = !torn(3) && !torn(4);
  // What is none of these words is none of the header's: "2.3.1", "P".
  const auto plain = [&](std::size_t number, std::string_view letters, std::size_t most,
                         std::string_view otherwise) {
    std::string word = message != nullptr ? message->header().field(number).component(1).text() : "";
    const bool good = !word.empty() && word.size() <= most && word.find_first_not_of(letters) == word.npos;
    return good ? word : std::string(otherwise);
  };
  std::string line("MSH");
  const auto field = [&](std::string_view value) {
    line += separators.field;
    line += value;
  };
  std::string delimiters{separators.component, separators.repetition};
  if (separators.escape != '\0') {
    delimiters += separators.escape;
  }
  delimiters += separators.subcomponent;
  field(delimiters);
  field("KIROKU");
  field("");
  field(addressed ? raw(3) : "");
  field(addressed ? raw(4) : "");
  field(format_hl7_time(now));
  field("");
  const std::string trigger = message != nullptr ? message->header().field(9).component(2).text() : "";
  field(trigger.empty() ? "ACK"
                        : std::string("ACK") + separators.component + trigger + separators.component + "ACK");
  field("K" + std::to_string(now.time_since_epoch().count()));
  field(plain(11, "DPT", 1, "P"));
  field(plain(12, "0123456789.", 8, "2.6"));
  for (int i = 13; i <= 17; ++i) {
    field("");
  }
  field("UNICODE UTF-8");
  line += "\rMSA";
  field(code);
  field(torn(10) ? "" : raw(10));
  if (!text.empty()) {
    field(escaped(text, separators));
  }
  return line + "\r";
}

Hl7Vitals::Taken Hl7Vitals::take(std::string_view bytes, std::int64_t arrival_ns, UtcTime now,
                                 const std::string& peer) {
  const std::string at = peer.empty() ? "" : "@" + peer;
  const Hl7Parse parsed = parse_hl7_message(bytes);
  std::string source = at, problem = parsed.problem;
  std::string notice = "message-refused", words;  // what is told of a problem, if not the problem itself
  bool is_told = true;
  std::vector<PatientPart> stated;  // all of the message
  std::vector<PatientPart> parts;   // those of here
  Taken taken;
  taken.answer = "AA";
  if (parsed.message) {
    problem = problem_of_names(*parsed.message);
    if (problem.empty()) source = parsed.message->sender() + at;
    if (!senders_.takes(*parsed.message)) return refuse(*parsed.message, source, arrival_ns, now);
    taken.is_of_sender = problem.empty();
    stated = patient_parts(*parsed.message);
    const std::string type = parsed.message->type();
    if (!problem.empty()) {
      taken.answer = "AE";
    } else if (const auto refusal = refusal_of(*parsed.message)) {
      taken.answer = refusal->code;
      problem = refusal->why;
      notice = refusal->name;
      const auto count = refusals_.add(notice + " " + source);
      is_told = count.has_value();
      words = counted(problem, count.value_or(0));
    } else if (type.empty()) {
      taken.answer = "AE";
      problem = "the message states no type (MSH-9)";
    } else if (!MonitorReader::reads(type)) {
      taken.answer = "AR";
      problem =
          "messages of type " + type + " are not read; ORU^R01, ORU^R30 to R32, ORU^R40 and ORU^W01 are";
    } else if (problem = problem_of_parts(stated); !problem.empty()) {
      taken.answer = "AE";
    }
  } else {
    // A frame of two bytes becomes lines of hundreds: whoever sends them without end must not fill the disk.
    const auto count = unreadable_.add(at);
    if (!count) return {{}, "AE", make_acknowledgement(nullptr, "AE", problem, now)};
    if (*count > kUnreadableKept) problem += "; " + std::to_string(*count) + " such messages so far";
    taken.answer = "AE";
  }
  // What is of others, too, is kept of none: it names them, and has their values.
  bool is_of_here = true;
  if (parsed.message) {
    is_of_here = std::ranges::all_of(stated, [&](const PatientPart& part) { return places_.takes(part); });
    if (problem.empty()) parts = parts_of_here(std::move(stated), source, arrival_ns, taken.lines);
    if (problem.empty() && parts.empty()) {
      taken.acknowledgement = make_acknowledgement(parsed.message.get(), taken.answer, "", now);
      return taken;
    }
  }
  const Novelty novelty =
      problem.empty() ? novelty_of(source, *parsed.message, bytes, arrival_ns) : Novelty::kNew;
  taken.acknowledgement = make_acknowledgement(parsed.message.get(), taken.answer, problem, now);
  const auto repeated = [&](const std::string& how) {
    taken.lines.emplace_back(media::VitalNotice{
        arrival_ns, "message-repeated", "the message '" + parsed.message->control_id() + "' " + how, source});
  };
  if (novelty == Novelty::kRepeated) {
    repeated("came again; it is recorded once");
    return taken;
  }
  std::vector<std::string> sources;
  sources.reserve(parts.size());
  for (const PatientPart& part : parts) {
    sources.push_back(parsed.message->sender() + mark_of(part, source) + at);
  }
  if (is_of_here) {
    taken.lines.emplace_back(media::DeviceMessage{arrival_ns, std::string(bytes),
                                                  taken.acknowledgement.empty() ? "" : taken.answer,
                                                  sources.size() == 1 ? sources.front() : source});
  }
  if (novelty == Novelty::kRepeatedWithOtherTime) {
    repeated("came again with another time (MSH-7); its values are recorded once");
    return taken;
  }
  if (!problem.empty()) {
    if (words.empty()) words = problem;
    if (is_told) taken.lines.emplace_back(media::VitalNotice{arrival_ns, notice, words, source});
    return taken;
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const PatientPart& part = parts[i];
    note_mixtures(part, sources[i], arrival_ns, taken.lines);
    if (watch_ && part.observes) watch_->heard(part.numbers, arrival_ns);
    const std::optional<UtcTime> arrived = peer.empty() ? std::nullopt : std::optional(now);
    MonitorReader& reader = reader_of(sources[i]);
    reader.case_begins(begins_ns_);
    for (media::VitalLine& line : reader.read(*parsed.message, arrival_ns, arrived, part.begin, part.end)) {
      taken.lines.push_back(std::move(line));
    }
  }
  return taken;
}

std::vector<PatientPart> Hl7Vitals::parts_of_here(std::vector<PatientPart> parts, const std::string& source,
                                                  std::int64_t arrival_ns,
                                                  std::vector<media::VitalLine>& lines) {
  if (places_.takes_all()) return parts;
  const std::size_t stated = parts.size();
  const bool is_placed =
      std::ranges::any_of(parts, [](const PatientPart& part) { return !part.place.empty(); });
  std::erase_if(parts, [&](const PatientPart& part) { return !places_.takes(part); });
  if (parts.size() == stated) return parts;
  const auto tell = [&](Tally& tally, const char* name, std::string_view sentence) {
    if (const auto count = tally.add(source)) {
      lines.emplace_back(media::VitalNotice{arrival_ns, name, counted(sentence, *count), source});
    }
  };
  if (!is_placed) {
    tell(unplaced_, "place-not-stated", "a message that names no place (PV1-3) is not recorded");
  } else {
    tell(elsewhere_, "other-place",
         parts.empty()
             ? "a message of another place is not recorded"
             : "a message is of other places, too, so of it only the values of this one are recorded");
  }
  return parts;
}

bool Hl7Vitals::PatientKey::differs(const PatientKey& other) const {
  return number != other.number || (issuer && other.issuer && issuer != other.issuer);
}

std::string Hl7Vitals::mark_of(const PatientPart& part, const std::string& sender) {
  std::string mark = part.place;
  if (!part.patient.empty()) {
    if (patients_at_.size() >= kMostSenders) patients_at_.clear();  // somebody makes up senders or places
    std::vector<PatientKey>& known = patients_at_[sender + "\n" + part.place];
    const PatientKey now{hash_of(part.patient), hash_of(part.issuer)};
    auto found = std::ranges::find_if(known, [&](const PatientKey& one) { return !one.differs(now); });
    if (found == known.end() && known.size() < kMostPatients) found = known.insert(known.end(), now);
    const auto number = found - known.begin() + 1;
    if (number > 1) mark += (mark.empty() ? "#" : " #") + std::to_string(number);
  }
  return mark.empty() ? "" : "[" + mark + "]";
}

void Hl7Vitals::note_mixtures(const PatientPart& part, const std::string& source, std::int64_t arrival_ns,
                              std::vector<media::VitalLine>& lines) {
  if (!part.observes) return;
  if (!part.place.empty()) {
    const std::string place = lower_case(part.place);
    beds_.untold = beds_.untold || (places_.takes_all() && !last_place_.empty() && last_place_ != place);
    last_place_ = place;
  }
  if (!part.patient.empty()) {
    const PatientKey patient{hash_of(part.patient), hash_of(part.issuer)};
    patients_.untold = patients_.untold || (last_patient_ && last_patient_->differs(patient));
    last_patient_ = patient;
  }
  note_mixture(
      beds_, "several-beds",
      "vital signs of several beds (PV1-3) come in this stream; the source of each says of which, and "
      "locations= of its address keeps others out",
      source, arrival_ns, lines);
  note_mixture(patients_, "several-patients",
               "vital signs of several patients (PID-3) come in this stream; the messages say of whom",
               source, arrival_ns, lines);
}

void Hl7Vitals::note_mixture(Mixture& mixture, const char* name, const char* text, const std::string& source,
                             std::int64_t arrival_ns, std::vector<media::VitalLine>& lines) {
  if (!mixture.untold || (mixture.told_ns && arrival_ns - *mixture.told_ns < kMixtureEveryNs)) return;
  mixture = {false, arrival_ns};
  lines.emplace_back(media::VitalNotice{arrival_ns, name, text, source});
}

Hl7Vitals::Taken Hl7Vitals::refuse(const Hl7Message& message, const std::string& source,
                                   std::int64_t arrival_ns, UtcTime now) {
  Taken taken;
  taken.answer = "AR";
  taken.acknowledgement = make_acknowledgement(&message, taken.answer, kStrangersMessage, now);
  if (const auto count = strangers_.add(source)) {
    taken.lines.emplace_back(media::VitalNotice{
        arrival_ns, "sender-refused",
        std::string(kStrangersMessage) + "; " + std::to_string(*count) + " of it refused so far", source});
  }
  return taken;
}

Hl7Vitals::Novelty Hl7Vitals::novelty_of(const std::string& source, const Hl7Message& message,
                                         std::string_view bytes, std::int64_t arrival_ns) {
  const auto earlier = seen_.see(source, message, bytes, arrival_ns);
  if (!earlier) return Novelty::kNew;
  if (earlier->has_same_bytes) return Novelty::kRepeated;
  const bool soon = arrival_ns - earlier->arrival_ns <= kLongestRetryNs;
  return earlier->has_same_content && earlier->tells_apart && soon ? Novelty::kRepeatedWithOtherTime
                                                                   : Novelty::kNew;
}

MonitorReader& Hl7Vitals::reader_of(const std::string& source) {
  const auto known = readers_.find(source);
  if (known != readers_.end()) {
    return known->second;
  }
  if (readers_.size() >= kMostSenders) {
    readers_.clear();  // somebody makes up senders; notices are made again
  }
  return readers_.try_emplace(source, source, assumed_zone_).first->second;
}

}  // namespace kiroku::recorder
