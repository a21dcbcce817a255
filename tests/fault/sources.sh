#!/usr/bin/env bash
# Sources that fail while kirokud records them over real links: an endoscope by SRT, a room camera by UDP/MPEG-TS (ffmpeg sends both), a monitor over MLLP.
#   tests/fault/sources.sh 100        so many faults; each a random one of: the sender dies and comes back, stalls without an error, comes back with pictures of
#                                     another size, the monitor hangs up in the middle of a message, trickles, floods
# Afterwards the case must verify with every segment decoded, segments and stated gaps must cover each stream from its beginning to the end, pictures must have come
# back after every fault, and the recorder must need no more memory or descriptors than before.
# Exit status: 0 all hold, 1 some do not, 77 where a tool is missing.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
kiroku=${KIROKU:-$root/build/release/apps/kiroku}
player=${KIROKU_MLLP_PLAYER:-$root/build/release/tests/system/mllp_player}
faults=${1:-100}
for program in "$kiroku" "$player"; do [[ -x $program ]] || { echo "no program at $program: run deploy/test first" >&2; exit 2; }; done
for tool in jq ffmpeg; do command -v $tool >/dev/null || { echo "SKIPPED: $tool is not installed"; exit 77; }; done
ffmpeg -v quiet -protocols | grep -qw srt || { echo "SKIPPED: this ffmpeg does not speak SRT"; exit 77; }
scratch=$(mktemp -d "${TMPDIR:-/tmp}/kiroku-sources.XXXXXX")
export KIROKU_HOME=$scratch/home
source "$root/tests/support/daemon.sh"
base=$((20000 + RANDOM % 10000))
declare -A pid size
size=([endoscope]=640x480 [room]=320x240)
# signal_sender SIGNAL STREAM: fails where the sender has ended. Its number may be another process's by then, another test's perhaps.
signal_sender() {
  [[ $(ps -o ppid= -p "${pid[$2]}") -eq $$ ]] && kill "-$1" "${pid[$2]}" 2>/dev/null
}
cleanup() {
  for stream in "${!pid[@]}"; do signal_sender KILL "$stream" || true; done
  [[ -z $recorder ]] || kill "$recorder" 2>/dev/null || true
  wait 2>/dev/null || true
  rm -rf "$scratch"
}
trap cleanup EXIT

send() { # STREAM: starts its sender
  local to
  case $1 in
    endoscope) to="srt://127.0.0.1:$base?mode=listener&latency=100000" ;;
    room) to="udp://127.0.0.1:$((base + 1))?pkt_size=1316" ;;
  esac
  ffmpeg -v error -nostdin -re -f lavfi -i "testsrc2=size=${size[$1]}:rate=25" -c:v mpeg2video -b:v 2M -g 12 -bf 0 -f mpegts "$to" 2>>"$scratch/senders.log" &
  pid[$1]=$!
}
send_vitals() {
  while :; do "$player" "127.0.0.1:$((base + 2))" --waves 2x100x3600 >/dev/null 2>&1 || true; sleep 0.5; done &
  pid[vitals]=$!
}
frames() { "$kiroku" status --json | jq --arg name "$1" '.rooms[0].streams[] | select(.name == $name) | .frames'; }
# Waits until more pictures of STREAM are recorded than BEFORE. A sender that ended because nobody took what it sent while it stalled begins anew, as an encoder does.
comes_back() { # STREAM BEFORE
  for ((wait = 0; wait < 300; ++wait)); do
    if (($(frames "$1") > $2)); then return 0; fi
    signal_sender 0 "$1" || send "$1"
    sleep 0.1
  done
  return 1
}
needs() { echo "$(awk '/VmRSS/ { print int($2 / 1024) }' "/proc/$recorder/status") $(find "/proc/$recorder/fd" | wc -l)"; }

"$kiroku" init --demo >/dev/null
{
  room
  stream endoscope video "srt://127.0.0.1:$base?latency=100000"
  stream room video "udp://127.0.0.1:$((base + 1))"
  stream vitals vitals "mllp://127.0.0.1:$((base + 2))"
} >>"$KIROKU_HOME/kiroku.toml"
send endoscope
send room
send_vitals
start_recorder
id=$("$kiroku" case start --json | jq -r .case)
for stream in endoscope room; do comes_back $stream 5 || fail "$stream never came"; done
read -r memory descriptors < <(needs)
declare -A tried
for ((i = 1; i <= faults; ++i)); do
  stream=$( ((RANDOM % 2)) && echo endoscope || echo room)
  case $((RANDOM % 6)) in
    0 | 1)
      what="sender dies"
      signal_sender KILL "$stream" && wait "${pid[$stream]}" 2>/dev/null || true
      sleep "0.$((RANDOM % 10))"
      send $stream
      ;;
    2)
      what="sender stalls without an error"
      signal_sender STOP "$stream" || true
      sleep $((1 + RANDOM % 8))
      signal_sender CONT "$stream" || true
      ;;
    3)
      what="pictures change their size"
      signal_sender KILL "$stream" && wait "${pid[$stream]}" 2>/dev/null || true
      size[$stream]=$((16 * (10 + RANDOM % 40)))x$((16 * (10 + RANDOM % 30)))
      send $stream
      ;;
    4)
      what="monitor hangs up in a message, trickles, sends garbage" stream=room
      { printf '\x0bMSH|^~\\&|MON||||2026'; sleep 0.3; } >"/dev/tcp/127.0.0.1/$((base + 2))" || fail "the monitor's port is closed"
      printf '\x0bMSH|^~\\&|MON||||20260101||ORU^R01|1|P|2.6\rOBX|1|NM|1^MDC_X^MDC||5\r\x1c\r' >"$scratch/message.hl7"
      timeout 3 "$player" "127.0.0.1:$((base + 2))" --trickle 20 "$scratch/message.hl7" >/dev/null 2>&1 || true
      head -c 20000 /dev/urandom >"/dev/tcp/127.0.0.1/$((base + 2))" 2>/dev/null || true
      ;;
    5)
      what="monitor floods and never reads an answer" stream=room
      # Where nobody reads answers, the recorder stops reading in its turn: what sends then waits, and is ended here.
      printf '\x0bMSH|^~\\&|MON||||20260101||ORU^R01|1|P|2.6\rOBX|1|NM|1^MDC_X^MDC||5\r\x1c\r%.0s' {1..2000} >"$scratch/flood"
      timeout 2 bash -c 'cat "$1" "$1" "$1" "$1" "$1" >"/dev/tcp/127.0.0.1/$2"' _ "$scratch/flood" "$((base + 2))" 2>/dev/null || true
      ;;
  esac
  tried[$what]=$((${tried[$what]:-0} + 1))
  before=$(frames $stream)
  comes_back $stream $((before + 10)) || fail "fault $i ($what, $stream): no pictures came back; $("$kiroku" status)"
done
read -r memory_after descriptors_after < <(needs)
"$kiroku" case stop >/dev/null
case=$KIROKU_HOME/archive/$id
report=$("$kiroku" verify --json --identity "$KIROKU_HOME/identity.txt" "$case") || { "$kiroku" verify "$case"; fail "not intact"; }
for what in "${!tried[@]}"; do echo "$what: ${tried[$what]} times, held"; done | sort
jq -r '"verdict: " + .verdict + "; " + ([.streams[] | select(.kind == "video") | "\(.name): \(.segments) segments, gaps of \(.gap_ns / 1e9 | round) s"] | join("; "))' <<<"$report"
# Spans of segments and gaps, in order, must leave nothing out; the first picture may come within a second.
for stream in endoscope room; do
  hole=$(jq -r --arg name $stream 'select((.type == "segment" or .type == "gap") and .stream == $name) | [.start_ns, .end_ns] | @tsv' "$case/ledger.jsonl" |
    sort -n | awk 'NR > 1 && $1 > until { hole += $1 - until } { if ($2 > until) until = $2; if (NR == 1 && $1 > 1e9) hole += $1 } END { print hole / 1e9 }')
  awk -v hole="$hole" 'BEGIN { exit !(hole < 0.001) }' || fail "$stream: $hole s are neither recorded nor stated as a gap"
done
echo "the recorder's memory: $memory MiB before, $memory_after MiB after; descriptors: $descriptors, $descriptors_after"
((memory_after < memory + 100 && descriptors_after < descriptors + 20)) || fail "the recorder grows"
