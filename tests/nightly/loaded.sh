#!/usr/bin/env bash
# The whole suite beside four busy loops, as often as asked: a test that fails once under load is a defect. Usage: loaded.sh TIMES [CTEST OPTION...]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../deploy/lib.sh"
times=$1
shift
loops=()
trap 'kill "${loops[@]}" 2>/dev/null || true' EXIT
for _ in 1 2 3 4; do
  (while :; do :; done) &
  loops+=($!)
done
for ((run = 1; run <= times; ++run)); do
  say "Beside four busy loops, run $run of $times"
  run_tests release -j"$(nproc)" "$@"
  read -r passed failed skipped < <(count_tests)
  echo "after $run of $times runs: $passed passed, $failed failed, $skipped skipped"
done
tally
