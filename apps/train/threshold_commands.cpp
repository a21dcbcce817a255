#include <cmath>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/sim/number_option.h"
#include "apps/train/train_command.h"
#include "base/number_text.h"
#include "trainer/haptic_rate/published_thresholds.h"
#include "trainer/haptic_rate/sensing_subject.h"
#include "trainer/statistics/power.h"

namespace kiroku::apps {
namespace {

using Json = nlohmann::ordered_json;
using trainer::RateSeries;

struct PredictRequest {
  std::string masking = "0";
  std::optional<std::string> series, device;
  bool json = false;
};

struct PowerRequest {
  std::string power = "0.8";
  bool json = false;
};

Json optional_json(const std::optional<double>& number) { return number ? Json(*number) : Json(nullptr); }

std::string text_of(const trainer::PredictedThreshold& predicted) {
  if (predicted.hz) return number_text(*predicted.hz, 3) + " Hz";
  return predicted.all_are_felt ? "above 100 Hz" : "none is felt";
}

/// The conditions of a study in one manner.
Json predictions_of(const trainer::Plate& plate, RateSeries series, const trainer::SensingModel& model) {
  const std::vector<trainer::PublishedThreshold> study = trainer::published_thresholds(series);
  const trainer::PublishedThreshold& first = study.front();
  trainer::SensingModel strict = model;
  strict.manner = trainer::Manner::kPress;
  strict.keener_db = trainer::keener_for(plate, first.fingers, first.mean_hz, strict);
  Json rows = Json::array();
  for (const trainer::PublishedThreshold& published : study) {
    const trainer::PredictedThreshold predicted =
        trainer::predicted_threshold(plate, series, published.fingers, model);
    const trainer::PredictedRange beside =
        trainer::predicted_beside(plate, series, published.fingers, first.fingers, first.mean_hz, model);
    rows.push_back({{"fingers", published.fingers.text()},
                    {"manner", trainer::name_of(model.manner)},
                    {"predicted_hz", optional_json(predicted.hz)},
                    {"predicted", text_of(predicted)},
                    {"level_at_100_hz_db", predicted.level_at_100_hz_db},
                    {"beside_first_hz", {beside.least_hz, beside.most_hz}},
                    {"paper_hz", published.mean_hz},
                    {"masking_for_paper_db", model.manner == trainer::Manner::kPress
                                                 ? optional_json(trainer::masking_for(
                                                       plate, published.fingers, published.mean_hz, strict))
                                                 : Json(nullptr)}});
  }
  return rows;
}

int run_predict(const PredictRequest& request) {
  const RateSeries series = trainer::rate_series(request.series.value_or("haptic-rate"));
  trainer::SensingModel model;
  model.masking_db = parse_number(request.masking, "--masking", 0, 60);
  if (request.device) model.device_hz = parse_number(*request.device, "--device-bandwidth", 1, 1e5);
  Progress progress("pressing the plate");
  const trainer::Plate plate;
  Json rows = Json::array();
  for (const trainer::Manner manner : {trainer::Manner::kPress, trainer::Manner::kStroke}) {
    progress.update(rows.empty() ? 0 : 1, 2);
    model.manner = manner;
    for (Json& row : predictions_of(plate, series, model)) rows.push_back(std::move(row));
  }
  progress.clear();
  const trainer::PublishedThreshold first = trainer::published_thresholds(series).front();
  if (request.json) {
    print_json({{"series", trainer::name_of(series)}, {"predictions", rows}});
    return kDone;
  }
  std::cout << "what channels of touch let expect of the " << trainer::name_of(series)
            << " study\n  fingers, manner  felt up to, at 100 Hz above just felt  if vibrating is what makes "
            << first.fingers.text() << " pressed " << number_text(first.mean_hz, 3)
            << " Hz: by all curves  the study's  masking that would make them agree\n";
  for (const Json& row : rows) {
    std::cout << "  " << row["fingers"].get<std::string>() << ", " << row["manner"].get<std::string>() << "  "
              << row["predicted"].get<std::string>() << ", "
              << number_text(row["level_at_100_hz_db"].get<double>(), 3) << " dB  "
              << number_text(row["beside_first_hz"][0].get<double>(), 3) << " to "
              << number_text(row["beside_first_hz"][1].get<double>(), 3) << " Hz  ";
    if (row["manner"] == "press")
      std::cout << number_text(row["paper_hz"].get<double>(), 3) << " Hz";
    else
      std::cout << "not measured";
    if (!row["masking_for_paper_db"].is_null())
      std::cout << "  " << number_text(row["masking_for_paper_db"].get<double>(), 3) << " dB";
    std::cout << "\n";
  }
  return kDone;
}

int run_power(const PowerRequest& request) {
  const double power = parse_number(request.power, "--power", 0.06, 0.999);
  const std::vector<trainer::PublishedThreshold> table =
      trainer::published_thresholds(RateSeries::kExclusion);
  const double lowest_hz =
                   trainer::rate_hz(RateSeries::kExclusion, trainer::rates_of(RateSeries::kExclusion)),
               highest_hz = trainer::rate_hz(RateSeries::kExclusion, 1);
  Json conditions = Json::array(), pairs = Json::array(), as_published = Json::array();
  for (const trainer::PublishedThreshold& one : table) {
    const auto allowed = trainer::values_allowed(one.mean_hz, *one.sd_hz, lowest_hz, highest_hz);
    conditions.push_back(
        {{"fingers", one.fingers.text()},
         {"mean_hz", one.mean_hz},
         {"sd_hz", *one.sd_hz},
         {"values_needed", trainer::values_needed(one.mean_hz, *one.sd_hz)},
         {"values_needed_in_series", trainer::values_needed(one.mean_hz, *one.sd_hz, lowest_hz)},
         {"values_allowed_in_series", allowed ? Json(*allowed) : Json(nullptr)}});
  }
  std::size_t for_published_p = 2;
  const auto p_of = [](std::size_t values) { return trainer::single_and_several_of_table_1(values).test->p; };
  while (p_of(for_published_p) > trainer::kPublishedP) ++for_published_p;
  for (std::size_t i = 0; i < table.size(); ++i) {
    for (std::size_t j = i + 1; j < table.size(); ++j) {
      const double effect = trainer::effect_between(table[i], table[j]);
      pairs.push_back({{"first", table[i].fingers.text()},
                       {"second", table[j].fingers.text()},
                       {"effect", effect},
                       {"power_of_six", trainer::power_of_pairs(effect, trainer::kPublishedSubjects)},
                       {"people_needed", trainer::pairs_needed(effect, power)}});
    }
  }
  const double p_of_six = p_of(trainer::kPublishedSubjects);
  if (request.json) {
    print_json({{"power", power},
                {"conditions", conditions},
                {"p_published", trainer::kPublishedP},
                {"p_of_six_values_each", p_of_six},
                {"values_each_for_published_p", for_published_p},
                {"pairs", pairs}});
    return kDone;
  }
  std::cout << "Table 1 of the exclusion study, from its means and standard deviations alone\n"
               "  fingers  mean (SD)  values that it takes at least: above 0 Hz; among the series' rates\n";
  for (const Json& one : conditions) {
    std::cout << "  " << one["fingers"].get<std::string>() << "  "
              << number_text(one["mean_hz"].get<double>(), 3) << " ("
              << number_text(one["sd_hz"].get<double>(), 3) << ") Hz  " << one["values_needed"].get<int>()
              << "; " << one["values_needed_in_series"].get<int>();
    if (!one["values_allowed_in_series"].is_null())
      std::cout << ", and " << one["values_allowed_in_series"].get<int>() << " at most";
    std::cout << "\n";
  }
  std::cout << "  six people cannot have a spread that takes more than six values: these are not of one "
               "threshold a "
               "person\n  one finger against two, Welch's t: p "
            << number_text(p_of_six, 2) << " of six values each; published "
            << number_text(trainer::kPublishedP, 2) << ", which takes " << for_published_p << " each\n"
            << "  people that a study of pairs takes for a power of " << number_text(100 * power, 3)
            << " %, by log-normal populations\n";
  for (const Json& one : pairs) {
    std::cout << "  " << one["first"].get<std::string>() << " and " << one["second"].get<std::string>()
              << ": effect " << number_text(one["effect"].get<double>(), 2) << ", six find it with "
              << number_text(100 * one["power_of_six"].get<double>(), 2) << " %, it takes "
              << one["people_needed"].get<int>() << "\n";
  }
  return kDone;
}

}  // namespace

void add_train_threshold_commands(Command& train) {
  {
    Command& command = train.add_command("predict", "which rates the channels of touch would feel");
    const auto request = std::make_shared<PredictRequest>();
    command.choice("--series", {"haptic-rate", "exclusion"}, request->series, "whose rates and fingers",
                   "haptic-rate");
    command.option("--device-bandwidth", "HZ", request->device, "of a device that smooths forces",
                   "one that plays all");
    command.option("--masking", "DB", request->masking, "by which a finger raises its neighbour's threshold");
    command.flag("--json", request->json, "prints one JSON object instead");
    command.explain(
        "The plate is pressed and stroked, the steps of its forces move the skin, and the channels of touch "
        "feel some of that. The first column puts nothing in. The second asks which threshold each condition "
        "has if people call vibrating only what makes the first one's the study's, over all curves that the "
        "sources allow. The last says how much fingers would have to mask of each other for the study's "
        "threshold.");
    command.example("kiroku train predict", "one to five fingers");
    command.example("kiroku train predict --series exclusion", "the exclusion study's fingers and pairs");
    command.on_run([request] { return run_predict(*request); });
  }
  {
    Command& command =
        train.add_command("power", "how many people the exclusion study's differences take to be found");
    const auto request = std::make_shared<PowerRequest>();
    command.option("--power", "SHARE", request->power, "the chance to find a difference that is there");
    command.flag("--json", request->json, "prints one JSON object instead");
    command.explain(
        "From the means and standard deviations of its Table 1: how many values there must have been, which "
        "p follows "
        "for one finger against two, and how many people a study of each pair would take (Student's t for "
        "pairs on "
        "logarithms, two-sided at 5 %).");
    command.example("kiroku train power", "for a power of 80 %");
    command.on_run([request] { return run_power(*request); });
  }
}

}  // namespace kiroku::apps
