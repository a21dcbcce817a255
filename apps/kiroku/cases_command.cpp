#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "archive/catalogue/catalogue.h"
#include "archive/catalogue/catalogue_json.h"
#include "base/joined.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> home;
  bool rebuild = false, json = false;
};

ordered_json row_json(const archive::CatalogueRow& row, const Home& home) {
  ordered_json out{{"case", row.case_id}, {"folder", (home.archive() / row.case_id).string()}};
  out.update(archive::catalogue_json(row));
  return out;
}

/// "2026-08-05 11:15 (09:15 UTC)"; once where this machine's zone is UTC.
std::string start_of(const archive::CatalogueRow& row) {
  const std::string local = format_local(row.opened);
  if (local.ends_with("+0000")) return local.substr(0, 16) + " UTC";
  return local.substr(0, 16) + " (" + format_utc(row.opened).substr(11, 5) + " UTC)";
}

void print_table(const std::vector<archive::CatalogueRow>& cases) {
  std::vector<std::vector<std::string>> rows{
      {"case", "start", "length", "streams", "size", "verdict", "verified"}};
  for (const archive::CatalogueRow& row : cases) {
    const bool readable = row.state != "unreadable";
    rows.push_back({printable(row.case_id), readable ? start_of(row) : "-",
                    row.duration_ns ? format_duration(*row.duration_ns) : row.state,
                    printable(joined(row.streams)), format_bytes(row.bytes), row.last_verdict.value_or("-"),
                    row.verified ? format_local(*row.verified).substr(0, 16) : "never"});
  }
  std::cout << format_table(rows, "llrlrll", 0);
}

int run(const Request& request) {
  const Home home = Home::open(request.home);
  const auto catalogue = archive::Catalogue::open(home.catalogue_file());
  if (request.rebuild) catalogue->rebuild(home.archive());
  const std::vector<archive::CatalogueRow> rows = catalogue->list(home.archive());
  if (request.json) {
    ordered_json cases = ordered_json::array();
    for (const auto& row : rows) cases.push_back(row_json(row, home));
    print_json({{"cases", cases}});
  } else if (rows.empty()) {
    std::cout << "Nothing is recorded in " << printable(home.archive().string())
              << " yet: 'kiroku record --help' tells how.\n";
  } else {
    print_table(rows);
  }
  return kDone;
}

}  // namespace

void add_cases_command(Command& program) {
  Command& command = program.add_command("cases", "lists what is recorded, newest first");
  const auto request = std::make_shared<Request>();
  command.flag("--rebuild", request->rebuild,
               "makes the catalogue anew from the archive's folders, which are the truth");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The verdict is what 'kiroku verify' last said by the keys, roots and log of this home alone, and "
      "when; "
      "nothing is judged here.");
  command.example("kiroku cases", "lists the home's cases");
  command.example("kiroku cases --json | jq -r '.cases[0].folder'", "prints the newest case's folder");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
