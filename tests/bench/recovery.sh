#!/usr/bin/env bash
# Recovery of a case of ten hours whose recorder was killed (tiny pictures, read as fast as they come). Goal: below 10 s.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
"$kiroku" init --demo >/dev/null
"$kiroku" record --duration 11:00:00 --endoscope 'synthetic:pattern?size=64x48&rate=5&speed=max' \
  --room 'synthetic:pattern?size=64x48&rate=5&speed=max' --vitals 'synthetic:patient?waves=0&speed=max' >/dev/null 2>"$scratch/stderr" &
recorder=$!
until case=$(ls -d "$KIROKU_HOME"/archive/2* 2>/dev/null) && (($(find "$case/segments/endoscope" -type f | wc -l) >= 18000)); do
  kill -0 "$recorder" 2>/dev/null || { cat "$scratch/stderr" >&2; exit 1; }
  sleep 0.2
done
kill -9 "$recorder"
wait "$recorder" 2>/dev/null || true
echo "killed after $(find "$case" -type f | wc -l) files, $(wc -l <"$case/ledger.jsonl") ledger entries"
sync
read -r cpu peak seconds < <(usage "$kiroku" recover)
echo "kiroku recover: $seconds s ($cpu s of CPU), peak memory $((peak / 1024)) MiB (goal 10 s)"
echo "kiroku recover again, with nothing to do: $(wall "$kiroku" recover) s"
"$kiroku" verify --json "$case" | jq -r '"verdict: " + .verdict'
