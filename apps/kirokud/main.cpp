// kirokud: records unattended. Configuration in kiroku.toml; control by `kiroku case` and `kiroku status`.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <iostream>
#include <malloc.h>
#include <memory>
#include <sstream>
#include <systemd/sd-daemon.h>
#include <unistd.h>
#include <vector>

#include <nlohmann/json.hpp>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/configuration/consent_configuration.h"
#include "apps/configuration/viewer_configuration.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kiroku/recovering.h"
#include "apps/kiroku/standing_consents.h"
#include "apps/kirokud/descriptor_store.h"
#include "apps/kirokud/descriptor_watch.h"
#include "apps/kirokud/end_signals.h"
#include "apps/kirokud/hardware_watch.h"
#include "apps/kirokud/late_stamper.h"
#include "apps/kirokud/room_resumption.h"
#include "apps/kirokud/room_setup.h"
#include "apps/kirokud/servers.h"
#include "apps/kirokud/successor.h"
#include "apps/kirokud/upgrade_wait.h"
#include "archive/format/pointing_stream.h"
#include "archive/storage/file_system.h"
#include "archive/storage/recording_lock.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "base/process_hardening.h"
#include "recorder/daemon/control_server.h"
#include "recorder/source/boxed_source.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/mllp_address.h"

namespace kiroku::apps {
namespace {

constexpr const char* kServiceHome = "/var/lib/kiroku";
constexpr std::chrono::seconds kTick{1};
constexpr int kDiskTicks = 10;

struct Request {
  std::optional<std::string> home, configuration;
  bool check = false;
};

/// To the journal with its priorities where systemd reads standard error, else to standard error for a
/// person.
void set_up_logging() {
  std::shared_ptr<spdlog::logger> logger;
  if (std::getenv("JOURNAL_STREAM") != nullptr) {
    logger = std::make_shared<spdlog::logger>("kirokud", std::make_shared<spdlog::sinks::systemd_sink_mt>());
  } else {
    logger = std::make_shared<spdlog::logger>("kirokud", std::make_shared<spdlog::sinks::stderr_sink_mt>());
    logger->set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %-8l %v", spdlog::pattern_time_type::utc);
  }
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(logger);
}

/// What a recorder that died left behind comes first. No authority is waited for: until the rooms are there
/// nobody can begin a case.
void recover_first(const WritableHome& shared, const Authorities& authorities,
                   const archive::RecordingLock& lock, recorder::ResumptionPlanner& resumption) {
  RecoveryWishes wishes;
  wishes.carry_on = [&](const archive::CutOffCase& cut) { return resumption.carry_on(cut); };
  wishes.stamp_later = true;
  for (const archive::CaseRecovery& each : recover_home(shared, authorities.named(), lock, wishes)) {
    std::istringstream lines(recovery_text(each));
    for (std::string line; std::getline(lines, line);) spdlog::warn("{}", line);
  }
}

Home home_of(const Request& request) {
  if (request.home) return Home::open(request.home);
  if (std::getenv("KIROKU_HOME") != nullptr) return Home::open({});
  return Home::open(std::string(kServiceHome));
}

struct DaemonSetup {
  Configuration recorder;
  ViewerConfiguration viewer;
  ConsentConfiguration consent;
};

DaemonSetup read_configuration(const std::filesystem::path& file) {
  const Bytes text = read_small_file(file, "the configuration");
  Configuration configuration = parse_configuration(text_of(text), file.string());
  if (configuration.rooms.empty()) {
    throw UsageError(file.string() +
                     " names no [[room]], so that there is nothing to record: see the example in the "
                     "file that `kiroku init` wrote, or deploy/kiroku.toml");
  }
  return {std::move(configuration), parse_viewer_configuration(text_of(text), file.string()),
          parse_consent_configuration(text_of(text), file.string())};
}

/// A disk that cannot be asked is told of; it must not end what is being recorded.
void watch_disk(recorder::Daemon& daemon) {
  try {
    daemon.watch_disk();
  } catch (const std::exception& error) {
    spdlog::warn("{}", printable(error.what()));
  }
}

/// Likewise for the key in hardware.
void watch_hardware(HardwareWatch& hardware, bool recorded) {
  try {
    hardware.look(recorded);
  } catch (const std::exception& error) {
    spdlog::warn("the key in hardware could not be looked at: {}", printable(error.what()));
  }
}

/// Waits for signals and feeds the watchdog; returns the sentence that says why the recorder ends.
std::string watch(recorder::Daemon& daemon, const Inboxes& inboxes, const EndSignals& signals,
                  HardwareWatch& hardware, Successor& successor, UpgradeWait& upgrade,
                  const std::function<void()>& tend_servers) {
  DescriptorWatch descriptors;
  for (int tick = 0;; ++tick) {
    for (const auto& [listen, inbox] : inboxes) inbox->tend();
    tend_servers();
    if (const int signal = signals.wait(kTick); signal != 0)
      return std::string("received ") + ::strsignal(signal);
    if (daemon.healthy()) ::sd_notify(0, "WATCHDOG=1");
    if (tick % kDiskTicks == 0) watch_disk(daemon);
    descriptors.look();
    watch_hardware(hardware, daemon.recording());
    // Last, as a case may have begun since the recorder was asked.
    if (!daemon.recording() && successor.is_there() && upgrade.is_over() && successor.is_ready() &&
        daemon.begin_no_more())
      return "a newer version was installed and nothing is being recorded";
  }
}

/// What a patient consented to binds every program of the home, which read the home's own file.
void require_consent_of_home(const Home& home, const std::filesystem::path& file,
                             const ConsentConfiguration& stated) {
  if (!stated.is_stated || stated.has_rules_of(consent_configuration(home))) return;
  throw UsageError(file.string() + ": [consent] is read from " + home.configuration_file().string() +
                   " alone, where it says something else: put it there");
}

/// Of an address where HL7 messages are waited for: throws kiroku::UsageError where nothing says who may
/// send.
void check_senders(const std::string& source) {
  const auto address = recorder::parse_source_address(source, recorder::Presence::kMayBeAbsent);
  if (address.kind != recorder::SourceKind::kMonitors) return;
  const std::string why = recorder::MllpServer::trust_problem(recorder::mllp_server_options(address));
  static_cast<void>(recorder::mllp_senders(address));
  static_cast<void>(recorder::hl7_places(address));
  if (!why.empty()) throw UsageError(why);
}

/// Says how it ended, with `left` cases that could not be closed; the exit status.
int end_of(int left) {
  if (left > 0) {
    spdlog::error("ended; {} case(s) could not be closed: the next start brings them to their end", left);
    return kRefused;
  }
  spdlog::info("ended; every case is closed");
  return kDone;
}

int run(const Request& request) {
  const Home home = home_of(request);
  const std::filesystem::path file =
      request.configuration ? std::filesystem::path(*request.configuration) : home.configuration_file();
  const DaemonSetup setup = read_configuration(file);
  const Configuration& configuration = setup.recorder;
  require_consent_of_home(home, file, setup.consent);
  RecipientChoice(home, configuration, {}).require_all_files();
  std::vector<std::string> doubts = doubts_of(configuration);
  if (request.check) {
    for (const RoomConfiguration& room : configuration.rooms) {
      RecipientChoice recipients(home, configuration, {});
      for (const StreamConfiguration& stream : room.streams) {
        static_cast<void>(recipients.of(stream.name));
        if (!stream.is_video) check_senders(stream.source);
      }
      if (room.procedure.hl7) check_senders(room.procedure.hl7->listen);
      static_cast<void>(recipients.of(kEventsRecipients));
      static_cast<void>(recipients.of(std::string(archive::kPointingStream)));
    }
    static_cast<void>(hook_token(home, configuration));
    recorder::ControlServer::check(home.control_socket(configuration));
    std::vector<std::string> warnings = doubtful_retention(configuration);
    warnings.insert(warnings.end(), doubts.begin(), doubts.end());
    // It records without a viewer, and beside another log: neither keeps a newer program from taking over.
    warnings.push_back(viewer_certificate_problem(home, setup.viewer));
    std::erase(warnings, "");
    for (const std::string& sentence : warnings)
      print_error("kirokud", "warning: " + file.string() + ": " + sentence);
    if (const std::string why = why_another_log(home); !why.empty())
      print_error("kirokud", "warning: " + why);
    std::cout << printable(file.string()) << ": good, " << configuration.rooms.size() << " room(s)\n";
    return kDone;
  }
  set_up_logging();
  // Before any other thread is there.
  DescriptorStore store([](const std::string& sentence) { spdlog::warn("{}", printable(sentence)); });
  allow_many_descriptors();
  const EndSignals signals;
  const archive::RecordingLock lock =
      archive::RecordingLock::take(archive::real_file_system(), home.archive());
  recorder::DaemonOptions options;
  const auto tell = [&options](const std::string& sentence) {
    options.problems.push_back(sentence);
    spdlog::error("{}", printable(sentence));
  };
  doubts.insert(doubts.end(), configuration.retention.unclear.begin(), configuration.retention.unclear.end());
  for (const std::string& sentence : doubts) {
    options.remarks.push_back(file.string() + ": " + sentence);
    spdlog::warn("{}", printable(options.remarks.back()));
  }
  const TellWithout without = [&tell](const std::string& why) { tell("recording goes on, but " + why); };
  const WritableHome shared(home, without);  // by all rooms
  log_configuration(file, home, *shared.log, tell);

  // Asked before the first source: an upgrade while a case runs then finds the decoder of this version at
  // hand.
  if (const std::string why = recorder::why_unboxed(); !why.empty()) {
    spdlog::error(
        "sources are decoded without a box, beside the device key: {}; cases are recorded all the same",
        printable(why));
  }
  const Authorities authorities(home, configuration, {}, without);
  RoomResumption resumption(home, configuration);
  recover_first(shared, authorities, lock, resumption.planner());
  options.archive = home.archive();
  options.warn_below_hours = configuration.storage.warn_below_hours;
  std::atomic<int> left = 0;
  options.listener = listener_for(home, left);
  // Each room asks over connections of its own: a source of stamps belongs to one thread at a time.
  std::vector<std::unique_ptr<Authorities>> of_rooms;
  const TellWithout told_already = [](const std::string& /*why*/) {};
  Inboxes inboxes;
  std::vector<std::shared_ptr<recorder::ProcedureSource>> procedures;
  LookingOn looking_on;
  // One for all rooms: each note takes a step of the one key.
  const std::shared_ptr<search::NoteWriter> notes = search_notes_of(home, configuration, without);
  for (const RoomConfiguration& room : configuration.rooms) {
    of_rooms.push_back(
        std::make_unique<Authorities>(home, configuration, std::vector<std::string>{}, told_already));
    options.rooms.push_back(plan_of(room, home, configuration, *of_rooms.back(), shared,
                                    setup.viewer.listen.empty() ? nullptr : &looking_on));
    options.rooms.back().session.search = notes;
    options.rooms.back().procedure = procedure_of(room, inboxes, store);
    if (options.rooms.back().procedure) procedures.push_back(options.rooms.back().procedure);
    options.rooms.back().footswitches = room.footswitches;
    std::vector<std::string> pictures;
    for (const recorder::StreamRequest& stream : options.rooms.back().session.video)
      pictures.push_back(stream.name);
    options.rooms.back().profile_rules = profile_rules_for(configuration, room.name, pictures);
    resumption.apply(options.rooms.back());
    if (room.rules.resume_within) options.rooms.back().memory = store.memory_of_room(room.name);
  }
  store.forget_rest();
  HardwareWatch hardware(shared.key.hardware());
  options.hardware_silent = [&hardware] { return hardware.silent(); };
  std::string reason;
  {
    std::unique_ptr<LateStamper> late;
    if (shared.queue) late = std::make_unique<LateStamper>(home, authorities, shared);
    recorder::Daemon daemon(std::move(options));
    const recorder::ControlServer control(
        home.control_socket(configuration),
        [&daemon](const nlohmann::json& asked) { return daemon.handle(asked); });
    const std::unique_ptr<KeptHttp> http = serve_http(home, configuration, daemon);
    shared.log->tell_of_remarks([&daemon](const std::string& sentence) {
      spdlog::error("{}", printable(sentence));
      daemon.add_remark(sentence);
    });
    // Late stamps are entered until the block's end, when the daemon is gone.
    const std::shared_ptr<void> quiet(nullptr, [&shared](void*) { shared.log->tell_of_remarks({}); });
    std::unique_ptr<KeptViewer> viewer =
        serve_viewer(home, configuration, setup.viewer, shared, looking_on, daemon);
    ::sd_notify(0, "READY=1");
    spdlog::info("recording for {} room(s), home {}", configuration.rooms.size(), home.folder().string());
    Successor successor(
        {"--check", "--home", home.folder().string(), "--config", file.string()},
        {.tell = [](const std::string& sentence) { spdlog::error("{}", printable(sentence)); }});
    UpgradeWait upgrade({.is_kept = DescriptorStore::is_there,
                         .is_known =
                             [&procedures] {
                               return std::ranges::any_of(procedures, [](const auto& each) {
                                 return each->knows_by_messages(utc_now());
                               });
                             },
                         .tell =
                             [&daemon](const std::string& sentence) {
                               spdlog::warn("{}", sentence);
                               daemon.add_remark(sentence);
                             }},
                        Clock::system());
    reason = watch(daemon, inboxes, signals, hardware, successor, upgrade, [&] {
      http->tend();
      viewer->tend();
    });
    ::sd_notify(0, "STOPPING=1");
    spdlog::info("ending: {}", reason);
    // Before whoever looks on: a request that hangs must not keep a case from its end.
    daemon.close();
    for (const auto& [listen, inbox] : inboxes) inbox->end();
    if (!ends_in_time(std::move(viewer))) {
      late.reset();
      spdlog::error("a request to the viewer does not come to its end within {} s: it is cut off",
                    kLongestEndOfViewer.count());
      shared.log->shutdown();
      const int status = end_of(left);
      spdlog::shutdown();
      ::_exit(status);
    }
  }
  shared.log->shutdown();
  return end_of(left);
}

}  // namespace
}  // namespace kiroku::apps

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  kiroku::harden_process();
  // Each arena of glibc keeps what the largest case needed of it, and there may be eight for each core.
  constexpr int kMostArenas = 4;
  (void)::mallopt(M_ARENA_MAX, kMostArenas);
  Program program("kirokud", "records operating rooms unattended", "");
  Command& root = program.root();
  const auto request = std::make_shared<Request>();
  root.option("--home", "DIR", request->home, "the recorder's home", "$KIROKU_HOME, else /var/lib/kiroku");
  root.option("--config", "FILE", request->configuration, "the configuration", "kiroku.toml in the home");
  root.flag("--check", request->check, "says whether the configuration is good, and records nothing");
  root.explain(
      "Records the rooms of kiroku.toml, each case sealed and time-stamped, until it is told to end "
      "(SIGTERM): then cases "
      "that run are closed properly. 'kiroku case' starts and stops cases, 'kiroku status' tells how it is.");
  root.example("kirokud --check --config kiroku.toml", "looks for mistakes in a configuration");
  root.example("kirokud --home ~/.local/share/kiroku", "records in the foreground");
  root.on_run([request] { return run(*request); });
  return kiroku::recorder::end_process(program.run(argc, argv));
}
