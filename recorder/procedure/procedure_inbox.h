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

class ProcedureInbox {
 public:
  /// Hears what a person should see; nothing of a message's content is in it.
  using Tell = std::function<void(const std::string& sentence)>;

  /// `listen` is mllp://ADDRESS:PORT with the options of mllp_address.h and `zone` (mllp_source.h). Does not
  /// listen yet. `time` must outlive it. Throws kiroku::UsageError for an address that is none.
  ProcedureInbox(const std::string& listen, Tell tell, const Clock& time = Clock::system());
  ~ProcedureInbox();
  ProcedureInbox(const ProcedureInbox&) = delete;
  ProcedureInbox& operator=(const ProcedureInbox&) = delete;

  /// Throws kiroku::UsageError for an address that is none.
  static void check(const std::string& listen);

  /// Listens, if it does not; a port that is taken is tried again some seconds after. Call each second or so.
  void tend();

  /// As those of ProcedureBook.
  [[nodiscard]] std::optional<ProcedureData> find(const ProcedureRule& rule, UtcTime at) const;
  [[nodiscard]] bool is_doubtful(const ProcedureRule& rule, UtcTime at) const;
  [[nodiscard]] bool is_too_early(const ProcedureRule& rule, UtcTime at) const;
  [[nodiscard]] std::vector<ProcedureData> list(const ProcedureRule& rule, UtcTime at) const;
  [[nodiscard]] ProcedureWay way() const;
  /// The port it listens on; 0 while it does not.
  [[nodiscard]] std::uint16_t port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
