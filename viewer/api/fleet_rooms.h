// Rooms of many appliances that report to a hospital, as its page shows them. Who has them is no part of the
// viewer (apps/fleet).
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace kiroku::viewer {

/// Implementations are thread-safe. All functions throw Refusal (503) where the database is away, and
/// kiroku::Error.
class FleetRooms {
 public:
  virtual ~FleetRooms() = default;

  /// FleetRooms of openapi.json: what needs a person first.
  virtual nlohmann::ordered_json rooms() = 0;

  /// An appliance that asked to be enrolled.
  struct Asked {
    std::string appliance;
    std::string fingerprint;  // of its request
  };
  /// The one that shows this code. Throws kiroku::UsageError where none does, or too many were wrong.
  virtual Asked asked(const std::string& code) = 0;
  /// It may report from now on.
  virtual void enrol(const std::string& code, const std::string& by) = 0;
  /// No certificate of this name counts any more; false where none is enrolled.
  virtual bool revoke(const std::string& appliance) = 0;
};

}  // namespace kiroku::viewer
