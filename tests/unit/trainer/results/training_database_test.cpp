#include "trainer/results/training_database.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/catalogue/sqlite_handles.h"
#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::trainer {
namespace {

using testing::HasSubstr;

template <typename Action>
std::string refusal(const Action& action) {
  try {
    action();
  } catch (const UsageError& error) {
    return error.what();
  }
  return "nothing was refused";
}

void execute(const std::filesystem::path& file, const char* sql) {
  sqlite3* raw = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &raw), SQLITE_OK);
  const archive::SqliteDatabase database(raw);
  ASSERT_EQ(sqlite3_exec(raw, sql, nullptr, nullptr, nullptr), SQLITE_OK);
}

TEST(TrainingDatabase, KeepsTraineesAndSessions) {
  const test::TemporaryFolder folder;
  const RateSession session{"Aoki",
                            true,
                            MethodKind::kStaircase,
                            RateSeries::kHapticRate,
                            {{1, 23.7, true}, {1, 30.5, false}, {2, 8.5, true}},
                            {{Fingers::of("middle"), {25.1, {20, 31}}, 24.5},
                             {Fingers::of("index"), {8.8, {7, 10}}, std::nullopt}}};
  {
    TrainingDatabase database(folder / "results.sqlite");
    const Trainee aoki = database.add_trainee("Aoki", "first", true);
    database.add_trainee("Abe", "", false);
    EXPECT_EQ(database.add_rate_session(aoki, session, UtcTime{}), 1);
  }
  const TrainingDatabase database(folder / "results.sqlite");
  ASSERT_EQ(database.trainees().size(), 2U);
  EXPECT_EQ(database.trainees()[0].name, "Abe");
  EXPECT_FALSE(database.trainees()[0].simulated);
  EXPECT_EQ(database.trainee("Aoki").group, "first");
  const auto found = database.rate_sessions();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].subject, "Aoki");
  EXPECT_TRUE(found[0].simulated);
  EXPECT_EQ(found[0].method, MethodKind::kStaircase);
  EXPECT_EQ(found[0].series, RateSeries::kHapticRate);
  ASSERT_EQ(found[0].trials.size(), 3U);
  EXPECT_EQ(found[0].trials[1].rate_hz, 30.5);
  EXPECT_FALSE(found[0].trials[1].vibrating);
  ASSERT_EQ(found[0].thresholds.size(), 2U);
  EXPECT_EQ(found[0].trials[2].fingers, Fingers(2));
  // In the order in which they were asked, each by its name.
  EXPECT_EQ(found[0].thresholds[0].fingers.text(), "middle");
  EXPECT_EQ(found[0].thresholds[1].fingers.text(), "index");
  EXPECT_EQ(found[0].thresholds[0].own_hz, 24.5);
  EXPECT_FALSE(found[0].thresholds[1].own_hz);
  EXPECT_EQ(found[0].thresholds[1].estimate.interval_hz.high, 10);
}

TEST(TrainingDatabase, KeepsAttempts) {
  const test::TemporaryFolder folder;
  ExclusionRecord record;
  record.session = 4;
  record.test = true;
  record.object = "b";
  record.fingers = 5;
  record.score = {true, 3.5, 4.5e4, 1e-6, 0.25, 6.5, 12.5, 0.95, 2.5e4};
  record.conditions = AttemptConditions{0.3, 8e4, 2012, 7654};
  TrainingDatabase database(folder / "results.sqlite");
  database.add_attempt(database.add_trainee("Aoki", "first", false), record, UtcTime{});
  const std::vector<ExclusionRecord> found = database.attempts();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].trainee, "Aoki");
  EXPECT_EQ(found[0].group, "first");
  EXPECT_EQ(found[0].session, 4);
  EXPECT_TRUE(found[0].test);
  EXPECT_FALSE(found[0].stress_shown);
  EXPECT_EQ(found[0].object, "b");
  EXPECT_EQ(found[0].fingers, 5U);
  EXPECT_TRUE(found[0].score.done);
  EXPECT_EQ(found[0].score.time_s, 3.5);
  EXPECT_EQ(found[0].score.damaged_m3, 1e-6);
  EXPECT_EQ(found[0].score.best_visible_share, 0.95);
  EXPECT_EQ(found[0].score.high_von_mises_pa, 2.5e4);
  EXPECT_EQ(found[0].conditions, record.conditions);
}

TEST(TrainingDatabase, ABegunAttemptIsBrokenOffUntilItsEndIsKept) {
  const test::TemporaryFolder folder;
  ExclusionRecord record;
  record.object = "a";
  record.fingers = 3;
  std::int64_t ended = 0;
  {
    TrainingDatabase database(folder / "results.sqlite");
    const Trainee aoki = database.add_trainee("Aoki", "", false);
    database.begin_attempt(aoki, record, UtcTime{});
    ended = database.begin_attempt(aoki, record, UtcTime{});
    // The program ends here for the first.
  }
  TrainingDatabase database(folder / "results.sqlite");
  database.end_attempt(ended, Ending::kDone, {true, 3.5, 4.5e4, 1e-6, 0.25, 6.5, 12.5, 0.95, std::nullopt});
  const std::vector<ExclusionRecord> found = database.attempts();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].ending, Ending::kBrokenOff);
  EXPECT_FALSE(found[0].score.done);
  EXPECT_EQ(found[1].ending, Ending::kDone);
  EXPECT_TRUE(found[1].score.done);
  EXPECT_EQ(found[1].score.time_s, 3.5);
  EXPECT_EQ(found[1].score.peak_wrist_n, 12.5);
  EXPECT_FALSE(found[1].score.high_von_mises_pa);
  EXPECT_EQ(found[1].sealed_case, "");
  EXPECT_FALSE(found[1].conditions);
  database.keep_conditions(found[1].number, {0.5, 1e5, 2000, 7000});
  EXPECT_EQ(database.attempts()[1].conditions, (AttemptConditions{0.5, 1e5, 2000, 7000}));
  EXPECT_FALSE(database.attempts()[0].conditions);
  EXPECT_THAT(refusal([&] { database.keep_conditions(77, {}); }), HasSubstr("no attempt 77"));
  database.keep_case(found[1].number, "20260805T091502Z-3f9c21ab");
  EXPECT_EQ(database.attempts()[1].sealed_case, "20260805T091502Z-3f9c21ab");
  EXPECT_THAT(refusal([&] { database.keep_case(77, "x"); }), HasSubstr("no attempt 77"));
  EXPECT_THAT(refusal([&] { database.end_attempt(77, Ending::kDone, {}); }), HasSubstr("no attempt 77"));
}

Checklist checklist_of(const std::string& examiner, int rating) {
  Checklist checklist;
  checklist.items.fill(ItemState::kDone);
  checklist.items[2] = ItemState::kNotDone;
  checklist.items[5] = ItemState::kNotSeen;
  checklist.global_rating = rating;
  checklist.examiner = examiner;
  checklist.account = "root";
  return checklist;
}

TEST(TrainingDatabase, KeepsWhatWasSaidOfAnAttemptUntilItIsSealed) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder / "results.sqlite";
  const Questionnaire first{{1, std::nullopt, -2}, "The palm is missing.", "anna"},
      second{{2, 2, 0}, "", "anna"};
  {
    TrainingDatabase database(file);
    const Trainee aoki = database.add_trainee("Aoki", "", false);
    ExclusionRecord record;
    record.object = "a";
    record.ending = Ending::kDone;
    database.add_attempt(aoki, record, UtcTime{});
    database.add_attempt(aoki, record, UtcTime{});
    const std::int64_t runs = database.begin_attempt(aoki, record, UtcTime{});
    database.keep_questionnaire(1, first);
    database.keep_checklist(1, checklist_of("Dr Sato", 2));
    EXPECT_THAT(refusal([&] { database.keep_questionnaire(runs, first); }), HasSubstr("broken off"));
    EXPECT_THAT(refusal([&] { database.keep_checklist(77, checklist_of("Dr Sato", 2)); }),
                HasSubstr("no attempt 77"));
    EXPECT_THAT(refusal([&] { database.keep_questionnaire(2, {{3, {}, {}}, "", ""}); }), HasSubstr("not 3"));
    EXPECT_THAT(refusal([&] { database.keep_checklist(2, checklist_of("", 2)); }), HasSubstr("'examiner'"));
  }
  TrainingDatabase database(file);
  EXPECT_EQ(database.attempts()[0].questionnaire, first);
  EXPECT_EQ(database.attempts()[0].checklist, checklist_of("Dr Sato", 2));
  EXPECT_FALSE(database.attempts()[1].questionnaire);
  EXPECT_FALSE(database.attempts()[1].checklist);
  // Once more, in its place.
  database.keep_questionnaire(1, second);
  database.keep_checklist(1, checklist_of("Dr Abe", 5));
  EXPECT_EQ(database.attempts()[0].questionnaire, second);
  EXPECT_EQ(database.attempts()[0].checklist, checklist_of("Dr Abe", 5));
  database.keep_case(1, "20260805T091502Z-3f9c21ab");
  EXPECT_THAT(refusal([&] { database.keep_questionnaire(1, first); }),
              HasSubstr("sealed as 20260805T091502Z"));
  EXPECT_THAT(refusal([&] { database.keep_checklist(1, checklist_of("Dr Sato", 2)); }),
              HasSubstr("sealed as"));
  EXPECT_EQ(database.attempts()[0].questionnaire, second);
  EXPECT_EQ(database.attempts()[0].checklist, checklist_of("Dr Abe", 5));
}

/// What version 5 brought, taken away from the rate sessions; and from the attempts.
constexpr const char* kNoSeries =
    "ALTER TABLE rate_sessions DROP COLUMN series; "
    // And what version 6 brought.
    "ALTER TABLE rate_trials ADD COLUMN fingers INTEGER NOT NULL DEFAULT 1; "
    "UPDATE rate_trials SET fingers = CAST(which AS INTEGER); ALTER TABLE rate_trials DROP COLUMN which; "
    "CREATE TABLE numbered (session INTEGER NOT NULL, fingers INTEGER NOT NULL, hz REAL NOT NULL, low_hz "
    "REAL NOT "
    "NULL, high_hz REAL NOT NULL, own_hz REAL, PRIMARY KEY (session, fingers)) STRICT; "
    "INSERT INTO numbered SELECT session, CAST(which AS INTEGER), hz, low_hz, high_hz, own_hz FROM "
    "rate_thresholds; "
    "DROP TABLE rate_thresholds; ALTER TABLE numbered RENAME TO rate_thresholds; ";
constexpr const char* kNoAssessments =
    // And what version 9 brought.
    "ALTER TABLE attempts DROP COLUMN instrument; "
    "DROP TABLE checklist_items; DROP TABLE checklists; DROP TABLE questionnaires; ";
constexpr const char* kNoConditions =
    "ALTER TABLE attempts DROP COLUMN friction; ALTER TABLE attempts DROP COLUMN damage_pa; "
    "ALTER TABLE attempts DROP COLUMN vertices; ALTER TABLE attempts DROP COLUMN tetrahedra; "
    // And what version 7 brought.
    "ALTER TABLE attempts DROP COLUMN high_von_mises_pa; ";

void execute(const std::filesystem::path& file, const std::string& sql) { execute(file, sql.c_str()); }

TEST(TrainingDatabase, GivesAnOlderOneWhatIsNew) {
  const test::TemporaryFolder folder;
  { TrainingDatabase made(folder / "first.sqlite"); }
  execute(folder / "first.sqlite",
          kNoSeries + std::string(kNoAssessments) +
              "DROP TABLE attempts; ALTER TABLE trainees DROP COLUMN account; PRAGMA user_version "
              "= 1");
  EXPECT_TRUE(TrainingDatabase(folder / "first.sqlite").attempts().empty());
  ExclusionRecord done;
  done.object = "a";
  done.score.done = true;
  {
    TrainingDatabase made(folder / "second.sqlite");
    const Trainee aoki = made.add_trainee("Aoki", "", false);
    made.add_attempt(aoki, done, UtcTime{});
    made.add_attempt(aoki, {}, UtcTime{});
  }
  execute(folder / "second.sqlite",
          std::string(kNoSeries) + kNoAssessments + kNoConditions +
              "ALTER TABLE attempts DROP COLUMN ending; ALTER TABLE attempts DROP COLUMN sealed_case; "
              "ALTER TABLE trainees DROP COLUMN account; "
              "PRAGMA user_version = 2");
  const std::vector<ExclusionRecord> kept = TrainingDatabase(folder / "second.sqlite").attempts();
  ASSERT_EQ(kept.size(), 2U);
  EXPECT_EQ(kept[0].ending, Ending::kDone);
  EXPECT_EQ(kept[1].ending, Ending::kTimeOver);
  execute(folder / "second.sqlite",
          std::string(kNoSeries) + kNoAssessments + kNoConditions +
              "ALTER TABLE attempts DROP COLUMN sealed_case; ALTER TABLE trainees DROP COLUMN account; "
              "PRAGMA user_version = 3");
  TrainingDatabase third(folder / "second.sqlite");
  EXPECT_EQ(third.attempts()[0].ending, Ending::kDone);
  EXPECT_EQ(third.trainee("Aoki").account, "");
}

TEST(TrainingDatabase, OfAnOlderOneTheConditionsAreUnknownAndTheRatesWereTheExclusionTrainers) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder / "results.sqlite";
  {
    TrainingDatabase made(file);
    const Trainee aoki = made.add_trainee("Aoki", "", false, "anna");
    ExclusionRecord record;
    record.object = "a";
    record.conditions = AttemptConditions{0.3, 8e4, 2012, 7654};
    made.add_attempt(aoki, record, UtcTime{});
    RateSession session;
    session.trials = {{1, 23.7, true}, {3, 2.7, true}};
    session.thresholds = {{1, {25.1, {20, 31}}, 24.5}, {3, {3.8, {3, 5}}, std::nullopt}};
    made.add_rate_session(aoki, session, UtcTime{});
  }
  execute(file, std::string(kNoSeries) + kNoAssessments + kNoConditions + "PRAGMA user_version = 4");
  for (int time = 0; time < 2; ++time) {
    TrainingDatabase opened(file);
    ASSERT_EQ(opened.attempts().size(), 1U);
    EXPECT_FALSE(opened.attempts()[0].conditions);
    EXPECT_EQ(opened.trainee("Aoki").account, "anna");
    ASSERT_EQ(opened.rate_sessions().size(), 1U);
    EXPECT_EQ(opened.rate_sessions()[0].series, RateSeries::kExclusion);
    EXPECT_EQ(opened.rate_sessions()[0].trials[0].rate_hz, 23.7);
    EXPECT_EQ(opened.rate_sessions()[0].trials[1].fingers, Fingers(3));
    ASSERT_EQ(opened.rate_sessions()[0].thresholds.size(), 2U);
    EXPECT_EQ(opened.rate_sessions()[0].thresholds[1].fingers, Fingers(3));
    EXPECT_EQ(opened.rate_sessions()[0].thresholds[1].estimate.hz, 3.8);
  }
}

TEST(TrainingDatabase, OfVersionSevenWhatItHasStaysAndMoreCanBeSaid) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder / "results.sqlite";
  {
    TrainingDatabase made(file);
    ExclusionRecord record;
    record.object = "a";
    record.score.high_von_mises_pa = 2.5e4;
    made.add_attempt(made.add_trainee("Aoki", "", false), record, UtcTime{});
  }
  execute(file, kNoAssessments + std::string("PRAGMA user_version = 7"));
  TrainingDatabase opened(file);
  ASSERT_EQ(opened.attempts().size(), 1U);
  EXPECT_EQ(opened.attempts()[0].score.high_von_mises_pa, 2.5e4);
  EXPECT_FALSE(opened.attempts()[0].questionnaire);
  opened.keep_checklist(1, checklist_of("Dr Sato", 3));
  EXPECT_EQ(opened.attempts()[0].checklist, checklist_of("Dr Sato", 3));
}

TEST(TrainingDatabase, OfVersionEightAllAttemptsWereWithFingertips) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder / "results.sqlite";
  ExclusionRecord record;
  record.object = "a";
  record.fingers = 2;
  record.instrument = "retractor";
  {
    TrainingDatabase made(file);
    made.add_attempt(made.add_trainee("Aoki", "", false), record, UtcTime{});
    EXPECT_EQ(made.attempts()[0].instrument, "retractor");
  }
  execute(file, "ALTER TABLE attempts DROP COLUMN instrument; PRAGMA user_version = 8");
  TrainingDatabase opened(file);
  ASSERT_EQ(opened.attempts().size(), 1U);
  EXPECT_EQ(opened.attempts()[0].instrument, "");
  opened.add_attempt(opened.trainee("Aoki"), record, UtcTime{});
  EXPECT_EQ(opened.attempts()[1].instrument, "retractor");
}

TEST(TrainingDatabase, BindsATraineeToAUser) {
  const test::TemporaryFolder folder;
  TrainingDatabase database(folder / "results.sqlite");
  EXPECT_EQ(database.add_trainee("Aoki", "", false, "anna").account, "anna");
  EXPECT_EQ(database.trainee("Aoki").account, "anna");
  database.bind_to_user(database.trainee("Aoki"), "ben");
  EXPECT_EQ(database.trainee("Aoki").account, "ben");
  const Trainee model = database.add_trainee("Model", "", true);
  EXPECT_THAT(refusal([&] { database.bind_to_user(model, "ben"); }), HasSubstr("no user trains so"));
}

TEST(TrainingDatabase, RefusesANameThatExistsAndNamesThatAreNone) {
  const test::TemporaryFolder folder;
  TrainingDatabase database(folder / "results.sqlite");
  database.add_trainee("Aoki", "", false);
  EXPECT_THAT(refusal([&] { database.add_trainee("Aoki", "other", true); }), HasSubstr("a trainee 'Aoki'"));
  EXPECT_THAT(refusal([&] { database.add_trainee("", "", false); }), HasSubstr("not empty"));
  EXPECT_THAT(refusal([&] { database.add_trainee("a\nb", "", false); }), HasSubstr("control characters"));
  EXPECT_THAT(refusal([&] { (void)database.trainee("Ueda"); }), HasSubstr("no trainee 'Ueda'"));
  // A trainee on the network reads these sentences.
  const auto place = testing::Not(HasSubstr(folder.path().string()));
  EXPECT_THAT(refusal([&] { database.add_trainee("Aoki", "other", true); }), place);
  EXPECT_THAT(refusal([&] { (void)database.trainee("Ueda"); }), place);
}

TEST(TrainingDatabase, RefusesWhatItDoesNotKnow) {
  const test::TemporaryFolder folder;
  { TrainingDatabase made(folder / "newer.sqlite"); }
  execute(folder / "newer.sqlite", "PRAGMA user_version = 10");
  EXPECT_THAT(refusal([&] { TrainingDatabase opened(folder / "newer.sqlite"); }), HasSubstr("newer version"));
  execute(folder / "other.sqlite", "CREATE TABLE cases (name TEXT)");
  EXPECT_THAT(refusal([&] { TrainingDatabase opened(folder / "other.sqlite"); }),
              HasSubstr("another program's"));
  std::ofstream(folder / "text.sqlite") << std::string(5000, 'x');
  EXPECT_THAT(refusal([&] { TrainingDatabase opened(folder / "text.sqlite"); }), HasSubstr("no database"));
  EXPECT_EQ(std::filesystem::file_size(folder / "text.sqlite"), 5000U);  // left alone
  EXPECT_THROW(TrainingDatabase(folder / "absent/results.sqlite"), Error);
}

}  // namespace
}  // namespace kiroku::trainer
