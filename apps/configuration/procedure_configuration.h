// [room.procedure] of kiroku.toml: where a room learns about the procedure. Pure functions, thread-safe.
#pragma once

#include <optional>
#include <string>

#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/worklist.h"

namespace kiroku::apps {

class TableReader;

/// [room.procedure.hl7].
struct Hl7Configuration {
  std::string listen;  // "mllp://0.0.0.0:2576"
  recorder::ProcedureRule rule;
};

/// [room.procedure].
struct ProcedureConfiguration {
  std::optional<Hl7Configuration> hl7;
  std::optional<recorder::WorklistOptions> worklist;
  [[nodiscard]] bool empty() const { return !hl7 && !worklist; }
};

/// What stands in `room` under "procedure"; nothing is fine. Throws kiroku::UsageError with line and column.
ProcedureConfiguration read_procedure(TableReader& room);

}  // namespace kiroku::apps
