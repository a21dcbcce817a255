#include "recorder/events_lane.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"

namespace kiroku::recorder {

EventsLane::EventsLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info)
    : context_(context),
      segments_(context, stream_index, std::move(info),
                [&problems = context.problems](const std::exception& error) {
                  problems.end_session(close_reason_for(error), error.what());
                }) {}

void EventsLane::begin(std::int64_t begins_ns) {
  const std::lock_guard guard(mutex_);
  segments_.begin(begins_ns);
}

void EventsLane::mark(const std::string& text) { add("mark", "text", text); }

void EventsLane::subject_missing(const std::string& why) { add("subject-missing", "text", why); }

void EventsLane::ahead_left_out(const std::string& why) { add("ahead-left-out", "text", why); }

void EventsLane::patient_differs(const std::string& how) { add("patient-differs", "text", how); }

void EventsLane::picture_turn(const std::string& stream, const std::string& how) {
  nlohmann::ordered_json members;
  members["stream"] = stream;
  members["text"] = how;
  add("picture-turn", members);
}

void EventsLane::profile(const nlohmann::ordered_json& decision) { add("profile", "profile", decision); }

void EventsLane::late_subject(const Bytes& json) {
  const auto subject = parse_foreign_json<nlohmann::ordered_json>(text_of(json));
  if (!subject.is_object()) throw UsageError("a subject must be a JSON object");
  add("subject", "subject", subject);
}

void EventsLane::add(const std::string& kind, const std::string& key, const nlohmann::ordered_json& value) {
  nlohmann::ordered_json members;
  members[key] = value;
  add(kind, members);
}

void EventsLane::add(const std::string& kind, const nlohmann::ordered_json& members) {
  const archive::Moment now = context_.clock.moment();
  nlohmann::ordered_json event;
  event["time_ns"] = now.mono_ns;
  event["utc"] = format_utc(now.utc);
  event["kind"] = kind;
  event.update(members);
  const std::string event_text = event.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  const crypto::Secret salt = crypto::Secret::random(32);
  Bytes committed = to_bytes(salt.bytes());
  append(committed, bytes_of(event_text));
  nlohmann::ordered_json line;
  line["salt"] = crypto::to_hex(salt.bytes());
  line["event"] = event_text;

  const std::lock_guard guard(mutex_);
  if (closed_) throw Error("the case is closed: nothing can be marked in it any more");
  waiting_.push_back(line.dump() + "\n");
  context_.facts.push(archive::CaseEntryBody(archive::MarkEntry{crypto::sha256(committed)}));
}

void EventsLane::step(std::int64_t now_ns) {
  std::vector<std::string> events;
  {
    const std::lock_guard guard(mutex_);
    events.swap(waiting_);
  }
  segments_.seal(events, 0, now_ns);
}

void EventsLane::finish(std::int64_t close_ns) {
  {
    const std::lock_guard guard(mutex_);
    closed_ = true;
  }
  step(close_ns);
  segments_.finish(close_ns);
}

}  // namespace kiroku::recorder
