#include "fleet/stored_copy.h"

#include <algorithm>
#include <vector>

#include "archive/format/case_layout.h"
#include "archive/reading/case_reader.h"
#include "archive/verify/found_files.h"
#include "crypto/encoding.h"

namespace kiroku::fleet {
namespace {

/// The reason why the object with this key does not count as holding these bytes.
std::optional<std::string> object_problem(ObjectStore& store, ShippingList& list, const std::string& key,
                                          std::uint64_t bytes, const std::string& sha256, UtcTime now) {
  const std::optional<ShippedObject> shipped = list.find(key);
  if (!shipped) return key + " is not in the store yet";
  const std::optional<StoredObject> stored = store.look(key, shipped->version);
  if (!stored) return key + " is not in the store any more";
  if (stored->bytes != bytes || stored->sha256 != sha256)
    return key + " in the store is not what was recorded";
  if (!stored->compliance || !stored->lock_ends || *stored->lock_ends <= now)
    return "nothing locks " + key + " in the store";
  return {};
}

}  // namespace

std::optional<std::string> why_not_stored(ObjectStore& store, ShippingList& list,
                                          const std::string& appliance,
                                          const std::filesystem::path& case_folder, const std::string& stream,
                                          UtcTime now) {
  const std::string prefix = appliance + "/" + case_folder.filename().string() + "/";
  const archive::CaseReader reader = archive::CaseReader::open(case_folder);
  const archive::FileReference ledger =
      archive::measure_file(archive::real_reading(), case_folder / archive::kLedgerFile);
  if (auto problem = object_problem(store, list, prefix + std::string(archive::kLedgerFile), ledger.bytes,
                                    crypto::to_hex(ledger.sha256), now))
    return problem;
  std::vector<archive::ErasedEntry> erased;
  reader.for_each([&](const archive::CaseEntry& entry) {
    if (const auto* gone = std::get_if<archive::ErasedEntry>(&entry.body)) erased.push_back(*gone);
  });
  for (const archive::SegmentEntry& segment : reader.segments(stream, INT64_MIN, INT64_MAX)) {
    const bool gone = std::ranges::any_of(erased, [&](const archive::ErasedEntry& each) {
      return each.stream == stream && each.first_index <= segment.index && segment.index <= each.last_index;
    });
    if (gone) continue;
    const archive::FileReference& stated = segment.file;
    if (auto problem = object_problem(store, list, prefix + stated.file, stated.bytes,
                                      crypto::to_hex(stated.sha256), now))
      return problem;
  }
  return {};
}

}  // namespace kiroku::fleet
