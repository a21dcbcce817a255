#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/common/time_option.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/standing_consents.h"
#include "apps/kiroku/stretch_words.h"
#include "apps/kiroku/told_to_end.h"
#include "apps/kiroku/user_name.h"
#include "apps/kiroku/verify_extras.h"
#include "apps/verify/judging.h"
#include "archive/reading/case_reader.h"
#include "archive/verify/report.h"
#include "archive/verify/report_json.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "media/export/case_export.h"
#include "media/export/exporter.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

struct Request {
  std::string named, output;
  std::optional<std::string> stream, from, to, home, purpose;
  std::vector<std::string> identities;
  bool all = false, force = false, json = false;
};

/// What an export reports to: draws, and ends it where that was asked for.
class Watch {
 public:
  void operator()(std::uint64_t done, std::uint64_t total) {
    if (told_to_end()) throw Error("ended before it was whole: nothing was written");
    progress_.update(done, total);
  }

 private:
  Progress progress_{"exporting"};
};

/// What the recorder stated that it could not record of the stretch.
std::string missing_words(const std::string& gaps, const std::string& sound_gaps) {
  std::string out;
  if (!gaps.empty()) out += "Not in it, since it was not recorded: " + gaps + ".\n";
  if (!sound_gaps.empty()) out += "Of its sound was not recorded: " + sound_gaps + ".\n";
  return out;
}

/// The same of each stream, and what was erased of it since.
std::string missing_words(const archive::CaseReader& recording, const archive::Span& stretch,
                          const ordered_json& manifest) {
  const std::int64_t begins_ns = recording.opening().begins_ns;
  std::string out;
  for (const ordered_json& stream : manifest["streams"]) {
    const std::string name = stream["name"];
    const std::string of = printable(name);
    const std::string gaps = gap_words(gaps_within(recording.gaps(name), stretch), begins_ns);
    const std::string sound = gap_words(gaps_within(recording.sound_gaps(name), stretch), begins_ns);
    if (!gaps.empty()) out += "Of " + of + " was not recorded: " + gaps + ".\n";
    if (!sound.empty()) out += "Of the sound of " + of + " was not recorded: " + sound + ".\n";
    if (!stream["erased"].empty())
      out += "Of " + of + " was erased since: " + std::to_string(stream["erased"].size()) + " segment(s).\n";
  }
  return out;
}

int export_one(const Request& request, const std::optional<Home>& home, const archive::CaseReader& recording,
               const archive::Span& stretch) {
  media::ExportOptions options;
  options.stream = *request.stream;
  // Refuses an unknown one before a passphrase is asked for.
  const bool pictures = recording.stream(options.stream).kind == "video";
  options.from_ns = stretch.start_ns;
  options.to_ns = stretch.end_ns;
  options.output = request.output;
  options.overwrite = request.force;
  const crypto::AgeIdentities identities = load_identities(request.identities, home);
  const bool is_entered =
      enter_purpose(home, recording.folder(), request.purpose, "exported " + options.stream);
  media::ExportResult result;
  {
    Watch watch;
    options.progress = [&watch](std::uint64_t done, std::uint64_t total) { watch(done, total); };
    result = media::export_stream(recording, identities, options);
  }
  if (!is_entered) log_access(home, recording.folder(), "exported " + options.stream);
  const std::int64_t begins_ns = recording.opening().begins_ns;
  const auto gaps = gaps_within(recording.gaps(options.stream), stretch);
  const auto sound_gaps = gaps_within(recording.sound_gaps(options.stream), stretch);
  if (request.json) {
    ordered_json told{{"case", recording.opening().case_id}, {"stream", options.stream}};
    if (request.purpose) told["purpose"] = *request.purpose;
    told.update({{"file", request.output},
                 {"segments", result.segments},
                 {"frames", result.frames},
                 {"uncounted_segments", result.uncounted},
                 {"left_out", result.left_out},
                 {"bytes", result.bytes},
                 {"zero_ns", result.zero_ns},
                 {"start_ns", result.start_ns},
                 {"end_ns", result.end_ns},
                 {"gaps", gaps_json(gaps)},
                 {"sound_gaps", gaps_json(sound_gaps)},
                 {"verified", false}});
    print_json(told);
    return kDone;
  }
  std::cout
      << printable(request.output) << ": " << result.frames << (pictures ? " frames" : " lines") << " of "
      << options.stream << ", from " << format_duration(result.start_ns - begins_ns) << " to "
      << format_duration(result.end_ns - begins_ns) << " of the case, " << format_bytes(result.bytes)
      << (result.uncounted == 0 ? ""
                                : "; " + std::to_string(result.uncounted) +
                                      " segment(s) found by recovery are in it and not counted")
      << "\nIts time 0 is " << archive::case_time_text(result.zero_ns, begins_ns) << " of the case.\n"
      << missing_words(gap_words(gaps, begins_ns), gap_words(sound_gaps, begins_ns))
      << clock_set_words(recording.wall_clock(), begins_ns)
      << "Its segments have the hashes that the ledger states; whether the case holds was not verified: "
         "'kiroku verify' does that.\n";
  if (result.left_out > 0 && recording.stream(options.stream).kind == "events") {
    std::cout << result.left_out << " " << media::kLeftOutOfEvents << "\n";
  } else if (result.left_out > 0) {
    std::cout
        << result.left_out
        << " lines are texts, alarms, messages or notices and have no place in a table; export .jsonl to "
           "see them\n";
  }
  return kDone;
}

/// As `kiroku verify` says with the same keys: who has them reads what is in the files.
ordered_json verification_of(const Request& request, const archive::CaseReader& recording,
                             const crypto::AgeIdentities& identities) {
  JudgingRequest with_the_keys;
  with_the_keys.opened = &identities;
  const VerifyExtras extras = verify_extras(std::make_shared<std::optional<std::string>>(request.home));
  const Judge judge(with_the_keys, extras);
  const archive::VerificationReport report = judge.judge(recording.folder()).report;
  if (report.lines_root != recording.lines_root()) {
    throw Error(
        "the ledger of " + recording.folder().string() +
        " is not the one that was verified: it changed in between, so nothing was exported; find out what "
        "writes to it");
  }
  const ordered_json whole = archive::report_json(report);
  ordered_json verification{{"verdict", whole["verdict"]},   {"time", whole["time"]},
                            {"entries", report.entries},     {"ledger_root", nullptr},
                            {"contents", whole["contents"]}, {"findings", whole["findings"]}};
  if (report.lines_root) verification["ledger_root"] = crypto::to_hex(*report.lines_root);
  return verification;
}

/// Of events to which no entry commits. What has no place in a table is in the lines beside it.
std::string left_out_words(const ordered_json& manifest) {
  std::string out;
  for (const ordered_json& file : manifest["files"]) {
    const std::string name = file["file"];
    if (!file.contains("left_out") || name.ends_with(".csv")) continue;
    out += "Of " + printable(name) + ": " + std::to_string(file["left_out"].get<std::uint64_t>()) + " " +
           media::kLeftOutOfEvents + ".\n";
  }
  return out;
}

int export_all(const Request& request, const std::optional<Home>& home, const archive::CaseReader& recording,
               const archive::Span& stretch) {
  media::CaseExportOptions options;
  options.from_ns = stretch.start_ns;
  options.to_ns = stretch.end_ns;
  options.folder = request.output;
  options.overwrite = request.force;
  options.made_by = user_name();
  options.program = "kiroku " + std::string(version());
  const crypto::AgeIdentities identities = load_identities(request.identities, home);
  options.purpose = request.purpose;
  options.verification = verification_of(request, recording, identities);
  const bool is_entered = enter_purpose(home, recording.folder(), request.purpose, "exported every stream");
  media::CaseExportResult result;
  {
    Watch watch;
    options.progress = [&watch](std::uint64_t done, std::uint64_t total) { watch(done, total); };
    result = media::export_case(recording, identities, options);
  }
  if (!is_entered) log_access(home, recording.folder(), "exported every stream");
  const std::string verdict = options.verification["verdict"];
  const bool is_tampered = verdict == archive::verdict_name(archive::Verdict::kTampered);
  if (is_tampered) {
    print_error("kiroku",
                "warning: the case does not hold: what was exported is not proved to be what was recorded; "
                "'kiroku verify' says what was changed");
  }
  const int status = is_tampered ? kAnswerIsNo : kDone;
  if (request.json) {
    print_json(result.manifest);
    return status;
  }
  const std::int64_t zero_ns = result.manifest["zero"]["case_ns"];
  std::cout << printable(request.output) << ": " << result.files.size() << " files of "
            << recording.opening().streams.size() << " streams, " << format_bytes(result.bytes)
            << "; time 0 of all is " << archive::case_time_text(zero_ns, recording.opening().begins_ns)
            << " of the case, whose verdict is " << verdict << ". " << media::kExportManifest
            << " says where each begins.\n"
            << missing_words(recording, stretch, result.manifest) << left_out_words(result.manifest)
            << clock_set_words(recording.wall_clock(), recording.opening().begins_ns);
  return status;
}

int run(const Request& request) {
  if (request.all == request.stream.has_value()) {
    throw UsageError("name one stream with --stream, or take every stream with --all");
  }
  const std::optional<Home> home = Home::find(request.home);
  const archive::CaseReader recording = archive::CaseReader::open(find_case(home, request.named));
  const archive::Span stretch = recording.parse_stretch(request.from, request.to);
  end_when_told();
  return request.all ? export_all(request, home, recording, stretch)
                     : export_one(request, home, recording, stretch);
}

}  // namespace

void add_export_command(Command& program) {
  Command& command =
      program.add_command("export", "writes streams of a case as plain media, for a recipient");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->named, "case folder, or identifier of a case in the home's archive");
  command.option("--stream", "STREAM", request->stream, "which stream: endoscope, room, vitals, events");
  command.flag("--all", request->all, "every stream instead, into a folder with manifest.json");
  command.required_option("-o,--output", "FILE", request->output,
                          "where to; its ending says what: .ts .mkv .mp4 for pictures, .jsonl .csv for vital "
                          "signs; with --all a folder");
  command.option("-i,--identity", "FILE", request->identities,
                 "a recipient's identity; in a --demo home its own");
  command.option("--purpose", "P", request->purpose,
                 "what for: teaching, research or another purpose of the site's; a consent to it must stand");
  command.option("--from", "T", request->from, kTimeHelp, "the start");
  command.option("--to", "T", request->to, "likewise", "the end");
  command.flag(
      "--force", request->force,
      "replaces what is there, in one step, once the new one is whole; with --all an earlier export");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead; with --all the manifest");
  command.explain(
      "Pictures are copied, never encoded again. Every sealed file is checked against the ledger before a "
      "byte of it leaves; if one changes meanwhile, nothing is written. Whole segments are written, so that "
      "a little more than asked for may be there. The export is entered in the appliance log.");
  command.explain(
      "All forms and streams have one time base. Time 0 is --from, or where the earliest segment of pictures "
      "begins that reaches into the stretch; it is the same for every stream that is exported from the same "
      "stretch. A stream that begins later begins later in its file, and gaps stay. A .csv has the case's "
      "time and, in its last column, the time since 0.");
  command.explain(
      "What the recorder stated that it could not record of the stretch is named in the answer, in --json "
      "and "
      "in the manifest. A UTC time is what the recorder's clock showed, the steps by which it was set "
      "reckoned "
      "with.");
  command.explain(
      "--all verifies the case first, with the keys that were given, so that every segment of the case is "
      "decrypted and decoded; of one that was tampered with the exit status is 1, though it is exported. "
      "manifest.json says what was found, where each file begins on the "
      "case's clock and in UTC by the ledger, gaps, and the SHA-256 of each file; NAME.frames.csv says when "
      "each picture is shown.");
  command.explain(
      "With --purpose nothing is written unless the appliance log states a consent of this case to that "
      "purpose that was not withdrawn ('kiroku consent'). The purpose is entered in the log before the first "
      "byte leaves, and stands in manifest.json. [consent] of kiroku.toml may demand a purpose of every "
      "export.");
  command.example(
      "kiroku export 20260805T091502Z-3f9c21ab --stream endoscope -i identity.txt -o endoscope.mp4",
      "the endoscope's film");
  command.example("kiroku export CASE --stream vitals -i identity.txt --from 10:00 --to 20:00 -o vitals.csv",
                  "ten minutes of vital signs as a table");
  command.example("kiroku export CASE --all -i identity.txt --from 1h2m --to 1:05:00 -o for-the-study",
                  "three minutes of everything, on one time line");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
