// Where vital signs come from. A source is read by one thread and may be interrupted from another.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "media/vital_line.h"

namespace kiroku::recorder {

class CaseClock;
class PatientWatch;
struct SourceAddress;

using media::to_json_line;
using media::VitalLine;
using media::VitalSample;

class VitalSource {
 public:
  virtual ~VitalSource() = default;
  /// The next line in order of time_ns, which counts from the case's zero; nothing at the end, and where
  /// quiet_until_ns() says so. A source that states its own times (file, synthetic) never waits: whoever
  /// records it at its own pace waits until the case clock shows time_ns. One that waits for what arrives
  /// stamps it with the case clock. Throws kiroku::Error when the source fails (a damaged line of a file:
  /// with its line and column); it has ended then.
  virtual std::optional<VitalLine> next() = 0;
  /// After next() gave nothing: for a source that waits for what arrives and may yet give more, the time
  /// before which nothing more will be stamped; nothing if it has ended.
  [[nodiscard]] virtual std::optional<std::int64_t> quiet_until_ns() const { return std::nullopt; }
  /// Makes next() end, from any thread (not from a signal handler). A source that waits for what arrives
  /// first gives what it had taken; all others end now.
  virtual void interrupt() noexcept = 0;
  /// Told of each patient whom what it gives names. Before next() is first called.
  virtual void hear_patients(std::shared_ptr<PatientWatch> /*watch*/) {}
  /// The case begins there, later than the recording did, which went ahead of it. From any thread.
  virtual void case_begins(std::int64_t /*begins_ns*/) {}
  /// Whether it waits for what arrives, rather than stating its own times.
  [[nodiscard]] virtual bool is_live() const { return false; }
  /// Connections and messages that were refused because of who sent them. From any thread.
  [[nodiscard]] virtual std::uint64_t refused() const { return 0; }
  /// Messages that are not recorded, or not all of them, because they are of other places. From any thread.
  [[nodiscard]] virtual std::uint64_t elsewhere() const { return 0; }
};

/// Opens `synthetic:patient?…` (synthetic_patient.h), a `.csv` file (csv_source.h), `mllp://…` or a `.hl7`
/// file (mllp_source.h) and checks as much as can be checked without reading all of it. `clock` must outlive
/// the source; it may be restarted until next() is first called. Throws kiroku::UsageError for an address
/// nothing here understands, kiroku::Error for a file that is absent or no such table.
std::unique_ptr<VitalSource> open_vital_source(const SourceAddress& address, const CaseClock& clock);

}  // namespace kiroku::recorder
