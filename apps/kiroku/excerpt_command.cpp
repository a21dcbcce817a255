#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/time_option.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/standing_consents.h"
#include "apps/kiroku/stretch_words.h"
#include "apps/kiroku/user_name.h"
#include "archive/reading/case_reader.h"
#include "archive/reading/excerpt.h"
#include "base/error.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::string named, from, to, output;
  std::vector<std::string> streams, identities, recipients, recipient_files;
  std::optional<std::string> home, author, purpose;
  bool json = false;
};

int run(const Request& request) {
  const std::optional<Home> home = Home::find(request.home);
  const archive::CaseReader recording = archive::CaseReader::open(find_case(home, request.named));
  archive::ExcerptOptions options;
  const archive::Span stretch = recording.parse_stretch(request.from, request.to);
  options.from_ns = stretch.start_ns;
  options.to_ns = stretch.end_ns;
  options.streams = request.streams;
  for (const std::string& text : request.recipients)
    options.recipients.push_back(crypto::parse_recipient(text));
  for (const std::string& file : request.recipient_files) {
    for (auto& recipient : load_recipients(file)) options.recipients.push_back(std::move(recipient));
  }
  const bool rekey = !options.recipients.empty();
  if (!rekey && !request.identities.empty()) {
    throw UsageError(
        "an identity is only needed to let a new reader in: name him with --to-recipient age1..., or "
        "leave out --identity");
  }
  crypto::AgeIdentities identities;
  if (rekey) {
    identities = load_identities(request.identities, home);
    options.identities = &identities;
  }
  options.made_at = utc_now();
  options.made_by = request.author.value_or(user_name());
  const bool is_entered =
      enter_purpose(home, recording.folder(), request.purpose,
                    rekey ? "excerpt for a new reader" : "took an excerpt, sealed as it is");
  const archive::ExcerptResult result = archive::make_excerpt(recording.folder(), options, request.output);
  if (rekey && !is_entered) log_access(home, recording.folder(), "excerpt for a new reader");
  // By both clocks: where the machine's was set, they tell different stretches apart.
  const std::int64_t begins_ns = recording.opening().begins_ns;
  const archive::WallClock& clock = recording.wall_clock();
  const std::string from_utc = format_utc(clock.at(stretch.start_ns));
  const std::string to_utc = format_utc(clock.at(stretch.end_ns));
  if (request.json) {
    print_json({{"case", recording.opening().case_id},
                {"excerpt", request.output},
                {"from_ns", stretch.start_ns},
                {"to_ns", stretch.end_ns},
                {"from_utc", from_utc},
                {"to_utc", to_utc},
                {"clock_set", clock_set_json(clock)},
                {"segments", result.segments},
                {"bytes", result.bytes},
                {"first_entry", result.first_entry},
                {"last_entry", result.last_entry}});
  } else {
    std::cout << printable(request.output) << ": " << result.segments << " segments, "
              << format_bytes(result.bytes) << ", ledger entries " << result.first_entry << " to "
              << result.last_entry << "\nIt is " << archive::case_time_text(stretch.start_ns, begins_ns)
              << " to " << archive::case_time_text(stretch.end_ns, begins_ns) << " of the case: " << from_utc
              << " to " << to_utc << " by the recorder's clock.\n"
              << clock_set_words(clock, begins_ns);
  }
  return kDone;
}

}  // namespace

void add_excerpt_command(Command& program) {
  Command& command = program.add_command("excerpt", "copies a part of a case that can be verified by itself");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->named, "case folder, or identifier of a case in the home's archive");
  command.required_option("--from", "T", request->from, kTimeHelp);
  command.required_option("--to", "T", request->to, "likewise");
  command.required_option("-o,--output", "DIR", request->output, "a folder that does not exist yet");
  command.option("--stream", "STREAM", request->streams, "only this stream; all of them if absent");
  command.option("--to-recipient", "KEY", request->recipients,
                 "an age1... recipient who shall open the excerpt");
  command.option("--to-recipients-file", "FILE", request->recipient_files, "a file of them, one a line");
  command.option("-i,--identity", "FILE", request->identities,
                 "identity that opens the case, to let the new reader in; in a --demo home its own");
  command.option("--by", "NAME", request->author, "who makes it, as excerpt.json shall state it",
                 "the name of your account");
  command.option("--purpose", "P", request->purpose,
                 "what for: teaching, research or another purpose of the site's; a consent to it must stand");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Without --to-recipient the segments stay sealed to whom they were. 'kiroku verify' judges an excerpt "
      "by the same rules as a case and says what part of the case it is; its verdict is 'intact-excerpt' at "
      "best, exit status 4, or 0 with --excerpt.");
  command.explain(
      "With --purpose nothing is written unless the appliance log states a consent of this case to that "
      "purpose that was not withdrawn ('kiroku consent'); the purpose is entered in the log first. [consent] "
      "of kiroku.toml may demand a purpose of every excerpt.");
  command.explain(
      "UTC is what the recorder's clock showed. Where that clock was set in the course of the case, the "
      "steps "
      "that the ledger states are reckoned with. A time that it never showed, or showed twice, is refused: "
      "then write the time from the start of the case.");
  command.example("kiroku excerpt CASE --from 00:10:00 --to 00:12:30 -o for-the-court",
                  "two and a half minutes, with their proof");
  command.example(
      "kiroku excerpt CASE --from 00:10:00 --to 00:12:30 --stream endoscope -i identity.txt --to-recipient "
      "age1... -o for-the-expert",
      "the endoscope alone, which the expert can open");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
