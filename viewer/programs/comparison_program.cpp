#include "viewer/programs/comparison_program.h"

#include <array>
#include <optional>
#include <poll.h>
#include <sys/socket.h>
#include <thread>

#include "crypto/remote_identity.h"

namespace kiroku::viewer {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr int kIdentitySocket = 3;
constexpr std::size_t kMostOutput = 4U << 20;

/// Until both ends are closed. What the program itself started may hold them open: not waited for once the
/// program was ended by force.
void listen_until_end(const ChildProgram& child, int out, int err, std::chrono::milliseconds limit,
                      ComparisonProgramEnd& end, ProgramListener& listener, const std::atomic<bool>& stop) {
  constexpr int kPatienceMs = 200;
  constexpr auto kGrace = std::chrono::seconds(5), kLastWords = std::chrono::seconds(1);
  std::array<pollfd, 2> ends{{{out, POLLIN, 0}, {err, POLLIN, 0}}};
  const SteadyClock::time_point begin = SteadyClock::now();
  std::optional<SteadyClock::time_point> asked_to_end, ended;
  while (ends[0].fd >= 0 || ends[1].fd >= 0) {
    const SteadyClock::time_point now = SteadyClock::now();
    if (!asked_to_end && (stop || now - begin > limit)) {
      end.overdue = !stop;
      asked_to_end = now;
      child.ask_to_end();
    } else if (asked_to_end && !ended && now - *asked_to_end > kGrace) {
      ended = now;
      child.end_by_force();
    } else if (ended && now - *ended > kLastWords) {
      return;
    }
    if (::poll(ends.data(), ends.size(), kPatienceMs) <= 0) continue;
    if (ends[0].revents != 0 && !drain(out, [&](std::string_view bytes) {
          if (end.out.size() < kMostOutput) end.out += bytes;
        }))
      ends[0].fd = -1;
    if (ends[1].revents != 0 && !drain(err, [&](std::string_view bytes) { listener.take(bytes); }))
      ends[1].fd = -1;
  }
}

}  // namespace

ComparisonProgramEnd run_comparison_program(const std::filesystem::path& program,
                                            const ComparisonProgramCall& call,
                                            const crypto::AgeIdentities& identities,
                                            const ProgramListener::Progress& progress,
                                            const std::atomic<bool>& stop) {
  std::vector<std::string> arguments{"compare", "--identity-socket", std::to_string(kIdentitySocket)};
  arguments.insert(arguments.end(), call.arguments.begin(), call.arguments.end());
  DescriptorPair out = make_pipe(), err = make_pipe(), socket = make_socket_pair();
  std::vector<Descriptor> given;
  given.push_back(file_of_text(call.input));
  given.push_back(std::move(out.theirs));
  given.push_back(std::move(err.theirs));
  given.push_back(std::move(socket.theirs));
  if (!call.further_file.empty()) given.push_back(file_of_text(call.further_file));

  ChildProgram child(program, arguments, std::move(given), call.priority);
  ComparisonProgramEnd end;
  ProgramListener listener(progress);
  {
    std::jthread answering([&] { crypto::answer_for(identities, socket.ours.number()); });
    listen_until_end(child, out.ours.number(), err.ours.number(), call.limit, end, listener, stop);
    ::shutdown(socket.ours.number(), SHUT_RDWR);
  }
  constexpr auto kToLeave = std::chrono::seconds(5);
  end.status = child.wait(kToLeave);
  end.problem = listener.problem();
  if (end.status == ChildProgram::kNotStarted && end.problem.empty())
    end.problem = "the program " + program.string() + " cannot be started; install Kiroku anew";
  return end;
}

}  // namespace kiroku::viewer
