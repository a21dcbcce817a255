#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "archive/format/log_entry.h"
#include "archive/writing/log_reading.h"
#include "base/attempt_guard.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "recorder/control/control_client.h"
#include "recorder/control/plan_patient.h"
#include "viewer/api/api.h"
#include "viewer/api/meant_case.h"
#include "viewer/kept/sealed_plan.h"
#include "viewer/people/json_fields.h"
#include "viewer/people/subject_json.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kLongestMark = 500;
constexpr std::size_t kLargestSubject = 16U << 10;
constexpr std::size_t kDigitsOfPlan = 64;

/// A recorder that hangs must not hold every thread of the viewer; starting opens cameras, which takes long.
constexpr std::chrono::seconds kPatience{30};

/// 503 where no recorder answers, or not in time, 409 with its own sentence where it could not do what it was
/// asked.
ordered_json answer_of_recorder(const ViewerContext& context, const json& question) {
  try {
    ordered_json answer = recorder::ask_recorder(context.home().control_socket, question, kPatience);
    answer.erase("ok");
    return answer;
  } catch (const recorder::NobodyAnswers& nobody) {
    throw Refusal(503, nobody.what());
  } catch (const recorder::AnswersTooLate& late) {
    throw Refusal(503, late.what());
  } catch (const Error& refused) {
    throw Refusal(409, refused.what());
  }
}

Response ask(const ViewerContext& context, const json& question) {
  return Response::json(answer_of_recorder(context, question));
}

/// What the case is about, out of a body that may have nothing of it: "subject", as somebody typed it, or
/// "procedure", one that GET procedures listed. What was typed says by whom, whatever the browser claims.
void add_subject(json& question, const json& asked, const Request& request) {
  if (asked.contains("subject") && asked.contains("procedure"))
    throw Refusal(400, "give 'subject' or 'procedure', not both");
  const std::string& user = request.session->user();
  if (const auto subject = asked.find("subject"); subject != asked.end()) {
    if (!subject->is_object() || subject->dump().size() > kLargestSubject) {
      throw Refusal(
          400, "'subject' must be a JSON object of at most " + std::to_string(kLargestSubject) + " bytes");
    }
    question["subject"] = *subject;
    question["subject"]["origin"] = "page";
    question["subject"]["chosen"] = "typed in by " + user;
  }
  if (asked.contains("procedure")) {
    question["procedure"] = take_text(asked, "procedure");
    question["by"] = user;
  }
}

/// Where another case runs than the one that the page shows, the room does nothing.
void add_meant_case(json& question, const json& asked) {
  if (const auto meant = meant_case(asked)) question["case"] = *meant;
}

/// Seals that the appliance log knows by signed entries, in hexadecimal, and since when.
std::map<std::string, UtcTime> sealed_here(const ViewerContext& context) {
  std::map<std::string, UtcTime> seals;
  crypto::MerkleFrontier tree;
  const ViewerHome& home = context.home();
  archive::for_each_log_line(home.log_folder, [&](const archive::LogLine& line) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    if (line.type != "plan-sealed") return;
    const archive::LogEntryParse parsed = archive::parse_log_entry(line.json);
    if (!parsed.entry) return;
    const auto* const entry = std::get_if<archive::PlanSealedEntry>(&parsed.entry->body);
    if (entry != nullptr && archive::is_signed_entry(home.log_folder, home.device, line.seq, tree.root()))
      seals.emplace(crypto::to_hex(entry->sha256), line.utc);
  });
  return seals;
}

/// Throws where the appliance log knows no such seal: a case must not name a plan that nobody sealed here.
void require_sealed(const ViewerContext& context, const std::string& plan) {
  if (!sealed_here(context).contains(plan))
    throw Refusal(409, "the appliance log knows no such plan: seal it here first, by kiroku plan seal");
}

/// As the appliance log has whoever acts on a recording, before it happens. A log that cannot be written is
/// told of, and keeps nobody from recording.
std::string who(const Request& request) {
  return request.session->user() + " (kiroku view, " + request.peer + ")";
}

/// What people ask of the rooms. Each entry of the appliance log is signed and flushed, so that one person's
/// askings that come to nothing must not fill it.
class RoomAskings {
 public:
  explicit RoomAskings(ViewerContext& context) : context_(context) {}

  /// Enters `what` of the case that the question names, else of `case_id`, and asks. What the recorder's
  /// state forbids is refused without an entry, and who was refused often waits.
  Response enter_and_ask(const Request& request, const std::string& case_id, const std::string& what,
                         const json& question) {
    const std::string& user = request.session->user();
    const auto now = context_.home().clock->now();
    if (const auto wait = refused_.wait(user, now); wait.count() > 0) {
      throw Refusal(429,
                    "refused too often: look at what the room does, and try again in " +
                        std::to_string(wait.count()) + " s",
                    wait);
    }
    try {
      require_possible(question);
      // Nobody is kept from starting and ending a recording, which takes its time by itself.
      const std::string& deed = question.at("do").get_ref<const std::string&>();
      if (deed != "start" && deed != "stop") context_.require_pace(request.session->person());
      context_.note_access(question.value("case", case_id), what, who(request));
      return ask(context_, question);
    } catch (const Refusal& refusal) {
      if (refusal.status() == 409) refused_.failed(user, now);
      throw;
    }
  }

 private:
  /// Throws where the recorder would refuse by what its room does now.
  void require_possible(const json& question) const {
    const std::string& name = question.at("room").get_ref<const std::string&>();
    const ordered_json status = answer_of_recorder(context_, {{"do", "status"}});
    for (const ordered_json& room : status.at("rooms")) {
      if (room.at("room") != name) continue;
      const std::string& state = room.at("state").get_ref<const std::string&>();
      const bool is_free = state == "idle" || state == "standby";
      const bool starts = question.at("do") == "start";
      if (starts && !is_free) throw Refusal(409, "room " + name + " is recording already");
      if (question.contains("case")) require_meant(question, room);
      // Stopping ends an operation between its cases, too.
      const bool ends_operation = question.at("do") == "stop" && room.value("tries_again", false);
      if (!starts && is_free && !ends_operation) throw Refusal(409, "room " + name + " is not recording");
      return;
    }
    throw Refusal(409, "there is no room named '" + name + "'");
  }

  /// Throws where the room has gone on to another case than the one that the question names, or to none. The
  /// room itself decides, in the same words; what it would refuse is no entry of the log.
  static void require_meant(const json& question, const ordered_json& room) {
    const std::string& name = question.at("room").get_ref<const std::string&>();
    const std::string& meant = question.at("case").get_ref<const std::string&>();
    const std::string& state = room.at("state").get_ref<const std::string&>();
    const std::string now = room.value("case", "");
    const bool stops = question.at("do") == "stop";
    const bool has_case = state == "recording" || state == "closing";
    const bool can = state == "recording" || (stops && (has_case || room.value("tries_again", false)));
    if (now != meant || !can) refuse_meant(name, meant, has_case ? now : "");
  }

  ViewerContext& context_;
  AttemptGuard refused_{{.free_failures = 20,
                         .first_wait = std::chrono::seconds(2),
                         .longest_wait = std::chrono::minutes(1),
                         .memory = std::chrono::minutes(2)}};
};

/// One press starts without a body; the rest can be said then or while the case runs.
Response start(ViewerContext& context, RoomAskings& askings, const Request& request) {
  const std::string& room = request.parameter("room");
  json question{{"do", "start"}, {"room", room}};
  if (!request.body.empty()) {
    const json asked = request.json();
    if (asked.contains("case"))
      throw Refusal(400, "'case' names one that runs, and a start begins another: leave it out");
    add_subject(question, asked, request);
    if (asked.contains("plan")) {
      const std::string plan = take_text(asked, "plan");
      const bool is_hash =
          plan.size() == kDigitsOfPlan && plan.find_first_not_of("0123456789abcdef") == std::string::npos;
      if (!is_hash) throw Refusal(400, "'plan' must be the hash of a sealed plan: 64 hexadecimal digits");
      require_sealed(context, plan);
      question["plan"] = plan;
      if (const auto digest = crypto::from_hex(plan)) {
        crypto::Sha256Digest seal{};
        std::ranges::copy(*digest, seal.begin());
        if (const auto file = compare::find_sealed_plan(context.home().plans_folder, seal))
          question["plan_patients"] = recorder::patients_of_plan(*file);
      }
    }
  }
  return askings.enter_and_ask(request, ViewerContext::kEveryCase, "asked to start recording in " + room,
                               question);
}

Response add_late_subject(ViewerContext& context, RoomAskings& askings, const Request& request) {
  const std::string& room = request.parameter("room");
  json question{{"do", "subject"}, {"room", room}};
  const json asked = request.json();
  add_subject(question, asked, request);
  add_meant_case(question, asked);
  if (!question.contains("subject") && !question.contains("procedure"))
    throw Refusal(400, "give a 'subject' or a 'procedure'");
  return askings.enter_and_ask(request, context.case_of(room), "gave patient and procedure of " + room,
                               question);
}

/// Plans that lie here and that the appliance log knows, newest first.
ordered_json plans_json(const ViewerContext& context) {
  const std::map<std::string, UtcTime> sealed = sealed_here(context);
  std::vector<std::pair<UtcTime, ordered_json>> plans;
  if (!sealed.empty()) {
    for (const compare::SealedPlanFile& plan : compare::sealed_plans(context.home().plans_folder)) {
      const std::string seal = crypto::to_hex(plan.seal);
      const auto found = sealed.find(seal);
      if (found == sealed.end()) continue;
      const std::string name = plan.name.empty() ? plan.file.filename().string() : plan.name;
      plans.emplace_back(found->second,
                         ordered_json{{"seal", seal}, {"name", name}, {"sealed", format_utc(found->second)}});
    }
  }
  std::ranges::stable_sort(plans, std::ranges::greater(), &std::pair<UtcTime, ordered_json>::first);
  ordered_json out = ordered_json::array();
  for (auto& [time, plan] : plans) out.push_back(std::move(plan));
  return out;
}

/// The hospital's list, which names patients: who looked at it is entered before it leaves.
Response procedures(ViewerContext& context, const Request& request) {
  const std::string& room = request.parameter("room");
  ordered_json listed = answer_of_recorder(context, {{"do", "procedures"}, {"room", room}});
  context.enter_access_once(request, ViewerContext::kEveryCase,
                            "looked at the planned procedures of " + room);
  for (ordered_json& procedure : listed["procedures"]) {
    // As the API says subjects everywhere.
    const auto subject = playback::read_subject(procedure.value("subject", ordered_json::object()).dump());
    procedure["subject"] = subject_json(subject.value_or(playback::CaseSubject{}));
  }
  listed["plans"] = plans_json(context);
  return Response::json(listed);
}

Response stop(ViewerContext& context, RoomAskings& askings, const Request& request) {
  const std::string& room = request.parameter("room");
  json question{{"do", "stop"}, {"room", room}, {"wait", false}};
  if (!request.body.empty()) add_meant_case(question, request.json());
  return askings.enter_and_ask(request, context.case_of(room), "asked to stop recording in " + room,
                               question);
}

/// The mark's words stay in the case, where they are sealed.
Response mark(ViewerContext& context, RoomAskings& askings, const Request& request) {
  const json asked = request.json();
  const auto text = asked.find("text");
  if (text == asked.end() || !text->is_string() || text->get_ref<const std::string&>().empty() ||
      text->get_ref<const std::string&>().size() > kLongestMark) {
    throw Refusal(400, "'text' must be a text of 1 to " + std::to_string(kLongestMark) + " bytes");
  }
  const std::string& room = request.parameter("room");
  json question{{"do", "mark"}, {"room", room}, {"text", *text}};
  add_meant_case(question, asked);
  return askings.enter_and_ask(request, context.case_of(room), "marked a moment in " + room, question);
}

/// In which form pictures are archived from here on. Why stays in the case, where it is sealed.
Response change_profile(ViewerContext& context, RoomAskings& askings, const Request& request) {
  const json asked = request.json();
  const std::string& room = request.parameter("room");
  json question{{"do", "profile"}, {"room", room}, {"by", request.session->user()}};
  question["profile"] = take_text(asked, "profile");
  add_meant_case(question, asked);
  for (const char* further : {"stream", "why"}) {
    if (!asked.contains(further)) continue;
    question[further] = take_text(asked, further);
    if (question[further].get_ref<const std::string&>().size() > kLongestMark)
      throw Refusal(
          400, std::string("'") + further + "' must have at most " + std::to_string(kLongestMark) + " bytes");
  }
  return askings.enter_and_ask(request, context.case_of(room),
                               "changed how pictures of " + room + " are archived", question);
}

}  // namespace

void add_room_routes(Router& router, ViewerContext& context) {
  const auto add = [&router](std::string method, std::string pattern, Right right, Handler handler,
                             bool is_activity = true) {
    Route route{std::move(method), std::move(pattern), right, std::move(handler), is_activity};
    // Whoever stands in the room does not wait for their own film.
    route.is_quick = true;
    router.add(std::move(route));
  };
  const auto askings = std::make_shared<RoomAskings>(context);
  add(
      "GET", "api/status", Right::kSeeLive,
      [&context](const Request& /*request*/) {
        return ask(context, {{"do", "status"}});
      },
      false);
  add("POST", "api/rooms/{room:name}/start", Right::kControlRooms,
      [&context, askings](const Request& request) { return start(context, *askings, request); });
  add("GET", "api/rooms/{room:name}/procedures", Right::kControlRooms,
      [&context](const Request& request) { return procedures(context, request); });
  add("POST", "api/rooms/{room:name}/subject", Right::kControlRooms,
      [&context, askings](const Request& request) { return add_late_subject(context, *askings, request); });
  add("POST", "api/rooms/{room:name}/stop", Right::kControlRooms,
      [&context, askings](const Request& request) { return stop(context, *askings, request); });
  add("POST", "api/rooms/{room:name}/mark", Right::kControlRooms,
      [&context, askings](const Request& request) { return mark(context, *askings, request); });
  add("POST", "api/rooms/{room:name}/profile", Right::kControlRooms,
      [&context, askings](const Request& request) { return change_profile(context, *askings, request); });
}

}  // namespace kiroku::viewer
