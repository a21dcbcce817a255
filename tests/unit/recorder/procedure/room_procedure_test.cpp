#include "recorder/procedure/room_procedure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/eventually.h"
#include "tests/support/mllp_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/worklist_server.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;

/// Skips where the server is not installed.
class RoomProcedureTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::has_worklist_server()) GTEST_SKIP() << "wlmscpfs is not installed (Debian package dcmtk)";
    inbox->tend();
    server.add("W1", "Listed^Lisa", test::compact_local_time("%Y%m%d"), test::compact_local_time("%H%M"));
    server.start();
    WorklistOptions options;
    options.host = "127.0.0.1";
    options.port = server.port();
    options.called_ae = "RIS";
    room = std::make_unique<RoomProcedure>(inbox, ProcedureRule{{"OR1"}, 12h},
                                           std::make_unique<Worklist>(options, Worklist::Tell()));
    ASSERT_TRUE(test::eventually([&] { return room->find(utc_now()).has_value(); }));
  }
  void deliver(const std::string& type, const std::string& segments) {
    test::MllpClient client("127.0.0.1", inbox->port());
    client.send_message("MSH|^~\\&|HIS|H|||20260805080000||" + type + "|" + std::to_string(++number) +
                        "|P|2.5\r" + segments);
    EXPECT_THAT(client.receive().value_or(""), testing::HasSubstr("MSA|AA|"));
  }
  void adt(const std::string& event, const std::string& patient) {
    deliver("ADT^" + event, "PID|1||" + patient + "^^^H^MR\rPV1|1|I|OR1\r");
  }
  [[nodiscard]] std::string found() const {
    const UtcTime at = utc_now();
    const auto data = room->find(at);
    return data ? data->patient_id : room->doubt(at) == Doubt::kNone ? "nobody" : "in doubt";
  }
  const test::TemporaryFolder folder;
  test::WorklistServer server{folder.path()};
  const std::shared_ptr<ProcedureInbox> inbox =
      std::make_shared<ProcedureInbox>("mllp://127.0.0.1:0", ProcedureInbox::Tell());
  std::unique_ptr<RoomProcedure> room;
  int number = 0;
};

TEST_F(RoomProcedureTest, NobodyIsTakenFromTheWorklistWhereMessagesLeaveItInDoubt) {
  adt("A02", "1");
  EXPECT_EQ(found(), "1") << "who is there is there";
  adt("A02", "2");
  EXPECT_EQ(found(), "in doubt");
  EXPECT_EQ(room->doubt(utc_now()), Doubt::kSeveralThere);
  EXPECT_THAT(room->list(utc_now()), testing::SizeIs(3)) << "a person chooses";
  adt("A03", "2");
  EXPECT_EQ(found(), "in doubt");
  EXPECT_EQ(room->doubt(utc_now()), Doubt::kMayBeGone);
  adt("A03", "1");
  EXPECT_EQ(found(), "W1");
}

// Neither way says who lies there.
TEST_F(RoomProcedureTest, WhereMessagesAndWorklistPlanTwoPatientsNeitherIsTaken) {
  const std::string when = test::compact_local_time("%Y%m%d") + test::compact_local_time("%H%M");
  const auto book = [&](const std::string& event, const std::string& patient) {
    deliver("SIU^" + event, "SCH|A" + patient + "|F" + patient + "|||||||||^^^" + when + "\rPID|1||" +
                                patient + "^^^H^MR\rAIL|1||OR1\r");
  };
  book("S12", "7");
  EXPECT_EQ(found(), "in doubt");
  EXPECT_EQ(room->doubt(utc_now()), Doubt::kTwoWays);
  book("S15", "7");
  EXPECT_EQ(found(), "W1");
  book("S12", "W1");
  EXPECT_EQ(found(), "W1") << "both plan the same patient";
}

// Messages said that they left; the list names them still.
TEST_F(RoomProcedureTest, AStepOfWhoeverLeftTheRoomIsNotTaken) {
  adt("A02", "W1");
  EXPECT_EQ(found(), "W1");
  adt("A03", "W1");
  EXPECT_NE(found(), "W1");
}

TEST_F(RoomProcedureTest, WhatWasRecordedHereIsForAPersonToChooseAgain) {
  const UtcTime now = utc_now();
  const std::optional<ProcedureData> step = room->find(now);
  ASSERT_TRUE(step);
  room->ended(*step, now - 5min);
  EXPECT_EQ(found(), "W1") << "it goes on after a pause";
  EXPECT_EQ(room->find(now + 6min), std::nullopt);
  EXPECT_EQ(room->doubt(now + 6min), Doubt::kRecordedAlready);
  EXPECT_THAT(room->list(now), testing::SizeIs(1)) << "a person chooses";
  adt("A02", "W1");
  EXPECT_EQ(room->doubt(now + 6min), Doubt::kRecordedHere) << "it may be told late";
  adt("A03", "W1");
  adt("A02", "W1");
  EXPECT_EQ(room->find(now + 6min).value_or(ProcedureData()).patient_id, "W1") << "who came again is there";
}

/// Without a worklist.
class RoomOfMessages : public testing::Test {
 protected:
  void SetUp() override { inbox->tend(); }
  void deliver(const std::string& type, const std::string& segments) {
    test::MllpClient client("127.0.0.1", inbox->port());
    client.send_message("MSH|^~\\&|HIS|H|||||" + type + "|" + std::to_string(++number) + "|P|2.5\r" +
                        segments);
    EXPECT_THAT(client.receive().value_or(""), testing::HasSubstr("MSA|AA|"));
  }
  void move(const std::string& patient, const std::string& place) {
    deliver("ADT^A02", "PID|1||" + patient + "^^^H^MR\rPV1|1|I|" + place + "\r");
  }
  void book(const std::string& patient, UtcTime time) {
    std::string when = format_utc(time).substr(0, 19);
    std::erase_if(when, [](char each) { return each == '-' || each == ':' || each == 'T'; });
    deliver("SIU^S12", "SCH|A" + patient + "|F" + patient + "|||||||||^^^" + when + "+0000\rPID|1||" +
                           patient + "^^^H^MR\rAIL|1||OR1\r");
  }
  const std::shared_ptr<ProcedureInbox> inbox =
      std::make_shared<ProcedureInbox>("mllp://127.0.0.1:0", ProcedureInbox::Tell());
  RoomProcedure room{inbox, ProcedureRule{{"OR1"}, 12h}, nullptr};
  int number = 0;
};

// They were in the room by mistake, or were operated on faster than it was planned.
TEST_F(RoomOfMessages, WhoeverLeftBeforeTheirTimeIsDoneIfACaseAboutThemHasEnded) {
  const UtcTime now = utc_now(), begin = now + 30min;
  book("P", begin);
  book("Q", begin + 50min);
  move("P", "OR1");
  const std::optional<ProcedureData> about = room.find(now);
  ASSERT_TRUE(about);
  EXPECT_EQ(about->patient_id, "P");
  move("P", "HOLDING");
  EXPECT_EQ(room.find(begin), std::nullopt);
  EXPECT_EQ(room.doubt(begin), Doubt::kLeftAlready);
  room.ended(*about, now - 2h);
  EXPECT_EQ(room.doubt(begin), Doubt::kLeftAlready) << "before they came";
  room.ended(*about, now);
  EXPECT_EQ(room.find(begin).value_or(ProcedureData()).patient_id, "Q");
}

TEST_F(RoomOfMessages, WhereTheRoomRunsLateWhatWasRecordedKeepsNobodyWaiting) {
  const UtcTime now = utc_now();
  book("P", now - 70min);
  book("Q", now - 5min);
  EXPECT_EQ(room.doubt(now), Doubt::kEarlierOpen);
  ProcedureData about;
  about.patient_id = "P";
  about.patient_id_issuer = "H";
  room.ended(about, now - 20min);
  EXPECT_EQ(room.find(now).value_or(ProcedureData()).patient_id, "Q");
}

// The recorder was started anew in the middle of an operation, which goes on.
TEST_F(RoomOfMessages, WhoeverIsPlannedNextIsNotTakenForAnOperationThatWasCutOff) {
  const UtcTime now = utc_now();
  book("P", now - 70min);
  book("Q", now + 5min);
  ProcedureData about;
  about.patient_id = "P";
  about.patient_id_issuer = "H";
  room.cut_off(about, now - 5min);
  EXPECT_EQ(room.find(now), std::nullopt);
  EXPECT_EQ(room.doubt(now), Doubt::kEarlierOpen);
  room.ended(about, now - 1min);
  EXPECT_EQ(room.find(now).value_or(ProcedureData()).patient_id, "Q") << "its case was ended";
}

TEST_F(RoomOfMessages, WhatWasRecordedHereLongAgoMayBeMeant) {
  const UtcTime now = utc_now();
  book("P", now);
  std::optional<ProcedureData> about = room.find(now);
  ASSERT_TRUE(about);
  about->planned.clear();
  room.ended(*about, now - 13h);
  EXPECT_TRUE(room.find(now)) << "another without a time";
  room.ended(*about, now - 11h);
  EXPECT_EQ(room.doubt(now), Doubt::kRecordedAlready);
}

// Whoever is signed off late is in the room, as far as messages say, when the next one's case begins.
TEST_F(RoomOfMessages, WhoeverWasRecordedSinceTheyCameIsNotTakenForTheNextOne) {
  const UtcTime now = utc_now();
  move("P", "OR1");
  book("Q", now + 13min);
  const std::optional<ProcedureData> about = room.find(now);
  ASSERT_TRUE(about);
  EXPECT_EQ(about->patient_id, "P");
  room.ended(*about, now + 1min);
  EXPECT_EQ(room.find(now + 5min).value_or(ProcedureData()).patient_id, "P") << "it goes on after a pause";
  EXPECT_EQ(room.find(now + 12min), std::nullopt);
  EXPECT_EQ(room.doubt(now + 12min), Doubt::kRecordedHere);
  room.ended(*about, now + 11min);
  EXPECT_EQ(room.find(now + 12min).value_or(ProcedureData()).patient_id, "P") << "it went on";
  EXPECT_EQ(room.doubt(now + 22min), Doubt::kRecordedHere);
  move("P", "PACU");
  EXPECT_EQ(room.find(now + 22min).value_or(ProcedureData()).patient_id, "Q");
}

// Also where it starts anew between two cases.
TEST_F(RoomOfMessages, WhatWasRecordedBeforeAStartIsForAPersonToChooseAgain) {
  const UtcTime now = utc_now();
  Bytes state;
  const auto with_memory = [&] {
    auto made = std::make_shared<ProcedureInbox>(
        "mllp://127.0.0.1:0", ProcedureInbox::Tell(), Clock::system(),
        InboxMemory{state, [&state](ByteView kept) { state = to_bytes(kept); }});
    made->tend();
    return made;
  };
  auto first = with_memory();
  {
    test::MllpClient client("127.0.0.1", first->port());
    std::string when = format_utc(now).substr(0, 19);
    std::erase_if(when, [](char each) { return each == '-' || each == ':' || each == 'T'; });
    client.send_message("MSH|^~\\&|HIS|H|||||SIU^S12|1|P|2.5\rSCH|AP|FP|||||||||^^^" + when +
                        "+0000\rPID|1||P^^^H^MR\rAIL|1||OR1\r");
    EXPECT_THAT(client.receive().value_or(""), testing::HasSubstr("MSA|AA|"));
  }
  const ProcedureRule rule{{"OR1"}, 12h};
  {
    RoomProcedure before(first, rule, nullptr);
    const std::optional<ProcedureData> about = before.find(now);
    ASSERT_TRUE(about);
    before.ended(*about, now - 11min);
    EXPECT_EQ(before.doubt(now), Doubt::kRecordedAlready);
  }
  first->end();
  const auto second = with_memory();
  EXPECT_EQ(RoomProcedure(second, rule, nullptr).doubt(now), Doubt::kRecordedAlready);
  EXPECT_EQ(RoomProcedure(second, {{"or1"}, 12h}, nullptr).doubt(now), Doubt::kRecordedAlready);
}

TEST(Procedures, AreTheSameUnlessSomethingTellsThemApart) {
  ProcedureData one;
  one.patient_id = "0077";
  one.accession = "A1";
  one.planned = "2026-08-05T09:15:00+02:00";
  EXPECT_TRUE(may_be_same_procedure(one, data_of_subject(subject_json(one))));
  const auto with = [&](std::string ProcedureData::*member, const std::string& text) {
    ProcedureData other = one;
    other.*member = text;
    return may_be_same_procedure(one, other);
  };
  EXPECT_TRUE(with(&ProcedureData::patient_id, "77"));
  EXPECT_TRUE(with(&ProcedureData::planned, "2026-08-05T09:15"));
  EXPECT_TRUE(with(&ProcedureData::planned, ""));
  EXPECT_TRUE(with(&ProcedureData::accession, ""));
  EXPECT_FALSE(with(&ProcedureData::patient_id, "78"));
  EXPECT_FALSE(with(&ProcedureData::planned, "2026-08-05T14:00"));
  EXPECT_FALSE(with(&ProcedureData::accession, "A2"));
  EXPECT_EQ(data_of_subject(to_bytes("[1, {")), ProcedureData());
  EXPECT_EQ(data_of_subject(to_bytes("{\"patient\": 7}")), ProcedureData());
}

}  // namespace
}  // namespace kiroku::recorder
