// Which connections a server keeps when more come than it can hold. Thread-safe.
//
// A connection takes its place when it is accepted, before TLS and before its first byte. Where there is no
// place, the idlest connection of the lowest standing goes, so that silent connections shut nobody out. Those
// of somebody whom the server knows stay, but leave some places for others: where they do not, the owner with
// the most of them gives one up.
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
    /// Connections of this standing make room only as `kept_of_owner` says.
    Standing safe = Standing::kKnown;
    /// So many of one owner never make room, whoever comes.
    std::size_t kept_of_owner = 8;
    /// One place in so many, of all and of a holder's, is for connections that are not safe.
    std::size_t one_for_others_in = 8;
  };

  /// One connection's, until it is destroyed.
  class Place {
   public:
    ~Place();
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    /// It did something now; `shown` is what it showed of itself.
    void note(Standing shown);
    /// The same of one that is known, and whose it is.
    void note_known(const std::string& owner);
    /// A busy connection (its answer is being made or sent) makes room only as a safe one does, and last.
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
    std::string holder, owner;  // no owner: nobody known
    std::function<void()> end;
    Standing standing = Standing::kSilent;
    bool is_busy = false;
    std::uint64_t last = 0;  // greater is later
  };
  using Entries = std::map<std::uint64_t, Entry>;
  /// The one that makes room; the end if none may. All with the mutex held, and of `of_holder` alone where
  /// that is not null.
  Entries::iterator leaving(const std::string* of_holder);
  Entries::iterator idlest(const std::string* of_holder);
  Entries::iterator idlest_of_greatest_owner(const std::string* of_holder);
  /// How many are neither safe nor of an owner.
  [[nodiscard]] std::size_t others(const std::string* of_holder) const;
  void forget(Entries::iterator entry);
  const Limits limits_;
  mutable std::mutex mutex_;
  Entries entries_;
  std::map<std::string, std::size_t> of_holder_;
  std::uint64_t next_ = 0;
};

}  // namespace kiroku
