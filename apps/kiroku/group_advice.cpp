#include "apps/kiroku/group_advice.h"

#include "apps/kiroku/user_name.h"
#include "recorder/devices/plugged_devices.h"

namespace kiroku::apps {

std::optional<GroupAdvice> group_advice(const std::filesystem::path& device) {
  const auto group = recorder::missing_group(device);
  if (!group) return {};
  const std::string name = user_name();
  return GroupAdvice{
      "not examined: " + device.string() + " is for the group " + *group + ", in which " + name + " is not",
      "kirokud's unit has this group; to examine it by hand: sudo usermod -aG " + *group + " " + name +
          ", sign in anew, then run this again"};
}

}  // namespace kiroku::apps
