// Written consent to the use of cases, as whoever takes something out of one is bound by it
// (docs/how-to/consent.md). The functions are thread-safe.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "archive/upkeep/consents.h"

namespace kiroku::viewer {

/// [consent] of kiroku.toml.
struct SitePurposes {
  std::vector<std::string> names;
  /// Nothing leaves without one of them.
  bool are_demanded = false;
};

/// Both are asked anew each time, since file and log change while a viewer runs. Null functions: the site has
/// no purposes, and nobody consented to anything.
struct SiteConsent {
  std::function<SitePurposes()> purposes;       // throws kiroku::Error
  std::function<archive::Consents()> consents;  // throws kiroku::Error where nobody can tell
};

}  // namespace kiroku::viewer
