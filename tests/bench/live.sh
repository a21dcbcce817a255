#!/usr/bin/env bash
# How old live pictures are: when a WebSocket client on the same machine has them (a real kirokud, a synthetic endoscope of 640x480 at 25 pictures a second),
# and when they are on the screen of a real Chromium that shows two streams of 480x270 on the page, by the machine's clock: of every picture, and of the flashes
# that the source draws at whole even seconds. Usage: tests/bench/live.sh [build folder]
set -euo pipefail
source=$(cd "$(dirname "$0")/../.." && pwd)
build=$(cd "${1:-build/release}" && pwd)
out=$(mktemp)
trap 'rm -f "$out"' EXIT
echo "load: $(cut -d' ' -f1-3 /proc/loadavg), $(nproc) cores"
"$build/tests/system/viewer_system_test" --gtest_filter='Live.ShowsWhatIsRecorded*' --gtest_output="json:$out" >/dev/null
jq -r '.testsuites[].testsuite[] | "age of a live picture: median \(.age_median_ms) ms, p95 \(.age_p95_ms) ms"' "$out"
KIROKU_MEASURE=1 bash "$source/tests/page/run.sh" page "$build/viewer/page/page" "$build/viewer/web" "$source" "$build/apps/kiroku" "$build/apps/kirokud" live 2>&1 |
  grep -o 'glass to glass: .*'
echo "load: $(cut -d' ' -f1-3 /proc/loadavg)"
