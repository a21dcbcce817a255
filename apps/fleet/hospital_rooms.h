// All rooms of all appliances for the hospital's page: rows of the catalogue's database.
#pragma once

#include "apps/fleet/fleet_configuration.h"
#include "apps/fleet/shared_reports.h"
#include "viewer/api/fleet_rooms.h"

namespace kiroku::apps {

/// Thread-safe.
class HospitalRooms final : public viewer::FleetRooms {
 public:
  /// `configuration` must outlive it. Throws fleet::DatabaseError, kiroku::UsageError.
  explicit HospitalRooms(const FleetConfiguration& configuration)
      : configuration_(configuration), reports_(configuration) {}

  nlohmann::ordered_json rooms() override;
  Asked asked(const std::string& code) override;
  void enrol(const std::string& code, const std::string& by) override;
  bool revoke(const std::string& appliance) override;

 private:
  template <typename Work>
  auto with_reports(const Work& work);

  const FleetConfiguration& configuration_;
  SharedReports reports_;
};

}  // namespace kiroku::apps
