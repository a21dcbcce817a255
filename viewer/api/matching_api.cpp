#include "viewer/api/matching_api.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <mutex>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_or_null.h"
#include "viewer/api/alignment_fields.h"
#include "viewer/api/api.h"
#include "viewer/api/fluoroscopy_fields.h"
#include "viewer/http/disk_room.h"
#include "viewer/kept/kept_comparison.h"
#include "viewer/kept/sealed_plan.h"
#include "viewer/people/json_fields.h"
#include "viewer/people/turns.h"
#include "viewer/programs/comparison_maker.h"
#include "viewer/programs/plan_picker.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kMatchingBodyLimit = 256U << 10;

ordered_json state_json(const ComparisonMakingState& state) {
  using State = ComparisonMakingState::State;
  ordered_json told{{"name", state.name}, {"made_by", state.made_by}};
  told["state"] = state.state == State::kRunning ? "running"
                  : state.state == State::kDone  ? "done"
                                                 : "failed";
  if (state.state == State::kRunning) {
    told["doing"] = state.doing;
    told["share"] = or_null(state.share);
  }
  if (state.state == State::kFailed) told["problem"] = state.problem;
  return told;
}

/// Steps matched by hand, points picked and tools clicked: what the plan has, and a comparison made of what a
/// person says.
class MatchingApi {
 public:
  MatchingApi(ViewerContext& context, const MatchingLimits& limits)
      : context_(context),
        limits_(limits),
        maker_({.program = context.home().comparison_program,
                .home = context.home().folder,
                .comparisons = context.home().comparisons_folder,
                .tell = [&context](const std::string& sentence) { context.tell(sentence); },
                .limit = limits.making}),
        picker_({.program = context.home().comparison_program, .clock = context.home().clock}) {}

  Response steps(const Request& request) {
    const Session::Identities identities = ViewerContext::require_unlocked(request);
    const std::filesystem::path seal = plan_of(context_.open_case(request));
    const std::string& case_id = request.parameter("case");
    context_.enter_access_once(request, case_id, "matched a plan by hand");
    const std::chrono::milliseconds limit = limits_.reading;
    const Turns::Turn waits(readers_, request.session->person());
    const std::unique_lock turn(reading_, limit);
    if (!turn) throw Refusal(503, kReadForOthers);
    const ComparisonProgramEnd end = run_comparison_program(
        context_.home().comparison_program,
        {.arguments = {case_id, seal.string(), "--home", context_.home().folder.string(), "--steps",
                       "--json"},
         .input = {},
         .further_file = {},
         .priority = ChildPriority::kAnswering,
         .limit = limit},
        *identities, [](const std::string& /*doing*/, std::optional<double> /*share*/) {},
        context_.closing());
    if (end.overdue) {
      throw Refusal(504, "reading the plan " + seal.filename().string() + " and its case took longer than " +
                             std::to_string(limit / std::chrono::seconds(1)) +
                             " s, and was ended: try again when the machine has less to do");
    }
    const json told = json::parse(end.out, nullptr, false);
    if (end.status != 0 || !told.is_object()) {
      throw Refusal(422, end.problem.empty()
                             ? "the sealed plan " + seal.filename().string() + " cannot be read"
                             : end.problem);
    }
    return Response::text(end.out, "application/json");
  }

  Response start(const Request& request) {
    const Session::Identities identities = ViewerContext::require_unlocked(request);
    const json asked = request.json();
    const std::string name = take_text(asked, "name");
    if (!compare::is_comparison_name(name))
      throw Refusal(400, "a comparison cannot be called '" + name +
                             "': use at most 32 small letters, digits and hyphens");
    const auto by_hand = asked.find("by_hand");
    if (by_hand == asked.end() || !by_hand->is_object())
      throw Refusal(400, "'by_hand' must say what was matched: an object with 'steps'");
    const std::string& case_id = request.parameter("case");
    const archive::CaseReader recording = context_.open_case(request);
    const std::filesystem::path seal = plan_of(recording);
    FluoroscopyFields fluoroscopy = take_fluoroscopy(asked, recording.opening());
    std::vector<std::string> more = take_alignment(asked, recording.opening());
    std::ranges::move(fluoroscopy.arguments, std::back_inserter(more));
    const compare::KeptPlace place = compare::kept_place(context_.home().comparisons_folder, case_id, name);
    std::error_code ignored;
    if (std::filesystem::exists(place.sealed_document(), ignored))
      throw Refusal(409, "the case has a comparison '" + name + "' already: give this one another name");
    // Before the entry: askings that come to nothing fill no log.
    const auto other = maker_.state();
    if (other && other->state == ComparisonMakingState::State::kRunning) refuse_beside(other);
    require_disk_room(context_.home().folder, 0, "remove comparisons that nobody needs");
    const std::string& user = request.session->user();
    context_.enter_access(request, case_id, "asked for a comparison with a plan, " + name);
    if (!maker_.start({.case_id = case_id,
                       .seal_file = seal,
                       .name = name,
                       .by_hand = by_hand->dump(),
                       .more = std::move(more),
                       .further_file = std::move(fluoroscopy.geometry),
                       .made_by = user,
                       .asked_by = user + " (kiroku view, " + request.peer + ")",
                       .identities = identities})) {
      refuse_beside(maker_.state());
    }
    return state(request);
  }

  Response state(const Request& request) {
    const auto state = maker_.state();
    if (!state || state->case_id != request.parameter("case"))
      throw Refusal(404, "no comparison of this case was asked for since the server began");
    return Response::json(state_json(*state),
                          state->state == ComparisonMakingState::State::kRunning ? 202 : 200);
  }

  Response stop(const Request& request) {
    const auto state = maker_.state();
    if (!state || state->case_id != request.parameter("case") ||
        state->state != ComparisonMakingState::State::kRunning)
      throw Refusal(404, "no comparison of this case is being made");
    if (state->made_by != request.session->user() && request.session->role() != Role::kAdministrator)
      throw Refusal(403, "it is made by " + state->made_by + ": they or an administrator can stop it");
    maker_.stop();
    return Response::nothing();
  }

  /// `what` is a question of `kiroku plan pick`, asked with the body.
  Response pick(const Request& request, const char* what) {
    static_cast<void>(ViewerContext::require_unlocked(request));
    const json question{{what, request.json()}};
    const std::filesystem::path seal = plan_picked_on(request);
    context_.enter_access_once(request, request.parameter("case"), "picked points on pictures of a plan");
    const PickingAnswer answer = picker_.ask(seal, request.session->user(), question.dump());
    if (!answer.ready)
      return Response::json({{"doing", answer.doing}, {"share", or_null(answer.share)}}, 202);
    const json told = json::parse(answer.text, nullptr, false);
    if (told.is_object() && told.contains("refused") && told["refused"].is_string())
      throw Refusal(400, told["refused"].get<std::string>());
    if (!told.is_object())
      throw Refusal(422, "the program that shows the plan answered with what is no answer");
    return Response::text(answer.text, "application/json");
  }

 private:
  [[noreturn]] static void refuse_beside(const std::optional<ComparisonMakingState>& other) {
    throw Refusal(409, "another comparison is being made" +
                           (other ? " by " + other->made_by : std::string()) + ": wait until it is done");
  }
  /// plan_of(), which reads a whole ledger and hashes plans, once for the many questions about one case.
  [[nodiscard]] std::filesystem::path plan_picked_on(const Request& request) {
    const std::string& case_id = request.parameter("case");
    const std::lock_guard guard(picked_on_mutex_);
    std::error_code gone;
    if (picked_on_.case_id != case_id ||
        std::filesystem::last_write_time(picked_on_.seal, gone) != picked_on_.written || gone) {
      picked_on_ = {};
      const std::filesystem::path seal = plan_of(context_.open_case(request));
      picked_on_ = {case_id, seal, std::filesystem::last_write_time(seal)};
    }
    return picked_on_.seal;
  }

  /// The sealed plan that the case was recorded by.
  [[nodiscard]] std::filesystem::path plan_of(const archive::CaseReader& recording) const {
    if (!recording.opening().plan) throw Refusal(404, "this case was not recorded by a sealed plan");
    if (context_.home().comparison_program.empty())
      throw Refusal(503, "the program that compares is not installed: install Kiroku anew");
    const auto seal = compare::find_sealed_plan(context_.home().plans_folder, *recording.opening().plan);
    if (!seal) {
      throw Refusal(404, "the plan that this case was recorded by is not here: put its folder into " +
                             context_.home().plans_folder.string());
    }
    return *seal;
  }

  ViewerContext& context_;
  const MatchingLimits limits_;
  ComparisonMaker maker_;
  PlanPicker picker_;
  static constexpr const char* kReadForOthers = "plans are being read for others: try again";
  /// Of one that is read and those who wait for it: each holds a thread of the server.
  Turns readers_{{.all = 4, .of_person = 1},
                 {kReadForOthers, "a plan is being read for you already: wait until that is done"}};
  std::timed_mutex reading_;
  struct {
    std::string case_id;
    std::filesystem::path seal;
    std::filesystem::file_time_type written;
  } picked_on_;
  std::mutex picked_on_mutex_;
};

}  // namespace

void add_matching_routes(Router& router, ViewerContext& context) { add_matching_routes(router, context, {}); }

void add_matching_routes(Router& router, ViewerContext& context, const MatchingLimits& limits) {
  const auto api = std::make_shared<MatchingApi>(context, limits);
  router.add("GET", "api/cases/{case:case}/matching", Right::kCompare,
             [api](const Request& request) { return api->steps(request); });
  router.add({"POST", "api/cases/{case:case}/comparisons", Right::kCompare,
              [api](const Request& request) { return api->start(request); }, true, kMatchingBodyLimit});
  router.add({"GET", "api/cases/{case:case}/making", Right::kCompare,
              [api](const Request& request) { return api->state(request); }, false});
  router.add("DELETE", "api/cases/{case:case}/making", Right::kCompare,
             [api](const Request& request) { return api->stop(request); });
  for (const char* what : {"picture", "point", "registration"}) {
    router.add("POST", std::string("api/cases/{case:case}/picking/") + what, Right::kCompare,
               [api, what](const Request& request) { return api->pick(request, what); });
  }
}

}  // namespace kiroku::viewer
