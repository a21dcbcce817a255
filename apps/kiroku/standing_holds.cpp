#include "apps/kiroku/standing_holds.h"

#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/witnessed_note.h"

namespace kiroku::apps {

archive::Holds standing_holds(const Home& home) {
  // What the log itself shows says more than that it is another one.
  archive::Holds holds =
      archive::read_holds(home.log_folder(), home.device(), home_witnessed_checkpoint(home));
  require_same_log(home);
  return holds;
}

}  // namespace kiroku::apps
