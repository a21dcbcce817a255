// The parts of kiroku.toml that only an unattended recorder reads: [[room]], [daemon], [storage]. Pure
// functions, thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/configuration/procedure_configuration.h"
#include "recorder/daemon/room.h"
#include "recorder/encoder/video_profile.h"
#include "recorder/procedure/profile_rules.h"

namespace kiroku::apps {

struct Configuration;
class TableReader;

/// One [[room.stream]].
struct StreamConfiguration {
  std::string name;  // [a-z0-9-], unique in its room
  bool is_video = true;
  std::string source;
  std::string purpose;
  recorder::VideoProfile video;  // what is not stated is [recording]'s
  std::string microphone;        // as StreamRequest::microphone
  /// Its pictures are archived in this form too, as the stream recorder::second_name().
  std::optional<recorder::Profile> also;
  /// Whether it, or what archives its pictures a second time, is the stream of pictures of that name.
  [[nodiscard]] bool has_pictures_named(const std::string& stream) const;
};

/// One [[room]].
struct RoomConfiguration {
  std::string name;  // [a-z0-9-]
  std::vector<StreamConfiguration> streams;
  recorder::RoomRules rules;
  ProcedureConfiguration procedure;
  std::vector<recorder::FootswitchOptions> footswitches;
};

/// One [[recording.profile_for]].
struct ProfileForConfiguration {
  recorder::ProfileRule rule;
  std::vector<std::string> rooms;  // none: every room, and `kiroku record`
};

/// The rules for a room ("": for `kiroku record`) that records these streams of pictures; of their streams
/// those that there are.
std::vector<recorder::ProfileRule> profile_rules_for(const Configuration& configuration,
                                                     const std::string& room,
                                                     const std::vector<std::string>& streams);

/// [daemon].
struct DaemonConfiguration {
  std::string socket;          // of the control; empty: control.sock in the home
  std::string listen_address;  // of /metrics and the hook, on this machine alone; empty: no HTTP
  std::uint16_t listen_port = 0;
  std::string hook_token_file;
};

/// [storage].
struct StorageConfiguration {
  double warn_below_hours = 8;
};

/// The recording profile that [recording] states.
recorder::VideoProfile default_video_profile(const Configuration& configuration);

/// Read what `top` holds of them into `into`; [recording] must have been read. Throw kiroku::UsageError with
/// line and column.
void read_rooms(TableReader& top, Configuration& into);
void read_daemon(TableReader& top, Configuration& into);
/// [[recording.profile_for]]; rooms must have been read.
void read_profile_rules(TableReader& top, Configuration& into);

}  // namespace kiroku::apps
