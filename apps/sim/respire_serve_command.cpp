// 'kiroku respire serve': a lung's motion fitted to radiographs by hand, on a page.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <mutex>
#include <thread>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/step_line.h"
#include "apps/common/time_option.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kiroku/serving.h"
#include "apps/sim/case_fluoroscopy.h"
#include "apps/sim/number_option.h"
#include "apps/sim/patient_of_material.h"
#include "apps/sim/plan_sealing.h"
#include "apps/sim/radiograph_series.h"
#include "apps/sim/sim_command.h"
#include "base/error.h"
#include "base/number_text.h"
#include "crypto/encoding.h"
#include "sim/drr/dicom_radiograph.h"
#include "sim/volume/volume_reader.h"
#include "viewer/breathing/breathing_api.h"
#include "viewer/viewer.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct RespireServeRequest {
  ServingRequest serving{.listen = "", .own_port = "8447"};
  std::string volume, model;
  std::optional<std::string> geometry, series, radiographs, named, stream, from, to, polarity, rate, start,
      at_once;
  std::vector<std::string> identities;
  bool resample = false;
};

void check(const RespireServeRequest& request) {
  if (!request.serving.listen.empty() && !page_of(request.serving))
    throw UsageError("there is no page to work on: it was not built; name its folder with --web");
  if (request.radiographs && request.named)
    throw UsageError("--radiographs and --case are two series: give one of them");
  if (!request.radiographs && !request.named && (request.rate || request.polarity || request.start))
    throw UsageError(
        "--rate, --polarity and --start say something of --radiographs or --case: give one of these too");
  if (!request.named && (request.stream || request.from || request.to || !request.identities.empty()))
    throw UsageError("--stream, --from, --to and --identity say something of --case: give that too");
  if (!request.named && !request.geometry)
    throw UsageError("without --case nothing says how the patient is seen: give --geometry");
}

std::optional<double> rate_of(const RespireServeRequest& request) {
  if (!request.rate) return std::nullopt;
  return parse_number(*request.rate, "--rate", 0.01, 240);
}

CaseFluoroscopyRequest fluoroscopy_of(const RespireServeRequest& request) {
  CaseFluoroscopyRequest asked{.named = *request.named,
                               .stream = request.stream,
                               .from = request.from,
                               .to = request.to,
                               .polarity = request.polarity,
                               .identities = request.identities};
  if (const std::optional<double> rate = rate_of(request)) asked.most_a_second = *rate;
  return asked;
}

sim::ProjectionGeometry geometry_from(const fs::path& file) {
  return (sim::is_dicom_file(file) ? sim::read_dicom_geometry(file) : sim::read_geometry(file)).geometry;
}

/// What is served.
struct Workbench {
  std::unique_ptr<viewer::BreathingBench> bench;
  fs::path geometry;                                  // the file that says how the patient is seen
  std::optional<viewer::BenchRecording> recording{};  // nothing: the radiographs are of no case
  std::size_t recorded = 0;                           // pictures of the case in what was asked for
};

Workbench workbench_of(const RespireServeRequest& request, const Home& home) {
  StepLine line;
  std::optional<FoundFluoroscopy> found;
  if (request.named) found = find_case_fluoroscopy(home, fluoroscopy_of(request));
  Workbench made;
  made.geometry = request.geometry ? fs::path(*request.geometry) : geometry_beside(home, found->stream);
  line.show("reading " + request.model);
  viewer::BenchInputs inputs{.file = request.model,
                             .model = sim::read_breathing_model(request.model),
                             .named = {},
                             .volume = {},
                             .geometry = geometry_from(made.geometry),
                             .radiographs = {}};
  inputs.named = viewer::files_named_by(inputs.model, inputs.file);
  static_cast<void>(inputs.model.needed_tumour());  // before what takes long
  if (request.start) inputs.start_s = parse_number(*request.start, "--start");
  // Nobody's pictures are opened before what they are opened for is known to be there.
  if (found) {
    line.show("opening the pictures of " + found->stream);
    CaseFluoroscopy read = read_case_fluoroscopy(home, *found, fluoroscopy_of(request));
    made.recording = inputs.recording = std::move(read.recording);
    made.recorded = read.pictures;
    inputs.radiographs = std::move(read.radiographs);
  }
  if (request.radiographs) {
    line.show("reading " + *request.radiographs);
    const auto series = open_radiographs(*request.radiographs, request.polarity, rate_of(request));
    std::size_t bytes = 0;
    while (std::optional<TimedRadiograph> next = series->next()) {
      bytes += next->image.values.size() * sizeof(float);
      viewer::BreathingBench::require_memory_for(bytes);  // before the machine runs out of it
      inputs.radiographs.push_back({next->time_s, std::move(next->image), std::move(next->name)});
    }
    if (inputs.radiographs.empty()) throw Error("'" + *request.radiographs + "' holds no picture");
  }
  line.show("reading " + request.volume);
  sim::VolumeFile file = sim::read_volume(request.volume, {request.series.value_or(""), request.resample});
  inputs.model.warnings.insert(inputs.model.warnings.end(), file.findings.begin(), file.findings.end());
  inputs.volume = std::move(file.volume);
  const PatientIds of_ct = patients_of_ct(request.volume, request.series.value_or(""));
  const auto warn = [&](const std::string& what, const PatientIds& of_what) {
    if (auto warning = patient_warning(of_ct, what, of_what))
      inputs.model.warnings.push_back(std::move(*warning));
  };
  if (request.radiographs) warn("the radiographs", patients_of_radiographs(*request.radiographs));
  // Read for this alone: beside a CT without a number a case gives nothing of its patient away.
  if (found && !of_ct.empty()) {
    warn("the case",
         patients_of_case(found->recording, load_identities(fluoroscopy_of(request).identities, home)));
  }
  made.bench = std::make_unique<viewer::BreathingBench>(std::move(inputs),
                                                        [&](const std::string& step) { line.show(step); });
  return made;
}

viewer::ModelSealer sealer_of(const Home& home) {
  return [&home, one = std::make_shared<std::mutex>()](const fs::path& model) {
    const std::lock_guard guard(*one);  // authorities are asked by one thread at a time
    const WritableHome writable(home);
    const SealedPlan made =
        seal_plan_file(home, model, sim::read_breathing_model(model).name, {}, writable.trust,
                       [&](const crypto::Sha256Digest& digest) { writable.log->plan_sealed(digest); });
    viewer::SealedModel told{made.file.filename().string(), crypto::to_hex(made.digest), {}};
    for (const Stamp& stamp : made.stamps) {
      viewer::SealedModel::Stamp& its = told.stamps.emplace_back();
      its.authority = stamp.authority;
      its.problem = stamp.problem;
      if (!stamp.gen_time) continue;
      its.time = format_utc(*stamp.gen_time);
      its.kind = timestamp::authority_kind_name(stamp.clock);
    }
    return told;
  };
}

constexpr const char* kNotVerified =
    "\nIts segments have the hashes that the ledger states; whether the case holds was not verified: 'kiroku "
    "verify' "
    "does that.";

std::string of_case_text(const Workbench& of) {
  return " (of " + counted(of.recorded, "picture", "pictures") + " of " + of.recording->stream + " in case " +
         of.recording->case_id + "), seen as " + of.geometry.string() + " says";
}

int run(const RespireServeRequest& request) {
  constexpr std::size_t kMostAtOnce = 64;
  check(request);
  const Home home = Home::open(request.serving.home);
  const std::size_t at_once = request.at_once ? parse_count(*request.at_once, "--at-once", 1, kMostAtOnce)
                                              : std::max(1U, std::thread::hardware_concurrency() / 2);
  const Workbench made = workbench_of(request, home);
  const viewer::BreathingBench& bench = *made.bench;
  const auto tell = tell_on_standard_error();
  viewer::BreathingRoom room(bench, at_once, tell, sealer_of(home));
  const std::size_t count = bench.radiographs().size();
  serve_until_stopped(request.serving, home,
                      {.serves = "breathing",
                       .identities = nullptr,
                       .more_routes =
                           [&room](viewer::Router& router, viewer::ViewerContext& context) {
                             viewer::add_breathing_routes(router, room, context);
                           },
                       .tell = tell,
                       .first_line =
                           [&](const std::string& url) {
                             return "The lung of " + request.model + (url.empty() ? "" : " at " + url) +
                                    (count == 0 ? ", without radiographs"
                                                : ", with " + counted(count, "radiograph", "radiographs")) +
                                    (made.recording ? of_case_text(made) : "") + ", " +
                                    counted(at_once, "person", "persons") + " at a time" +
                                    (made.recording ? std::string(kNotVerified) : "");
                           },
                       .tell_more =
                           [&](nlohmann::ordered_json& told) {
                             told["model"] = request.model;
                             told["geometry"] = made.geometry.string();
                             told["radiographs"] = count;
                             told["recording"] = nullptr;
                             if (made.recording) {
                               told["recording"] = {{"case", made.recording->case_id},
                                                    {"stream", made.recording->stream},
                                                    {"first_s", made.recording->first_s},
                                                    {"pictures", made.recorded},
                                                    {"verified", false}};
                             }
                             told["at_once"] = at_once;
                             told["warnings"] = bench.model().warnings;
                           }});
  return kDone;
}

}  // namespace

void add_respire_command(Command& program) {
  Command& respire = program.add_command("respire", "works by hand on a lung that breathes");
  Command& command =
      respire.add_command("serve", "serves a page to fit a lung's motion on: sliders, beside radiographs");
  const auto request = std::make_shared<RespireServeRequest>();
  command.argument("VOLUME", request->volume, "the CT: a DICOM folder, .nii, .nrrd or .mha");
  command.argument("BREATHING", request->model, "the breathing lung (.json), as for sim respire");
  command.option("-g,--geometry", "FILE", request->geometry,
                 "source and detector (.json), or an RT Image (.dcm)",
                 "with --case: STREAM.geometry.json in the home");
  command.option("--radiographs", "PATH", request->radiographs,
                 "a folder of DICOM, .png or .mha files, a DICOM file of several pictures, or a film");
  command.option("--case", "CASE", request->named,
                 "the fluoroscopy of this case instead: its folder, or its identifier in the home's archive");
  command.option("--stream", "STREAM", request->stream, "of the case",
                 "the only one whose purpose is fluoroscopy");
  command.option("--from", "T", request->from, "of the case: " + kTimeHelp, "the start");
  command.option("--to", "T", request->to, "likewise", "the end");
  command.option("-i,--identity", "FILE", request->identities,
                 "a recipient's identity; in a --demo home its own");
  command.choice("--polarity", {"bone-white", "bone-black"}, request->polarity, "of the radiographs",
                 "a DICOM file's own, else bone-white; of a case bone-black");
  command.option("--rate", "N", request->rate, "pictures a second; of a case as many are taken at most",
                 "their own; 10 of a folder, 5 of a case");
  command.option("--start", "S", request->start, "the waveform's moment at the first picture", "0");
  command.option("--series", "UID", request->series, "of a DICOM folder of several series: the one to read");
  command.flag("--resample", request->resample, "reads a CT whose slices are not evenly spaced, resampled");
  command.option("--at-once", "N", request->at_once, "people who work at a time",
                 "half as many as there are cores");
  add_serving_options(command, request->serving);
  command.explain(
      "Surgeons and administrators sign in to the viewer of the home ('kiroku view', or kirokud), choose "
      "Breathing there, and move amplitudes, phases, directions, baselines and the breath's length while "
      "they "
      "see the computed radiograph of the moving lung beside, over, wiped against or subtracted from the "
      "real "
      "one of the same moment. What is saved is a new model for 'kiroku sim respire', beside the one that "
      "was "
      "opened; no file is overwritten.");
  command.explain(
      "The radiographs must be of the geometry's size, and the patient must lie as the CT has them: 'kiroku "
      "sim "
      "fit-series --aligned-geometry' finds how they lay.");
  command.example("kiroku respire serve ct/ lung.json -g front.json --radiographs fluoroscopy.dcm",
                  "behind the home's viewer");
  command.example(
      "kiroku respire serve ct/ lung.json --case 20260805T091502Z-3f9c21ab --from 10:00 --to 10:30",
      "half a minute of a case's fluoroscopy; its pane in the viewer leads there");
  command.example("kiroku respire serve ct/ lung.json -g front.json --listen 127.0.0.1:8447",
                  "with an address of its own, without radiographs");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
