// What the rooms of kiroku.toml are to the recorder: their streams, where they learn about procedures, and
// whom they tell.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>

#include "apps/configuration/configuration.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kirokud/descriptor_store.h"
#include "recorder/daemon/daemon.h"
#include "recorder/procedure/room_procedure.h"
#include "viewer/live/live_monitors.h"
#include "viewer/live/live_pictures.h"

namespace kiroku::apps {

/// What is shown of rooms while they record.
struct LookingOn {
  live::Channels channels;
  live::LiveMonitors monitors;
};

/// `looking_on` is given the room's pictures and vital signs; null: nobody looks on.
recorder::RoomPlan plan_of(const RoomConfiguration& room, const Home& home,
                           const Configuration& configuration, const Authorities& authorities,
                           const WritableHome& shared, LookingOn* looking_on);

/// Where hospital systems deliver messages of patients, by address: rooms that name the same one share it.
using Inboxes = std::map<std::string, std::shared_ptr<recorder::ProcedureInbox>>;

/// Where the room learns about procedures; null where nothing is configured. Inboxes go on from what `store`
/// holds of them.
std::shared_ptr<recorder::ProcedureSource> procedure_of(const RoomConfiguration& room, Inboxes& inboxes,
                                                        DescriptorStore& store);

/// `left` counts the cases that could not be closed.
recorder::RoomListener listener_for(const Home& home, std::atomic<int>& left);

}  // namespace kiroku::apps
