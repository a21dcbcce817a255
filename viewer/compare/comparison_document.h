// A comparison as a document that can be sealed (docs/reference/format-plans.md, "Comparisons"): JSON, and
// the same for people as one HTML file. Pure functions, thread-safe.
#pragma once

#include <string>
#include <vector>

#include "base/bytes.h"
#include "viewer/compare/comparison.h"
#include "viewer/kept/provenance.h"

namespace kiroku::compare {

std::string comparison_json(const Comparison& comparison, const sim::Plan& plan, const Provenance& made);

/// A picture of a moment, for the page.
struct StillPicture {
  std::string caption;
  Bytes png;
};
/// One file, nothing loaded from elsewhere; English.
std::string comparison_html(const Comparison& comparison, const sim::Plan& plan, const Provenance& made,
                            const std::vector<StillPicture>& stills);

}  // namespace kiroku::compare
