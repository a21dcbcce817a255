#!/usr/bin/env bash
# One static solve as a whole process (mesh read, result written) against CalculiX (SPOOLES, as many threads as cores) on the same nodes, tetrahedra
# and loads: a clamped beam of 6,561 and of 20,449 nodes; turn about, the median of the rounds. Goal: 5 times as fast. ROUNDS=5
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
command -v ccx >/dev/null || { echo "needs ccx: apt-get install calculix-ccx" >&2; exit 2; }
OMP_NUM_THREADS=$(nproc)
export OMP_NUM_THREADS

cd "$scratch"
for cells in 8 12; do
  size=$(python3 "$root/tests/bench/sim_beam.py" $cells .)
  ours=() theirs=()
  for ((round = 0; round < ${ROUNDS:-5}; ++round)); do
    ours+=("$(wall "$kiroku" sim solve beam.json -o beam.vtu)")
    theirs+=("$(wall ccx -i beam)")
  done
  ours_s=$(median "${ours[@]}") theirs_s=$(median "${theirs[@]}")
  echo "$size: kiroku sim solve $ours_s s (${ours[*]}), ccx $theirs_s s (${theirs[*]}), $(ratio "$theirs_s" "$ours_s") times as fast (goal 5)"
done
read -r cpu_s peak_kib _ < <(usage "$kiroku" sim solve beam.json -o beam.vtu)
echo "$size: kiroku sim solve takes $cpu_s s of CPU and $((peak_kib / 1024)) MiB at its peak"
read -r cpu_s peak_kib _ < <(usage ccx -i beam)
echo "$size: ccx takes $cpu_s s of CPU and $((peak_kib / 1024)) MiB at its peak"
