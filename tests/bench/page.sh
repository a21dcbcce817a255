#!/usr/bin/env bash
# A long case in Chromium: the first picture (goal: 1 s), and how far two panes are apart while it is played to its end at eight times its speed, and after
# (goal: a frame, 40 ms). One hour unless told otherwise: page.sh [HH:MM:SS].
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
build=$root/build/release
"$kiroku" init --demo >/dev/null
"$kiroku" record --duration "${1:-01:00:00}" --endoscope 'synthetic:endoscope?size=160x120&rate=25&speed=max' \
  --room 'synthetic:room?size=160x120&rate=25&speed=max' --vitals 'synthetic:patient?waves=0&speed=max' --json | jq -r '"recorded \(.duration_ns / 1e9) s"'
bash "$root/tests/page/run.sh" long "$build/viewer/page/page" "$build/viewer/web" "$root" "$kiroku" "$build/apps/kirokud"
