// Where vital signs come from. A source is read by one thread and may be interrupted from another.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "media/vital_sample.h"

namespace kiroku::recorder {

struct SourceAddress;

using media::to_json_line;
using media::VitalSample;

class VitalSource {
 public:
  virtual ~VitalSource() = default;
  /// The next sample in order of time_ns, which counts from the case's zero; nothing at the end, and after
  /// interrupt(). A source that states its own times (file, synthetic) never waits: whoever records it at its
  /// own pace waits until the case clock shows time_ns. Throws kiroku::Error when the source fails (a damaged
  /// line of a file: with its line and column); it has ended then.
  virtual std::optional<VitalSample> next() = 0;
  /// Makes next() end now and always, from any thread (not from a signal handler).
  virtual void interrupt() noexcept = 0;
};

/// Opens `synthetic:patient?…` (synthetic_patient.h) or a `.csv` file (csv_source.h) and checks as much as
/// can be checked without reading all of it. Throws kiroku::UsageError for an address nothing here
/// understands, kiroku::Error for a file that is absent or no such table.
std::unique_ptr<VitalSource> open_vital_source(const SourceAddress& address);

}  // namespace kiroku::recorder
