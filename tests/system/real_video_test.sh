#!/usr/bin/env bash
# A procedure from real video, as a person would do it: record two films and a patient, verify, export, compare the exported pictures with a re-mux of the
# originals, open a segment with stock age and ffmpeg, check a token with stock openssl. Usage: real_video_test.sh KIROKU SOURCE_DIR
set -euo pipefail
kiroku=$1 videos=$2/../shared/data/recording/video
[[ -d $videos ]] || { echo "SKIPPED: the real films are not there ($videos)"; exit 77; }
for tool in openssl jq age ffmpeg; do
  command -v "$tool" >/dev/null || { echo "SKIPPED: $tool is not installed"; exit 77; }
done
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export KIROKU_HOME=$scratch/home
fail() { echo "FAILED: $*"; exit 1; }
pictures() { ffmpeg -v error -nostdin -i "$1" -map 0:v -fps_mode passthrough -f rawvideo -pix_fmt yuv420p - | sha256sum | cut -d' ' -f1; }
frames() { ffmpeg -v error -nostdin -i "$1" -map 0:v -fps_mode passthrough -f framemd5 - | grep -vc '^#'; }

"$kiroku" init --demo >/dev/null
for profile in lossless uncompressed mpeg2; do
  case=$("$kiroku" record --endoscope "$videos/rvimlab_endo.mp4?speed=max" --room "$videos/intel_one_by_one_person.mp4?speed=max" --vitals 'synthetic:patient?speed=max' \
    --profile "$profile" --duration 00:00:05 --json | jq -r .case)
  "$kiroku" verify "$case" --identity "$KIROKU_HOME/identity.txt" >"$scratch/report" || fail "$profile: $(cat "$scratch/report")"
  extension=mkv
  [[ $profile != mpeg2 ]] || extension=ts
  for stream in endoscope room; do
    "$kiroku" export "$case" --stream "$stream" --identity "$KIROKU_HOME/identity.txt" -o "$scratch/$profile-$stream.$extension"
    count=$(jq -s --arg s "$stream" 'map(select(.type == "segment" and .stream == $s).frames) | add' "$case/ledger.jsonl")
    found=$(frames "$scratch/$profile-$stream.$extension")
    ((count == found)) || fail "$profile $stream: the export has $found frames, the ledger states $count"
    if [[ $profile != mpeg2 ]]; then
      original=$videos/rvimlab_endo.mp4
      [[ $stream == endoscope ]] || original=$videos/intel_one_by_one_person.mp4
      [[ $(pictures "$scratch/$profile-$stream.mkv") == $(ffmpeg -v error -nostdin -i "$original" -map 0:v -fps_mode passthrough -frames:v "$count" -f rawvideo -pix_fmt yuv420p - | sha256sum | cut -d' ' -f1) ]] ||
        fail "$profile $stream: the exported pictures are not the film's"
    fi
  done
  segment=$(ls "$case"/segments/endoscope/*.age | sed -n 2p)
  age -d -i "$KIROKU_HOME/identity.txt" "$segment" | ffmpeg -v error -nostdin -i - -map 0:v -f null - 2>"$scratch/errors"
  [[ ! -s $scratch/errors ]] || fail "$profile: ffmpeg on one segment says: $(cat "$scratch/errors")"
  token=$(ls "$case"/tokens/*.tsr | head -1)
  note=$case/checkpoints/$(basename "$token" | cut -d. -f1).note
  openssl ts -verify -data "$note" -in "$token" -CAfile "$KIROKU_HOME/own-authority.pem" >/dev/null 2>&1 || fail "openssl ts -verify refuses $token"
done
echo "PASSED"
