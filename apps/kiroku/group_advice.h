// What to say of a device that is for a group in which the user is not. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace kiroku::apps {

struct GroupAdvice {
  std::string finding;  // "not examined: /dev/video0 is for the group video, in which anna is not"
  std::string advice;
};
/// Nothing where a group is not what lacks. kirokud's unit has the groups; whoever runs a command by hand may
/// lack them.
std::optional<GroupAdvice> group_advice(const std::filesystem::path& device);

}  // namespace kiroku::apps
