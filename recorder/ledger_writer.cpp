#include "recorder/ledger_writer.h"

#include "recorder/clock/whole_seconds.h"
#include "recorder/segmenter.h"

namespace kiroku::recorder {
namespace {

// How soon a fact is durable in the ledger: many facts share one fsync, and nobody waits for it.
constexpr std::chrono::milliseconds kPatience{200};

/// "37 s", rounded up.
}  // namespace

LedgerWriter::LedgerWriter(FactQueue& facts, const CaseClock& clock, ProblemLog& problems, PreRoll* pre_roll,
                           std::chrono::nanoseconds stamp_interval)
    : facts_(facts),
      clock_(clock),
      problems_(problems),
      pre_roll_(pre_roll),
      stamp_interval_(stamp_interval),
      clock_watch_(clock) {}

LedgerWriter::~LedgerWriter() {
  stopping_ = true;
  facts_.wake();
  if (thread_.joinable()) thread_.join();
}

void LedgerWriter::start() {
  thread_ = std::thread([this] { run(); });
}

void LedgerWriter::begin_case(archive::CaseWriter& writer, Stamper& stamper) {
  begun_ = {&writer, &stamper};
  case_ = &begun_;
  facts_.wake();
}

void LedgerWriter::abandon() {
  stopping_ = true;
  facts_.wake();
  if (thread_.joinable()) thread_.join();
}

void LedgerWriter::hold() {
  while (!stopping_ && case_ == nullptr) {
    for (Fact& fact : facts_.take(kPatience)) pre_roll_->add(std::move(fact));
    pre_roll_->trim(clock_.now_ns());
  }
  if (case_ != nullptr) write(pre_roll_->take());
}

void LedgerWriter::run() {
  try {
    if (pre_roll_ != nullptr) hold();
    while (!stopping_) {
      state_clock();
      if (clock_.now_ns() >= next_stamp_ns_) {
        stamper().stamp(writer().checkpoint(clock_.moment()));
        next_stamp_ns_ = clock_.now_ns() + stamp_interval_.count();
      }
      write(facts_.take(kPatience));
    }
  } catch (const std::exception& error) {
    failure_ = std::current_exception();
    problems_.end_session(close_reason_for(error), error.what());
  }
}

void LedgerWriter::state_clock() {
  if (const std::optional<archive::ClockEntry> clock = clock_watch_.check()) {
    writer().append({*clock}, clock_.moment());
  }
}

void LedgerWriter::write(std::vector<Fact> facts) {
  std::vector<archive::CaseEntryBody> bodies;
  const auto flush = [&] {
    if (!bodies.empty()) writer().append(bodies, clock_.moment());
    bodies.clear();
  };
  for (Fact& fact : facts) {
    if (auto* body = std::get_if<archive::CaseEntryBody>(&fact)) {
      auto* gap = std::get_if<archive::GapEntry>(body);
      if (gap == nullptr || pre_roll_ == nullptr) {
        bodies.push_back(std::move(*body));
      } else if (const auto within = pre_roll_->within_case(std::move(*gap))) {
        bodies.emplace_back(*within);
      }
      continue;
    }
    flush();
    if (auto* segment = std::get_if<StandbySegment>(&fact)) {
      write(std::move(*segment));
    } else {
      write(std::get<AuthorityAnswer>(fact));
    }
  }
  flush();
}

void LedgerWriter::write(StandbySegment segment) {
  if (!pre_roll_->keeps(segment)) return;
  const std::filesystem::path from = pre_roll_->path_of(segment.entry.file);
  pre_roll_->number(segment);
  writer().take_in(segment.entry, from);
  writer().append({std::move(segment.entry)}, clock_.moment());
}

void LedgerWriter::write(const AuthorityAnswer& answer) {
  tell(answer);
  if (!answer.valid()) {
    ++missed_;
    writer().append(
        {archive::TokenMissedEntry{answer.checkpoint.size, answer.authority,
                                   answer.cause + "; left alone for " + whole_seconds(answer.pause)}},
        clock_.moment());
    return;
  }
  if (const auto in_the_way = writer().token_in_the_way(answer.checkpoint.size, answer.authority)) {
    ++missed_;
    problems_.report("no time-stamp from " + answer.authority + ": " + in_the_way->cause);
    writer().append({*in_the_way}, clock_.moment());
    return;
  }
  writer().store_authority_chain(answer.authority, answer.judgement.chain);
  archive::TokenEntry facts = token_facts(answer);
  facts.exchange = {clock_.at_ns(answer.asked), clock_.at_ns(answer.answered)};
  writer().add_token(answer.checkpoint, answer.authority, answer.response, facts, clock_.moment());
  ++tokens_;
  stamper().entered(answer);
}

void LedgerWriter::tell(const AuthorityAnswer& answer) {
  if (!answer.valid()) {
    failing_ns_.try_emplace(answer.authority, clock_.now_ns());
    problems_.report("no time-stamp from " + answer.authority + ": " + answer.cause);
    return;
  }
  const auto failing = failing_ns_.extract(answer.authority);
  if (answer.hurried && failing.empty()) return;  // at the end of a case, as it should be
  const auto [path, first] = paths_.try_emplace(answer.authority, answer.path);
  const bool moved = !first && path->second != answer.path;
  path->second = answer.path;
  const bool begins_unshared = first && !answer.not_shared.empty();
  if (failing.empty() && !moved && !begins_unshared) return;
  std::string sentence = answer.authority + " gives time-stamps";
  if (!failing.empty()) {
    sentence += " again after " + whole_seconds(std::chrono::nanoseconds(clock_.now_ns() - failing.mapped()));
  }
  if (!answer.path.empty()) sentence += ", " + answer.path;
  if (!answer.not_shared.empty()) sentence += "; not shared with other rooms: " + answer.not_shared;
  problems_.report(sentence);
}

void LedgerWriter::state_slow_end(const Ended& ended, const archive::Moment& close) {
  if (close.mono_ns - ended.at_ns <= kLongestUnstatedEndNs) return;
  std::vector<archive::CaseEntryBody> gaps;
  for (const std::string& stream : ended.streams) {
    gaps.emplace_back(archive::GapEntry{stream, {ended.at_ns, close.mono_ns}, archive::GapCause::kOverload});
  }
  if (!gaps.empty()) writer().append(gaps, close);
}

void LedgerWriter::finish(const std::string& close_reason, const Ended& ended) {
  stopping_ = true;
  facts_.wake();
  if (thread_.joinable()) thread_.join();
  if (failure_) std::rethrow_exception(failure_);
  // A case that ended as soon as it had begun.
  if (pre_roll_ != nullptr) write(pre_roll_->take());
  write(facts_.take(std::chrono::nanoseconds(0)));
  // A clock that is set beyond the end of a schedule's window ends the case before the step was looked for.
  state_clock();
  // One moment for both: the disk may take as long again for the gaps.
  const archive::Moment close = clock_.moment();
  state_slow_end(ended, close);
  writer().close(close_reason, close);
  stamper().stamp_closing(writer().checkpoint(clock_.moment(), true));
  while (stamper().outstanding() > 0) write(facts_.take(kPatience));
  write(facts_.take(std::chrono::nanoseconds(0)));
  writer().finish(clock_.moment());
}

}  // namespace kiroku::recorder
