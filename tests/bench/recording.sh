#!/usr/bin/env bash
# CPU time of recording 1080p30 and 720p30 as MPEG-2, sealing, hashes, ledger and tokens included, against ffmpeg's for the same two encodes
# into plain files: same films, same decoder and encoder threads, same encoder settings. Five runs each, turn about. Goal: at most 1.05 times ffmpeg's.
# The films have 20 s and are read as fast as they can be, so that both programs do the same work and nothing waits for a clock.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
"$kiroku" init --demo >/dev/null
make_film() { # SIZE OUT: a moving picture with grain, as cameras have
  ffmpeg -v error -nostdin -f lavfi -i "testsrc2=size=$1:rate=30:duration=20,noise=alls=8:allf=t:all_seed=1" -c:v libx264 -preset ultrafast -crf 20 "$2"
}
make_film 1920x1080 "$scratch/endoscope.mp4"
make_film 1280x720 "$scratch/room.mp4"
# What recorder/encoder/video_encoder.cpp sets.
encode=(-c:v mpeg2video -b:v 4M -maxrate 6M -bufsize 2000000 -g 15 -bf 0 -flags +cgop+low_delay -sc_threshold 1000000000 -thread_type slice
  -force_key_frames 'expr:gte(t,n_forced*2)' -f mpegts)
threads=$(($(nproc) < 4 ? $(nproc) : 4))
peer() {
  usage ffmpeg -v error -nostdin -y -threads 2 -i "$scratch/endoscope.mp4" -threads 2 -i "$scratch/room.mp4" \
    -map 0:v -threads "$threads" "${encode[@]}" "$scratch/endoscope.ts" -map 1:v -threads "$threads" "${encode[@]}" "$scratch/room.ts"
}
ours() {
  usage "$kiroku" record --endoscope "$scratch/endoscope.mp4?speed=max" --room "$scratch/room.mp4?speed=max"
}
for i in 1 2 3 4 5; do
  read -r cpu _ _ < <(peer)
  theirs+=("$cpu")
  read -r cpu memory _ < <(ours)
  mine+=("$cpu") peak+=("$((memory / 1024))")
  rm -rf "$KIROKU_HOME"/archive/2*
done
a=$(median "${theirs[@]}") b=$(median "${mine[@]}")
echo "ffmpeg: $a s of CPU (${theirs[*]}); kiroku record: $b s (${mine[*]}); ratio $(ratio "$b" "$a") (goal 1.05); peak memory $(median "${peak[@]}") MiB (goal 300 MB)"
