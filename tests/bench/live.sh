#!/usr/bin/env bash
# How old live pictures are when a browser has them: a real kirokud, a synthetic endoscope of 640x480 at 25 pictures a second, a WebSocket client on the
# same machine. Their case-clock time is compared with the time of arrival. Usage: tests/bench/live.sh [build folder]
set -euo pipefail
build=${1:-build/release}
out=$(mktemp)
trap 'rm -f "$out"' EXIT
"$build/tests/system/viewer_system_test" --gtest_filter='Live.ShowsWhatIsRecorded*' --gtest_output="json:$out" >/dev/null
jq -r '.testsuites[].testsuite[] | "age of a live picture: median \(.age_median_ms) ms, p95 \(.age_p95_ms) ms"' "$out"
