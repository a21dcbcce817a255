#include "apps/sim/volume_request.h"

namespace kiroku::apps {

void add_volume_options(Command& command, VolumeRequest& request) {
  command.argument("VOLUME", request.path,
                   "a folder of DICOM files, or .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd");
  command.option("--series", "UID", request.series,
                 "of a folder with several series: its UID, or how that ends");
  command.flag("--resample", request.resample,
               "resamples uneven gaps and a tilted gantry instead of refusing them");
  command.flag("--json", request.json, "prints one JSON object instead");
}

}  // namespace kiroku::apps
