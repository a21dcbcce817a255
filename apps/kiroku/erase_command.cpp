#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/recording_setup.h"
#include "archive/case_layout.h"
#include "archive/case_reader.h"
#include "archive/file_system.h"
#include "archive/retention.h"
#include "base/error.h"
#include "recorder/checkpoint_stamper.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> case_name, older_than, home;
  std::string stream, policy;
  bool json = false;
};

/// "30d", or what every other duration is written as.
std::chrono::nanoseconds parse_age(const std::string& text) {
  constexpr std::size_t kMostDigits = 5;
  if (!text.ends_with('d')) return parse_duration(text, "--older-than");
  const std::string number = text.substr(0, text.size() - 1);
  if (number.empty() || number.size() > kMostDigits ||
      number.find_first_not_of("0123456789") != std::string::npos) {
    throw UsageError("--older-than is '" + text + "': write whole days such as 30d, or 12h, 90m");
  }
  return std::chrono::hours(24) * std::stol(number);
}

bool is_old_enough(const fs::path& folder, const Request& request) {
  if (!request.older_than) return true;
  const UtcTime opened = archive::CaseReader::open(folder).opened_at().utc;
  return utc_now() - opened > std::chrono::duration_cast<UtcTime::duration>(parse_age(*request.older_than));
}

/// The one case that was named, or every case of the home that is old enough and has the stream.
std::vector<fs::path> cases_to_erase_from(const Home& home, const Request& request) {
  if (request.case_name) {
    const fs::path folder = find_case(home, *request.case_name);
    if (!home.holds(folder)) {
      throw UsageError(folder.string() +
                       " is not in this home's archive: only the recorder that recorded a "
                       "case can state that something was erased from it");
    }
    if (!is_old_enough(folder, request)) {
      throw UsageError("case " + folder.filename().string() + " is not older than " + *request.older_than +
                       ": nothing was erased");
    }
    return {fs::canonical(folder)};
  }
  std::vector<fs::path> folders;
  for (const fs::directory_entry& entry : fs::directory_iterator(home.archive())) {
    if (!archive::is_case_id(entry.path().filename().string()) || !entry.is_directory()) continue;
    const archive::CaseReader reader = archive::CaseReader::open(entry.path());
    const auto& streams = reader.opening().streams;
    const bool has_stream = std::any_of(streams.begin(), streams.end(),
                                        [&](const auto& stream) { return stream.name == request.stream; });
    if (has_stream && reader.closing() && is_old_enough(entry.path(), request))
      folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

int run(const Request& request) {
  if (!request.case_name && !request.older_than) {
    throw UsageError("name the CASE to erase from, or say which with --older-than, such as 30d");
  }
  if (request.policy.empty()) throw UsageError("--policy is empty: say why the recording may go");
  const Home home = Home::open(request.home);
  const std::vector<fs::path> folders = cases_to_erase_from(home, request);
  const Configuration configuration = home.configuration();
  const Authorities authorities(home, configuration, {});
  const WritableHome writable(home);
  archive::RetentionOptions options;
  options.key = &writable.key;
  options.device_name = home.device().name();
  options.log = writable.log.get();
  options.stamp = recorder::checkpoint_stamper(authorities.named(), &writable.trust, writable.queue.get());
  ordered_json cases = ordered_json::array();
  for (const fs::path& folder : folders) {
    const archive::Erasure erased =
        archive::erase_stream(archive::real_file_system(), options, folder, request.stream, request.policy);
    refresh_catalogue(home, folder);
    cases.push_back({{"case", folder.filename().string()},
                     {"stream", request.stream},
                     {"segments", erased.segments},
                     {"bytes", erased.bytes},
                     {"stamped", erased.stamped}});
    if (request.json) continue;
    std::cout << folder.filename().string() << ": "
              << (erased.segments == 0 ? "nothing of " + request.stream + " was left to erase"
                                       : "erased " + std::to_string(erased.segments) + " segments of " +
                                             request.stream + " (" + format_bytes(erased.bytes) + ")")
              << (erased.segments > 0 && !erased.stamped ? "; no authority time-stamped it" : "") << "\n";
  }
  if (request.json) {
    print_json({{"cases", cases}});
  } else if (folders.empty()) {
    std::cout << "No closed case with a stream " << printable(request.stream) << " is older than "
              << *request.older_than << ".\n";
  }
  return kDone;
}

}  // namespace

void add_erase_command(Command& program) {
  Command& command =
      program.add_command("erase", "erases one stream of closed cases and keeps the proof of the rest");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->case_name, "a case of this home; all that are old enough if absent");
  command.required_option("--stream", "S", request->stream, "the stream whose pictures or samples go");
  command.required_option("--policy", "TEXT", request->policy,
                          "why they may go; stands in the case and in the appliance log for good");
  command.option("--older-than", "T", request->older_than,
                 "only what was opened longer ago: 30d, or 12h, 90m");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Bytes go, hashes stay: 'kiroku verify' goes on proving everything else and says how many segments "
      "were "
      "erased by which policy. That they are erased is signed and time-stamped before the first byte goes. "
      "There is no way back. A case that is not closed is refused.");
  command.example("kiroku erase 20260805T091502Z-3f9c21ab --stream room --policy 'consent withdrawn'",
                  "erases the room camera of one case");
  command.example("kiroku erase --older-than 30d --stream room --policy 'room: 30 days'",
                  "erases the room camera of every case that is older than thirty days");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
