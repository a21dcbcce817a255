#include "recorder/vitals/hl7_refusal.h"

#include "base/ascii.h"

namespace kiroku::recorder {

std::optional<Hl7Refusal> refusal_of(const Hl7Message& message) {
  if (message.holds_another()) {
    return Hl7Refusal{"AE", "several-messages",
                      "several messages came in one frame; each one needs a frame of its own"};
  }
  const std::string mode = lower_case(message.header().field(11).component(1).text());
  if (mode == "t" || mode == "d") {
    return Hl7Refusal{"AR", "training-message",
                      "messages of training and debugging (MSH-11) are not taken here"};
  }
  // Without it, or with T, processing is current; I loads what is so now.
  const std::string restored = lower_case(message.header().field(11).component(2).text());
  if (restored == "a" || restored == "r") {
    return Hl7Refusal{
        "AR", "archived-message",
        "messages for or from an archive (MSH-11 is P^A or P^R) are not taken here: they tell of "
        "before"};
  }
  return std::nullopt;
}

}  // namespace kiroku::recorder
