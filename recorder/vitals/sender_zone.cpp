#include "recorder/vitals/sender_zone.h"

namespace kiroku::recorder {
namespace {

std::optional<Hl7Time> sent(const Hl7Message& message) {
  return parse_hl7_time(message.header().field(7).component(1).raw());
}

}  // namespace

std::optional<std::chrono::minutes> stated_zone(const Hl7Message& message) {
  const std::optional<Hl7Time> time = sent(message);
  return time ? time->zone : std::nullopt;
}

AssumedZone zone_of(const Hl7Message& message, const AssumedZone& assumed) {
  const std::optional<Hl7Time> time = sent(message);
  if (!time || !time->zone) return assumed;
  const UtcTime utc = time->local - *time->zone;
  return assumed.utc(time->local, utc) == utc ? assumed : AssumedZone(*time->zone);
}

}  // namespace kiroku::recorder
