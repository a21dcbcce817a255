// Where a hospital's systems deliver messages about patients and appointments: HL7 v2 ADT and SIU over MLLP,
// for one room or several. Every function may be called from any thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/clock.h"
#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_source.h"

namespace kiroku::recorder {

/// Where what an inbox knows outlives the process: in memory alone, as it is of patients.
struct InboxMemory {
  Bytes earlier;                             // as an earlier process kept it last; empty: nothing
  std::function<void(ByteView state)> keep;  // called by any thread, one at a time; must not throw
};

class ProcedureInbox {
 public:
  /// Hears what a person should see, from any thread; nothing of a message's content is in it.
  using Tell = std::function<void(const std::string& sentence)>;

  /// `listen` is mllp://ADDRESS:PORT with the options of mllp_address.h and `zone` (mllp_source.h). Does not
  /// listen yet. `time` must outlive it. With a `memory` it goes on from what an earlier process knew; each
  /// message is kept there before it is acknowledged, or within a second of the one before. Throws
  /// kiroku::UsageError for an address that is none.
  ProcedureInbox(const std::string& listen, Tell tell, const Clock& time = Clock::system(),
                 InboxMemory memory = {});
  ~ProcedureInbox();
  ProcedureInbox(const ProcedureInbox&) = delete;
  ProcedureInbox& operator=(const ProcedureInbox&) = delete;

  /// Throws kiroku::UsageError for an address that is none.
  static void check(const std::string& listen);

  /// Listens, if it does not; a port that is taken is tried again some seconds after. Call each second or so.
  void tend();
  /// Keeps what is not kept yet. Nothing is taken any more: who delivers waits for an acknowledgement, and
  /// delivers again to whoever listens next.
  void end();

  /// As those of ProcedureBook.
  void watch(const ProcedureRule& rule);
  [[nodiscard]] Standing standing(const ProcedureRule& rule, const ProcedureData& data,
                                  std::optional<UtcTime> planned, UtcTime at,
                                  const EndedSince& ended = {}) const;
  [[nodiscard]] ProcedureChoice choose(const ProcedureRule& rule, UtcTime at,
                                       const EndedSince& ended = {}) const;
  [[nodiscard]] std::optional<ProcedureData> find(const ProcedureRule& rule, UtcTime at) const {
    return choose(rule, at).data;
  }
  [[nodiscard]] Objection objection(const ProcedureRule& rule, const ProcedureChoice& taken,
                                    UtcTime at) const;
  [[nodiscard]] std::vector<ProcedureData> list(const ProcedureRule& rule, UtcTime at) const;
  void note_recorded(const ProcedureRule& rule, const ProcedureData& data, UtcTime at);
  /// Also by an earlier process.
  [[nodiscard]] std::vector<std::pair<ProcedureData, UtcTime>> recorded(const ProcedureRule& rule) const;
  /// When, since the machine's boot, somebody came to the room last, left it, or was done with there; nothing
  /// where no message says so.
  [[nodiscard]] std::optional<Clock::Duration> changed_at(const ProcedureRule& rule) const;
  /// Its sentence says since when messages are known, if that is not since before all that counts.
  [[nodiscard]] ProcedureWay way() const;
  /// The port it listens on; 0 while it does not.
  [[nodiscard]] std::uint16_t port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
