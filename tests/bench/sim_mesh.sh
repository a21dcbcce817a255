#!/usr/bin/env bash
# A mesh of a real lung as a whole process: 133 DICOM pictures and a label map read, refined until the number of vertices is met, slivers removed,
# written. Time, CPU and peak memory for 600, 5,000 and 20,000 vertices; goal for the last: 15 s and 2 GB. Needs a folder of DICOM files and the
# labels of TotalSegmentator:  CT=FOLDER LABELS=FILE [ORGAN=lung] [VERTICES="600 5000 20000"] tests/bench/sim_mesh.sh
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
[[ -n ${CT:-} && -n ${LABELS:-} ]] || { echo "set CT to a folder of DICOM files, LABELS to their segmentation" >&2; exit 2; }

for vertices in ${VERTICES:-600 5000 20000}; do
  read -r cpu_s peak_kib wall_s < <(usage "$kiroku" sim mesh "$CT" --labels "$LABELS" --organ "${ORGAN:-lung}" --vertices "$vertices" -o "$scratch/mesh.msh")
  made=$(awk '/^\$Nodes/ { getline; print; exit }' "$scratch/mesh.msh")
  echo "$vertices vertices wanted, $made made: $wall_s s ($cpu_s s of CPU), peak memory $((peak_kib / 1024)) MiB"
done
