#include "recorder/stamper.h"

#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

// Another process may have learnt meanwhile that an authority is to be left alone, or that it answers again.
constexpr std::chrono::seconds kLongestSleep{5};

}  // namespace

struct Stamper::Worker {
  Worker(NamedAuthority named, const Context& given, FactQueue& queue)
      : context(given),
        facts(queue),
        contact(std::move(named), given.trust, given.queue, *given.clock),
        thread([this] { run(); }) {}
  ~Worker() {
    {
      const std::lock_guard guard(mutex);
      stopping = true;
    }
    contact.hurry();  // behind the above, so that the authority is not asked for a token that nobody reads
    changed.notify_all();
    thread.join();
  }

  void give(const archive::StoredCheckpoint& checkpoint, bool is_closing) {
    {
      const std::lock_guard guard(mutex);
      closing = closing || is_closing;
      // If nothing was added since, there is a token, or a request for one, already.
      if (!newest || *newest != checkpoint.size || (is_closing && next)) {
        newest = checkpoint.size;
        next = checkpoint;
        unqueued = true;
        due = true;
      }
    }
    // A round does not put off the end of a case. Behind the above: its one request is for this checkpoint.
    if (is_closing) contact.hurry();
    changed.notify_all();
  }

  void run() {
    std::unique_lock lock(mutex);
    for (;;) {
      changed.wait(lock, [&] { return stopping || next.has_value(); });
      if (stopping) return;
      if (std::exchange(unqueued, false)) put_in_queue(lock);
      const bool last_chance = closing;
      lock.unlock();
      const bool by_round = !last_chance && contact.may_share();
      const AuthorityContact::Time allowed = last_chance ? contact.limit() : contact.next();
      lock.lock();
      if (stopping) return;
      if (closing != last_chance) continue;
      if (by_round) {
        await_round(lock);
        continue;
      }
      const Clock& clock = *context.clock;
      const Clock::Time now = clock.now();
      if (allowed > now) {
        if (closing && allowed > now + kClosingPatience) {
          give_up();
        } else {
          due = closing;
          clock.wait_until(changed, lock, std::min(allowed, now + kLongestSleep),
                           [&] { return stopping || unqueued || closing != last_chance; });
        }
        continue;
      }
      ask(lock);
    }
  }

  /// Where no shared token comes, `next` stays: the authority is asked for it as soon as it may be.
  void await_round(std::unique_lock<std::mutex>& lock) {
    const archive::StoredCheckpoint checkpoint = *next;
    due = asking = true;
    unqueued = false;
    lock.unlock();
    std::optional<AuthorityAnswer> answer = contact.wait_for_shared(checkpoint);
    lock.lock();
    asking = false;
    if (answer) take(std::move(*answer));
  }

  void ask(std::unique_lock<std::mutex>& lock) {
    const archive::StoredCheckpoint checkpoint = *next;
    due = asking = true;
    unqueued = false;  // what the queue knows is older at most, and will do
    lock.unlock();
    AuthorityAnswer answer = contact.ask_in_place_of_sharing(checkpoint);
    if (!answer.valid()) {
      in_queue([&] { context.queue->failed(context.case_id, answer.authority, answer.cause); });
    }
    lock.lock();
    asking = false;
    take(std::move(answer));
  }

  void take(AuthorityAnswer answer) {
    const bool newer = unqueued;
    if (!newer && (answer.valid() || closing)) next.reset();
    facts.push(std::move(answer));
    due = newer;
  }

  /// The case ends before the authority may be asked again.
  void give_up() {
    if (const std::string failure = contact.last_failure(); !failure.empty()) {
      AuthorityAnswer answer;
      answer.authority = contact.name();
      answer.checkpoint = *next;
      answer.cause = "not asked, since it is to be left alone: " + failure;
      answer.pause = contact.status().pause;
      facts.push(std::move(answer));
    }
    next.reset();
    due = false;
  }

  void put_in_queue(std::unique_lock<std::mutex>& lock) {
    const std::uint64_t size = next->size;
    lock.unlock();
    in_queue([&] { context.queue->want(context.case_id, contact.name(), size, context.clock->utc()); });
    lock.lock();
  }

  /// Does something with the queue, if there is one; recording goes on without it.
  template <typename Step>
  void in_queue(Step step) {
    if (context.queue == nullptr) return;
    try {
      step();
    } catch (const Error& error) {
      if (context.report) context.report(error.what());
    }
  }

  const Context& context;
  FactQueue& facts;
  AuthorityContact contact;
  mutable std::mutex mutex;  // of what follows
  std::condition_variable changed;
  std::optional<archive::StoredCheckpoint> next;
  std::optional<std::uint64_t> newest;  // size of the newest checkpoint that was given
  bool unqueued = false;                // the queue does not know of `next` yet
  bool due = false;                     // an answer to `next` is about to come
  bool asking = false;
  bool closing = false;
  bool stopping = false;
  std::thread thread;
};

Stamper::Stamper(std::vector<NamedAuthority> authorities, Context context, FactQueue& facts)
    : context_(std::move(context)) {
  for (NamedAuthority& authority : authorities)
    workers_.push_back(std::make_unique<Worker>(std::move(authority), context_, facts));
}

Stamper::~Stamper() = default;

void Stamper::stamp(const archive::StoredCheckpoint& checkpoint) {
  for (const auto& worker : workers_) worker->give(checkpoint, false);
}

void Stamper::stamp_closing(const archive::StoredCheckpoint& checkpoint) {
  for (const auto& worker : workers_) worker->give(checkpoint, true);
}

void Stamper::entered(const AuthorityAnswer& answer) {
  for (const auto& worker : workers_) {
    if (worker->contact.name() != answer.authority) continue;
    worker->in_queue(
        [&] { context_.queue->done(context_.case_id, answer.authority, answer.checkpoint.size); });
  }
}

std::size_t Stamper::outstanding() const {
  std::size_t count = 0;
  for (const auto& worker : workers_) {
    const std::lock_guard guard(worker->mutex);
    count += worker->due || worker->asking ? 1U : 0U;
  }
  return count;
}

std::vector<AuthorityStatus> Stamper::status() const {
  std::vector<AuthorityStatus> list;
  for (const auto& worker : workers_) list.push_back(worker->contact.status());
  return list;
}

}  // namespace kiroku::recorder
