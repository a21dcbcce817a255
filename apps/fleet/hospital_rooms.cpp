#include "apps/fleet/hospital_rooms.h"

#include <nlohmann/json.hpp>

#include "apps/fleet/enrolling.h"
#include "fleet/catalogue/room_board.h"
#include "viewer/http/request.h"

namespace kiroku::apps {
namespace {

constexpr int kNoDatabase = 503;
constexpr std::chrono::seconds kAskAgain{10};

}  // namespace

template <typename Work>
auto HospitalRooms::with_reports(const Work& work) {
  try {
    return reports_.with(work);
  } catch (const fleet::DatabaseError& error) {
    if (!error.passes()) throw;
    throw viewer::Refusal(kNoDatabase, error.what(), kAskAgain);
  }
}

nlohmann::ordered_json HospitalRooms::rooms() {
  return with_reports([](fleet::FleetReports& reports) {
    const UtcTime now = reports.now();
    return fleet::board_json(fleet::board_of(reports.appliances(), now), reports.not_enrolled(), now);
  });
}

viewer::FleetRooms::Asked HospitalRooms::asked(const std::string& code) {
  const fleet::FleetAuthority authority = fleet::FleetAuthority::open(configuration_.authority);
  const fleet::PendingEnrolment found =
      with_reports([&](fleet::FleetReports& reports) { return request_of_code(reports, authority, code); });
  return {found.appliance, fleet::request_fingerprint(found.request_pem)};
}

void HospitalRooms::enrol(const std::string& code, const std::string& by) {
  const fleet::FleetAuthority authority = fleet::FleetAuthority::open(configuration_.authority);
  with_reports([&](fleet::FleetReports& reports) {
    admit_request(reports, authority, request_of_code(reports, authority, code), configuration_, by);
  });
}

bool HospitalRooms::revoke(const std::string& appliance) {
  return with_reports([&](fleet::FleetReports& reports) { return reports.revoke(appliance); });
}

}  // namespace kiroku::apps
