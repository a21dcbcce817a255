#!/usr/bin/env bash
# What sealing adds to a picture's way to the disk, beside writing it in the clear: the same coded pictures, at the pace of a camera, on the same file system, in one run.
# 1080p30 as MPEG-2 (4 Mbit/s) and without loss, 720x480 at 30 a second uncompressed. Prints what docs/results/record.py sealing-latency takes. Needs 1 GB free in
# KIROKU_BENCH_DIR and 1 GB of memory; three minutes.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
bench=${KIROKU_SEALING_LATENCY_BENCH:-$root/build/release/tests/bench/sealing_latency_bench}
[[ -x $bench ]] || { echo "no program at $bench: build the target sealing_latency_bench first" >&2; exit 2; }
scratch=$(mktemp -d "${KIROKU_BENCH_DIR:-${TMPDIR:-/tmp}}/kiroku-bench.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
while read -r profile size seconds; do
  "$bench" "$scratch" "$profile" "$size" "$seconds"
  rm "$scratch"/*
done <<END
mpeg2 1920x1080 20
lossless 1920x1080 10
uncompressed 720x480 10
END
