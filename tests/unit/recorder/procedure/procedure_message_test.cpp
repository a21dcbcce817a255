#include "recorder/procedure/procedure_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/shared_data.h"

namespace kiroku::recorder {
namespace {

using Kind = ProcedureMessage::Kind;
using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

const AssumedZone kZone = std::chrono::minutes(120);

std::vector<ProcedureMessage> read_all(const std::string& text) {
  const Hl7Parse parsed = parse_hl7_message(text);
  EXPECT_TRUE(parsed.message) << parsed.problem;
  return read_procedure_messages(*parsed.message, kZone);
}
ProcedureMessage read(const std::string& text) {
  const std::vector<ProcedureMessage> all = read_all(text);
  EXPECT_THAT(all, SizeIs(1));
  return all.front();
}

std::string adt(const std::string& event, const std::string& more = "PV1|1|I|WARD^3^2|||||||OR1\r",
                const std::string& charset = "") {
  return "MSH|^~\\&|ADT|HOSP|||20260805080000||ADT^" + event + "|1|P|2.5||||||" + charset + "\rEVN|" + event +
         "|20260805080000\rPID|1||4711^^^HOSP&1.2.3&ISO^MR||Doe^John^Q||19800115|M\r" + more;
}

const std::string kAppointment =
    "MSH|^~\\&|PLAN|HOSP|||20260804170000||SIU^S12^SIU_S12|2|P|2.5\r"
    "SCH|P1|F77^PLAN|||||||||^^^20260805091500+0200\r"
    "PID|1||99^^^^PI~4711^^^HOSP^MR||Doe^John||1980|M\r"
    "PV1|1|I|WARD^3^2||||200^Attend^Ann\r"
    "RGS|1\r"
    "AIS|1||K35^Appendectomy\\T\\washout^OPS|20260805093000+0200\r"
    "AIL|1||SURGERY^OR1^^HOSP\r"
    "AIP|1||300^Cutter^Carla^M^^Dr|SUR^Surgeon\r"
    "AIP|2||301^Sleep^Sam|ANE^Anaesthetist\r";

TEST(ProcedureMessage, ReadsWhereAPatientIs) {
  const ProcedureMessage message = read(adt("A02", "PV1|1|I|WARD^3^2||||200^Attend^Ann||||OR1||||||||V5\r"));
  EXPECT_EQ(message.kind, Kind::kPlaces);
  EXPECT_EQ(message.patient, "4711\nHOSP");
  EXPECT_THAT(message.places, ElementsAre("OR1", "OR1")) << "they are not in the bed that they keep";
  EXPECT_EQ(message.data.location, "OR1") << "the temporary location goes before the ward";
  EXPECT_EQ(message.data.patient, (PersonName{"Doe", "John Q", "Doe^John^Q"}));
  EXPECT_EQ(message.data.birth_date, "1980-01-15");
  EXPECT_EQ(message.data.sex, "M");
  EXPECT_EQ(message.data.visit, "V5");
  EXPECT_THAT(message.data.staff,
              ElementsAre(StaffMember{"attending", "200", {"Attend", "Ann", "200^Attend^Ann"}}));
}

TEST(ProcedureMessage, ReadsAnAppointment) {
  const ProcedureMessage message = read(kAppointment);
  EXPECT_EQ(message.kind, Kind::kAppointment);
  EXPECT_EQ(message.appointment, "F77");
  EXPECT_EQ(message.patient, "4711\nHOSP") << "the medical record number of several";
  EXPECT_EQ(message.planned, parse_utc("2026-08-05T07:15:00Z"));
  EXPECT_EQ(message.data.planned, "2026-08-05T09:15:00+02:00");
  EXPECT_EQ(message.data.description, "Appendectomy&washout");
  EXPECT_EQ(message.data.code, "K35");
  EXPECT_EQ(message.data.coding_system, "OPS");
  EXPECT_EQ(message.data.birth_date, "1980");
  EXPECT_THAT(message.places, Contains("SURGERY^OR1"));
  EXPECT_THAT(message.data.staff,
              Contains(StaffMember{"Surgeon", "300", {"Cutter", "Carla M", "300^Cutter^Carla^M^^Dr"}}));
  EXPECT_THAT(message.data.staff, SizeIs(3));
}

TEST(ProcedureMessage, KnowsWhoLeavesAndWhatIsCancelled) {
  for (const char* event : {"A03", "A11", "A21", "A23", "A29", "A53"})
    EXPECT_EQ(read(adt(event)).kind, Kind::kLeaves) << event;
  for (const char* event : {"A01", "A04", "A08", "A10"}) {
    EXPECT_EQ(read(adt(event)).kind, Kind::kPlaces) << event;
    EXPECT_EQ(read(adt(event)).moves, std::string(event) != "A08") << event;
  }
  for (const char* event : {"S15", "S16", "S17", "S26"}) {
    std::string text = kAppointment;
    text.replace(text.find("S12"), 3, event);
    EXPECT_EQ(read(text).kind, Kind::kCancels) << event;
  }
  EXPECT_EQ(read("MSH|^~\\&|A||||2026||ADT^A01|1|P|2.5\rPV1|1|I|OR1\r").kind, Kind::kNothing) << "nobody";
  EXPECT_EQ(read("MSH|^~\\&|A||||2026||SIU^S23|1|P|2.5\rSCH|1\rAIL|1||OR1\r").kind, Kind::kNothing)
      << "a blocked slot";
}

// What is to be, or was to be, and what is said of a person, tells nothing of who lies in the room now.
TEST(ProcedureMessage, WhatIsPendingOrOfAPersonPlacesNobody) {
  for (const char* event : {"A05", "A14", "A15", "A25", "A26", "A27", "A38", "A28", "A31", "A40", "A47"})
    EXPECT_EQ(read(adt(event)).kind, Kind::kFacts) << event;
  // What another system has on record of somebody is no event of theirs.
  for (const char* event : {"A54", "A55", "A60", "A61", "A20", "Z01"})
    EXPECT_EQ(read(adt(event)).kind, Kind::kFacts) << event;
}

TEST(ProcedureMessage, WhoeverWasDischargedIsGone) {
  const auto with_end = [](const std::string& event, const std::string& end) {
    return read(adt(event, "PV1|1|I|OR1||||||||||||||||V7" + std::string(26, '|') + end + "\r"));
  };
  const ProcedureMessage gone = with_end("A08", "202608050700");
  EXPECT_EQ(gone.kind, Kind::kDeparts);
  EXPECT_THAT(gone.places, IsEmpty());
  EXPECT_TRUE(gone.is_of_record);
  EXPECT_EQ(gone.visit, "V7");
  for (const char* end : {"20260804", "2026080507"})
    EXPECT_EQ(with_end("A08", end).kind, Kind::kDeparts) << end;
  for (const char* end :
       {"", "\"\"", "202608051700", "20260806", "20260805", "202608", "2026080508", "yesterday", "00000000"})
    EXPECT_EQ(with_end("A08", end).kind, Kind::kPlaces) << end;
  EXPECT_EQ(with_end("A13", "202608050700").kind, Kind::kPlaces) << "that is what it cancels";
  // Some interfaces fill it in whatever they tell.
  for (const char* event : {"A01", "A02", "A04", "A10"}) {
    for (const char* end : {"00000000", "20260804", "202608050700"}) {
      const ProcedureMessage moved = with_end(event, end);
      EXPECT_TRUE(moved.moves && moved.kind == Kind::kPlaces) << event << end;
      EXPECT_THAT(moved.places, Contains("OR1")) << event << end;
    }
  }
}

TEST(ProcedureMessage, WhoeverIsNamedByTheirAccountAloneIsSomebody) {
  const std::string named = "PID|1" + std::string(17, '|') + "ACC1^^^H\rPV1|1|I|OR1\r";
  const auto of = [](const std::string& event, const std::string& more) {
    return read("MSH|^~\\&|A||||2026||ADT^" + event + "|1|P|2.5\r" + more);
  };
  EXPECT_EQ(of("A03", named).kind, Kind::kLeaves);
  EXPECT_TRUE(has_its_numbers(of("A03", named)));
  EXPECT_NE(of("A03", named).patient, of("A03", "PID|1||ACC1^^^H\r").patient) << "no patient's number";
  const ProcedureMessage nobody = of("A03", "PID|1||||Doe^John\rPV1|1|I|OR1\r");
  EXPECT_EQ(nobody.kind, Kind::kNothing);
  EXPECT_TRUE(nobody.leaves_unnamed);
  EXPECT_FALSE(of("A08", "PID|1||||Doe^John\rPV1|1|I|OR1\r").leaves_unnamed);
}

TEST(ProcedureMessage, APlaceMayBeNamedWithItsHospital) {
  EXPECT_THAT(read(adt("A02", "PV1|1|I|SURGERY^OR1^^HOSP&1.2\r")).places,
              ElementsAre("SURGERY", "OR1", "SURGERY^OR1^^HOSP", "SURGERY^OR1"));
  EXPECT_THAT(read(kAppointment).places, Contains("SURGERY^OR1^^HOSP"));
}

TEST(ProcedureMessage, WhoDepartsNamesWhereTheyWere) {
  for (const char* event : {"A09", "A32"}) {
    EXPECT_EQ(read(adt(event)).kind, Kind::kDeparts) << event;
    EXPECT_THAT(read(adt(event, "PV1|1|I|OR2||||||||OR1\r")).places, ElementsAre("OR1", "OR1", "OR2", "OR2"))
        << "whether they go to the one or leave it";
    EXPECT_THAT(read(adt(event, "PV1|1|I|WARD^3|||WARD^2\r")).places,
                testing::IsSupersetOf({"WARD^3", "WARD^2"}));
    EXPECT_THAT(read(adt(event, "PV1|1|I|WARD^3" + std::string(40, '|') + "OR1\r")).places,
                testing::Each("OR1"))
        << "the prior temporary location";
  }
  EXPECT_EQ(read("MSH|^~\\&|A||||2026||ADT^^ADT_A03|1|P|2.5\rEVN|A03\rPID|1||7\r").kind, Kind::kLeaves)
      << "the event stands in EVN-1 alone";
  EXPECT_EQ(read("MSH|^~\\&|A||||2026||ADT|1|P|2.5\rPID|1||7\rPV1|1|I|OR1\r").kind, Kind::kFacts);
  EXPECT_TRUE(is_of_procedures("ADT"));
}

TEST(ProcedureMessage, WhoeverIsElsewhereForATimeIsNotWhereTheyAreAssigned) {
  const std::string in_recovery = "PV1|1|I|OR1||||||||PACU\r";
  for (const char* event : {"A01", "A02", "A08", "A10"}) {
    EXPECT_THAT(read(adt(event, in_recovery)).places, ElementsAre("PACU", "PACU")) << event;
    EXPECT_THAT(read(adt(event, "PV1|1|I|OR1||||||||\"\"\r")).places, ElementsAre("OR1", "OR1")) << event;
    EXPECT_THAT(read(adt(event, "PV1|1|I|OR1||||||||^^\r")).places, ElementsAre("OR1", "OR1")) << event;
  }
  EXPECT_THAT(read(adt("A03", in_recovery)).places, Contains("OR1")) << "whoever is gone is in neither";
  EXPECT_THAT(read(adt("A09", in_recovery)).places, Contains("OR1"));
}

TEST(ProcedureMessage, KnowsWhoIsOnlyRegistered) {
  for (const char* event : {"A01", "A04", "A06", "A07", "A13", "A22", "A52"})
    EXPECT_TRUE(read(adt(event)).registers) << event;
  for (const char* event : {"A02", "A08", "A10", "A12", "A17", "A33"})
    EXPECT_FALSE(read(adt(event)).registers) << event;
}

TEST(ProcedureMessage, AnAppointmentsNumberIsOneOfWhoGaveIt) {
  const auto with = [](const std::string& placer, const std::string& filler, const std::string& sender) {
    return read("MSH|^~\\&|" + sender + "||||2026||SIU^S12|1|P|2.5\rSCH|" + placer + "|" + filler +
                "\rPID|1||7\rAIL|1||OR1\r");
  };
  const ProcedureMessage one = with("P1^EMR", "F1^PLAN^1.2^ISO", "A");
  EXPECT_EQ(one.filler_by, (Assigner{"PLAN", "1.2"}));
  EXPECT_EQ(one.placer_by, (Assigner{"EMR", ""}));
  EXPECT_TRUE(one.names_rooms);
  const auto same = [&](const ProcedureMessage& other) {
    const std::optional<bool> is_one = same_number_of_appointment(one, other);
    return !is_one ? "unknown" : *is_one ? "same" : "another";
  };
  EXPECT_STREQ(same(with("P2", "F1^plan", "B")), "same");
  EXPECT_STREQ(same(with("", "F1^X^1.2^ISO", "B")), "same");
  EXPECT_STREQ(same(with("P1^EMR", "F1^RIS", "A")), "another");
  EXPECT_STREQ(same(with("", "F1^PLAN^9.9^ISO", "A")), "another");
  EXPECT_STREQ(same(with("", "F1", "A")), "same") << "of one sender";
  EXPECT_STREQ(same(with("", "F1", "B")), "unknown");
  EXPECT_STREQ(same(with("P1^emr", "", "B")), "same");
  EXPECT_STREQ(same(with("P1^RIS", "", "B")), "another");
  EXPECT_STREQ(same(with("P1", "", "B")), "unknown");
  EXPECT_STREQ(same(with("P9", "", "A")), "another");
}

TEST(ProcedureMessage, SaysWhoToldItAndWhenByTheirClock) {
  const auto times = [](const std::string& event, const std::string& evn, const std::string& sent) {
    const ProcedureMessage message = read("MSH|^~\\&|ADT|HOSP|||" + sent + "||ADT^" + event +
                                          "|1|P|2.5\rEVN|" + evn + "\rPID|1||7\rPV1|1|I|OR1\r");
    const auto text = [](const std::optional<UtcTime>& time) {
      return time ? format_utc(*time).substr(11, 5) : "none";
    };
    return text(message.told) + " " + text(message.happened);
  };
  EXPECT_EQ(times("A02", "A02|202608050800||||202608050730", "20260805090000+0200"), "06:00 05:30");
  EXPECT_EQ(times("A02", "A02", "20260805090000+0200"), "07:00 07:00");
  EXPECT_EQ(times("A02", "A02|202608051000", "20260805090000+0200"), "07:00 07:00") << "not later than sent";
  EXPECT_EQ(times("A02", "A02|202608050800||||202608051600", ""), "06:00 06:00") << "nor later than told";
  EXPECT_EQ(times("A08", "A08|202608050800||||202608050730", ""), "06:00 06:00") << "when they came";
  EXPECT_EQ(times("A02", "A02", "20260805"), "none none");
  const std::string sender = read(adt("A01")).sender;
  EXPECT_FALSE(sender.empty());
  EXPECT_NE(read(kAppointment).sender, sender);
}

TEST(ProcedureMessage, KeepsEveryNumberOfAPatient) {
  const ProcedureMessage message = read(
      "MSH|^~\\&|A||||2026||ADT^A01|1|P|2.5\r"
      "PID|1|X1|V9^^^H^AN~77^^^H&1.2.3&ISO^PI||Doe^John||1980|||||||||||V8^^^H\r");
  EXPECT_EQ(message.patient, "77\nH") << "the patient's, and not the account's";
  ASSERT_THAT(message.numbers, SizeIs(4));
  EXPECT_EQ(message.numbers[0].issuer + " " + message.numbers[0].issuer_id + " " + message.numbers[0].type,
            "H 1.2.3 PI");
  EXPECT_TRUE(message.numbers[1].is_of_account);
  EXPECT_EQ(message.numbers[2].number, "X1");
  EXPECT_TRUE(message.numbers[3].is_of_account);
  EXPECT_THAT(read(adt("A40", "MRG|99^^^^PI~0815^^^HOSP^MR\r")).replaced_numbers, SizeIs(2));
}

TEST(ProcedureMessage, KnowsWhatAPatientWasCalledBefore) {
  EXPECT_EQ(read(adt("A40", "MRG|99^^^^PI~0815^^^HOSP^MR\r")).replaces, "0815\nHOSP");
  EXPECT_EQ(read(adt("A47", "MRG|0815\r")).replaces, "0815\n");
  EXPECT_EQ(read(adt("A18", "MRG||||0815\r")).replaces, "0815\n") << "MRG-4 before v2.3";
  EXPECT_EQ(read(adt("A40", "MRG|4711^^^HOSP^MR\r")).replaces, "") << "its own";
  EXPECT_EQ(read(adt("A35", "MRG|||77\r")).replaces, "") << "an account";
  EXPECT_EQ(read("MSH|^~\\&|A||||2026||ADT^A40|1|P|2.5\rPID|1\rMRG|0815\r").replaces, "") << "into nobody";
}

TEST(ProcedureMessage, TwoPatientsWhoSwapTheirPlacesAreTwo) {
  const auto all = read_all(adt("A17", "PV1|1|I|OR1\rPID|2||12^^^HOSP^MR||Roe^Jane\rPV1|2|I|OR2\r"));
  ASSERT_THAT(all, SizeIs(2));
  EXPECT_EQ(all[0].patient + " " + all[0].data.location, "4711\nHOSP OR1");
  EXPECT_EQ(all[1].patient + " " + all[1].data.location, "12\nHOSP OR2");
  EXPECT_EQ(all[1].data.patient.family, "Roe");
  EXPECT_TRUE(all[0].moves && all[1].moves);
  EXPECT_THAT(all[1].places, testing::Not(Contains("OR1")));
}

TEST(ProcedureMessage, AnAppointmentOfTwoPatientsIsOfEach) {
  std::string text = kAppointment;
  text.insert(text.find("RGS|"), "PID|2||12^^^HOSP^MR||Roe^Jane\r");
  const auto all = read_all(text);
  ASSERT_THAT(all, SizeIs(2));
  for (const ProcedureMessage& each : all) {
    EXPECT_EQ(each.kind, Kind::kAppointment);
    EXPECT_EQ(each.appointment, "F77");
    EXPECT_EQ(each.planned, parse_utc("2026-08-05T07:15:00Z"));
    EXPECT_THAT(each.places, Contains("SURGERY^OR1"));
  }
  EXPECT_EQ(all[1].data.patient.family, "Roe");
  std::string many = kAppointment;
  for (std::size_t i = 0; i < kMostPatients + 3; ++i)
    many.insert(many.find("RGS|"), "PID|2||5" + std::to_string(i) + "^^^HOSP^MR\r");
  EXPECT_THAT(read_all(many), SizeIs(kMostPatients));
}

TEST(ProcedureMessage, ACancelledMoveIsOne) {
  const auto event = [](const std::string& name) {
    return read("MSH|^~\\&|A||||2026||ADT^" + name + "|1|P|2.5\rPID|1||7\rPV1|1|I|HOLDING\r");
  };
  EXPECT_TRUE(event("A12").cancels_move);
  EXPECT_TRUE(event("A12").moves);
  EXPECT_FALSE(event("A02").cancels_move);
}

TEST(ProcedureMessage, WhatAChangeTakesOutOfAnAppointmentIsNoneOfIt) {
  std::string moved = kAppointment;
  moved.replace(moved.find("S12"), 3, "S13");
  moved.replace(moved.find("AIL|1||"), 7, "AIL|1|D|");
  moved += "AIL|2|A|SURGERY^OR2^^HOSP\r";
  EXPECT_THAT(read(moved).places, testing::AllOf(Contains("OR2"), testing::Not(Contains("OR1"))));
  std::string group = kAppointment;
  group.replace(group.find("RGS|1"), 5, "RGS|1|D");
  group += "RGS|2|A\rAIL|1||SURGERY^OR3\r";
  EXPECT_THAT(read(group).places, testing::AllOf(Contains("OR3"), testing::Not(Contains("OR1"))));
}

TEST(ProcedureMessage, AnAppointmentThatItsStatusCallsOffIsCancelled) {
  const auto with_status = [](const std::string& event, const std::string& status) {
    std::string text = kAppointment;
    text.replace(text.find("S12"), 3, event);
    const std::size_t end = text.find('\r', text.find("SCH|"));
    text.insert(end, std::string(14, '|') + status);
    const ProcedureMessage message = read(text);
    EXPECT_EQ(message.is_over, status == "COMPLETE") << status;
    EXPECT_EQ(message.placer + message.filler, "P1F77");
    return message.kind;
  };
  EXPECT_EQ(with_status("S14", "Cancelled^^HL70278"), Kind::kCancels);
  EXPECT_EQ(with_status("S14", "NOSHOW"), Kind::kCancels);
  EXPECT_EQ(with_status("S14", "Booked"), Kind::kAppointment);
  EXPECT_EQ(with_status("S14", "COMPLETE"), Kind::kAppointment);
  for (const char* status : {"CAN^Cancelled^L", "X^Canceled", "7^^L^CANCELLED", "9^^L^Z^Cancelled", "CAN",
                             "N^No show", "STORNO^Storniert^LOCAL", "X^Abgesagt", "9^キャンセル"})
    EXPECT_EQ(with_status("S14", status), Kind::kCancels) << status;
}

TEST(ProcedureMessage, AStatusThatIsNotKnownIsUnclear) {
  const auto is_unclear = [](const std::string& status) {
    std::string text = kAppointment;
    text.insert(text.find('\r', text.find("SCH|")), std::string(14, '|') + status);
    return read(text).is_status_unclear;
  };
  for (const char* status : {"", "\"\"", "Booked", "BOOKED^^HL70278", "B^Booked", "Scheduled",
                             "2^^L^Confirmed", "Started", "Overbook", "Pending", "Arrived", "Checked in",
                             "GEBUCHT", "1^予約済", "Complete", "Cancelled", "STORNO"})
    EXPECT_FALSE(is_unclear(status)) << status;
  for (const char* status : {"Waitlist^Appointment on a waiting list^HL70278", "Blocked", "X", "7^^L",
                             "Unconfirmed", "nicht bestätigt", "on hold"})
    EXPECT_TRUE(is_unclear(status)) << status;
}

TEST(ProcedureMessage, WhetherAStatusIsSaidIsToldApart) {
  const auto says_none = [](const std::string& status) {
    std::string text = kAppointment;
    text.insert(text.find('\r', text.find("SCH|")), std::string(14, '|') + status);
    return read(text).says_no_status;
  };
  EXPECT_TRUE(says_none(""));
  EXPECT_FALSE(says_none("Booked"));
  EXPECT_FALSE(says_none("Waitlist"));
}

TEST(ProcedureMessage, TakesTheTimeOfTheSenderOrTheAssumedZone) {
  const auto planned = [](const std::string& time) {
    return read("MSH|^~\\&|A||||2026||SIU^S12|1|P|2.5\rPID|1||7\rTQ1|1||||||" + time + "\r");
  };
  EXPECT_EQ(planned("202608050915").planned, parse_utc("2026-08-05T07:15:00Z"));
  EXPECT_EQ(planned("202608050915").data.planned, "2026-08-05T09:15");
  EXPECT_FALSE(planned("202608050915").is_time_unclear);
  EXPECT_EQ(planned("20260805").planned, std::nullopt);
  EXPECT_EQ(planned("20260805").data.planned, "2026-08-05");
  EXPECT_TRUE(planned("20260805").is_time_unclear);
  EXPECT_EQ(planned("20260805").within,
            (TimeSpan{*parse_utc("2026-08-04T22:00:00Z"), *parse_utc("2026-08-05T22:00:00Z")}));
  EXPECT_EQ(planned("2026080509").within,
            (TimeSpan{*parse_utc("2026-08-05T07:00:00Z"), *parse_utc("2026-08-05T08:00:00Z")}));
  for (const char* time : {"05.08.2026 09:15", "soon", "1850"}) {
    EXPECT_TRUE(planned(time).is_time_unclear) << time;
    EXPECT_EQ(planned(time).within, std::nullopt) << time;
  }
  EXPECT_FALSE(planned("").is_time_unclear) << "nothing is stated";
}

// HL7 v2 chapter 2, MSH-7: a zone that is stated there holds throughout the message.
TEST(ProcedureMessage, TimesWithoutAZoneAreInTheZoneOfMsh7) {
  const auto planned = [](const std::string& sent, const std::string& time) {
    return read("MSH|^~\\&|A||||" + sent + "||SIU^S12|1|P|2.5\rPID|1||7\rTQ1|1||||||" + time + "\r");
  };
  EXPECT_EQ(planned("20260805080000+0000", "202608050915").planned, parse_utc("2026-08-05T09:15:00Z"));
  EXPECT_EQ(planned("20260805080000+0000", "202608050915").data.planned, "2026-08-05T09:15+00:00");
  EXPECT_EQ(planned("20260805080000+0900", "202608050915").planned, parse_utc("2026-08-05T00:15:00Z"));
  EXPECT_EQ(planned("20260805080000+0000", "202608050915-0500").planned, parse_utc("2026-08-05T14:15:00Z"))
      << "its own";
  const ProcedureMessage told = read(
      "MSH|^~\\&|ADT|HOSP|||20260805080000+0000||ADT^A02|1|P|2.5\rEVN|A02|202608050759||||202608050730\r"
      "PID|1||7\rPV1|1|I|OR1\r");
  EXPECT_EQ(told.told, parse_utc("2026-08-05T07:59:00Z"));
  EXPECT_EQ(told.happened, parse_utc("2026-08-05T07:30:00Z"));
}

/// Of each place its last spelling, when it is planned there, and of what.
std::vector<std::string> plan_of(const ProcedureMessage& message) {
  std::vector<std::string> out;
  for (const PlannedPlace& each : message.planned_places) {
    out.push_back(each.spellings.back() + " " +
                  (each.is_time_unclear ? "unclear"
                   : each.planned       ? format_utc(*each.planned).substr(11, 5)
                                        : "none") +
                  (each.code.empty() ? "" : " " + each.code));
  }
  return out;
}

PlannedPlace plan_places_of(const std::string& begin, const std::string& place) {
  return read("MSH|^~\\&|P||||2026||SIU^S12|2|P|2.5\rSCH|P1|F77|||||||||^^^" + begin + "\rPID|1||7\r" + place)
      .planned_places.front();
}

// HL7 v2 chapter 10: AIS-4 to 6, AIG-8 to 10, AIL-6 to 8.
TEST(ProcedureMessage, EachPlaceOfAnAppointmentHasItsOwnTime) {
  const auto plan = [](const std::string& resources) {
    return plan_of(
        read("MSH|^~\\&|PLAN|HOSP|||20260804170000+0000||SIU^S12^SIU_S12|2|P|2.5\r"
             "SCH|P1|F77|||||||||^^^20260805080000\rPID|1||7\r" +
             resources));
  };
  EXPECT_THAT(plan("RGS|1\rAIL|1||OR2|||202608050815\rRGS|2\rAIL|2||OR1|||20260805120000+0100\r"),
              ElementsAre("OR2 08:15", "OR1 11:00"));
  EXPECT_THAT(plan("RGS|1\rAIS|1||K35|202608050930\rAIL|1||OR1\rRGS|2\rAIS|2||K36||30|min\rAIL|1||OR2\r"),
              ElementsAre("OR1 09:30 K35", "OR2 08:30 K36"))
      << "that of the service in its group";
  EXPECT_THAT(plan("AIS|1||K35|202608050930\rAIL|1||OR1||||-15|min^minute\r"), ElementsAre("OR1 07:45 K35"));
  EXPECT_THAT(plan("AIG|1||OR1^Room|||||202608051000\rAIG|2||OR2^Room||||||2|HR\r"),
              ElementsAre("OR1^Room 10:00", "OR2^Room 10:00"));
  EXPECT_THAT(plan("AIL|1||OR1||||0\rAIL|2||OR2||||600\rAIL|3||OR3||||1|^Hours\rAIL|4||OR4||||1|d\r"),
              ElementsAre("OR1 08:00", "OR2 08:10", "OR3 09:00", "OR4 08:00"))
      << "HL7 has an offset without a unit mean seconds";
  EXPECT_THAT(
      plan("AIL|1||OR1|||soon\rAIL|2||OR2||||5|fortnight\rAIL|3||OR3||||x|min\rAIL|4||OR4|||20260806\r"),
      ElementsAre("OR1 unclear", "OR2 unclear", "OR3 unclear", "OR4 unclear"));
  EXPECT_THAT(plan("AIL|1||OR1|||20260805\rAIL|2||OR2|||\"\"\r"), ElementsAre("OR1 08:00", "OR2 08:00"));
  EXPECT_THAT(plan("AIL|1||OR1~OR2|||202608050900\rAIL|2||OR3|||||||||Cancelled\r"),
              ElementsAre("OR1 09:00", "OR2 09:00"));
  EXPECT_THAT(plan("AIL|1||OR1|||||||||CAN^Cancelled^L\rAIL|2||OR2\r"), ElementsAre("OR2 08:00"));
  EXPECT_THAT(plan("RGS|1\rAIS|1||K35\rRGS|2\rAIL|1||OR1\r"), ElementsAre("OR1 08:00"));
  // Beyond what a time can be.
  const auto far = [](const std::string& begin, const std::string& offset) {
    const ProcedureMessage message = read("MSH|^~\\&|P||||2026||SIU^S12|2|P|2.5\rSCH|P1|F77|||||||||^^^" +
                                          begin + "\rPID|1||7\rAIL|1||OR1||||" + offset + "|d\r");
    return message.planned_places.front();
  };
  EXPECT_TRUE(far("99991231235900", "300").is_time_unclear);
  EXPECT_TRUE(far("19700102", "-300").is_time_unclear);
  EXPECT_TRUE(far("197001021200+0000", "-300").is_time_unclear);
  EXPECT_EQ(far("99991231235900", "300").planned, std::nullopt);
  const PlannedPlace day = plan_places_of("20260805", "AIL|1||OR1\r");
  EXPECT_TRUE(day.is_time_unclear);
  EXPECT_EQ(day.within->latest - day.within->earliest, std::chrono::hours(24));
  EXPECT_TRUE(plan_places_of("", "AIL|1||OR1|||20260805\r").within.has_value());
  EXPECT_EQ(read("MSH|^~\\&|P||||2026||SIU^S12|2|P|2.5\rSCH|P1|F77\rPID|1||7\r"
                 "AIL|1||OR1|||20260805120000+0000\r")
                .planned,
            parse_utc("2026-08-05T12:00:00Z"))
      << "where the appointment states none";
}

TEST(ProcedureMessage, ReadsNamesInTheirCharacterSet) {
  std::string latin = adt("A01", "", "8859/1");
  latin.replace(latin.find("Doe^John"), 8, "M\xFCller^J\xF6rg");
  EXPECT_EQ(read(latin).data.patient.family, "Müller");
  std::string japanese = adt("A01", "", "CP932");
  japanese.replace(japanese.find("Doe^John^Q"), 10, "\x8E\x52\x93\x63^\x91\xBE\x98\x59");
  EXPECT_EQ(read(japanese).data.patient, (PersonName{"山田", "太郎", "山田^太郎"}));
}

TEST(ProcedureMessage, BecomesASubjectWithoutWhatIsNotKnown) {
  const auto subject = nlohmann::json::parse(text_of(subject_json(read(adt("A01", "")).data)));
  EXPECT_EQ(subject, nlohmann::json::parse(R"({"patient":{"id":"4711","id_issuer":"HOSP","family":"Doe",
      "given":"John Q","name":"Doe^John^Q","birth_date":"1980-01-15","sex":"M"},"origin":"hl7"})"));
}

TEST(ProcedureMessage, EveryRealMessageIsReadOrNamed) {
  KIROKU_NEEDS_SHARED_DATA("recording/hl7");
  std::size_t patients = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(test::shared_data("recording/hl7"))) {
    if (entry.path().extension() != ".hl7") continue;
    const Bytes bytes = test::read_whole(entry.path());
    for (const std::string_view one : split_hl7_messages(text_of(bytes))) {
      const Hl7Parse parsed = parse_hl7_message(one);
      if (!parsed.message || !is_of_procedures(parsed.message->type())) continue;
      for (const ProcedureMessage& message : read_procedure_messages(*parsed.message, kZone)) {
        patients += message.patient.empty() ? 0U : 1U;
        EXPECT_NO_THROW(subject_json(message.data));
      }
    }
  }
  EXPECT_GE(patients, 10U);
}

}  // namespace
}  // namespace kiroku::recorder
