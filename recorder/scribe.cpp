#include "recorder/scribe.h"

namespace kiroku::recorder {
namespace {

// How soon a fact is durable in the ledger: many facts share one fsync, and nobody waits for it.
constexpr std::chrono::milliseconds kPatience{200};

}  // namespace

Scribe::Scribe(archive::CaseWriter& writer, FactQueue& facts, const CaseClock& clock, Troubles& troubles,
               Stamper& stamper, std::chrono::nanoseconds stamp_interval)
    : writer_(writer),
      facts_(facts),
      clock_(clock),
      troubles_(troubles),
      stamper_(stamper),
      stamp_interval_(stamp_interval),
      clock_watch_(clock) {}

Scribe::~Scribe() {
  stopping_ = true;
  facts_.wake();
  if (thread_.joinable()) thread_.join();
}

void Scribe::start() {
  thread_ = std::thread([this] { run(); });
}

void Scribe::run() {
  try {
    while (!stopping_) {
      if (const std::optional<archive::ClockEntry> clock = clock_watch_.check()) {
        writer_.append({*clock}, clock_.moment());
      }
      if (clock_.now_ns() >= next_stamp_ns_) {
        stamp(false);
        next_stamp_ns_ = clock_.now_ns() + stamp_interval_.count();
      }
      write(facts_.take(kPatience));
    }
  } catch (const std::exception& error) {
    failure_ = std::current_exception();
    troubles_.end_session(close_reason_for(error), error.what());
  }
}

void Scribe::write(std::vector<Fact> facts) {
  std::vector<archive::CaseEntryBody> bodies;
  const auto flush = [&] {
    if (!bodies.empty()) writer_.append(bodies, clock_.moment());
    bodies.clear();
  };
  for (Fact& fact : facts) {
    if (auto* body = std::get_if<archive::CaseEntryBody>(&fact)) {
      bodies.push_back(std::move(*body));
    } else {
      flush();
      write(std::get<AuthorityAnswer>(fact));
    }
  }
  flush();
}

void Scribe::write(const AuthorityAnswer& answer) {
  if (!answer.cause.empty()) {
    ++missed_;
    troubles_.mention("no time stamp from " + answer.authority + ": " + answer.cause);
    writer_.append({archive::TokenMissedEntry{answer.checkpoint.size, answer.authority, answer.cause}},
                   clock_.moment());
    return;
  }
  archive::TokenEntry entry;
  entry.gen_time = answer.judgement.info->gen_time;
  entry.accuracy_ns = answer.judgement.info->accuracy_ns;
  entry.serial = answer.judgement.info->serial;
  writer_.store_authority_chain(answer.authority, answer.judgement.chain);
  writer_.add_token(answer.checkpoint, answer.authority, answer.response, entry, clock_.moment());
  ++tokens_;
}

void Scribe::stamp(bool log_it) { stamper_.stamp(writer_.checkpoint(clock_.moment(), log_it)); }

void Scribe::finish(const std::string& close_reason) {
  stopping_ = true;
  facts_.wake();
  if (thread_.joinable()) thread_.join();
  if (failure_) std::rethrow_exception(failure_);
  write(facts_.take(std::chrono::nanoseconds(0)));
  writer_.close(close_reason, clock_.moment());
  stamp(true);
  while (stamper_.outstanding() > 0) write(facts_.take(kPatience));
  write(facts_.take(std::chrono::nanoseconds(0)));
  writer_.finish(clock_.moment());
}

}  // namespace kiroku::recorder
