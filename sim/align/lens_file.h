// A lens as OpenCV's FileStorage has it (YAML, XML or JSON), as its calibration programs write it:
// camera_matrix (3 x 3), distortion_coefficients, image_width, image_height, and fisheye_model where that is
// not 0. Pure functions, thread-safe.
#pragma once

#include <string>
#include <string_view>

#include "sim/render/lens.h"

namespace kiroku::sim {

/// kiroku::UsageError in a sentence that begins with `name`, for what is no calibration, and for one whose
/// model has more coefficients than LensCalibration.
LensCalibration read_lens_calibration(std::string_view text, const std::string& name);

/// As read_lens_calibration() reads it, to the bit. `form`: ".yml", ".yaml", ".xml" or ".json". `rms_px` and
/// `pictures` are written as OpenCV's programs do: avg_reprojection_error and nr_of_frames.
std::string lens_calibration_text(const LensCalibration& lens, double rms_px, std::size_t pictures,
                                  const std::string& form);

}  // namespace kiroku::sim
