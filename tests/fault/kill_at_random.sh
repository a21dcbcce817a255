#!/usr/bin/env bash
# kill -9 at random moments of a recording at full load, recovery, verification, and how much was lost.
#   tests/fault/kill_at_random.sh 200          so many kills; KIROKU_FAULT_LOAD overrides what is recorded
# Full load: an endoscope of 1080p30, a room camera of 720p25, vital signs with waveforms, all at their own pace. Lost is, of each stream, the time from the end of
# what its recipients can still open to the kill, on the case clock.
# Exit status: 0 all hold, 1 some do not.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
kiroku=${KIROKU:-$root/build/release/apps/kiroku}
kills=${1:-200}
[[ -x $kiroku ]] || { echo "no program at $kiroku: build it, or set KIROKU" >&2; exit 2; }
for tool in jq age ffprobe; do command -v $tool >/dev/null || { echo "$tool is not installed" >&2; exit 77; }; done
scratch=$(mktemp -d "${TMPDIR:-/tmp}/kiroku-kill.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
export KIROKU_HOME=$scratch/home
load=(--endoscope 'synthetic:pattern?size=1920x1080&rate=30' --room 'synthetic:pattern?size=1280x720&rate=25' --vitals 'synthetic:patient?waves=1')
[[ -z ${KIROKU_FAULT_LOAD:-} ]] || read -ra load <<<"$KIROKU_FAULT_LOAD"

# end_of CASE STREAM: where, on the case clock in seconds, what can be opened ends
end_of() {
  local case=$1 stream=$2 line file start plain
  line=$(grep -a "\"type\":\"segment\".*\"stream\":\"$stream\"" "$case/ledger.jsonl" | tail -1)
  [[ -n $line ]] || { echo 0; return; }
  file=$(jq -r .file <<<"$line") start=$(jq -r '.start_ns / 1e9' <<<"$line")
  if [[ $(jq -r 'has("frames") or has("samples")' <<<"$line") == true ]]; then jq -r '.end_ns / 1e9' <<<"$line"; return; fi
  plain=$scratch/plain
  age -d -i "$KIROKU_HOME/identity.txt" "$case/$file" >"$plain" 2>/dev/null || true
  if [[ $stream == vitals ]]; then
    { sed '$d' "$plain"; tail -1 "$plain" | grep '}$' || true; } | jq -R 'fromjson? | .time_ns // empty' | sort -n | tail -1 | awk -v s="$start" '{ t = $1 / 1e9 } END { print (t > s ? t : s) }'
  else
    # The frames of a segment follow one another at the source's rate from its start on.
    { ffprobe -v quiet -select_streams v -show_entries packet=pts_time,duration_time -of csv=p=0 "$plain" || true; } |
      awk -F, -v s="$start" '$1 != "N/A" && $1 != "" { if (first == "" || $1 < first) first = $1; if (last == "" || $1 + $2 > last) last = $1 + $2 } END { print first == "" ? s : s + last - first }'
  fi
}

held=0 bad=0
: >"$scratch/lost"
for ((i = 1; i <= kills; ++i)); do
  rm -rf "$KIROKU_HOME"
  "$kiroku" init --demo >/dev/null
  "$kiroku" record "${load[@]}" >"$scratch/out" 2>"$scratch/err" &
  pid=$!
  for ((wait = 0; wait < 600; ++wait)); do
    [[ -z $(find "$KIROKU_HOME/archive" -maxdepth 1 -name '2*') ]] || break
    sleep 0.05
  done
  moment=$(awk -v seed="$RANDOM$i" 'BEGIN { srand(seed); printf "%.3f", 6 * rand() }')
  sleep "$moment"
  killed_utc=$EPOCHREALTIME
  kill -9 "$pid" 2>/dev/null || true
  wait "$pid" 2>/dev/null || true
  case=$(find "$KIROKU_HOME/archive" -maxdepth 1 -type d -name '2*' | head -1)
  if ! "$kiroku" recover --json >"$scratch/recovered" 2>"$scratch/recover-err"; then
    echo "kill $i after $moment s: not recovered: $(cat "$scratch/recover-err" "$scratch/recovered")"; ((++bad)); continue
  fi
  if [[ -z $case || ! -d $case ]]; then ((++held)); continue; fi  # killed before there was a case
  verdict=$("$kiroku" verify --json --identity "$KIROKU_HOME/identity.txt" "$case" | jq -r .verdict) || true
  if [[ $verdict != intact && $verdict != intact-with-gaps ]]; then
    echo "kill $i after $moment s: $verdict"; ((++bad))
    "$kiroku" verify --identity "$KIROKU_HOME/identity.txt" "$case" || true
    continue
  fi
  ((++held))
  opened=$(head -1 "$case/ledger.jsonl" | jq -r .utc)
  killed=$(awk -v k="$killed_utc" -v o="$(date -d "$opened" +%s.%6N)" 'BEGIN { print k - o }')
  for stream in $(head -1 "$case/ledger.jsonl" | jq -r '.streams[] | select(.kind != "events") | .name'); do
    echo "$stream $(awk -v k="$killed" -v e="$(end_of "$case" "$stream")" 'BEGIN { l = k - e; print (l > 0 ? l : 0) }')" >>"$scratch/lost"
  done
done
echo "$kills kills at random: $held held, $bad did not"
for stream in $(cut -d' ' -f1 "$scratch/lost" | sort -u); do
  grep "^$stream " "$scratch/lost" | cut -d' ' -f2 | sort -g | awk -v name="$stream" '
    { a[NR] = $1; over += $1 > 1 } END { printf "  %-10s lost: median %.2f s, 95 %% %.2f s, most %.2f s; more than one second %d of %d times\n", name, a[int((NR + 1) / 2)], a[int(NR * 0.95 + 0.5)], a[NR], over, NR }'
done
((bad == 0))
