#include "recorder/procedure/worklist.h"

#include <atomic>
#include <ctime>
#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "media/box/child.h"
#include "tests/support/child_processes.h"
#include "tests/support/eventually.h"
#include "tests/support/moved_clock.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/worklist_server.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

std::string local(UtcTime time, const char* format) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(
      std::chrono::time_point_cast<std::chrono::system_clock::duration>(time));
  std::tm here{};
  localtime_r(&seconds, &here);
  char text[16];
  std::strftime(text, sizeof text, format, &here);
  return text;
}

/// Skips where the server is not installed.
class WorklistTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::has_worklist_server()) GTEST_SKIP() << "wlmscpfs is not installed (Debian package dcmtk)";
  }
  void add(const std::string& id, const std::string& name, UtcTime planned,
           const std::string& station = "ENDO1", const std::string& charset = "ISO_IR 192") {
    server.add(id, name, local(planned, "%Y%m%d"), local(planned, "%H%M"), station, charset);
  }
  [[nodiscard]] WorklistOptions options() const {
    WorklistOptions options;
    options.host = "127.0.0.1";
    options.port = server.port();
    options.called_ae = "RIS";
    options.timeout = 5s;
    return options;
  }
  const test::TemporaryFolder folder;
  test::WorklistServer server{folder.path()};
  const UtcTime now = std::chrono::floor<std::chrono::minutes>(utc_now());
};

TEST_F(WorklistTest, ReadsTheStepsOfTheDay) {
  add("1", "Müller^Jörg^Q", now);
  add("2", "Other^Day", now + 72h);
  server.start();
  const WorklistAnswer answer = ask_worklist(options(), now);
  EXPECT_EQ(answer.problem, "");
  ASSERT_THAT(answer.items, SizeIs(1));
  EXPECT_EQ(answer.items[0].planned, now);
  ProcedureData data = answer.items[0].data;
  EXPECT_EQ(data.planned, local(now, "%Y-%m-%dT") + local(now, "%H:%M"));
  data.planned = "";
  const auto subject = nlohmann::json::parse(text_of(subject_json(data)));
  EXPECT_EQ(subject, nlohmann::json::parse(R"({"patient":{"id":"1","family":"Müller","given":"Jörg Q",
      "name":"Müller^Jörg^Q","birth_date":"1980-01-15","sex":"F"},
      "procedure":{"description":"Colonoscopy 1","id":"P1","accession":"A1","study_uid":"1.2.826.0.1.1",
                   "location":"Room 1"},
      "staff":[{"role":"performing","family":"Cutter","given":"Carla M","name":"Cutter^Carla^M"},
               {"role":"requesting","family":"Asks","given":"Ann","name":"Asks^Ann"}],
      "origin":"worklist"})"))
      << subject.dump(1);
}

TEST_F(WorklistTest, AsksForItsStationAlone) {
  add("1", "A^A", now);
  add("2", "B^B", now, "ENDO2");
  server.start();
  EXPECT_THAT(ask_worklist(options(), now).items, SizeIs(2));
  WorklistOptions one = options();
  one.station_ae = "ENDO2";
  const WorklistAnswer answer = ask_worklist(one, now);
  ASSERT_THAT(answer.items, SizeIs(1));
  EXPECT_EQ(answer.items[0].data.patient_id, "2");
  one.modality = "CT";
  EXPECT_THAT(ask_worklist(one, now).items, IsEmpty());
}

TEST_F(WorklistTest, ReadsNamesInTheirCharacterSet) {
  add("1", "M\xFCller^J\xF6rg", now, "LATIN", "ISO_IR 100");
  add("2", "Yamada^Tarou=\x1B$B;3ED\x1B(B^\x1B$BB@O:\x1B(B", now, "JAPAN", "\\ISO 2022 IR 87");
  server.start();
  WorklistOptions one = options();
  one.station_ae = "LATIN";
  const auto latin = ask_worklist(one, now);
  ASSERT_THAT(latin.items, SizeIs(1)) << latin.problem;
  EXPECT_EQ(latin.items[0].data.patient.family, "Müller");
  one.station_ae = "JAPAN";
  const auto japan = ask_worklist(one, now);
  ASSERT_THAT(japan.items, SizeIs(1)) << japan.problem;
  EXPECT_EQ(japan.items[0].data.patient, (PersonName{"Yamada", "Tarou", "Yamada^Tarou=山田^太郎"}));
}

// A name of 5,000 bytes took the whole list away. The step that it names keeps its place: another patient's
// is not taken for it.
TEST_F(WorklistTest, AStepThatSaysMoreThanIsKeptCostsItselfAlone) {
  add("1", "Near^Er", now + 10min);
  add("2", std::string(5000, 'L') + "^Long", now + 2h);
  add("3", "Far^Ther", now + 6h);
  server.start();
  const WorklistAnswer answer = ask_worklist(options(), now);
  EXPECT_EQ(answer.problem, "");
  ASSERT_THAT(answer.items, SizeIs(3));
  const auto nearest_to = [&](UtcTime at) {
    const auto step = nearest_step(answer, now, at, 12h);
    return step ? step->patient_id : "none";
  };
  EXPECT_EQ(nearest_to(now), "1");
  EXPECT_EQ(nearest_to(now + 2h), "none");
  EXPECT_EQ(nearest_to(now + 6h), "3");
  EXPECT_EQ(left_out_of(answer),
            "1 step says more of a patient and a procedure than is kept, and cannot be chosen");

  std::mutex mutex;
  std::vector<std::string> told;
  const Worklist worklist(options(), [&](const std::string& sentence) {
    const std::lock_guard guard(mutex);
    told.push_back(sentence);
  });
  ASSERT_TRUE(test::eventually([&] { return worklist.find(now).has_value(); })) << worklist.way().state;
  EXPECT_EQ(worklist.find(now + 2h), std::nullopt);
  EXPECT_THAT(worklist.list(now), SizeIs(2));
  EXPECT_THAT(worklist.way().state, HasSubstr("1 step says more of a patient"));
  ASSERT_TRUE(test::eventually([&] {
    const std::lock_guard guard(mutex);
    return !told.empty();
  }));
  EXPECT_THAT(told[0], HasSubstr("the worklist of RIS: 1 step says more"));
}

WorklistItem item_of(const std::string& patient, std::optional<UtcTime> planned,
                     std::optional<TimeSpan> within = {}) {
  WorklistItem item;
  item.data.patient_id = patient;
  item.planned = planned;
  item.within = within;
  return item;
}

// It was passed over, and another patient's was taken.
TEST(WorklistStep, OneWhoseTimeCannotBeReadKeepsOthersFromBeingTaken) {
  const UtcTime now = *parse_utc("2026-08-05T09:00:00Z"), day = *parse_utc("2026-08-05T00:00:00Z");
  const auto of = [&](const std::vector<WorklistItem>& items) {
    WorklistAnswer answer;
    answer.items = items;
    const auto step = nearest_step(answer, now, now, 12h);
    return step ? step->patient_id : doubt_of(answer, now, 12h) == Doubt::kTimeUnclear ? "unclear" : "none";
  };
  const TimeSpan today{day, day + 24h}, tomorrow{day + 24h, day + 48h}, next_week{day + 168h, day + 192h};
  const WorklistItem near = item_of("1", now - 10min);
  EXPECT_EQ(of({near}), "1");
  EXPECT_EQ(of({near, item_of("2", {}, today)}), "unclear");
  EXPECT_EQ(of({near, item_of("2", {})}), "unclear");
  EXPECT_EQ(of({item_of("2", {}, today)}), "unclear");
  EXPECT_EQ(of({near, item_of("2", {}, tomorrow)}), "1");
  EXPECT_EQ(of({item_of("2", {}, next_week)}), "none");
  EXPECT_EQ(of({near, item_of("1", {}, today)}), "1") << "the same patient's";
  WorklistItem left_out = item_of("", {}, today);
  left_out.is_left_out = true;
  EXPECT_EQ(of({near, left_out}), "unclear");
  WorklistAnswer answer;
  answer.items = {near, item_of("2", {}, today)};
  EXPECT_THAT(left_out_of(answer), HasSubstr("1 step states no time, or one that cannot be read"));
}

TEST(WorklistStep, OneThatIsDoneWithIsPassedOver) {
  const UtcTime now = *parse_utc("2026-08-05T09:00:00Z");
  WorklistAnswer answer;
  answer.items = {item_of("1", now - 10min), item_of("2", now + 30min)};
  const auto with = [&](Standing standing) {
    return [standing](const ProcedureData& data, std::optional<UtcTime>) {
      return data.patient_id == "1" ? standing : Standing::kOpen;
    };
  };
  EXPECT_EQ(nearest_step(answer, now, now, 12h, with(Standing::kOpen)).value().patient_id, "1");
  EXPECT_EQ(nearest_step(answer, now, now, 12h, with(Standing::kDone)).value().patient_id, "2");
  EXPECT_EQ(nearest_step(answer, now, now, 12h, with(Standing::kDoubtful)), std::nullopt);
  EXPECT_EQ(doubt_of(answer, now, 12h, with(Standing::kDoubtful)), Doubt::kLeftAlready);
}

TEST(WorklistStep, WhereAnEarlierOneIsOpenAPersonChooses) {
  const UtcTime now = *parse_utc("2026-08-05T09:00:00Z");
  WorklistAnswer answer;
  answer.items = {item_of("1", now - 70min), item_of("2", now + 10min)};
  const auto with = [&](Standing standing) {
    return [standing](const ProcedureData& data, std::optional<UtcTime>) {
      return data.patient_id == "1" ? standing : Standing::kOpen;
    };
  };
  EXPECT_EQ(nearest_step(answer, now, now, 12h, with(Standing::kOpen)), std::nullopt);
  EXPECT_EQ(doubt_of(answer, now, 12h, with(Standing::kOpen)), Doubt::kEarlierOpen);
  for (const Standing standing : {Standing::kRecorded, Standing::kDone})
    EXPECT_EQ(nearest_step(answer, now, now, 12h, with(standing)).value().patient_id, "2");
  EXPECT_EQ(nearest_step(answer, now, now, 1h, with(Standing::kOpen)).value().patient_id, "2")
      << "longer ago than the window";
  EXPECT_EQ(nearest_step(answer, now, now - 40min, 12h, with(Standing::kOpen)).value().patient_id, "1");
  EXPECT_TRUE(nearest_step(answer, now, now, 12h)) << "who does not know what was recorded";
  answer.items[1].data.patient_id = "1";
  EXPECT_TRUE(nearest_step(answer, now, now, 12h, with(Standing::kOpen))) << "one patient's";
  answer.items[0].is_left_out = true;
  EXPECT_EQ(doubt_of(answer, now, 12h, with(Standing::kOpen)), Doubt::kEarlierOpen);
}

TEST_F(WorklistTest, ReadsTimesStrictlyAndAsAcrNemaWroteThem) {
  const std::string day = local(now, "%Y%m%d");
  struct Case {
    std::string date, time, planned;  // "09:15:20"; "day", "any"
  };
  const std::vector<Case> cases{
      {day, "0915", "09:15:00"}, {day, "091520", "09:15:20"},   {day, "091520.123456", "09:15:20"},
      {day, "09", "09:00:00"},   {day, "09:15:20", "09:15:20"}, {day, "09:15", "09:15:00"},
      {day, "2400", "day"},      {day, "915", "day"},           {day, "09:1520", "day"},
      {day, "noon", "day"}};
  for (std::size_t i = 0; i < cases.size(); ++i)
    server.add(std::to_string(i), "A^A", cases[i].date, cases[i].time);
  server.start();
  const WorklistAnswer answer = ask_worklist(options(), now);
  ASSERT_THAT(answer.items, SizeIs(cases.size())) << answer.problem;
  for (const WorklistItem& item : answer.items) {
    const Case& stated = cases.at(std::stoul(item.data.patient_id));
    const std::string read = item.planned ? local(*item.planned, "%H:%M:%S") : item.within ? "day" : "any";
    EXPECT_EQ(read, stated.planned) << stated.date << " " << stated.time;
    if (!item.within) continue;
    EXPECT_EQ(local(item.within->earliest, "%Y%m%d%H%M"), day + "0000");
  }
  EXPECT_THAT(left_out_of(answer), HasSubstr("4 steps state no time, or one that cannot be read"));
}

// Together they are longer than an answer of the box may be.
TEST_F(WorklistTest, ManyLongStepsTakeNoOtherAway) {
  constexpr int kLong = 75;
  for (int i = 0; i < kLong; ++i) add(std::to_string(i + 2), std::string(60'000, 'L') + "^Long", now + 1h);
  add("1", "Near^Er", now);
  server.start();
  const WorklistAnswer answer = ask_worklist(options(), now);
  EXPECT_EQ(answer.problem, "");
  EXPECT_THAT(answer.items, SizeIs(kLong + 1));
  EXPECT_THAT(left_out_of(answer), HasSubstr("75 steps say"));
  EXPECT_TRUE(nearest_step(answer, now, now, 12h).has_value());
}

// Who answers for a name is foreign, too.
TEST(WorklistBox, HasItsLimitsBeforeANameIsLookedUp) {
  const Descriptor memory = media::make_shared_memory(4096);
  const media::BoxedChild child("worklist", memory);  // it is asked nothing yet
  EXPECT_TRUE(test::eventually(
      [&] { return test::line_of_process(child.process(), "status", "NoNewPrivs:") == "1"; }));
  const auto has = [&](const char* limit, const char* most) {
    return test::line_of_process(child.process(), "limits", limit).find(most) != std::string::npos;
  };
  EXPECT_TRUE(test::eventually([&] { return has("Max open files", "64"); }));
  EXPECT_TRUE(test::eventually([&] { return has("Max file size", "0"); }));
  EXPECT_TRUE(test::eventually([&] { return has("Max cpu time", "60"); }));
}

// What is nearest to the right time may be no part of an answer around a wrong one.
TEST_F(WorklistTest, AnAnswerFromBeforeTheClockWasSetIsNotChosenFrom) {
  test::MovedClock time(now + 20h);
  add("tomorrow", "Abe^Akiko", now + 21h);
  server.start();
  WorklistOptions rarely = options();
  rarely.refresh = 10min;
  const Worklist worklist(rarely, {}, time);
  ASSERT_TRUE(test::eventually([&] { return worklist.find(time.utc()).has_value(); }))
      << worklist.way().state;
  time.await_waiting(1);
  time.set_utc(now + 12h);  // within the window of both
  EXPECT_EQ(worklist.find(time.utc()), std::nullopt);
  EXPECT_THAT(worklist.list(time.utc()), SizeIs(0));
  EXPECT_TRUE(worklist.find(now + 12h) == std::nullopt);
  time.move(5s);  // it is asked again soon
  EXPECT_TRUE(test::eventually([&] { return worklist.list(time.utc()).size() == 1; }))
      << worklist.way().state;
}

// A step that was called off while the worklist was away went on naming its patient for the whole window.
TEST_F(WorklistTest, AnAnswerThatIsOldWhileNoneComesIsForPeopleAlone) {
  test::MovedClock time(now);
  add("1", "Stale^Alice", now + 30min);
  server.start();
  WorklistOptions asked = options();
  asked.refresh = 1min;
  asked.timeout = 1s;
  const Worklist worklist(asked, {}, time);
  ASSERT_TRUE(test::eventually([&] { return worklist.find(time.utc()).has_value(); }))
      << worklist.way().state;
  time.await_waiting(1);
  server.stop();
  time.move(1min);
  ASSERT_TRUE(test::eventually([&] { return !worklist.way().well; }));
  EXPECT_TRUE(worklist.find(time.utc()).has_value()) << "it was asked a minute ago";
  EXPECT_THAT(worklist.way().state, HasSubstr("the worklist RIS at"));
  time.await_waiting(1);
  time.suspend(3min);
  EXPECT_EQ(worklist.find(time.utc()), std::nullopt);
  EXPECT_EQ(worklist.doubt(time.utc()), Doubt::kNone);
  const std::vector<ProcedureData> listed = worklist.list(time.utc());
  ASSERT_THAT(listed, SizeIs(1));
  EXPECT_EQ(listed[0].patient_id, "1");
  EXPECT_THAT(listed[0].chosen, HasSubstr("Z, 4 min before, and has not answered since"));
  EXPECT_THAT(worklist.way().state, testing::AllOf(HasSubstr("nothing is chosen from the list of "),
                                                   HasSubstr(", which is 4 min old: the worklist RIS at")));
  server.start();
  time.move(5min);
  EXPECT_TRUE(test::eventually([&] { return worklist.find(time.utc()).has_value(); }))
      << worklist.way().state;
}

// Nobody asked while the machine slept.
TEST_F(WorklistTest, AnAnswerFromBeforeTheMachineSleptIsNotChosenFrom) {
  test::MovedClock time(now);
  add("1", "Stale^Alice", now + 30min);
  server.start();
  WorklistOptions asked = options();
  asked.refresh = 1min;
  const Worklist worklist(asked, {}, time);
  ASSERT_TRUE(test::eventually([&] { return worklist.find(time.utc()).has_value(); }))
      << worklist.way().state;
  time.await_waiting(1);
  time.suspend(1h);
  EXPECT_EQ(worklist.find(time.utc()), std::nullopt);
  EXPECT_THAT(worklist.way().state, HasSubstr("which is 60 min old: it is asked again"));
  time.move(5s);
  EXPECT_TRUE(test::eventually([&] { return worklist.find(time.utc()).has_value(); }))
      << worklist.way().state;
}

TEST_F(WorklistTest, SaysWhyItCannotBeAsked) {
  EXPECT_THAT(ask_worklist(options(), now).problem, HasSubstr("the worklist RIS at 127.0.0.1:"))
      << "nobody listens";
  server.start();
  WorklistOptions wrong = options();
  wrong.called_ae = "NOBODY";
  EXPECT_THAT(ask_worklist(wrong, now).problem, HasSubstr("cannot be asked"));
}

TEST_F(WorklistTest, DoesNotWaitForAServerThatSaysNothing) {
  boost::asio::io_context context;
  boost::asio::ip::tcp::acceptor silent(context, {boost::asio::ip::make_address("127.0.0.1"), 0});
  WorklistOptions asked = options();
  asked.port = silent.local_endpoint().port();
  asked.timeout = 1s;
  EXPECT_THAT(ask_worklist(asked, now).problem, HasSubstr("cannot be asked"));
}

TEST_F(WorklistTest, IsAskedAgainUntilItAnswersAndKeepsTheNearestStep) {
  std::mutex mutex;
  std::vector<std::string> told;
  WorklistOptions often = options();
  often.refresh = 100ms;
  often.timeout = 1s;
  Worklist worklist(often, [&](const std::string& sentence) {
    const std::lock_guard guard(mutex);
    told.push_back(sentence);
  });
  const auto until = [](const auto& holds) { return test::eventually(holds); };
  ASSERT_TRUE(until([&] { return !worklist.way().well; }));
  EXPECT_EQ(worklist.find(now), std::nullopt);
  add("1", "Near^Er", now + 10min);
  add("2", "Far^Ther", now - 2h);
  server.start();
  worklist.hurry();
  ASSERT_TRUE(until([&] { return worklist.find(now).has_value(); })) << worklist.way().state;
  EXPECT_EQ(worklist.find(now)->patient_id, "1");
  EXPECT_EQ(worklist.find(now - 90min)->patient_id, "2");
  EXPECT_EQ(worklist.find(now - 40h), std::nullopt);
  EXPECT_EQ(worklist.find(now - 5h), std::nullopt) << "three hours before the first one";
  EXPECT_EQ(worklist.doubt(now - 5h), Doubt::kTooEarly);
  EXPECT_EQ(worklist.doubt(now), Doubt::kNone);
  EXPECT_THAT(worklist.way().state, HasSubstr("RIS listed 2 steps"));
  const std::lock_guard guard(mutex);
  ASSERT_THAT(told, SizeIs(2));
  EXPECT_THAT(told[0], HasSubstr("it is asked again"));
  EXPECT_THAT(told[1], HasSubstr("answers again"));
}

}  // namespace
}  // namespace kiroku::recorder
