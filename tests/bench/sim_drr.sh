#!/usr/bin/env bash
# Radiographs of 512 x 512 pixels computed from a CT, a series of 36 on two threads: the CT as it is from 36 angles; what is in a mesh of its lungs and of
# its whole body, 5,000 vertices each, deformed anew for each of 36 frames from four sides, alone and with what is outside. Each beside plastimatch's
# "exact" for the CT as it is (there is no peer that deforms), in one run, medians of
# three; goals 4, 12 and 4 times as fast. Needs plastimatch, the target sim_drr_bench, and a CT of 256^3 voxels around the origin (.mha):  CT=FILE tests/bench/sim_drr.sh
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
[[ -n ${CT:-} ]] || { echo "set CT to a volume around the origin (.mha)" >&2; exit 2; }
command -v plastimatch >/dev/null || { echo "plastimatch is not installed" >&2; exit 2; }
bench=${KIROKU_BENCH:-$root/build/release/tests/bench}/sim_drr_bench
[[ -x $bench ]] || { echo "no program at $bench: build the target sim_drr_bench" >&2; exit 2; }
threads=${THREADS:-2}
export OMP_NUM_THREADS=$threads KIROKU_BENCH_THREADS=$threads

"$kiroku" sim mesh "$CT" --organ lung --vertices 5000 -o "$scratch/lung.msh" >"$scratch/lung.txt" 2>/dev/null
"$kiroku" sim mesh "$CT" --threshold -200:3000 --vertices 5000 -o "$scratch/body.msh" >"$scratch/body.txt" 2>/dev/null
head -1 "$scratch/lung.txt" "$scratch/body.txt" | grep vertices | sed 's|^.*/||'

peer() {
  plastimatch drr -A cpu -i exact -y 0 -N 10 -a 36 --isocenter "0 0 0" --sad 1000 --sid 1500 -r "512 512" -z "600 600" -P preprocess -t pfm \
    -O "$scratch/peer_" "$CT" | sed -n 's/^Total time: *\([0-9.]*\).*/\1/p'
}
declare -A seconds
for run in 1 2 3; do
  peer_s=$(peer | awk '{ print $1 / 36 }')
  seconds[peer]+=" $peer_s"
  seconds[ct]+=" $("$bench" "$CT")"
  seconds[lung]+=" $("$bench" "$CT" "$scratch/lung.msh")"
  seconds[lung-all]+=" $("$bench" "$CT" "$scratch/lung.msh" all)"
  seconds[body]+=" $("$bench" "$CT" "$scratch/body.msh")"
done
# shellcheck disable=SC2086
for what in peer ct lung lung-all body; do seconds[$what]=$(median ${seconds[$what]}); done
for what in ct lung lung-all body; do
  echo "$what: ${seconds[$what]} s a frame, plastimatch ${seconds[peer]} s, $(ratio "${seconds[peer]}" "${seconds[$what]}") times as fast"
done
