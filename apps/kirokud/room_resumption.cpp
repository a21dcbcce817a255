#include "apps/kirokud/room_resumption.h"

#include <spdlog/spdlog.h>

#include "archive/storage/file_system.h"
#include "archive/writing/appliance_log.h"
#include "base/printable.h"

namespace kiroku::apps {

RoomResumption::RoomResumption(const Home& home, const Configuration& configuration)
    : planner_(context(home), rules(home, configuration)) {}

void RoomResumption::apply(recorder::RoomPlan& plan) {
  if (const auto note = notes_.find(plan.name); note != notes_.end()) plan.running = note->second;
  plan.resume = planner_.of(plan.name);
  plan.not_resumed = why_not_[plan.name];
}

recorder::ResumptionPlanner::Context RoomResumption::context(const Home& home) {
  recorder::ResumptionPlanner::Context context;
  context.archive = home.archive();
  context.boot_id = archive::kernel_boot_id();
  context.tell = [this](const std::string& room, const std::string& sentence) {
    why_not_[room] = sentence;
    spdlog::error("room {}: {}", room, printable(sentence));
  };
  return context;
}

std::vector<recorder::ResumeRule> RoomResumption::rules(const Home& home,
                                                        const Configuration& configuration) {
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

}  // namespace kiroku::apps
