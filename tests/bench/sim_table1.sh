#!/usr/bin/env bash
# Table 1 of the paper on interactive volume manipulation: frames a second of simulation and shading together, for four organs, without a graphics
# processor or (GPU=yes) on one, while something moves and at rest, each beside OSMesa's picture at rest. Needs a folder of DICOM files and the labels of TotalSegmentator, as of
# LIDC-IDRI-0001:
#   CT=FOLDER LABELS=FILE [GPU=yes] [SECONDS_EACH=5] [PICTURES=FOLDER] tests/bench/sim_table1.sh
# Its last line is what docs/results/record.py takes:
#   docs/results/record.py sim-table1 --machine NAME $(CT=… LABELS=… tests/bench/sim_table1.sh | tail -1)
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
bench=$root/build/release/tests/bench/sim_table1_bench
[[ -x $bench ]] || { echo "no program at $bench: ninja -C build/release sim_table1_bench" >&2; exit 2; }
[[ -n ${CT:-} && -n ${LABELS:-} ]] || { echo "set CT to a folder of DICOM files, LABELS to their segmentation" >&2; exit 2; }
scratch=$(mktemp -d "${KIROKU_BENCH_DIR:-${TMPDIR:-/tmp}}/kiroku-bench.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
pictures=${PICTURES:-$scratch}
mkdir -p "$pictures"
engine=(--gpu off)
[[ ${GPU:-no} == yes ]] && engine=(--gpu auto --engine opengl)

figures=
for organ in liver right-kidney breast right-lung; do
  "$bench" "$organ" --ct "$CT" --labels "$LABELS" "${engine[@]}" --seconds "${SECONDS_EACH:-5}" \
    --picture "$pictures/$organ.png" --reference "$pictures/$organ-osmesa.png" | tee "$scratch/said"
  figures+=" $(grep -oE '\b(fps|cpu|still_fps|still_cpu|vertices|ssim|still_ssim|differing)=[0-9.]+' "$scratch/said" | sed "s/^/${organ#right-}_/" | tr '\n' ' ')"
done
echo $figures
