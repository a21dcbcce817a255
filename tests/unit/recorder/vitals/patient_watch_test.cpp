#include "recorder/vitals/patient_watch.h"

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

PatientNumber number(const std::string& text, const std::string& issuer = "H",
                     const std::string& type = "MR") {
  return {text, issuer, "", type, false};
}
PatientNumber visit(const std::string& text) { return {text, "H", "", "VN", true}; }

TEST(PatientWatch, TwoPatientsAreToldApartByNumbersOfOneKind) {
  EXPECT_TRUE(name_two_patients({number("A1")}, {number("B2")}));
  EXPECT_TRUE(name_two_patients({number("A1")}, {number("B2", "", "")}));
  EXPECT_FALSE(name_two_patients({number("A1")}, {number("A1", "MONITORS", "PI")}))
      << "a gateway's own label";
  EXPECT_FALSE(name_two_patients({number("A1"), visit("V5")}, {number("V5", "", "")})) << "of a visit";
  EXPECT_TRUE(name_two_patients({number("A1"), visit("V5")}, {number("B2"), number("V5", "", "")}));
  EXPECT_TRUE(name_two_patients({number("A1", "", "")}, {number("B2"), visit("A1")}))
      << "a visit's, HL7 says";
  EXPECT_TRUE(name_two_patients({number("A1"), visit("7")}, {number("7", "", "MR")}))
      << "a patient's, HL7 says";
  EXPECT_TRUE(name_two_patients({number("A1"), visit("7")}, {number("B2", "", ""), visit("A1")}));
  EXPECT_FALSE(name_two_patients({number("4711")}, {number("004711", "", "")}));
  EXPECT_FALSE(name_two_patients({number("A1"), number("7", "H", "PI")}, {number("7", "H", "PI")}));
  EXPECT_FALSE(name_two_patients({number("A1")}, {visit("V5")})) << "nothing says so";
  EXPECT_FALSE(name_two_patients({number("A1"), visit("V5")}, {visit("V5")}));
  EXPECT_TRUE(name_two_patients({number("A1"), visit("V5")}, {visit("V6")}));
  EXPECT_FALSE(name_two_patients({}, {number("B2")}));
  EXPECT_FALSE(name_two_patients({number("A1")}, {}));
}

TEST(PatientWatch, CountsEachOtherPatientOfTheCaseOnce) {
  PatientWatch watch;
  watch.heard({number("B2")}, 10);
  EXPECT_EQ(watch.take_others(), 0U) << "nobody knows whom the case is about";
  watch.expect({number("A1")}, 20);
  EXPECT_EQ(watch.take_others(), 0U) << "before it began";
  watch.heard({number("A1")}, 30);
  EXPECT_EQ(watch.take_others(), 0U);
  watch.heard({number("B2")}, 40);
  watch.heard({number("B2")}, 50);
  watch.heard({}, 50);
  EXPECT_EQ(watch.take_others(), 1U);
  EXPECT_EQ(watch.take_others(), 0U);
  watch.heard({number("C3")}, 60);
  EXPECT_EQ(watch.take_others(), 1U);
  // Whom it is about may become known late, or be corrected.
  watch.expect({number("B2")}, 20);
  EXPECT_EQ(watch.take_others(), 2U);
}

TEST(PatientWatch, RemembersSoManyPatientsAndNoMore) {
  PatientWatch watch;
  watch.expect({number("A1")}, 0);
  for (std::size_t i = 0; i < 10 * PatientWatch::kMostPatients; ++i)
    watch.heard({number("B" + std::to_string(i))}, static_cast<std::int64_t>(i));
  EXPECT_EQ(watch.take_others(), 10 * PatientWatch::kMostPatients);
  watch.expect({number("A1")}, 0);
  EXPECT_EQ(watch.take_others(), PatientWatch::kMostPatients);
}

}  // namespace
}  // namespace kiroku::recorder
