// 'kiroku compare': a plan beside the recording of the operation.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <set>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/common/step_line.h"
#include "apps/common/version.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kiroku/stamped_file.h"
#include "apps/kiroku/user_name.h"
#include "apps/sim/keeping.h"
#include "apps/sim/picture_options.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/plan_reading.h"
#include "apps/sim/sealed_files.h"
#include "archive/file_stamps.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "media/film_writer.h"
#include "sim/fem/number_text.h"
#include "sim/volume/volume_reader.h"
#include "viewer/compare/comparison_document.h"
#include "viewer/compare/paired_pictures.h"
#include "viewer/kept/log_of_case.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::int64_t kNsPerSecond = 1'000'000'000;

struct Request {
  std::optional<std::string> named, plan, output, home, stream, by_hand, write_by_hand, made_by, from, to,
      speed, form, share, width, volume, series, transfer, view, zoom, gpu, verified, name;
  std::vector<std::string> identities, authorities, trust;
  bool force = false, json = false;
};

/// kKept: no file of the caller's, but kept in the home for the viewer.
enum class Output { kDocument, kPage, kFilm, kKept };

Output output_form(const fs::path& output) {
  const fs::path ending = output.extension();
  if (ending == ".json") return Output::kDocument;
  if (ending == ".html") return Output::kPage;
  if (ending == ".mp4") return Output::kFilm;
  throw UsageError(
      "the output " + output.string() +
      " must end in .mp4 (a film), .html (a page with figures and pictures) or .json (the figures)");
}

/// The plan, its files as they are now, and whether a seal beside it fits them.
struct PlanAtHand {
  sim::Plan plan;
  PlanSeal files;
  crypto::Sha256Digest seal{};
  bool sealed = false;
  fs::path seal_file;
};

/// A sealed plan must be what was sealed: comparing with something else would say nothing.
fs::path plan_of_seal(const fs::path& seal_file) {
  const PlanSeal seal =
      parse_plan_seal(text_of(read_small_file(seal_file, "the sealed plan")), seal_file.string());
  const fs::path folder = seal_file.parent_path();
  for (const Check& check : check_sealed_files(seal.files, folder)) {
    if (check.answer != Check::Answer::kHolds)
      throw Error("the plan is not the one that was sealed: " + check.text + "; see kiroku plan verify " +
                  seal_file.string());
  }
  return folder / seal.files.front().name;
}

std::optional<PlanAtHand> read_plan_at_hand(const Request& request) {
  fs::path file = *request.plan;
  if (file.string().ends_with(".seal.json")) file = plan_of_seal(file);
  auto plan = read_plan_and_tell(file.string(), request.json);
  if (!plan) return {};
  PlanAtHand at_hand{std::move(*plan), {}, {}, false, {}};
  at_hand.files = seal_of_plan(file, at_hand.plan.name);
  at_hand.seal = crypto::sha256(bytes_of(plan_seal_text(at_hand.files)));
  fs::path seal = file;
  std::error_code ignored;
  if (fs::exists(seal.replace_extension(".seal.json"), ignored))
    at_hand.sealed = crypto::sha256(read_small_file(seal, "the sealed plan")) == at_hand.seal;
  at_hand.seal_file = std::move(seal);
  return at_hand;
}

/// The line on a terminal for steps of unknown length, then for those with a share.
class Told {
 public:
  compare::ComparisonProgress progress() {
    return {[this](const std::string& step) { begin(step); }, [this](double share) { update(share); }};
  }
  void begin(const std::string& step) {
    shares_.reset();
    steps_.emplace();
    steps_->show(step);
    doing_ = step;
  }
  void update(double share) {
    if (!shares_) {
      steps_.reset();
      shares_.emplace(doing_);
    }
    constexpr double kParts = 1000;
    shares_->update(static_cast<std::uint64_t>(share * kParts), static_cast<std::uint64_t>(kParts));
  }
  void clear() {
    shares_.reset();
    steps_.reset();
  }

 private:
  std::optional<StepLine> steps_;
  std::optional<Progress> shares_;
  std::string doing_;
};

/// Simulated once, when it is first needed.
class Frames {
 public:
  Frames(const sim::Plan& plan, Told& told) : plan_(plan), told_(told) {}
  const sim::PlanFrames& get() {
    if (!frames_) {
      told_.begin("carrying out the plan");
      const double all_s = std::max(1e-9, duration_s(plan_));
      frames_.emplace(plan_, [&](double time_s) { told_.update(time_s / all_s); });
    }
    return *frames_;
  }

 private:
  const sim::Plan& plan_;
  Told& told_;
  std::optional<sim::PlanFrames> frames_;
};

compare::CompositionForm form_of(const Request& request, const compare::PictureSize& size) {
  compare::CompositionForm form;
  const std::string arrangement = request.form.value_or("beside");
  form.arrangement = arrangement == "overlay" ? compare::Arrangement::kOverlay
                     : arrangement == "wipe"  ? compare::Arrangement::kWipe
                                              : compare::Arrangement::kSideBySide;
  if (request.share) form.share = parse_number(*request.share, "--share", 0, 1);
  form.width = size.width;
  form.height = size.height;
  return form;
}

/// The plan in pictures as large as the recording's.
class PlanView {
 public:
  PlanView(const Request& request, const archive::CaseReader& recording,
           const crypto::AgeIdentities& identities, const compare::Comparison& comparison,
           const PlanAtHand& at_hand, std::int64_t from_ns) {
    PictureOptions options;
    options.transfer = request.transfer;
    options.view = request.view;
    options.zoom = request.zoom;
    options.gpu = request.gpu;
    constexpr int kWidest = 640;
    const int widest =
        request.width ? static_cast<int>(parse_number(*request.width, "--width", 64, 4096)) : kWidest;
    size_ = compare::picture_size(recording, identities, comparison.stream, from_ns, widest);
    options.size = std::to_string(size_.width) + "x" + std::to_string(size_.height);
    const fs::path ct = request.volume ? fs::path(*request.volume) : at_hand.plan.volume;
    if (ct.empty()) {
      throw UsageError(
          "the plan names no CT that could be shown: name one with --volume, or ask for figures alone "
          "(-o OUT.json)");
    }
    const sim::Volume volume = sim::read_volume(ct, {request.series.value_or(""), false}).volume;
    const sim::Scene scene = options.scene(sim::view_of_plan(at_hand.plan));
    background_ = scene.background;
    pictures_.emplace(at_hand.plan,
                      std::make_shared<const sim::ShadedVolume>(
                          sim::shade(volume, sim::extent_of(at_hand.plan.body.mesh), options.shading())),
                      options.transfer_function("liver"), options.gpu_use(), scene);
  }
  sim::PlanPictures& pictures() { return *pictures_; }
  [[nodiscard]] compare::CompositionForm form(const Request& request) const {
    compare::CompositionForm form = form_of(request, size_);
    form.plan_background = background_;
    return form;
  }
  [[nodiscard]] const compare::PictureSize& size() const { return size_; }

 private:
  compare::PictureSize size_;
  sim::Rgb background_;
  std::optional<sim::PlanPictures> pictures_;
};

/// From a second before the first step to a second after the last, as far as something was recorded.
archive::Span shown_span(const Request& request, const archive::CaseReader& recording,
                         const compare::Comparison& comparison) {
  const auto& pieces = comparison.map->pieces();
  archive::Span span{
      std::max(comparison.case_begins_ns, pieces.front().knots.front().case_ns - kNsPerSecond),
      std::min(comparison.recording_end_ns, pieces.back().knots.back().case_ns + kNsPerSecond)};
  if (request.from) span.start_ns = recording.parse_time(*request.from);
  if (request.to) span.end_ns = recording.parse_time(*request.to);
  if (span.end_ns <= span.start_ns) throw UsageError("there is no time from --from to --to");
  return span;
}

std::uint64_t write_film(const Request& request, const archive::Span& span, compare::PairedPictures& pictures,
                         Told& told) {
  constexpr int kRate = 25;
  const double speed = request.speed ? parse_number(*request.speed, "--speed", 0.05, 1000) : 1;
  const double step_ns = speed * double(kNsPerSecond) / kRate;
  media::FilmWriter film(*request.output, {pictures.width(), pictures.height(), 3, kRate, 1}, request.force);
  told.begin("making the film");
  const double all_ns = double(span.end_ns - span.start_ns);
  for (std::int64_t number = 0;; ++number) {
    const double since_ns = double(number) * step_ns;
    if (since_ns >= all_ns) break;
    const sim::Picture picture = pictures.at(span.start_ns + std::llround(since_ns));
    film.add(view_of(picture));
    told.update(since_ns / all_ns);
  }
  film.finish();
  return film.frames();
}

/// The plan by itself, a picture each time step, as fast as it was planned.
std::uint64_t write_plan_film(const fs::path& file, const sim::Plan& plan, const sim::PlanFrames& frames,
                              sim::PlanPictures& pictures, Told& told) {
  constexpr int kMillisecondsPerSecond = 1000;
  const int step_ms = static_cast<int>(std::lround(plan.time_step_s * kMillisecondsPerSecond));
  media::FilmFormat format{pictures.scene().width, pictures.scene().height, 3, kMillisecondsPerSecond,
                           step_ms};
  format.key_interval = std::max(1, kMillisecondsPerSecond / step_ms / 2);
  media::FilmWriter film(file, format);
  told.begin("making the plan's film");
  const auto count = std::llround(duration_s(plan) / plan.time_step_s) + 1;
  for (long long number = 0; number < count; ++number) {
    constexpr double kSameMomentS = 1e-9;
    const double at_s = double(number) * plan.time_step_s + kSameMomentS;
    const auto after = std::ranges::upper_bound(
        frames.all(), at_s, {}, [](const sim::PlanFrames::Kept& kept) { return kept.frame.time_s; });
    const sim::PlanFrames::Kept& kept = *std::prev(after);  // the first is of time 0
    film.add(view_of(pictures.picture(kept.frame, *kept.mesh)));
    told.update(double(number) / double(count));
  }
  film.finish();
  return film.frames();
}

/// The middle of each step that was found.
std::vector<compare::StillPicture> stills(const compare::Comparison& comparison,
                                          compare::PairedPictures& pictures, Told& told) {
  told.begin("making pictures");
  std::vector<compare::StillPicture> all;
  for (const compare::StepMatch& match : comparison.matching.matches) {
    const std::int64_t at_ns = (match.span.start_ns + match.span.end_ns) / 2;
    const sim::Picture picture = pictures.at(at_ns);
    const compare::Caption caption = pictures.caption_at(at_ns);
    all.push_back({std::to_string(match.step + 1) + ". " + comparison.steps[match.step].name + ": " +
                       caption.plan + ", " + caption.recording,
                   media::png_of(view_of(picture))});
  }
  return all;
}

compare::NamedFile named(const SealedFile& file) { return {file.role, file.name, file.bytes, file.sha256}; }

void write_output(const fs::path& file, ByteView bytes, bool force) {
  if (fs::exists(file) && !force)
    throw UsageError(file.string() + " is already there; choose another name, or overwrite it with --force");
  write_durably(file, bytes);
}

/// liver.html has its document in liver.comparison.json: a plan is often called liver.json.
fs::path document_of(const fs::path& output) {
  fs::path document = output;
  if (output_form(output) != Output::kDocument) document.replace_extension(".comparison.json");
  return document;
}

/// Only comparisons are replaced by comparisons.
void require_comparison(const fs::path& file) {
  if (fs::exists(file))
    (void)compare::read_provenance(text_of(read_small_file(file, "the comparison")), file.string());
}

/// A seal that holds is not written over by accident.
void require_free(const Request& request, const fs::path& document) {
  for (const fs::path& file : {fs::path(*request.output), document}) {
    if (fs::exists(file) && !request.force)
      throw UsageError(file.string() +
                       " is already there; choose another name, or overwrite it with --force");
  }
  require_comparison(document);
}

/// Tokens of an earlier document of that name would say that this one differs.
void remove_tokens(const fs::path& document) {
  for (const fs::path& token : archive::tokens_beside(document)) fs::remove(token);
}

/// Hash into the log, tokens beside the document.
std::vector<Stamp> seal_document(const Request& request, const Home& home, const std::string& case_id,
                                 const fs::path& document, const crypto::Sha256Digest& digest) {
  const Authorities authorities(home, home.configuration(), request.authorities);
  const WritableHome writable(home);
  writable.log->access(case_id, compare::comparison_deed(digest), user_name());
  std::vector<Stamp> stamps;
  for (const recorder::NamedAuthority& authority : authorities.named()) {
    stamps.push_back(stamp_file(authority, document, digest, writable.trust));
  }
  return stamps;
}

void print_comparison(const compare::Comparison& comparison, const PlanAtHand& at_hand) {
  std::vector<std::vector<std::string>> rows{{"step", "done as", "began at", "lasted", "planned for"}};
  for (const compare::StepFigures& figures : comparison.figures) {
    const compare::PlannedStep& planned = comparison.steps[figures.step];
    const std::string name = std::to_string(figures.step + 1) + ". " + printable(planned.name);
    const std::string lasts = sim::number_text(planned.duration_s, 4) + " s";
    if (const compare::StepMatch* const match = comparison.matching.match_of(figures.step)) {
      rows.push_back(
          {name, std::to_string(*figures.done_as + 1) + ".",
           compare::case_time_text(match->span.start_ns, comparison.case_begins_ns),
           sim::number_text(double(match->span.end_ns - match->span.start_ns) / double(kNsPerSecond), 4) +
               " s",
           lasts});
    } else {
      rows.push_back({name, "not found", "", "", lasts});
    }
  }
  std::cout << format_table(rows, "lrrrr", 2);
  for (const compare::ToolDistance& tool : comparison.tools) {
    std::cout << "  " << printable(at_hand.plan.tools[tool.tool].tool.name) << ": "
              << sim::number_text(tool.all.mean_px, 3) << " pixels from its planned way on average, "
              << sim::number_text(tool.all.largest_px, 3) << " at most, in " << tool.all.pictures
              << " pictures\n";
  }
}

struct Made {
  fs::path document;
  crypto::Sha256Digest digest{};
  std::vector<Stamp> stamps;
  bool in_log = false;
};

Made write_document(const Request& request, const std::optional<Home>& home,
                    const archive::CaseReader& recording, const compare::Comparison& comparison,
                    const PlanAtHand& at_hand, const compare::Provenance& made, Keeping* keeping) {
  Made result;
  const std::string text = compare::comparison_json(comparison, at_hand.plan, made);
  result.digest = crypto::sha256(bytes_of(text));
  if (keeping != nullptr) {
    result.document = keeping->place().document();
    keeping->keep_document(text);
    if (at_hand.sealed) keeping->keep_tokens_of(at_hand.seal_file);
  } else {
    result.document = document_of(*request.output);
    remove_tokens(result.document);
    write_output(result.document, bytes_of(text), request.force);
  }
  result.in_log = home && home->holds(recording.folder());
  if (result.in_log) {
    result.stamps =
        seal_document(request, *home, recording.opening().case_id, result.document, result.digest);
  }
  return result;
}

int tell(const Request& request, const compare::Comparison& comparison, const PlanAtHand& at_hand,
         const Made& made, std::uint64_t pictures, const Keeping* keeping) {
  const std::string document =
      keeping == nullptr ? made.document.string() : keeping->place().sealed_document().string();
  const std::string output = request.output.value_or(document);
  if (request.json) {
    ordered_json object{{"output", output},
                        {"document", document},
                        {"sha256", crypto::to_hex(made.digest)},
                        {"in_log", made.in_log},
                        {"time_stamps", stamps_json(made.stamps)},
                        {"steps_found", comparison.matching.matches.size()},
                        {"steps_planned", comparison.steps.size()},
                        {"in_planned_order", comparison.matching.in_planned_order()},
                        {"pictures", pictures}};
    if (keeping != nullptr) object["name"] = keeping->place().name;
    print_json(object);
  } else {
    warn_of_missing(made.stamps);
    print_comparison(comparison, at_hand);
    std::cout << output << ": " << comparison.matching.matches.size() << " of " << comparison.steps.size()
              << " steps found" << (comparison.matching.in_planned_order() ? "" : ", in another order")
              << "\n  " << document
              << (made.in_log ? " is entered into the appliance log"
                              : " is not sealed: "
                                "the case is not of this home")
              << "\n  hash  " << crypto::to_hex(made.digest) << "\n";
    for (const Stamp& each : made.stamps) {
      if (each.gen_time)
        std::cout << "  time  " << format_utc(*each.gen_time) << " by " << each.authority << "\n";
    }
    if (keeping != nullptr) {
      std::cout << "  next  kiroku view shows it in the case"
                << (pictures == 0 ? ", without the plan's film: the plan names no CT (--volume)" : "")
                << "\n";
    }
  }
  return any_valid(made.stamps) ? kDone : kNoAnswer;
}

/// Film or page beside the document; how many pictures it has.
std::uint64_t write_pictures(const Request& request, Output form, const archive::CaseReader& recording,
                             const crypto::AgeIdentities& identities, const compare::Comparison& comparison,
                             const PlanAtHand& at_hand, Frames& frames, compare::Provenance& made,
                             Told& told) {
  std::uint64_t count = 0;
  std::vector<compare::StillPicture> pictures;
  if (!comparison.map && form == Output::kFilm)
    throw Error(
        "no step of the plan was found in the recording, so there is nothing to show in step: mark steps by "
        "their names while recording, or match them by hand (--by-hand)");
  if (comparison.map) {
    const archive::Span span = shown_span(request, recording, comparison);
    const archive::Span read =
        form == Output::kFilm ? span : archive::Span{comparison.case_begins_ns, comparison.recording_end_ns};
    const sim::PlanFrames& simulated = frames.get();
    told.begin("reading the CT");
    PlanView plan(request, recording, identities, comparison, at_hand, read.start_ns);
    compare::PairedPictures paired(recording, identities, comparison, simulated, plan.pictures(),
                                   plan.form(request), read.start_ns, read.end_ns);
    if (form == Output::kFilm) {
      count = write_film(request, span, paired, told);
    } else {
      pictures = stills(comparison, paired, told);
      count = pictures.size();
    }
  }
  told.clear();
  if (form == Output::kPage) {
    write_output(*request.output,
                 bytes_of(compare::comparison_html(comparison, at_hand.plan, made, pictures)), request.force);
  }
  const fs::path output = *request.output;
  made.outputs.push_back(
      named(hashed(form == Output::kFilm ? "film" : "page", output.filename().string(), output)));
  return count;
}

/// The plan's film for the viewer, seen as the endoscope was where that is known; 0 where no CT could be
/// shown.
std::uint64_t keep_plan_film(const Request& request, Keeping& keeping, const archive::CaseReader& recording,
                             const crypto::AgeIdentities& identities, const compare::Comparison& comparison,
                             const PlanAtHand& at_hand, Frames& frames, compare::Provenance& made,
                             Told& told) {
  if (!request.volume && at_hand.plan.volume.empty()) return 0;
  const sim::PlanFrames& simulated = frames.get();
  told.begin("reading the CT");
  PlanView plan(request, recording, identities, comparison, at_hand, comparison.case_begins_ns);
  if (comparison.camera) plan.pictures().set_camera(comparison.camera->registration().camera);
  const std::uint64_t count =
      write_plan_film(keeping.film_file(), at_hand.plan, simulated, plan.pictures(), told);
  told.clear();
  made.outputs.push_back(keeping.keep_film());
  return count;
}

int make(const Request& request) {
  if (!request.named || !request.plan)
    throw UsageError("name the case and the plan: kiroku compare CASE PLAN -o OUT.html");
  const std::optional<Home> home = Home::find(request.home);
  const archive::CaseReader recording = archive::CaseReader::open(find_case(home, *request.named));
  const std::string stream = compare::pictures_of(recording, request.stream);
  const Output form = request.output ? output_form(*request.output) : Output::kKept;
  if (request.output) require_free(request, document_of(*request.output));
  std::optional<Keeping> keeping;
  if (!request.output && !request.write_by_hand) {
    if (!home)
      throw UsageError("there is no home to keep it in: say where to: -o OUT.mp4, OUT.html or OUT.json");
    keeping.emplace(*home, recording, stream, *request.plan, request.name, request.force);
  }
  auto at_hand = read_plan_at_hand(request);
  if (!at_hand) return kRefused;
  compare::ByHand by_hand;
  if (request.by_hand) {
    by_hand = compare::read_by_hand(text_of(read_small_file(*request.by_hand, "what was matched by hand")),
                                    *request.by_hand, recording, at_hand->plan);
  }
  const crypto::AgeIdentities identities = load_identities(request.identities, home);
  log_access(home, recording.folder(), "opened to compare it with a plan");
  Told told;
  Frames frames(at_hand->plan, told);
  const compare::Comparison comparison = compare::compare(
      recording, identities, stream, at_hand->plan, by_hand,
      [&]() -> const sim::PlanFrames& { return frames.get(); }, told.progress());
  told.clear();
  if (request.write_by_hand) {
    write_output(
        *request.write_by_hand,
        bytes_of(compare::by_hand_text(comparison.matching, comparison.steps, comparison.case_begins_ns)),
        request.force);
    if (!request.output) {
      print_comparison(comparison, *at_hand);
      return kDone;
    }
  }
  compare::Provenance made;
  made.made_by = request.made_by.value_or(user_name());
  made.made_at = std::chrono::floor<std::chrono::microseconds>(std::chrono::system_clock::now());
  made.program = std::string("kiroku ") + kVersion;
  made.case_state = compare::state_of(recording.folder());
  made.plan = at_hand->plan.name;
  made.plan_seal = at_hand->seal;
  made.plan_sealed = at_hand->sealed;
  for (const SealedFile& file : at_hand->files.files) made.plan_files.push_back(named(file));
  if (recording.opening().plan) made.case_names_plan = *recording.opening().plan == at_hand->seal;
  std::uint64_t count = 0;
  if (keeping) {
    count =
        keep_plan_film(request, *keeping, recording, identities, comparison, *at_hand, frames, made, told);
  } else if (form != Output::kDocument) {
    count = write_pictures(request, form, recording, identities, comparison, *at_hand, frames, made, told);
  }
  Keeping* const kept = keeping ? &*keeping : nullptr;
  const Made written = write_document(request, home, recording, comparison, *at_hand, made, kept);
  return tell(request, comparison, *at_hand, written, count, kept);
}

/// Whether the case still begins as it did when it was compared.
Check check_case(const Request& request, const std::optional<Home>& home, const compare::CaseState& stated) {
  using Answer = Check::Answer;
  fs::path folder;
  try {
    folder = find_case(home, request.named.value_or(stated.case_id));
  } catch (const Error&) {
    return {"case", Answer::kUnknown, "the case " + stated.case_id + " is not here: name its folder"};
  }
  try {
    if (archive::CaseReader::open(folder).opening().case_id != stated.case_id)
      return {"case", Answer::kDiffers,
              folder.filename().string() + " is another case than " + stated.case_id};
    const auto root = compare::root_of_first(folder, stated.ledger_size);
    if (!root) return {"case", Answer::kDiffers, "its ledger has lost entries since"};
    if (*root != stated.ledger_root) return {"case", Answer::kDiffers, "its ledger was changed since"};
  } catch (const Error& error) {
    return {"case", Answer::kUnknown, error.what()};
  }
  return {"case", Answer::kHolds,
          "the first " + std::to_string(stated.ledger_size) + " ledger entries of " + stated.case_id +
              " are as they were compared"};
}

std::vector<Check> check_plan(const Request& request, const compare::Provenance& made) {
  using Answer = Check::Answer;
  if (!request.plan)
    return {{"plan", Answer::kUnknown, "name the plan, whose files are kept by whoever planned"}};
  std::vector<SealedFile> files;
  for (const compare::NamedFile& file : made.plan_files)
    files.push_back({file.role, file.name, file.bytes, file.sha256});
  std::vector<Check> checks = check_sealed_files(files, fs::path(*request.plan).parent_path());
  for (Check& check : checks) check.what = "plan";
  if (crypto::sha256(bytes_of(plan_seal_text({made.plan, files}))) != made.plan_seal)
    checks.push_back(
        {"plan", Answer::kDiffers, "the document's list of files does not have the seal it states"});
  return checks;
}

std::vector<Check> check_outputs(const compare::Provenance& made, const fs::path& folder) {
  using Answer = Check::Answer;
  std::vector<Check> checks;
  for (const compare::NamedFile& output : made.outputs) {
    // Only beside the document: a name that leads elsewhere is none of ours.
    const fs::path name = fs::path(output.name).filename();
    try {
      const bool same = hashed(output.role, output.name, folder / name).sha256 == output.sha256;
      checks.push_back({output.role, same ? Answer::kHolds : Answer::kDiffers,
                        name.string() + (same ? " is as it was made" : " was changed since")});
    } catch (const IoError& error) {
      checks.push_back({output.role, Answer::kUnknown, error.what()});
    }
  }
  return checks;
}

int verify(const Request& request) {
  const fs::path file = *request.verified;
  const Bytes bytes = read_small_file(file, "the comparison");
  const compare::Provenance made = compare::read_provenance(text_of(bytes), file.string());
  const crypto::Sha256Digest digest = crypto::sha256(bytes);
  const std::optional<Home> home = Home::find(request.home);
  std::vector<Check> checks{check_case(request, home, made.case_state)};
  std::ranges::move(check_plan(request, made), std::back_inserter(checks));
  std::ranges::move(check_outputs(made, file.parent_path()), std::back_inserter(checks));
  std::ranges::move(check_tokens(request.trust, home, file, digest), std::back_inserter(checks));
  checks.push_back(check_log(home, "comparison", [&](const archive::LogEntryBody& body) {
    const auto* const entry = std::get_if<archive::AccessEntry>(&body);
    return entry != nullptr && entry->what == compare::comparison_deed(digest) &&
           entry->case_id == made.case_state.case_id;
  }));
  const int status = tell_checks(file.string(), "made by " + made.made_by, checks,
                                 {{"comparison", file.string()},
                                  {"case", made.case_state.case_id},
                                  {"plan", made.plan},
                                  {"made_by", made.made_by},
                                  {"made_at", format_utc(made.made_at)},
                                  {"sha256", crypto::to_hex(digest)}},
                                 request.json);
  if (!request.json) std::cout << "  Whether the case itself is whole tells kiroku verify.\n";
  return status;
}

}  // namespace

void add_compare_command(Command& program) {
  Command& command = program.add_command("compare", "shows a plan beside the recording of the operation");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->named, "case folder, or identifier of a case in the home's archive");
  command.argument("PLAN", request->plan, "the plan (.json), or the sealed plan (.seal.json)");
  command.option("-o,--output", "OUT", request->output,
                 "where to: .mp4 (a film of both), .html (a page with figures and pictures), .json (figures)",
                 "kept in the home, where kiroku view shows it in the case");
  command.option("--name", "NAME", request->name, "what a comparison that is kept is called",
                 "the plan file's name");
  command.option("--verify", "FILE", request->verified,
                 "tells whether a comparison (.json) still fits its case and plan, instead of making one");
  command.option("--by-hand", "FILE", request->by_hand,
                 "JSON: steps matched by hand, points of the organ and tools picked in the pictures",
                 "steps are found by the marks of the recording");
  command.option("--write-by-hand", "FILE", request->write_by_hand,
                 "writes the steps that were found, to be edited and given with --by-hand");
  command.option("--stream", "STREAM", request->stream, "which recorded pictures",
                 "endoscope, or the only ones");
  command.option("-i,--identity", "FILE", request->identities,
                 "a recipient's identity; in a --demo home its own");
  command.choice("--show", {"beside", "overlay", "wipe"}, request->form,
                 "the plan beside the recording, over it, or left of a line in it", "beside");
  command.option("--share", "SHARE", request->share,
                 "opacity of the plan laid over, or where the line is (0 to 1)", "0.5");
  command.option("--from", "T", request->from, "hh:mm:ss[.fff] from the start, or RFC 3339",
                 "a second before the first step");
  command.option("--to", "T", request->to, "likewise", "a second after the last step");
  command.option("--speed", "FACTOR", request->speed, "of the film", "1");
  command.option("--width", "PIXELS", request->width, "of each of the two pictures",
                 "the recording's, at most 640");
  command.option("--volume", "CT", request->volume, "the CT to be shown", "the plan's");
  command.option("--series", "UID", request->series,
                 "of a folder with several series: its UID, or how that ends");
  command.option("--transfer", "NAME", request->transfer, "how tissue looks (kiroku sim transfer)", "liver");
  command.option("--view", "FROM", request->view,
                 "front, back, left, right, head, feet, or AZIMUTH,ELEVATION in degrees", "front");
  command.option("--zoom", "FACTOR", request->zoom, "larger than what fits", "1");
  command.choice("--gpu", {"auto", "off"}, request->gpu,
                 "off computes pictures in software, the same everywhere", "auto");
  command.option("--made-by", "NAME", request->made_by, "who compares", "the user of this machine");
  command.option("--authority", "NAME", request->authorities, "asks only this authority of kiroku.toml");
  command.option("--trust", "PEM", request->trust,
                 "with --verify: roots of time-stamping authorities; those of the home if absent");
  add_home_option(command, request->home);
  command.flag("-f,--force", request->force, "replaces what is there");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "A step is found where its name was marked while recording ('clip the artery', or 'step 3'); 'done' "
      "beside it "
      "ends it, 'pause' and 'resume' interrupt it. Beside every output the document OUT.comparison.json says "
      "what was "
      "matched, "
      "by whom, of which case and which plan; its hash is entered into the appliance log and time-stamped "
      "(OUT.comparison.AUTHORITY.tsr). The case is only read. Exit status: 0 made and time-stamped, 3 made "
      "without a "
      "time-stamp; "
      "with --verify 0 all holds, 1 something differs, 3 something could not be checked.");
  command.example("kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json",
                  "for the viewer: the plan beside the recording, in step");
  command.example("kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json -o liver.html",
                  "a page for people: order, times, vital signs, pictures of each step");
  command.example("kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json -o liver.mp4",
                  "a film of both, in step");
  command.example("kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json --verify liver.comparison.json",
                  "does the comparison still fit?");
  command.on_run([request] { return request->verified ? verify(*request) : make(*request); });
}

}  // namespace kiroku::apps
