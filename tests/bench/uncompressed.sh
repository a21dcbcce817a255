#!/usr/bin/env bash
# Uncompressed 1080p60 4:2:2 (249 MB/s) from a paced synthetic source for 60 s: no frame may be dropped, memory below 300 MB.
# The disk's own limit is measured beside it. Needs 22 GB free in KIROKU_BENCH_DIR.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
"$kiroku" init --demo >/dev/null
dd if=/dev/zero of="$scratch/zero" bs=4M count=1500 conv=fdatasync 2>&1 | tail -1 | sed 's/^/the disk alone, 6 GB written in one go: /'
rm "$scratch/zero"
read -r cpu peak seconds < <(usage "$kiroku" record --profile uncompressed --duration 00:01:00 \
  --endoscope 'synthetic:pattern?size=1920x1080&rate=60&pixel_format=uyvy422')
case=$(ls -d "$KIROKU_HOME"/archive/2*)
jq -c 'select(.type == "close" or .type == "gap")' "$case/ledger.jsonl"
echo "bytes: $(du -sb "$case" | cut -f1); frames dropped: $(jq -s 'map(.dropped // 0) | add' "$case/ledger.jsonl") (goal 0); CPU $cpu s in $seconds s; peak memory $((peak / 1024)) MiB (goal 300 MB)"
