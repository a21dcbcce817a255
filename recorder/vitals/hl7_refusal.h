// Messages of which nothing may be taken, whatever they say: neither vital signs nor who is in a room. Pure
// functions, thread-safe.
#pragma once

#include <optional>
#include <string>

#include "recorder/vitals/hl7_message.h"

namespace kiroku::recorder {

struct Hl7Refusal {
  std::string code;  // of the acknowledgement: "AE", "AR"
  std::string name;  // "several-messages", "training-message", "archived-message"
  std::string why;   // nothing of what the message says is in it
};

/// AE for several messages in one frame: what the first one says would be taken to be of all their patients,
/// and one acknowledgement cannot answer for all. AR for training and debugging (MSH-11 is T or D): their
/// patients are not real. AR for what goes into an archive or is restored from one (MSH-11 is P^A or P^R): it
/// is none of now.
std::optional<Hl7Refusal> refusal_of(const Hl7Message& message);

}  // namespace kiroku::recorder
