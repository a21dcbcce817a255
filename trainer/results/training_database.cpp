#include "trainer/results/training_database.h"

#include <algorithm>
#include <map>

#include "archive/catalogue/sqlite_handles.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::trainer {
namespace {

namespace fs = std::filesystem;
using archive::SqliteError;
using archive::SqliteStatement;

/// "KTrn": told by file(1) and by us.
constexpr std::int64_t kApplication = 0x4B54726E;
constexpr int kBusyMilliseconds = 5000;

constexpr const char* kSchema = R"(
  CREATE TABLE trainees (
    id         INTEGER PRIMARY KEY,
    name       TEXT NOT NULL UNIQUE,
    study_group TEXT NOT NULL,
    simulated  INTEGER NOT NULL       -- 1: no person
  ) STRICT;
  CREATE TABLE rate_sessions (
    id         INTEGER PRIMARY KEY,
    trainee    INTEGER NOT NULL REFERENCES trainees (id),
    began_us   INTEGER NOT NULL,      -- microseconds since 1970, UTC
    method     TEXT NOT NULL
  ) STRICT;
  CREATE TABLE rate_trials (
    session    INTEGER NOT NULL REFERENCES rate_sessions (id),
    number     INTEGER NOT NULL,      -- from 1
    fingers    INTEGER NOT NULL,
    rate_hz    REAL NOT NULL,
    vibrating  INTEGER NOT NULL,
    PRIMARY KEY (session, number)
  ) STRICT;
  CREATE TABLE rate_thresholds (
    session    INTEGER NOT NULL REFERENCES rate_sessions (id),
    fingers    INTEGER NOT NULL,
    hz         REAL NOT NULL,
    low_hz     REAL NOT NULL,         -- 95 % interval
    high_hz    REAL NOT NULL,
    own_hz     REAL,                  -- the method's own estimate
    PRIMARY KEY (session, fingers)
  ) STRICT;
)";

/// Since version 2.
constexpr const char* kAttempts = R"(
  CREATE TABLE attempts (
    id          INTEGER PRIMARY KEY,
    trainee     INTEGER NOT NULL REFERENCES trainees (id),
    began_us    INTEGER NOT NULL,     -- microseconds since 1970, UTC
    session     INTEGER NOT NULL,     -- of the trainee, from 1
    test        INTEGER NOT NULL,     -- 1: a test, 0: practice
    stress_shown INTEGER NOT NULL,
    object      TEXT NOT NULL,
    fingers     INTEGER NOT NULL,
    done        INTEGER NOT NULL,
    time_s      REAL NOT NULL,
    largest_von_mises_pa REAL NOT NULL,
    damaged_m3  REAL NOT NULL,
    path_m      REAL NOT NULL,
    peak_force_n REAL NOT NULL,
    peak_wrist_n REAL NOT NULL,
    best_visible_share REAL NOT NULL
  ) STRICT;
)";

/// Since version 3. What was kept before was never broken off.
constexpr const char* kEndings = R"(
  ALTER TABLE attempts ADD COLUMN ending TEXT NOT NULL DEFAULT 'time-over';
  UPDATE attempts SET ending = 'done' WHERE done = 1;
)";

/// Since version 4.
constexpr const char* kAccounts = R"(
  ALTER TABLE trainees ADD COLUMN account TEXT NOT NULL DEFAULT '';  -- the user who trains so, '': none
  ALTER TABLE attempts ADD COLUMN sealed_case TEXT NOT NULL DEFAULT '';  -- '': none
)";

/// Since version 5. What was kept before had one series of rates, and said nothing of an attempt's
/// conditions.
constexpr const char* kConditions = R"(
  ALTER TABLE rate_sessions ADD COLUMN series TEXT NOT NULL DEFAULT 'exclusion';
  ALTER TABLE attempts ADD COLUMN friction REAL;       -- these four are NULL together: not recorded
  ALTER TABLE attempts ADD COLUMN damage_pa REAL;      -- von Mises stress that counts as damage
  ALTER TABLE attempts ADD COLUMN vertices INTEGER;    -- of the object's mesh
  ALTER TABLE attempts ADD COLUMN tetrahedra INTEGER;
)";

/// Since version 6: which fingers, as Fingers::text() writes them, where there was their number. A session
/// may have several conditions of one finger, so that they are its key.
constexpr const char* kNamedFingers = R"(
  ALTER TABLE rate_trials ADD COLUMN which TEXT NOT NULL DEFAULT '';  -- "2", "index+middle"
  UPDATE rate_trials SET which = fingers;
  ALTER TABLE rate_trials DROP COLUMN fingers;
  CREATE TABLE named_rate_thresholds (
    session    INTEGER NOT NULL REFERENCES rate_sessions (id),
    number     INTEGER NOT NULL,      -- from 1, in the order in which they were asked
    which      TEXT NOT NULL,
    hz         REAL NOT NULL,
    low_hz     REAL NOT NULL,         -- 95 % interval
    high_hz    REAL NOT NULL,
    own_hz     REAL,                  -- the method's own estimate
    PRIMARY KEY (session, which)
  ) STRICT;
  INSERT INTO named_rate_thresholds SELECT session, fingers, fingers, hz, low_hz, high_hz, own_hz FROM rate_thresholds;
  DROP TABLE rate_thresholds;
  ALTER TABLE named_rate_thresholds RENAME TO rate_thresholds;
)";

/// Since version 7: the stress that all tissue but a share stays below; of older attempts nobody measured it.
constexpr const char* kHighStress = "ALTER TABLE attempts ADD COLUMN high_von_mises_pa REAL;";

/// Since version 8: what was said of attempts (trainer/assessment/assessment.h).
constexpr const char* kAssessments = R"(
  CREATE TABLE questionnaires (
    attempt    INTEGER PRIMARY KEY REFERENCES attempts (id),
    organ_feel INTEGER,               -- -2 to 2; NULL: not answered
    useful     INTEGER,
    stress_helps INTEGER,
    comment    TEXT NOT NULL,
    account    TEXT NOT NULL          -- the user who filled it in
  ) STRICT;
  CREATE TABLE checklists (
    attempt    INTEGER PRIMARY KEY REFERENCES attempts (id),
    global_rating INTEGER NOT NULL,   -- 1 to 5
    examiner   TEXT NOT NULL,
    account    TEXT NOT NULL
  ) STRICT;
  CREATE TABLE checklist_items (
    attempt    INTEGER NOT NULL REFERENCES checklists (attempt),
    item       TEXT NOT NULL,
    state      TEXT NOT NULL,         -- "done", "not-done", "not-seen"
    PRIMARY KEY (attempt, item)
  ) STRICT;
)";

/// Since version 9. All attempts before were with fingertips.
constexpr const char* kInstruments = R"(
  ALTER TABLE attempts ADD COLUMN instrument TEXT NOT NULL DEFAULT '';  -- "retractor"; '': fingertips
)";

}  // namespace

struct TrainingDatabase::State {
  fs::path file;
  archive::SqliteDatabase database;

  [[nodiscard]] SqliteStatement statement(std::string_view sql) const { return {database.get(), file, sql}; }
  void execute(const std::string& sql) const {
    if (sqlite3_exec(database.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
      throw SqliteError(database.get(), file);
  }
  [[nodiscard]] std::int64_t number(std::string_view sql) const {
    SqliteStatement asked = statement(sql);
    asked.step();
    return asked.integer(0);
  }
  /// All of `work` or nothing.
  template <typename Work>
  void whole(const Work& work) const {
    execute("BEGIN IMMEDIATE");
    try {
      work();
      execute("COMMIT");
    } catch (...) {
      sqlite3_exec(database.get(), "ROLLBACK", nullptr, nullptr, nullptr);
      throw;
    }
  }
};

TrainingDatabase::TrainingDatabase(const fs::path& file) : state_(std::make_unique<State>()) {
  state_->file = file;
  sqlite3* raw = nullptr;
  const int opened = sqlite3_open_v2(file.c_str(), &raw, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  state_->database.reset(raw);
  if (opened != SQLITE_OK) throw SqliteError(raw, file);
  sqlite3_busy_timeout(raw, kBusyMilliseconds);
  try {
    if (state_->number("SELECT count(*) FROM sqlite_schema") == 0) {
      state_->whole([&] {
        if (state_->number("SELECT count(*) FROM sqlite_schema") > 0) return;  // another was quicker
        state_->execute(std::string(kSchema) + kAttempts + kEndings + kAccounts + kConditions +
                        kNamedFingers + kHighStress + kAssessments + kInstruments +
                        "PRAGMA application_id = " + std::to_string(kApplication) +
                        "; PRAGMA user_version = " + std::to_string(kVersion));
      });
    }
    if (state_->number("PRAGMA application_id") != kApplication)
      throw UsageError(file.string() +
                       " is another program's database: name one of kiroku train, or a new file");
    if (state_->number("PRAGMA user_version") > kVersion) {
      throw UsageError("the results in " + file.string() +
                       " were written by a newer version of kiroku: use that, or name another file");
    }
    if (state_->number("PRAGMA user_version") < kVersion) {
      state_->whole([&] {
        const std::int64_t found = state_->number("PRAGMA user_version");
        if (found == kVersion) return;  // another was quicker
        state_->execute(std::string(found < 2 ? kAttempts : "") + (found < 3 ? kEndings : "") +
                        (found < 4 ? kAccounts : "") + (found < 5 ? kConditions : "") +
                        (found < 6 ? kNamedFingers : "") + (found < 7 ? kHighStress : "") +
                        (found < 8 ? kAssessments : "") + kInstruments +
                        "PRAGMA user_version = " + std::to_string(kVersion));
      });
    }
  } catch (const SqliteError& error) {
    if (error.code() != SQLITE_NOTADB && error.code() != SQLITE_CORRUPT) throw;
    throw UsageError(file.string() +
                     " is no database, or a damaged one: name another file, or bring it back from a copy");
  }
  state_->execute("PRAGMA foreign_keys = ON");
}

TrainingDatabase::~TrainingDatabase() = default;

Trainee TrainingDatabase::add_trainee(const std::string& name, const std::string& group, bool simulated,
                                      const std::string& account) {
  constexpr std::size_t kLongest = 100;
  const auto sound = [](const std::string& text) {
    return text.size() <= kLongest && !first_unprintable(text);
  };
  if (name.empty() || !sound(name) || !sound(group))
    throw UsageError(
        "a trainee's name and group are text of at most 100 bytes without control characters and others that "
        "cannot be seen, the name not empty");
  const auto existing = trainees();
  if (std::ranges::find(existing, name, &Trainee::name) != existing.end()) {
    throw UsageError("there is a trainee '" + name + "' already: choose another name");
  }
  state_->statement("INSERT INTO trainees (name, study_group, simulated, account) VALUES (?, ?, ?, ?)")
      .bind(name)
      .bind(group)
      .bind(std::int64_t{simulated ? 1 : 0})
      .bind(account)
      .step();
  return {sqlite3_last_insert_rowid(state_->database.get()), name, group, simulated, account};
}

void TrainingDatabase::bind_to_user(const Trainee& trainee, const std::string& account) {
  if (trainee.simulated) throw UsageError("'" + trainee.name + "' is a simulated trainee: no user trains so");
  state_->statement("UPDATE trainees SET account = ? WHERE id = ?").bind(account).bind(trainee.id).step();
}

std::vector<Trainee> TrainingDatabase::trainees() const {
  std::vector<Trainee> found;
  SqliteStatement rows =
      state_->statement("SELECT id, name, study_group, simulated, account FROM trainees ORDER BY name");
  while (rows.step())
    found.push_back({rows.integer(0), rows.text(1), rows.text(2), rows.integer(3) != 0, rows.text(4)});
  return found;
}

Trainee TrainingDatabase::trainee(const std::string& name) const {
  const auto all = trainees();
  const auto found = std::ranges::find(all, name, &Trainee::name);
  if (found == all.end()) {
    throw UsageError("there is no trainee '" + name + "': 'kiroku train trainee add' adds one");
  }
  return *found;
}

std::int64_t TrainingDatabase::add_rate_session(const Trainee& subject, const RateSession& session,
                                                UtcTime began) {
  std::int64_t id = 0;
  state_->whole([&] {
    state_->statement("INSERT INTO rate_sessions (trainee, began_us, method, series) VALUES (?, ?, ?, ?)")
        .bind(subject.id)
        .bind(std::int64_t{began.time_since_epoch().count()})
        .bind(name_of(session.method))
        .bind(name_of(session.series))
        .step();
    id = sqlite3_last_insert_rowid(state_->database.get());
    std::int64_t number = 0;
    for (const RateTrial& trial : session.trials) {
      state_
          ->statement(
              "INSERT INTO rate_trials (session, number, which, rate_hz, vibrating) VALUES (?, ?, ?, ?, ?)")
          .bind(id)
          .bind(++number)
          .bind(trial.fingers.text())
          .bind_real(trial.rate_hz)
          .bind(std::int64_t{trial.vibrating ? 1 : 0})
          .step();
    }
    number = 0;
    for (const RateThreshold& threshold : session.thresholds) {
      SqliteStatement row = state_->statement(
          "INSERT INTO rate_thresholds (session, number, which, hz, low_hz, high_hz, own_hz) VALUES (?, ?, "
          "?, ?, "
          "?, ?, ?)");
      row.bind(id)
          .bind(++number)
          .bind(threshold.fingers.text())
          .bind_real(threshold.estimate.hz)
          .bind_real(threshold.estimate.interval_hz.low)
          .bind_real(threshold.estimate.interval_hz.high);
      if (threshold.own_hz) {
        row.bind_real(*threshold.own_hz);
      } else {
        row.bind(std::optional<std::int64_t>());
      }
      row.step();
    }
  });
  return id;
}

std::vector<RateSession> TrainingDatabase::rate_sessions() const {
  std::vector<RateSession> found;
  SqliteStatement rows = state_->statement(
      "SELECT rate_sessions.id, name, simulated, method, series FROM rate_sessions JOIN trainees ON trainee "
      "= "
      "trainees.id "
      "ORDER BY rate_sessions.id");
  while (rows.step()) {
    RateSession session;
    session.subject = rows.text(1);
    session.simulated = rows.integer(2) != 0;
    session.method = method_kind(rows.text(3));
    session.series = rate_series(rows.text(4));
    SqliteStatement trials = state_->statement(
        "SELECT which, rate_hz, vibrating FROM rate_trials WHERE session = ? ORDER BY number");
    trials.bind(rows.integer(0));
    while (trials.step())
      session.trials.push_back({Fingers::of(trials.text(0)), trials.real(1), trials.integer(2) != 0});
    SqliteStatement thresholds = state_->statement(
        "SELECT which, hz, low_hz, high_hz, own_hz FROM rate_thresholds WHERE session = ? ORDER BY number");
    thresholds.bind(rows.integer(0));
    while (thresholds.step()) {
      session.thresholds.push_back(
          {Fingers::of(thresholds.text(0)),
           {thresholds.real(1), {thresholds.real(2), thresholds.real(3)}},
           thresholds.is_null(4) ? std::nullopt : std::optional(thresholds.real(4))});
    }
    found.push_back(std::move(session));
  }
  return found;
}

namespace {

/// In the order that bind_score() gives them.
constexpr const char* kScoreColumns =
    "ending, done, time_s, largest_von_mises_pa, damaged_m3, path_m, peak_force_n, peak_wrist_n, "
    "best_visible_share, high_von_mises_pa";
constexpr const char* kScoreValues = "?, ?, ?, ?, ?, ?, ?, ?, ?, ?";

SqliteStatement& bind_score(SqliteStatement& row, Ending ending, const ExclusionScore& score) {
  row.bind(name_of(ending))
      .bind(std::int64_t{score.done ? 1 : 0})
      .bind_real(score.time_s)
      .bind_real(score.largest_von_mises_pa)
      .bind_real(score.damaged_m3)
      .bind_real(score.path_m)
      .bind_real(score.peak_force_n)
      .bind_real(score.peak_wrist_n)
      .bind_real(score.best_visible_share);
  if (score.high_von_mises_pa) return row.bind_real(*score.high_von_mises_pa);
  return row.bind(std::optional<std::int64_t>());
}

constexpr const char* kConditionColumns = "friction, damage_pa, vertices, tetrahedra";
SqliteStatement& bind_conditions(SqliteStatement& row, const std::optional<AttemptConditions>& conditions) {
  if (!conditions) {
    const std::optional<std::int64_t> none;
    return row.bind(none).bind(none).bind(none).bind(none);
  }
  return row.bind_real(conditions->friction)
      .bind_real(conditions->damage_pa)
      .bind(conditions->vertices)
      .bind(conditions->tetrahedra);
}

}  // namespace

void TrainingDatabase::add_attempt(const Trainee& trainee, const ExclusionRecord& record, UtcTime began) {
  const auto flag = [](bool is) { return std::int64_t{is ? 1 : 0}; };
  SqliteStatement row =
      state_->statement(std::string("INSERT INTO attempts (trainee, began_us, session, test, stress_shown, "
                                    "object, fingers, instrument, ") +
                        kScoreColumns + ", " + kConditionColumns + ") VALUES (?, ?, ?, ?, ?, ?, ?, ?, " +
                        kScoreValues + ", ?, ?, ?, ?)");
  row.bind(trainee.id)
      .bind(std::int64_t{began.time_since_epoch().count()})
      .bind(std::int64_t{record.session})
      .bind(flag(record.test))
      .bind(flag(record.stress_shown))
      .bind(record.object)
      .bind(static_cast<std::int64_t>(record.fingers))
      .bind(record.instrument);
  bind_conditions(bind_score(row, record.ending, record.score), record.conditions).step();
}

std::int64_t TrainingDatabase::begin_attempt(const Trainee& trainee, ExclusionRecord record, UtcTime began) {
  record.ending = Ending::kBrokenOff;
  add_attempt(trainee, record, began);
  return sqlite3_last_insert_rowid(state_->database.get());
}

void TrainingDatabase::end_attempt(std::int64_t attempt, Ending ending, const ExclusionScore& score) {
  SqliteStatement row = state_->statement(std::string("UPDATE attempts SET (") + kScoreColumns + ") = (" +
                                          kScoreValues + ") WHERE id = ?");
  bind_score(row, ending, score).bind(attempt).step();
  if (sqlite3_changes(state_->database.get()) != 1)
    throw UsageError("there is no attempt " + std::to_string(attempt) + " among these results");
}

void TrainingDatabase::keep_conditions(std::int64_t attempt, const AttemptConditions& conditions) {
  SqliteStatement row = state_->statement(std::string("UPDATE attempts SET (") + kConditionColumns +
                                          ") = (?, ?, ?, ?) WHERE id = ?");
  bind_conditions(row, conditions).bind(attempt).step();
  if (sqlite3_changes(state_->database.get()) != 1)
    throw UsageError("there is no attempt " + std::to_string(attempt) + " among these results");
}

void TrainingDatabase::keep_case(std::int64_t attempt, const std::string& case_id) {
  state_->statement("UPDATE attempts SET sealed_case = ? WHERE id = ?").bind(case_id).bind(attempt).step();
  if (sqlite3_changes(state_->database.get()) != 1)
    throw UsageError("there is no attempt " + std::to_string(attempt) + " among these results");
}

void TrainingDatabase::require_assessable(std::int64_t attempt) const {
  SqliteStatement row = state_->statement("SELECT ending, sealed_case FROM attempts WHERE id = ?");
  row.bind(attempt);
  if (!row.step())
    throw UsageError("there is no attempt " + std::to_string(attempt) + " among these results");
  if (const std::string sealed = row.text(1); !sealed.empty())
    throw UsageError("this attempt was sealed as " + sealed + " already");
  if (ending_named(row.text(0)) == Ending::kBrokenOff)
    throw UsageError("this attempt runs, or was broken off: nothing can be said of it");
}

void TrainingDatabase::keep_questionnaire(std::int64_t attempt, const Questionnaire& questionnaire) {
  require_sound(questionnaire);
  state_->whole([&] {
    require_assessable(attempt);
    SqliteStatement row = state_->statement(
        "INSERT OR REPLACE INTO questionnaires (attempt, organ_feel, useful, stress_helps, comment, account) "
        "VALUES (?, ?, ?, ?, ?, ?)");
    row.bind(attempt);
    for (const std::optional<int> answer : questionnaire.answers)
      row.bind(answer ? std::optional<std::int64_t>(*answer) : std::nullopt);
    row.bind(questionnaire.comment).bind(questionnaire.account).step();
  });
}

void TrainingDatabase::keep_checklist(std::int64_t attempt, const Checklist& checklist) {
  require_sound(checklist);
  state_->whole([&] {
    require_assessable(attempt);
    state_->statement("DELETE FROM checklist_items WHERE attempt = ?").bind(attempt).step();
    state_->statement("DELETE FROM checklists WHERE attempt = ?").bind(attempt).step();
    state_
        ->statement("INSERT INTO checklists (attempt, global_rating, examiner, account) VALUES (?, ?, ?, ?)")
        .bind(attempt)
        .bind(std::int64_t{checklist.global_rating})
        .bind(checklist.examiner)
        .bind(checklist.account)
        .step();
    for (std::size_t i = 0; i < kChecklistItems.size(); ++i) {
      state_->statement("INSERT INTO checklist_items (attempt, item, state) VALUES (?, ?, ?)")
          .bind(attempt)
          .bind(std::string(kChecklistItems.at(i).name))
          .bind(std::string(name_of(checklist.items.at(i))))
          .step();
    }
  });
}

std::vector<ExclusionRecord> TrainingDatabase::attempts() const {
  std::map<std::int64_t, Questionnaire> questionnaires;
  SqliteStatement said = state_->statement(
      "SELECT attempt, organ_feel, useful, stress_helps, comment, account FROM questionnaires");
  while (said.step()) {
    Questionnaire& questionnaire = questionnaires[said.integer(0)];
    for (std::size_t i = 0; i < kQuestions.size(); ++i) {
      const int column = static_cast<int>(i) + 1;
      if (!said.is_null(column)) questionnaire.answers.at(i) = static_cast<int>(said.integer(column));
    }
    questionnaire.comment = said.text(4);
    questionnaire.account = said.text(5);
  }
  std::map<std::int64_t, Checklist> checklists;
  SqliteStatement ticked = state_->statement(
      "SELECT attempt, item, state, global_rating, examiner, account FROM checklist_items JOIN checklists "
      "USING (attempt)");
  while (ticked.step()) {
    Checklist& checklist = checklists[ticked.integer(0)];
    const auto item = std::ranges::find(kChecklistItems, ticked.text(1), &ChecklistItem::name);
    const std::optional<ItemState> state = item_state(ticked.text(2));
    if (item == kChecklistItems.end() || !state)
      throw Error(state_->file.string() + " has a checklist that this version of kiroku does not know");
    checklist.items.at(static_cast<std::size_t>(item - kChecklistItems.begin())) = *state;
    checklist.global_rating = static_cast<int>(ticked.integer(3));
    checklist.examiner = ticked.text(4);
    checklist.account = ticked.text(5);
  }
  std::vector<ExclusionRecord> found;
  SqliteStatement rows = state_->statement(
      "SELECT name, study_group, simulated, session, test, stress_shown, object, fingers, done, time_s, "
      "largest_von_mises_pa, damaged_m3, path_m, peak_force_n, peak_wrist_n, best_visible_share, ending, "
      "attempts.id, sealed_case, friction, damage_pa, vertices, tetrahedra, high_von_mises_pa, instrument "
      "FROM attempts "
      "JOIN trainees ON "
      "trainee = trainees.id ORDER BY attempts.id");
  while (rows.step()) {
    ExclusionRecord record;
    record.trainee = rows.text(0);
    record.group = rows.text(1);
    record.simulated = rows.integer(2) != 0;
    record.session = static_cast<int>(rows.integer(3));
    record.test = rows.integer(4) != 0;
    record.stress_shown = rows.integer(5) != 0;
    record.object = rows.text(6);
    record.fingers = static_cast<std::size_t>(rows.integer(7));
    record.score = {
        rows.integer(8) != 0, rows.real(9),  rows.real(10),
        rows.real(11),        rows.real(12), rows.real(13),
        rows.real(14),        rows.real(15), rows.is_null(23) ? std::nullopt : std::optional(rows.real(23))};
    record.ending = ending_named(rows.text(16));
    record.number = rows.integer(17);
    record.sealed_case = rows.text(18);
    record.instrument = rows.text(24);
    if (!rows.is_null(19))
      record.conditions = AttemptConditions{rows.real(19), rows.real(20), rows.integer(21), rows.integer(22)};
    if (const auto filled = questionnaires.find(record.number); filled != questionnaires.end())
      record.questionnaire = filled->second;
    if (const auto filled = checklists.find(record.number); filled != checklists.end())
      record.checklist = filled->second;
    found.push_back(std::move(record));
  }
  return found;
}

}  // namespace kiroku::trainer
