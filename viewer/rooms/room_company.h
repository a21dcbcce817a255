// Who looks on in each room, and where they point. Thread-safe.
#pragma once

#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "viewer/http/socket.h"

namespace kiroku::viewer {

class RoomCompany {
 public:
  struct Member {
    std::string name, role;
    std::shared_ptr<SocketOutput> output;
    /// Whether they may see now what is pointed at.
    std::function<bool()> is_admitted;
  };

  /// A member of a room while it lives.
  class Seat {
   public:
    ~Seat();
    Seat(const Seat&) = delete;
    Seat& operator=(const Seat&) = delete;
    /// Tells everybody in the room; a browser that is too slow misses it.
    void tell(const std::string& text) const;

   private:
    friend class RoomCompany;
    Seat(RoomCompany& company, std::string room, std::list<Member>::iterator member);
    RoomCompany& company_;
    const std::string room_;
    const std::list<Member>::iterator member_;
  };
  /// Everybody is told who is there now, and again whenever that changes: {"watchers":[{"name","role"}]},
  /// each person once.
  [[nodiscard]] std::unique_ptr<Seat> join(const std::string& room, Member member);

 private:
  void tell_watchers(const std::string& room);  // with the mutex held
  std::mutex mutex_;
  std::map<std::string, std::list<Member>> rooms_;
};

}  // namespace kiroku::viewer
