#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "archive/case_reader.h"
#include "media/exporter.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::string named, stream, output;
  std::optional<std::string> from, to, home;
  std::vector<std::string> identities;
  bool json = false;
};

int run(const Request& request) {
  const std::optional<Home> home = Home::find(request.home);
  const archive::CaseReader recording = archive::CaseReader::open(find_case(home, request.named));
  media::ExportOptions options;
  options.stream = request.stream;
  // Refuses an unknown one before a passphrase is asked for.
  const bool pictures = recording.stream(request.stream).kind == "video";
  if (request.from) options.from_ns = recording.parse_time(*request.from);
  if (request.to) options.to_ns = recording.parse_time(*request.to);
  options.output = request.output;
  const crypto::AgeIdentities identities = load_identities(request.identities, home);
  media::ExportResult result;
  {
    Progress progress("exporting");
    options.progress = [&progress](std::uint64_t done, std::uint64_t total) { progress.update(done, total); };
    result = media::export_stream(recording, identities, options);
  }
  log_access(home, recording.folder(), "exported " + request.stream);
  if (request.json) {
    print_json({{"case", recording.opening().case_id},
                {"stream", request.stream},
                {"file", request.output},
                {"segments", result.segments},
                {"frames", result.frames},
                {"uncounted_segments", result.uncounted},
                {"left_out", result.left_out},
                {"bytes", result.bytes},
                {"start_ns", result.start_ns},
                {"end_ns", result.end_ns}});
  } else {
    std::cout << request.output << ": " << result.frames << (pictures ? " frames" : " lines") << " of "
              << request.stream << ", from " << format_duration(result.start_ns) << " to "
              << format_duration(result.end_ns) << " of the case, " << format_bytes(result.bytes)
              << (result.uncounted == 0 ? ""
                                        : "; " + std::to_string(result.uncounted) +
                                              " segment(s) found by recovery are in it and not counted")
              << "\n";
    if (result.left_out > 0) {
      std::cout
          << result.left_out
          << " lines are texts, alarms, messages or notices and have no place in a table; export .jsonl to "
             "see them\n";
    }
  }
  return kDone;
}

}  // namespace

void add_export_command(Command& program) {
  Command& command =
      program.add_command("export", "writes one stream of a case as plain media, for a recipient");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->named, "case folder, or identifier of a case in the home's archive");
  command.required_option("--stream", "STREAM", request->stream,
                          "which stream: endoscope, room, vitals, events");
  command.required_option(
      "-o,--output", "FILE", request->output,
      "where to; its ending says what: .ts .mkv .mp4 for pictures, .jsonl .csv for vital signs");
  command.option("-i,--identity", "FILE", request->identities,
                 "a recipient's identity; in a --demo home its own");
  command.option("--from", "T", request->from, "hh:mm:ss[.fff] from the start, or RFC 3339", "the start");
  command.option("--to", "T", request->to, "likewise", "the end");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Pictures are copied, never encoded again. Every sealed file is checked against the ledger before a "
      "byte of it "
      "leaves; if one changes meanwhile, nothing is written. Whole segments are written, so that a little "
      "more than asked for may be there. The export is "
      "entered in "
      "the appliance log.");
  command.example(
      "kiroku export 20260805T091502Z-3f9c21ab --stream endoscope -i identity.txt -o endoscope.mp4",
      "the endoscope's film");
  command.example(
      "kiroku export CASE --stream vitals -i identity.txt --from 00:10:00 --to 00:20:00 -o vitals.csv",
      "ten minutes of vital signs as a table");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
