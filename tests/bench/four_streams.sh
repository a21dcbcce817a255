#!/usr/bin/env bash
# Four video streams and eight waveforms at once, for a minute (or the seconds given): 1080p30 as MPEG-2, uncompressed SD, two room cameras, 8 x 500 Hz over MLLP.
# Goals: within 2 cores without a dropped frame; from capture to durable at most a segment and 100 ms for 99 of 100 frames; status within 50 ms.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
source "$root/tests/support/daemon.sh"
seconds=${1:-60}
player=${KIROKU_MLLP_PLAYER:-$root/build/release/tests/system/mllp_player}
[[ -x $player ]] || { echo "no player of monitors at $player: run deploy/test first" >&2; exit 2; }
port=$((20000 + RANDOM % 10000))
"$kiroku" init --demo >/dev/null
{
  room
  stream endoscope video 'synthetic:pattern?size=1920x1080&rate=30'
  stream microscope video 'synthetic:pattern?size=720x576&rate=25&pixel_format=uyvy422' 'profile = "uncompressed"'
  stream room video 'synthetic:pattern?size=1280x720&rate=25'
  stream table video 'synthetic:pattern?size=1280x720&rate=25'
  stream vitals vitals "mllp://127.0.0.1:$port"
} >>"$KIROKU_HOME/kiroku.toml"
trap '[[ -z $recorder ]] || kill "$recorder" 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$scratch"' EXIT
start_recorder
ticks() { awk '{ print $14 + $15 }' "/proc/$recorder/stat"; }
id=$("$kiroku" case start --json | jq -r .case)
before=$(ticks) since=$EPOCHREALTIME
"$player" "127.0.0.1:$port" --waves "8x500x$((seconds - 2))" >"$scratch/player" &
playing=$!
answer() { # seconds until the recorder has answered, without the start of a process
  python3 - "$KIROKU_HOME/control.sock" <<'PYTHON'
import socket, sys, time
start = time.monotonic()
with socket.socket(socket.AF_UNIX) as asked:
    asked.connect(sys.argv[1])
    asked.sendall(b'{"do":"status"}\n')
    with asked.makefile() as answer:
        answer.readline()
print(time.monotonic() - start)
PYTHON
}
for ((i = 0; i < 100; ++i)); do
  status+=("$(wall "$kiroku" status --json)") answers+=("$(answer)")
  sleep "$(awk -v s="$seconds" 'BEGIN { print (s - 4) / 120 }')"
done
wait "$playing" || true
after=$(ticks) until=$EPOCHREALTIME
peak=$(awk '/VmHWM/ { print int($2 / 1024) }' "/proc/$recorder/status")
"$kiroku" case stop >/dev/null
case=$KIROKU_HOME/archive/$id
echo "the monitor's messages: $(cat "$scratch/player")"
jq -r 'select(.type == "close") | .totals | to_entries[] | "\(.key): \(.value.frames) frames or samples, \(.value.dropped) dropped, \(.value.bytes) bytes"' "$case/ledger.jsonl"
# A segment's entry is written when its bytes are durable; its frames were captured evenly over its span.
jq -r 'select(.type == "segment" and (.frames // 0) > 0) | [.mono_ns, .start_ns, .end_ns, .frames] | @tsv' "$case/ledger.jsonl" |
  awk '{ for (i = 0; i < $4; ++i) print ($1 - $2 - i * ($3 - $2) / $4) / 1e6 }' | sort -g |
  awk '{ a[NR] = $1 } END { printf "from capture to durable: median %.0f ms, 99 %% %.0f ms, most %.0f ms (goal: 99 %% within 2,100 ms)\n", a[int((NR + 1) / 2)], a[int(NR * 0.99 + 0.5)], a[NR] }'
spread() { sort -g | awk -v what="$1" '{ a[NR] = $1 * 1000 } END { printf "%s: median %.0f ms, 99 %% %.0f ms, most %.0f ms (goal 50 ms)\n", what, a[int((NR + 1) / 2)], a[99], a[NR] }'; }
printf '%s\n' "${status[@]}" | spread "kiroku status, from the start of its process to its end"
printf '%s\n' "${answers[@]}" | spread "the recorder's answer to it"
awk -v t="$((after - before))" -v a="$since" -v b="$until" -v p="$peak" 'BEGIN { printf "kirokud: %.2f cores; peak memory %d MiB (goal 300 MB)\n", t / 100 / (b - a), p }'
echo "verdict: $("$kiroku" verify --json "$case" | jq -r .verdict)"
