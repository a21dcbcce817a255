#include "apps/kiroku/stated_from_store.h"

#include <algorithm>
#include <chrono>
#include <iostream>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/stamped_file.h"
#include "apps/kiroku/store.h"
#include "apps/kiroku/user_name.h"
#include "apps/verify/report_text.h"
#include "archive/format/case_folder.h"
#include "archive/format/store_statement.h"
#include "archive/storage/file_stamps.h"
#include "archive/verify/report_json.h"
#include "archive/verify/store_statements.h"
#include "archive/verify/verdict.h"
#include "base/error.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "crypto/file_hash.h"
#include "fleet/fetcher.h"
#include "fleet/stored_case.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using archive::StoreStatement;
using nlohmann::ordered_json;

/// An appliance that records ships some seconds behind; one that cannot reach the store for longer than this
/// looks like one that is gone, and is told apart by who runs it.
constexpr std::chrono::minutes kQuiet{15};

std::string ago(UtcTime now, UtcTime then) {
  return format_duration(std::chrono::nanoseconds(std::max(now - then, UtcTime::duration{0})).count());
}

/// By the store's own times: this machine's clock may be wrong, and so may the appliance's.
void require_quiet(fleet::ObjectStore& store, const fleet::StoredCase& stored, const std::string& appliance) {
  const std::optional<UtcTime> log = fleet::log_came_last(store, appliance);
  const std::optional<UtcTime> now = store.told_time();
  if (!now || !stored.put) {
    throw UsageError(
        "the store does not tell when the case came, so nothing says that its appliance is gone: give "
        "--force "
        "where you know that");
  }
  const auto refuse = [&](const std::string& what, UtcTime then) {
    throw UsageError(what + " came " + ago(*now, then) +
                     " ago, by the store's clock: " + printable(appliance) +
                     " may still record, and brings its cases to their ends itself. Wait " +
                     std::to_string(kQuiet.count()) +
                     " minutes from then, or give --force where you know that it is gone");
  };
  if (*now - *stored.put < kQuiet) refuse("something of the case", *stored.put);
  if (log && *now - *log < kQuiet) refuse("something of the appliance's log", *log);
}

struct Found {
  fleet::FetchedCase fetched;
  Judged judged;
  StoreStatement statement;  // without its time, and the log's state
};

std::string where(const StoreConfiguration& of, const std::string& appliance) {
  return of.endpoint + "/" + of.bucket + "/" + appliance;
}

/// What is there, and that this device may say so.
Found find(const FromStoreRequest& request, const Home& home, const StoreConfiguration& of,
           const std::string& appliance, fleet::ObjectStore& store, const fleet::StoredCase& stored,
           const Judge& judge) {
  const std::string& case_id = *request.case_name;
  Found found;
  found.fetched = fleet::fetch_case(store, appliance, case_id, *request.output);
  for (const std::string& remark : found.fetched.remarks) print_error("kiroku", case_id + ": " + remark);
  const fs::path& folder = found.fetched.folder;
  found.judged = judge.judge(folder);
  const archive::VerificationReport& report = found.judged.report;
  const std::string fetched =
      "; it was fetched into " + printable(folder.string()) + ", and nothing was stated";
  if (report.device == home.device().to_string()) {
    throw UsageError("case " + case_id +
                     " is this device's own, which can bring it to its end: use 'kiroku recover'" + fetched);
  }
  if (report.verdict == archive::Verdict::kTampered) return found;
  if (!found.judged.device_trusted) {
    throw UsageError("the device of case " + case_id + " is not trusted here: give its device.identity or " +
                     "device.pub with --device" + fetched);
  }
  if (report.verdict != archive::Verdict::kIncomplete) {
    throw UsageError("case " + case_id + " was brought to its end by its own device, and is " +
                     std::string(archive::verdict_name(report.verdict)) + fetched);
  }
  if (fleet::list_case(store, appliance, case_id).newest != stored.newest) {
    throw Error("the case changed in the store while it was fetched: its appliance may still ship" + fetched);
  }
  const archive::CaseFolder case_folder = archive::CaseFolder::open(folder);
  found.statement = archive::describe_for_statement(case_folder, report.entries, report.signed_entries);
  if (found.statement.entries.root != report.lines_root)
    throw Error("the ledger changed after it was verified" + fetched);
  found.statement.maker = home.device().name();
  found.statement.case_id = report.case_id;
  found.statement.device = report.device;
  found.statement.store = where(of, appliance);
  found.statement.newest = stored.put;
  return found;
}

/// A statement of this device that says the same, and that an outside authority dates; nothing if none.
std::optional<archive::JudgedStatement> stated_before(const Home& home, const Found& found,
                                                      const timestamp::TrustStore& trust) {
  archive::VerifyOptions options;
  options.devices = {home.device()};
  options.trust = &trust;
  const auto all = archive::judge_store_statements(
      archive::CaseFolder::open(found.fetched.folder),
      {found.statement.case_id, crypto::VerifierKey::parse(found.statement.device),
       found.statement.entries.size},
      options);
  for (const archive::JudgedStatement& each : all) {
    if (each.holds() && each.by_outside && each.statement->says_the_same(found.statement)) return each;
  }
  return {};
}

ordered_json lines_json(const archive::LinesOfLedger& lines) {
  return {{"size", lines.size}, {"root", crypto::to_hex(lines.root)}};
}

ordered_json statement_json(const StoreStatement& statement, const fs::path& file) {
  ordered_json files = ordered_json::array();
  for (const StoreStatement::File& each : statement.files)
    files.push_back({{"file", each.path}, {"sha256", crypto::to_hex(each.sha256)}});
  return {{"file", file.string()},
          {"maker", statement.maker},
          {"store", statement.store},
          {"looked", format_utc(statement.looked)},
          {"newest", statement.newest ? ordered_json(format_utc(*statement.newest)) : ordered_json()},
          {"log", lines_json(statement.log)},
          {"entries", lines_json(statement.entries)},
          {"signed", lines_json(statement.signed_entries)},
          {"files", files},
          {"missing", statement.missing}};
}

std::string words_of(const StoreStatement& statement) {
  return counted(statement.entries.size, "entry", "entries") + ", of which its device signed " +
         std::to_string(statement.signed_entries.size) + ", and " +
         counted(statement.files.size(), "file", "files") + " that no entry names";
}

ordered_json head_json(const FromStoreRequest& request, const std::string& appliance, const Found& found) {
  return {{"case", *request.case_name},
          {"appliance", appliance},
          {"folder", found.fetched.folder.string()},
          {"remarks", found.fetched.remarks},
          {"report", archive::report_json(found.judged.report)}};
}

/// Writes, signs and enters it; the file.
fs::path make_statement(const Home& home, Found& found) {
  const crypto::SigningKey key = home.signing_key();
  const auto log = open_log(home, key);
  const archive::ApplianceLog::Head head = log->head();
  StoreStatement& statement = found.statement;
  statement.looked = utc_now();
  statement.log = {head.size, head.root};
  const crypto::SignedNote note = crypto::sign_note_by_all(statement.to_text(), statement.maker, key);
  if (!note.hardware_silent.empty()) {
    throw Error(
        "the key in this device's hardware did not sign, and without it no verifier takes a statement: " +
        note.hardware_silent + "; nothing was stated");
  }
  if (note.note.size() > archive::kMaximumStoreStatementBytes) {
    throw Error(
        "the store has more files of the case, or lacks more, than one statement can list; nothing was "
        "stated");
  }
  const fs::path folder = archive::store_statements_folder(found.fetched.folder, statement.case_id);
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw IoError("create", folder, failed.value());
  const fs::path file = folder / archive::store_statement_name(statement.looked, home.device().key_id());
  write_durably(file, bytes_of(note.note));
  // Before anybody else has it.
  log->access(statement.case_id,
              "states what " + statement.store + " had of this case of another device: " +
                  words_of(statement) + "; statement " + file.filename().string() + ", sha256 " +
                  crypto::to_hex(crypto::sha256(bytes_of(note.note))),
              user_name());
  return file;
}

}  // namespace

int state_from_store(const FromStoreRequest& request, const std::optional<std::string>& asked_home,
                     const VerifyExtras& extras, bool json) {
  const Home home = Home::open(asked_home);
  if (!request.appliance) throw UsageError("say whose case it is with --appliance NAME");
  if (!request.output) throw UsageError("say where to with -o DIR");
  const std::string& appliance = *request.appliance;
  const std::string& case_id = *request.case_name;
  const Configuration configuration = home.configuration();
  const StoreConfiguration of = store_of(home);
  const Authorities authorities(home, configuration, {});
  const timestamp::TrustStore trust = home.trust();
  const Judge judge(request.judging, extras);
  fleet::ObjectStore store = open_store(home, of);
  store.require_lockable();
  const fleet::StoredCase stored = fleet::list_case(store, appliance, case_id);
  if (stored.newest.empty()) {
    throw UsageError("the store has nothing of case " + printable(case_id) + " below '" +
                     printable(appliance) + "/': 'kiroku fetch --list --appliance " + printable(appliance) +
                     "' names the cases that it has");
  }
  if (!request.force) require_quiet(store, stored, appliance);

  Found found = find(request, home, of, appliance, store, stored, judge);
  const std::string report_words =
      report_text(found.judged.report, found.fetched.folder.string(), found.judged.device_trusted,
                  found.judged.log ? "compared with " + found.judged.log->string() : no_log_words());
  ordered_json told = head_json(request, appliance, found);
  if (found.judged.report.verdict == archive::Verdict::kTampered) {
    told["statement"] = nullptr;
    if (json) {
      print_json(told);
    } else {
      std::cout << report_words << "What the store has is no case that holds: nothing was stated.\n";
    }
    return kAnswerIsNo;
  }
  if (const auto before = stated_before(home, found, trust)) {
    const fs::path file =
        archive::store_statements_folder(found.fetched.folder, found.statement.case_id) / before->file;
    told["statement"] = statement_json(*before->statement, file);
    told["stated_before"] = true;
    if (json) {
      print_json(told);
    } else {
      std::cout << report_words << "stated     by this device before, in " << printable(file.string())
                << ", by " << format_utc(*before->existed_at) << " as " << printable(before->authority)
                << " says; nothing came since\n";
    }
    return kDone;
  }

  const fs::path file = make_statement(home, found);
  std::vector<Stamp> stamps;
  const crypto::Sha256Digest digest = crypto::hash_file(file).sha256;
  for (const recorder::NamedAuthority& authority : authorities.named())
    stamps.push_back(stamp_file(authority, file, digest, trust));
  warn_of_missing(stamps);
  std::vector<fs::path> files{file};
  for (const Stamp& each : stamps) {
    if (each.gen_time) files.push_back(archive::token_beside(file, each.authority));
  }
  ordered_json objects = ordered_json::array();
  std::string problem, put_lines;
  try {
    for (const fs::path& each : files) {
      const fleet::PutBeside put =
          fleet::put_beside(store, appliance, case_id, stored, each, utc_now() + of.retain);
      objects.push_back(
          {{"key", put.key}, {"version", put.version}, {"locked_until", format_utc(put.lock_ends)}});
      put_lines += "in store   " + put.key + ", locked until " + format_utc(put.lock_ends) + "\n";
    }
  } catch (const Error& error) {
    problem =
        std::string(error.what()) + "; the statement lies in " + file.parent_path().string() +
        ", signed and entered into the log, and is not all in the store: run this again with another -o";
  }
  told["statement"] = statement_json(found.statement, file);
  told["stated_before"] = false;
  told["time_stamps"] = stamps_json(stamps);
  told["time"] = time_of(stamps);
  told["in_store"] = objects;
  told["problem"] = problem;
  if (json) {
    print_json(told);
  } else {
    std::cout
        << report_words << "found      " << words_of(found.statement)
        << (found.statement.newest
                ? "; the newest object is of " + format_utc(*found.statement.newest) + " by the store's clock"
                : "")
        << "\nstated     by this device, " << printable(found.statement.maker) << ", in "
        << printable(file.string()) << "\n"
        << stamp_lines(stamps) << put_lines
        << "The case stays incomplete: its own device never ended it. The statement says how far it came, "
           "who says so, and when.\n";
  }
  if (!problem.empty()) print_error("kiroku", problem);
  return problem.empty() && any_valid(stamps) ? kDone : kNoAnswer;
}

}  // namespace kiroku::apps
