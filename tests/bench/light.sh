#!/usr/bin/env bash
# How well a display's codes are read at 2 % of the picture's height, and false readings in films without a display.
#   tests/bench/light.sh SECONDS PICTURES FILM...   SECONDS of each condition; PICTURES of the films, shared among the cores, each share with a seed of
#                                                   its own. Goals: 99 % of seconds, and no false reading in 100,000 pictures.
# Exit status: 1 where a picture was read falsely.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
(($# >= 3)) || { sed -n '2,5s/^# //p' "${BASH_SOURCE[0]}" >&2; exit 2; }
bench=build/release/tests/bench/light_bench
[[ -x $bench ]] || { echo "no program at $bench: cmake --build --preset release --target light_bench" >&2; exit 2; }
seconds=$1 pictures=$2
shift 2
"$bench" "$seconds" 21.6
cores=$(nproc)
part=$(((pictures + cores - 1) / cores))
seq "$cores" | xargs -P "$cores" -I{} "$bench" --false "$part" {} "$@" | tee /dev/stderr | awk '
  { gsub(",", ""); pictures += $2; for (i = 1; i < NF; ++i) if ($i ~ /^(agree|old|foreign)$/) wrong += $(i + 1) }
  END { printf "%d pictures, %d false readings\n", pictures, wrong; exit wrong > 0 }'
