#!/usr/bin/env bash
# Watching a case: transcoding on one core against real time, seeking, the first picture of ten hours, vital signs of ten hours. Goals: more than 3 times
# real time for 720p MPEG-2; 95 of 100 seeks within 800 ms, within 300 ms where the piece is cached; first picture within 1 s; 200 ms at 1,000 bins.
# Give parts of it by name: pieces, first, vitals.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
bench=$root/build/release/tests/bench/playback_bench
[[ -x $bench ]] || { echo "no program at $bench: cmake --build --preset release --target playback_bench" >&2; exit 2; }
wanted=${*:-pieces first vitals}
"$kiroku" init --demo >/dev/null
identity=$KIROKU_HOME/identity.txt
record() { "$kiroku" record "$@" --json | jq -r .case; }
if [[ $wanted == *pieces* ]]; then
  # A moving view into a body with noise, at 4 Mbit/s: what an endoscope gives the encoder to do.
  case=$(record --endoscope 'synthetic:endoscope?size=1280x720&rate=25&speed=max' --duration 00:01:00)
  echo "720p25 MPEG-2, on one core:"
  taskset -c 0 "$bench" pieces "$case" endoscope "$identity" | head -1
  echo "on $(nproc) cores:"
  "$bench" pieces "$case" endoscope "$identity"
fi
if [[ $wanted == *first* ]]; then
  case=$(record --duration 10:00:00 --endoscope 'synthetic:pattern?size=64x48&rate=5&speed=max' \
    --room 'synthetic:pattern?size=64x48&rate=5&speed=max' --vitals 'synthetic:patient?waves=0&speed=max')
  "$bench" first "$case" endoscope "$identity"
fi
if [[ $wanted == *vitals* ]]; then
  "$bench" vitals
fi
