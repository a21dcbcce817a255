#include "apps/configuration/room_configuration.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <linux/input-event-codes.h>

#include "apps/common/format.h"
#include "apps/configuration/configuration.h"
#include "apps/configuration/room_overlap.h"
#include "apps/configuration/table_reader.h"
#include "archive/format/case_layout.h"
#include "archive/format/pointing_stream.h"
#include "recorder/session.h"
#include "recorder/session_request.h"
#include "recorder/source/source_address.h"

namespace kiroku::apps {
namespace {

/// Once all the rest is read.
void check_also(const StreamConfiguration& stream, TableReader& reader) {
  const auto refuse = [&](const std::string& why) { reader.refuse(reader.find("also")->source(), why); };
  if (!stream.is_video) refuse("'also' is for streams of kind video");
  if (*stream.also == stream.video.profile)
    refuse("'also' is '" + std::string(recorder::profile_name(*stream.also)) +
           "', as which these pictures are archived already");
  if (const std::string name = recorder::second_name(stream.name, *stream.also);
      !archive::is_short_name(name))
    refuse("with 'also' there would be a stream named '" + name + "': a name has at most 32 characters");
}

StreamConfiguration read_stream(const toml::table& table, const TableReader& in,
                                const Configuration& defaults) {
  StreamConfiguration stream;
  stream.video = default_video_profile(defaults);
  TableReader reader(table, "[[room.stream]]", in.file());
  reader.text("name", [&](const std::string& text) {
    require_short_name(text);
    if (text == "events") throw UsageError("'name' is 'events': that stream holds the operator's marks");
    if (text == archive::kPointingStream)
      throw UsageError("'name' is 'pointing': that stream holds where people point on live pictures");
    if (text == "published")
      throw UsageError(
          "'name' is 'published': a store may let anybody read what lies below a folder of that name; give "
          "the stream another one");
    stream.name = text;
  });
  reader.text("kind", [&](const std::string& text) {
    if (text != "video" && text != "vitals")
      throw UsageError("'kind' is '" + text + "': it must be video or vitals");
    stream.is_video = text == "video";
  });
  reader.text("source", [&](const std::string& text) {
    if (recorder::parse_source_address(text, recorder::Presence::kNotLookedAt).unpaced()) {
      throw UsageError("'source' is '" + text +
                       "': a room is recorded at the pace of its clock, without speed=max");
    }
    if (recorder::parse_source_address(text, recorder::Presence::kNotLookedAt).kind ==
        recorder::SourceKind::kSound) {
      throw UsageError("'source' is '" + text +
                       "', which has no pictures: write it as 'microphone' of a stream that has");
    }
    stream.source = text;
  });
  stream.purpose = stream.name;
  reader.text("purpose", [&](const std::string& text) { stream.purpose = text; });
  reader.text("profile", [&](const std::string& text) {
    require_profile(text);
    stream.video.profile = *recorder::parse_profile(text);
  });
  reader.text("also", [&](const std::string& text) {
    require_profile(text, "also");
    stream.also = recorder::parse_profile(text);
  });
  reader.text("bit_rate",
              [&](const std::string& text) { stream.video.bit_rate = parse_bit_rate(text, "'bit_rate'"); });
  reader.text("chroma",
              [&](const std::string& text) { stream.video.chroma_422 = parse_chroma(text, "'chroma'"); });
  reader.flag("deinterlace", stream.video.deinterlace);
  reader.flag("audio", stream.video.audio);
  reader.text("microphone", [&](const std::string& text) {
    if (recorder::parse_source_address(text, recorder::Presence::kNotLookedAt).kind !=
        recorder::SourceKind::kSound) {
      throw UsageError("'microphone' is '" + text + "': write alsa:hw:1,0 as 'kiroku devices' lists it");
    }
    stream.microphone = text;
  });
  reader.refuse_unknown_keys();
  if (stream.name.empty()) reader.refuse(table.source(), "a [[room.stream]] needs a 'name'");
  if (stream.source.empty()) reader.refuse(table.source(), "a [[room.stream]] needs a 'source'");
  if (stream.is_video &&
      recorder::parse_source_address(stream.source, recorder::Presence::kNotLookedAt).kind ==
          recorder::SourceKind::kMonitors) {
    reader.refuse(reader.find("source")->source(),
                  "'source' is '" + stream.source + "', where monitors deliver: write kind = \"vitals\"");
  }
  if (stream.also) check_also(stream, reader);
  if (!stream.is_video && !stream.microphone.empty()) {
    reader.refuse(reader.find("microphone")->source(), "'microphone' is for streams of kind video");
  }
  return stream;
}

std::vector<std::string> not_empty(const std::vector<std::string>& texts, const std::string& key) {
  if (texts.empty() || std::ranges::any_of(texts, [](const std::string& text) { return text.empty(); }))
    throw UsageError("'" + key + "' must hold texts that are not empty");
  return texts;
}

recorder::FootswitchOptions read_footswitch(const toml::table& table, const TableReader& in) {
  recorder::FootswitchOptions footswitch;
  TableReader reader(table, "[[room.footswitch]]", in.file());
  reader.text("device", [&](const std::string& text) {
    if (!text.starts_with('/') && !(text.starts_with("name:") && text.size() > 5)) {
      throw UsageError("'device' is '" + text + "': write a path below /dev/input, or name:NAME");
    }
    footswitch.device = text;
  });
  std::int64_t key = 0;
  reader.integer("key", 1, KEY_MAX, key);
  footswitch.key = static_cast<std::uint16_t>(key);
  bool stated = false;
  reader.text("press", [&](const std::string& text) {
    using recorder::PressAction;
    for (const PressAction action : {PressAction::kStart, PressAction::kStop, PressAction::kStartStop,
                                     PressAction::kMark, PressAction::kProfile}) {
      if (text != recorder::press_action_name(action)) continue;
      footswitch.action = action;
      stated = true;
    }
    if (!stated)
      throw UsageError("'press' is '" + text + "': it must be start, stop, start-stop, mark or profile");
  });
  bool to_profile = false;
  reader.text("profile", [&](const std::string& text) {
    require_profile(text);
    footswitch.profile = *recorder::parse_profile(text);
    to_profile = true;
  });
  reader.texts("streams", [&](const std::vector<std::string>& texts) {
    footswitch.streams = not_empty(texts, "streams");
  });
  reader.text("mark", [&](const std::string& text) {
    if (text.empty()) throw UsageError("'mark' is empty: say what a press marks");
    footswitch.mark = text;
  });
  reader.refuse_unknown_keys();
  if (footswitch.device.empty() || footswitch.key == 0 || !stated) {
    reader.refuse(table.source(), "a [[room.footswitch]] needs a 'device', a 'key' and what a 'press' does");
  }
  if (to_profile != (footswitch.action == recorder::PressAction::kProfile)) {
    reader.refuse(table.source(),
                  "a [[room.footswitch]] has a 'profile' where its press is \"profile\", and only there");
  }
  return footswitch;
}

void require_signal(const RoomConfiguration& room, TableReader& reader) {
  const toml::node* node = reader.find("start_on_signal");
  const std::string& wanted = room.rules.start_on_signal;
  if (std::none_of(room.streams.begin(), room.streams.end(),
                   [&](const auto& stream) { return stream.name == wanted; })) {
    reader.refuse(node->source(), "'start_on_signal' is '" + wanted + "', which is no stream of this room");
  }
  if (room.rules.pre_roll < room.rules.signal_lasts) {
    reader.refuse(node->source(),
                  "'start_on_signal' needs a 'pre_roll' that is not shorter than 'signal_lasts', or the "
                  "beginning would be lost");
  }
}

void read_resumption(TableReader& reader, recorder::RoomRules& rules) {
  constexpr std::chrono::minutes kUsual{10};
  constexpr std::chrono::seconds kLeast{10};
  constexpr std::chrono::hours kMost{12};
  bool resume = false;
  std::optional<std::chrono::nanoseconds> within;
  reader.flag("resume", resume);
  reader.text("resume_within", [&](const std::string& text) {
    within = parse_stated_duration(text, "'resume_within'");
    if (*within < kLeast || *within > kMost)
      throw UsageError("'resume_within' is '" + text + "': it must be between 10s and 12h");
  });
  if (within && !resume) {
    reader.refuse(reader.find("resume_within")->source(),
                  "'resume_within' has no effect without 'resume = true'");
  }
  if (resume) rules.resume_within = within.value_or(kUsual);
}

/// Its own, and that of what archives its pictures a second time.
std::vector<std::string> names_of(const StreamConfiguration& stream) {
  std::vector<std::string> names{stream.name};
  if (stream.also) names.push_back(recorder::second_name(stream.name, *stream.also));
  return names;
}

RoomConfiguration read_room(const toml::table& table, const TableReader& top, const Configuration& defaults) {
  RoomConfiguration room;
  TableReader reader(table, "[[room]]", top.file());
  reader.text("name", [&](const std::string& text) {
    require_short_name(text);
    room.name = text;
  });
  reader.texts("schedule", [&](const std::vector<std::string>& windows) {
    room.rules.schedule = recorder::Schedule::parse(windows);
  });
  reader.text("stop_after_silence", [&](const std::string& text) {
    room.rules.stop_after_silence = parse_stated_duration(text, "'stop_after_silence'");
  });
  reader.text("longest_case", [&](const std::string& text) {
    room.rules.longest_case = parse_stated_duration(text, "'longest_case'");
  });
  reader.text("pre_roll", [&](const std::string& text) {
    room.rules.pre_roll = parse_stated_duration(text, "'pre_roll'");
    if (room.rules.pre_roll > std::chrono::hours(1))
      throw UsageError("'pre_roll' is '" + text + "': at most 1h");
  });
  if (room.rules.pre_roll >= room.rules.longest_case) {
    const toml::node* node = reader.find("pre_roll");
    if (node == nullptr) node = reader.find("longest_case");
    reader.refuse(node->source(),
                  "'pre_roll' is not shorter than 'longest_case': each case would end as it begins");
  }
  reader.text("start_on_signal", [&](const std::string& text) { room.rules.start_on_signal = text; });
  reader.text("signal_lasts", [&](const std::string& text) {
    room.rules.signal_lasts = parse_stated_duration(text, "'signal_lasts'");
  });
  read_resumption(reader, room.rules);
  room.procedure = read_procedure(reader);
  for_each_table(reader, "footswitch", [&](const toml::table& entry) {
    room.footswitches.push_back(read_footswitch(entry, reader));
  });
  for_each_table(reader, "stream", [&](const toml::table& entry) {
    StreamConfiguration stream = read_stream(entry, reader, defaults);
    for (const StreamConfiguration& other : room.streams) {
      for (const std::string& name : names_of(stream)) {
        if (std::ranges::count(names_of(other), name) > 0)
          reader.refuse(entry.source(), "there are two streams named '" + name + "' in this room");
      }
    }
    room.streams.push_back(std::move(stream));
  });
  for (const recorder::FootswitchOptions& footswitch : room.footswitches) {
    for (const std::string& name : footswitch.streams) {
      const bool known = std::ranges::any_of(
          room.streams, [&](const auto& stream) { return stream.has_pictures_named(name); });
      if (!known)
        reader.refuse(table.source(),
                      "a footswitch names the stream '" + name + "', which is no video stream of this room");
    }
  }
  reader.refuse_unknown_keys();
  if (room.name.empty()) reader.refuse(table.source(), "a [[room]] needs a 'name'");
  if (!room.rules.start_on_signal.empty()) require_signal(room, reader);
  if (room.streams.empty()) reader.refuse(table.source(), "a [[room]] needs at least one [[room.stream]]");
  return room;
}

/// Whether a room that the rule is for records pictures as such a stream; where no room is configured, nobody
/// knows.
bool may_be_recorded(const ProfileForConfiguration& rule, const std::string& stream,
                     const Configuration& configuration) {
  const auto is_it = [&](const StreamConfiguration& one) { return one.has_pictures_named(stream); };
  return configuration.rooms.empty() ||
         std::ranges::any_of(configuration.rooms, [&](const RoomConfiguration& room) {
           const bool meant =
               rule.rooms.empty() || std::ranges::find(rule.rooms, room.name) != rule.rooms.end();
           return meant && std::ranges::any_of(room.streams, is_it);
         });
}

ProfileForConfiguration read_profile_rule(const toml::table& table, const TableReader& in,
                                          const Configuration& configuration) {
  ProfileForConfiguration read;
  recorder::ProfileRule& rule = read.rule;
  TableReader reader(table, "[[recording.profile_for]]", in.file());
  reader.text("name", [&](const std::string& text) {
    require_short_name(text);
    rule.name = text;
  });
  reader.texts("words",
               [&](const std::vector<std::string>& texts) { rule.words = not_empty(texts, "words"); });
  reader.texts("codes",
               [&](const std::vector<std::string>& texts) { rule.codes = not_empty(texts, "codes"); });
  bool stated = false;
  reader.text("profile", [&](const std::string& text) {
    require_profile(text);
    rule.profile = *recorder::parse_profile(text);
    stated = true;
  });
  reader.texts("rooms", [&](const std::vector<std::string>& texts) {
    read.rooms = not_empty(texts, "rooms");
    for (const std::string& name : read.rooms) {
      const bool known =
          std::ranges::any_of(configuration.rooms, [&](const auto& room) { return room.name == name; });
      if (!known) throw UsageError("'rooms' names '" + name + "', and there is no [[room]] of that name");
    }
  });
  reader.texts("streams", [&](const std::vector<std::string>& texts) {
    rule.streams = not_empty(texts, "streams");
    for (const std::string& name : rule.streams) {
      if (!may_be_recorded(read, name, configuration))
        throw UsageError("'streams' names '" + name + "', which is no video stream of these rooms");
    }
  });
  reader.refuse_unknown_keys();
  if (rule.name.empty()) reader.refuse(table.source(), "a [[recording.profile_for]] needs a 'name'");
  if (!stated) reader.refuse(table.source(), "a [[recording.profile_for]] needs a 'profile'");
  if (rule.words.empty() && rule.codes.empty()) {
    reader.refuse(table.source(),
                  "a [[recording.profile_for]] needs 'words' or 'codes': of which procedures it is");
  }
  return read;
}

/// Without sign-in nobody but this machine's own programs may come.
void read_listen(const std::string& text, DaemonConfiguration& into) {
  const std::size_t colon = text.rfind(':');
  const std::string port = colon == std::string::npos ? "" : text.substr(colon + 1);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), into.listen_port);
  if (port.empty() || error != std::errc() || end != port.data() + port.size() || into.listen_port == 0 ||
      !text.starts_with("127.")) {
    throw UsageError(
        "'listen' is '" + text +
        "': write an address of this machine alone and a port, such as 127.0.0.1:9464; from elsewhere "
        "it is reached through a proxy that asks who comes");
  }
  into.listen_address = text.substr(0, colon);
}

}  // namespace

bool StreamConfiguration::has_pictures_named(const std::string& stream) const {
  return is_video && std::ranges::count(names_of(*this), stream) > 0;
}

recorder::VideoProfile default_video_profile(const Configuration& configuration) {
  recorder::VideoProfile video;
  video.profile = *recorder::parse_profile(configuration.profile);
  video.bit_rate = configuration.bit_rate;
  video.chroma_422 = configuration.chroma_422;
  video.deinterlace = configuration.deinterlace;
  video.audio = configuration.audio;
  return video;
}

void read_rooms(TableReader& top, Configuration& into) {
  for_each_table(top, "room", [&](const toml::table& entry) {
    RoomConfiguration room = read_room(entry, top, into);
    const bool twice = std::any_of(into.rooms.begin(), into.rooms.end(),
                                   [&](const auto& other) { return other.name == room.name; });
    if (twice) top.refuse(entry.source(), "there are two rooms named '" + room.name + "'");
    if (const std::string why = overlap_of(room, into.rooms); !why.empty()) top.refuse(entry.source(), why);
    into.rooms.push_back(std::move(room));
  });
}

void read_profile_rules(TableReader& top, Configuration& into) {
  const toml::table* recording = top.table("recording");
  if (recording == nullptr) return;
  TableReader reader(*recording, "[recording]", top.file());
  for_each_table(reader, "profile_for", [&](const toml::table& entry) {
    ProfileForConfiguration read = read_profile_rule(entry, reader, into);
    const bool twice = std::ranges::any_of(
        into.profile_for, [&](const auto& other) { return other.rule.name == read.rule.name; });
    if (twice)
      reader.refuse(entry.source(), "there are two [[recording.profile_for]] named '" + read.rule.name + "'");
    into.profile_for.push_back(std::move(read));
  });
}

namespace {

// As `kiroku record` and `kiroku train` name their streams.
constexpr std::array<std::string_view, 4> kOfRecord{"endoscope", "room", "fluoroscopy", "vitals"};
constexpr std::array<std::string_view, 2> kOfTraining{"training", "forces"};

/// `with_second`: also what archives the same pictures in a second form.
std::vector<std::string> streams_of_rooms(const Configuration& configuration, bool with_second) {
  std::vector<std::string> names;
  const auto add = [&names](const std::string& name) {
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  };
  for (const RoomConfiguration& room : configuration.rooms) {
    for (const StreamConfiguration& stream : room.streams) {
      if (with_second)
        std::ranges::for_each(names_of(stream), add);
      else
        add(stream.name);
    }
  }
  if (configuration.rooms.empty()) names.assign(kOfRecord.begin(), kOfRecord.end());
  return names;
}

}  // namespace

std::vector<std::string> names_with_recipients(const Configuration& configuration) {
  std::vector<std::string> names = streams_of_rooms(configuration, false);
  for (const std::string_view name : kOfRecord) {
    if (std::ranges::find(names, name) == names.end()) names.emplace_back(name);
  }
  names.insert(names.end(), kOfTraining.begin(), kOfTraining.end());
  names.emplace_back(kEventsRecipients);
  names.emplace_back(archive::kPointingStream);
  return names;
}

std::string mistyped_recipients(const Configuration& configuration, const std::string& name) {
  const bool always_there = name == kEventsRecipients || name == archive::kPointingStream;
  if (configuration.rooms.empty() || always_there) return {};
  const std::vector<std::string> recorded = streams_of_rooms(configuration, false);
  if (std::ranges::find(recorded, name) != recorded.end()) return {};
  for (const RoomConfiguration& room : configuration.rooms) {
    for (const StreamConfiguration& stream : room.streams) {
      if (!stream.name.starts_with(name) && !name.starts_with(stream.name)) continue;
      return "[recipients] names the stream '" + name + "', which no [[room]] records, and room '" +
             room.name + "' records '" + stream.name +
             "', which everybody in recipients.txt could open: write the name of what is recorded";
    }
  }
  return {};
}

std::vector<std::string> idle_recipients(const Configuration& configuration) {
  std::vector<std::string> idle;
  if (configuration.rooms.empty()) return idle;
  const std::vector<std::string> recorded = streams_of_rooms(configuration, false);
  for (const auto& [name, file] : configuration.recipients) {
    if (std::ranges::find(kOfRecord, name) == kOfRecord.end()) continue;
    if (std::ranges::find(recorded, name) != recorded.end()) continue;
    idle.push_back("[recipients] names the stream '" + name +
                   "', which no [[room]] records: it holds for `kiroku record` alone. The rooms record " +
                   joined(recorded) + ", and what is not named is sealed for recipients.txt");
  }
  return idle;
}

std::vector<std::string> doubts_of(const Configuration& configuration) {
  std::vector<std::string> doubts = idle_recipients(configuration);
  for (std::string& sentence : shared_by_rooms(configuration.rooms)) doubts.push_back(std::move(sentence));
  return doubts;
}

std::vector<std::string> idle_retention(const Configuration& configuration) {
  std::vector<std::string> names = streams_of_rooms(configuration, true);
  if (configuration.rooms.empty()) {
    for (const std::string_view first : kOfRecord) {
      for (const recorder::Profile form :
           {recorder::Profile::kMpeg2, recorder::Profile::kUncompressed, recorder::Profile::kLossless})
        names.push_back(recorder::second_name(std::string(first), form));
    }
  }
  names.insert(names.end(), kOfTraining.begin(), kOfTraining.end());
  names.emplace_back(kEventsRecipients);
  names.emplace_back(archive::kPointingStream);
  std::vector<std::string> purposes{recorder::kEventsPurpose, recorder::kPointingPurpose};
  for (const RoomConfiguration& room : configuration.rooms) {
    for (const StreamConfiguration& stream : room.streams) purposes.push_back(stream.purpose);
  }
  std::vector<std::string> idle;
  for (const RetentionRule& rule : configuration.retention.rules) {
    const bool by_name = !rule.stream.empty();
    // Without rooms purposes are those of streams, of marks and of training, which nobody chooses.
    if (!by_name && configuration.rooms.empty()) continue;
    const std::vector<std::string>& known = by_name ? names : purposes;
    const std::string& stated = by_name ? rule.stream : rule.purpose;
    if (std::ranges::find(known, stated) != known.end()) continue;
    idle.push_back(std::string("[[retention]] is for the ") + (by_name ? "stream" : "purpose") + " '" +
                   stated +
                   "', which nothing that is recorded here has: by this rule only cases of before "
                   "may ever be erased. There are " +
                   joined(known));
  }
  return idle;
}

namespace {

/// Streams of rooms for which there are two rules.
std::vector<std::string> overlapping_retention(const Configuration& configuration) {
  std::vector<std::string> told;
  for (const RoomConfiguration& room : configuration.rooms) {
    for (const StreamConfiguration& stream : room.streams) {
      for (const std::string& name : names_of(stream)) {
        archive::StreamInfo info;
        info.name = name;
        info.purpose = stream.purpose;
        const RetentionRule* const holds = rule_for(configuration.retention.rules, info);
        for (const RetentionRule& rule : configuration.retention.rules) {
          if (&rule == holds || !rule.concerns(info)) continue;
          told.push_back("[[retention]] has two rules for the stream '" + name + "' of room '" + room.name +
                         "': that of " + holds->of() + ", which keeps it longer (" +
                         age_in_words(holds->after) + "), holds; that of " + rule.of() + " (" +
                         age_in_words(rule.after) + ") erases nothing of it");
        }
      }
    }
  }
  return told;
}

}  // namespace

std::vector<std::string> doubtful_retention(const Configuration& configuration) {
  std::vector<std::string> doubts = configuration.retention.unclear;
  for (std::string& sentence : idle_retention(configuration)) doubts.push_back(std::move(sentence));
  for (const RetentionRule& rule : configuration.retention.rules) {
    if (rule.after >= std::chrono::hours(24)) continue;
    doubts.push_back("[[retention]] of " + rule.of() + " erases what was recorded " +
                     age_in_words(rule.after) + " after the case was opened, which is less than a day");
  }
  for (std::string& sentence : overlapping_retention(configuration)) doubts.push_back(std::move(sentence));
  return doubts;
}

std::vector<recorder::ProfileRule> profile_rules_for(const Configuration& configuration,
                                                     const std::string& room,
                                                     const std::vector<std::string>& streams) {
  std::vector<recorder::ProfileRule> rules;
  for (const ProfileForConfiguration& each : configuration.profile_for) {
    if (!each.rooms.empty() && std::ranges::find(each.rooms, room) == each.rooms.end()) continue;
    recorder::ProfileRule rule = each.rule;
    std::erase_if(rule.streams,
                  [&](const std::string& name) { return std::ranges::find(streams, name) == streams.end(); });
    if (rule.streams.empty() && !each.rule.streams.empty()) continue;
    rules.push_back(std::move(rule));
  }
  return rules;
}

void read_daemon(TableReader& top, Configuration& into) {
  if (const toml::table* table = top.table("daemon")) {
    TableReader reader(*table, "[daemon]", top.file());
    reader.text("socket", [&](const std::string& text) { into.daemon.socket = text; });
    reader.text("listen", [&](const std::string& text) { read_listen(text, into.daemon); });
    reader.text("hook_token_file", [&](const std::string& text) { into.daemon.hook_token_file = text; });
    reader.refuse_unknown_keys();
  }
  if (const toml::table* table = top.table("storage")) {
    TableReader reader(*table, "[storage]", top.file());
    reader.text("warn_below", [&](const std::string& text) {
      const std::chrono::duration<double, std::ratio<3600>> hours =
          parse_stated_duration(text, "'warn_below'");
      into.storage.warn_below_hours = hours.count();
    });
    read_replicas(reader, into.retention);
    reader.refuse_unknown_keys();
  }
}

}  // namespace kiroku::apps
