#include "fleet/stored_records.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <set>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/storage/file_system.h"
#include "archive/verify/case_evidence.h"
#include "archive/verify/record_choice.h"
#include "base/error.h"
#include "crypto/byte_source.h"
#include "crypto/file_hash.h"
#include "fleet/held_objects.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMostOfAll = std::uint64_t{256} << 20;

}  // namespace

std::string record_key(const std::string& appliance, const std::string& case_id) {
  return appliance + "/" + std::string(archive::kEvidenceFolder) + "/" + case_id + ".ers";
}

std::vector<Bytes> stored_records(ObjectStore& store, const std::string& appliance,
                                  const std::string& case_id) {
  const std::string key = record_key(appliance, case_id);
  std::vector<ListedVersion> versions;
  store.for_each_version(key, [&](const ListedVersion& each) {
    if (each.key != key || each.bytes > evidence::kMaximumRecordBytes) return;
    if (versions.size() == kMostVersions)
      throw Error("the store lists more than " + std::to_string(kMostVersions) + " versions of " + key);
    const bool is_first = each.newest && !versions.empty() && !versions.front().newest;
    versions.insert(is_first ? versions.begin() : versions.end(), each);
  });
  std::vector<Bytes> records;
  std::set<crypto::Sha256Digest> known;
  std::uint64_t all = 0;
  for (const ListedVersion& each : versions_to_try(std::move(versions))) {
    if (each.bytes > kMostOfAll - all) continue;
    Bytes bytes;
    try {
      bytes = store.get(each.key, each.version, static_cast<std::size_t>(each.bytes));
    } catch (const Error&) {
      // One that cannot be read says nothing of the others; a store that is away does not answer this.
      try {
        store.look(key, each.version);
      } catch (const StoreError& refusal) {
        if (!refusal.is_of_one_object()) throw;
      }
      continue;
    }
    if (!known.insert(crypto::sha256(bytes)).second) continue;
    all += bytes.size();
    records.push_back(std::move(bytes));
  }
  return records;
}

void fetch_record(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                  const evidence::JudgingRules& rules, FetchedCase& fetched,
                  const archive::FileReading& reading) {
  std::vector<Bytes> records;
  try {
    records = stored_records(store, appliance, case_id);
  } catch (const StoreError& error) {
    if (error.passes()) throw;
    fetched.remarks.push_back(std::string("its evidence records were not had: ") + error.what());
  }
  if (records.empty()) return;
  std::size_t chosen = 0;
  if (records.size() > 1) {
    try {
      const archive::RecordChoice choice =
          archive::choose_record(archive::CaseFolder::open(fetched.folder, reading), records, rules, {});
      chosen = choice.index;
      fetched.remarks.push_back("of its " + std::to_string(records.size()) +
                                " evidence records in the store " +
                                (choice.holds ? "the one was taken that holds and proves the earliest time"
                                              : "none was found to hold, and the likeliest was taken"));
    } catch (const IoError&) {
      throw;
    } catch (const Error& error) {
      fetched.remarks.push_back(
          std::string("which of its evidence records in the store holds was not found out: ") + error.what());
    }
  }
  archive::FileSystem& files = archive::real_file_system();
  const fs::path file = archive::evidence_file(fetched.folder, case_id);
  if (const auto there = archive::read_evidence_file(files, file)) {
    if (*there != records[chosen])
      fetched.remarks.push_back(file.string() +
                                " was there already, and is another than the store's: it was left, and the "
                                "case is judged with it; give another folder to have the store's");
    return;
  }
  if (!files.is_folder(file.parent_path())) files.make_folder(file.parent_path());
  files.write_durably(file, records[chosen]);
  ++fetched.objects;
  fetched.bytes += records[chosen].size();
}

void put_record(ObjectStore& store, const std::string& appliance, const std::string& case_id, ByteView record,
                const Clock& clock) {
  const std::string key = record_key(appliance, case_id);
  const std::string ledger = appliance + "/" + case_id + "/" + std::string(archive::kLedgerFile);
  PutLock lock = longest_lock(store, {ledger, key});
  if (lock.ends && *lock.ends <= clock.utc()) lock.ends.reset();
  const crypto::FileHash hash{record.size(), crypto::sha256(record)};
  const std::string version = store.put(key, *crypto::memory_source(record), hash.sha256, lock);
  require_held(store, key, version, hash, lock);
}

}  // namespace kiroku::fleet
