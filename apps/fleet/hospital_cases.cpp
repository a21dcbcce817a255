#include "apps/fleet/hospital_cases.h"

#include "apps/fleet/case_search.h"
#include "apps/fleet/page_place.h"
#include "apps/fleet/verified_cases.h"
#include "base/error.h"
#include "viewer/http/case_name.h"
#include "viewer/http/request.h"

namespace kiroku::apps {
namespace {

constexpr int kBadRequest = 400, kUnavailable = 503;
constexpr std::chrono::seconds kTryAgain{10};

/// What `work` gives; a store that is away is told so.
template <typename Work>
auto of_store(const Work& work) {
  try {
    return work();
  } catch (const fleet::StoreError& error) {
    if (!error.passes()) throw;
    throw viewer::Refusal(kUnavailable, error.what(), kTryAgain);
  }
}

/// Likewise a database.
template <typename Work>
auto of_database(const Work& work) {
  try {
    return work();
  } catch (const fleet::DatabaseError& error) {
    if (!error.passes()) throw;
    throw viewer::Refusal(kUnavailable, error.what(), kTryAgain);
  }
}

search::SearchWords words_of(const viewer::StoredCasesSubject& subject) {
  try {
    return search_words({subject.patient, subject.authority, subject.procedure, subject.coding_system},
                        {"'patient'", "'authority'", "'procedure'", "'coding_system'"});
  } catch (const UsageError& error) {
    throw viewer::Refusal(kBadRequest, error.what());
  }
}

viewer::StoredCase stored_case(fleet::FleetCase one) {
  return {std::move(one.appliance), std::move(one.row), one.alarm, std::move(one.unchecked)};
}

fleet::CaseQuery query_of(const viewer::StoredCasesQuestion& question) {
  fleet::CaseQuery query;
  query.appliance = question.appliance;
  query.state = question.state;
  query.verdict = question.verdict;
  query.unverified = question.unverified;
  query.needs_a_person = question.needs_a_person;
  query.opened_from = question.opened_from;
  query.opened_before = question.opened_before;
  query.limit = question.limit;
  if (question.after) {
    query.after = parse_page_place(*question.after);
    if (!query.after) throw viewer::Refusal(kBadRequest, "'after' is not what the page before ended with");
  }
  return query;
}

}  // namespace

HospitalCases::HospitalCases(const FleetConfiguration& configuration,
                             const std::optional<std::string>& scratch,
                             const std::optional<std::string>& search_key)
    : configuration_(configuration),
      scratch_parent_(scratch),
      catalogue_(configuration_.open_catalogue()),
      scratch_(scratch),
      store_([this] { return configuration_.open_store(); }),
      shelf_(scratch_.path() / "shelf", store_),
      has_search_key_(search_key.has_value()) {
  if (search_key) notes_.emplace(search::SiteKey::read(*search_key));
}

template <typename Work>
auto HospitalCases::with_catalogue(const Work& work) {
  const std::lock_guard guard(mutex_);
  try {
    if (!catalogue_) catalogue_.emplace(configuration_.open_catalogue());
    return work(*catalogue_);
  } catch (const fleet::DatabaseError& error) {
    catalogue_.reset();
    if (!error.passes()) throw;
    throw viewer::Refusal(kUnavailable, error.what(), kTryAgain);
  }
}

viewer::StoredCasesPage HospitalCases::list(const viewer::StoredCasesQuestion& question) {
  const fleet::CaseQuery query = query_of(question);
  std::vector<fleet::FleetCase> found =
      with_catalogue([&](fleet::FleetCatalogue& catalogue) { return catalogue.find(query); });
  viewer::StoredCasesPage page;
  if (found.size() == query.limit) page.next = page_place(found.back());
  for (fleet::FleetCase& each : found) page.cases.push_back(stored_case(std::move(each)));
  return page;
}

viewer::StoredCasesSearch HospitalCases::search(const viewer::StoredCasesQuestion& question,
                                                const viewer::StoredCasesSubject& subject) {
  const fleet::CaseQuery query = query_of(question);
  const search::SearchWords words = words_of(subject);
  const std::lock_guard guard(searching_);
  Searched searched = of_database([&] {
    // A connection of its own: lists do not wait until all notes are read.
    fleet::FleetCatalogue catalogue = configuration_.open_catalogue();
    return search_cases(catalogue, query, *notes_, words);
  });
  viewer::StoredCasesSearch result{{}, searched.looked_at, searched.without_note, searched.foreign};
  if (!searched.is_all) result.page.next = page_place(searched.found.back());
  for (fleet::FleetCase& each : searched.found) result.page.cases.push_back(stored_case(std::move(each)));
  return result;
}

std::vector<viewer::StoredAppliance> HospitalCases::appliances() {
  std::vector<viewer::StoredAppliance> all;
  for (const fleet::ApplianceTotals& each :
       with_catalogue([](fleet::FleetCatalogue& catalogue) { return catalogue.totals_by_appliance(); })) {
    const fleet::FleetTotals& of = each.totals;
    all.push_back({each.appliance, of.cases, of.bytes, of.open, of.unverified, of.alarms, of.incomplete,
                   of.unproven, of.unchecked, of.missing, of.unreadable, each.newest, each.seen});
  }
  return all;
}

std::optional<viewer::StoredCase> HospitalCases::row(const std::string& name) {
  const auto parts = viewer::parse_stored_case_name(name);
  if (!parts) return {};
  fleet::CaseQuery query;
  query.appliance = parts->first;
  query.case_id = parts->second;
  std::vector<fleet::FleetCase> found =
      with_catalogue([&](fleet::FleetCatalogue& catalogue) { return catalogue.find(query); });
  if (found.empty()) return {};
  return stored_case(std::move(found.front()));
}

std::optional<viewer::StoredCases::Found> HospitalCases::find(const std::string& name) {
  const auto parts = viewer::parse_stored_case_name(name);
  if (!parts) return {};
  auto place = of_store([&] { return shelf_.find(parts->first, parts->second); });
  if (!place) return {};
  using Proofs = fleet::CaseShelf::Place::Proofs;
  return Found{{std::move(place->folder), std::move(place->segments), std::move(place->ledger)},
               place->proofs == Proofs::kComing,
               place->proofs == Proofs::kMissing ? place->problem : std::string()};
}

archive::VerificationReport HospitalCases::verify(const std::filesystem::path& folder) {
  const std::lock_guard guard(judging_);
  if (!judge_) judge_.emplace(configuration_, scratch_parent_);
  const std::string appliance = folder.parent_path().filename().string();
  const std::string case_id = folder.filename().string();
  // As of now: the log must be newer than all that the case may name.
  archive::VerificationReport report = judge_->judge(appliance, case_id, utc_now());
  if (const fleet::Verification found = verification_of(report); found.alarm) {
    // Whoever asked reads the verdict; the hospital's lists must not go on saying another.
    try {
      with_catalogue([&](fleet::FleetCatalogue& catalogue) { catalogue.accuse(appliance, case_id, found); });
    } catch (const fleet::DatabaseError& error) {
      print_error("kiroku-fleet", appliance + "/" + case_id + " is " + found.verdict +
                                      ", and the catalogue could not be told: " + error.what());
    }
  }
  return report;
}

}  // namespace kiroku::apps
