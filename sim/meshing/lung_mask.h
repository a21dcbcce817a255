// The lungs of a CT without a segmentation, by their air. Pure, thread-safe.
//
// Source: thresholding, connected parts and an airway grown until it leaks, as in Hu, Hoffman and Reinhardt,
// "Automatic Lung Segmentation for Accurate Quantitation of Volumetric X-Ray CT Images", IEEE TMI 20(6),
// 2001, and Mori et al., "Automated Extraction and Visualization of Bronchus from 3D CT Images of Lung",
// CVRMed 1995.
#pragma once

#include "sim/volume/volume.h"

namespace kiroku::sim {

struct LungMask {
  LabelMap map;           // 1 in the lungs
  std::size_t lungs = 0;  // 2, or 1 where they touch or one is not there
  double airway_ml = 0;   // of windpipe and bronchi, left out; 0 where none was found
};

/// What is below -400 HU and does not reach the sides of the volume; without windpipe and large bronchi; the
/// largest part, and the second if it is a tenth of that at least; vessels that it encloses in a slice belong
/// to it. A consolidated lung, or a tumour at its border, is not air and stays outside; so does a lung that
/// reaches the sides, as in a volume cropped to it. kiroku::Error where there is no such air, or the slices
/// (k) are not axial.
LungMask find_lungs(const Volume& volume);

}  // namespace kiroku::sim
