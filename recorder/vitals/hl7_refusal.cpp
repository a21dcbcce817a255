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
  return std::nullopt;
}

}  // namespace kiroku::recorder
