#include "viewer/compare/comparison_document.h"

#include <fstream>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::compare {
namespace {

using testing::HasSubstr;
using testing::Not;

/// Two steps, of which the second was done first; names that would be markup.
Comparison sample() {
  Comparison comparison;
  comparison.steps = {{"<script>alert(1)</script>", 0, 2}, {"Clip & cut", 2, 1}, {"Close", 3, 1}};
  const std::vector<Mark> marks{{2 * kSecond, "clip & cut"},
                                {4 * kSecond, "done"},
                                {5 * kSecond, "step 1: <now>"},
                                {9 * kSecond, "step 1"},
                                {9 * kSecond, "not <b>step 1</b>"}};
  comparison.matching = match_by_marks(comparison.steps, marks, 10 * kSecond);
  comparison.map.emplace(comparison.steps, comparison.matching);
  comparison.stream = "endoscope";
  comparison.recording_end_ns = 10 * kSecond;
  VitalSeries systolic{"arterial pressure, systolic", "mm[Hg]", {}};
  for (int second = 0; second < 10; ++second)
    systolic.numbers.push_back({second * kSecond, second < 3 ? 120.0 : 85.0});
  comparison.record.vitals[{"MDC_PRESS_BLD_ART_ABP_SYS", ""}] = systolic;
  comparison.record.events_lacking = 2;
  comparison.figures = figures_of(comparison.steps, comparison.matching, comparison.record);
  return comparison;
}

Provenance provenance() {
  Provenance made;
  made.made_by = "Dr. <i>Sato</i>";
  made.made_at = *parse_utc("2026-08-06T07:12:00Z");
  made.program = "kiroku 0";
  made.case_state = {"20260805T091502Z-3f9c21ab", 17, crypto::sha256(bytes_of("ledger"))};
  made.plan = "A & B";
  made.plan_seal = crypto::sha256(bytes_of("seal"));
  made.plan_files = {{"plan", "liver.json", 12, crypto::sha256(bytes_of("plan"))}};
  made.case_names_plan = false;
  made.outputs = {{"film", "out.mp4", 99, crypto::sha256(bytes_of("film"))}};
  return made;
}

TEST(ComparisonDocument, SaysWhatWasFoundAndIsReadBack) {
  const std::string text = comparison_json(sample(), {}, provenance());
  const nlohmann::json document = nlohmann::json::parse(text);
  EXPECT_EQ(document["in_planned_order"], false);
  EXPECT_EQ(document["steps"][0]["done"]["order"], 2);
  EXPECT_EQ(document["steps"][0]["done"]["end_from"], "recording-end");
  EXPECT_EQ(document["steps"][0]["done"]["pause_before_ns"], kSecond);
  EXPECT_EQ(document["steps"][1]["done"]["end_from"], "mark");
  EXPECT_EQ(document["steps"][1]["pressure_events"][0]["text"], "systolic pressure 85.0 mmHg, below 90");
  EXPECT_EQ(document["steps"][2]["done"], nullptr);
  EXPECT_EQ(document["repeated_marks"][0]["text"], "step 1");
  EXPECT_EQ(document["ambiguous_marks"][0]["text"], "not <b>step 1</b>");
  EXPECT_EQ(document["events_lacking"], 2);
  EXPECT_EQ(document["time_map"]["pieces"][0]["knots"][1], nlohmann::json::parse("[3, 4000000000]"));
  EXPECT_EQ(document["registration"], nullptr);
  EXPECT_EQ(document["case"]["verified"], false);
  EXPECT_EQ(text, comparison_json(sample(), {}, provenance()));

  const Provenance back = read_provenance(text, "out.json");
  EXPECT_EQ(back.made_by, "Dr. <i>Sato</i>");
  EXPECT_EQ(back.made_at, provenance().made_at);
  EXPECT_EQ(back.case_state.case_id, "20260805T091502Z-3f9c21ab");
  EXPECT_EQ(back.case_state.ledger_size, 17U);
  EXPECT_EQ(back.case_state.ledger_root, provenance().case_state.ledger_root);
  EXPECT_EQ(back.plan_seal, provenance().plan_seal);
  EXPECT_EQ(back.plan_files[0].name, "liver.json");
  EXPECT_EQ(back.case_names_plan, false);
  EXPECT_EQ(back.outputs[0].sha256, provenance().outputs[0].sha256);
}

TEST(ComparisonDocument, RefusesWhatIsNone) {
  const std::string text = comparison_json(sample(), {}, provenance());
  for (const std::string& wrong :
       {std::string("{}"), std::string("no"), std::string(R"({"format": "kiroku-plan-seal/1"})"),
        text.substr(0, text.size() / 2)})
    EXPECT_THROW(read_provenance(wrong, "x.json"), UsageError);
}

TEST(ComparisonDocument, IsAPageInWhichNoNameIsMarkup) {
  const std::string page = comparison_html(sample(), {}, provenance(), {{"1. <x>", to_bytes("png")}});
  EXPECT_THAT(page, Not(HasSubstr("<script>")));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;alert(1)&lt;/script&gt;"));
  EXPECT_THAT(page, HasSubstr("Dr. &lt;i&gt;Sato&lt;/i&gt;"));
  EXPECT_THAT(page, HasSubstr("Plan and recording: A &amp; B"));
  EXPECT_THAT(
      page,
      HasSubstr("2 of 3 planned steps were found in the recording, <b>in another order than planned</b>"));
  EXPECT_THAT(page, HasSubstr("Not found: 3. Close."));
  EXPECT_THAT(page, HasSubstr("names a step among other words"));
  EXPECT_THAT(page, HasSubstr("not &lt;b&gt;step 1&lt;/b&gt;"));
  EXPECT_THAT(page, HasSubstr("whose lines are not there: 2."));
  EXPECT_THAT(page, HasSubstr("was recorded by another plan"));
  EXPECT_THAT(page, HasSubstr("data:image/png;base64,cG5n"));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
}

// Of a forged recording a page of figures and pictures can be made as well.
TEST(ComparisonDocument, ItsPageSaysFirstThatTheRecordingWasNotVerified) {
  const std::string page = comparison_html(sample(), {}, provenance(), {});
  const std::size_t said = page.find("The recording was not verified for this comparison.");
  ASSERT_NE(said, std::string::npos);
  EXPECT_LT(said, page.find("planned steps were found"));
  EXPECT_THAT(page, HasSubstr("<code>kiroku verify 20260805T091502Z-3f9c21ab</code>"));
}

TEST(ComparisonDocument, SaysWhichCtItShowsAndWhoseItIs) {
  Provenance made = provenance();
  made.ct = ComparedCt{false, "77", {{"volume", "other/<ct>.dcm", 9, crypto::sha256(bytes_of("ct"))}}};
  made.of_one_patient = false;
  const std::string text = comparison_json(sample(), {}, made);
  const nlohmann::json document = nlohmann::json::parse(text);
  EXPECT_EQ(document["ct"]["of_plan"], false);
  EXPECT_EQ(document["ct"]["series"], "77");
  EXPECT_EQ(document["one_patient"], false);
  const Provenance back = read_provenance(text, "out.json");
  ASSERT_TRUE(back.ct.has_value());
  EXPECT_FALSE(back.ct->of_plan);
  EXPECT_EQ(back.ct->files[0].sha256, made.ct->files[0].sha256);
  EXPECT_EQ(back.of_one_patient, false);
  EXPECT_THAT(cautions_of(back), testing::ElementsAre(HasSubstr("another plan"), HasSubstr("another patient"),
                                                      HasSubstr("not part of the plan: other")));
  const std::string page = comparison_html(sample(), {}, made, {});
  EXPECT_LT(page.find("The CT shown is not part of the plan"), page.find("planned steps were found"));
  EXPECT_THAT(page, HasSubstr("CT, <b>not the plan's</b>"));
  EXPECT_THAT(page, HasSubstr("other/&lt;ct&gt;.dcm"));
  // A document of an earlier version says nothing of it.
  nlohmann::ordered_json earlier = nlohmann::ordered_json::parse(text);
  earlier.erase("ct");
  earlier.erase("one_patient");
  EXPECT_FALSE(read_provenance(earlier.dump(), "out.json").ct.has_value());
}

TEST(ComparisonDocument, ItsPageSaysWhereNoPressureWasMeasured) {
  Comparison comparison = sample();
  EXPECT_THAT(comparison_html(comparison, {}, provenance(), {}), Not(HasSubstr("Not measured")));
  comparison.record.vitals.clear();
  comparison.figures = figures_of(comparison.steps, comparison.matching, comparison.record);
  const std::string page = comparison_html(comparison, {}, provenance(), {});
  EXPECT_THAT(page, HasSubstr("<b>Not measured:</b> no systolic or mean arterial pressure was recorded while "
                              "any step was done"));
  EXPECT_THAT(page, Not(HasSubstr("None while a step was done")));
  const nlohmann::json document = nlohmann::json::parse(comparison_json(comparison, {}, provenance()));
  EXPECT_EQ(document["steps"][0]["pressure_measured"], false);
}

TEST(ComparisonDocument, KnowsACaseByTheFirstEntriesOfItsLedger) {
  const test::TemporaryFolder folder;
  const test::Reader reader = test::make_reader();
  const auto recorded = test::record_case(folder / "archive",
                                          {{"events", "events", "application/jsonl", {to_bytes("x\n")}, {1}}},
                                          reader.recipients);
  const CaseState state = state_of(recorded);
  EXPECT_EQ(state.case_id, recorded.filename().string());
  EXPECT_GT(state.ledger_size, 2U);
  EXPECT_EQ(root_of_first(recorded, state.ledger_size), state.ledger_root);
  EXPECT_NE(root_of_first(recorded, state.ledger_size - 1), state.ledger_root);
  EXPECT_FALSE(root_of_first(recorded, state.ledger_size + 1).has_value());
  // A time-stamp that comes later changes nothing of what was compared.
  std::ofstream(recorded / "ledger.jsonl", std::ios::app) << "more\n";
  EXPECT_EQ(root_of_first(recorded, state.ledger_size), state.ledger_root);
  EXPECT_THROW(state_of(folder.path()), Error);
}

}  // namespace
}  // namespace kiroku::compare
