#include "viewer/programs/plan_picker.h"

#include <array>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <poll.h>
#include <sys/socket.h>
#include <thread>
#include <utility>

#include "viewer/http/request.h"
#include "viewer/people/turns.h"
#include "viewer/programs/child_program.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

constexpr int kTooLong = 504, kCannotBeShown = 422;
/// Pictures of a plan as text.
constexpr std::size_t kLongestLine = 16U << 20;

struct Question {
  std::string text;
  bool done = false;
  std::string answer;
  int refused = 0;  // a status, with its sentence in `answer`
};

/// The program with its three ends.
class Asked {
 public:
  Asked(const fs::path& program, const fs::path& seal_file, const Clock& clock,
        ProgramListener::Progress progress)
      : clock_(clock), listener_(std::move(progress)) {
    DescriptorPair in = make_socket_pair(), out = make_pipe(), err = make_pipe();
    std::vector<Descriptor> given;
    given.push_back(std::move(in.theirs));
    given.push_back(std::move(out.theirs));
    given.push_back(std::move(err.theirs));
    in_ = std::move(in.ours);
    out_ = std::move(out.ours);
    err_ = std::move(err.ours);
    child_.emplace(program, std::vector<std::string>{"plan", "pick", seal_file.string()}, std::move(given),
                   ChildPriority::kAnswering);
  }

  enum class Heard { kLine, kEnd, kTooLate, kLeave };
  /// A line of its standard output into `line`.
  Heard hear(std::string& line, std::chrono::milliseconds patience, const std::function<bool()>& leave) {
    constexpr int kLookMs = 100;
    const Clock::Time until = clock_.now() + patience;
    bool open = true;
    for (;;) {
      const std::size_t end = heard_.find('\n');
      if (end != std::string::npos) {
        line = heard_.substr(0, end);
        heard_.erase(0, end + 1);
        return Heard::kLine;
      }
      if (!open || heard_.size() > kLongestLine) return Heard::kEnd;
      if (leave()) return Heard::kLeave;
      if (clock_.now() > until) return Heard::kTooLate;
      std::array<pollfd, 2> ends{{{out_.number(), POLLIN, 0}, {err_.number(), POLLIN, 0}}};
      if (::poll(ends.data(), ends.size(), kLookMs) <= 0) continue;
      if (ends[1].revents != 0) drain(err_.number(), [&](std::string_view bytes) { listener_.take(bytes); });
      if (ends[0].revents != 0) open = drain(out_.number(), [&](std::string_view bytes) { heard_ += bytes; });
    }
  }

  bool say(const std::string& text) {
    const std::string line = text + "\n";
    return ::send(in_.number(), line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
           static_cast<ssize_t>(line.size());
  }

  [[nodiscard]] std::string problem() {
    // Its last words may have come after the end of its answers.
    std::array<pollfd, 1> end{{{err_.number(), POLLIN, 0}}};
    constexpr int kLastWordsMs = 500;
    while (::poll(end.data(), end.size(), kLastWordsMs) > 0 &&
           drain(err_.number(), [&](std::string_view bytes) { listener_.take(bytes); })) {
    }
    return listener_.problem().empty() ? "the program that shows the plan ended without a word"
                                       : listener_.problem();
  }

 private:
  const Clock& clock_;
  ProgramListener listener_;
  Descriptor in_, out_, err_;
  std::string heard_;
  std::optional<ChildProgram> child_;
};

}  // namespace

struct PlanPicker::Work {
  explicit Work(Options asked)
      : options(std::move(asked)), clock(*options.clock), thread([this] { run(); }) {}
  ~Work() {
    {
      const std::lock_guard guard(mutex);
      ending = true;
    }
    changed.notify_all();
    thread.join();
  }
  Work(const Work&) = delete;
  Work& operator=(const Work&) = delete;

  /// The program belongs to this thread, with which it would end.
  void run() {
    std::unique_lock lock(mutex);
    for (;;) {
      changed.wait(lock, [&] { return ending || (wanted && !refused); });
      if (ending) return;
      const fs::path seal = *wanted;
      ready = false;
      doing.clear();
      share.reset();
      lock.unlock();
      int status = 0;
      std::string problem;
      try {
        std::tie(status, problem) = serve(seal);
      } catch (const std::exception& error) {
        status = kCannotBeShown;
        problem = error.what();
      }
      lock.lock();
      ready = false;
      if (wanted == seal) {
        // Who waits for an answer is told why there is none; where nobody waits, the next who asks.
        if (status != 0 && !question) {
          refused = status;
          sentence = problem;
        } else {
          wanted.reset();
        }
      }
      if (question)
        settle(*question, status == 0 ? 409 : status,
               status == 0 ? "another plan was asked for meanwhile: ask again" : problem);
    }
  }

  /// Until nobody asks any more or another plan is wanted: status 0; else why it ended.
  std::pair<int, std::string> serve(const fs::path& seal) {
    bool prepared = false;
    const auto leave = [&] {
      const std::lock_guard guard(mutex);
      return ending || wanted != seal || (prepared && !ready) || clock.now() - last_asked > options.idle;
    };
    Asked program(options.program, seal, clock, [&](const std::string& what, std::optional<double> part) {
      const std::lock_guard guard(mutex);
      doing = what;
      share = part;
    });
    std::string line;
    for (;; prepared = true) {
      const auto heard = program.hear(line, prepared ? options.to_answer : options.to_prepare, leave);
      if (heard == Asked::Heard::kEnd) return {kCannotBeShown, program.problem()};
      if (heard == Asked::Heard::kTooLate)
        return {kTooLong, prepared ? "a picture of the plan took too long; the program was ended: ask again"
                                   : "carrying out the plan took too long; the program was ended"};
      if (heard == Asked::Heard::kLeave) return {};
      std::unique_lock lock(mutex);
      if (prepared) {
        settle(*question, 0, line);
      } else {
        ready = true;
      }
      // Not ready any more: another plan was wanted in between.
      const auto waited = [&] { return ending || wanted != seal || !ready || question; };
      while (!waited()) {
        if (clock.now() - last_asked >= options.idle) {
          ready = false;  // whoever asks from now on begins anew
          return {};
        }
        clock.wait_until(changed, lock, last_asked + options.idle, waited);
      }
      if (ending || wanted != seal || !ready) return {};
      if (!program.say(question->text)) return {kCannotBeShown, program.problem()};
    }
  }

  void settle(Question& one, int status, std::string text) {
    one.done = true;
    one.refused = status;
    one.answer = std::move(text);
    question.reset();
    changed.notify_all();
  }

  PickingAnswer ask(const fs::path& seal, const std::string& who, const std::string& text) {
    std::unique_lock lock(mutex);
    const bool same = wanted == seal;
    if (wanted && !same && who != last_who && clock.now() - last_asked < options.reserved)
      throw Refusal(409, last_who + " picks points on another plan: wait until that is done");
    last_asked = clock.now();
    last_who = who;
    if (refused) {
      const int status = std::exchange(refused, 0);
      wanted.reset();
      if (same) throw Refusal(status, sentence);
    }
    if (wanted != seal) {
      wanted = seal;
      ready = false;
      doing.clear();
      share.reset();
      changed.notify_all();
    }
    if (!ready) return {false, doing, share, {}};
    const Turns::Turn turn(turns, who);
    if (!clock.wait_for(changed, lock, options.to_answer + kToBeEnded, [&] { return !question; }))
      throw Refusal(503, kOthersAsk);
    if (!ready || wanted != seal) return {false, doing, share, {}};
    const auto mine = std::make_shared<Question>();
    mine->text = text;
    question = mine;
    changed.notify_all();
    if (!clock.wait_for(changed, lock, options.to_answer + kToBeEnded, [&] { return mine->done; }))
      throw Refusal(kTooLong, "a picture of the plan took too long");
    if (mine->refused != 0) throw Refusal(mine->refused, mine->answer);
    return {true, {}, {}, mine->answer};
  }

  static constexpr auto kToBeEnded = std::chrono::seconds(5);
  static constexpr const char* kOthersAsk = "others ask for pictures of the plan: try again";

  const Options options;
  const Clock& clock;
  std::mutex mutex;  // of what follows
  std::condition_variable changed;
  bool ending = false;
  std::optional<fs::path> wanted;  // the sealed plan that is asked about
  bool ready = false;              // it is carried out
  std::string doing;
  std::optional<double> share;
  int refused = 0;  // why it is not: a status and a sentence, until the next who asks was told
  std::string sentence;
  std::string last_who;
  Clock::Time last_asked;
  std::shared_ptr<Question> question;  // the one that is being answered
  /// Of it, and of those that come after it: each holds a thread of the server. A page asks for three things
  /// at a time.
  Turns turns{{.all = 4, .of_person = 3},
              {kOthersAsk, "you ask for pictures of the plan already: try again in a moment"}};
  std::thread thread;  // last: uses the rest
};

PlanPicker::PlanPicker(Options options) : work_(std::make_unique<Work>(std::move(options))) {}

PlanPicker::~PlanPicker() = default;

PickingAnswer PlanPicker::ask(const fs::path& seal_file, const std::string& who,
                              const std::string& question) {
  return work_->ask(seal_file, who, question);
}

}  // namespace kiroku::viewer
