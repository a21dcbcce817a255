#!/usr/bin/env bash
# A day in shortened time, and a year's cases: memory, descriptors and threads must be flat, every case intact.
#   tests/fault/soak.sh 24 200        so many hours in one case, recorded as fast as sources deliver (two videos of tiny pictures at five a second, vital signs);
#                                     then so many cases of seconds by one kirokud, which `kiroku status` and /metrics are asked all the time
# Exit status: 0 it holds, 1 it does not, 77 where a tool is missing.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
kiroku=${KIROKU:-$root/build/release/apps/kiroku}
hours=${1:-24} cases=${2:-200}
[[ -x $kiroku ]] || { echo "no program at $kiroku: run deploy/test first" >&2; exit 2; }
for tool in jq curl; do command -v $tool >/dev/null || { echo "SKIPPED: $tool is not installed"; exit 77; }; done
scratch=$(mktemp -d "${TMPDIR:-/tmp}/kiroku-soak.XXXXXX")
export KIROKU_HOME=$scratch/home
source "$root/tests/support/daemon.sh"
trap '[[ -z $recorder ]] || kill "$recorder" 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$scratch"' EXIT
port=$((20000 + RANDOM % 10000))
needs() { # PROCESS: a line of MiB, descriptors, threads
  awk '/VmRSS/ { print $2 / 1024 }' "/proc/$1/status" | paste -d' ' - <(find "/proc/$1/fd" | wc -l) <(find "/proc/$1/task" -maxdepth 1 | wc -l)
}
# Memory by the means of three stretches: what leaks grows from each to the next. A queue of pictures that fills once, on a busy machine, stays in the heap: one
# step. Descriptors and threads come and go with files that wait for the disk: what leaks is missing from the least of them.
flat() { # WHAT: judges lines of needs()
  awk -v what="$1" '{ m[NR] = $1; d[NR] = $2; t[NR] = $3 }
    END { from = int(NR / 10) + 1; half = int((NR + from) / 2); left = NR - from + 1
      for (i = from; i <= NR; ++i) {
        late = i > half
        third = int(3 * (i - from) / left)
        sum[third] += m[i]; ++count[third]
        if (m[i] > most) most = m[i]
        if (!(late in least_d) || d[i] < least_d[late]) least_d[late] = d[i]
        if (!(late in least_t) || t[i] < least_t[late]) least_t[late] = t[i]
      }
      for (third in sum) mean[third] = sum[third] / count[third]
      printf "%s: memory %.0f, %.0f and %.0f MiB in a third of the time each, %.0f MiB at most; descriptors %d, %d at least; threads %d, %d at least (%d readings)\n", what, mean[0], mean[1], mean[2], most, least_d[0], least_d[1], least_t[0], least_t[1], NR
      grows = mean[1] > mean[0] * 1.05 + 3 && mean[2] > mean[1] * 1.05 + 3
      exit !(!grows && least_d[1] <= least_d[0] + 5 && least_t[1] <= least_t[0] + 2) }' "$scratch/needs" || fail "$1: it grows"
}

"$kiroku" init --demo >/dev/null
"$kiroku" record --duration "$hours:00:00" --json --endoscope 'synthetic:pattern?size=64x48&rate=5&speed=max' \
  --room 'synthetic:pattern?size=64x48&rate=5&speed=max' --vitals 'synthetic:patient?waves=0&speed=max' >"$scratch/record" 2>"$scratch/daemon.log" &
recorder=$!
sleep 2
: >"$scratch/needs"
while kill -0 "$recorder" 2>/dev/null; do
  needs "$recorder" >>"$scratch/needs" 2>/dev/null || true
  sleep 0.5
done
wait "$recorder" || fail "the recording did not end well"
recorder=
sed -i '$d' "$scratch/needs"  # taken while it ended
case=$(jq -r .case "$scratch/record")
verdict=$("$kiroku" verify --json "$case" | jq -r .verdict) || true
[[ $verdict == intact ]] || fail "the long case is $verdict"
flat "one case of $hours hours, intact"
rm -rf "$case"

port=$((20000 + RANDOM % 10000))
{
  room
  stream endoscope video 'synthetic:pattern?size=640x480&rate=25'
  stream vitals vitals synthetic:patient
  printf '[daemon]\nlisten = "127.0.0.1:%s"\n' "$port"
} >>"$KIROKU_HOME/kiroku.toml"
start_recorder
: >"$scratch/needs"
for ((i = 1; i <= cases; ++i)); do
  id=$("$kiroku" case start --json | jq -r .case)
  until (($("$kiroku" status --json | jq '.rooms[0].streams[0].frames') >= 50)); do
    curl -sf "http://127.0.0.1:$port/metrics" >/dev/null || fail "no metrics"
  done
  "$kiroku" case stop >/dev/null
  verdict=$("$kiroku" verify --json "$KIROKU_HOME/archive/$id" | jq -r .verdict) || true
  [[ $verdict == intact ]] || { "$kiroku" verify "$KIROKU_HOME/archive/$id" || true; fail "case $i is $verdict"; }
  needs "$recorder" >>"$scratch/needs"
done
stop_recorder
flat "$cases cases by one kirokud, every one intact"
