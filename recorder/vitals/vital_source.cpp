#include "recorder/vitals/vital_source.h"

#include "base/error.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/csv_source.h"
#include "recorder/vitals/mllp_source.h"
#include "recorder/vitals/signal_file.h"
#include "recorder/vitals/synthetic_patient.h"

namespace kiroku::recorder {

std::unique_ptr<VitalSource> open_vital_source(const SourceAddress& address, const CaseClock& clock) {
  if (address.kind == SourceKind::kSynthetic && address.location == "patient") {
    return open_synthetic_patient(address);
  }
  if (address.kind == SourceKind::kMonitors) {
    return open_mllp_source(address, clock);
  }
  if (address.kind == SourceKind::kFile && address.location.ends_with(".csv")) {
    return open_csv_source(address);
  }
  if (address.kind == SourceKind::kFile && address.location.ends_with(".hl7")) {
    return open_hl7_file_source(address);
  }
  for (const char* const ending : {".edf", ".hea", ".vital"}) {
    if (address.kind == SourceKind::kFile && address.location.ends_with(ending)) {
      return open_signal_source(address);
    }
  }
  throw UsageError(
      "source '" + address.stated +
      "' gives no vital signs; give synthetic:patient, mllp://ADDRESS:PORT where monitors deliver, or "
      "the path of a .csv, .hl7, .edf, .hea (WFDB) or .vital file");
}

}  // namespace kiroku::recorder
