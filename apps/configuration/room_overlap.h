// What two rooms of one kiroku.toml have in common and should not: a patient of the one would be sealed into
// the case of the other. Pure functions, thread-safe.
#pragma once

#include <string>
#include <vector>

#include "apps/configuration/room_configuration.h"

namespace kiroku::apps {

/// Why `room` cannot stand beside `others`, or contradicts itself; "" where it can. One place of HL7
/// messages, or one step of a worklist, that would be of both; one address that both listen at; one device
/// that both read; one key of a footswitch for two presses of one room.
std::string overlap_of(const RoomConfiguration& room, const std::vector<RoomConfiguration>& others);

/// A sentence for each thing that rooms share, which may be meant: a camera of the network, a film, a
/// microphone, a key of a footswitch, a worklist that tells rooms apart by who asks.
std::vector<std::string> shared_by_rooms(const std::vector<RoomConfiguration>& rooms);

}  // namespace kiroku::apps
