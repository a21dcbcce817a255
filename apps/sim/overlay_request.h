// What 'kiroku sim overlay' was asked for, of one radiograph and of a series.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/sim/drr_request.h"
#include "apps/sim/tumour_path.h"
#include "sim/drr/overlay.h"

namespace kiroku::apps {

struct OverlayRequest {
  DrrRequest drr;
  std::string output;
  std::optional<std::string> radiograph, series;  // one of them
  std::optional<std::string> mode, opacity, polarity, outline, path, measured, aligned, plot;
  std::optional<std::string> frames, rate, start, seen, table;  // of a series
  bool align = false, repeat = false, force = false;
};

inline constexpr sim::Colour kOutlineColour{255, 200, 0}, kPathColour{255, 70, 70},
    kMeasuredColour{90, 255, 90};

sim::OverlayMode mode_of(const OverlayRequest& request);
/// kiroku::UsageError for what is no part.
double opacity_of(const OverlayRequest& request);
/// The region to outline; nothing where none is asked for. kiroku::UsageError, with those that are there, for
/// one that the mesh does not have.
std::optional<std::int32_t> outlined_region(const OverlayRequest& request, const sim::TetMesh& mesh);
/// On the radiograph, and on the DRR beside it where the picture is wider than one.
void draw_on_both(sim::ColourPicture& picture, const std::vector<sim::PixelLine>& lines,
                  const sim::Colour& colour, std::size_t columns);

/// Over a series of radiographs, as a film with a table; an exit status.
int overlay_series(const OverlayRequest& request);

}  // namespace kiroku::apps
