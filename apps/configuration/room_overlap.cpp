#include "apps/configuration/room_overlap.h"

#include <algorithm>
#include <optional>
#include <string_view>

#include "base/ascii.h"
#include "base/error.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/mllp_address.h"

namespace kiroku::apps {
namespace {

using recorder::SourceAddress;
using recorder::SourceKind;

std::string quoted(const std::string& text) { return "'" + text + "'"; }

std::string both(const RoomConfiguration& one, const RoomConfiguration& other) {
  return "rooms '" + other.name + "' and '" + one.name + "'";
}

SourceAddress address_of(const std::string& source) {
  return recorder::parse_source_address(source, recorder::Presence::kNotLookedAt);
}

// --- What listens.

/// An address at which a room waits for messages.
struct Listening {
  std::string of;      // "the procedures of room 'or-1'"
  std::string stated;  // as it is written
  bool of_procedures = false;
  std::string address;
  std::uint16_t port = 0;

  [[nodiscard]] bool is_anywhere() const { return address == "0.0.0.0" || address == "::"; }
};

/// Nothing where its options are wrong, which is told when it is used.
std::optional<Listening> listening_of(const std::string& source, std::string of, bool of_procedures) {
  try {
    const SourceAddress address = address_of(source);
    if (address.kind != SourceKind::kMonitors) return {};
    const recorder::MllpServer::Options options = recorder::mllp_server_options(address);
    return Listening{std::move(of), source, of_procedures, options.address, options.port};
  } catch (const Error&) {
    return {};
  }
}

std::vector<Listening> listening_of(const RoomConfiguration& room) {
  std::vector<Listening> all;
  const auto add = [&all](std::optional<Listening> one) {
    if (one) all.push_back(std::move(*one));
  };
  const std::string of_room = " of room '" + room.name + "'";
  if (room.procedure.hl7)
    add(listening_of(room.procedure.hl7->listen, "[room.procedure.hl7]" + of_room, true));
  for (const StreamConfiguration& stream : room.streams)
    add(listening_of(stream.source, "the stream '" + stream.name + "'" + of_room, false));
  return all;
}

std::string clash_of(const Listening& one, const Listening& other) {
  // Port 0 is any that is free.
  const bool meets = one.port != 0 && one.port == other.port &&
                     (one.address == other.address || one.is_anywhere() || other.is_anywhere());
  // The same words: rooms share who listens there.
  const bool shared = one.of_procedures && other.of_procedures && one.stated == other.stated;
  if (!meets || shared) return {};
  const std::string why =
      other.of + " and " + one.of + " wait for messages at one port, " + std::to_string(one.port);
  return one.of_procedures && other.of_procedures
             ? why + ": write the same 'listen' in both rooms, with what both allow"
             : why + ", and only one of them would get them: give each a port of its own";
}

std::string listening_clash(const RoomConfiguration& room, const std::vector<RoomConfiguration>& others) {
  const std::vector<Listening> own = listening_of(room);
  for (std::size_t at = 0; at < own.size(); ++at) {
    for (std::size_t before = 0; before < at; ++before)
      if (std::string why = clash_of(own[at], own[before]); !why.empty()) return why;
    for (const RoomConfiguration& other : others) {
      for (const Listening& theirs : listening_of(other))
        if (std::string why = clash_of(own[at], theirs); !why.empty()) return why;
    }
  }
  return {};
}

// --- Who comes into which room.

/// Whether one message can name both: the same place, "OR1" and the "OR1" of "SURGERY^OR1", or "SURGERY^OR1"
/// and the one of a hospital, "SURGERY^OR1^^HOSP".
bool may_be_one_place(const std::string& a, const std::string& b) {
  const auto is_part = [](const std::string& part, const std::string& whole) {
    return ("^" + lower_case(whole) + "^").find("^" + lower_case(part) + "^") != std::string::npos;
  };
  return is_part(a, b) || is_part(b, a);
}

std::string place_overlap(const RoomConfiguration& room, const RoomConfiguration& other) {
  if (!room.procedure.hl7 || !other.procedure.hl7) return {};
  const Hl7Configuration &own = *room.procedure.hl7, &theirs = *other.procedure.hl7;
  for (const RoomConfiguration* of : {&room, &other}) {
    if (own.listen != theirs.listen || !of->procedure.hl7->rule.locations.empty()) continue;
    return both(room, other) + " get their HL7 messages at one address, and room '" + of->name +
           "' has no 'locations': it would take the patients of the other, too; write which are its own";
  }
  for (const std::string& location : own.rule.locations) {
    for (const std::string& place : theirs.rule.locations) {
      if (!may_be_one_place(location, place)) continue;
      const std::string places =
          location == place ? quoted(place) : quoted(place) + " and " + quoted(location);
      return both(room, other) + " have one of their 'locations' in common, " + places +
             ": a patient who is there would be sealed into the cases of both; write each place in one "
             "room, as \"SURGERY^OR1\" where its name alone is not unique";
    }
  }
  return {};
}

/// Whether a step may be one that both ask for.
bool may_be_one_step(const recorder::WorklistOptions& a, const recorder::WorklistOptions& b) {
  const auto differ = [](const std::string& one, const std::string& other) {
    return !one.empty() && !other.empty() && one != other;
  };
  return same_but_for_case(a.host, b.host) && a.port == b.port && a.called_ae == b.called_ae &&
         !differ(a.station_ae, b.station_ae) && !differ(a.modality, b.modality);
}

std::string worklist_overlap(const RoomConfiguration& room, const RoomConfiguration& other) {
  if (!room.procedure.worklist || !other.procedure.worklist) return {};
  const recorder::WorklistOptions &own = *room.procedure.worklist, &theirs = *other.procedure.worklist;
  if (!may_be_one_step(own, theirs)) return {};
  return both(room, other) + " ask the worklist " + own.called_ae +
         " for the same steps, and each would take the nearest one, whichever room it is for: give each its "
         "'station_ae'";
}

bool is_told_apart_by_who_asks(const RoomConfiguration& room, const RoomConfiguration& other) {
  return room.procedure.worklist->calling_ae != other.procedure.worklist->calling_ae;
}

// --- What is read.

std::string device_clash(const RoomConfiguration& room, const StreamConfiguration& stream,
                         const RoomConfiguration& other, const StreamConfiguration& theirs) {
  const SourceAddress own = address_of(stream.source), there = address_of(theirs.source);
  if (own.kind != SourceKind::kDevice || there.kind != SourceKind::kDevice || own.location != there.location)
    return {};
  return "the device " + own.location + " is the source of " + other.name + "/" + theirs.name + " and of " +
         room.name + "/" + stream.name +
         ": it gives its pictures to one of them alone; 'also' archives pictures in a second form";
}

std::string device_overlap(const RoomConfiguration& room, const std::vector<RoomConfiguration>& others) {
  for (std::size_t at = 0; at < room.streams.size(); ++at) {
    for (std::size_t before = 0; before < at; ++before) {
      if (std::string why = device_clash(room, room.streams[at], room, room.streams[before]); !why.empty())
        return why;
    }
    for (const RoomConfiguration& other : others) {
      for (const StreamConfiguration& theirs : other.streams)
        if (std::string why = device_clash(room, room.streams[at], other, theirs); !why.empty()) return why;
    }
  }
  return {};
}

// --- What is pressed.

bool is_same_key(const recorder::FootswitchOptions& a, const recorder::FootswitchOptions& b) {
  return a.device == b.device && a.key == b.key;
}

std::string key_of(const recorder::FootswitchOptions& footswitch) {
  return "key " + std::to_string(footswitch.key) + " of the footswitch " + footswitch.device;
}

/// Whether one press cannot do both. A mark goes with everything.
bool contradict(const recorder::FootswitchOptions& a, const recorder::FootswitchOptions& b) {
  using recorder::PressAction;
  const auto is_of_case = [](PressAction action) {
    return action != PressAction::kMark && action != PressAction::kProfile;
  };
  return (is_of_case(a.action) && is_of_case(b.action)) ||
         (a.action == PressAction::kProfile && b.action == PressAction::kProfile);
}

std::string pedal_overlap(const RoomConfiguration& room) {
  for (std::size_t at = 0; at < room.footswitches.size(); ++at) {
    for (std::size_t before = 0; before < at; ++before) {
      const recorder::FootswitchOptions &own = room.footswitches[at], &other = room.footswitches[before];
      if (!is_same_key(own, other) || !contradict(own, other)) continue;
      return "room '" + room.name + "' has two presses for " + key_of(own) + ", \"" +
             std::string(press_action_name(other.action)) + "\" and \"" +
             std::string(press_action_name(own.action)) + "\": one press cannot do both";
    }
  }
  return {};
}

// --- What may be meant.

void tell_shared(const RoomConfiguration& room, const RoomConfiguration& other,
                 std::vector<std::string>& sentences) {
  const std::string rooms = both(room, other);
  if (!worklist_overlap(room, other).empty()) {
    sentences.push_back(rooms + " ask the worklist " + room.procedure.worklist->called_ae +
                        " for steps of any station or of the same one: only if it lists by 'calling_ae' does "
                        "each get its own; else give each its 'station_ae'");
  }
  for (const StreamConfiguration& stream : room.streams) {
    for (const StreamConfiguration& theirs : other.streams) {
      const SourceAddress own = address_of(stream.source), there = address_of(theirs.source);
      const std::string streams = other.name + "/" + theirs.name + " and " + room.name + "/" + stream.name;
      if (own.kind != SourceKind::kSynthetic && own.kind == there.kind && own.location == there.location) {
        sentences.push_back(streams + " have one source, '" + own.stated +
                            "': what it shows stands in the cases of both rooms");
      }
      if (!stream.microphone.empty() && stream.microphone == theirs.microphone) {
        sentences.push_back(streams + " have one microphone, '" + stream.microphone +
                            "': what it hears stands in the cases of both rooms");
      }
    }
  }
  for (const recorder::FootswitchOptions& own : room.footswitches) {
    for (const recorder::FootswitchOptions& theirs : other.footswitches) {
      if (!is_same_key(own, theirs)) continue;
      sentences.push_back(rooms + " both act on " + key_of(own) +
                          ": one press does something in each; two equal footswitches are told apart by "
                          "their paths below /dev/input/by-path");
    }
  }
}

}  // namespace

std::string overlap_of(const RoomConfiguration& room, const std::vector<RoomConfiguration>& others) {
  if (std::string why = pedal_overlap(room); !why.empty()) return why;
  if (std::string why = device_overlap(room, others); !why.empty()) return why;
  if (std::string why = listening_clash(room, others); !why.empty()) return why;
  for (const RoomConfiguration& other : others) {
    if (std::string why = place_overlap(room, other); !why.empty()) return why;
    if (std::string why = worklist_overlap(room, other);
        !why.empty() && !is_told_apart_by_who_asks(room, other))
      return why;
  }
  return {};
}

std::vector<std::string> shared_by_rooms(const std::vector<RoomConfiguration>& rooms) {
  std::vector<std::string> sentences;
  for (std::size_t at = 0; at < rooms.size(); ++at) {
    for (std::size_t before = 0; before < at; ++before) tell_shared(rooms[at], rooms[before], sentences);
  }
  std::ranges::sort(sentences);
  sentences.erase(std::unique(sentences.begin(), sentences.end()), sentences.end());
  return sentences;
}

}  // namespace kiroku::apps
