#include "recorder/control/plan_patient.h"

#include <cstdint>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

std::string number(std::uint32_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i) & 0xffU);
  return text;
}

constexpr std::uint32_t kOpen = 0xFFFFFFFF;

/// Elements with VRs or without (PS3.5 7.1).
struct Writer {
  bool explicit_vr = true;
  [[nodiscard]] std::string operator()(std::uint32_t group, std::uint32_t tag, const std::string& vr,
                                       const std::string& value, std::uint32_t length = 0) const {
    if (length == 0) length = static_cast<std::uint32_t>(value.size());
    const bool is_long = vr == "SQ" || vr == "OB" || vr == "UN";
    const std::string head = number(group, 2) + number(tag, 2);
    if (!explicit_vr || group == 0xFFFE) return head + number(length, 4) + value;
    return head + vr + (is_long ? number(0, 2) + number(length, 4) : number(length, 2)) + value;
  }
};

std::string dicom(const std::string& syntax, const std::string& elements) {
  return std::string(128, '\0') + "DICM" + Writer{}(2, 0x10, "UI", syntax) + elements;
}

class PatientsOfPlan : public testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> of(const std::vector<std::string>& pictures) const {
    nlohmann::json files{{{"role", "plan"}, {"name", "plan.json"}}};
    std::filesystem::create_directories(folder_ / "ct");
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      const std::string name = "ct/" + std::to_string(i) + ".dcm";
      std::ofstream(folder_ / name, std::ios::binary) << pictures[i];
      files.push_back({{"role", "volume"}, {"name", name}});
    }
    return seal({{"format", "kiroku-plan-seal/1"}, {"plan", "liver"}, {"files", files}});
  }
  [[nodiscard]] std::vector<std::string> seal(const nlohmann::json& document) const {
    std::ofstream(folder_ / "plan.seal.json") << document.dump();
    return patients_of_plan(folder_ / "plan.seal.json");
  }
  const test::TemporaryFolder folder_;
};

constexpr const char* kExplicit = "1.2.840.10008.1.2.1";
constexpr const char* kImplicit = "1.2.840.10008.1.2\0";

TEST_F(PatientsOfPlan, AreReadFromThePicturesOfItsCt) {
  const Writer with, without{false};
  const auto patient = [](const Writer& write, const std::string& id) {
    return write(8, 0x60, "CS", "CT") + write(0x10, 0x10, "PN", "BRAVO^BERTA") + write(0x10, 0x20, "LO", id) +
           write(0x28, 0x10, "US", number(2, 2));
  };
  EXPECT_THAT(of({dicom(kExplicit, patient(with, "B2"))}), ElementsAre("B2"));
  EXPECT_THAT(of({dicom(kImplicit, patient(without, "B2  "))}), ElementsAre("B2"));
  EXPECT_THAT(of({dicom(kExplicit, patient(with, "B2")), dicom(kExplicit, patient(with, "A1")),
                  dicom(kExplicit, patient(with, "B2"))}),
              ElementsAre("B2", "A1"));
  EXPECT_THAT(of(std::vector<std::string>(2 * kMostPlanPatients, "no picture")), IsEmpty());
  std::vector<std::string> many;
  for (int i = 0; i < 20; ++i) many.push_back(dicom(kExplicit, patient(with, "P" + std::to_string(i))));
  EXPECT_THAT(of(many), SizeIs(kMostPlanPatients));
}

// What begins a case sends them as JSON, and no case is kept from beginning by a number.
TEST_F(PatientsOfPlan, InACharacterSetOfTheFilesOwnSayNothing) {
  const Writer with;
  const auto id = [&](const std::string& text) { return dicom(kExplicit, with(0x10, 0x20, "LO", text)); };
  EXPECT_THAT(of({id("\xC4"
                     "7"),
                  id("A\n1"), id("B 2")}),
              ElementsAre("B 2"));
}

TEST_F(PatientsOfPlan, AreTheFilesOwnAndNotThoseOfItsSequences) {
  const Writer with, without{false};
  const std::string end = with(0xFFFE, 0xE00D, "", ""), last = with(0xFFFE, 0xE0DD, "", "");
  const std::string of_other = with(0x10, 0x20, "LO", "A1");
  const std::string open_item = with(0xFFFE, 0xE000, "", of_other + end, kOpen);
  const std::string closed_item = with(0xFFFE, 0xE000, "", of_other);
  const std::string own = with(0x10, 0x20, "LO", "B2");
  EXPECT_THAT(of({dicom(kExplicit, with(8, 0x1110, "SQ", open_item + closed_item + last, kOpen) + own)}),
              ElementsAre("B2"));
  EXPECT_THAT(of({dicom(kExplicit, with(8, 0x1110, "SQ", closed_item) + own)}), ElementsAre("B2"));
  const std::string unknown = without(0xFFFE, 0xE000, "", without(0x10, 0x20, "", "A1") + end, kOpen) + last;
  EXPECT_THAT(of({dicom(kExplicit, with(9, 0x1001, "UN", unknown, kOpen) + own)}), ElementsAre("B2"));
  EXPECT_THAT(of({dicom(kExplicit, with(0x10, 0x30, "DA", "19510802") + own)}), IsEmpty()) << "in no order";
}

TEST_F(PatientsOfPlan, AreNoneOfWhatCannotBeRead) {
  const Writer with;
  const std::string own = with(0x10, 0x20, "LO", "B2");
  EXPECT_THAT(
      of({"", "DICM", std::string(132, '\0'), dicom(kExplicit, ""), dicom("1.2.840.10008.1.2.2\0", own),
          dicom("1.2.840.10008.1.2.1.99", own), dicom(kExplicit, own.substr(0, 9)),
          dicom(kExplicit, with(0x10, 0x20, "LO", std::string(5000, 'x'))),
          dicom(kExplicit, with(8, 0x60, "CS", "CT", 60'000) + own)}),
      IsEmpty());
  std::string deep;
  for (int i = 0; i < 200; ++i) deep += with(8, 0x1110, "SQ", with(0xFFFE, 0xE000, "", "", kOpen), kOpen);
  EXPECT_THAT(of({dicom(kExplicit, deep + own)}), IsEmpty());
  EXPECT_THAT(seal("text"), IsEmpty());
  EXPECT_THAT(seal({{"files", 7}}), IsEmpty());
  EXPECT_THAT(seal({{"files", {7, {{"role", "volume"}}, {{"role", "volume"}, {"name", "ct"}}}}}), IsEmpty());
  EXPECT_THAT(patients_of_plan(folder_ / "none.seal.json"), IsEmpty());
}

}  // namespace
}  // namespace kiroku::recorder
