// 'kiroku consent': written consent to the use of cases, stated in the appliance log.
#include "apps/kiroku/consent_command.h"

#include <algorithm>
#include <iostream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/output_file.h"
#include "apps/kiroku/standing_consents.h"
#include "apps/kiroku/standing_holds.h"
#include "apps/kiroku/user_name.h"
#include "archive/format/consent_layout.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/consents.h"
#include "archive/upkeep/holds.h"
#include "archive/verify/excerpt_verifier.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "base/joined.h"
#include "base/printable.h"
#include "crypto/encoding.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::string case_name, person;
  std::optional<std::string> home, since, form, write_form, entry;
  std::vector<std::string> purposes, identities;
  bool keep_form = false, json = false;
};

std::string case_of(const Home& home, const std::string& named) {
  const fs::path folder = find_case(home, named);
  if (!home.holds(folder) || archive::is_excerpt(folder)) {
    throw UsageError(
        folder.string() +
        " is no case of this home's archive: consent is stated by the recorder that recorded it");
  }
  return fs::canonical(folder).filename().string();
}

/// One line of a file or of standard input. A name on the command line could be read by everybody on the
/// machine.
std::string read_person(const std::string& file) {
  constexpr std::size_t kMost = 1'000;
  std::string text;
  if (file == "-") {
    // One more than may be there, so that what is too long is told.
    for (char next = 0; text.size() <= kMost + 2 && std::cin.get(next);) text += next;
  } else {
    const Bytes bytes = read_small_file(file, "who consented");
    text = text_of(bytes);
  }
  while (text.ends_with('\n') || text.ends_with('\r')) text.pop_back();
  const std::string from = file == "-" ? "standard input" : file;
  if (text.empty())
    throw UsageError(from + " is empty: write who consented in one line, and as what: 'Hana Mori, patient'");
  if (text.size() > kMost) throw UsageError(from + " has more than 1000 bytes: write one line");
  require_printable(text, "who consented, in " + from + ",");
  return text;
}

/// "2026-08-05", today unless one was given.
std::string day_of(const std::optional<std::string>& asked) {
  constexpr std::size_t kDay = 10;
  const std::string today = format_utc(utc_now()).substr(0, kDay);
  if (!asked) return today;
  const auto day = asked->size() == kDay ? parse_utc(*asked + "T00:00:00.000000Z") : std::nullopt;
  if (!day) throw UsageError("--since is '" + printable(*asked) + "': write a day as 2026-08-05");
  // East of Greenwich tomorrow has begun.
  if (*day > utc_now() + std::chrono::hours(14))
    throw UsageError("--since is " + *asked +
                     ", which is still to come: a consent is stated once it was given");
  return *asked;
}

void require_purposes(const std::vector<std::string>& purposes) {
  if (purposes.size() > archive::kMaximumPurposes) throw UsageError("--purpose was given more than 32 times");
  for (const std::string& each : purposes) {
    if (std::ranges::count(purposes, each) > 1)
      throw UsageError("--purpose names '" + printable(each) + "' twice");
  }
}

/// A case's purposes of which `is_wanted` holds, in the order of their names.
std::vector<std::string> purposes_of(const archive::Consents& consents, const std::string& name,
                                     bool (*is_wanted)(const archive::PurposeState&)) {
  std::vector<std::string> purposes;
  const auto found = consents.find(name);
  if (found == consents.end()) return purposes;
  for (const auto& [purpose, state] : found->second.purposes) {
    if (is_wanted(state)) purposes.push_back(purpose);
  }
  return purposes;
}
bool stands(const archive::PurposeState& state) { return state.stands; }

bool is_among(const std::vector<std::string>& all, const std::string& purpose) {
  return std::ranges::find(all, purpose) != all.end();
}

/// Who, since when, and the form, as they were handed in.
struct Words {
  std::string person, since;
  std::optional<Bytes> form;
};
Words read_words(const Request& request) {
  if (request.keep_form && !request.form) throw UsageError("--keep-form keeps the file of --form: name it");
  Words words;
  words.since = day_of(request.since);
  words.person = read_person(request.person);
  if (request.form) {
    words.form = read_small_file(*request.form, "the form");
    if (words.form->empty()) throw UsageError(*request.form + " is empty: it is no form that anybody signed");
  }
  return words;
}

/// The home, its log, and the turn of this process to state something. What somebody may still be typing, or
/// a pipe may still hold back, is read before the turn: nothing is held or erased in it.
struct Stating {
  explicit Stating(const Request& request)
      : home(Home::open(request.home)),
        name(case_of(home, request.case_name)),
        site(consent_configuration(home)),
        recipients(load_recipients(home.recipients_file())),
        words(read_words(request)),
        key(home.signing_key()),
        log(open_log(home, key)),
        turn(home.archive()),
        consents(standing_consents(home)) {
    if (log->case_state(name) == archive::ApplianceLog::CaseState::kUnknown) {
      throw UsageError("the appliance log does not say that case " + name +
                       " was opened, so nothing is stated about it; 'kiroku log --verify' says more");
    }
  }

  Home home;
  std::string name;
  ConsentConfiguration site;
  crypto::AgeRecipients recipients;
  Words words;
  crypto::SigningKey key;
  std::unique_ptr<archive::ApplianceLog> log;
  archive::ErasingTurn turn;
  archive::Consents consents;
};

/// Seals who, since when and by which form, and enters what is said of it in the clear; the entry's number.
/// What was sealed for an entry that could not be made is removed.
std::uint64_t enter(const Stating& stating, const Request& request, const std::vector<std::string>& purposes,
                    bool withdraws) {
  archive::ConsentDocument document;
  document.case_id = stating.name;
  document.purposes = purposes;
  document.withdraws = withdraws;
  document.since = stating.words.since;
  document.person = stating.words.person;
  const std::optional<Bytes>& form = stating.words.form;
  if (form) document.form = archive::ConsentDocument::Form{form->size(), crypto::sha256(*form)};
  archive::FileSystem& files = archive::real_file_system();
  std::vector<crypto::Sha256Digest> kept;
  const auto keep = [&](ByteView plaintext) {
    kept.push_back(archive::keep_sealed(files, stating.home.log_folder(), plaintext, stating.recipients));
    return kept.back();
  };
  archive::ConsentStatement statement;
  statement.case_id = stating.name;
  statement.purposes = purposes;
  statement.who = user_name();
  try {
    if (request.keep_form) statement.form = keep(form.value());
    statement.statement = keep(bytes_of(archive::to_json(document)));
    return withdraws ? stating.log->consent_withdrawn(statement) : stating.log->consent_given(statement);
  } catch (...) {
    archive::remove_unless_entered(files, stating.home.log_folder(), kept);
    throw;
  }
}

int give(const Request& request) {
  if (request.purposes.empty()) throw UsageError("say to what was consented with --purpose, once for each");
  require_purposes(request.purposes);
  const Stating stating(request);
  for (const std::string& each : request.purposes) {
    if (!stating.site.knows(each)) {
      throw UsageError("'" + printable(each) + "' is no purpose of this site; [consent] of kiroku.toml has " +
                       stating.site.known());
    }
  }
  const std::vector<std::string> there = purposes_of(stating.consents, stating.name, stands);
  for (const std::string& each : request.purposes) {
    if (is_among(there, each)) {
      throw UsageError(
          "a consent of case " + stating.name + " to " + each + " stands already (entry " +
          std::to_string(stating.consents.at(stating.name).purposes.at(each).entry) +
          " of the appliance log): nothing was entered; leave this purpose out, or withdraw that "
          "one first");
    }
  }
  const std::uint64_t entry = enter(stating, request, request.purposes, false);
  if (request.json) {
    print_json({{"case", stating.name}, {"entry", entry}, {"given", request.purposes}});
  } else {
    std::cout << "consent of case " << stating.name << " to " << joined(request.purposes)
              << " is entered (entry " << entry << " of the appliance log)\n";
  }
  return kDone;
}

int withdraw(const Request& request) {
  require_purposes(request.purposes);
  const Stating stating(request);
  const std::vector<std::string> there =
      purposes_of(stating.consents, stating.name, archive::may_be_withdrawn);
  for (const std::string& each : request.purposes) {
    if (is_among(there, each)) continue;
    const auto reason = archive::why_not_consented(stating.consents, stating.name, each);
    throw UsageError(printable(reason) + ": there is nothing to withdraw, and nothing was entered");
  }
  if (there.empty())
    throw UsageError("no consent of case " + stating.name + " stands: there is nothing to withdraw");
  const std::vector<std::string> purposes = request.purposes.empty() ? there : request.purposes;
  std::vector<std::string> still = purposes_of(stating.consents, stating.name, stands);
  const std::uint64_t entry = enter(stating, request, purposes, true);
  // It is entered: nothing that follows may look as if it were not.
  std::erase_if(still, [&](const std::string& each) { return is_among(purposes, each); });
  const bool due = std::ranges::any_of(
      purposes, [&](const std::string& each) { return is_among(stating.site.erase_when_withdrawn, each); });
  std::optional<std::string> held;  // nothing: nobody can tell
  std::string why_unknown;
  try {
    held = due ? archive::why_held(standing_holds(stating.home), stating.name) : "";
  } catch (const std::exception& error) {
    why_unknown = printable(error.what());
  }
  if (request.json) {
    ordered_json told{
        {"case", stating.name}, {"entry", entry}, {"withdrawn", purposes}, {"still_stands", still}};
    told["due_for_erasure"] = held ? ordered_json(due && held->empty()) : ordered_json();
    told["held"] = held ? ordered_json(!held->empty()) : ordered_json();
    if (!held) told["problem"] = why_unknown;
    print_json(told);
    return kDone;
  }
  std::cout << "consent of case " << stating.name << " to " << joined(purposes) << " is withdrawn (entry "
            << entry << " of the appliance log)\n";
  if (!due) {
    std::cout << "Nothing is erased: [consent] erase_when_withdrawn of kiroku.toml names none of these.\n";
  } else if (!held) {
    std::cout
        << "By [consent] erase_when_withdrawn of kiroku.toml the case is due. Whether a legal hold keeps it "
           "could not be told: "
        << why_unknown << "\n";
  } else if (!held->empty()) {
    std::cout << "Nothing is erased: " << *held << ", and a legal hold wins over a withdrawn consent.\n";
  } else {
    std::cout << "By [consent] erase_when_withdrawn of kiroku.toml the case is due: the next 'kiroku erase "
                 "--due' erases all its streams.\n";
  }
  return kDone;
}

ordered_json json_of(const archive::Consent& consent) {
  ordered_json out{{"entry", consent.entry},
                   {"kind", consent.withdraws ? "withdrawn" : "given"},
                   {"entered", format_utc(consent.at)},
                   {"purposes", consent.says.purposes},
                   {"who", consent.says.who},
                   {"counts", consent.withdraws || consent.is_signed},
                   {"signed", consent.is_signed},
                   {"form_kept", consent.says.form.has_value()}};
  return out;
}

int list(const Request& request) {
  const Home home = Home::open(request.home);
  ordered_json rows = ordered_json::array();
  for (const auto& [name, of_case] : standing_consents(home)) {
    ordered_json purposes = ordered_json::object();
    std::string text;
    for (const auto& [purpose, state] : of_case.purposes) {
      const bool is_signed = state.stands || state.withdrawal_signed;
      purposes[purpose] = {{"stands", state.stands},
                           {"entry", state.entry},
                           {"since", format_utc(state.since)},
                           {"signed", is_signed}};
      text += "  " + purpose + (state.stands ? " since " : " withdrawn ") + format_local(state.since) +
              (is_signed ? "" : " by an entry that nobody signed in time");
    }
    rows.push_back({{"case", name}, {"purposes", purposes}});
    if (!request.json) std::cout << name << text << "\n";
  }
  if (request.json) {
    print_json({{"consents", rows}});
  } else if (rows.empty()) {
    std::cout << "No consent is entered for any case.\n";
  }
  return kDone;
}

void write_form(const Request& request, const Home& home, const std::vector<archive::Consent>& entries,
                const crypto::AgeIdentities& identities) {
  std::vector<const archive::Consent*> with;
  for (const archive::Consent& each : entries) {
    if (each.says.form && (!request.entry || std::to_string(each.entry) == *request.entry))
      with.push_back(&each);
  }
  if (with.empty())
    throw UsageError("no form is kept by such an entry: 'kiroku consent show' says which has one");
  if (with.size() > 1) throw UsageError("several forms are kept: say whose with --entry");
  const archive::ConsentDocument says = archive::open_statement(home.log_folder(), *with.front(), identities);
  const Bytes form = archive::open_sealed(home.log_folder(), *with.front()->says.form, identities);
  if (!says.form || says.form->sha256 != crypto::sha256(form)) {
    throw Error("the form that is kept is not the one whose SHA-256 the statement names: it was not written");
  }
  OutputFile file(*request.write_form, 0600);
  file.write(form);
  file.commit(OutputFile::Durability::kNow);
}

int show(const Request& request) {
  const Home home = Home::open(request.home);
  const std::string name = case_of(home, request.case_name);
  const archive::Consents all = standing_consents(home);
  const auto found = all.find(name);
  const std::vector<archive::Consent> entries =
      found == all.end() ? std::vector<archive::Consent>() : found->second.entries;
  // Without an identity what stands in the clear; a demonstration home has its own.
  std::error_code ignored;
  const bool opens = !request.identities.empty() || fs::exists(home.identity_file(), ignored);
  if (request.write_form && !opens) throw UsageError("only a recipient opens a form: give --identity FILE");
  const crypto::AgeIdentities identities =
      opens && !entries.empty() ? load_identities(request.identities, home) : crypto::AgeIdentities();
  ordered_json rows = ordered_json::array();
  bool unreadable = false;
  for (const archive::Consent& each : entries) {
    ordered_json row = json_of(each);
    std::string line = "entry " + std::to_string(each.entry) + "  " + format_local(each.at) + "  " +
                       (each.withdraws ? "withdrawn" : "given") + ": " + joined(each.says.purposes) +
                       ", entered by " + printable(each.says.who);
    if (!each.is_signed) {
      line += "\n  Nobody signed this entry in time: ";
      line += each.withdraws ? "it forbids the use and erases nothing. If it is true, enter it again with "
                               "'kiroku consent withdraw'; if not, with 'kiroku consent give'."
                             : "it gives no consent.";
    }
    if (opens) {
      try {
        const archive::ConsentDocument says = archive::open_statement(home.log_folder(), each, identities);
        row["person"] = says.person;
        row["since"] = says.since;
        line += "\n  by " + printable(says.person) + ", on " + printable(says.since);
        if (says.form) {
          row["form"] = {{"bytes", says.form->bytes}, {"sha256", crypto::to_hex(says.form->sha256)}};
          line += "\n  form: SHA-256 " + crypto::to_hex(says.form->sha256) + ", " +
                  format_bytes(says.form->bytes) + (each.says.form ? ", kept" : ", not kept here");
        }
      } catch (const Error& error) {
        unreadable = true;
        row["problem"] = error.what();
        line += "\n  could not be read: " + printable(error.what());
      }
    }
    rows.push_back(row);
    if (!request.json) std::cout << line << "\n";
  }
  if (opens && !entries.empty()) log_access(home, home.archive() / name, "read the consents");
  if (request.write_form) write_form(request, home, entries, identities);
  if (request.json) {
    print_json({{"case", name}, {"entries", rows}});
  } else if (entries.empty()) {
    std::cout << "No consent is entered for case " << name << ".\n";
  } else if (!opens) {
    std::cout << "Who consented is sealed: --identity FILE opens it.\n";
  }
  return unreadable ? kAnswerIsNo : kDone;
}

void add_stating_options(Command& command, const std::shared_ptr<Request>& request) {
  command.argument("CASE", request->case_name, "a case of this home, closed or not");
  command.required_option("--person", "FILE", request->person,
                          "one line that says who, and as what; - reads standard input. It is sealed");
  command.option("--since", "DAY", request->since, "the day on the form, such as 2026-08-05", "today");
  command.option("--form", "FILE", request->form,
                 "the scanned form: its SHA-256 is sealed with the statement");
  command.flag("--keep-form", request->keep_form, "keeps the form, too, sealed beside the log");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
}

}  // namespace

void add_consent_command(Command& program) {
  Command& consent = program.add_command("consent", "states written consent to the use of a case");
  consent.explain(
      "A consent is stated in the appliance log, signed: to which purposes, when, by which user. Who "
      "consented, since when and by which form is sealed to the recipients of recipients.txt and lies beside "
      "the log.");
  consent.example("kiroku consent list", "which cases may be used for what");

  Command& giving = consent.add_command("give", "states that somebody consented");
  const auto given = std::make_shared<Request>();
  giving.option("--purpose", "P", given->purposes, "to what; one of the site's purposes, once for each");
  add_stating_options(giving, given);
  giving.explain(
      "The site's purposes are [consent] purposes of kiroku.toml: treatment-record, quality-assurance, "
      "teaching, "
      "research and publication where it names none.");
  giving.example(
      "kiroku consent give 20260805T091502Z-3f9c21ab --purpose teaching --person who.txt --form scan.pdf "
      "--keep-form",
      "the case may be used for teaching");
  giving.on_run([given] { return give(*given); });

  Command& withdrawing = consent.add_command("withdraw", "states that a consent was withdrawn");
  const auto withdrawn = std::make_shared<Request>();
  withdrawing.option("--purpose", "P", withdrawn->purposes, "to what; every purpose that stands if absent");
  add_stating_options(withdrawing, withdrawn);
  withdrawing.explain(
      "From then on no export for the purpose is made. What was handed out before stays where it is. The "
      "case "
      "is erased only where [consent] erase_when_withdrawn of kiroku.toml says so, and never under legal "
      "hold.");
  withdrawing.example("kiroku consent withdraw 20260805T091502Z-3f9c21ab --purpose teaching --person who.txt",
                      "the case may not be used for teaching any more");
  withdrawing.on_run([withdrawn] { return withdraw(*withdrawn); });

  Command& listing = consent.add_command("list", "tells which cases may be used for what");
  const auto listed = std::make_shared<Request>();
  add_home_option(listing, listed->home);
  listing.flag("--json", listed->json, "prints one JSON object instead");
  listing.explain("It names nobody, so that no identity is asked for.");
  listing.example("kiroku consent list", "every case with a consent, and what was withdrawn");
  listing.on_run([listed] { return list(*listed); });

  Command& showing = consent.add_command("show", "tells every consent of one case");
  const auto shown = std::make_shared<Request>();
  showing.argument("CASE", shown->case_name, "a case of this home");
  showing.option("-i,--identity", "FILE", shown->identities,
                 "a recipient's identity, which opens who consented; in a --demo home its own");
  showing.option("--write-form", "FILE", shown->write_form, "writes the form that is kept, opened");
  showing.writes("--write-form");
  showing.option("--entry", "ENTRY", shown->entry, "whose form, where several are kept");
  add_home_option(showing, shown->home);
  showing.flag("--json", shown->json, "prints one JSON object instead");
  showing.explain("With an identity, that the consents were read is entered in the appliance log.");
  showing.example("kiroku consent show 20260805T091502Z-3f9c21ab -i identity.txt",
                  "who consented, and to what");
  showing.on_run([shown] { return show(*shown); });
}

}  // namespace kiroku::apps
