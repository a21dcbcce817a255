#!/usr/bin/env bash
# kiroku verify against openssl dgst -sha256 of the same files in the page cache, five runs each, turn about. Goal: at least 1.7 times on two cores.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
"$kiroku" init --demo >/dev/null
# About 2 GB: uncompressed 720p, as fast as it goes.
case=$("$kiroku" record --profile uncompressed --endoscope 'synthetic:pattern?size=1280x720&rate=50&speed=max' --duration 00:00:20 --json | jq -r .case)
mapfile -t files < <(find "$case" -type f)
cat "${files[@]}" >/dev/null
size=$(du -sb "$case" | cut -f1)
for i in 1 2 3 4 5; do
  theirs+=("$(wall openssl dgst -sha256 "${files[@]}")")
  ours+=("$(wall "$kiroku" verify "$case")")
done
a=$(median "${theirs[@]}") b=$(median "${ours[@]}")
echo "$size bytes in ${#files[@]} files on $(nproc) cores: openssl dgst -sha256 $a s; kiroku verify $b s; kiroku is $(ratio "$a" "$b") times as fast (goal 1.7)"
echo "peak memory of verify: $(usage "$kiroku" verify "$case" | cut -d' ' -f2) KiB"
