#!/usr/bin/env bash
# What it costs to decode in a box: processor time and duration of recording 1080p30 and 720p30 as MPEG-2 with kiroku-decoder in its box, against
# the same program where no kiroku-decoder is beside it, which then decodes by itself. Five runs each, turn about. Goal: at most 1.03 times.
# The films have 20 s and are read as fast as they can be, so that nothing waits for a clock.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
"$kiroku" init --demo >/dev/null
make_film() { # SIZE OUT: a moving picture with grain, as cameras have
  ffmpeg -v error -nostdin -f lavfi -i "testsrc2=size=$1:rate=30:duration=20,noise=alls=8:allf=t:all_seed=1" -c:v libx264 -preset ultrafast -crf 20 "$2"
}
make_film 1920x1080 "$scratch/endoscope.mp4"
make_film 1280x720 "$scratch/room.mp4"
full=$(dirname "$kiroku")/kiroku-full
mkdir "$scratch/alone"
cp "$full" "$scratch/alone/kiroku-full"
record() { # PROGRAM
  usage "$1" record --endoscope "$scratch/endoscope.mp4?speed=max" --room "$scratch/room.mp4?speed=max"
  rm -rf "$KIROKU_HOME"/archive/2*
}
said=$("$scratch/alone/kiroku-full" record --room "$scratch/room.mp4?speed=max" --duration 1s 2>&1)
[[ $said == *"without a box"* ]] || { echo "the program alone still finds a decoder" >&2; exit 1; }
rm -rf "$KIROKU_HOME"/archive/2*
for i in 1 2 3 4 5; do
  read -r cpu _ time < <(record "$scratch/alone/kiroku-full")
  without+=("$cpu") without_time+=("$time")
  read -r cpu _ time < <(record "$full")
  boxed+=("$cpu") boxed_time+=("$time")
done
a=$(median "${without[@]}") b=$(median "${boxed[@]}")
at=$(median "${without_time[@]}") bt=$(median "${boxed_time[@]}")
echo "without a box: $a s of CPU (${without[*]}), $at s (${without_time[*]}); in a box: $b s of CPU (${boxed[*]}), $bt s (${boxed_time[*]});" \
  "ratio of CPU $(ratio "$b" "$a"), of time $(ratio "$bt" "$at") (goal 1.03)"
