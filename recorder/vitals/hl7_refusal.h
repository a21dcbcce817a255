// Messages of which nothing may be taken, whatever they say: neither vital signs nor who is in a room. Pure
// functions, thread-safe.
#pragma once

#include <optional>
#include <string>

#include "recorder/vitals/hl7_message.h"

namespace kiroku::recorder {

struct Hl7Refusal {
  std::string code;  // of the acknowledgement: "AE", "AR"
  std::string name;  // "several-messages", "training-message"
  std::string why;   // nothing of what the message says is in it
};

/// AE for several messages in one frame: what the first one says would be taken to be of all their patients,
/// and one acknowledgement cannot answer for all. AR for training and debugging (MSH-11 is T or D): their
/// patients are not real.
std::optional<Hl7Refusal> refusal_of(const Hl7Message& message);

}  // namespace kiroku::recorder
