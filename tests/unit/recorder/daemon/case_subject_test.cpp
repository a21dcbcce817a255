#include "recorder/daemon/case_subject.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/procedure/procedure_book.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class KnownProcedure : public ProcedureSource {
 public:
  [[nodiscard]] ProcedureChoice choose(UtcTime at) const override {
    ++asked;
    if (fails) throw Error("the worklist's answer is cut off");
    if (book) return book->choose({{}, 12h}, at);
    return {known, known ? Doubt::kNone : doubts, is_by_plan};
  }
  [[nodiscard]] Objection objection(const ProcedureChoice& /*taken*/, UtcTime /*at*/) const override {
    return against;
  }
  [[nodiscard]] std::vector<ProcedureData> list(UtcTime) const override { return {}; }
  void hurry() override { ++hurried; }
  void ended(const ProcedureData& data, UtcTime) override { ended_of.push_back(data.patient_id); }
  [[nodiscard]] std::vector<ProcedureWay> ways() const override {
    return {{"worklist", false, "the server does not answer"}};
  }

  std::optional<ProcedureData> known;
  std::optional<ProcedureBook> book;  // in its place
  bool fails = false, is_by_plan = false;
  Doubt doubts = Doubt::kNone;
  Objection against = Objection::kNone;
  std::vector<std::string> ended_of;
  mutable int asked = 0;
  int hurried = 0;
};

class CaseSubjectTest : public testing::Test {
 protected:
  static ProcedureData somebody() {
    ProcedureData data;
    data.patient_id = "4711";
    return data;
  }
  const std::shared_ptr<KnownProcedure> source = std::make_shared<KnownProcedure>();
  std::vector<std::string> told;
  CaseSubject subject{source, [this](const std::string& sentence) { told.push_back(sentence); }};
};

TEST_F(CaseSubjectTest, WhatAPersonGaveIsTakenAndNothingLookedFor) {
  source->known = somebody();
  const auto found = subject.at_beginning({}, to_bytes("{}"), GoesOn::kNo);
  EXPECT_EQ(found.state, SubjectState::kGiven);
  EXPECT_EQ(found.json, to_bytes("{}"));
  EXPECT_EQ(source->asked, 0);
  EXPECT_EQ(subject.why_missing(), std::nullopt);
  EXPECT_EQ(subject.late(Clock::Time(1h)), std::nullopt);
}

TEST_F(CaseSubjectTest, WhatIsKnownIsFound) {
  source->known = somebody();
  const auto found = subject.at_beginning({}, {}, GoesOn::kNo);
  EXPECT_EQ(found.state, SubjectState::kFound);
  EXPECT_EQ(found.json, subject_json(somebody()));
  EXPECT_EQ(subject.why_missing(), std::nullopt);
}

TEST_F(CaseSubjectTest, TellsWhomAnEndedCaseWasAbout) {
  source->known = somebody();
  subject.at_beginning({}, {}, GoesOn::kNo);
  subject.ended({});
  subject.ended({});
  EXPECT_THAT(source->ended_of, ElementsAre("4711")) << "once";
  subject.at_beginning({}, to_bytes(R"({"patient":{"id":"12"}})"), GoesOn::kNo);
  subject.ended({});
  source->known.reset();
  subject.at_beginning({}, {}, GoesOn::kNo);
  subject.ended({});
  subject.at_beginning({}, {}, GoesOn::kNo);
  subject.given_while_running(to_bytes(R"({"patient":{"id":"13"}})"));
  subject.ended({});
  subject.at_beginning({}, to_bytes("{}"), GoesOn::kNo);
  subject.ended({});
  EXPECT_THAT(source->ended_of, ElementsAre("4711", "12", "13")) << "of whom anything is known";
}

TEST_F(CaseSubjectTest, ACaseThatCarriesOnAnotherTakesItsSubject) {
  source->known = somebody();
  const auto found = subject.at_beginning({}, {}, GoesOn::kWithSubject);
  EXPECT_EQ(found.state, SubjectState::kCarriedOver);
  EXPECT_EQ(found.json, std::nullopt);
  EXPECT_EQ(source->asked, 0);
}

TEST_F(CaseSubjectTest, LooksEachSecondUntilSomethingIsKnownAndTellsItOnce) {
  EXPECT_EQ(subject.at_beginning({}, {}, GoesOn::kNo).state, SubjectState::kNone);
  EXPECT_EQ(subject.why_missing(),
            "the case begins without procedure data; worklist: the server does not answer");
  EXPECT_EQ(source->hurried, 1);
  EXPECT_EQ(subject.late(Clock::Time(10s)), std::nullopt);
  source->known = somebody();
  EXPECT_EQ(subject.late(Clock::Time(10s + 999ms)), std::nullopt) << "not yet a second later";
  EXPECT_EQ(source->asked, 3) << "for the case, for why nobody was taken, and a second ago";
  EXPECT_EQ(subject.late(Clock::Time(11s)), subject_json(somebody()));
  EXPECT_EQ(subject.late(Clock::Time(12s)), std::nullopt);
}

// Who begins it in another process knows whom it is about no more than it was told.
TEST_F(CaseSubjectTest, ACaseThatGoesOnAfterACrashIsToldOfWhenItEnds) {
  subject.at_beginning({}, {}, GoesOn::kWithSubject, somebody());
  EXPECT_EQ(subject.about(), somebody());
  subject.ended({});
  EXPECT_THAT(source->ended_of, ElementsAre("4711"));
}

TEST_F(CaseSubjectTest, TellsOfAnotherPatientWhoIsNamedMeanwhile) {
  source->known = somebody();
  subject.at_beginning({}, {}, GoesOn::kNo);
  EXPECT_EQ(subject.contradicted(Clock::Time(10s)), std::nullopt) << "the same one";
  source->known.reset();
  EXPECT_EQ(subject.contradicted(Clock::Time(20s)), std::nullopt) << "nobody";
  source->known = somebody();
  source->known->patient_id = "12";
  EXPECT_EQ(subject.contradicted(Clock::Time(29s)), std::nullopt) << "not yet ten seconds later";
  EXPECT_THAT(subject.contradicted(Clock::Time(30s)).value_or(""),
              HasSubstr("another patient for this room"));
  EXPECT_EQ(subject.contradicted(Clock::Time(40s)), std::nullopt) << "once";
  EXPECT_EQ(subject.about(), somebody()) << "it stays about whom it was";
  // Whom a person gave stands against whatever messages say.
  subject.at_beginning({}, to_bytes(R"({"patient":{"id":"13"}})"), GoesOn::kNo);
  EXPECT_EQ(subject.contradicted(Clock::Time(50s)), std::nullopt);
  subject.at_beginning({}, {}, GoesOn::kNo);
  subject.given_while_running(to_bytes(R"({"patient":{"id":"13"}})"));
  EXPECT_EQ(subject.contradicted(Clock::Time(60s)), std::nullopt);
}

TEST_F(CaseSubjectTest, TellsEachObjectionOnceUntilThePatientHasLeft) {
  source->known = somebody();
  subject.at_beginning({}, {}, GoesOn::kNo);
  Clock::Time now{};
  const auto told_now = [&](Objection against) {
    source->against = against;
    now += 10s;
    return subject.contradicted(now).value_or("");
  };
  EXPECT_EQ(told_now(Objection::kNone), "");
  EXPECT_THAT(told_now(Objection::kTakenBack), HasSubstr("take back"));
  EXPECT_EQ(told_now(Objection::kTakenBack), "") << "once";
  EXPECT_THAT(told_now(Objection::kSeveralThere), HasSubstr("placed another patient in this room, too"));
  EXPECT_EQ(told_now(Objection::kOver), "");
  EXPECT_EQ(told_now(Objection::kOtherIdentity), "") << "what is corrected of whoever has left";
  EXPECT_THAT(told_now(Objection::kAnotherThere), HasSubstr("another patient for this room"));
  subject.at_beginning({}, {}, GoesOn::kNo);
  EXPECT_THAT(told_now(Objection::kOtherIdentity), HasSubstr("another number, name or day of birth"));
  subject.given_while_running(to_bytes(R"({"patient":{"id":"13"}})"));
  EXPECT_EQ(told_now(Objection::kTakenBack), "") << "whom a person gave stands against whatever messages say";
}

// A worklist drops a step that has begun.
TEST_F(CaseSubjectTest, WhoIsPlannedForLaterIsNoOther) {
  source->is_by_plan = true;
  source->known = somebody();
  source->known->planned = "2026-08-05T08:00:00+02:00";
  subject.at_beginning({}, {}, GoesOn::kNo);
  source->known->patient_id = "12";
  source->known->planned = "2026-08-05T08:40:00+02:00";
  EXPECT_EQ(subject.contradicted(Clock::Time(10s)), std::nullopt);
  source->known->planned = "2026-08-05T07:40:00+02:00";
  EXPECT_TRUE(subject.contradicted(Clock::Time(20s)));
  // Registered ahead of time they are the next one, too: whom an event brings is an objection.
  source->known = somebody();
  source->known->planned = "2026-08-05T08:00:00+02:00";
  subject.at_beginning({}, {}, GoesOn::kNo);
  source->known->patient_id = "12";
  source->known->planned = "2026-08-05T08:40:00+02:00";
  source->is_by_plan = false;
  EXPECT_EQ(subject.contradicted(Clock::Time(30s)), std::nullopt);
}

// Around now is the next patient, as soon as they are booked.
TEST_F(CaseSubjectTest, AnOperationThatGoesOnWithoutASubjectLooksForNone) {
  source->known = somebody();
  EXPECT_EQ(subject.at_beginning({}, {}, GoesOn::kWithoutSubject).state, SubjectState::kNone);
  EXPECT_THAT(subject.why_missing().value_or(""), HasSubstr("a person must say whom it is about"));
  EXPECT_EQ(subject.late(Clock::Time(1h)), std::nullopt);
  EXPECT_EQ(source->asked, 0);
  subject.at_beginning({}, {}, GoesOn::kNo);
  EXPECT_EQ(subject.why_missing(), std::nullopt) << "the next operation's case";
}

// It had one: nobody is to read that none was known.
TEST_F(CaseSubjectTest, AnOperationThatGoesOnWithItsSubjectWithheldSaysSoAndLooksForNone) {
  source->known = somebody();
  CaseSubject without_source(nullptr, {});
  for (CaseSubject* const each : {&subject, &without_source}) {
    EXPECT_EQ(each->at_beginning({}, {}, GoesOn::kSubjectWithheld).state, SubjectState::kNone);
    const std::string why = each->why_missing().value_or("");
    EXPECT_THAT(why, HasSubstr("after one whose subject it is not given"));
    EXPECT_THAT(why, HasSubstr("a person must say whom it is about"));
    EXPECT_THAT(why, testing::Not(HasSubstr("no subject is known")));
    EXPECT_EQ(each->late(Clock::Time(1h)), std::nullopt);
    each->at_beginning({}, to_bytes("typed"), GoesOn::kSubjectWithheld);
    EXPECT_EQ(each->why_missing(), std::nullopt) << "a person said it";
  }
  EXPECT_EQ(source->asked, 0);
}

TEST_F(CaseSubjectTest, WhatIsPlannedForLaterBecomesNoRunningCasesByItself) {
  const UtcTime begun(std::chrono::sys_days(std::chrono::year(2026) / 8 / 5) + 9h);
  source->book.emplace();
  subject.at_beginning(begun, {}, GoesOn::kNo);
  const auto book = [&](const std::string& patient, UtcTime planned) {
    ProcedureMessage message;
    message.kind = ProcedureMessage::Kind::kAppointment;
    message.appointment = message.patient = message.data.patient_id = patient;
    message.planned = planned;
    source->book->take(message, begun + 1min);
  };
  book("4712", begun + 7h);
  EXPECT_EQ(subject.late(Clock::Time(10s)), std::nullopt);
  book("4711", begun + 1h);
  EXPECT_THAT(std::string(text_of(subject.late(Clock::Time(20s)).value_or(Bytes()))), HasSubstr("4711"))
      << "it is looked for still";
}

// A patient who was placed in the room may have an appointment at any time.
TEST_F(CaseSubjectTest, WhoIsPlacedInTheRoomBecomesItsPatientWhateverIsPlanned) {
  subject.at_beginning({}, {}, GoesOn::kNo);
  source->known = somebody();
  source->known->planned = "2026-08-05T16:00:00+00:00";
  EXPECT_EQ(subject.late(Clock::Time(10s)), subject_json(*source->known));
}

TEST_F(CaseSubjectTest, SaysThatTwoPatientsCouldBeMeant) {
  source->doubts = Doubt::kTwoPlanned;
  subject.at_beginning({}, {}, GoesOn::kNo);
  EXPECT_EQ(subject.why_missing(),
            "the case begins without procedure data; two patients are planned equally near to its beginning, "
            "and a person must choose; worklist: the server does not answer");
}

TEST_F(CaseSubjectTest, SaysThatWhatIsPlannedLiesTooFarAhead) {
  source->doubts = Doubt::kTooEarly;
  subject.at_beginning({}, {}, GoesOn::kNo);
  EXPECT_THAT(subject.why_missing().value_or(""),
              HasSubstr("lies more than an hour ahead, and a person must choose"));
}

TEST_F(CaseSubjectTest, StopsLookingWhereAPersonGaveOneWhileTheCaseRan) {
  subject.at_beginning({}, {}, GoesOn::kNo);
  subject.given_while_running(to_bytes("{}"));
  source->known = somebody();
  EXPECT_EQ(subject.late(Clock::Time(1h)), std::nullopt);
}

TEST_F(CaseSubjectTest, ASourceThatFailsIsToldAndKeepsNoCaseFromBeginning) {
  source->fails = true;
  EXPECT_EQ(subject.at_beginning({}, {}, GoesOn::kNo).state, SubjectState::kNone);
  EXPECT_THAT(told, ElementsAre(HasSubstr("procedure data cannot be looked up: the worklist's answer")));
}

TEST_F(CaseSubjectTest, WithoutProcedureDataNothingIsMissed) {
  CaseSubject alone({}, [this](const std::string& sentence) { told.push_back(sentence); });
  EXPECT_EQ(alone.at_beginning({}, {}, GoesOn::kNo).state, SubjectState::kNone);
  EXPECT_EQ(alone.why_missing(), std::nullopt);
  EXPECT_EQ(alone.late(Clock::Time(1h)), std::nullopt);
  EXPECT_THAT(told, IsEmpty());
}

}  // namespace
}  // namespace kiroku::recorder
