#include "fleet/catalogue/store_index.h"

#include <algorithm>
#include <map>

#include "archive/format/case_layout.h"
#include "archive/search/note_writer.h"
#include "base/error.h"
#include "crypto/hash.h"
#include "fleet/fetcher.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;
using archive::CaseStamp;

/// The versions of one case's objects as they are listed, in few bytes.
class Listing {
 public:
  void take(const ListedVersion& version) {
    const std::string line =
        version.key + "\n" + version.version + "\n" + std::to_string(version.bytes) + "\n";
    hash_.update(bytes_of(line));
    if (version.key.ends_with("/" + std::string(archive::kLedgerFile)) && version.newest)
      ledger_bytes_ = static_cast<std::int64_t>(version.bytes);
  }
  CaseStamp stamp() {
    const crypto::Sha256Digest digest = hash_.finish();
    CaseStamp stamp{ledger_bytes_, 0};
    std::uint64_t number = 0;
    for (std::size_t i = 0; i < sizeof number; ++i)
      number = number << 8U | std::to_integer<std::uint64_t>(digest[i]);
    stamp.changed = static_cast<std::int64_t>(number & INT64_MAX);  // the column is signed
    return stamp;
  }

 private:
  crypto::Sha256 hash_;
  std::int64_t ledger_bytes_ = -1;
};

/// The case that a key below `prefix` is of; "" where it is of none.
std::string case_of(const std::string& key, std::size_t prefix) {
  const std::string name = key.substr(prefix, key.find('/', prefix) - prefix);
  return archive::is_case_id(name) ? name : "";
}

}  // namespace

std::vector<std::string> appliances_in_store(ObjectStore& store) {
  std::vector<std::string> names = store.folders("");
  std::erase_if(names, [](const std::string& name) { return !archive::is_short_name(name); });
  std::ranges::sort(names);
  return names;
}

IndexReport index_appliance(ObjectStore& store, const std::string& appliance, archive::CaseTable& table,
                            const fs::path& scratch, bool anew) {
  std::map<std::string, CaseStamp> known = table.stamps();
  IndexReport report;
  std::map<std::string, CaseStamp> there, growing;
  // Keys come in their order, so that a case's objects stand together.
  const auto list = [&](const std::string& prefix) {
    std::string current;
    Listing listing;
    const auto finish = [&] {
      if (!current.empty()) there.emplace(current, listing.stamp());
      listing = Listing();
    };
    store.for_each_version(prefix, [&](const ListedVersion& version) {
      const std::string case_id = case_of(version.key, prefix.size());
      if (case_id != current) {
        finish();
        current = case_id;
      }
      if (!case_id.empty()) listing.take(version);
    });
    finish();
  };
  list(appliance + "/growing/");
  growing.swap(there);
  list(appliance + "/");
  for (const auto& [case_id, parts] : growing) {
    // While it is recorded its ledger grows in parts of their own; afterwards they stay, and say nothing new.
    const auto [row, is_new] = there.emplace(case_id, parts);
    if (!is_new && row->second.bytes < 0) row->second.changed ^= parts.changed;
  }
  report.cases = there.size();
  // What changed and cannot be read is no longer what was verified: nobody is to find the old verdict beside
  // it. The stamp is none of the store's, so that it is tried again each time.
  std::map<std::string, archive::CatalogueRow> rows;
  const auto leave_unreadable = [&](const std::string& case_id, const CaseStamp& stamp) {
    if (rows.empty()) {
      for (archive::CatalogueRow& row : table.rows()) rows.emplace(row.case_id, std::move(row));
    }
    const auto row = rows.find(case_id);
    if (row == rows.end()) return;  // it is new, and may be on its way
    row->second.state = "unreadable";
    table.put(row->second, {stamp.bytes, stamp.changed ^ 1});
  };
  for (const auto& [case_id, stamp] : there) {
    const auto before = known.extract(case_id);
    if (!anew && !before.empty() && before.mapped() == stamp) continue;
    const fs::path folder = scratch / case_id;
    fs::remove_all(folder);
    try {
      fetch_ledger(store, appliance, case_id, folder);
    } catch (const StoreError& error) {
      if (error.passes()) throw;
      report.problems.push_back(case_id + ": " + error.what());
      leave_unreadable(case_id, stamp);
      continue;
    } catch (const IoError&) {
      throw;
    } catch (const Error& error) {
      // What is wrong with one case keeps no other out of the catalogue.
      report.problems.push_back(case_id + ": " + error.what());
      leave_unreadable(case_id, stamp);
      continue;
    }
    table.put(archive::read_catalogue_row(case_id, folder), stamp);
    fs::remove_all(folder);
    ++report.read;
  }
  for (const auto& [case_id, stamp] : known) report.missing.push_back(case_id);
  if (!report.missing.empty()) {
    for (archive::CatalogueRow& row : table.rows()) {
      if (!std::ranges::binary_search(report.missing, row.case_id) || row.state == "missing") continue;
      row.state = "missing";
      table.put(row, {});  // with no stamp of anything: should it be there again, it is read again
    }
  }
  return report;
}

NotesReport index_notes(ObjectStore& store, const std::string& appliance, FleetCatalogue& catalogue,
                        bool anew) {
  constexpr std::size_t kMostProblems = 20;
  const std::map<std::string, std::string> known = catalogue.note_versions(appliance);
  const std::string prefix = appliance + "/" + std::string(search::kStoreFolder) + "/";
  std::vector<ListedVersion> changed;
  NotesReport report;
  const auto refuse = [&](const std::string& case_id, const std::string& why) {
    if (report.problems.size() == kMostProblems) {
      ++report.more_problems;
    } else {
      report.problems.push_back(case_id + ": " + why);
    }
  };
  store.for_each_version(prefix, [&](const ListedVersion& version) {
    const std::string case_id = search::case_of_note(version.key.substr(prefix.size()));
    if (case_id.empty() || !version.newest) return;
    ++report.notes;
    const auto before = known.find(case_id);
    if (anew || before == known.end() || before->second != version.version) changed.push_back(version);
  });
  for (const ListedVersion& each : changed) {
    const std::string case_id = search::case_of_note(each.key.substr(prefix.size()));
    std::string text;
    try {
      // More than a note has is neither fetched nor kept.
      if (each.bytes <= search::kMostNoteBytes)
        text = text_of(store.get(each.key, each.version, search::kMostNoteBytes));
    } catch (const StoreError& error) {
      if (error.passes()) throw;
      refuse(case_id, error.what());
      continue;  // it is asked for again
    }
    const std::optional<search::SearchNote> note = search::SearchNote::parse(text);
    if (!note || note->of.case_id != case_id) {
      refuse(case_id, "what the store has as its search note is none of this case");
      text.clear();
    }
    catalogue.put_note(appliance, case_id, each.version, text);
    ++report.read;
  }
  return report;
}

}  // namespace kiroku::fleet
