// kirokud: records unattended. Configuration in kiroku.toml; control by `kiroku case` and `kiroku status`.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstring>
#include <future>
#include <initializer_list>
#include <iostream>
#include <malloc.h>
#include <map>
#include <mutex>
#include <poll.h>
#include <sstream>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <systemd/sd-daemon.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include <nlohmann/json.hpp>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/configuration/viewer_configuration.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kiroku/recovering.h"
#include "apps/kiroku/viewer_setup.h"
#include "archive/storage/file_system.h"
#include "archive/storage/recording_lock.h"
#include "archive/writing/appliance_log.h"
#include "base/descriptor_limit.h"
#include "base/error.h"
#include "base/process_hardening.h"
#include "recorder/daemon/control_server.h"
#include "recorder/daemon/daemon.h"
#include "recorder/daemon/http_server.h"
#include "recorder/daemon/resumption.h"
#include "recorder/late_stamping.h"
#include "recorder/procedure/room_procedure.h"
#include "recorder/source/boxed_source.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/mllp_address.h"
#include "viewer/live/live_monitors.h"
#include "viewer/live/live_pictures.h"
#include "viewer/viewer.h"

namespace kiroku::apps {
namespace {

constexpr const char* kServiceHome = "/var/lib/kiroku";
constexpr std::chrono::seconds kTick{1};
constexpr int kDiskTicks = 10;
constexpr std::chrono::seconds kLateStampInterval{15};
constexpr std::chrono::seconds kLongestEndOfViewer{20};
constexpr int kNiceOfOthers = 10;  // nice(2); on Linux each thread has its own

/// What `make` makes; its threads inherit the priority of the one that makes it. Whoever watches or asks by a
/// network, recording goes first.
template <typename Make>
auto behind_the_recording(const Make& make) {
  return std::async(std::launch::async,
                    [&make] {
                      (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceOfOthers);
                      return make();
                    })
      .get();
}

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

/// What a recorder that died left behind comes first. Where a room may go on with it, no authority is waited
/// for.
void recover_first(const WritableHome& shared, const Authorities& authorities,
                   const archive::RecordingLock& lock, recorder::ResumptionPlanner& resumption) {
  RecoveryWishes wishes;
  wishes.carry_on = [&](const archive::CutOffCase& cut) { return resumption.carry_on(cut); };
  wishes.stamp_later = resumption.may_resume();
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
};

DaemonSetup read_configuration(const std::filesystem::path& file) {
  const Bytes text = read_small_file(file, "the configuration");
  Configuration configuration = parse_configuration(text_of(text), file.string());
  if (configuration.rooms.empty()) {
    throw UsageError(file.string() +
                     " names no [[room]], so that there is nothing to record: see the example in the "
                     "file that `kiroku init` wrote, or deploy/kiroku.toml");
  }
  return {std::move(configuration), parse_viewer_configuration(text_of(text), file.string())};
}

/// What is shown of rooms while they record.
struct LookingOn {
  live::Channels channels;
  live::LiveMonitors monitors;
};

/// `looking_on` is given the room's pictures and vital signs; null: nobody looks on.
recorder::RoomPlan plan_of(const RoomConfiguration& room, const Home& home,
                           const Configuration& configuration, const Authorities& authorities,
                           const WritableHome& shared, LookingOn* looking_on) {
  recorder::RoomPlan plan;
  plan.name = room.name;
  plan.rules = room.rules;
  RecipientChoice recipients(home, configuration, {});
  for (const StreamConfiguration& stream : room.streams) {
    recorder::StreamRequest asked{
        stream.name, stream.source, stream.purpose, stream.video, recipients.of(stream.name), true};
    const auto tell = [name = room.name](const std::string& sentence) {
      spdlog::error("room {}: {}", name, printable(sentence));
    };
    asked.guard = guard_for(configuration, tell);
    asked.microphone = stream.microphone;
    asked.microphone_guard = guard_for(configuration, tell);
    if (!stream.is_video && looking_on != nullptr) {
      asked.vitals_tap = std::make_shared<recorder::VitalsTap>();
      looking_on->monitors.add(room.name, stream.name, asked.vitals_tap);
    }
    if (stream.is_video && looking_on != nullptr) {
      asked.tap = std::make_shared<recorder::PictureTap>();
      looking_on->channels[{room.name, stream.name}] = std::make_unique<live::LiveChannel>(
          asked.tap, [](const std::string& sentence) { spdlog::warn("{}", printable(sentence)); });
    }
    auto& requests = stream.is_video ? plan.session.video : plan.session.vitals;
    requests.push_back(std::move(asked));
    if (stream.also) {
      recorder::StreamRequest second = recorder::second_of(requests.back(), *stream.also);
      requests.push_back(std::move(second));
    }
  }
  plan.session.archive = home.archive();
  plan.session.device_name = home.device().name();
  plan.session.event_recipients = recipients.usual();
  plan.session.pointing = looking_on != nullptr;
  plan.session.segment_duration = configuration.segment;
  plan.session.stamp_interval = configuration.stamp_every;
  plan.session.authorities = authorities.named();
  plan.session.key = &shared.key;
  plan.session.trust = &shared.trust;
  plan.session.log = shared.log.get();
  plan.session.queue = shared.queue.get();
  return plan;
}

/// Where hospital systems deliver messages of patients, by address: rooms that name the same one share it.
using Inboxes = std::map<std::string, std::shared_ptr<recorder::ProcedureInbox>>;

/// Where the room learns about procedures; null where nothing is configured.
std::shared_ptr<recorder::ProcedureSource> procedure_of(const RoomConfiguration& room, Inboxes& inboxes) {
  if (room.procedure.empty()) return {};
  std::shared_ptr<recorder::ProcedureInbox> inbox;
  recorder::ProcedureRule rule;
  if (room.procedure.hl7) {
    rule = room.procedure.hl7->rule;
    std::shared_ptr<recorder::ProcedureInbox>& shared = inboxes[room.procedure.hl7->listen];
    if (!shared) {
      shared = std::make_shared<recorder::ProcedureInbox>(
          room.procedure.hl7->listen,
          [](const std::string& sentence) { spdlog::warn("{}", printable(sentence)); });
    }
    inbox = shared;
  }
  std::unique_ptr<recorder::Worklist> worklist;
  if (room.procedure.worklist) {
    worklist = std::make_unique<recorder::Worklist>(*room.procedure.worklist,
                                                    [name = room.name](const std::string& sentence) {
                                                      spdlog::warn("room {}: {}", name, printable(sentence));
                                                    });
  }
  return std::make_shared<recorder::RoomProcedure>(std::move(inbox), std::move(rule), std::move(worklist));
}

/// Of a case that has changed. A catalogue that cannot be written is no fault of the case.
void tell_catalogue(const Home& home, const std::filesystem::path& folder) {
  try {
    refresh_catalogue(home, folder);
  } catch (const std::exception& error) {
    spdlog::warn("the catalogue does not know case {} yet: {}", folder.filename().string(),
                 printable(error.what()));
  }
}

/// Rooms whose cases are carried on after a crash, and why one is not.
class RoomResumption {
 public:
  RoomResumption(const Home& home, const Configuration& configuration)
      : planner_(context(home), rules(home, configuration)) {}

  recorder::ResumptionPlanner& planner() { return planner_; }
  void apply(recorder::RoomPlan& plan) {
    if (const auto note = notes_.find(plan.name); note != notes_.end()) plan.running = note->second;
    plan.resume = planner_.of(plan.name);
    plan.not_resumed = why_not_[plan.name];
  }

 private:
  recorder::ResumptionPlanner::Context context(const Home& home) {
    recorder::ResumptionPlanner::Context context;
    context.archive = home.archive();
    context.boot_id = archive::kernel_boot_id();
    context.tell = [this](const std::string& room, const std::string& sentence) {
      why_not_[room] = sentence;
      spdlog::error("room {}: {}", room, printable(sentence));
    };
    return context;
  }
  std::vector<recorder::ResumeRule> rules(const Home& home, const Configuration& configuration) {
    std::vector<recorder::ResumeRule> rules;
    for (const RoomConfiguration& room : configuration.rooms) {
      if (!room.rules.resume_within) continue;
      const auto note =
          std::make_shared<recorder::RunningNote>(archive::real_file_system(), home.archive(), room.name);
      notes_[room.name] = note;
      rules.push_back({room.name, *room.rules.resume_within, room.rules.longest_case, note});
    }
    return rules;
  }

  std::map<std::string, std::shared_ptr<recorder::RunningNote>> notes_;
  std::map<std::string, std::string> why_not_;
  recorder::ResumptionPlanner planner_;
};

/// `left` counts the cases that could not be closed.
recorder::RoomListener listener_for(const Home& home, std::atomic<int>& left) {
  recorder::RoomListener listener;
  listener.note = [](const std::string& sentence) { spdlog::info("{}", printable(sentence)); };
  listener.warn = [](const std::string& sentence) { spdlog::warn("{}", printable(sentence)); };
  listener.closed = [&home](const recorder::SessionResult& result) { tell_catalogue(home, result.folder); };
  listener.left = [&left](const std::string& sentence) {
    ++left;
    spdlog::error("{}", printable(sentence));
  };
  return listener;
}

std::unique_ptr<recorder::HttpServer> serve_http(const Home& home, const Configuration& configuration,
                                                 recorder::Daemon& daemon) {
  if (configuration.daemon.listen_address.empty()) return {};
  recorder::HttpServerOptions options;
  options.address = configuration.daemon.listen_address;
  options.port = configuration.daemon.listen_port;
  if (!configuration.daemon.hook_token_file.empty()) {
    const std::filesystem::path file = home.folder() / configuration.daemon.hook_token_file;
    const Bytes token = read_small_file(file, "the hook's token");
    if (is_open_to_others(file)) {
      spdlog::warn("the hook's token can be read by others than its owner: chmod 600 {}, and take another",
                   printable(file.string()));
    }
    options.token = std::string(text_of(token));
    options.token.erase(options.token.find_last_not_of(" \r\n") + 1);
    if (options.token.size() < 16) throw UsageError("the hook's token must have at least 16 characters");
  }
  options.tell = [](const std::string& sentence) { spdlog::warn("{}", printable(sentence)); };
  options.metrics = [&daemon] { return daemon.metrics(); };
  options.hook = [&daemon](const std::string& room, const std::string& action, const std::string& body) {
    return daemon.hook(room, action, body);
  };
  return behind_the_recording(
      [&options] { return std::make_unique<recorder::HttpServer>(std::move(options)); });
}

/// A connection to planning or training takes two descriptors.
viewer::WebServerLimits limits_of_viewer() {
  viewer::WebServerLimits limits;
  constexpr std::uint64_t kFewest = 32;
  const std::uint64_t part = std::max(kFewest, count_descriptors().may / 4);
  limits.connections = std::min<std::size_t>(limits.connections, part);
  limits.connections_of_address = std::min<std::size_t>(limits.connections_of_address, part / 2);
  return limits;
}

std::unique_ptr<viewer::Viewer> open_viewer(const Home& home, const Configuration& configuration,
                                            const ViewerConfiguration& asked, const WritableHome& shared,
                                            LookingOn& looking_on, recorder::Daemon& daemon) {
  std::optional<std::string> certificate, key;
  if (!asked.certificate.empty()) {
    certificate = (home.folder() / asked.certificate).string();
    key = (home.folder() / asked.key).string();
  }
  viewer::ServerCertificate own = viewer_certificate(home, asked.listen, certificate, key);
  viewer::ViewerOptions options{
      .home = viewer_home(home, configuration, shared.key, shared.trust, shared_identities({}, home)),
      .web = {.listen = asked.listen,
              .certificate_pem = std::move(own.certificate_pem),
              .key_pem = std::move(own.key_pem),
              .limits = limits_of_viewer()},
      .sessions = {},
      .page = find_page(),
      .tell = [](const std::string& sentence) { spdlog::warn("viewer: {}", printable(sentence)); }};
  options.home.live = live::live_pictures(looking_on.channels);
  options.home.vitals = [&looking_on](const std::string& room, std::int64_t after_ns) {
    return looking_on.monitors.now(room, after_ns);
  };
  options.home.rooms = {
      .running_case = [&daemon](const std::string& room) { return daemon.running_case(room); },
      .now_ns = [&daemon](const std::string& room) { return daemon.now_ns(room); },
      .point = [&daemon](const std::string& room,
                         media::PointedAt at) { return daemon.point(room, std::move(at)); }};
  auto server =
      behind_the_recording([&options] { return std::make_unique<viewer::Viewer>(std::move(options)); });
  spdlog::info("the viewer is at {}", server->url());
  return server;
}

/// The viewer with live pictures; null where none is configured or it cannot be served: that ends no
/// recorder.
std::unique_ptr<viewer::Viewer> serve_viewer(const Home& home, const Configuration& configuration,
                                             const ViewerConfiguration& asked, const WritableHome& shared,
                                             LookingOn& looking_on, recorder::Daemon& daemon) {
  if (asked.listen.empty()) return {};
  try {
    return open_viewer(home, configuration, asked, shared, looking_on, daemon);
  } catch (const std::exception& error) {
    spdlog::error("recording goes on without the viewer: {}", printable(error.what()));
    return {};
  }
}

/// False, with all of it left behind, where a request does not come to its end: the process must end without
/// destroying what it may still use.
bool ends_in_time(std::unique_ptr<viewer::Viewer> viewer) {
  std::promise<void> ended;
  std::future<void> end = ended.get_future();
  std::thread ending([viewer = std::move(viewer), ended = std::move(ended)]() mutable {
    viewer.reset();
    ended.set_value();
  });
  if (end.wait_for(kLongestEndOfViewer) == std::future_status::ready) {
    ending.join();
    return true;
  }
  ending.detach();
  return false;
}

/// Works off the stamping queue, for cases that were closed while no authority answered, until it is
/// destroyed.
class LateStamper {
 public:
  LateStamper(const Home& home, const Authorities& authorities, const WritableHome& shared)
      : home_(home),
        stamping_(authorities.named(), {nullptr, home.archive(), &shared.key, home.device().name(),
                                        shared.log.get(), &shared.trust, shared.queue.get()}),
        thread_([this] { run(); }) {}
  ~LateStamper() {
    {
      const std::lock_guard guard(mutex_);
      ending_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  LateStamper(const LateStamper&) = delete;
  LateStamper& operator=(const LateStamper&) = delete;

 private:
  void run() {
    std::unique_lock lock(mutex_);
    while (!changed_.wait_for(lock, kLateStampInterval, [this] { return ending_; })) {
      lock.unlock();
      try {
        for (const auto& each : stamping_.work_off(recorder::LateStamping::Patience::kAllPauses).stamped) {
          spdlog::info("case {} is stamped by {} now", each.case_id, each.authority);
          tell_catalogue(home_, home_.archive() / each.case_id);
        }
      } catch (const std::exception& error) {
        spdlog::warn("time-stamps that did not come cannot be asked for now: {}", printable(error.what()));
      }
      lock.lock();
    }
  }

  const Home& home_;
  recorder::LateStamping stamping_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool ending_ = false;
  std::thread thread_;
};

/// Whether the program's file was replaced by a newer one: a package was upgraded.
bool was_replaced() {
  std::error_code ignored;
  return std::filesystem::read_symlink("/proc/self/exe", ignored).string().ends_with(" (deleted)");
}

/// Tells when descriptors become few, and when they are no longer.
class DescriptorWatch {
 public:
  void look() {
    const DescriptorCount count = count_descriptors();
    const std::uint64_t kept = descriptors_kept_back(count.may);
    // What is told once is over when there are clearly more again.
    const bool few = count.are + (are_few_ ? 2 * kept : kept + kept / 4) >= count.may;
    if (few == are_few_) return;
    are_few_ = few;
    if (few) {
      spdlog::warn(
          "{} of {} files and connections are open: recording goes on, and further connections to the viewer "
          "and the hook are refused; raise the hard limit (LimitNOFILE= of the unit, `ulimit -Hn`)",
          count.are, count.may);
    } else {
      spdlog::info("{} of {} files and connections are open: connections are taken again", count.are,
                   count.may);
    }
  }

 private:
  bool are_few_ = false;
};

/// A disk that cannot be asked is told of; it must not end what is being recorded.
void watch_disk(recorder::Daemon& daemon) {
  try {
    daemon.watch_disk();
  } catch (const std::exception& error) {
    spdlog::warn("{}", printable(error.what()));
  }
}

/// SIGINT, SIGTERM and SIGHUP, as a descriptor that becomes readable. They are blocked in every thread that
/// is started from now on, so that they interrupt nothing there. A signalfd would not do: libraries start
/// threads before main() (OpenBLAS, which FFmpeg's filters stand on), and a signal that one of those takes
/// would end the process.
class EndSignals {
 public:
  EndSignals() {
    descriptor_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (descriptor_ < 0) throw Error("signals cannot be received");
    struct sigaction end {};
    end.sa_handler = [](int signal) {
      number_ = signal;
      constexpr std::uint64_t kOne = 1;
      (void)!::write(descriptor_, &kOne, sizeof kOne);
    };
    end.sa_flags = SA_RESTART;
    sigset_t wanted;
    ::sigemptyset(&wanted);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
      ::sigaddset(&wanted, signal);
      ::sigaction(signal, &end, nullptr);
    }
    ::pthread_sigmask(SIG_BLOCK, &wanted, &before_);
    ::signal(SIGPIPE, SIG_IGN);
  }

  /// The signal that came within `limit`, 0 if none did. Called by the thread that made the object.
  [[nodiscard]] int wait(std::chrono::seconds limit) const {
    pollfd waiting{descriptor_, POLLIN, 0};
    const timespec time{limit.count(), 0};
    ::ppoll(&waiting, 1, &time, &before_);
    return number_;
  }

 private:
  // The handler's.
  static inline std::atomic<int> number_ = 0;
  static inline std::atomic<int> descriptor_ = -1;
  sigset_t before_{};
};

/// Waits for signals and feeds the watchdog; returns the sentence that says why the recorder ends.
std::string watch(recorder::Daemon& daemon, const Inboxes& inboxes, const EndSignals& signals) {
  DescriptorWatch descriptors;
  for (int tick = 0;; ++tick) {
    for (const auto& [listen, inbox] : inboxes) inbox->tend();
    if (const int signal = signals.wait(kTick); signal != 0)
      return std::string("received ") + ::strsignal(signal);
    if (daemon.healthy()) ::sd_notify(0, "WATCHDOG=1");
    if (tick % kDiskTicks == 0) watch_disk(daemon);
    descriptors.look();
    if (!daemon.recording() && was_replaced())
      return "a newer version was installed and nothing is being recorded";
  }
}

/// Of an address where HL7 messages are waited for: throws kiroku::UsageError where nothing says who may
/// send.
void check_senders(const std::string& source) {
  const auto address = recorder::parse_source_address(source, recorder::Presence::kMayBeAbsent);
  if (address.kind != recorder::SourceKind::kMonitors) return;
  const std::string why = recorder::MllpServer::trust_problem(recorder::mllp_server_options(address));
  static_cast<void>(recorder::mllp_senders(address));
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

/// Started by hand it has a shell's limit, which the viewer's connections alone reach.
void allow_many_descriptors() {
  constexpr std::uint64_t kEnough = 4096;
  if (const std::uint64_t may = raise_descriptor_limit(); may < kEnough)
    spdlog::warn(
        "only {} files and connections may be open at once: sources, segments and the viewer's guests "
        "share them; raise the hard limit to {} or more (LimitNOFILE= of the unit, `ulimit -Hn`)",
        may, kEnough);
}

int run(const Request& request) {
  const Home home = home_of(request);
  const std::filesystem::path file =
      request.configuration ? std::filesystem::path(*request.configuration) : home.configuration_file();
  const DaemonSetup setup = read_configuration(file);
  const Configuration& configuration = setup.recorder;
  if (request.check) {
    for (const RoomConfiguration& room : configuration.rooms) {
      RecipientChoice recipients(home, configuration, {});
      for (const StreamConfiguration& stream : room.streams) {
        static_cast<void>(recipients.of(stream.name));
        if (!stream.is_video) check_senders(stream.source);
      }
      if (room.procedure.hl7) check_senders(room.procedure.hl7->listen);
    }
    std::cout << printable(file.string()) << ": good, " << configuration.rooms.size() << " room(s)\n";
    return kDone;
  }
  set_up_logging();
  allow_many_descriptors();
  const EndSignals signals;
  const archive::RecordingLock lock =
      archive::RecordingLock::take(archive::real_file_system(), home.archive());
  const WritableHome shared(home);  // by all rooms
  log_configuration(file, home, *shared.log);

  // Asked before the first source: an upgrade while a case runs then finds the decoder of this version at
  // hand.
  if (const std::string why = recorder::why_unboxed(); !why.empty()) {
    spdlog::error(
        "sources are decoded without a box, beside the device key: {}; cases are recorded all the same",
        printable(why));
  }
  const Authorities authorities(home, configuration, {});
  RoomResumption resumption(home, configuration);
  recover_first(shared, authorities, lock, resumption.planner());
  recorder::DaemonOptions options;
  options.archive = home.archive();
  options.warn_below_hours = configuration.storage.warn_below_hours;
  std::atomic<int> left = 0;
  options.listener = listener_for(home, left);
  // Each room asks over connections of its own: a source of stamps belongs to one thread at a time.
  std::vector<std::unique_ptr<Authorities>> of_rooms;
  Inboxes inboxes;
  LookingOn looking_on;
  for (const RoomConfiguration& room : configuration.rooms) {
    of_rooms.push_back(std::make_unique<Authorities>(home, configuration, std::vector<std::string>{}));
    options.rooms.push_back(plan_of(room, home, configuration, *of_rooms.back(), shared,
                                    setup.viewer.listen.empty() ? nullptr : &looking_on));
    options.rooms.back().procedure = procedure_of(room, inboxes);
    options.rooms.back().footswitches = room.footswitches;
    std::vector<std::string> pictures;
    for (const recorder::StreamRequest& stream : options.rooms.back().session.video)
      pictures.push_back(stream.name);
    options.rooms.back().profile_rules = profile_rules_for(configuration, room.name, pictures);
    resumption.apply(options.rooms.back());
  }
  std::string reason;
  {
    std::unique_ptr<LateStamper> late;
    if (shared.queue) late = std::make_unique<LateStamper>(home, authorities, shared);
    recorder::Daemon daemon(std::move(options));
    const recorder::ControlServer control(
        home.control_socket(configuration),
        [&daemon](const nlohmann::json& asked) { return daemon.handle(asked); });
    const std::unique_ptr<recorder::HttpServer> http = serve_http(home, configuration, daemon);
    std::unique_ptr<viewer::Viewer> viewer =
        serve_viewer(home, configuration, setup.viewer, shared, looking_on, daemon);
    ::sd_notify(0, "READY=1");
    spdlog::info("recording for {} room(s), home {}", configuration.rooms.size(), home.folder().string());
    reason = watch(daemon, inboxes, signals);
    ::sd_notify(0, "STOPPING=1");
    spdlog::info("ending: {}", reason);
    // Before whoever looks on: a request that hangs must not keep a case from its end.
    daemon.close();
    if (viewer && !ends_in_time(std::move(viewer))) {
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
