#include "recorder/events_lane.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"

namespace kiroku::recorder {

EventsLane::EventsLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info)
    : context_(context), output_(context.store, stream_index, std::move(info), context.facts) {}

void EventsLane::begin(std::int64_t begins_ns) {
  const std::lock_guard guard(mutex_);
  sealed_until_ns_ = begins_ns;
}

void EventsLane::mark(const std::string& text) { add("mark", "text", text); }

void EventsLane::subject_missing(const std::string& why) { add("subject-missing", "text", why); }

void EventsLane::late_subject(const Bytes& json) {
  const auto subject = nlohmann::ordered_json::parse(text_of(json), nullptr, false);
  if (!subject.is_object()) throw UsageError("a subject must be a JSON object");
  add("subject", "subject", subject);
}

void EventsLane::add(const std::string& kind, const std::string& key, const nlohmann::ordered_json& value) {
  const archive::Moment now = context_.clock.moment();
  nlohmann::ordered_json event;
  event["time_ns"] = now.mono_ns;
  event["utc"] = format_utc(now.utc);
  event["kind"] = kind;
  event[key] = value;
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
  if (events.empty() || gap_cause_) return;
  const std::int64_t end_ns = std::max(now_ns, sealed_until_ns_ + 1);
  try {
    output_.begin(sealed_until_ns_, sealed_until_ns_, "1/1000000000");
    for (const std::string& event : events) output_.write(bytes_of(event));
    output_.end({end_ns, events.size(), 0});
    sealed_until_ns_ = end_ns;
  } catch (const std::exception& error) {
    gap_cause_ = gap_cause_for(error);
    context_.troubles.end_session(close_reason_for(error), error.what());
    try {
      output_.give_up({end_ns, 0, 0});
    } catch (const std::exception& second) {
      context_.troubles.mention(second.what());
    }
  }
}

void EventsLane::finish(std::int64_t close_ns) {
  {
    const std::lock_guard guard(mutex_);
    closed_ = true;
  }
  step(close_ns);
  try {
    output_.drain();
  } catch (const std::exception& error) {
    if (!gap_cause_) gap_cause_ = gap_cause_for(error);
    context_.troubles.end_session(close_reason_for(error), error.what());
  }
  if (gap_cause_) {
    const std::int64_t since_ns = output_.claimed_until_ns();
    context_.facts.push(archive::CaseEntryBody(
        archive::GapEntry{output_.info().name, {since_ns, std::max(close_ns, since_ns)}, *gap_cause_}));
  }
}

}  // namespace kiroku::recorder
