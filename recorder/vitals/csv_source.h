// Vital signs from a table of comma-separated values (RFC 4180).
#pragma once

#include <memory>
#include <string>

#include "recorder/vitals/vital_source.h"

namespace kiroku::recorder {

/// Opens `FILE.csv`. Options: `speed=max`, `zero=start|first`.
///
/// The first line names the columns, in any order and case: `time`, `code`, `value`, `unit`, each once;
/// `quality` may be there; others are passed over. Fields may be quoted ("a ""b"" c", also over several
/// lines); a byte order mark, CR LF and lines with nothing in them are taken in stride. UTF-8.
///
///   time     seconds from the start with up to nine decimals ("12.5"), hh:mm:ss[.fff] from the start, or RFC
///   3339
///            in UTC; the first row decides, the others must look alike. RFC 3339 counts from the first row,
///            and becomes the sample's device_time; with zero=first the other two count from the first row,
///            too (for tables with times of day).
///   code     IEEE 11073-10101 reference identifier, or any name: it is passed on as it is
///   value    a decimal number; nothing for a quantity that was reported without one
///   unit     UCUM; nothing means the usual unit of a code that vital_codes.h knows, else unknown
///   quality  good (also if empty), questionable, invalid, missing
///
/// Throws kiroku::Error naming file, line and column: a column that is not there, something that is no number
/// or time, time going backwards, a field missing or left over, a quote not closed.
std::unique_ptr<VitalSource> open_csv_source(const SourceAddress& address);

}  // namespace kiroku::recorder
