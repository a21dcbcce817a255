#!/usr/bin/env bash
# A case of ten hours (tiny pictures, read as fast as they come): verification and listing. Goals: verify below 200 MB, list below 1 s.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
"$kiroku" init --demo >/dev/null
made=$EPOCHREALTIME
case=$("$kiroku" record --duration 10:00:00 --endoscope 'synthetic:pattern?size=64x48&rate=5&speed=max' \
  --room 'synthetic:pattern?size=64x48&rate=5&speed=max' --vitals 'synthetic:patient?waves=0&speed=max' --json | jq -r .case)
awk -v a="$made" -v b="$EPOCHREALTIME" -v f="$(find "$case" -type f | wc -l)" -v e="$(wc -l <"$case/ledger.jsonl")" \
  'BEGIN { printf "recorded %d files, %d ledger entries in %.0f s\n", f, e, b - a }'
read -r cpu peak seconds < <(usage "$kiroku" verify "$case")
echo "kiroku verify: $seconds s ($cpu s of CPU), peak memory $((peak / 1024)) MiB (goal 200 MB)"
echo "kiroku cases: $(wall "$kiroku" cases) s (goal 1 s); rebuilt from the folders: $(wall "$kiroku" cases --rebuild) s"
