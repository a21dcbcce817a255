#include "apps/sim/comparison_making.h"

#include <filesystem>

#include "apps/common/file.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/standing_consents.h"
#include "apps/sim/breathing_comparing.h"
#include "apps/sim/compared_ct.h"
#include "apps/sim/comparison_films.h"
#include "apps/sim/comparison_outputs.h"
#include "apps/sim/comparison_progress.h"
#include "apps/sim/comparison_sealing.h"
#include "apps/sim/comparison_telling.h"
#include "apps/sim/keeping.h"
#include "apps/sim/number_option.h"
#include "apps/sim/plan_at_hand.h"
#include "base/error.h"
#include "viewer/compare/comparison_document.h"
#include "viewer/compare/paired_pictures.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

MadeComparison write_document(const ComparisonRequest& request, const std::optional<Home>& home,
                              const archive::CaseReader& recording, const compare::Comparison& comparison,
                              const PlanAtHand& at_hand, const compare::Provenance& made, Keeping* keeping) {
  const std::string text = compare::comparison_json(comparison, at_hand.plan, made);
  if (keeping == nullptr) return write_sealed(request, home, recording, text);
  MadeComparison result;
  result.digest = crypto::sha256(bytes_of(text));
  result.document = keeping->place().document();
  keeping->keep_document(text);
  if (at_hand.sealed) keeping->keep_tokens_of(at_hand.seal_file);
  result.in_log = home && home->holds(recording.folder());
  if (result.in_log) {
    result.stamps =
        seal_document(request, *home, recording.opening().case_id, result.document, result.digest);
  }
  return result;
}

/// What a comparison is made of, each computed when it is first needed.
struct Sources {
  const archive::CaseReader& recording;
  const crypto::AgeIdentities& identities;
  const PlanAtHand& at_hand;
  SimulatedPlan& frames;
  PlanCt& ct;
  std::optional<compare::UsedLens> lens = {};                // where one was given
  std::optional<compare::PlanRadiographs> radiographs = {};  // where fluoroscopy was asked for
};

/// The plan's radiographs beside the case's fluoroscopy.
void add_fluoroscopy(const ComparisonRequest& request, Sources& from, compare::Comparison& comparison,
                     ComparisonTold& told) {
  if (!request.geometry) return;
  const compare::FluoroscopyRequest asked = fluoroscopy_request(request, from.recording, comparison);
  from.radiographs.emplace(from.at_hand.plan, from.ct.get());
  const sim::PlanFrames& frames = from.frames.get();
  told.begin("comparing with the fluoroscopy");
  comparison.fluoroscopy =
      compare::compare_fluoroscopy(from.recording, from.identities, *comparison.map, frames,
                                   *from.radiographs, asked, [&](double share) { told.update(share); });
  told.clear();
}

/// The plan's organ on the recorded pictures.
void add_alignment(const ComparisonRequest& request, const Sources& from, compare::Comparison& comparison,
                   ComparisonTold& told) {
  if (request.align != "auto") return;
  compare::AlignmentRequest asked = alignment_request(request, from.lens, from.recording, comparison);
  std::optional<compare::PlannedShapes> planned;
  if (asked.deformed) asked.planned = &planned.emplace(comparison.map, from.frames.get());
  told.begin("looking for the organ in the pictures");
  comparison.alignment =
      compare::align_organ(from.recording, from.identities, comparison.stream, from.at_hand.plan.body, asked,
                           [&](double share) { told.update(share); });
  told.clear();
}

/// Of the fluoroscopy where that was asked for, else of the pictures.
std::uint64_t write_paired_film(const ComparisonRequest& request, Sources& from,
                                const compare::Comparison& comparison, const compare::Provenance& made,
                                ComparisonTold& told) {
  const archive::Span span = shown_span(request, from.recording, comparison);
  const sim::PlanFrames& frames = from.frames.get();
  if (comparison.fluoroscopy) {
    const double share = request.share ? parse_number(*request.share, "--share", 0, 1) : 0.5;
    compare::PairedRadiographs paired(from.recording, from.identities, comparison, *comparison.fluoroscopy,
                                      frames, *from.radiographs, radiograph_form(request), share,
                                      span.start_ns, span.end_ns, compare::cautions_of(made));
    return write_film(
        request, span, paired.width(), paired.height(),
        [&](std::int64_t case_ns) { return paired.at(case_ns); }, told);
  }
  PlanView plan(request, from.recording, from.identities, comparison, from.at_hand.plan, from.ct,
                span.start_ns);
  compare::PairedPictures paired(from.recording, from.identities, comparison, frames, plan.pictures(),
                                 plan.form(request, made), span.start_ns, span.end_ns);
  return write_film(
      request, span, paired.width(), paired.height(),
      [&](std::int64_t case_ns) { return paired.at(case_ns); }, told);
}

std::vector<compare::StillPicture> paired_stills(const ComparisonRequest& request, Sources& from,
                                                 const compare::Comparison& comparison,
                                                 const compare::Provenance& made, ComparisonTold& told) {
  const archive::Span whole{comparison.case_begins_ns, comparison.recording_end_ns};
  const sim::PlanFrames& frames = from.frames.get();
  PlanView plan(request, from.recording, from.identities, comparison, from.at_hand.plan, from.ct,
                whole.start_ns);
  compare::PairedPictures paired(from.recording, from.identities, comparison, frames, plan.pictures(),
                                 plan.form(request, made), whole.start_ns, whole.end_ns);
  return stills(comparison, paired, told);
}

/// Film or page beside the document; how many pictures it has.
std::uint64_t write_pictures(const ComparisonRequest& request, ComparisonOutput form, Sources& from,
                             const compare::Comparison& comparison, compare::Provenance& made,
                             ComparisonTold& told) {
  std::uint64_t count = 0;
  std::vector<compare::StillPicture> pictures;
  if (!comparison.map && form == ComparisonOutput::kFilm)
    throw Error(
        "no step of the plan was found in the recording, so there is nothing to show in step: mark steps by "
        "their names while recording, or match them by hand (--by-hand)");
  if (comparison.map && form == ComparisonOutput::kFilm) {
    count = write_paired_film(request, from, comparison, made, told);
  } else if (comparison.map) {
    pictures = paired_stills(request, from, comparison, made, told);
    count = pictures.size();
  }
  told.clear();
  if (form == ComparisonOutput::kPage) {
    write_output(*request.output,
                 bytes_of(compare::comparison_html(comparison, from.at_hand.plan, made, pictures)),
                 request.force);
  }
  const fs::path output = *request.output;
  made.outputs.push_back(
      named(hashed(form == ComparisonOutput::kFilm ? "film" : "page", output.filename().string(), output)));
  return count;
}

/// The plan's films for the viewer, seen as the endoscope was where that is known, and as the fluoroscope
/// was; how many pictures the first has, 0 where no CT could be shown.
std::uint64_t keep_plan_films(const ComparisonRequest& request, Keeping& keeping, Sources& from,
                              const compare::Comparison& comparison, compare::Provenance& made,
                              ComparisonTold& told) {
  if (!from.ct.is_named()) return 0;
  const sim::PlanFrames& frames = from.frames.get();
  const sim::Plan& plan = from.at_hand.plan;
  PlanView view(request, from.recording, from.identities, comparison, plan, from.ct,
                comparison.case_begins_ns);
  if (comparison.camera) view.pictures().set_camera(comparison.camera->registration().camera);
  const std::uint64_t count =
      write_plan_film(keeping.film_file("replay"), plan, frames, view.pictures(), told);
  made.outputs.push_back(keeping.keep_film("replay"));
  if (comparison.fluoroscopy) {
    write_radiograph_film(keeping.film_file("radiographs"), plan, frames, *from.radiographs,
                          *comparison.fluoroscopy, told);
    made.outputs.push_back(keeping.keep_film("radiographs"));
  }
  told.clear();
  return count;
}

compare::ByHand by_hand_of(const ComparisonRequest& request, const archive::CaseReader& recording,
                           const sim::Plan& plan) {
  if (!request.by_hand) return {};
  const std::string what = "what was matched by hand";
  const bool piped = *request.by_hand == "-";
  const Bytes text = read_small_file(piped ? "/dev/stdin" : *request.by_hand, what);
  return compare::read_by_hand(text_of(text), piped ? what : *request.by_hand, recording, plan);
}

void require_alignment_options(const ComparisonRequest& request) {
  if (request.field && request.align != "auto")
    throw UsageError("--field is for --align auto: it says what the endoscope's pictures cover");
  if (request.lens && request.align != "auto")
    throw UsageError("--lens is for --align auto: it says how the endoscope shows its pictures");
  if (request.organ && request.align != "auto")
    throw UsageError("--organ is for --align auto: it says how the plan's organ is laid on the pictures");
  if (request.colours && !is_deformed(request))
    throw UsageError("--colours is for --organ deformed: it says what its colours count from");
  if (request.align != "auto") return;
  if (request.field && request.lens) {
    throw UsageError(
        "--field and --lens both say what the endoscope's pictures cover: leave --field out, the lens has "
        "it");
  }
  if (!request.field && !request.lens) {
    throw UsageError(
        "--align needs the endoscope's field of view: say with --field how many degrees the lesser side of "
        "its pictures covers, or give its calibration with --lens");
  }
  if (request.field) (void)alignment_field_deg(request);
}

/// Before anything is computed, as far as the case and what was matched by hand say it.
void require_alignment_sense(const ComparisonRequest& request, const archive::CaseReader& recording,
                             const compare::ByHand& by_hand) {
  if (request.align != "auto") return;
  if (by_hand.registration) {
    throw UsageError(
        "--align auto and the registration in --by-hand both say where the organ is: leave one of them out");
  }
  if (request.from && request.to)
    compare::require_alignable(recording.parse_stretch(request.from, request.to), is_deformed(request));
}

void require_fluoroscopy_options(const ComparisonRequest& request) {
  if (request.geometry) return;
  const bool needs_it =
      request.form == "difference" || request.form == "checkerboard" || request.form == "contour";
  if (needs_it || request.fluoroscopy || request.align_at || request.polarity)
    throw UsageError(
        "--fluoroscopy, --align-at, --polarity and --show difference, checkerboard and contour are of "
        "radiographs: say with --geometry how the fluoroscope sees the patient");
}

}  // namespace

int make_comparison(const ComparisonRequest& request) {
  if (!request.named || !request.plan)
    throw UsageError("name the case and the plan: kiroku compare CASE PLAN -o OUT.html");
  if (is_breathing(*request.plan)) return make_breathing_comparison(request);
  require_fluoroscopy_options(request);
  require_alignment_options(request);
  const std::optional<compare::UsedLens> lens = alignment_lens(request);
  const std::optional<Home> home = Home::find(request.home);
  const archive::CaseReader recording = archive::CaseReader::open(find_case(home, *request.named));
  const std::string stream = compare::pictures_of(recording, request.stream);
  const ComparisonOutput form = request.output ? output_form(*request.output) : ComparisonOutput::kKept;
  // In the clear, with pictures, or with marks and vital signs; what is kept for the viewer is sealed.
  const bool material_leaves = !request.steps && (request.output || request.write_by_hand);
  if (request.purpose && !material_leaves)
    throw UsageError(
        "--purpose is for what is written in the clear: -o OUT.mp4, OUT.html or OUT.json, --write-by-hand");
  if (request.output) require_free(request, document_of(*request.output));
  std::optional<Keeping> keeping;
  if (!request.output && !request.write_by_hand && !request.steps) {
    if (!home)
      throw UsageError("there is no home to keep it in: say where to: -o OUT.mp4, OUT.html or OUT.json");
    keeping.emplace(*home, recording, stream, *request.plan, request.name, request.force);
  }
  auto at_hand = read_plan_at_hand(*request.plan, request.json);
  if (!at_hand) return kRefused;
  const compare::ByHand by_hand = by_hand_of(request, recording, at_hand->plan);
  require_alignment_sense(request, recording, by_hand);
  std::optional<compare::ComparedCt> compared = compared_ct(request, *at_hand);
  const crypto::AgeIdentities identities = identities_of(request, home);
  const bool is_entered =
      material_leaves &&
      enter_purpose(home, recording.folder(), request.purpose,
                    request.output ? "wrote a comparison with a plan" : "wrote the steps that were found");
  if (!is_entered) log_access(home, recording.folder(), "opened to compare it with a plan");
  ComparisonTold told(request.progress == "json");
  SimulatedPlan frames(at_hand->plan, told);
  PlanCt ct(request, at_hand->plan, told);
  Sources from{recording, identities, *at_hand, frames, ct, lens};
  compare::Comparison comparison = compare::compare(
      recording, identities, stream, at_hand->plan, by_hand,
      [&]() -> const sim::PlanFrames& { return frames.get(); }, told.progress());
  told.clear();
  if (request.steps) {
    tell_steps(comparison, *at_hand, recording.opening().plan, request.json);
    return kDone;
  }
  if (request.write_by_hand) {
    write_output(
        *request.write_by_hand,
        bytes_of(compare::by_hand_text(comparison.matching, comparison.steps, comparison.case_begins_ns)),
        request.force);
    if (!request.output) {
      tell_steps(comparison, *at_hand, recording.opening().plan, false);
      return kDone;
    }
  }
  const PatientNumbers numbers = patient_numbers(request, at_hand->plan.volume, recording, identities);
  compare::Provenance made = provenance_of(request, recording, *at_hand, std::move(compared), numbers);
  add_alignment(request, from, comparison, told);
  add_fluoroscopy(request, from, comparison, told);
  std::uint64_t count = 0;
  if (keeping) {
    count = keep_plan_films(request, *keeping, from, comparison, made, told);
  } else if (form != ComparisonOutput::kDocument) {
    count = write_pictures(request, form, from, comparison, made, told);
  }
  Keeping* const kept = keeping ? &*keeping : nullptr;
  const MadeComparison written = write_document(request, home, recording, comparison, *at_hand, made, kept);
  return tell_comparison(request, comparison, *at_hand, made, numbers, written, count, kept);
}

}  // namespace kiroku::apps
