// Files of roots that a person named in the place of the home's. Not thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/kiroku/home.h"
#include "timestamp/token_verifier.h"

namespace kiroku::apps {

/// Of outside authorities, and of the recorder's own.
struct NamedRoots {
  std::vector<std::string> trust, own_authority;
  [[nodiscard]] bool empty() const { return trust.empty() && own_authority.empty(); }
};

/// --trust and --own-authority. `roots` must live until the program has run; `when` begins their help.
void add_root_options(Command& command, NamedRoots& roots, const std::string& when = "");

/// Those that are named; where none is, the home's, and without a home none. Throws kiroku::Error for files
/// that hold no certificates.
timestamp::TrustStore trust_of(const NamedRoots& roots, const std::optional<Home>& home);
/// The same by the name of a home, for commands that say nothing without roots: throws kiroku::UsageError
/// where none is named and there is no home.
timestamp::TrustStore required_trust(const NamedRoots& roots, const std::optional<std::string>& home);

}  // namespace kiroku::apps
