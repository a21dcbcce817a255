// 'kiroku-fleet cases' and 'kiroku-fleet status'.
#include <algorithm>
#include <charconv>
#include <filesystem>
#include <iostream>
#include <memory>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/fleet/case_search.h"
#include "apps/fleet/commands.h"
#include "apps/fleet/fleet_configuration.h"
#include "apps/fleet/page_place.h"
#include "archive/catalogue/catalogue_json.h"
#include "archive/format/case_layout.h"
#include "archive/search/search_note.h"
#include "base/error.h"
#include "base/joined.h"
#include "base/json_or_null.h"
#include "base/near_miss.h"
#include "base/number_text.h"
#include "fleet/catalogue/renewal_board.h"
#include "fleet/catalogue/room_board.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

struct Request {
  std::string configuration;
  std::optional<std::string> appliance, state, verdict, from, to, limit, after, history;
  std::optional<std::string> search_key, patient, authority, procedure, coding_system;
  bool unverified = false, attention = false, json = false;
  [[nodiscard]] bool searches() const {
    return search_key || patient || authority || procedure || coding_system;
  }
};

/// "2026-08-05" or a whole time, as RFC 3339 writes it in UTC.
UtcTime time_of(const std::string& text, const std::string& option) {
  constexpr std::size_t kDate = 10;
  const std::optional<UtcTime> time = parse_utc(text.size() == kDate ? text + "T00:00:00Z" : text);
  if (!time) {
    throw UsageError(option + " is '" + printable(text) +
                     "': write a day as 2026-08-05, or a time as 2026-08-05T09:15:02Z");
  }
  return *time;
}

std::size_t limit_of(const std::string& text) {
  constexpr std::size_t kMost = 10'000;
  std::size_t limit = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), limit);
  if (error != std::errc() || end != text.data() + text.size() || limit < 1 || limit > kMost)
    throw UsageError("--limit is '" + printable(text) + "': it takes a number from 1 to " +
                     std::to_string(kMost));
  return limit;
}

fleet::CaseQuery query_of(const Request& request) {
  fleet::CaseQuery query;
  query.appliance = request.appliance;
  query.state = request.state;
  query.verdict = request.verdict;
  query.unverified = request.unverified;
  query.needs_a_person = request.attention;
  if (request.from) query.opened_from = time_of(*request.from, "--from");
  if (request.to) query.opened_before = time_of(*request.to, "--to");
  if (query.opened_from && query.opened_before && *query.opened_before <= *query.opened_from)
    throw UsageError("--to is not after --from");
  if (request.limit) query.limit = limit_of(*request.limit);
  if (request.after) {
    query.after = parse_page_place(*request.after);
    if (!query.after)
      throw UsageError("--after is '" + printable(*request.after) +
                       "': give what the page before ended with");
  }
  return query;
}

/// The verdict as it stands, and what a reader must know beside it.
std::string verdict_of(const fleet::FleetCase& one) {
  std::string words = one.row.last_verdict ? printable(*one.row.last_verdict)
                      : one.alarm          ? "NOT INTACT, changed since"
                                           : "-";
  if (one.unchecked) words += ", not checked since";
  return words;
}

void print_table(const std::vector<fleet::FleetCase>& cases) {
  constexpr std::size_t kToTheMinute = 16;
  std::vector<std::vector<std::string>> rows{
      {"appliance", "case", "start", "length", "size", "verdict", "verified"}};
  for (const fleet::FleetCase& each : cases) {
    const archive::CatalogueRow& row = each.row;
    const bool is_there = row.state == "closed" || row.state == "open";
    rows.push_back({printable(each.appliance), printable(row.case_id),
                    is_there ? format_local(row.opened).substr(0, kToTheMinute) : "-",
                    row.state == "closed" && row.duration_ns ? format_duration(*row.duration_ns) : row.state,
                    format_bytes(row.bytes), verdict_of(each),
                    row.verified ? format_local(*row.verified).substr(0, kToTheMinute) : "not as it is now"});
  }
  std::cout << format_table(rows, "lllrrll", 0);
}

/// "No case is so" of a name that was mistyped would read as if nothing were wrong with what was meant. One
/// whose key is kept here is known, though no case of it has come.
void require_known(const std::string& appliance, const FleetConfiguration& configuration,
                   fleet::FleetCatalogue& catalogue) {
  std::error_code ignored;
  for (const char* form : {".identity", ".pub"}) {
    if (archive::is_short_name(appliance) &&
        std::filesystem::exists(configuration.devices / (appliance + form), ignored))
      return;
  }
  const std::vector<std::string> known = catalogue.appliances();
  if (std::ranges::find(known, appliance) == known.end())
    throw UsageError("the catalogue has no case of an appliance '" + printable(appliance) +
                     "'; it has those of " + (known.empty() ? "none" : printable(joined(known))) +
                     did_you_mean(appliance, known));
}

int history(const Request& request, fleet::FleetCatalogue& catalogue) {
  if (!request.appliance) throw UsageError("say whose case it is: --appliance NAME");
  const std::vector<fleet::EnteredVerification> all =
      catalogue.verifications(*request.appliance, *request.history);
  if (all.empty() && catalogue.find({.appliance = request.appliance, .case_id = request.history}).empty())
    throw UsageError("the catalogue has no case '" + printable(*request.history) + "' of " +
                     printable(*request.appliance));
  if (request.json) {
    ordered_json told = ordered_json::array();
    for (const fleet::EnteredVerification& each : all) {
      told.push_back({{"at", format_utc(each.when)},
                      {"verdict", each.verdict},
                      {"findings", each.findings},
                      {"detail", each.detail}});
    }
    print_json({{"appliance", *request.appliance}, {"case", *request.history}, {"verifications", told}});
    return kDone;
  }
  if (all.empty()) std::cout << "It was never verified here.\n";
  for (const fleet::EnteredVerification& each : all) {
    std::cout << format_local(each.when) << "  " << printable(each.verdict)
              << (each.detail.empty() ? "" : ": " + printable(each.detail)) << "\n";
  }
  return kDone;
}

/// What is asked for, in the clear: it stays in this process.
search::SearchWords words_of(const Request& request) {
  if (!request.search_key || (!request.patient && !request.procedure))
    throw UsageError("to search give --search-key FILE, and --patient NUMBER or --procedure CODE or both");
  for (const auto* each :
       {&request.patient, &request.authority, &request.procedure, &request.coding_system}) {
    if (*each && (*each)->empty())
      throw UsageError("nothing can be searched by an empty text: leave that option out");
  }
  return search_words({request.patient.value_or(""), request.authority.value_or(""),
                       request.procedure.value_or(""), request.coding_system.value_or("")},
                      {"--patient", "--authority", "--procedure", "--coding-system"});
}

void tell_of_search(const Searched& searched) {
  std::cout << "Looked at " << counted(searched.looked_at, "case", "cases") << ", of which "
            << searched.without_note << " cannot be searched: they have no search note.\n";
  if (searched.foreign > 0)
    std::cout << "The search "
              << (searched.foreign == 1 ? "note of 1 of them was"
                                        : "notes of " + std::to_string(searched.foreign) + " of them were")
              << " not made by this key.\n";
}

int cases(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  fleet::FleetCatalogue catalogue = configuration.open_catalogue();
  if (request.appliance) require_known(*request.appliance, configuration, catalogue);
  if (request.history && request.searches())
    throw UsageError("--history shows one case: leave out what to search for");
  if (request.history) return history(request, catalogue);
  const fleet::CaseQuery query = query_of(request);
  std::optional<Searched> searched;
  if (request.searches()) {
    const search::SearchWords words = words_of(request);
    search::NoteReader reader(search::SiteKey::read(*request.search_key));
    searched = search_cases(catalogue, query, reader, words);
  }
  const std::vector<fleet::FleetCase> found = searched ? searched->found : catalogue.find(query);
  const bool may_be_more = searched ? !searched->is_all : found.size() == query.limit;
  const std::optional<std::string> next =
      may_be_more ? std::optional(page_place(found.back())) : std::nullopt;
  if (request.json) {
    ordered_json told = ordered_json::array();
    for (const fleet::FleetCase& each : found) {
      ordered_json one{{"appliance", each.appliance}, {"case", each.row.case_id}};
      one.update(archive::catalogue_json(each.row));
      one["alarm"] = each.alarm;
      one["unchecked"] = or_null(each.unchecked);
      told.push_back(one);
    }
    ordered_json all{{"cases", told}, {"next", next ? ordered_json(*next) : ordered_json()}};
    if (searched) {
      all["looked_at"] = searched->looked_at;
      all["without_note"] = searched->without_note;
      all["not_by_this_key"] = searched->foreign;
    }
    print_json(all);
    return kDone;
  }
  if (found.empty()) {
    std::cout << "No case is so. 'kiroku-fleet index' brings the catalogue up to date.\n";
    if (searched) tell_of_search(*searched);
    return kDone;
  }
  print_table(found);
  if (searched) tell_of_search(*searched);
  if (next) std::cout << "There may be more: --after " << printable(*next) << "\n";
  return kDone;
}

/// What the appliances that report say together.
struct FleetNow {
  std::size_t enrolled = 0, recording = 0;  // appliances that may report; rooms that record
  /// Of appliances that are heard of, those whose rooms were to share time-stamps and do not; of the others
  /// that is not known.
  std::vector<std::string> unheard, unshared;
};

FleetNow fleet_now(const FleetConfiguration& configuration) {
  fleet::FleetReports reports = configuration.open_reports();
  FleetNow now;
  std::set<std::string> enrolled, unheard, unshared;
  for (const fleet::BoardRow& row : fleet::board_of(reports.appliances(), reports.now())) {
    enrolled.insert(row.appliance);
    if (!row.is_heard) {
      unheard.insert(row.appliance);
      continue;
    }
    if (row.room && row.room->state == "recording") ++now.recording;
    if (std::ranges::find(row.concerns, fleet::Concern::kNotShared) != row.concerns.end())
      unshared.insert(row.appliance);
  }
  now.enrolled = enrolled.size();
  now.unheard.assign(unheard.begin(), unheard.end());
  now.unshared.assign(unshared.begin(), unshared.end());
  return now;
}

void print_rooms(const FleetNow& now) {
  if (now.enrolled == 0) return;
  std::cout << "rooms             " << now.recording << " recording, of "
            << counted(now.enrolled, "appliance", "appliances") << " that may report\n";
  if (!now.unheard.empty()) std::cout << "not heard of      " << joined(now.unheard) << "\n";
  if (!now.unshared.empty())
    std::cout << "not shared        time-stamps of " << joined(now.unshared)
              << ": each asks the authority itself. 'kiroku status' there says why.\n";
}

int status(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  fleet::FleetCatalogue catalogue = configuration.open_catalogue();
  const fleet::FleetTotals totals = catalogue.totals();
  const std::uint64_t not_renewed = fleet::RenewalBoard(fleet::Postgres(configuration.connection)).refused();
  const FleetNow now = fleet_now(configuration);
  if (request.json) {
    print_json({{"cases", totals.cases},
                {"segments", totals.segments},
                {"bytes", totals.bytes},
                {"open", totals.open},
                {"unreadable", totals.unreadable},
                {"missing", totals.missing},
                {"unverified", totals.unverified},
                {"not_intact", totals.alarms},
                {"incomplete", totals.incomplete},
                {"unproven", totals.unproven},
                {"not_checked", totals.unchecked},
                {"not_renewed", not_renewed},
                {"being_verified", totals.being_verified},
                {"enrolled", now.enrolled},
                {"recording", now.recording},
                {"not_heard", now.unheard},
                {"not_shared", now.unshared}});
  } else {
    std::cout << "in the catalogue  " << counted(totals.cases, "case", "cases") << ", "
              << format_bytes(totals.bytes) << ", " << totals.open << " of them not closed\n"
              << "not verified      " << totals.unverified << " as they are now, and "
              << totals.being_verified << " being verified now\n"
              << "not intact        " << totals.alarms << "\n"
              << "not proven        " << totals.incomplete << " incomplete, " << totals.unproven
              << " unproven\n"
              << "not checked       " << totals.unchecked << ", though it was tried\n"
              << "not renewed       " << not_renewed
              << " refused; 'kiroku-fleet renew' tries them again, and says why\n"
              << "not there         " << totals.missing << " missing from the store, " << totals.unreadable
              << " whose ledger cannot be read\n";
    print_rooms(now);
  }
  const bool is_bad = totals.alarms + totals.missing + totals.unreadable > 0;
  const bool is_unknown = totals.incomplete + totals.unproven + totals.unchecked > 0;
  if (!request.json && (is_bad || is_unknown)) std::cout << "'kiroku-fleet cases --attention' names them.\n";
  return is_bad ? kAnswerIsNo : is_unknown || not_renewed > 0 ? kNoAnswer : kDone;
}

}  // namespace

void add_fleet_cases_command(Command& program) {
  Command& command = program.add_command("cases", "lists cases of all appliances, newest first");
  command.explain(
      "Shown is what the catalogue knows, with the verdict of the last 'kiroku-fleet verify'; nothing is "
      "judged here. "
      "What a case is about is not in the catalogue: it stays sealed. Where a site opted in, who has its "
      "search key finds cases by patient and procedure: search notes are read from the catalogue and "
      "compared "
      "here, so that the database learns neither what was asked for nor what was found. A case without such "
      "a "
      "note is not found, and a case that is found must be opened to know whom it is about.");
  const auto request = std::make_shared<Request>();
  command.option("--appliance", "NAME", request->appliance, "only of this one");
  command.option("--from", "TIME", request->from, "only what began then or later");
  command.option("--to", "TIME", request->to, "only what began before");
  command.choice("--state", {"closed", "open", "unreadable", "missing"}, request->state, "only these", "any");
  command.choice(
      "--verdict", {"intact", "intact-with-gaps", "intact-excerpt", "incomplete", "unproven", "tampered"},
      request->verdict, "only those whose newest verdict, of the case as it is now, is this", "any");
  command.flag("--unverified", request->unverified,
               "only what is not verified as it is now: never, or it changed since");
  command.flag(
      "--attention", request->attention,
      "only what needs a person: not intact, incomplete, unproven, not checked, missing, or unreadable");
  command.option("--limit", "N", request->limit, "how many at most", "100");
  command.option("--after", "PLACE", request->after, "what follows the page that ended with this");
  command.option("--search-key", "FILE", request->search_key,
                 "the site's search key, by which --patient and --procedure are searched here");
  command.option("--patient", "NUMBER", request->patient, "only of the patient with this number");
  command.option("--authority", "NAME", request->authority,
                 "which this one gave, as the hospital's messages say it", "whoever gave it");
  command.option("--procedure", "CODE", request->procedure, "only of the procedure with this code");
  command.option("--coding-system", "NAME", request->coding_system, "of this coding system", "of any");
  command.option("--history", "CASE", request->history,
                 "instead, all that was ever found of one case of --appliance");
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.example("kiroku-fleet cases --from 2026-08-01 --appliance or-2", "what or-2 recorded since August");
  command.example("kiroku-fleet cases --verdict tampered", "what does not hold");
  command.example("kiroku-fleet cases --search-key site-search.key --patient 0012345",
                  "one patient's cases, where the site opted in");
  command.on_run([request] { return cases(*request); });
}

void add_fleet_status_command(Command& program) {
  Command& command = program.add_command("status", "how many cases there are, and what needs a person");
  command.explain(
      "Exit status 1 says that a case is not intact, not in the store any more, or has a ledger that cannot "
      "be read; 3 "
      "that one is incomplete or unproven, or could not be checked; 0 does not say that every case was "
      "looked "
      "at: 'not verified' counts those that were not. A case that was not intact counts until a later "
      "verification says otherwise. Appliances that report are named where they are not heard of, "
      "and "
      "where their rooms do not share time-stamps though they should; 'kiroku-fleet rooms' has each room.");
  const auto request = std::make_shared<Request>();
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.example("kiroku-fleet status", "at a glance");
  command.on_run([request] { return status(*request); });
}

}  // namespace kiroku::apps
