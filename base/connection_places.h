// Which connections a server keeps when more come than it can hold. Thread-safe.
//
// A connection takes its place when it is accepted, before TLS and before its first byte. Where there is no
// place, the idlest connection of the lowest standing goes, so that silent connections shut nobody out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace kiroku {

class ConnectionPlaces {
 public:
  /// What a connection has shown of itself; it rises only.
  enum class Standing {
    kSilent,  // nothing yet
    kSpoken,  // said something that the server understands
    kKnown    // of somebody whom the server knows
  };
  struct Limits {
    std::size_t all = 1000, of_holder = 200;
    /// Connections of this standing never make room for a newcomer.
    Standing safe = Standing::kKnown;
  };

  /// One connection's, until it is destroyed.
  class Place {
   public:
    ~Place();
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    /// It did something now; `shown` is what it showed of itself.
    void note(Standing shown);
    /// A busy connection (its answer is being made or sent) never makes room.
    void set_busy(bool is_busy);

   private:
    friend class ConnectionPlaces;
    Place(ConnectionPlaces& places, std::uint64_t id) : places_(places), id_(id) {}
    ConnectionPlaces& places_;
    const std::uint64_t id_;
  };

  explicit ConnectionPlaces(Limits limits) : limits_(limits) {}
  ConnectionPlaces(const ConnectionPlaces&) = delete;
  ConnectionPlaces& operator=(const ConnectionPlaces&) = delete;

  /// A place for a connection of `holder` (base/network_address.h), or null where none can be made. Where
  /// `holder` has its most connections, one of its own makes room, else one of anybody. `end` closes the
  /// connection that makes room: it is called at most once, on the newcomer's thread, possibly after its
  /// Place is gone. Places must not outlive this.
  std::unique_ptr<Place> enter(const std::string& holder, std::function<void()> end);

  [[nodiscard]] std::size_t count() const;

 private:
  struct Entry {
    std::string holder;
    std::function<void()> end;
    Standing standing = Standing::kSilent;
    bool is_busy = false;
    std::uint64_t last = 0;  // greater is later
  };
  using Entries = std::map<std::uint64_t, Entry>;
  /// The one that makes room; the end if none may. With the mutex held.
  Entries::iterator idlest(const std::string* of_holder);
  void forget(Entries::iterator entry);
  const Limits limits_;
  mutable std::mutex mutex_;
  Entries entries_;
  std::map<std::string, std::size_t> of_holder_;
  std::uint64_t next_ = 0;
};

}  // namespace kiroku
