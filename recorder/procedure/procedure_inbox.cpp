#include "recorder/procedure/procedure_inbox.h"

#include <algorithm>
#include <chrono>
#include <mutex>

#include "base/error.h"
#include "base/tally.h"
#include "recorder/procedure/repeated_messages.h"
#include "recorder/procedure/state_codec.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/hl7_refusal.h"
#include "recorder/vitals/hl7_vitals.h"
#include "recorder/vitals/mllp_address.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::seconds kListenAgain{10};
// Of what is kept of one message; whoever sends more than that does not fill the memory.
constexpr std::size_t kLongestKept = 16U << 10;
// A hospital's messages may come by the dozen, and each time the whole book is kept.
constexpr std::uint64_t kStateVersion = 2;
constexpr std::uint64_t kOlderStateVersion = 1;  // without the messages that may come again

struct Listening {
  MllpServer::Options server;
  SenderList senders;
  AssumedZone zone;
};

Listening listening_at(const std::string& listen) {
  const SourceAddress address = parse_source_address(listen);
  if (address.kind != SourceKind::kMonitors) {
    throw UsageError("'" + address.stated +
                     "' is nowhere to wait for HL7 messages: write mllp://ADDRESS:PORT");
  }
  if (address.options.contains("locations")) {
    throw UsageError("'" + address.stated +
                     "': locations of an address are those of vital signs; here each room says its own, as "
                     "locations = [\"OR1\"] beside listen");
  }
  return {mllp_server_options(address), mllp_senders(address),
          parse_assumed_zone(address.option("zone", "local"), address.stated)};
}

std::size_t kept_bytes(const ProcedureMessage& message) {
  std::size_t bytes = subject_json(message.data).size() + message.sender.size() + message.patient.size() +
                      message.replaces.size() + message.appointment.size() + message.placer.size() +
                      message.filler.size() + message.facility.size() + message.visit.size();
  for (const std::string& place : message.places) bytes += place.size();
  for (const PlannedPlace& each : message.planned_places) {
    for (const std::string& place : each.spellings) bytes += place.size();
    bytes += each.planned_text.size() + each.location.size() + each.description.size() + each.code.size() +
             each.coding_system.size();
  }
  for (const auto* const numbers : {&message.numbers, &message.replaced_numbers}) {
    for (const PatientNumber& each : *numbers)
      bytes += each.number.size() + each.issuer.size() + each.issuer_id.size() + each.type.size();
  }
  return bytes;
}

/// Why nothing of what a message says can be kept, or "".
std::string problem_of(const std::vector<ProcedureMessage>& messages) {
  if (std::ranges::any_of(messages, [](const auto& each) { return kept_bytes(each) > kLongestKept; }))
    return "the message says more of a patient and a procedure than is kept";
  if (!std::ranges::all_of(messages, has_its_numbers)) {
    return "the message names a patient by a number that is longer than " + std::to_string(kLongestNumber) +
           " bytes";
  }
  return "";
}

}  // namespace

struct ProcedureInbox::State {
  State(const std::string& listen, Tell told, const Clock& its_time, InboxMemory its_memory)
      : where(parse_source_address(listen).stated),
        listening(listening_at(listen)),
        tell(std::move(told)),
        time(its_time),
        memory(std::move(its_memory)) {
    if (!memory.earlier.empty()) take_over();
  }

  /// What an earlier process knew; nothing of it where it cannot be used.
  void take_over() {
    try {
      StateReader reader(memory.earlier);
      std::uint64_t version = 0, its_taken = 0, its_refused = 0;
      ProcedureMoment its_since{UtcTime{}};
      Bytes its_book;
      reader.one(version);
      if (version != kStateVersion && version != kOlderStateVersion) StateReader::refuse();
      reader.all(its_since, its_taken, its_refused, its_book);
      Bytes its_repeated;
      if (version == kStateVersion) reader.one(its_repeated);
      reader.require_end();
      RepeatedMessages known =
          its_repeated.empty() ? RepeatedMessages() : RepeatedMessages::imported(its_repeated);
      book = ProcedureBook::imported(its_book);
      repeated = std::move(known);
      since = its_since;
      taken = its_taken;
      refused = its_refused;
      if (book.not_kept() > 0) {
        complain(std::to_string(book.not_kept()) +
                 " of what was known before this start cannot be read: a person must choose whom cases are "
                 "about in the rooms that it concerns");
      }
    } catch (const Error& error) {
      complain(std::string("what was known before this start cannot be used: ") + error.what());
    }
    memory.earlier = {};
  }

  /// Without the mutex, which others wait for: the book is copied with it, and kept without it.
  void keep() {
    if (!memory.keep) return;
    const std::lock_guard one_at_a_time(keeping);
    StateWriter writer;
    {
      const std::lock_guard guard(mutex);
      if (!is_news || !since) return;
      writer.all(kStateVersion, *since, taken, refused, book.exported(), repeated.exported());
      is_news = false;
    }
    memory.keep(writer.take());
  }

  /// On the server's thread.
  MllpServer::Answer take(std::string_view bytes) {
    const ProcedureMoment now{time.utc(), time.since_boot()};
    const Hl7Parse parsed = parse_hl7_message(bytes);
    std::string answer = "AA", why;
    std::optional<std::vector<ProcedureMessage>> messages;
    std::optional<std::uint64_t> strangers, late, lost, unclear;
    if (!parsed.message) {
      answer = "AE";
      why = parsed.problem;
    } else if (!listening.senders.takes(*parsed.message)) {
      answer = "AR";
      why = kStrangersMessage;
    } else if (const auto refusal = refusal_of(*parsed.message)) {
      answer = refusal->code;
      why = refusal->why;
      if (const auto count = refusals.add(refusal->name)) {
        complain(refusal->why + "; " + std::to_string(*count) + " such messages so far");
      }
    } else if (!is_of_procedures(parsed.message->type())) {
      answer = "AR";
      why = "only messages of patients and appointments (ADT, SIU) are taken here";
    } else {
      messages = read_procedure_messages(*parsed.message, listening.zone);
      why = problem_of(*messages);
      if (!why.empty()) {
        answer = "AE";
        messages.reset();
      }
    }
    {
      const std::lock_guard guard(mutex);
      ++(messages ? taken : refused);
      if (messages && !repeated.is_repeated(*parsed.message, bytes)) {
        const std::uint64_t strangers_before = book.strangers_left(), late_before = book.ended_late(),
                            lost_before = book.not_kept();
        const bool is_unclear = std::ranges::any_of(*messages, [](const ProcedureMessage& each) {
          return each.kind == ProcedureMessage::Kind::kAppointment && each.is_time_unclear;
        });
        if (is_unclear) unclear = times_unclear.add("");
        book.take_all(std::move(*messages), now);
        if (book.strangers_left() != strangers_before) strangers = strangers_left.add("");
        if (book.ended_late() != late_before) late = ended_late.add("");
        if (book.not_kept() != lost_before) lost = not_kept.add("");
        is_news = true;
      }
    }
    // Before it is acknowledged: the sender does not say it again, should this process end now.
    keep();
    if (late) {
      complain(
          "a message came late, after newer ones of the same patient or appointment, and says that the "
          "patient left or is planned no more (" +
          std::to_string(*late) + " so far): a person must choose whom the room's cases are about");
    }
    if (strangers) {
      complain("a patient left whom no message had placed under any of the numbers that it names (" +
               std::to_string(*strangers) + " so far): whoever is known to be in a room may be gone");
    }
    if (lost) {
      complain("more is told than is kept, and something that concerns a room was forgotten (" +
               std::to_string(*lost) + " so far): a person must choose whom its cases are about");
    }
    if (unclear) {
      complain("an appointment states a time that cannot be read, or no hour (" + std::to_string(*unclear) +
               " so far): no patient is taken by plan where it may be meant");
    }
    const bool is_to_sender = parsed.message && listening.senders.takes(*parsed.message);
    return {make_acknowledgement(parsed.message.get(), answer, why, now.utc), is_to_sender};
  }

  /// `at` as the wall clock shows it now.
  [[nodiscard]] ProcedureMoment moment(UtcTime at) const {
    // In this order: whatever was told before `at` stays before it.
    const auto ago = std::chrono::duration_cast<Clock::Duration>(time.utc() - at);
    return {at, time.since_boot() - ago};
  }

  /// With the mutex: from when on messages are known; "" where that is before all that counts.
  [[nodiscard]] std::string known_since(const ProcedureMoment& now) const {
    if (!since) return "";
    const UtcTime moment = now.by_this_clock(*since);
    if (now.utc - moment > ProcedureBook::kLongestWindow) return "";
    constexpr std::size_t kToMinutes = 16;
    return format_utc(moment).substr(0, kToMinutes) + "Z";
  }

  /// Of a complaint about a connection the name alone: the sentence beside it may begin with a patient's.
  void complain(const std::string& what) {
    if (tell) tell("HL7 messages at " + where + ": " + what);
  }

  const std::string where;
  const Listening listening;
  const Tell tell;
  const Clock& time;
  InboxMemory memory;

  Tally refusals{};
  std::mutex keeping;        // held while something is kept; taken before the other one
  mutable std::mutex mutex;  // guards what follows, but for the server's own thread
  ProcedureBook book;
  RepeatedMessages repeated;
  std::uint64_t taken = 0, refused = 0;
  Tally strangers_left, ended_late, not_kept, times_unclear;
  std::optional<ProcedureMoment> since;  // from which on messages are known
  bool is_news = false;                  // something is not kept yet
  bool is_ended = false;
  std::string problem;
  Clock::Time not_before{};
  std::unique_ptr<MllpServer> server;  // last: its thread uses the rest
};

ProcedureInbox::ProcedureInbox(const std::string& listen, Tell tell, const Clock& time, InboxMemory memory)
    : state_(std::make_unique<State>(listen, std::move(tell), time, std::move(memory))) {}

ProcedureInbox::~ProcedureInbox() = default;

void ProcedureInbox::check(const std::string& listen) { listening_at(listen); }

void ProcedureInbox::tend() {
  State& state = *state_;
  std::string news;
  state.keep();
  {
    const std::lock_guard guard(state.mutex);
    if (state.is_ended) return;
    if (state.server || state.time.now() < state.not_before) return;
    try {
      auto server = std::make_unique<MllpServer>(
          state.listening.server,
          [&state](std::string_view message, const std::string& /*peer*/) { return state.take(message); },
          [&state](const std::string& name, const std::string& /*text*/, const std::string& /*peer*/) {
            state.complain(name);
          });
      server->start();
      if (!state.problem.empty()) news = "HL7 messages are waited for at " + state.where + " now";
      state.problem.clear();
      state.server = std::move(server);
      if (!state.since) {
        state.since = ProcedureMoment{state.time.utc(), state.time.since_boot()};
        state.is_news = true;
      }
    } catch (const std::exception& error) {
      state.not_before = state.time.now() + kListenAgain;
      if (state.problem != error.what()) news = error.what();
      state.problem = error.what();
    }
  }
  state.keep();
  if (!news.empty() && state.tell) state.tell(news);
}

void ProcedureInbox::end() {
  std::unique_ptr<MllpServer> server;
  {
    const std::lock_guard guard(state_->mutex);
    state_->is_ended = true;
    server = std::move(state_->server);
  }
  // Without the mutex, which its thread may wait for.
  server.reset();
  state_->keep();
}

ProcedureChoice ProcedureInbox::choose(const ProcedureRule& rule, UtcTime at, const EndedSince& ended) const {
  const std::lock_guard guard(state_->mutex);
  const ProcedureMoment moment = state_->moment(at);
  ProcedureChoice choice = state_->book.choose(rule, moment, ended);
  // Somebody may have been placed in the room before, or booked for now.
  const bool may_lack =
      choice.data && state_->since && moment.utc - moment.by_this_clock(*state_->since) <= rule.window;
  if (may_lack) {
    if (const std::string since = state_->known_since(moment); !since.empty())
      choice.data->chosen += "; messages before " + since + " are not known";
  }
  return choice;
}

Objection ProcedureInbox::objection(const ProcedureRule& rule, const ProcedureChoice& taken,
                                    UtcTime at) const {
  const std::lock_guard guard(state_->mutex);
  return state_->book.objection(rule, taken, state_->moment(at));
}

void ProcedureInbox::watch(const ProcedureRule& rule) {
  const std::lock_guard guard(state_->mutex);
  state_->book.watch(rule);
}

Standing ProcedureInbox::standing(const ProcedureRule& rule, const ProcedureData& data,
                                  std::optional<UtcTime> planned, UtcTime at, const EndedSince& ended) const {
  const std::lock_guard guard(state_->mutex);
  return state_->book.standing(rule, data, planned, state_->moment(at), ended);
}

void ProcedureInbox::note_recorded(const ProcedureRule& rule, const ProcedureData& data, UtcTime at) {
  {
    const std::lock_guard guard(state_->mutex);
    state_->book.note_recorded(rule, data, state_->moment(at));
    state_->is_news = true;
  }
  state_->keep();
}

std::vector<std::pair<ProcedureData, UtcTime>> ProcedureInbox::recorded(const ProcedureRule& rule) const {
  const std::lock_guard guard(state_->mutex);
  return state_->book.recorded(rule, {state_->time.utc(), state_->time.since_boot()});
}

std::vector<ProcedureData> ProcedureInbox::list(const ProcedureRule& rule, UtcTime at) const {
  const std::lock_guard guard(state_->mutex);
  return state_->book.list(rule, state_->moment(at));
}

std::optional<Clock::Duration> ProcedureInbox::changed_at(const ProcedureRule& rule) const {
  const std::lock_guard guard(state_->mutex);
  const std::optional<ProcedureMoment> changed = state_->book.changed(rule);
  return changed ? std::optional(changed->since_boot) : std::nullopt;
}

ProcedureWay ProcedureInbox::way() const {
  const std::lock_guard guard(state_->mutex);
  if (!state_->server) {
    return {"hl7", false, state_->problem.empty() ? "does not wait for messages yet" : state_->problem};
  }
  const std::uint64_t strangers = state_->server->refused(), late = state_->book.ended_late(),
                      lost = state_->book.not_kept();
  const std::string since = state_->known_since({state_->time.utc(), state_->time.since_boot()});
  return {
      "hl7", true,
      "waits for messages at " + state_->where + "; " + std::to_string(state_->taken) + " taken, " +
          std::to_string(state_->refused) + " refused" +
          (strangers == 0 ? "" : ", " + std::to_string(strangers) + " connections of strangers") +
          (since.empty() ? "" : "; messages before " + since + " are not known") +
          (lost == 0 ? "" : "; forgotten or not to be read of what concerns rooms: " + std::to_string(lost)) +
          (late == 0 ? ""
                     : "; messages that said too late that somebody left or is planned no more: " +
                           std::to_string(late))};
}

std::uint16_t ProcedureInbox::port() const {
  const std::lock_guard guard(state_->mutex);
  return state_->server ? state_->server->port() : std::uint16_t{0};
}

}  // namespace kiroku::recorder
