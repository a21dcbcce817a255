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

constexpr std::chrono::minutes kZone{120};

ProcedureMessage read(const std::string& text) {
  const Hl7Parse parsed = parse_hl7_message(text);
  EXPECT_TRUE(parsed.message) << parsed.problem;
  return read_procedure_message(*parsed.message, kZone);
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
  EXPECT_THAT(message.places, testing::UnorderedElementsAre("OR1", "OR1", "WARD", "3", "2", "WARD^3^2"));
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
  for (const char* event : {"A03", "A11", "A23", "A29"})
    EXPECT_EQ(read(adt(event)).kind, Kind::kLeaves) << event;
  for (const char* event : {"A01", "A04", "A08", "A10"})
    EXPECT_EQ(read(adt(event)).kind, Kind::kPlaces) << event;
  for (const char* event : {"S15", "S16", "S17", "S26"}) {
    std::string text = kAppointment;
    text.replace(text.find("S12"), 3, event);
    EXPECT_EQ(read(text).kind, Kind::kCancels) << event;
  }
  EXPECT_EQ(read("MSH|^~\\&|A||||2026||ADT^A01|1|P|2.5\rPV1|1|I|OR1\r").kind, Kind::kNothing) << "nobody";
  EXPECT_EQ(read("MSH|^~\\&|A||||2026||SIU^S23|1|P|2.5\rSCH|1\rAIL|1||OR1\r").kind, Kind::kNothing)
      << "a blocked slot";
}

TEST(ProcedureMessage, TakesTheTimeOfTheSenderOrTheAssumedZone) {
  const auto planned = [](const std::string& time) {
    return read("MSH|^~\\&|A||||2026||SIU^S12|1|P|2.5\rPID|1||7\rTQ1|1||||||" + time + "\r");
  };
  EXPECT_EQ(planned("202608050915").planned, parse_utc("2026-08-05T07:15:00Z"));
  EXPECT_EQ(planned("202608050915").data.planned, "2026-08-05T09:15");
  EXPECT_EQ(planned("20260805").planned, std::nullopt);
  EXPECT_EQ(planned("20260805").data.planned, "2026-08-05");
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
      const ProcedureMessage message = read_procedure_message(*parsed.message, kZone);
      patients += message.patient.empty() ? 0U : 1U;
      EXPECT_NO_THROW(subject_json(message.data));
    }
  }
  EXPECT_GE(patients, 10U);
}

}  // namespace
}  // namespace kiroku::recorder
