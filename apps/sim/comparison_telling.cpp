#include "apps/sim/comparison_telling.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "archive/reading/case_reader.h"
#include "base/joined.h"
#include "base/json_or_null.h"
#include "base/number_text.h"
#include "base/utc_time.h"
#include "crypto/encoding.h"
#include "viewer/compare/by_hand.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

constexpr std::int64_t kNsPerSecond = 1'000'000'000;

void print_comparison(const compare::Comparison& comparison, const PlanAtHand& at_hand) {
  std::vector<std::vector<std::string>> rows{{"step", "done as", "began at", "lasted", "planned for"}};
  for (const compare::StepFigures& figures : comparison.figures) {
    const compare::PlannedStep& planned = comparison.steps[figures.step];
    const std::string name = std::to_string(figures.step + 1) + ". " + printable(planned.name);
    const std::string lasts = number_text(planned.duration_s, 4) + " s";
    if (const compare::StepMatch* const match = comparison.matching.match_of(figures.step)) {
      rows.push_back(
          {name, std::to_string(*figures.done_as + 1) + ".",
           archive::case_time_text(match->span.start_ns, comparison.case_begins_ns),
           number_text(double(match->span.end_ns - match->span.start_ns) / double(kNsPerSecond), 4) + " s",
           lasts});
    } else {
      rows.push_back({name, "not found", "", "", lasts});
    }
  }
  std::cout << format_table(rows, "lrrrr", 2);
  for (const compare::Mark& mark : comparison.matching.ambiguous) {
    std::cout << "  the mark at " << archive::case_time_text(mark.time_ns, comparison.case_begins_ns)
              << " names a step among other words, and neither begins nor ends it: \"" << printable(mark.text)
              << "\"\n";
  }
  if (comparison.record.events_lacking > 0) {
    std::cout << "  events to which the ledger commits and whose lines are not there: "
              << comparison.record.events_lacking << "; any of them may have marked a step\n";
  }
  if (const compare::LeftOut& left_out = comparison.record.left_out; left_out.any()) {
    std::cout << "  vital signs left out, as the monitor or the recorder marks them so: "
              << left_out.questionable << " questionable and " << left_out.invalid << " invalid values, "
              << left_out.alarms << " alarms\n";
  }
  for (const compare::ToolDistance& tool : comparison.tools) {
    std::cout << "  " << printable(at_hand.plan.tools[tool.tool].tool.name) << ": "
              << number_text(tool.all.mean_px, 3) << " pixels from its planned way on average, "
              << number_text(tool.all.largest_px, 3) << " at most, in " << tool.all.pictures << " pictures\n";
  }
}

ordered_json found_json(const compare::StepMatch& match) {
  ordered_json pauses = ordered_json::array();
  for (const archive::Span& pause : match.pauses)
    pauses.push_back({{"start_ns", pause.start_ns}, {"end_ns", pause.end_ns}});
  const bool stated =
      match.end_from == compare::KnownFrom::kMark || match.end_from == compare::KnownFrom::kHand;
  return {{"step", match.step + 1},
          {"start_ns", match.span.start_ns},
          {"end_ns", stated ? ordered_json(match.span.end_ns) : ordered_json(nullptr)},
          {"pauses", std::move(pauses)}};
}

void print_fluoroscopy(const compare::Fluoroscopy& found) {
  std::cout << "  fluoroscopy: gradient correlation " << number_text(found.similarity, 4);
  if (found.alignment) {
    constexpr double kMmPerM = 1000;
    const sim::Vector3 mm = kMmPerM * found.alignment->translation_m;
    std::cout << ", aligned " << number_text(found.alignment->similarity_after, 4) << "; the patient lay "
              << number_text(mm.x(), 3) << ", " << number_text(mm.y(), 3) << ", " << number_text(mm.z(), 3)
              << " mm to the left, back and head";
  }
  std::cout << "\n";
}

/// Where the recording departed from the plan, step by step, and where nothing can be said.
void print_departures(const compare::Comparison& comparison) {
  const compare::Alignment& found = *comparison.alignment;
  if (!found.deformed || found.deformed->departures.empty()) return;
  constexpr double kMmPerM = 1000;
  const std::vector<compare::StepDeparture> steps = found.step_departures();
  for (std::size_t number = 0; number < comparison.steps.size(); ++number) {
    const auto step = std::ranges::find(steps, number, &compare::StepDeparture::step);
    std::cout << "    " << number + 1 << ". " << printable(comparison.steps[number].name) << ": ";
    if (step == steps.end() || step->compared == 0) {
      std::cout << "nothing can be said of a departure from the plan\n";
      continue;
    }
    if (step->departed == 0) {
      std::cout << "as planned, within two standard errors";
    } else {
      std::cout << "departed from the plan by up to " << number_text(kMmPerM * step->largest_m, 3)
                << " mm (standard error " << number_text(kMmPerM * step->largest_error_m, 2) << " mm), in "
                << step->departed << " pictures";
    }
    std::cout << " of " << step->compared << " compared, of " << step->pictures << "\n";
  }
}

void print_alignment(const compare::Alignment& found, std::int64_t begins_ns) {
  std::cout << "  the plan's organ was placed in " << found.held() << " of " << found.moments.size()
            << " pictures\n";
  if (found.lens) {
    constexpr double kPercent = 100;
    const double drawn_in = found.lens->lens.drawn_in();
    std::cout << "  by the lens " << printable(found.lens->file.name) << ": "
              << (drawn_in < 0 ? "pincushion" : "barrel") << " distortion of "
              << number_text(kPercent * std::abs(drawn_in), 2) << " % at the farthest corner, field of view "
              << number_text(found.field_deg, 3) << " degrees without it\n";
  }
  if (found.deformed) {
    constexpr double kMmPerM = 1000;
    std::cout << "  it was deformed to fit in " << found.deformed->deformed()
              << " pictures, and displaced by up to " << number_text(kMmPerM * found.deformed->largest_m(), 3)
              << " mm\n";
    for (const auto& [why, pictures] : found.deformed->rigid())
      std::cout << "    not in " << pictures << ": " << compare::sentence_of(why) << "\n";
  }
  for (const compare::Alignment::Lost& lost : found.lost()) {
    std::cout << "    not from " << archive::case_time_text(lost.span.start_ns, begins_ns) << " to "
              << archive::case_time_text(lost.span.end_ns, begins_ns) << ": "
              << compare::sentence_of(lost.why) << "\n";
  }
}

}  // namespace

int tell_comparison(const ComparisonRequest& request, const compare::Comparison& comparison,
                    const PlanAtHand& at_hand, const compare::Provenance& provenance,
                    const PatientNumbers& numbers, const MadeComparison& made, std::uint64_t pictures,
                    const Keeping* keeping) {
  const std::string document =
      keeping == nullptr ? made.document.string() : keeping->place().sealed_document().string();
  const std::string output = request.output.value_or(document);
  if (request.json) {
    ordered_json object{
        {"output", output},
        {"document", document},
        {"sha256", crypto::to_hex(made.digest)},
        {"in_log", made.in_log},
        {"time", time_of(made.stamps)},
        {"time_stamps", stamps_json(made.stamps)},
        {"steps_found", comparison.matching.matches.size()},
        {"steps_planned", comparison.steps.size()},
        {"in_planned_order", comparison.matching.in_planned_order()},
        {"pictures", pictures},
        {"case_names_plan", or_null(provenance.case_names_plan)},
        {"ct_of_plan", provenance.ct ? ordered_json(provenance.ct->of_plan) : ordered_json(nullptr)},
        {"one_patient", or_null(provenance.of_one_patient)},
        {"cautions", compare::cautions_of(provenance)}};
    // Not to a program that compares for somebody, who may not see whom the case is of.
    if (provenance.of_one_patient == false && !request.asked_by)
      object["patient_numbers"] = {{"ct", joined(numbers.ct)}, {"case", joined(numbers.of_case)}};
    if (comparison.fluoroscopy) {
      object["similarity"] = {{"before", comparison.fluoroscopy->similarity}};
      if (comparison.fluoroscopy->alignment)
        object["similarity"]["after"] = comparison.fluoroscopy->alignment->similarity_after;
    }
    if (comparison.alignment) {
      object["aligned"] = {{"pictures", comparison.alignment->moments.size()},
                           {"held", comparison.alignment->held()}};
      if (comparison.alignment->lens)
        object["aligned"]["lens_sha256"] = crypto::to_hex(comparison.alignment->lens->file.sha256);
      if (comparison.alignment->deformed)
        object["aligned"]["deformed"] = comparison.alignment->deformed->deformed();
      if (comparison.alignment->deformed && !comparison.alignment->deformed->departures.empty()) {
        const auto& all = comparison.alignment->deformed->departures;
        object["aligned"]["compared"] = std::ranges::count_if(all, &compare::Departure::compared);
        object["aligned"]["departed"] = std::ranges::count_if(all, &compare::Departure::departed);
      }
    }
    if (keeping != nullptr) object["name"] = keeping->place().name;
    print_json(object);
  } else {
    warn_of_missing(made.stamps);
    for (const std::string& caution : compare::cautions_of(provenance))
      std::cout << "  CAUTION: " << printable(caution) << "\n";
    if (provenance.of_one_patient == false && !request.asked_by)
      std::cout << "    the CT states " << printable(joined(numbers.ct)) << ", the case "
                << printable(joined(numbers.of_case)) << "\n";
    print_comparison(comparison, at_hand);
    if (comparison.fluoroscopy) print_fluoroscopy(*comparison.fluoroscopy);
    if (comparison.alignment) {
      print_alignment(*comparison.alignment, comparison.case_begins_ns);
      print_departures(comparison);
    }
    std::cout << output << ": " << comparison.matching.matches.size() << " of " << comparison.steps.size()
              << " steps found" << (comparison.matching.in_planned_order() ? "" : ", in another order")
              << "\n  " << document
              << (made.in_log ? " is entered into the appliance log"
                              : " is not sealed: "
                                "the case is not of this home")
              << "\n  hash  " << crypto::to_hex(made.digest) << "\n";
    std::cout << stamp_lines(made.stamps);
    std::cout << "  The recording was not verified: kiroku verify tells whether it is whole\n";
    if (keeping != nullptr) {
      std::cout << "  next  kiroku view shows it in the case"
                << (pictures == 0 ? ", without the plan's film: the plan names no CT (--volume)" : "")
                << "\n";
    }
  }
  return any_valid(made.stamps) ? kDone : kNoAnswer;
}

void tell_steps(const compare::Comparison& comparison, const PlanAtHand& at_hand,
                const std::optional<crypto::Sha256Digest>& named, bool json) {
  compare::Provenance about;
  if (named) about.case_names_plan = *named == at_hand.seal;
  if (!json) {
    for (const std::string& caution : compare::cautions_of(about))
      std::cout << "  CAUTION: " << printable(caution) << "\n";
    print_comparison(comparison, at_hand);
    return;
  }
  ordered_json steps = ordered_json::array(), found = ordered_json::array(), tools = ordered_json::array();
  for (std::size_t step = 0; step < comparison.steps.size(); ++step) {
    const compare::PlannedStep& planned = comparison.steps[step];
    steps.push_back({{"step", step + 1},
                     {"name", planned.name},
                     {"start_s", planned.start_s},
                     {"duration_s", planned.duration_s}});
  }
  for (const compare::StepMatch& match : comparison.matching.matches) found.push_back(found_json(match));
  ordered_json ambiguous = ordered_json::array();
  for (const compare::Mark& mark : comparison.matching.ambiguous)
    ambiguous.push_back({{"time_ns", mark.time_ns}, {"text", mark.text}});
  for (const auto& each : at_hand.plan.tools) tools.push_back(each.tool.name);
  print_json({{"plan", at_hand.plan.name},
              {"seal", crypto::to_hex(at_hand.seal)},
              {"case_names_plan", or_null(about.case_names_plan)},
              {"stream", comparison.stream},
              {"begins_ns", comparison.case_begins_ns},
              {"end_ns", comparison.recording_end_ns},
              {"steps", std::move(steps)},
              {"found", std::move(found)},
              {"ambiguous_marks", std::move(ambiguous)},
              {"tools", std::move(tools)}});
}

}  // namespace kiroku::apps
