#include "apps/kiroku/user_name.h"

#include <pwd.h>
#include <unistd.h>

namespace kiroku::apps {

std::string user_name() {
  const passwd* entry = ::getpwuid(::geteuid());
  return entry == nullptr ? "uid " + std::to_string(::geteuid()) : std::string(entry->pw_name);
}

}  // namespace kiroku::apps
