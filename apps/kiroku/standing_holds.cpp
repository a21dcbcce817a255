#include "apps/kiroku/standing_holds.h"

#include <optional>

#include "apps/kiroku/witnessed_note.h"
#include "apps/verify/witness_judgement.h"
#include "crypto/signed_note.h"

namespace kiroku::apps {

archive::Holds standing_holds(const Home& home) {
  std::optional<crypto::Checkpoint> seen;
  if (const auto note = home_witnessed_note(home); note && is_of_log(*note, home.device()))
    seen = crypto::Checkpoint::parse(crypto::open_note(note->text, {home.device()}).text);
  return archive::read_holds(home.log_folder(), home.device(), seen);
}

}  // namespace kiroku::apps
