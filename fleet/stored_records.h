// Evidence records of cases in a store: <appliance>/evidence/<case>.ers, in all its versions. An appliance
// and its fleet may both put one; none is ever lost. Functions; one thread at a time.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "archive/format/file_reading.h"
#include "base/clock.h"
#include "evidence/record_verifier.h"
#include "fleet/fetcher.h"
#include "fleet/object_store.h"

namespace kiroku::fleet {

/// "or-1/evidence/20260805T091502Z-3f9c21ab.ers".
std::string record_key(const std::string& appliance, const std::string& case_id);

/// Every record that the store has of a case, each once, the newest version in front; of many versions those
/// of versions_to_try(), and no more than 256 MiB. Throws StoreError, kiroku::Error.
std::vector<Bytes> stored_records(ObjectStore& store, const std::string& appliance,
                                  const std::string& case_id);

/// Brings the record that counts (archive/verify/record_choice.h, by `rules`) to where kiroku-verify looks
/// for it beside the fetched case. Another one that lies there already stays, and a
/// remark says so; so does one of records that the store refuses. The case's files are read by `files`.
/// Throws StoreError, kiroku::Error, kiroku::IoError.
void fetch_record(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                  const evidence::JudgingRules& rules, FetchedCase& fetched,
                  const archive::FileReading& files = archive::real_reading());

/// Puts a record as a new version, locked as long and as firmly as the case's ledger and its records before,
/// and reads it back. Where nothing of these is locked any more, it is put without a lock. Throws StoreError,
/// kiroku::Error.
void put_record(ObjectStore& store, const std::string& appliance, const std::string& case_id, ByteView record,
                const Clock& clock = Clock::system());

}  // namespace kiroku::fleet
