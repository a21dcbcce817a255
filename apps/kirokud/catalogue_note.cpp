#include "apps/kirokud/catalogue_note.h"

#include <exception>

#include <spdlog/spdlog.h>

#include "apps/kiroku/recording_setup.h"
#include "base/printable.h"

namespace kiroku::apps {

void tell_catalogue(const Home& home, const std::filesystem::path& folder) {
  try {
    refresh_catalogue(home, folder);
  } catch (const std::exception& error) {
    spdlog::warn("the catalogue does not know case {} yet: {}", folder.filename().string(),
                 printable(error.what()));
  }
}

}  // namespace kiroku::apps
