// Pictures of an object that fingertips lift, coloured by stress. In software: the same bytes each time.
// Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "sim/render/picture.h"
#include "trainer/exclusion/lifted_object.h"

namespace kiroku::trainer {

/// 320 x 200: from the trainee's side and below, where fingertips press; these are half transparent. Colours
/// are viridis from 0 to `top_pa`. kiroku::Error as SurfaceRenderer.
sim::Picture picture_from_below(const sim::TetMesh& mesh, const ExclusionTask& task,
                                const LiftedObject& lifted, double top_pa);

/// 480 x 300: from above, the upper half taken away along the plane through `on_plane_m` across the way the
/// object is lifted.
sim::Picture picture_cut_open(const sim::TetMesh& mesh, const ExclusionTask& task, const LiftedObject& lifted,
                              double top_pa, const sim::Vector3& on_plane_m);

/// Pictures of one size side by side, `columns` in a row, each with its caption below; cells without a
/// picture stay dark. The last cell of all that is empty, or the last picture, shows the scale.
/// kiroku::UsageError without pictures, and where their sizes differ.
struct CaptionedPicture {
  std::string caption;
  sim::Picture picture;  // without pixels: the cell stays empty
};
sim::Picture sheet_of(const std::vector<CaptionedPicture>& cells, std::size_t columns, double top_pa);

}  // namespace kiroku::trainer
