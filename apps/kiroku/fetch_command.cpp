// 'kiroku fetch': cases out of a store, where their appliance is not there any more.
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/store.h"
#include "apps/kiroku/verify_extras.h"
#include "apps/verify/judging.h"
#include "apps/verify/report_text.h"
#include "archive/verify/report_json.h"
#include "base/error.h"
#include "base/printable.h"
#include "fleet/fetcher.h"
#include "fleet/stored_records.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> case_name, output, appliance;
  bool all = false, list = false, oldest = false, json = false;
  JudgingRequest judging;
};

int list(const Request& request, const std::string& appliance, const std::vector<std::string>& cases) {
  if (request.json) {
    print_json({{"appliance", appliance}, {"cases", cases}});
    return kDone;
  }
  for (const std::string& each : cases) std::cout << each << "\n";
  if (cases.empty()) std::cout << "The store has no case of " << printable(appliance) << ".\n";
  return kDone;
}

/// Gets one case, judges it, tells of both.
int fetch(const Request& request, fleet::ObjectStore& store, const std::string& appliance,
          const std::string& name, const Judge& judge, ordered_json& told) {
  fleet::FetchedCase fetched =
      fleet::fetch_case(store, appliance, name, *request.output,
                        request.oldest ? fleet::WhichVersions::kOldest : fleet::WhichVersions::kNewest);
  judge.with_rules(fetched.folder, [&](const evidence::JudgingRules& rules) {
    fleet::fetch_record(store, appliance, name, rules, fetched);
  });
  const Judged judged = judge.judge(fetched.folder);
  told.push_back({{"case", name},
                  {"folder", fetched.folder.string()},
                  {"objects", fetched.objects},
                  {"bytes", fetched.bytes},
                  {"closed", !fetched.growing},
                  {"remarks", fetched.remarks},
                  {"report", archive::report_json(judged.report)}});
  if (!request.json) {
    for (const std::string& remark : fetched.remarks) print_error("kiroku", name + ": " + remark);
    std::cout << "fetched " << fetched.objects << " objects, " << format_bytes(fetched.bytes) << ", into "
              << printable(fetched.folder.string()) << "\n"
              << (fetched.growing
                      ? "The store gives no end of this case: it is judged as far as the store gives it.\n"
                      : "")
              << report_text(judged.report, fetched.folder.string(), judged.device_trusted,
                             judged.log ? "compared with " + judged.log->string() : no_log_words());
  }
  const int status = archive::exit_status(judged.report.verdict);
  return judged.is_witnessed() ? status : worse(status, kNoAnswer);
}

int run(const Request& request, const std::optional<std::string>& asked_home, const VerifyExtras& extras) {
  const Home home = Home::open(asked_home);
  const StoreConfiguration of = store_of(home);
  const std::string appliance = request.appliance.value_or(of.appliance);
  if (int{request.case_name.has_value()} + int{request.all} + int{request.list} != 1)
    throw UsageError("give a CASE, or one of --all and --list");
  if (!request.case_name && (!request.judging.against.empty() || request.judging.log_proof))
    throw UsageError("--against and --proof are of one case: fetch the cases one by one");
  if (!request.list && !request.output) throw UsageError("say where to with -o DIR");
  fleet::ObjectStore store = open_store(home, of);
  if (request.list) return list(request, appliance, fleet::cases_in_store(store, appliance));
  const Judge judge(request.judging, extras);
  const std::vector<std::string> cases =
      request.all ? fleet::cases_in_store(store, appliance) : std::vector{*request.case_name};
  if (cases.empty()) {
    throw UsageError("the store tells of no case of " + printable(appliance) + " in bucket '" + of.bucket +
                     "': nothing was fetched");
  }
  ordered_json told = ordered_json::array();
  int status = kDone;
  for (const std::string& each : cases) {
    try {
      status = worse(status, fetch(request, store, appliance, each, judge, told));
    } catch (const Error& error) {
      // One that cannot be had keeps no other back.
      if (!request.all) throw;
      print_error("kiroku", each + ": " + error.what());
      told.push_back({{"case", each}, {"problem", error.what()}});
      status = worse(status, kRefused);
    }
  }
  if (request.json) print_json({{"appliance", appliance}, {"cases", told}});
  return status;
}

}  // namespace

void add_fetch_command(Command& program) {
  Command& command = program.add_command("fetch", "gets cases back out of a store, and verifies them");
  command.explain(
      "For when an appliance is not there any more: what the store of [store] in kiroku.toml holds of a case "
      "becomes a folder again, and is verified as 'kiroku verify' does, with the same exit status. A case "
      "that "
      "was being recorded is there as far as it had come, and is incomplete; it stays so, for only its own "
      "device can sign its end. What another device stated of it, by 'kiroku recover --from-store', comes "
      "beside it, and so does its evidence record: of several the one that holds and proves the earliest "
      "time.");
  const auto request = std::make_shared<Request>();
  const auto asked_home = std::make_shared<std::optional<std::string>>();
  const auto extras = std::make_shared<VerifyExtras>(verify_extras(asked_home));
  command.argument("CASE", request->case_name, "identifier of a case in the store");
  command.flag("--all", request->all, "every case that the store has of the appliance, instead");
  command.flag(
      "--oldest", request->oldest,
      "of objects with several versions the oldest, where the ledger does not tell which: newer ones may "
      "be somebody's who has the appliance's keys");
  command.flag("--list", request->list, "only names the cases that the store has of the appliance");
  command.option("-o,--output", "DIR", request->output, "the folder that gets a folder for each case");
  command.writes("--output", Writes::kCases);
  command.option("--appliance", "NAME", request->appliance, "whose cases", "[store] of kiroku.toml");
  add_judging_options(command, request->judging, *extras);
  add_home_option(command, *asked_home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.example("kiroku fetch --list --appliance or-2", "which cases the store has of another appliance");
  command.example("kiroku fetch --all --appliance or-2 -o fetched --device or-2.pub",
                  "gets all of them, and says what each still proves");
  command.on_run([request, asked_home, extras] { return run(*request, *asked_home, *extras); });
}

}  // namespace kiroku::apps
