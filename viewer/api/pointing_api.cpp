#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "viewer/api/api.h"
#include "viewer/api/guest_output.h"
#include "viewer/api/meant_case.h"
#include "viewer/rooms/point_rate.h"
#include "viewer/rooms/room_company.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kLongestPointMessage = 512;
constexpr double kLatestPointNs = 9007199254740992;  // the format's integers

double part_of(const json& message, const char* key) {
  const auto found = message.find(key);
  if (found == message.end() || !found->is_number())
    throw Refusal(400, std::string("'") + key + "' is missing");
  const double part = found->get<double>();
  if (!(part >= 0 && part <= 1)) {
    throw Refusal(400, std::string("'") + key + "' must be a part of the picture, from 0 to 1");
  }
  return part;
}

std::int64_t case_time_of(const json& number) {
  // As a floating-point number first: what no 64 bits hold must not wrap around.
  if (!number.is_number_integer() || std::abs(number.get<double>()) > kLatestPointNs) {
    throw Refusal(400, "'picture_ns' is no time of a case");
  }
  return number.get<std::int64_t>();
}

/// A browser in a room: hears who is there and where they point, and points.
class CompanySocket final : public SocketHandler {
 public:
  CompanySocket(ViewerContext& context, RoomCompany& company, PointRates& rates, const Request& request,
                std::shared_ptr<SocketOutput> output)
      : clock_(*context.home().clock),
        rooms_(context.home().rooms),
        room_(request.parameter("room")),
        guest_(GuestPresence::of(context, request, room_)),
        streams_(streams_of(context, room_)),
        by_(guest_ ? request.session->invitation()->terms().guest : request.session->user()),
        role_(role_name(request.session->role())),
        rate_(rates.of(request.session->person(), clock_.now())),
        seat_(company.join(room_, {by_, role_, std::move(output), [this] { return is_admitted(); }})) {}

  void receive(const SocketMessage& message) override {
    if (!rate_->take(clock_.now())) return;
    const json said = parse_foreign_json(text_of(message.bytes));
    if (!message.is_text || !said.is_object()) throw Refusal(400, "a message is one JSON object");
    const media::PointedAt at = pointed_at(said);
    const std::string meant = meant_case(said).value_or("");
    if (!is_admitted()) return;
    // Shown is only what is in the case, or counted there as dropped. A hand that is still held down when the
    // next patient's begins, and a guest of the one before, point at nothing.
    const std::optional<std::int64_t> time_ns = rooms_.point(room_, at, guest_ ? guest_->case_id() : meant);
    if (!time_ns) return;
    seat_->tell(ordered_json{{"pointer",
                              {{"by", at.by},
                               {"role", at.role},
                               {"stream", at.stream},
                               {"x", at.x},
                               {"y", at.y},
                               {"time_ns", *time_ns}}}}
                    .dump());
  }

 private:
  static std::vector<std::string> streams_of(const ViewerContext& context, const std::string& room) {
    std::vector<std::string> names;
    for (const LiveStream& each : context.home().live.streams) {
      if (each.room == room) names.push_back(each.stream);
    }
    if (names.empty()) throw Refusal(404, "there are no live pictures of a room " + room);
    return names;
  }
  [[nodiscard]] bool is_admitted() const { return !guest_ || guest_->is_admitted(); }
  [[nodiscard]] media::PointedAt pointed_at(const json& said) const {
    media::PointedAt at;
    at.by = by_;
    at.role = role_;
    const auto stream = said.find("stream");
    if (stream != said.end() && stream->is_string()) at.stream = stream->get<std::string>();
    if (std::ranges::count(streams_, at.stream) == 0) {
      throw Refusal(400, "'stream' names no pictures of this room");
    }
    at.x = part_of(said, "x");
    at.y = part_of(said, "y");
    if (const auto picture = said.find("picture_ns"); picture != said.end()) {
      at.picture_ns = case_time_of(*picture);
    }
    return at;
  }

  const Clock& clock_;
  const LiveRooms& rooms_;
  const std::string room_;
  const std::unique_ptr<GuestPresence> guest_;
  const std::vector<std::string> streams_;
  const std::string by_, role_;
  const std::shared_ptr<PointRates::Shared> rate_;
  const std::unique_ptr<RoomCompany::Seat> seat_;  // last: calls what is above
};

}  // namespace

void add_pointing_routes(Router& router, ViewerContext& context) {
  const auto company = std::make_shared<RoomCompany>();
  const auto rates = std::make_shared<PointRates>();
  Route route;
  route.method = "GET";
  route.pattern = "api/live/{room:name}";
  route.right = Right::kWatchRoom;
  route.body_limit = kLongestPointMessage;
  route.socket = [&context, company, rates](const Request& request, std::shared_ptr<SocketOutput> output) {
    return std::make_unique<CompanySocket>(context, *company, *rates, request, std::move(output));
  };
  router.add(std::move(route));
}

}  // namespace kiroku::viewer
