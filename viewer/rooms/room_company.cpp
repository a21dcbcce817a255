#include "viewer/rooms/room_company.h"

#include <set>
#include <utility>

#include <nlohmann/json.hpp>

namespace kiroku::viewer {

RoomCompany::Seat::Seat(RoomCompany& company, std::string room, std::list<Member>::iterator member)
    : company_(company), room_(std::move(room)), member_(member) {}

RoomCompany::Seat::~Seat() {
  const std::lock_guard guard(company_.mutex_);
  company_.rooms_.at(room_).erase(member_);
  company_.tell_watchers(room_);
}

void RoomCompany::Seat::tell(const std::string& text) const {
  const std::lock_guard guard(company_.mutex_);
  for (const Member& member : company_.rooms_.at(room_)) {
    if (member.is_admitted()) member.output->send_text(text);
  }
}

std::unique_ptr<RoomCompany::Seat> RoomCompany::join(const std::string& room, Member member) {
  const std::lock_guard guard(mutex_);
  std::list<Member>& members = rooms_[room];
  members.push_back(std::move(member));
  std::unique_ptr<Seat> seat(new Seat(*this, room, std::prev(members.end())));
  tell_watchers(room);
  return seat;
}

void RoomCompany::tell_watchers(const std::string& room) {
  const std::list<Member>& members = rooms_.at(room);
  std::set<std::pair<std::string, std::string>> told;
  auto watchers = nlohmann::ordered_json::array();
  for (const Member& member : members) {
    if (told.emplace(member.name, member.role).second) {
      watchers.push_back({{"name", member.name}, {"role", member.role}});
    }
  }
  const std::string text = nlohmann::ordered_json{{"watchers", std::move(watchers)}}.dump();
  for (const Member& member : members) member.output->send_text(text);
}

}  // namespace kiroku::viewer
