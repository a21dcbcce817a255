#include "apps/sim/breathing_comparing.h"

#include <array>
#include <filesystem>
#include <iostream>
#include <utility>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/standing_consents.h"
#include "apps/sim/case_fluoroscopy.h"
#include "apps/sim/compared_ct.h"
#include "apps/sim/comparison_outputs.h"
#include "apps/sim/comparison_progress.h"
#include "apps/sim/comparison_sealing.h"
#include "apps/sim/plan_at_hand.h"
#include "apps/sim/radiograph_series.h"
#include "base/error.h"
#include "base/json_or_null.h"
#include "base/number_text.h"
#include "crypto/encoding.h"
#include "sim/drr/dicom_radiograph.h"
#include "sim/volume/volume_reader.h"
#include "viewer/breathing/breathing_comparison.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

double in_mm(double metres) { return 1000 * metres; }

void check_breathing(const ComparisonRequest& request) {
  const std::array<std::pair<const char*, bool>, 19> of_operations{
      {{"--by-hand", request.by_hand.has_value()},
       {"--write-by-hand", request.write_by_hand.has_value()},
       {"--steps", request.steps},
       {"--identity-socket", request.identity_socket.has_value()},
       {"--name", request.name.has_value()},
       {"--stream", request.stream.has_value()},
       {"--show", request.form.has_value() && request.form != "beside"},
       {"--share", request.share.has_value()},
       {"--speed", request.speed.has_value()},
       {"--width", request.width.has_value()},
       {"--transfer", request.transfer.has_value()},
       {"--view", request.view.has_value()},
       {"--zoom", request.zoom.has_value()},
       {"--align-at", request.align_at.has_value()},
       {"--align", request.align == "auto"},
       {"--organ", request.organ.has_value() && request.organ != "rigid"},
       {"--colours", request.colours.has_value() && request.colours != "rest"},
       {"--field", request.field.has_value()},
       {"--lens", request.lens.has_value()}}};
  for (const auto& [option, given] : of_operations) {
    if (given)
      throw UsageError(*request.plan +
                       " is a breathing lung, which has no steps, tools or organ to look for: leave " +
                       option + " out");
  }
  if (!request.volume)
    throw UsageError(*request.plan + " is a breathing lung: name the CT that it lies in with --volume");
  if (!request.output || output_form(*request.output) != ComparisonOutput::kDocument)
    throw UsageError(*request.plan +
                     " is a breathing lung, whose comparison is a document: say where to with -o OUT.json");
}

CaseFluoroscopyRequest fluoroscopy_of(const ComparisonRequest& request) {
  return {.named = *request.named,
          .stream = request.fluoroscopy,
          .from = request.from,
          .to = request.to,
          .polarity = request.polarity,
          .identities = request.identities,
          .stream_option = "--fluoroscopy"};
}

/// What the document says of the pictures, beside what was found in them.
ordered_json breathing_json(const viewer::BreathingComparison& found, const CaseFluoroscopy& read,
                            const compare::NamedFile& geometry, const std::string& polarity) {
  ordered_json breathing{{"stream", read.recording.stream},
                         {"first_s", read.recording.first_s},
                         {"recorded_pictures", read.pictures},
                         {"polarity", polarity},
                         {"geometry", compare::file_json(geometry)}};
  breathing.update(viewer::comparison_json(found));
  return breathing;
}

std::string with_error(double value, double error, int digits) {
  return number_text(value, digits) + " ± " + number_text(error, 2);
}

void print_groups(const viewer::BreathingComparison& found) {
  std::vector<std::vector<std::string>> rows{{"", "planned", "found"}};
  const auto add = [&](const std::string& name, const sim::GroupMotion& planned,
                       const sim::GroupMotion& motion, const sim::WaveFit& wave) {
    rows.push_back({name + ", amplitude, mm", number_text(in_mm(planned.amplitude_m), 3),
                    with_error(in_mm(motion.amplitude_m), in_mm(wave.amplitude_error_m), 3)});
    rows.push_back({name + ", baseline, mm", number_text(in_mm(planned.baseline_m), 3),
                    with_error(in_mm(motion.baseline_m), in_mm(wave.baseline_error_m), 3)});
  };
  const sim::SeriesFit& fit = found.found.fit;
  add("rib cage", found.planned.motion.rib_cage, found.found.motion.motion.rib_cage, fit.rib_cage);
  add("diaphragm", found.planned.motion.diaphragm, found.found.motion.motion.diaphragm, fit.diaphragm);
  rows.push_back({"breath, s", number_text(*found.planned.cycle_s, 3),
                  fit.cycle ? with_error(fit.cycle->cycle_s, fit.cycle->error_s, 4) : "not sought"});
  std::cout << format_table(rows, "lrr", 2);
}

void print_tumour(const viewer::BreathingComparison& found) {
  const std::vector<double> off_m = found.distances_m();
  const std::string of = " of " + counted(found.radiographs.size(), "picture", "pictures");
  if (off_m.empty()) {
    std::cout << "  The tumour was seen in none" << of << ": nothing can be said of where it went\n";
    return;
  }
  const ordered_json tumour = viewer::comparison_json(found)["tumour"];
  const auto mm = [&](const char* key) { return number_text(tumour[key].get<double>(), 3) + " mm"; };
  std::cout << "  The tumour was seen in " << off_m.size() << of << ": " << mm("mean_mm")
            << " from where the plan has it on average, 95 % within " << mm("within_95_mm") << ", "
            << mm("largest_mm") << " at most; in " << found.beyond_two()
            << " by more than two standard deviations\n";
}

int tell_breathing(const ComparisonRequest& request, const viewer::BreathingComparison& found,
                   const compare::Provenance& made, const MadeComparison& written) {
  if (request.json) {
    ordered_json object{{"output", *request.output},
                        {"document", written.document.string()},
                        {"sha256", crypto::to_hex(written.digest)},
                        {"in_log", written.in_log},
                        {"time", time_of(written.stamps)},
                        {"time_stamps", stamps_json(written.stamps)},
                        {"case_names_plan", or_null(made.case_names_plan)},
                        {"one_patient", or_null(made.of_one_patient)},
                        {"cautions", compare::cautions_of(made)}};
    ordered_json breathing = viewer::comparison_json(found);
    breathing.erase("radiographs");
    object["breathing"] = std::move(breathing);
    print_json(object);
    return any_valid(written.stamps) ? kDone : kNoAnswer;
  }
  warn_of_missing(written.stamps);
  for (const std::string& caution : compare::cautions_of(made))
    std::cout << "  CAUTION: " << printable(caution) << "\n";
  print_groups(found);
  print_tumour(found);
  std::cout << "  Gradient correlation of the pictures with the plan "
            << number_text(found.mean_similarity(), 3) << ", with the motion that was found "
            << number_text(found.found.fit.similarity_after, 3) << "\n";
  for (const std::string& finding : found.found.fit.findings) std::cout << "  " << printable(finding) << "\n";
  std::cout << written.document.string()
            << (written.in_log ? " is entered into the appliance log"
                               : " is not sealed: the case is not of this home")
            << "\n  hash  " << crypto::to_hex(written.digest) << "\n"
            << stamp_lines(written.stamps)
            << "  The recording was not verified: kiroku verify tells whether it is whole\n";
  return any_valid(written.stamps) ? kDone : kNoAnswer;
}

}  // namespace

int make_breathing_comparison(const ComparisonRequest& request) {
  check_breathing(request);
  const Home home = Home::open(request.home);
  const CaseFluoroscopyRequest asked = fluoroscopy_of(request);
  const FoundFluoroscopy pictures = find_case_fluoroscopy(home, asked);
  const fs::path geometry =
      request.geometry ? fs::path(*request.geometry) : geometry_beside(home, pictures.stream);
  require_free(request, *request.output);
  const fs::path plan = plan_file_of(*request.plan);
  sim::BreathingModel model = sim::read_breathing_model(plan);
  static_cast<void>(model.needed_tumour());  // before what takes long
  const FilesAtHand at_hand = files_at_hand(plan, model.name);
  std::optional<compare::ComparedCt> ct = compared_ct(request, at_hand);
  const sim::ProjectionGeometry seen_by =
      (sim::is_dicom_file(geometry) ? sim::read_dicom_geometry(geometry) : sim::read_geometry(geometry))
          .geometry;
  static_cast<void>(
      enter_purpose(home, pictures.recording.folder(), request.purpose, "wrote a comparison with a plan"));
  ComparisonTold told(request.progress == "json");
  told.begin("opening the pictures of " + pictures.stream);
  CaseFluoroscopy read = read_case_fluoroscopy(home, pictures, asked);
  told.begin("reading " + *request.volume);
  sim::VolumeFile volume = sim::read_volume(*request.volume, {request.series.value_or(""), false});
  viewer::BenchInputs inputs{.file = plan,
                             .model = std::move(model),
                             .named = {},
                             .volume = std::move(volume.volume),
                             .geometry = seen_by,
                             .radiographs = std::move(read.radiographs),
                             .recording = read.recording};
  for (const std::vector<std::string>* warnings : {&inputs.model.warnings, &volume.findings}) {
    for (const std::string& warning : *warnings) {
      told.clear();
      if (!request.json) print_error("kiroku", "warning: " + warning);
    }
  }
  const viewer::BreathingBench bench(std::move(inputs), [&](const std::string& step) { told.begin(step); });
  std::string doing;
  const viewer::BreathingComparison found =
      viewer::compare_breathing(bench, [&](const std::string& step, std::size_t done, std::size_t all) {
        if (std::exchange(doing, step) != step) told.begin(step);
        if (all > 0) told.update(static_cast<double>(done) / static_cast<double>(all));
      });
  told.clear();
  const PatientNumbers numbers =
      patient_numbers(request, {}, pictures.recording, load_identities(request.identities, home));
  const compare::Provenance made =
      provenance_of(request, pictures.recording, at_hand, std::move(ct), numbers);
  ordered_json document = compare::provenance_json(made, pictures.stream);
  document["breathing"] =
      breathing_json(found, read, named(hashed("geometry", geometry.filename().string(), geometry)),
                     request.polarity.value_or("bone-black"));
  document["outputs"] = compare::files_json(made.outputs);
  const MadeComparison written =
      write_sealed(request, home, pictures.recording, compare::document_text(document));
  return tell_breathing(request, found, made, written);
}

}  // namespace kiroku::apps
