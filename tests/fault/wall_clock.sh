#!/usr/bin/env bash
# The wall clock is set while kirokud records: an hour ahead, an hour back, by half a second, and by somebody who mistakes daylight saving. libfaketime shifts what
# the program sees of CLOCK_REALTIME, and nothing else; the case clock (CLOCK_MONOTONIC) goes on.
#   tests/fault/wall_clock.sh 20        so many steps
# Afterwards every step must be stated in a `clock` entry within a second and with its size, the case must verify, no gap may stand in it, its duration must be
# that of the monotonic clock. In the hour that comes twice, a window of the schedule in local time is recorded both times: rather once too often.
# Exit status: 0 all hold, 1 some do not, 77 where a tool is missing.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
kiroku=${KIROKU:-$root/build/release/apps/kiroku}
steps=${1:-20}
[[ -x $kiroku ]] || { echo "no program at $kiroku: run deploy/test first" >&2; exit 2; }
command -v jq >/dev/null || { echo "SKIPPED: jq is not installed"; exit 77; }
library=$(find /usr/lib -name libfaketimeMT.so.1 2>/dev/null | head -1)
[[ -n $library ]] || { echo "SKIPPED: faketime is not installed"; exit 77; }
scratch=$(mktemp -d "${TMPDIR:-/tmp}/kiroku-clock.XXXXXX")
export KIROKU_HOME=$scratch/home
source "$root/tests/support/daemon.sh"
trap '[[ -z $recorder ]] || kill "$recorder" 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$scratch"' EXIT
offset=0
set_clock() { # SECONDS the wall clock is ahead of the real one
  # A file that is replaced at once: the program never reads half of it.
  printf '%+.3f\n' "$1" >"$scratch/offset.new"
  mv "$scratch/offset.new" "$scratch/offset"
  offset=$1
}
faked=(env "LD_PRELOAD=$library" "FAKETIME_TIMESTAMP_FILE=$scratch/offset" FAKETIME_NO_CACHE=1 FAKETIME_DONT_FAKE_MONOTONIC=1)
streams() {
  stream endoscope video 'synthetic:endoscope?size=64x48&rate=10'
  stream vitals vitals synthetic:patient
}

set_clock 0
"$kiroku" init --demo >/dev/null
# Tokens before, between and after the steps; the authority goes by the same wall clock, and waits while that stands behind its last token.
sed -i 's/^stamp_every = .*/stamp_every = "1s"/' "$KIROKU_HOME/kiroku.toml"
grep -q '^stamp_every = "1s"$' "$KIROKU_HOME/kiroku.toml" || fail "kiroku.toml has no stamp_every"
cp "$KIROKU_HOME/kiroku.toml" "$scratch/kiroku.toml"
{ room; streams; } >>"$KIROKU_HOME/kiroku.toml"
start_recorder "${faked[@]}"
id=$("$kiroku" case start --json | jq -r .case)
began=$EPOCHREALTIME
case=$KIROKU_HOME/archive/$id
sizes=(3600 -3600 -3600 3600 0.5 -0.5 7200 -7200)
step_clock() { # SECONDS
  set_clock "$(awk -v a="$offset" -v b="$1" 'BEGIN { print a + b }')"
  echo "$1 $(awk -v a="$began" -v b="$EPOCHREALTIME" 'BEGIN { print b - a }')" >>"$scratch/steps"
}
for ((i = 0; i < steps; ++i)); do
  sleep 1.2
  step_clock "${sizes[i % ${#sizes[@]}]}"
done
sleep 1.5
# The case ends at once, before the clock is looked at again.
step_clock 1257
"$kiroku" case stop >/dev/null
lasted=$(awk -v a="$began" -v b="$EPOCHREALTIME" 'BEGIN { print b - a }')
set_clock 0
stop_recorder
jq -r 'select(.type == "clock" and .step_ns != 0) | "\(.step_ns / 1e9) \(.mono_ns / 1e9)"' "$case/ledger.jsonl" >"$scratch/stated"
paste -d' ' "$scratch/steps" "$scratch/stated" | awk '
  { d = $1 - $3; if (d < 0) d = -d; late = $4 - $2; if (late > worst) worst = late; if (d > 0.05 || late > 1.3 || NF != 4) { print "step " NR " of " $1 " s at " $2 " s: stated " $3 " s at " $4 " s"; bad = 1 } }
  END { printf "%d steps of the wall clock, each stated, the latest after %.1f s\n", NR, worst; exit bad }' || fail "a step is not stated as it was"
report=$("$kiroku" verify --json --identity "$KIROKU_HOME/identity.txt" "$case") || fail "verify: $(jq -c ".verdict, .findings" <<<"$report")"
echo "verdict: $(jq -r .verdict <<<"$report")"
[[ -z $(jq -r 'select(.type == "gap") | .stream' "$case/ledger.jsonl") ]] || fail "there is a gap"
jq -r 'select(.type == "close") | .mono_ns / 1e9' "$case/ledger.jsonl" | awk -v l="$lasted" '{ d = $1 - l; exit !(d < 0.5 && d > -0.5) }' || fail "the case did not last as long as it did"

# The last Sunday of October 2025 in Berlin: 02:59:59 summer time is followed by 02:00:00 winter time, 01:00:00 UTC. A window begins at 02:30, which comes twice.
at_utc() { awk -v t="$(date -u -d "$1" +%s)" -v n="$(date +%s)" 'BEGIN { print t - n }'; }
export KIROKU_HOME=$scratch/home-in-berlin
set_clock "$(at_utc '2025-10-25 12:00:00')"
"${faked[@]}" "$kiroku" init --demo >/dev/null
{ cat "$scratch/kiroku.toml"; room 'schedule = ["sun 02:30-02:50"]'; streams; } >"$KIROKU_HOME/kiroku.toml"
set_clock "$(at_utc '2025-10-26 00:29:55')"
TZ=Europe/Berlin start_recorder "${faked[@]}"
sleep 8
"$kiroku" status --json | jq -e '.rooms[0].state == "recording"' >/dev/null || fail "the window did not begin a case"
set_clock "$(at_utc '2025-10-26 00:49:57')"
sleep 6
"$kiroku" status --json | jq -e '.rooms[0].state == "idle"' >/dev/null || fail "the window's end did not end the case"
set_clock "$(at_utc '2025-10-26 00:59:58')"
sleep 4
set_clock "$(at_utc '2025-10-26 01:29:57')"
sleep 6
"$kiroku" status --json | jq -e '.rooms[0].state == "recording"' >/dev/null || fail "the window that comes again was not recorded"
set_clock "$(at_utc '2025-10-26 01:51:00')"
sleep 3
"$kiroku" status --json | jq -e '.rooms[0].state == "idle"' >/dev/null || fail "the case went on after the window"
set_clock 0
stop_recorder
for each in "$KIROKU_HOME"/archive/2*; do
  verdict=$("$kiroku" verify --json "$each") || true
  [[ $(jq -r .verdict <<<"$verdict") == intact ]] || fail "a scheduled case: $(jq -c ".verdict, .findings" <<<"$verdict")"
done
echo "the hour that comes twice: its window was recorded both times; every case intact"
