#include <map>
#include <thread>

#include <nlohmann/json.hpp>

#include "archive/catalogue/catalogue.h"
#include "archive/verify/report_json.h"
#include "viewer/api/api.h"
#include "viewer/api/finding_meanings.h"
#include "viewer/api/verification_runner.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

/// The moments of a case that findings are about.
struct Moments {
  std::map<std::uint64_t, std::int64_t> of_entry;
  std::map<std::string, std::int64_t> of_file;
};

Moments moments_of(const archive::CaseReader& recording) {
  Moments moments;
  bool is_closed = false;
  recording.for_each([&](const archive::CaseEntry& entry) {
    if (is_closed) return;  // what is written later is of no moment of the case
    is_closed = std::holds_alternative<archive::CloseEntry>(entry.body);
    std::int64_t at_ns = entry.at.mono_ns;
    if (const auto* segment = std::get_if<archive::SegmentEntry>(&entry.body)) {
      at_ns = segment->span.start_ns;
      moments.of_file[segment->file.file] = at_ns;
    } else if (const auto* gap = std::get_if<archive::GapEntry>(&entry.body)) {
      at_ns = gap->span.start_ns;
    }
    moments.of_entry[entry.seq] = at_ns;
  });
  return moments;
}

/// None of the log: its entries are numbered by themselves.
ordered_json moment_of(const ordered_json& finding, const Moments& moments) {
  if (finding["of"] == "log") return nullptr;
  if (finding["file"].is_string()) {
    const auto found = moments.of_file.find(finding["file"].get<std::string>());
    if (found != moments.of_file.end()) return found->second;
  }
  if (finding["entry"].is_number()) {
    const auto found = moments.of_entry.find(finding["entry"].get<std::uint64_t>());
    if (found != moments.of_entry.end()) return found->second;
  }
  return nullptr;
}

/// A ledger that cannot be read has no moments; the findings say so themselves.
Moments moments_in(const std::filesystem::path& folder) {
  try {
    return moments_of(archive::CaseReader::open(folder));
  } catch (const Error&) {
    return {};
  }
}

ordered_json report_of(const archive::VerificationReport& report, const std::filesystem::path& folder) {
  ordered_json out = {{"state", "done"}};
  out.update(archive::report_json(report));
  const Moments moments = moments_in(folder);
  for (ordered_json& finding : out["findings"]) finding["time_ns"] = moment_of(finding, moments);
  add_meanings(out);
  return out;
}

Response describe(const std::optional<VerificationState>& state, const std::filesystem::path& folder) {
  if (!state) throw Refusal(404, "this case has not been verified here as it is now");
  if (!state->problem.empty()) throw Refusal(409, state->problem);
  if (state->report) {
    ordered_json report = report_of(*state->report, folder);
    report["verified"] = format_utc(state->finished);
    return Response::json(report);
  }
  return Response::json(
      {{"state", "running"}, {"done_bytes", state->done_bytes}, {"total_bytes", state->total_bytes}}, 202);
}

void add_to(Router& router, ViewerContext& context, VerificationRunner::Options options) {
  const auto runner = std::make_shared<VerificationRunner>(std::move(options));
  router.add("POST", "api/cases/{case:case}/verification", Right::kVerify,
             [&context, runner](const Request& request) {
               const std::filesystem::path folder = context.case_folder(request);
               if (!runner->start(folder, request.session->person())) {
                 throw Refusal(503, "many cases wait to be verified: try again later");
               }
               return describe(runner->state(folder), folder);
             });
  router.add({"GET", "api/cases/{case:case}/verification", Right::kVerify,
              [&context, runner](const Request& request) {
                const std::filesystem::path folder = context.case_folder(request);
                return describe(runner->state(folder), folder);
              },
              false});
}

}  // namespace

void add_verification_routes(Router& router, ViewerContext& context) {
  VerificationRunner::Options options;
  if (const auto& stored = context.home().stored) {
    options.elsewhere = [stored](const std::filesystem::path& folder) { return stored->verify(folder); };
    add_to(router, context, std::move(options));
    return;
  }
  options.verify.devices = {context.home().device};
  options.verify.trust = context.home().trust;
  options.verify.log = context.home().log_folder;
  options.home = context.home().folder;
  // A recorder may be at work on the same machine.
  options.verify.threads = std::max(1U, std::thread::hardware_concurrency() / 2);
  options.verified = [&context](const std::filesystem::path& folder,
                                const archive::VerificationReport& report) {
    // The list is for people's eyes; what was found holds without it.
    try {
      const auto catalogue = archive::Catalogue::open(context.home().catalogue_file);
      catalogue->refresh(folder);
      catalogue->set_verdict(folder.filename().string(), std::string(archive::verdict_name(report.verdict)),
                             utc_now());
    } catch (const Error& error) {
      context.tell(std::string("the list of cases does not know a verdict yet: ") + error.what());
    }
  };
  add_to(router, context, std::move(options));
}

}  // namespace kiroku::viewer
