// Whether a search found the organ, and why not. Functions are pure and thread-safe.
#pragma once

#include <optional>
#include <vector>

#include "sim/align/organ_track.h"
#include "sim/align/outline_fit.h"

namespace kiroku::sim {

/// Less of an outline free of cover says nothing of a place: under cover, each outline fits.
inline constexpr double kSeenOfOutline = 0.5;
inline bool is_covered(const OutlineFit& fit) { return fit.seen < kSeenOfOutline; }

/// Whether the place explains what is seen of its outline.
bool explains(const OutlineFit& fit);

/// Whether enough of the whole outline, covered or not, lies along a border for a place to be found anew.
bool is_borne_out(const OutlineFit& fit);

struct SearchVerdict {
  WhyLost why = WhyLost::kNoOrgan;
  std::optional<OutlineFit> best;  // none where no place shows enough of its outline
  double rival_px = 0;             // misfit of what spoke against the best, or of the next best; 0 for none
};

/// The mirror image, left for right, in which no place may explain what is seen as well.
Picture mirrored(const Picture& picture);

/// `fits` and `mirrors`: the places found in a picture and in its mirror image, the best first. A place in
/// the mirror image refuses the picture wherever it stands in its order: places under cover may stand before
/// it.
SearchVerdict verdict_of(std::vector<OutlineFit> fits, std::vector<OutlineFit> mirrors);

}  // namespace kiroku::sim
