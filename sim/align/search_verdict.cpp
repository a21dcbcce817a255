#include "sim/align/search_verdict.h"

#include <algorithm>

namespace kiroku::sim {
namespace {

constexpr double kMisfitPx = 3, kSupported = 0.75, kAgreement = 0.75, kShare = 0.5;
// Another place is worse where its misfit is so much larger.
constexpr double kRivalRatio = 1.25, kRivalPx = 0.25;

bool rivals(const OutlineFit& other, const OutlineFit& best) {
  return other.misfit_px <= kRivalRatio * best.misfit_px + kRivalPx;
}

}  // namespace

Picture mirrored(const Picture& picture) {
  Picture mirror(picture.width, picture.height);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x)
      std::copy_n(picture.pixel(picture.width - 1 - x, y), 3, mirror.pixel(x, y));
  }
  return mirror;
}

bool explains(const OutlineFit& fit) {
  return fit.misfit_px <= kMisfitPx && fit.supported >= kSupported && fit.agreement >= kAgreement &&
         fit.share_in_picture >= kShare && !is_covered(fit);
}

bool is_borne_out(const OutlineFit& fit) {
  constexpr double kOfWhole = 0.5;
  return fit.supported * fit.seen >= kOfWhole;
}

SearchVerdict verdict_of(std::vector<OutlineFit> fits, std::vector<OutlineFit> mirrors) {
  std::erase_if(fits, is_covered);
  std::erase_if(mirrors, is_covered);
  SearchVerdict verdict;
  if (fits.empty()) return verdict;
  verdict.best = fits.front();
  if (fits.size() > 1) verdict.rival_px = fits[1].misfit_px;
  const auto mirror = std::ranges::find_if(
      mirrors, [&](const OutlineFit& other) { return explains(other) && rivals(other, fits.front()); });
  if (mirror != mirrors.end()) {
    verdict.why = WhyLost::kMirrored;
    verdict.rival_px = mirror->misfit_px;
  } else if (explains(fits.front()) && is_borne_out(fits.front())) {
    verdict.why = fits.size() > 1 && rivals(fits[1], fits.front()) ? WhyLost::kAlike : WhyLost::kNotLost;
  }
  return verdict;
}

}  // namespace kiroku::sim
