#include "recorder/procedure/procedure_inbox.h"

#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/local_zone.h"
#include "tests/support/mllp_client.h"
#include "tests/support/moved_clock.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using test::MllpClient;
using testing::HasSubstr;
using testing::Not;

const std::string kInOr1 =
    "MSH|^~\\&|ADT|HOSP|||20260805080000||ADT^A02^ADT_A02|77|P|2.5||||||8859/1\r"
    "PID|1||4711^^^HOSP^MR||M\xFCller^J\xF6rg\rPV1|1|I|SURGERY^OR1\r";

class ProcedureInboxTest : public testing::Test {
 protected:
  void tell(const std::string& sentence) {
    const std::lock_guard guard(mutex);
    told += sentence + "\n";
  }
  std::mutex mutex;
  std::string told;
};

std::string answer(MllpClient& client, const std::string& message) {
  client.send_message(message);
  const std::string acknowledgement = client.receive().value_or("none");
  return acknowledgement.substr(std::min(acknowledgement.size(), acknowledgement.find("\rMSA|") + 5));
}

TEST_F(ProcedureInboxTest, TakesMessagesOverASocketAndAcknowledges) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC",
                       [this](const std::string& sentence) { tell(sentence); });
  EXPECT_FALSE(inbox.way().well);
  inbox.tend();
  inbox.tend();
  ASSERT_TRUE(inbox.way().well) << inbox.way().state;
  EXPECT_EQ(inbox.find({{"OR1"}, 12h}, utc_now()), std::nullopt);
  MllpClient client("127.0.0.1", inbox.port());
  EXPECT_EQ(answer(client, kInOr1), "AA|77\r");
  const auto found = inbox.find({{"surgery^or1"}, 12h}, utc_now());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->patient.family, "Müller");
  EXPECT_EQ(inbox.find({{"OR2"}, 12h}, utc_now()), std::nullopt);
  EXPECT_THAT(answer(client, "MSH|^~\\&|MON||||20260101||ORU^R01|5|P|2.6\rOBX|1|NM|1^X||5\r"),
              HasSubstr("AR|5|only messages of patients and appointments"));
  EXPECT_THAT(answer(client, "PID|1||4711||Secret^Name\r"), HasSubstr("AE|"));
  EXPECT_THAT(inbox.way().state, HasSubstr("1 taken, 2 refused"));
}

std::string adt(const std::string& event, const std::string& id, const std::string& patient,
                const std::string& place) {
  return "MSH|^~\\&|ADT|HOSP|||20260805080000||ADT^" + event + "|" + id + "|P|2.5\rEVN|" + event +
         "|20260805080000\rPID|1||" + patient + "^^^HOSP^MR\rPV1|1|I|" + place + "\r";
}

// An engine that saw no acknowledgement.
TEST_F(ProcedureInboxTest, AMessageThatIsSentAgainIsAcknowledgedAndTakenOnce) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC", {});
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  const std::string olga = adt("A01", "77", "olga", "OR1");
  EXPECT_EQ(answer(client, olga), "AA|77\r");
  EXPECT_EQ(answer(client, adt("A02", "78", "olga", "ICU")), "AA|78\r");
  EXPECT_EQ(answer(client, adt("A01", "79", "paul", "OR1")), "AA|79\r");
  EXPECT_EQ(answer(client, olga), "AA|77\r");
  EXPECT_EQ(inbox.find({{"OR1"}, 12h}, utc_now())->patient_id, "paul");
}

TEST_F(ProcedureInboxTest, TellsWhereSomebodyLeavesWhoIsNotKnown) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC",
                       [this](const std::string& sentence) { tell(sentence); });
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  EXPECT_EQ(answer(client, adt("A01", "1", "0077", "OR1")), "AA|1\r");
  EXPECT_EQ(answer(client, adt("A03", "2", "77", "OR1")), "AA|2\r");
  EXPECT_EQ(answer(client, adt("A03", "3", "77", "OR1")), "AA|3\r");
  {
    const std::lock_guard guard(mutex);
    EXPECT_EQ(told, "");
  }
  EXPECT_EQ(answer(client, adt("A03", "4", "4711", "OR1")), "AA|4\r");
  const std::lock_guard guard(mutex);
  EXPECT_THAT(told, HasSubstr("a patient left whom no message had placed under any of the numbers"));
  EXPECT_THAT(told, Not(HasSubstr("4711")));
}

// Out of its order.
TEST_F(ProcedureInboxTest, TellsOfALeavingThatComesLate) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC",
                       [this](const std::string& sentence) { tell(sentence); });
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  const auto at = [](const std::string& hour, std::string message) {
    for (std::size_t found = 0; (found = message.find("2026080508", found)) != std::string::npos; ++found)
      message.replace(found, 10, "20260805" + hour);
    return message;
  };
  EXPECT_EQ(answer(client, at("10", adt("A02", "1", "4711", "OR1"))), "AA|1\r");
  EXPECT_EQ(answer(client, at("09", adt("A03", "2", "4711", "OR1"))), "AA|2\r");
  EXPECT_EQ(inbox.find({{"OR1"}, 12h}, utc_now()), std::nullopt);
  EXPECT_EQ(inbox.choose({{"OR1"}, 12h}, utc_now()).doubt, Doubt::kToldLate);
  EXPECT_THAT(inbox.way().state,
              HasSubstr("; messages that said too late that somebody left or is planned no more: 1"));
  const std::lock_guard guard(mutex);
  EXPECT_THAT(told, HasSubstr("a message came late, after newer ones of the same patient"));
  EXPECT_THAT(told, Not(HasSubstr("4711")));
}

TEST_F(ProcedureInboxTest, RefusesNumbersThatItWouldNotKnowAgain) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC", {});
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  const std::string too_long(257, '7');
  const auto refused =
      HasSubstr("AE|5|the message names a patient by a number that is longer than 256 bytes");
  EXPECT_THAT(answer(client, adt("A02", "5", too_long, "OR1")), refused);
  std::string merging = adt("A40", "5", "4711", "OR1");
  EXPECT_THAT(answer(client, merging + "MRG|" + too_long + "^^^HOSP^MR\r"), refused);
  std::string many = "1^^^A^PI";
  for (int i = 2; i < 40; ++i) many += "~" + std::to_string(i) + "^^^A^PI";
  EXPECT_EQ(answer(client, merging + "MRG|" + many + "~4^^^HOSP^MR\r"), "AA|5\r");
}

// Rooms ask meanwhile whom their cases are about.
TEST_F(ProcedureInboxTest, AnswersWhileSomethingIsKept) {
  int asked = 0;
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC", {}, Clock::system(),
                       {{}, [&](ByteView) {
                          static_cast<void>(inbox.way());
                          static_cast<void>(inbox.find({{"OR1"}, 12h}, utc_now()));
                          ++asked;
                        }});
  inbox.tend();
  EXPECT_EQ(asked, 1);
}

// Booked before clocks change, for after it: another patient would be the nearest, by today's offset.
TEST_F(ProcedureInboxTest, WhatIsPlannedForAfterAChangeOfClocksGoesByTheClocksOfThen) {
  const test::LocalZone berlin("CET-1CEST,M3.5.0,M10.5.0/3");
  ProcedureInbox inbox("mllp://127.0.0.1:0", {});
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  for (const std::string day : {"20270115", "20270715"}) {
    EXPECT_THAT(answer(client, "MSH|^~\\&|PLAN|HOSP|||2026||SIU^S12|" + day + "|P|2.5\rSCH||" + day +
                                   "|||||||||^^^" + day + "0900\rPID|1||" + day + "\rAIL|1||OR1\r"),
                HasSubstr("AA|"));
  }
  const auto found = [&](const char* at) {
    const auto data = inbox.find({{"OR1"}, 5min}, *parse_utc(at));
    return data ? data->patient_id : "nobody";
  };
  EXPECT_EQ(found("2027-01-15T08:00:00Z"), "20270115");
  EXPECT_EQ(found("2027-07-15T07:00:00Z"), "20270715");
}

TEST_F(ProcedureInboxTest, TakesNothingOfStrangers) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?allow=127.0.5.1&sender=ADT/HOSP",
                       [this](const std::string& sentence) { tell(sentence); });
  inbox.tend();
  MllpClient stranger("127.0.0.1", inbox.port(), "127.0.7.1");
  EXPECT_FALSE(stranger.receive());
  MllpClient engine("127.0.0.1", inbox.port(), "127.0.5.1");
  EXPECT_THAT(answer(engine, "MSH|^~\\&|OTHER|HOSP|||20260805080000||ADT^A01|1|P|2.5\rPID|1||9\r"),
              HasSubstr("AR|1|this sender's messages"));
  EXPECT_EQ(answer(engine, kInOr1), "AA|77\r");
  EXPECT_THAT(inbox.way().state, HasSubstr("1 taken, 1 refused, 1 connections of strangers"));
  const std::lock_guard guard(mutex);
  EXPECT_THAT(told, HasSubstr("connection-refused"));
}

TEST_F(ProcedureInboxTest, ListensToTheNetworkOnlyWhereItIsSaidWhoMaySend) {
  ProcedureInbox inbox("mllp://0.0.0.0:0", [this](const std::string& sentence) { tell(sentence); });
  inbox.tend();
  EXPECT_FALSE(inbox.way().well);
  EXPECT_THAT(inbox.way().state, HasSubstr("say who may send with allow="));
}

TEST_F(ProcedureInboxTest, NobodyOfATrainingSystemIsInTheRoom) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC",
                       [this](const std::string& sentence) { tell(sentence); });
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  for (const char* mode : {"T", "D", "T^T"}) {
    std::string training = kInOr1;
    training.replace(training.find("|P|"), 3, std::string("|") + mode + "|");
    EXPECT_THAT(answer(client, training), HasSubstr("AR|77|messages of training and debugging (MSH-11)"))
        << mode;
  }
  EXPECT_EQ(inbox.find({{"OR1"}, 12h}, utc_now()), std::nullopt);
  EXPECT_THAT(inbox.way().state, HasSubstr("0 taken, 3 refused"));
  EXPECT_EQ(answer(client, kInOr1), "AA|77\r");
  const std::lock_guard guard(mutex);
  EXPECT_THAT(told, HasSubstr("MSH-11) are not taken here; 1 such messages so far\n"));
  EXPECT_THAT(told, HasSubstr("MSH-11) are not taken here; 2 such messages so far\n"));
  EXPECT_THAT(told, Not(HasSubstr("3 such")));
}

// It tells of before, as if it were now.
TEST_F(ProcedureInboxTest, NobodyOfARestoredArchiveIsInTheRoom) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC", {});
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  for (const char* mode : {"P^R", "P^A", "p^r"}) {
    std::string restored = kInOr1;
    restored.replace(restored.find("|P|"), 3, std::string("|") + mode + "|");
    EXPECT_THAT(answer(client, restored), HasSubstr("AR|77|messages for or from an archive (MSH-11")) << mode;
  }
  EXPECT_EQ(inbox.find({{"OR1"}, 12h}, utc_now()), std::nullopt);
  std::string loaded = kInOr1;
  loaded.replace(loaded.find("|P|"), 3, "|P^I|");
  EXPECT_EQ(answer(client, loaded), "AA|77\r") << "what is so now";
}

TEST_F(ProcedureInboxTest, TellsOfATimeThatCannotBeRead) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC",
                       [this](const std::string& sentence) { tell(sentence); });
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  EXPECT_EQ(answer(client,
                   "MSH|^~\\&|PLAN|HOSP|||2026||SIU^S12|5|P|2.5\rSCH|P1|F1|||||||||^^^5.8.2026\r"
                   "PID|1||4711^^^H\rAIL|1||OR1\r"),
            "AA|5\r");
  EXPECT_EQ(inbox.choose({{"OR1"}, 12h}, utc_now()).doubt, Doubt::kTimeUnclear);
  const std::lock_guard guard(mutex);
  EXPECT_THAT(told, HasSubstr("an appointment states a time that cannot be read, or no hour (1 so far)"));
  EXPECT_THAT(told, Not(HasSubstr("4711")));
}

// Whatever is taken is known after a start: an appointment of "no end" took all of it away.
TEST_F(ProcedureInboxTest, WhateverIsTakenIsKnownAfterAStart) {
  test::MovedClock time;
  Bytes kept;
  const auto keep = [&kept](ByteView state) { kept = to_bytes(state); };
  const auto tells = [this](const std::string& sentence) { tell(sentence); };
  {
    ProcedureInbox first("mllp://127.0.0.1:0", tells, time, {{}, keep});
    first.tend();
    MllpClient client("127.0.0.1", first.port());
    EXPECT_EQ(answer(client, adt("A01", "1", "4711", "OR1")), "AA|1\r");
    int number = 2;
    for (const std::string begin : {"99991231235900", "99991231235959-1200", "9999", "19700101",
                                    "19700101000000-1400", "99991231", "197001010000+1400", "0001", "x"}) {
      for (const std::string offset : {"", "300|d", "-300|d", "366|d", "1|min", "x|d"}) {
        const std::string id = std::to_string(number++);
        EXPECT_EQ(answer(client, "MSH|^~\\&|PLAN|HOSP|||" + begin + "||SIU^S12|" + id + "|P|2.5\rSCH|P" + id +
                                     "|F" + id + "|||||||||^^^" + begin + "\rPID|1||" + id + "^^^H||||" +
                                     begin + "\rPV1|1|I|OR2\rAIL|1||OR2|||" + (number % 2 == 0 ? begin : "") +
                                     "|" + offset + "\r"),
                  "AA|" + id + "\r");
        EXPECT_EQ(answer(client, "MSH|^~\\&|ADT|HOSP|||" + begin + "||ADT^A02|" + id + "a|P|2.5\rEVN|A02|" +
                                     begin + "||||" + begin + "\rPID|1||" + id + "^^^H\rPV1|1|I|OR3" +
                                     std::string(42, '|') + begin + "\r"),
                  "AA|" + id + "a\r");
      }
    }
    time.move(2s);
    first.tend();
  }
  told.clear();
  ProcedureInbox second("mllp://127.0.0.1:0", tells, time, {kept, keep});
  second.tend();
  EXPECT_EQ(second.find({{"OR1"}, 12h}, time.utc()).value_or(ProcedureData()).patient_id, "4711");
  EXPECT_EQ(told, "");
  EXPECT_THAT(second.way().state, HasSubstr("109 taken, 0 refused"));
}

// The event of the first one is not that of the second one's patient.
TEST_F(ProcedureInboxTest, NothingIsTakenOfAFrameOfSeveralMessages) {
  ProcedureInbox inbox("mllp://127.0.0.1:0?zone=UTC",
                       [this](const std::string& sentence) { tell(sentence); });
  inbox.tend();
  MllpClient client("127.0.0.1", inbox.port());
  const auto event = [](const std::string& name, const std::string& id, const std::string& patient) {
    return "MSH|^~\\&|ADT|HOSP|||20260805080000||ADT^" + name + "|" + id + "|P|2.5\rPID|1||" + patient +
           "^^^HOSP^MR||" + patient + "^X\rPV1|1|I|SURGERY^OR1\r";
  };
  EXPECT_EQ(answer(client, event("A10", "1", "WILMA")), "AA|1\r");
  const std::string leaves = event("A03", "2", "WILMA"), comes = event("A10", "3", "PETRA");
  for (const std::string& frame : {leaves + comes, leaves.substr(0, leaves.size() - 1) + comes}) {
    EXPECT_THAT(answer(client, frame), HasSubstr("AE|2|several messages came in one frame"));
  }
  const auto found = inbox.find({{"OR1"}, 12h}, utc_now());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->patient.family, "WILMA") << "neither has left, nor has anybody come";
  EXPECT_EQ(answer(client, leaves), "AA|2\r");
  EXPECT_EQ(answer(client, comes), "AA|3\r");
  EXPECT_EQ(inbox.find({{"OR1"}, 12h}, utc_now()).value_or(ProcedureData()).patient.family, "PETRA");
  const std::lock_guard guard(mutex);
  EXPECT_THAT(told, HasSubstr("several messages came in one frame"));
  EXPECT_THAT(told, Not(HasSubstr("PETRA")));
}

TEST_F(ProcedureInboxTest, TellsNothingOfAPatient) {
  ProcedureInbox inbox("mllp://127.0.0.1:0", [this](const std::string& sentence) { tell(sentence); });
  inbox.tend();
  {
    MllpClient stranger("127.0.0.1", inbox.port());
    stranger.send("PID|1||4711||Secret^Name\r");  // outside of a frame
    EXPECT_FALSE(stranger.receive(60s)) << "closed before its first message";
    MllpClient client("127.0.0.1", inbox.port());
    EXPECT_EQ(answer(client, kInOr1), "AA|77\r");
    client.send("PID|1||4711||Secret^Name\r");
    client.send("\x0BMSH|Secret^Name");
    EXPECT_EQ(answer(client, kInOr1), "AA|77\r");
    EXPECT_THAT(
        answer(client, "MSH|^~\\&|A||||2026||ADT^A01|8|P|2.5\rPID|1||7||" + std::string(40'000, 'x') + "\r"),
        HasSubstr("AE|8|the message says more"));
  }
  const std::lock_guard guard(mutex);
  EXPECT_THAT(told, HasSubstr("bytes-outside-frame"));
  EXPECT_THAT(told, HasSubstr("message-cut"));
  EXPECT_THAT(told, Not(HasSubstr("Secret")));
}

TEST_F(ProcedureInboxTest, APortThatIsTakenIsToldAndTriedAgain) {
  auto first = std::make_unique<ProcedureInbox>("mllp://127.0.0.1:0", ProcedureInbox::Tell());
  first->tend();
  const std::string taken = "mllp://127.0.0.1:" + std::to_string(first->port());
  test::MovedClock time;
  ProcedureInbox second(
      taken, [this](const std::string& sentence) { tell(sentence); }, time);
  second.tend();
  second.tend();
  EXPECT_FALSE(second.way().well);
  EXPECT_THAT(second.way().state, HasSubstr("cannot wait for monitors at 127.0.0.1"));
  EXPECT_EQ(std::count(told.begin(), told.end(), '\n'), 1) << told;
  first.reset();
  time.move(9s);
  second.tend();
  EXPECT_FALSE(second.way().well) << "too early";
  time.move(1s);
  second.tend();
  EXPECT_TRUE(second.way().well) << second.way().state;
  EXPECT_THAT(told, HasSubstr("are waited for at " + taken + " now"));
}

TEST_F(ProcedureInboxTest, AStartForgetsNobodyWhereSomethingKeepsWhatWasSaid) {
  test::MovedClock time;
  Bytes kept;
  int times = 0;
  const auto keep = [&](ByteView state) {
    kept = to_bytes(state);
    ++times;
  };
  const std::string listen = "mllp://127.0.0.1:0?zone=UTC";
  const ProcedureRule rule{{"OR1"}, 12h};
  // Each has a number of its own: one that is sent again is news to nobody.
  int control_id = 77;
  const auto is_taken = [&](MllpClient& client) {
    std::string message = kInOr1;
    const std::string number = std::to_string(control_id++);
    message.replace(message.find("|77|"), 4, "|" + number + "|");
    return answer(client, message) == "AA|" + number + "\r";
  };
  const auto tells = [this](const std::string& sentence) { tell(sentence); };
  {
    ProcedureInbox first(listen, tells, time, {{}, keep});
    first.tend();
    EXPECT_THAT(first.way().state, HasSubstr("0 refused; messages before 2026-08-05T09:00Z are not known"));
    EXPECT_EQ(times, 1) << "since when it is known";
    time.move(1h);
    MllpClient client("127.0.0.1", first.port());
    EXPECT_TRUE(is_taken(client));
    EXPECT_EQ(times, 2) << "before it is acknowledged";
    // Nobody says again what was acknowledged, should this process be killed in the same second.
    EXPECT_TRUE(is_taken(client));
    EXPECT_EQ(times, 3) << "each";
    first.tend();
    EXPECT_EQ(times, 3) << "nothing is new";
    EXPECT_TRUE(is_taken(client));
    EXPECT_TRUE(is_taken(client));
    EXPECT_EQ(times, 5);
    first.note_recorded(rule, {}, time.utc());
    EXPECT_EQ(times, 6) << "and the end of a case";
    first.end();
    EXPECT_EQ(times, 6);
    EXPECT_FALSE(first.way().well);
    first.tend();
    EXPECT_EQ(first.port(), 0) << "it does not listen again";
  }
  time.move(1min);
  ProcedureInbox second(listen, tells, time, {kept, keep});
  second.tend();
  const auto found = second.find(rule, time.utc());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->patient.family, "Müller");
  EXPECT_THAT(found->chosen, HasSubstr("; messages before 2026-08-05T09:00Z are not known"));
  EXPECT_THAT(second.way().state, HasSubstr("4 taken, 0 refused; messages before 2026-08-05T09:00Z"));
  // What was sent before the start comes again.
  MllpClient engine("127.0.0.1", second.port());
  EXPECT_EQ(answer(engine, adt("A03", "90", "4711", "SURGERY^OR1")), "AA|90\r");
  std::string again = kInOr1;
  again.replace(again.find("|77|"), 4, "|80|");
  EXPECT_EQ(answer(engine, again), "AA|80\r");
  EXPECT_EQ(second.find(rule, time.utc()), std::nullopt) << "they have left since";
  // Without, nobody is known, and it says since when that is so.
  ProcedureInbox third(listen, tells, time);
  third.tend();
  EXPECT_EQ(third.find(rule, time.utc()), std::nullopt);
  EXPECT_THAT(third.way().state, HasSubstr("messages before 2026-08-05T10:01Z are not known"));
  time.move(73h);
  EXPECT_THAT(third.way().state, Not(HasSubstr("not known"))) << "all that counts came since";
  EXPECT_EQ(told, "");
}

TEST_F(ProcedureInboxTest, BeginsAnewWhereWhatWasKeptIsDamaged) {
  test::MovedClock time;
  Bytes kept;
  const auto keep = [&kept](ByteView state) { kept = to_bytes(state); };
  const auto tells = [this](const std::string& sentence) { tell(sentence); };
  {
    ProcedureInbox first("mllp://127.0.0.1:0", tells, time, {{}, keep});
    first.tend();
  }
  kept.pop_back();
  ProcedureInbox second("mllp://127.0.0.1:0", tells, time, {kept, keep});
  EXPECT_THAT(told, HasSubstr("what was known before this start cannot be used"));
  second.tend();
  EXPECT_TRUE(second.way().well);
}

TEST_F(ProcedureInboxTest, RefusesAddressesThatAreNone) {
  for (const char* listen : {"rtsp://camera", "mllp://127.0.0.1:x", "mllps://127.0.0.1", "mllp://a?speed=9",
                             "mllp://127.0.0.1?locations=OR1", "x"}) {
    EXPECT_THROW(ProcedureInbox::check(listen), UsageError) << listen;
  }
}

}  // namespace
}  // namespace kiroku::recorder
