#include <algorithm>

#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "viewer/api/api.h"
#include "viewer/api/meant_case.h"
#include "viewer/people/json_fields.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kLongestName = 64;
constexpr std::int64_t kMostMinutes = 12 * 60;

ordered_json text_or_null(const std::string& text) {
  return text.empty() ? ordered_json(nullptr) : ordered_json(text);
}

ordered_json invitation_json(const Invitation& invitation) {
  const Invitation::View view = invitation.view();
  const InvitationTerms& terms = invitation.terms();
  const auto left = std::chrono::ceil<std::chrono::seconds>(invitation.left());
  const bool has_ended = view.state == InvitationState::kEnded;
  ordered_json out{{"id", invitation.id()},
                   {"guest", terms.guest},
                   {"room", terms.room},
                   {"made_by", terms.made_by},
                   {"made", format_utc(invitation.made_at())},
                   {"ends", format_utc(invitation.ends_at())},
                   {"left_s", has_ended ? 0 : std::max<std::int64_t>(0, left.count())},
                   {"state", invitation_state_name(view.state)},
                   {"end", nullptr},
                   {"case", text_or_null(view.case_id)},
                   {"address", text_or_null(view.address)},
                   {"watches", view.is_present && !has_ended}};
  if (view.end) out["end"] = invitation_end_name(*view.end);
  return out;
}

Response list(ViewerContext& context) {
  ordered_json all = ordered_json::array();
  for (const auto& each : context.invitations().list()) all.push_back(invitation_json(*each));
  return Response::json({{"invitations", std::move(all)}});
}

/// A name as people write it, which stands in the appliance log.
std::string guest_of(const json& asked) {
  std::string name = take_text(asked, "guest");
  const bool is_blank = name.find_first_not_of(' ') == std::string::npos;
  if (is_blank || name.size() > kLongestName) {
    throw Refusal(400, "'guest' must be a name of 1 to " + std::to_string(kLongestName) + " bytes");
  }
  if (const auto character = first_unprintable(name)) {
    throw Refusal(400, "'guest' holds " + *character +
                           ", which is obeyed or cannot be seen where it is shown: write it without");
  }
  return name;
}

std::chrono::minutes duration_of(const json& asked) {
  const auto minutes = asked.find("minutes");
  if (minutes == asked.end() || !minutes->is_number_integer() || minutes->get<std::int64_t>() < 1 ||
      minutes->get<std::int64_t>() > kMostMinutes) {
    throw Refusal(400, "'minutes' must be from 1 to " + std::to_string(kMostMinutes));
  }
  return std::chrono::minutes(minutes->get<std::int64_t>());
}

Response invite(ViewerContext& context, const Request& request) {
  const json asked = request.json();
  InvitationTerms terms;
  terms.guest = guest_of(asked);
  terms.room = take_text(asked, "room");
  terms.lasts = duration_of(asked);
  terms.made_by = request.session->user();
  terms.credential = request.session->credential();
  const std::string room = terms.room;
  if (std::ranges::count(context.home().live.streams, room, &LiveStream::room) == 0) {
    throw Refusal(404, "there are no live pictures of a room " + room + " to invite anybody to");
  }
  const std::string running = context.running_case(room);
  // Whoever began to invite somebody to another one, or while none ran, does not show them this patient.
  const auto meant = meant_case(asked, true);
  if (meant && *meant != running) refuse_meant(room, *meant, running);
  const Invitations::Made made = context.invitations().make(std::move(terms), running);
  try {
    context.enter_access(request, running.empty() ? ViewerContext::kEveryCase : running,
                         "invites guest " + made.invitation->terms().guest + " to " + room + " until " +
                             format_utc(made.invitation->ends_at()) + " (invitation " +
                             made.invitation->id() + ")");
  } catch (const Refusal&) {
    context.invitations().revoke(made.invitation->id());
    throw;
  }
  ordered_json out = invitation_json(*made.invitation);
  out["token"] = made.token;
  return Response::json(out, 201);
}

Response revoke(ViewerContext& context, const Request& request) {
  const std::string& id = request.parameter("invitation");
  const std::shared_ptr<Invitation> invitation = context.invitations().find(id);
  context.require_pace(request.session->person());
  // It ends also where the log cannot say so: a door is closed first.
  if (!context.invitations().revoke(id)) throw Refusal(404, "no invitation " + id + " lasts");
  const InvitationTerms& terms = invitation->terms();
  context.enter_access(request, context.case_of(terms.room),
                       "revokes invitation " + id + " of guest " + terms.guest + " to " + terms.room);
  return Response::nothing();
}

}  // namespace

void add_invitation_routes(Router& router, ViewerContext& context) {
  router.add({"GET", "api/invitations", Right::kControlRooms,
              [&context](const Request& /*request*/) { return list(context); }, false});
  router.add("POST", "api/invitations", Right::kInvite,
             [&context](const Request& request) { return invite(context, request); });
  router.add("DELETE", "api/invitations/{invitation:name}", Right::kControlRooms,
             [&context](const Request& request) { return revoke(context, request); });
}

}  // namespace kiroku::viewer
