#include "apps/kirokud/room_setup.h"

#include <spdlog/spdlog.h>

#include "apps/kirokud/catalogue_note.h"
#include "archive/format/pointing_stream.h"
#include "base/printable.h"

namespace kiroku::apps {

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
  plan.session.event_recipients = recipients.of(kEventsRecipients);
  plan.session.pointing = looking_on != nullptr;
  const std::string pointing(archive::kPointingStream);
  if (configuration.recipients.contains(pointing)) plan.session.pointing_recipients = recipients.of(pointing);
  plan.session.segment_duration = configuration.segment;
  plan.session.stamp_interval = configuration.stamp_every;
  plan.session.authorities = authorities.named();
  plan.session.key = &shared.key;
  plan.session.trust = &shared.trust;
  plan.session.log = shared.log.get();
  plan.session.queue = shared.queue.get();
  return plan;
}

std::shared_ptr<recorder::ProcedureSource> procedure_of(const RoomConfiguration& room, Inboxes& inboxes,
                                                        DescriptorStore& store) {
  if (room.procedure.empty()) return {};
  std::shared_ptr<recorder::ProcedureInbox> inbox;
  recorder::ProcedureRule rule;
  if (room.procedure.hl7) {
    rule = room.procedure.hl7->rule;
    std::shared_ptr<recorder::ProcedureInbox>& shared = inboxes[room.procedure.hl7->listen];
    if (!shared) {
      shared = std::make_shared<recorder::ProcedureInbox>(
          room.procedure.hl7->listen,
          [](const std::string& sentence) { spdlog::warn("{}", printable(sentence)); }, Clock::system(),
          store.memory_of(room.procedure.hl7->listen));
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

}  // namespace kiroku::apps
