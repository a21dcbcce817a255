// Run beside a PostgreSQL server: tests/fleet/postgres.sh with fleet_catalogue_test.
#include "fleet/catalogue/fleet_catalogue.h"

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <future>
#include <set>
#include <thread>

#include "fleet/catalogue/fleet_reports.h"
#include "fleet/catalogue/lease_keeper.h"
#include "fleet/catalogue/renewal_board.h"
#include "tests/support/case_table_suite.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

using archive::CatalogueRow;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;
using namespace std::chrono_literals;

std::string administrator() {
  const char* const given = std::getenv("KIROKU_POSTGRES");
  if (given == nullptr) throw std::runtime_error("run by tests/fleet/postgres.sh with");
  return given;
}

/// A database of the test's own.
class OfItsOwn : public testing::Test {
 protected:
  OfItsOwn() {
    Postgres server(administrator());
    server.ask("CREATE DATABASE " + name_);
    Postgres database(connection());
    FleetCatalogue::prepare(database);
  }
  ~OfItsOwn() override { Postgres(administrator()).ask("DROP DATABASE " + name_ + " WITH (FORCE)"); }

  /// As the administrator, or as `user`.
  [[nodiscard]] std::string connection(const std::string& user = "administrator") const {
    return administrator() + " dbname=" + name_ + " user=" + user;
  }
  [[nodiscard]] FleetCatalogue catalogue() const { return FleetCatalogue(Postgres(connection())); }
  /// A person who has one of the roles.
  std::string with_role(const std::string& role) {
    Postgres database(connection());
    database.ask("CREATE ROLE " + user_of(role) + " LOGIN IN ROLE " + role);
    return user_of(role);
  }
  static void make_the_sixth_version(Postgres& database) {
    database.ask("DROP FUNCTION kiroku.accuse");
    database.ask("ALTER TABLE kiroku.cases DROP COLUMN not_renewed_since");
    database.ask("UPDATE kiroku.version SET version = 6");
  }
  static void make_the_fifth_version(Postgres& database) {
    make_the_sixth_version(database);
    database.ask("DROP TABLE kiroku.renewals");
    database.ask("UPDATE kiroku.version SET version = 5");
  }
  static void make_the_fourth_version(Postgres& database) {
    make_the_fifth_version(database);
    database.ask("DROP TABLE kiroku.search_notes");
    database.ask("UPDATE kiroku.version SET version = 4");
  }
  /// What such a catalogue has, as far as this program's has it otherwise.
  static void make_the_third_version(Postgres& database) {
    make_the_fourth_version(database);
    database.ask("DROP TABLE kiroku.certificates");
    database.ask(
        "ALTER TABLE kiroku.appliances DROP COLUMN earlier_runs, DROP COLUMN run_changes, DROP COLUMN "
        "replaced, DROP COLUMN replaced_shown, ADD COLUMN earlier_run text");
    database.ask("UPDATE kiroku.version SET version = 3");
  }
  [[nodiscard]] std::string user_of(const std::string& role) const { return name_ + "_" + role; }

 private:
  static std::string new_name() {
    static int number = 0;
    return "test_" + std::to_string(++number);
  }
  const std::string name_ = new_name();
};

class InPostgres : public OfItsOwn {
 protected:
  std::unique_ptr<archive::CaseTable> open() { return catalogue_.table_of("or-1"); }

 private:
  FleetCatalogue catalogue_ = catalogue();
};

}  // namespace
}  // namespace kiroku::fleet

namespace kiroku::archive {
namespace {
INSTANTIATE_TYPED_TEST_SUITE_P(Postgres, CaseTableSuite, fleet::InPostgres);
}  // namespace
}  // namespace kiroku::archive

namespace kiroku::fleet {
namespace {

class FleetCatalogueTest : public OfItsOwn {
 protected:
  void put(const std::string& appliance, const std::string& case_id, UtcTime opened,
           const std::string& state = "closed", std::int64_t changed = 0) {
    CatalogueRow row;
    row.case_id = case_id;
    row.opened = opened;
    row.state = state;
    if (state == "closed") row.duration_ns = 3'600'000'000'000;
    row.segments = 3;
    row.bytes = 1000;
    catalogue_.table_of(appliance)->put(row, {1, changed});
  }
  static constexpr std::chrono::hours kQuarter{24 * 91};
  static FleetCatalogue::Due due() { return {kQuarter, 0s, 0s}; }
  static UtcTime day(int number) { return *parse_utc("2026-08-01T00:00:00Z") + std::chrono::days(number); }
  std::vector<std::string> found(const CaseQuery& query) {
    std::vector<std::string> names;
    for (const FleetCase& each : catalogue_.find(query))
      names.push_back(each.appliance + "/" + each.row.case_id);
    return names;
  }
  static void expect_refused(const std::function<void()>& work, const std::string& why) {
    try {
      work();
      ADD_FAILURE() << "not refused";
    } catch (const DatabaseError& error) {
      EXPECT_THAT(error.what(), HasSubstr(why));
      EXPECT_FALSE(error.passes());
    }
  }

  FleetCatalogue catalogue_ = catalogue();
};

TEST_F(FleetCatalogueTest, IsAskedByApplianceTimeStateAndVerdict) {
  put("or-1", "a", day(1));
  put("or-1", "b", day(3), "open");
  put("or-2", "a", day(2));
  put("or-2", "c", day(4), "unreadable");
  for (std::optional<Lease> lease = catalogue_.lease({kQuarter, 0s, 600s}, 600s); lease;
       lease = catalogue_.lease({kQuarter, 0s, 600s}, 600s)) {
    if (lease->appliance == "or-2") catalogue_.enter(*lease, {"tampered", true, 1, ""});
  }
  EXPECT_THAT(found({}), ElementsAre("or-2/c", "or-1/b", "or-2/a", "or-1/a"));
  EXPECT_THAT(found({.appliance = "or-2"}), ElementsAre("or-2/c", "or-2/a"));
  EXPECT_THAT(found({.appliance = "or-2", .case_id = "a"}), ElementsAre("or-2/a"));
  EXPECT_THAT(found({.state = "open"}), ElementsAre("or-1/b"));
  EXPECT_THAT(found({.verdict = "tampered"}), ElementsAre("or-2/a"));
  EXPECT_THAT(found({.state = "closed", .unverified = true}), ElementsAre("or-1/a"));
  EXPECT_THAT(found({.opened_from = day(2), .opened_before = day(4)}), ElementsAre("or-1/b", "or-2/a"));
  EXPECT_THAT(catalogue_.appliances(), ElementsAre("or-1", "or-2"));
  const FleetTotals totals = catalogue_.totals();
  EXPECT_EQ(totals.cases, 4U);
  EXPECT_EQ(totals.segments, 12U);
  EXPECT_EQ(totals.bytes, 4000U);
  EXPECT_EQ(totals.open, 1U);
  EXPECT_EQ(totals.unreadable, 1U);
  EXPECT_EQ(totals.unverified, 3U);
  EXPECT_EQ(totals.unverified_closed, 1U);
  EXPECT_EQ(totals.unverified_unreadable, 1U);
  EXPECT_EQ(totals.alarms, 1U);
  const std::vector<ApplianceTotals> each = catalogue_.totals_by_appliance();
  ASSERT_EQ(each.size(), 2U);
  EXPECT_EQ(each[0].appliance, "or-1");
  EXPECT_EQ(each[0].totals.cases, 2U);
  EXPECT_EQ(each[0].totals.alarms, 0U);
  EXPECT_EQ(each[0].newest, day(3));
  EXPECT_EQ(each[1].totals.alarms, 1U);
  EXPECT_EQ(each[1].totals.unreadable, 1U);
  EXPECT_EQ(each[1].newest, day(4));
  EXPECT_THAT(found({.needs_a_person = true}), ElementsAre("or-2/c", "or-2/a"));
}

TEST_F(FleetCatalogueTest, GoesThroughItInPages) {
  // Many began in the same microsecond: no page may leave one out or have it twice.
  for (int i = 0; i < 25; ++i) put("or-" + std::to_string(i % 3), "case" + std::to_string(i), day(i / 10));
  std::vector<std::string> all = found({});
  ASSERT_EQ(all.size(), 25U);
  std::vector<std::string> paged;
  CaseQuery query{.limit = 4};
  for (;;) {
    const std::vector<FleetCase> page = catalogue_.find(query);
    for (const FleetCase& each : page) paged.push_back(each.appliance + "/" + each.row.case_id);
    if (page.size() < query.limit) break;
    query.after = {page.back().row.opened, page.back().appliance, page.back().row.case_id};
  }
  EXPECT_EQ(paged, all);
}

TEST_F(FleetCatalogueTest, LeasesEachDueCaseToOneWorker) {
  for (int i = 0; i < 60; ++i) put("or-1", "case" + std::to_string(i), day(i));
  put("or-1", "growing", day(0), "open");
  constexpr int kWorkers = 4;
  std::vector<std::future<std::vector<Lease>>> workers;
  for (int i = 0; i < kWorkers; ++i) {
    workers.push_back(std::async(std::launch::async, [this] {
      FleetCatalogue own = catalogue();
      std::vector<Lease> leases;
      while (std::optional<Lease> lease = own.lease({kQuarter, 0s, 600s}, 600s)) leases.push_back(*lease);
      return leases;
    }));
  }
  std::set<std::string> cases;
  std::size_t leased = 0;
  for (auto& worker : workers) {
    for (const Lease& lease : worker.get()) {
      cases.insert(lease.case_id);
      ++leased;
    }
  }
  EXPECT_EQ(leased, 60U);
  EXPECT_EQ(cases.size(), 60U);
  EXPECT_EQ(catalogue_.totals().being_verified, 60U);
}

TEST_F(FleetCatalogueTest, GivesSearchNotesBesideTheCasesThatAreAskedFor) {
  for (const char* id : {"a", "b", "c"}) put("or-1", id, day(1));
  put("or-2", "a", day(2));
  catalogue_.put_note("or-1", "a", "v1", "a note");
  catalogue_.put_note("or-1", "a", "v2", "its \"newest\" one\n");
  catalogue_.put_note("or-1", "b", "v1", "");
  catalogue_.put_note("or-1", "of no case", "v1", "another");
  std::map<std::string, std::optional<std::string>> notes;
  for (const FleetCase& each : catalogue_.find({.with_notes = true}))
    notes[each.appliance + "/" + each.row.case_id] = each.search_note;
  EXPECT_EQ(notes, (std::map<std::string, std::optional<std::string>>{
                       {"or-1/a", "its \"newest\" one\n"}, {"or-1/b", ""}, {"or-1/c", {}}, {"or-2/a", {}}}));
  for (const FleetCase& each : catalogue_.find({})) EXPECT_FALSE(each.search_note) << "nobody asked for it";
  EXPECT_EQ(catalogue_.find({.appliance = "or-2", .with_notes = true}).size(), 1U);
  EXPECT_EQ(catalogue_.note_versions("or-1"),
            (std::map<std::string, std::string>{{"a", "v2"}, {"b", "v1"}, {"of no case", "v1"}}));
  EXPECT_THAT(catalogue_.note_versions("or-2"), IsEmpty());
}

TEST_F(FleetCatalogueTest, ACatalogueOfBeforeGetsATableForSearchNotes) {
  put("or-1", "a", day(1));
  Postgres database(connection());
  make_the_fourth_version(database);
  EXPECT_THAT([&] { (void)catalogue(); }, ThrowsMessage<UsageError>(HasSubstr("kiroku-fleet init")));
  FleetCatalogue::prepare(database);
  FleetCatalogue again = catalogue();
  EXPECT_EQ(again.find({.with_notes = true}).size(), 1U);
  FleetCatalogue indexer(Postgres(connection(with_role("kiroku_indexer"))));
  indexer.put_note("or-1", "a", "v1", "a note");
  indexer.put_note("or-1", "a", "v2", "another");
  FleetCatalogue reader(Postgres(connection(with_role("kiroku_reader"))));
  EXPECT_EQ(reader.find({.with_notes = true}).at(0).search_note, "another");
  expect_refused([&] { reader.put_note("or-1", "a", "v3", "a third"); }, "permission denied");
}

TEST_F(FleetCatalogueTest, TheLongestWaitingComesFirst) {
  for (const char* id : {"never", "old", "older", "fresh"}) put("or-1", id, day(1));
  const auto table = catalogue_.table_of("or-1");
  table->set_verdict("fresh", "intact", day(100));
  table->set_verdict("old", "intact", day(20));
  table->set_verdict("older", "intact", day(10));
  for (const char* expected : {"never", "older", "old"}) {
    const std::optional<Lease> lease = catalogue_.lease({day(50), 0s, 0s}, 600s);
    ASSERT_TRUE(lease);
    EXPECT_EQ(lease->case_id, expected);
  }
  EXPECT_FALSE(catalogue_.lease({day(50), 0s, 0s}, 600s));
}

TEST_F(FleetCatalogueTest, ACaseThatChangedJustNowWaitsForItsLog) {
  put("or-1", "a", day(1));
  EXPECT_FALSE(catalogue_.lease({kQuarter, 600s, 600s}, 600s));
  EXPECT_TRUE(catalogue_.lease({kQuarter, 0s, 600s}, 600s));
}

TEST_F(FleetCatalogueTest, NothingThatALedgerClaimsPutsItsVerificationOffOrStopsOthers) {
  CatalogueRow row;
  row.case_id = "future";
  row.opened = *parse_utc("9999-12-31T23:59:59.999999Z");
  row.duration_ns = INT64_MAX;
  row.state = "closed";
  row.segments = row.bytes = row.tokens = UINT64_MAX;
  catalogue_.table_of("or-1")->put(row, {INT64_MAX, INT64_MIN});
  row.case_id = "past";
  row.opened = *parse_utc("0001-01-01T00:00:00Z");
  row.duration_ns = INT64_MIN;
  catalogue_.table_of("or-1")->put(row, {1, 2});
  EXPECT_THAT(found({}), ElementsAre("or-1/future", "or-1/past"));
  EXPECT_GT(catalogue_.totals().bytes, 1U);
  std::set<std::string> leased;
  while (const std::optional<Lease> lease = catalogue_.lease({kQuarter, 0s, 600s}, 600s))
    leased.insert(lease->case_id);
  EXPECT_THAT(leased, ElementsAre("future", "past"));
}

TEST_F(FleetCatalogueTest, WhoeverChangesACaseAgainAndAgainPutsNothingOff) {
  put("or-1", "a", day(1));
  for (std::int64_t change = 1; change < 4; ++change) put("or-1", "a", day(1), "closed", change);
  // It has not settled, and is long enough without a verdict.
  EXPECT_FALSE(catalogue_.lease({kQuarter, 600s, 600s}, 600s));
  const std::optional<Lease> lease = catalogue_.lease({kQuarter, 600s, 0s}, 600s);
  ASSERT_TRUE(lease);
  // What is changed under a lease is free for the next one at once.
  put("or-1", "a", day(1), "closed", 9);
  EXPECT_TRUE(catalogue_.lease({kQuarter, 600s, 0s}, 600s));
}

TEST_F(FleetCatalogueTest, AnAlarmStandsUntilAVerificationSaysOtherwise) {
  put("or-1", "a", day(1));
  EXPECT_TRUE(catalogue_.enter(*catalogue_.lease(due(), 600s), {"tampered", true, 1, "no"}));
  put("or-1", "a", day(1), "closed", 7);
  EXPECT_EQ(catalogue_.find({})[0].row.last_verdict, std::nullopt);
  EXPECT_TRUE(catalogue_.find({})[0].alarm);
  EXPECT_EQ(catalogue_.totals().alarms, 1U);
  EXPECT_TRUE(catalogue_.enter(*catalogue_.lease(due(), 600s), {"intact", false, 0, ""}));
  EXPECT_EQ(catalogue_.totals().alarms, 0U);
}

TEST_F(FleetCatalogueTest, WhatIsNotProvenNeedsAPersonAndRaisesNoAlarm) {
  put("or-1", "cut-off", day(1));
  put("or-1", "whole", day(2));
  put("or-1", "without-a-root", day(3));
  while (const std::optional<Lease> lease = catalogue_.lease(due(), 600s)) {
    const char* verdict = lease->case_id == "cut-off"          ? "incomplete"
                          : lease->case_id == "without-a-root" ? "unproven"
                                                               : "intact";
    EXPECT_TRUE(catalogue_.enter(*lease, {verdict, false, 1, ""}));
  }
  EXPECT_THAT(found({.needs_a_person = true}), ElementsAre("or-1/without-a-root", "or-1/cut-off"));
  const FleetTotals totals = catalogue_.totals();
  EXPECT_EQ(totals.alarms, 0U);
  EXPECT_EQ(totals.incomplete, 1U);
  EXPECT_EQ(totals.unproven, 1U);
  // What changed since is not verified as it is now, though its history knows more.
  put("or-1", "cut-off", day(1), "closed", 7);
  EXPECT_THAT(found({.needs_a_person = true}), ElementsAre("or-1/without-a-root"));
  EXPECT_THAT(found({.unverified = true}), ElementsAre("or-1/cut-off"));
  EXPECT_EQ(catalogue_.totals().unverified, 1U);
  EXPECT_EQ(catalogue_.verifications("or-1", "cut-off").size(), 1U);
}

TEST_F(FleetCatalogueTest, ACaseIsDueAgainByTheDatabasesClock) {
  put("or-1", "a", day(1));
  const UtcTime before = catalogue_.now();
  EXPECT_TRUE(catalogue_.enter(*catalogue_.lease(due(), 600s), {"intact", false, 0, ""}));
  const std::optional<UtcTime> verified = catalogue_.find({})[0].row.verified;
  ASSERT_TRUE(verified);
  EXPECT_GE(*verified, before);
  EXPECT_LE(*verified, catalogue_.now());
  // Neither after a time, nor for whoever asks for all that this run has not verified.
  EXPECT_FALSE(catalogue_.lease(due(), 600s));
  EXPECT_FALSE(catalogue_.lease({before, 0s, 0s}, 600s));
  Postgres(connection()).ask("UPDATE kiroku.cases SET verified = now() - interval '90 days'");
  EXPECT_FALSE(catalogue_.lease(due(), 600s));
  Postgres(connection()).ask("UPDATE kiroku.cases SET verified = now() - interval '92 days'");
  EXPECT_TRUE(catalogue_.lease(due(), 600s));
}

TEST_F(FleetCatalogueTest, ALeaseIsExtendedUntilAnotherHasIt) {
  put("or-1", "a", day(1));
  const Lease first = *catalogue_.lease(due(), 0s);
  EXPECT_EQ(catalogue_.held_elsewhere(due()), 0U) << "its time is over";
  EXPECT_TRUE(catalogue_.extend(first, 600s));
  EXPECT_FALSE(catalogue_.lease(due(), 600s));
  EXPECT_EQ(catalogue_.held_elsewhere(due()), 1U);
  EXPECT_TRUE(catalogue_.extend(first, 0s));
  const Lease second = *catalogue_.lease(due(), 600s);
  EXPECT_FALSE(catalogue_.extend(first, 600s));
  EXPECT_FALSE(catalogue_.enter(first, {"intact", false, 0, ""}));
  EXPECT_TRUE(catalogue_.enter(second, {"intact", false, 0, ""}));
  EXPECT_EQ(catalogue_.held_elsewhere(due()), 0U);
  EXPECT_FALSE(catalogue_.extend(second, 600s));
}

TEST_F(FleetCatalogueTest, ALeaseLastsAsLongAsItIsKept) {
  put("or-1", "a", day(1));
  const Lease lease = *catalogue_.lease(due(), 0s);
  // The database is away at first.
  int tries = 0;
  const std::function<FleetCatalogue()> open = [&] {
    return ++tries < 3 ? FleetCatalogue(Postgres("host=/nowhere")) : catalogue();
  };
  {
    const LeaseKeeper keeper(lease, open, 1ms);
    while (catalogue_.held_elsewhere(due()) == 0) std::this_thread::yield();
  }
  EXPECT_EQ(tries, 3);
  EXPECT_FALSE(catalogue_.lease(due(), 600s));
  EXPECT_TRUE(catalogue_.enter(lease, {"intact", false, 0, ""}));
}

TEST_F(FleetCatalogueTest, AlarmsOfACatalogueOfTheSecondVersionAreOfWhatIsNotIntactAlone) {
  // That version raised an alarm for whatever is not intact for certain.
  for (const char* id : {"changed", "incomplete", "tampered", "unchecked", "unproven"})
    put("or-1", id, day(1));
  while (const std::optional<Lease> lease = catalogue_.lease(due(), 600s)) {
    const bool is_named = lease->case_id == "incomplete" || lease->case_id == "tampered";
    EXPECT_TRUE(catalogue_.enter(*lease, {is_named ? lease->case_id : "unproven", true, 1, ""}));
  }
  put("or-1", "changed", day(1), "closed", 7);
  put("or-1", "unchecked", day(1), "closed", 7);
  while (const std::optional<Lease> lease = catalogue_.lease(due(), 600s)) {
    if (lease->case_id == "unchecked") catalogue_.give_back(*lease, 600s, "its key was missing");
  }
  Postgres database(connection());
  make_the_third_version(database);
  database.ask("UPDATE kiroku.version SET version = 2");
  EXPECT_THAT([&] { (void)catalogue(); }, ThrowsMessage<UsageError>(HasSubstr("kiroku-fleet init")));
  FleetCatalogue::prepare(database);
  std::set<std::string> alarms;
  for (const FleetCase& each : catalogue().find({})) {
    if (each.alarm) alarms.insert(each.row.case_id);
  }
  EXPECT_THAT(alarms, ElementsAre("tampered"));
}

TEST_F(FleetCatalogueTest, WhatWasCutOffOrCannotBeReadIsVerifiedOnceItsTimeIsOver) {
  put("or-1", "open", day(1), "open");
  put("or-1", "unreadable", day(2), "unreadable");
  put("or-1", "missing", day(0), "missing");
  EXPECT_FALSE(catalogue_.lease({kQuarter, 0s, 600s}, 600s));
  const std::optional<Lease> cut_off = catalogue_.lease(due(), 600s);
  ASSERT_TRUE(cut_off);
  EXPECT_EQ(cut_off->case_id, "open");
  EXPECT_TRUE(catalogue_.enter(*cut_off, {"incomplete", false, 1, "it has no end"}));
  const std::optional<Lease> other = catalogue_.lease(due(), 600s);
  ASSERT_TRUE(other);
  EXPECT_EQ(other->case_id, "unreadable");
  EXPECT_FALSE(catalogue_.lease(due(), 600s));
}

TEST_F(FleetCatalogueTest, WhatADeadWorkerHeldIsAnothersAndItsVerdictCountsNoMore) {
  put("or-1", "a", day(1));
  const std::optional<Lease> dead = catalogue_.lease(due(), 0s);
  ASSERT_TRUE(dead);
  const std::optional<Lease> next = catalogue_.lease(due(), 600s);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->case_id, "a");
  EXPECT_FALSE(catalogue_.enter(*dead, {"intact", false, 0, ""}));
  EXPECT_THAT(catalogue_.verifications("or-1", "a"), IsEmpty());
  EXPECT_TRUE(catalogue_.enter(*next, {"tampered", true, 2, "segment 3 is not there"}));
  EXPECT_FALSE(catalogue_.enter(*next, {"intact", false, 0, ""}));
  const std::vector<FleetCase> rows = catalogue_.find({});
  EXPECT_EQ(rows[0].row.last_verdict, "tampered");
  const std::vector<EnteredVerification> all = catalogue_.verifications("or-1", "a");
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].findings, 2U);
  EXPECT_EQ(all[0].when, rows[0].row.verified);
  EXPECT_EQ(all[0].detail, "segment 3 is not there");
}

TEST_F(FleetCatalogueTest, NoVerdictIsEnteredOfACaseThatChangedMeanwhile) {
  put("or-1", "a", day(1));
  const std::optional<Lease> lease = catalogue_.lease(due(), 600s);
  ASSERT_TRUE(lease);
  put("or-1", "a", day(1), "closed", 7);
  EXPECT_FALSE(catalogue_.enter(*lease, {"intact", false, 0, ""}));
  EXPECT_EQ(catalogue_.find({})[0].row.last_verdict, std::nullopt);
}

TEST_F(FleetCatalogueTest, WhatIsGivenBackIsDueAgain) {
  put("or-1", "a", day(1));
  const std::optional<Lease> lease = catalogue_.lease(due(), 600s);
  ASSERT_TRUE(lease);
  catalogue_.give_back(*lease, 600s, "the store was away");
  EXPECT_FALSE(catalogue_.lease(due(), 600s)) << "it rests";
  put("or-1", "b", day(2));
  const std::optional<Lease> other = catalogue_.lease(due(), 600s);
  ASSERT_TRUE(other);
  catalogue_.give_back(*other, 0s, "again");
  EXPECT_TRUE(catalogue_.lease(due(), 600s));
  catalogue_.give_back(*other, 0s, "the lease is another's");
  const std::vector<EnteredVerification> all = catalogue_.verifications("or-1", "b");
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].verdict, "could-not-check");
  EXPECT_EQ(all[0].detail, "again");
  EXPECT_EQ(catalogue_.find({})[0].row.last_verdict, std::nullopt);
  EXPECT_EQ(catalogue_.find({.needs_a_person = true})[0].unchecked, "again");
  EXPECT_EQ(catalogue_.totals().unchecked, 2U);
}

TEST_F(FleetCatalogueTest, WhoAsksForAllWaitsForNoPauseAndTakesNoLease) {
  put("or-1", "a", day(1));
  put("or-1", "b", day(2));
  const std::optional<Lease> paused = catalogue_.lease(due(), 600s), held = catalogue_.lease(due(), 600s);
  ASSERT_TRUE(paused && held);
  catalogue_.give_back(*paused, 600s, "its key was missing");
  catalogue_.end_pauses();
  const std::optional<Lease> again = catalogue_.lease(due(), 600s);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->case_id, paused->case_id);
  EXPECT_FALSE(catalogue_.lease(due(), 600s)) << "the other is leased";
}

TEST_F(FleetCatalogueTest, EachRoleMayDoItsPartAlone) {
  put("or-1", "a", day(1));
  FleetCatalogue reader(Postgres(connection(with_role("kiroku_reader"))));
  FleetCatalogue indexer(Postgres(connection(with_role("kiroku_indexer"))));
  FleetCatalogue verifier(Postgres(connection(with_role("kiroku_verifier"))));
  EXPECT_EQ(reader.find({}).size(), 1U);
  CatalogueRow row = reader.find({})[0].row;
  expect_refused([&] { reader.table_of("or-1")->put(row, {}); }, "kiroku-fleet init");
  expect_refused([&] { reader.lease(due(), 600s); }, "permission denied");
  expect_refused([&] { verifier.table_of("or-1")->put(row, {}); }, "permission denied");
  expect_refused([&] { verifier.table_of("or-1")->remove("a"); }, "permission denied");
  EXPECT_NO_THROW(indexer.table_of("or-1")->put(row, {}));
  expect_refused([&] { indexer.table_of("or-1")->remove("a"); }, "permission denied");
  expect_refused([&] { indexer.table_of("or-1")->set_verdict("a", "intact", day(1)); }, "permission denied");
  const std::optional<Lease> lease = verifier.lease(due(), 600s);
  ASSERT_TRUE(lease);
  expect_refused([&] { indexer.enter(*lease, {"intact", false, 0, ""}); }, "permission denied");
  EXPECT_TRUE(verifier.enter(*lease, {"intact", false, 0, ""}));
  // What was found once nobody takes back.
  for (const char* role : {"kiroku_indexer", "kiroku_verifier"}) {
    Postgres database(connection(user_of(role)));
    expect_refused([&] { database.ask("UPDATE kiroku.verifications SET verdict = 'tampered'"); },
                   "permission denied");
    expect_refused([&] { database.ask("DELETE FROM kiroku.verifications"); }, "permission denied");
  }
}

TEST_F(FleetCatalogueTest, WhatAReaderFindsStandsUntilTheCaseIsVerifiedAnew) {
  put("or-1", "a", day(1));
  Postgres database(connection());
  make_the_sixth_version(database);
  EXPECT_THAT([&] { (void)catalogue(); }, ThrowsMessage<UsageError>(HasSubstr("kiroku-fleet init")));
  FleetCatalogue::prepare(database);
  FleetCatalogue reader(Postgres(connection(with_role("kiroku_reader"))));
  FleetCatalogue indexer(Postgres(connection(with_role("kiroku_indexer"))));
  FleetCatalogue verifier(Postgres(connection(with_role("kiroku_verifier"))));
  const auto verify = [&] {
    const std::optional<Lease> lease = verifier.lease(due(), 600s);
    return lease && verifier.enter(*lease, {"intact", false, 0, ""});
  };
  EXPECT_TRUE(verify());
  EXPECT_FALSE(verifier.lease(due(), 600s)) << "nothing is due";
  reader.accuse("or-1", "a", {"tampered", true, 2, "a segment is another"});
  EXPECT_THAT(found({.needs_a_person = true}), ElementsAre("or-1/a"));
  EXPECT_FALSE(catalogue_.find({})[0].row.last_verdict);
  // Who verifies it at this moment may have read it before.
  const std::optional<Lease> before = verifier.lease(due(), 600s);
  ASSERT_TRUE(before);
  verifier.accuse("or-1", "a", {"could-not-check", false, 0, "its record was not renewed"});
  EXPECT_FALSE(verifier.enter(*before, {"intact", false, 0, ""}));
  EXPECT_TRUE(catalogue_.find({})[0].alarm) << "a doubt takes no alarm back";
  EXPECT_TRUE(verify());
  EXPECT_THAT(found({.needs_a_person = true}), IsEmpty());
  // It brings no verdict that is good, and whoever may not accuse does not.
  reader.accuse("or-1", "a", {"intact", true, 0, ""});
  EXPECT_EQ(catalogue_.verifications("or-1", "a").back().verdict, "tampered");
  expect_refused([&] { indexer.accuse("or-1", "a", {"tampered", true, 1, ""}); }, "permission denied");
  reader.accuse("or-1", "none", {"tampered", true, 1, ""});
  EXPECT_THAT(catalogue_.verifications("or-1", "none"), IsEmpty());
}

TEST_F(FleetCatalogueTest, ADatabaseWithoutOneOfAnotherVersionOrAwayIsToldOf) {
  try {
    FleetCatalogue none{Postgres(administrator())};
    FAIL() << "opened";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("run 'kiroku-fleet init'"));
  }
  Postgres database(connection());
  EXPECT_NO_THROW(FleetCatalogue::prepare(database)) << "again";
  database.ask("UPDATE kiroku.version SET version = 99");
  EXPECT_THROW(FleetCatalogue::prepare(database), UsageError);
  EXPECT_THROW(static_cast<void>(catalogue()), UsageError);
  try {
    Postgres away("host=/nowhere dbname=x");
    FAIL() << "connected";
  } catch (const DatabaseError& error) {
    EXPECT_TRUE(error.passes());
    EXPECT_THAT(error.what(), HasSubstr("cannot reach PostgreSQL"));
  }
}

// Whose evidence record is to be looked at.
class RenewalBoardTest : public FleetCatalogueTest {
 protected:
  RenewalBoard board(const std::string& user = "administrator") {
    return RenewalBoard(Postgres(connection(user)));
  }
  /// Of a run that begins now.
  RenewalBoard::Due run(const std::string& judged_by = "rules") {
    return {board_.now(), 0s, judged_by, 91 * 24h, false};
  }
  std::vector<std::string> leased(const RenewalBoard::Due& of, const std::string& holder = "one",
                                  std::size_t most = 100) {
    std::vector<std::string> names;
    for (const RenewalTurn& each : board_.lease(of, most, holder, 600s))
      names.push_back(each.appliance + "/" + each.case_id);
    std::ranges::sort(names);
    return names;
  }
  static RenewalFound nothing_due(const std::string& case_id, std::optional<UtcTime> renew_from = {}) {
    RenewalFound found;
    found.appliance = "or-1";
    found.case_id = case_id;
    found.what = "nothing-due";
    found.renew_from = renew_from;
    found.record = "ab";
    return found;
  }

  RenewalBoard board_ = board();
};

TEST_F(RenewalBoardTest, EachRunLooksOnceAtWhatIsDue) {
  put("or-1", "a", day(1));
  put("or-1", "b", day(2));
  put("or-2", "a", day(3), "open");
  const RenewalBoard::Due first = run();
  EXPECT_THAT(leased(first), ElementsAre("or-1/a", "or-1/b"));
  EXPECT_TRUE(board_.enter("one", "rules", nothing_due("a")));
  RenewalFound waits = nothing_due("b");
  waits.again = true;
  EXPECT_TRUE(board_.enter("one", "rules", waits));
  EXPECT_FALSE(board_.enter("one", "rules", waits)) << "the lease has ended";
  EXPECT_THAT(leased(first), IsEmpty()) << "this run has looked at both";
  // The next run looks at what was left undone, and gives the record that was known.
  const std::vector<RenewalTurn> next = board_.lease(run(), 100, "two", 600s);
  ASSERT_EQ(next.size(), 1U);
  EXPECT_EQ(next[0].case_id, "b");
  EXPECT_EQ(next[0].record, "ab");
  EXPECT_TRUE(board_.enter("two", "rules", nothing_due("b")));
  EXPECT_THAT(leased(run()), IsEmpty());
  // Another policy, a record that is due by now, a case that changed.
  EXPECT_THAT(leased(run("others"), "three"), ElementsAre("or-1/a", "or-1/b"));
  EXPECT_TRUE(board_.enter("three", "others", nothing_due("a", board_.now() - 1s)));
  EXPECT_TRUE(board_.enter("three", "others", nothing_due("b", board_.now() + 1h)));
  EXPECT_THAT(leased(run("others"), "four"), ElementsAre("or-1/a"));
  EXPECT_TRUE(board_.enter("four", "others", nothing_due("a")));
  put("or-1", "b", day(2), "closed", 7);
  EXPECT_THAT(leased(run("others"), "five"), ElementsAre("or-1/b"));
  board_.give_back("five");
  RenewalBoard::Due all = run("others");
  all.all = true;
  EXPECT_EQ(board_.look(all).size(), 2U);
  RenewalBoard::Due seldom = run("others");
  seldom.every = 0s;
  EXPECT_EQ(board_.look(seldom).size(), 2U);
}

TEST_F(RenewalBoardTest, WorkersShareTheCasesAndNoneIsTwoWorkers) {
  for (int i = 0; i < 60; ++i) put("or-1", "case" + std::to_string(i), day(i));
  const RenewalBoard::Due due = run();
  std::vector<std::future<std::vector<RenewalTurn>>> workers;
  for (int i = 0; i < 4; ++i) {
    workers.push_back(std::async(std::launch::async, [this, &due, i] {
      RenewalBoard own = board();
      std::vector<RenewalTurn> turns;
      for (;;) {
        const auto more = own.lease(due, 7, "worker" + std::to_string(i), 600s);
        if (more.empty()) return turns;
        turns.insert(turns.end(), more.begin(), more.end());
      }
    }));
  }
  std::set<std::string> cases;
  std::size_t count = 0;
  for (auto& worker : workers) {
    for (const RenewalTurn& each : worker.get()) {
      cases.insert(each.case_id);
      ++count;
    }
  }
  EXPECT_EQ(count, 60U);
  EXPECT_EQ(cases.size(), 60U);
  EXPECT_EQ(board_.held_elsewhere(due), 60U);
  int holders = 0;
  for (int i = 0; i < 4; ++i) holders += board_.extend("worker" + std::to_string(i), 600s) ? 1 : 0;
  EXPECT_GE(holders, 1);
  EXPECT_FALSE(board_.extend("a stranger", 600s));
}

TEST_F(RenewalBoardTest, WhatAKilledWorkerHeldIsFreeAgain) {
  put("or-1", "a", day(1));
  ASSERT_EQ(board_.lease(run(), 10, "killed", 0s).size(), 1U);
  EXPECT_THAT(leased(run(), "another"), ElementsAre("or-1/a"));
  EXPECT_FALSE(board_.enter("killed", "rules", nothing_due("a"))) << "it is the other's by now";
  EXPECT_TRUE(board_.enter("another", "rules", nothing_due("a")));
}

TEST_F(RenewalBoardTest, VerifiersMayRenewAndOthersLook) {
  put("or-1", "a", day(1));
  RenewalBoard reader = board(with_role("kiroku_reader"));
  EXPECT_EQ(reader.look(run()).size(), 1U);
  expect_refused([&] { reader.lease(run(), 1, "x", 600s); }, "permission denied");
  RenewalBoard verifier = board(with_role("kiroku_verifier"));
  EXPECT_EQ(verifier.lease(run(), 1, "x", 600s).size(), 1U);
  EXPECT_TRUE(verifier.enter("x", "rules", nothing_due("a")));
}

TEST_F(RenewalBoardTest, ACatalogueOfBeforeGetsATableForRenewals) {
  put("or-1", "a", day(1));
  Postgres database(connection());
  make_the_fifth_version(database);
  EXPECT_THAT([&] { (void)board(); }, ThrowsMessage<UsageError>(HasSubstr("kiroku-fleet init")));
  FleetCatalogue::prepare(database);
  EXPECT_EQ(board().look(run()).size(), 1U);
}

TEST_F(RenewalBoardTest, WhatIsOpenAgainAndAgainIsCountedThoughItJustChanged) {
  put("or-1", "a", day(1));
  catalogue_.enter(*catalogue_.lease(due(), 600s), {"intact", false, 0, ""});
  put("or-1", "a", day(1), "open", 7);
  EXPECT_EQ(board_.out_of_reach(), 0U) << "it may be on its way";
  Postgres(connection())
      .ask("UPDATE kiroku.cases SET not_renewed_since = not_renewed_since - interval '3 days'");
  // Nor does a change end that.
  put("or-1", "a", day(1), "open", 8);
  EXPECT_EQ(board_.out_of_reach(), 1U);
}

// Who may report, and what each said last.
class FleetReportsTest : public OfItsOwn {
 protected:
  FleetReports reports(const std::string& user = "administrator") {
    return FleetReports(Postgres(connection(user)));
  }
  PendingEnrolment asked(const std::string& name) {
    PendingEnrolment one;
    one.id = std::to_string(++asked_);
    one.appliance = name;
    one.request_pem = make_certificate_request(name).request_pem;
    return one;
  }
  std::string issued(const PendingEnrolment& one) {
    return authority_.issue(one.request_pem, utc_now(), 1000h);
  }
  static std::string print_of(const std::string& pem) { return facts_of_certificate_pem(pem).fingerprint; }
  /// The fingerprint with which it may report.
  std::string enrol(FleetReports& all, const std::string& name) {
    const PendingEnrolment one = asked(name);
    all.ask(one, "192.0.2.1");
    const std::string pem = issued(one);
    all.admit(one, pem, "anna");
    return print_of(pem);
  }
  /// Renewed by whoever has this one, and used.
  std::string renewed(FleetReports& all, const std::string& name, const std::string& fingerprint) {
    const CertificateFacts next = facts_of_certificate_pem(issued(asked(name)));
    EXPECT_FALSE(all.renew(name, fingerprint, next));
    EXPECT_FALSE(all.take(name, next.fingerprint, said('c')));
    return next.fingerprint;
  }
  static ApplianceReport said(char run = 'a') {
    ApplianceReport report;
    report.program = "0.1.0";
    report.run = std::string(32, run);
    report.now = utc_now();
    return report;
  }

 private:
  test::TemporaryFolder folder_;
  int asked_ = 0;
  const FleetAuthority authority_ = FleetAuthority::open_or_make(folder_.path() / "authority", utc_now());
};

TEST_F(FleetReportsTest, AReportIsARowThatAnotherServerSees) {
  const std::string reporter = with_role("kiroku_reporter"), reader = with_role("kiroku_reader");
  FleetReports one = reports(reporter);
  const std::string print = enrol(one, "or-1");
  EXPECT_FALSE(one.take("or-1", print, said()));
  const std::vector<EnrolledAppliance> seen = reports(reader).appliances();
  ASSERT_EQ(seen.size(), 1U);
  EXPECT_TRUE(seen[0].heard);
  EXPECT_EQ(seen[0].enrolled_by, "anna");
  EXPECT_THAT([&] { reports(reader).take("or-1", print, said()); },
              ThrowsMessage<DatabaseError>(HasSubstr("role")));
}

TEST_F(FleetReportsTest, NoCertificateReportsAsAnother) {
  FleetReports all = reports();
  const std::string first = enrol(all, "or-1"), second = enrol(all, "or-2");
  EXPECT_EQ(all.take("or-2", first, said()), ReportRefusal::kOtherCertificate);
  EXPECT_EQ(all.take("or-9", first, said()), ReportRefusal::kNotEnrolled);
  EXPECT_FALSE(all.take("or-2", second, said()));
  EXPECT_TRUE(all.revoke("or-2"));
  EXPECT_FALSE(all.revoke("or-2"));
  EXPECT_EQ(all.take("or-2", second, said()), ReportRefusal::kRevoked);
}

TEST_F(FleetReportsTest, ASecondApplianceOfANameIsRefusedUntilTheFirstIsRevoked) {
  FleetReports all = reports();
  const PendingEnrolment twin = asked("or-1");
  all.ask(twin, "192.0.2.9");
  const std::string first = enrol(all, "or-1");
  EXPECT_THAT([&] { all.ask(asked("or-1"), "192.0.2.2"); }, ThrowsMessage<UsageError>(HasSubstr("revoke")));
  EXPECT_THAT([&] { all.admit(twin, issued(twin), "anna"); }, ThrowsMessage<UsageError>(HasSubstr("revoke")));
  EXPECT_EQ(all.certificate_for(twin.id), "");
  all.revoke("or-1");
  const std::string second = enrol(all, "or-1");
  EXPECT_EQ(all.take("or-1", first, said()), ReportRefusal::kOtherCertificate);
  EXPECT_FALSE(all.take("or-1", second, said()));
}

TEST_F(FleetReportsTest, ARenewedCertificateCountsAloneOnceItWasUsed) {
  FleetReports all = reports();
  const std::string first = enrol(all, "or-1");
  const CertificateFacts next = facts_of_certificate_pem(issued(asked("or-1")));
  EXPECT_FALSE(all.renew("or-1", first, next));
  // Its answer may have been lost.
  EXPECT_FALSE(all.take("or-1", first, said()));
  EXPECT_FALSE(all.take("or-1", next.fingerprint, said()));
  EXPECT_EQ(all.take("or-1", first, said()), ReportRefusal::kOtherCertificate);
  EXPECT_EQ(all.renew("or-1", first, next), ReportRefusal::kOtherCertificate);
}

TEST_F(FleetReportsTest, ACertificateThatEndedCountsNoMoreThoughItsConnectionStays) {
  FleetReports all = reports();
  const std::string print = enrol(all, "or-1");
  EXPECT_FALSE(all.take("or-1", print, said()));
  Postgres(connection()).ask("UPDATE kiroku.appliances SET certificate_until = now() - interval '1 second'");
  EXPECT_EQ(all.take("or-1", print, said()), ReportRefusal::kEnded);
  const CertificateFacts next = facts_of_certificate_pem(issued(asked("or-1")));
  EXPECT_EQ(all.renew("or-1", print, next), ReportRefusal::kEnded);
}

TEST_F(FleetReportsTest, WhoWasAdmittedAtTheLastMomentIsToldSo) {
  FleetReports all = reports();
  const PendingEnrolment one = asked("or-1");
  all.ask(one, "192.0.2.1");
  all.admit(one, issued(one), "anna");
  Postgres database(connection());
  database.ask("UPDATE kiroku.enrolments SET asked = asked - interval '11 minutes'");
  all.ask(asked("or-2"), "192.0.2.1");  // which removes old ones
  EXPECT_NE(all.certificate_for(one.id).value_or(""), "");
  database.ask("UPDATE kiroku.enrolments SET asked = asked - interval '10 minutes'");
  EXPECT_FALSE(all.certificate_for(one.id));
}

TEST_F(FleetReportsTest, TwoThatReportUnderOneNameAreSeen) {
  FleetReports all = reports();
  const std::string print = enrol(all, "or-1");
  all.take("or-1", print, said('a'));
  all.take("or-1", print, said('b'));  // it was started anew
  EXPECT_FALSE(all.appliances().at(0).doubled);
  all.take("or-1", print, said('a'));
  EXPECT_TRUE(all.appliances().at(0).doubled);
}

TEST_F(FleetReportsTest, ARunThatComesAgainIsSeenThoughOthersCameBetween) {
  FleetReports all = reports();
  const std::string print = enrol(all, "or-1");
  all.take("or-1", print, said('o'));
  for (const char run : {'a', 'b', 'c'}) all.take("or-1", print, said(run));
  EXPECT_FALSE(all.appliances().at(0).doubled);
  all.take("or-1", print, said('o'));
  EXPECT_TRUE(all.appliances().at(0).doubled);
}

TEST_F(FleetReportsTest, RunsThatChangeFasterThanAMachineStartsAreSeen) {
  FleetReports all = reports();
  const std::string print = enrol(all, "or-1");
  for (const char run : {'1', '2', '3', '4', '5', '6', '7', '8'}) all.take("or-1", print, said(run));
  EXPECT_FALSE(all.appliances().at(0).doubled) << "of seven changes";
  all.take("or-1", print, said('9'));
  EXPECT_TRUE(all.appliances().at(0).doubled);
}

TEST_F(FleetReportsTest, AMachineThatStartsAnewWithoutEndIsNoSecondOne) {
  FleetReports all = reports();
  Postgres database(connection());
  const std::string print = enrol(all, "or-1");
  ApplianceReport report = said();
  for (int start = 0; start < 40; ++start) {
    report.run = std::to_string(1000 + start) + std::string(28, 'a');
    all.take("or-1", print, report);
    all.take("or-1", print, report);
    database.ask(
        "UPDATE kiroku.appliances SET run_changes = coalesce((SELECT array_agg(at - interval '10 seconds' "
        "ORDER BY at DESC) FROM unnest(run_changes) AS at), '{}')");
  }
  EXPECT_FALSE(all.appliances().at(0).doubled);
}

TEST_F(FleetReportsTest, WhoRenewedACopiedCertificateIsSeenOnceTheOriginalReportsAgain) {
  FleetReports all = reports(with_role("kiroku_reporter"));
  const std::string original = enrol(all, "or-1");
  ASSERT_FALSE(all.take("or-1", original, said('o')));
  // The copy renews more than once, so that the original's is long past.
  const std::string copy = renewed(all, "or-1", renewed(all, "or-1", renewed(all, "or-1", original)));
  EXPECT_EQ(all.take("or-1", original, said('o')), ReportRefusal::kOtherCertificate);
  EXPECT_FALSE(all.appliances().at(0).replaced_shown) << "one of the appliance's own processes had it yet";
  EXPECT_EQ(all.take("or-1", original, said('o')), ReportRefusal::kOtherCertificate);
  const std::optional<UtcTime> since = all.appliances().at(0).replaced_shown;
  EXPECT_TRUE(since);
  all.take("or-1", copy, said('c'));
  all.take("or-1", original, said('o'));
  EXPECT_EQ(all.appliances().at(0).replaced_shown, since);

  all.revoke("or-1");
  const std::string anew = enrol(all, "or-1");
  EXPECT_FALSE(all.appliances().at(0).replaced_shown);
  for (const std::string& earlier : {original, copy, original, copy})
    EXPECT_EQ(all.take("or-1", earlier, said('c')), ReportRefusal::kOtherCertificate);
  EXPECT_FALSE(all.appliances().at(0).replaced_shown) << "who was revoked tells nothing of who has the name";
  EXPECT_FALSE(all.take("or-1", anew, said('n')));
}

TEST_F(FleetReportsTest, ARenewalByACertificateThatWasReplacedIsSeen) {
  FleetReports all = reports();
  const std::string first = enrol(all, "or-1");
  renewed(all, "or-1", first);
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(all.renew("or-1", first, facts_of_certificate_pem(issued(asked("or-1")))),
              ReportRefusal::kOtherCertificate);
  EXPECT_TRUE(all.appliances().at(0).replaced_shown);
}

TEST_F(FleetReportsTest, ACertificateThatWasReplacedLongAgoIsSeenAtOnce) {
  FleetReports all = reports();
  const std::string first = enrol(all, "or-1");
  renewed(all, "or-1", first);
  Postgres(connection()).ask("UPDATE kiroku.appliances SET replaced = replaced - interval '5 minutes'");
  all.take("or-1", first, said());
  EXPECT_TRUE(all.appliances().at(0).replaced_shown);
}

TEST_F(FleetReportsTest, ACertificateThatAnotherReplacedBeforeItWasUsedIsSeen) {
  FleetReports all = reports();
  const std::string shared = enrol(all, "or-1");
  const CertificateFacts original = facts_of_certificate_pem(issued(asked("or-1"))),
                         copy = facts_of_certificate_pem(issued(asked("or-1")));
  EXPECT_FALSE(all.renew("or-1", shared, original));
  EXPECT_FALSE(all.renew("or-1", shared, copy));
  EXPECT_FALSE(all.take("or-1", copy.fingerprint, said()));
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(all.take("or-1", original.fingerprint, said()), ReportRefusal::kOtherCertificate);
  EXPECT_TRUE(all.appliances().at(0).replaced_shown);
}

TEST_F(FleetReportsTest, WhoIsRefusedWhileTheNameIsEnrolledAnewTellsNothingOfIt) {
  FleetReports all = reports();
  const std::string first = enrol(all, "or-1");
  renewed(all, "or-1", first);
  all.take("or-1", first, said());
  Postgres enrolling(connection()), watching(connection());
  std::future<std::optional<ReportRefusal>> refused;
  enrolling.together([&] {
    enrolling.ask("UPDATE kiroku.appliances SET enrolled = now()");
    refused = std::async(std::launch::async, [&] { return reports().take("or-1", first, said()); });
    // It has seen what was there before, and waits for the row.
    while (watching.ask("SELECT 1 FROM pg_locks WHERE NOT granted").size() == 0) std::this_thread::yield();
    enrolling.ask("DELETE FROM kiroku.certificates");
  });
  EXPECT_EQ(refused.get(), ReportRefusal::kOtherCertificate);
  EXPECT_FALSE(all.appliances().at(0).replaced_shown);
}

TEST_F(FleetReportsTest, NobodyFillsTheDatabaseWithCertificates) {
  FleetReports all = reports();
  Postgres database(connection());
  const std::string first = enrol(all, "or-1");
  database.ask(
      "INSERT INTO kiroku.certificates (appliance, certificate, certificate_until) SELECT 'or-1', i::text, "
      "now() + interval '1 day' FROM generate_series(1, 999) AS i");
  const CertificateFacts next = facts_of_certificate_pem(issued(asked("or-1")));
  EXPECT_EQ(all.renew("or-1", first, next), ReportRefusal::kTooManyCertificates);
  EXPECT_FALSE(all.take("or-1", first, said()));
  database.ask(
      "UPDATE kiroku.certificates SET certificate_until = now() - interval '1 second' WHERE certificate = "
      "'7'");
  EXPECT_FALSE(all.renew("or-1", first, next));
  EXPECT_EQ(database.ask("SELECT count(*) FROM kiroku.certificates").integer(0, 0), 1000);
}

TEST_F(FleetReportsTest, RequestsAreFewAndEndByThemselves) {
  FleetReports all = reports();
  for (const char* name : {"or-1", "or-2", "or-3", "or-4"}) all.ask(asked(name), "192.0.2.1");
  EXPECT_THAT([&] { all.ask(asked("or-5"), "192.0.2.1"); }, ThrowsMessage<UsageError>(HasSubstr("too many")));
  all.ask(asked("or-5"), "192.0.2.2");
  EXPECT_EQ(all.pending().size(), 5U);
  Postgres(connection()).ask("UPDATE kiroku.enrolments SET asked = asked - interval '10 minutes'");
  EXPECT_EQ(all.pending().size(), 0U);
  EXPECT_FALSE(all.certificate_for("1"));
  all.ask(asked("or-6"), "192.0.2.1");
}

TEST_F(FleetReportsTest, WrongCodesAreSlowedDownTogether) {
  FleetReports one = reports(), other = reports();
  for (int i = 0; i < 5; ++i) one.code_failed();
  EXPECT_EQ(other.code_wait(), 0s);
  one.code_failed();
  EXPECT_EQ(other.code_wait(), 2s);
  for (int i = 0; i < 20; ++i) one.code_failed();
  EXPECT_EQ(other.code_wait(), 300s);
  Postgres(connection()).ask("UPDATE kiroku.wrong_codes SET last = last - interval '61 minutes'");
  one.code_failed();
  EXPECT_EQ(other.code_wait(), 0s);
}

TEST_F(FleetReportsTest, ACatalogueOfTheFirstVersionIsBroughtUpToDate) {
  Postgres database(connection());
  for (const char* table :
       {"appliances", "certificates", "enrolments", "wrong_codes", "search_notes", "renewals"})
    database.ask(std::string("DROP TABLE kiroku.") + table);
  database.ask("DROP FUNCTION kiroku.accuse");
  database.ask("UPDATE kiroku.version SET version = 1");
  EXPECT_THAT([&] { reports(); }, ThrowsMessage<UsageError>(HasSubstr("kiroku-fleet init")));
  FleetCatalogue::prepare(database);
  EXPECT_TRUE(reports().appliances().empty());
}

TEST_F(FleetReportsTest, ACatalogueOfTheThirdVersionKeepsItsAppliancesAndSeesTheirCopies) {
  Postgres database(connection());
  std::string used, copied;
  {
    FleetReports all = reports();
    used = enrol(all, "or-1");
    all.take("or-1", used, said('a'));
    copied = enrol(all, "or-2");
    enrol(all, "or-3");
    all.revoke("or-3");
  }
  // As that version has it, while or-2 renews.
  make_the_third_version(database);
  database.ask("UPDATE kiroku.appliances SET earlier_run = $1, run = $2 WHERE name = 'or-1'",
               {std::string(32, 'a'), std::string(32, 'b')});
  const std::string next = print_of(issued(asked("or-2")));
  database.ask(
      "UPDATE kiroku.appliances SET next_certificate = $1, next_until = certificate_until WHERE name = "
      "'or-2'",
      {next});
  EXPECT_THAT([&] { reports(); }, ThrowsMessage<UsageError>(HasSubstr("kiroku-fleet init")));
  FleetCatalogue::prepare(database);

  FleetReports all = reports();
  EXPECT_EQ(database.ask("SELECT count(*) FROM kiroku.certificates").integer(0, 0), 3);
  EXPECT_FALSE(all.take("or-1", used, said('a')));
  EXPECT_TRUE(all.appliances().at(0).doubled) << "the run before is known yet";
  EXPECT_FALSE(all.take("or-2", next, said()));
  for (int i = 0; i < 2; ++i) all.take("or-2", copied, said());
  EXPECT_TRUE(all.appliances().at(1).replaced_shown);
}

}  // namespace
}  // namespace kiroku::fleet
