// Radiographs that were taken one after the other, as 'kiroku sim overlay' takes them: single files, a folder
// of files, a DICOM file of several pictures, or a film. An object belongs to one thread.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "sim/drr/ct_projector.h"
#include "sim/drr/picture.h"

namespace kiroku::apps {

/// A single radiograph: DICOM, .png or .mha; light where much attenuates. `polarity` is "bone-white" or
/// "bone-black"; without it a DICOM file's own counts, of others "bone-white". Errors of all that is read.
sim::ProjectionImage read_radiograph(const std::filesystem::path& file,
                                     const std::optional<std::string>& polarity);

struct TimedRadiograph {
  double time_s = 0;  // since the first
  sim::ProjectionImage image;
  std::string name;  // for people
};

class RadiographSeries {
 public:
  virtual ~RadiographSeries() = default;
  /// The next one; nothing at the end. What it throws names the file.
  virtual std::optional<TimedRadiograph> next() = 0;
  /// How many there are, where that is known before they are read.
  [[nodiscard]] virtual std::optional<std::size_t> count() const = 0;
};

/// `a_second` is how many pictures were taken a second. Of a folder (its DICOM, .png and .mha files in the
/// order of their names) it is 10 if absent; of what has times of its own it takes their place.
/// kiroku::UsageError where there is no radiograph; for a DICOM file of several pictures without times, where
/// it is absent.
std::unique_ptr<RadiographSeries> open_radiographs(const std::filesystem::path& path,
                                                   const std::optional<std::string>& polarity,
                                                   std::optional<double> a_second);

}  // namespace kiroku::apps
