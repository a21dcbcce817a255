// The rooms of one machine, and what can be asked of and said about them. Every function may be called from
// any thread.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "recorder/daemon/room.h"

namespace kiroku::recorder {

struct DaemonOptions {
  std::vector<RoomPlan> rooms;
  std::filesystem::path archive;  // whose disk is watched
  double warn_below_hours = 8;
  RoomListener listener;  // of every room; sentences are given the room's name before them
  /// Why the device's key in hardware does not sign, one sentence; empty where it does, or there is none.
  /// Must not wait for the hardware; called by any thread. May be null.
  std::function<std::string()> hardware_silent;
  /// What the recorder goes on without, each a sentence for people.
  std::vector<std::string> problems;
  /// What a person should know and nothing is missing for, each a sentence: a doubt about the configuration,
  /// or that a newer version waits.
  std::vector<std::string> remarks;
  const Clock* time = &Clock::system();  // by which rooms and footswitches go; outlives the daemon
};

class Daemon {
 public:
  explicit Daemon(DaemonOptions options);
  /// As close().
  ~Daemon();
  /// Closes every case that runs, all rooms at once; none can be begun any more. Everything else can still be
  /// asked, so that whoever looks on need not go first. From one thread.
  void close();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  /// One more of DaemonOptions::problems.
  void add_problem(const std::string& sentence);
  /// One that holds no more.
  void remove_problem(const std::string& sentence);
  /// One more of DaemonOptions::remarks.
  void add_remark(const std::string& sentence);
  /// A request of recorder/daemon/control_server.h and its answer. Throws kiroku::Error for one that cannot
  /// be done.
  nlohmann::ordered_json handle(const nlohmann::json& request);
  /// The same by way of the HTTP hook. `meant`: as Room has it.
  nlohmann::ordered_json hook(const std::string& room, const std::string& action, const std::string& body,
                              const std::string& meant = "");
  /// The case that the room records now; "": none. Throws kiroku::UsageError for a room that is not there.
  [[nodiscard]] std::string running_case(const std::string& room) const;
  /// What the clock of that case shows now; nothing where none runs. Throws as running_case().
  [[nodiscard]] std::optional<std::int64_t> now_ns(const std::string& room) const;
  /// As Room::point(); throws as running_case().
  std::optional<std::int64_t> point(const std::string& room, media::PointedAt at,
                                    const std::string& meant = "");
  /// Prometheus' text format, 0.0.4.
  [[nodiscard]] std::string metrics() const;
  /// Looks at the disk and warns when a new threshold is passed. Call each few seconds.
  void watch_disk();
  /// Whether every room's thread is alive.
  [[nodiscard]] bool healthy() const;
  /// Also between the cases of an operation that the recorder goes on with by itself: it would not after a
  /// restart.
  [[nodiscard]] bool recording() const;
  /// For whoever ends the recorder while nothing is recorded: false where recording() holds in this moment;
  /// else no case begins any more, by a person or by a rule, and whoever asks for one waits until close(),
  /// which refuses it.
  [[nodiscard]] bool begin_no_more();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
