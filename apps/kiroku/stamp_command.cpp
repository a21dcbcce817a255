#include <algorithm>
#include <atomic>
#include <csignal>
#include <iostream>
#include <memory>
#include <thread>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "archive/catalogue/catalogue.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "recorder/late_stamping.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;
using recorder::LateStamping;
using std::chrono::steady_clock;

// The queue is looked at again at least so often: another process may have put something in.
constexpr std::chrono::seconds kLongestSleep{30};
constexpr std::chrono::milliseconds kSlice{100};

struct Request {
  std::vector<std::string> cases;
  std::optional<std::string> home;
  bool watch = false, json = false;
};

std::atomic<bool> stopped{false};

void catch_stops() {
  struct sigaction stop {};
  stop.sa_handler = [](int) { stopped = true; };
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(signal, &stop, nullptr);
}

ordered_json result_json(const LateStamping::Result& result) {
  ordered_json out = {{"stamped", ordered_json::array()},
                      {"waiting", ordered_json::array()},
                      {"dropped", ordered_json::array()}};
  for (const auto& each : result.stamped) {
    out["stamped"].push_back({{"case", each.case_id},
                              {"authority", each.authority},
                              {"checkpoint", each.checkpoint},
                              {"gen_time", format_utc(each.gen_time)},
                              {"path", each.path}});
  }
  for (const auto& each : result.waiting) {
    out["waiting"].push_back({{"case", each.wanted.case_id},
                              {"authority", each.wanted.authority},
                              {"since", format_utc(each.wanted.since)},
                              {"attempts", each.wanted.attempts},
                              {"last_error", each.wanted.last_error},
                              {"reason", each.reason}});
  }
  for (const auto& each : result.dropped) {
    out["dropped"].push_back(
        {{"case", each.case_id}, {"authority", each.authority}, {"reason", each.reason}});
  }
  return out;
}

void print_text(const LateStamping::Result& result) {
  for (const auto& each : result.stamped) {
    std::cout << each.case_id << "  stamped by " << each.authority << " at " << format_utc(each.gen_time)
              << (each.path.empty() ? "" : ", " + printable(each.path)) << "\n";
  }
  for (const auto& each : result.dropped) {
    std::cout << printable(each.case_id) << "  not wanted from " << printable(each.authority)
              << " any more: " << each.reason << "\n";
  }
  for (const auto& each : result.waiting) {
    std::cout << each.wanted.case_id << "  waits for " << each.wanted.authority << ": "
              << printable(each.reason) << "\n";
  }
  std::cout << std::flush;
}

void refresh_catalogue(const Home& home, const LateStamping::Result& result) {
  if (result.stamped.empty()) return;
  try {
    const auto catalogue = archive::Catalogue::open(home.catalogue_file());
    for (const auto& each : result.stamped) catalogue->refresh(home.archive() / each.case_id);
  } catch (const Error& error) {
    print_error("kiroku", std::string("warning: the catalogue does not know of this yet: ") + error.what());
  }
}

/// Until `time`, or a stop.
void sleep_until(steady_clock::time_point time) {
  while (!stopped && steady_clock::now() < time) std::this_thread::sleep_for(kSlice);
}

int watch(LateStamping& stamping, const Home& home, bool json) {
  catch_stops();
  std::size_t waiting = 0;
  for (bool first = true; !stopped; first = false) {
    const LateStamping::Result result = stamping.work_off(LateStamping::Patience::kAllPauses);
    refresh_catalogue(home, result);
    const bool news =
        first || !result.stamped.empty() || !result.dropped.empty() || result.waiting.size() != waiting;
    waiting = result.waiting.size();
    if (news && json) {
      std::cout << result_json(result).dump() << std::endl;
    } else if (news) {
      print_text(result);
    }
    const auto now = steady_clock::now();
    sleep_until(std::clamp(stamping.next().value_or(now + kLongestSleep), now + kSlice, now + kLongestSleep));
  }
  return kDone;
}

int run(const Request& request) {
  const Home home = Home::open(request.home);
  const Configuration configuration = home.configuration();
  const Authorities authorities(home, configuration, {});
  const auto queue = recorder::StampingQueue::open(home.stamping_file());
  const timestamp::TrustStore trust = home.trust();
  const crypto::SigningKey key = home.signing_key();
  const std::string device_name = home.device().name();
  const auto log = open_log(home, key);
  LateStamping stamping(authorities.named(), {.archive = home.archive(),
                                              .key = &key,
                                              .device_name = device_name,
                                              .log = log.get(),
                                              .trust = &trust,
                                              .queue = queue.get()});
  for (const std::string& named : request.cases) {
    const std::filesystem::path folder = find_case(home, named);
    if (!home.holds(folder)) {
      throw UsageError("'" + named + "' is no case of " + home.archive().string() +
                       ": only the recorder that recorded a case adds time-stamps to it");
    }
    stamping.want(std::filesystem::canonical(folder).filename().string());
  }
  if (request.watch) return watch(stamping, home, request.json);

  const LateStamping::Result result = stamping.work_off(LateStamping::Patience::kLimitsOnly);
  refresh_catalogue(home, result);
  if (request.json) {
    print_json(result_json(result));
  } else if (result.stamped.empty() && result.waiting.empty() && result.dropped.empty()) {
    std::cout << "No time-stamp is wanted.\n";
  } else {
    print_text(result);
  }
  return result.waiting.empty() ? kDone : kNoAnswer;
}

}  // namespace

void add_stamp_command(Command& program) {
  Command& command =
      program.add_command("stamp", "gets the time-stamps that did not come while a case was recorded");
  const auto request = std::make_shared<Request>();
  command.option(
      "--case", "CASE", request->cases,
      "also wants the end of this case stamped by every authority of kiroku.toml, whatever is known");
  command.flag("--watch", request->watch, "goes on until it is stopped, asking again when it may");
  add_home_option(command, request->home);
  command.flag("--json", request->json,
               "prints one JSON object instead; with --watch one a line, when something changes");
  command.explain(
      "Closed cases get a token over their newest checkpoint, its entry, and a last checkpoint; one token "
      "covers "
      "everything before it. A case that is being recorded waits: its recorder asks by itself. Authorities "
      "are "
      "asked no more often than they and 'min_interval' demand.");
  command.explain(
      "Exit status: 0 nothing is wanted any more, 2 wrong usage or unusable files, 3 something still waits.");
  command.example("kiroku stamp", "gets what can be had now");
  command.example("kiroku stamp --watch", "goes on as networks come back, until Ctrl-C");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
