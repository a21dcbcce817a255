// Whether the streams of a room deliver, by what the running kirokud says of them. Pure functions,
// thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string_view>

#include <nlohmann/json.hpp>

namespace kiroku::apps {

/// As the page of the recorder and the fleet count: monitors speak once a few seconds.
inline constexpr std::int64_t kSilentVideo_ms = 3'000, kSilentVitals_ms = 10'000;

/// Of a room in such a state every source is held, and is to deliver: of a case, or ahead of one.
inline bool holds_sources(std::string_view state) { return state == "recording" || state == "standby"; }

/// Of one of `streams` of a room whose sources are held. What has just begun is still being opened.
inline bool is_silent(const nlohmann::json& stream) {
  const std::int64_t age_ms = stream.value("age_ms", std::int64_t{0});
  const std::int64_t may_be_ms = stream.value("kind", "") == "vitals" ? kSilentVitals_ms : kSilentVideo_ms;
  return age_ms >= (stream.value("live", false) ? may_be_ms : kSilentVideo_ms);
}

}  // namespace kiroku::apps
