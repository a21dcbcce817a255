#!/usr/bin/env bash
# Every check that is too long for continuous integration, one after the other. A step that fails does not stop the next.
#
# Usage: tests/nightly/run.sh [--list] [STEP...]
#   tests/nightly/run.sh                 every step, some ten hours on two cores
#   tests/nightly/run.sh --list          the steps and their commands
#   tests/nightly/run.sh fuzz tidy       these steps alone
#
# The output of a step goes to build/nightly/STEP.log. Results stand in build/nightly/results.json, one line a step: step, command, exit status, seconds,
# commit, date. Exit status: 0 if every step passed or was skipped (77), 1 if one failed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
source deploy/lib.sh

# Name, then command. What continuous integration samples is done in full here.
steps=(
  "tests      deploy/test --all"
  "tidy       tests/lint/run.sh --tidy"
  "alone      tests/nightly/preset.sh debug -L hostile|unit"
  "scripts    tests/system/stock_tools_test.sh build/release/apps/kiroku . --every-profile"
  "shared     env KIROKU_EVERY_FORGERY=1 ctest --preset release -R ^ForeignExchange$"
  "verifier   tests/nightly/preset.sh verify"
  "asan       tests/nightly/preset.sh asan address_sanitizer_nightly -L hostile|unit|threads|heavy|attack"
  "tsan       tests/nightly/preset.sh tsan thread_sanitizer_nightly -L threads"
  "fuzz       tests/fuzz/run.sh 600"
  "calls      tests/fault/system_calls.sh"
  "faults     env KIROKU_FAULT_EVERY=1 KIROKU_POWER_CUTS=1000 build/release/tests/fault/fault_test"
  "kills      tests/fault/kill_at_random.sh 200"
  "store      tests/fleet/faults.py build/release/apps --kills 200"
  "hospital   tests/fleet/kills.py build/release/apps --kills 200 --rooms 6"
  "sources    tests/fault/sources.sh 100"
  "clock      tests/fault/wall_clock.sh 20"
  "soak       tests/fault/soak.sh 24 200"
  "recovery   tests/bench/recovery.sh"
  "loaded     tests/nightly/loaded.sh 10"
  "cuts       tests/theatre/power_cuts.py --cuts 70"
  "forgetful  tests/theatre/power_cuts.py --cuts 15 --without-flushes"
  "lying      tests/theatre/power_cuts.py --cuts 15 --lying-disk 256"
  "failing    tests/theatre/failing_disk.py --times 2"
  "theatre    tests/theatre/whole_machine.py"
  "debian13   tests/nightly/debian13.sh"
  "package    cmake --build build/release --target package"
)

case ${1-} in
  -h | --help) help_of "${BASH_SOURCE[0]}" && exit ;;
  --list) printf '%s\n' "${steps[@]}" && exit ;;
esac
known=" $(printf '%s\n' "${steps[@]}" | awk '{ print $1 }' | tr '\n' ' ')"
for wanted in "$@"; do
  [[ $known == *" $wanted "* ]] || die "there is no step '$wanted'; there are:$known"
done

install_missing verify build run test sanitize lint fleet nightly
mkdir -p build/nightly
failed=()
for step in "${steps[@]}"; do
  read -r name command <<<"$step"
  (($# == 0)) || [[ " $* " == *" $name "* ]] || continue
  say "$name: $command"
  began=$SECONDS status=0
  # shellcheck disable=SC2086 # a command and its arguments
  $command 2>&1 | tee "build/nightly/$name.log" | alive "$name goes on" || status=$?
  printf '{"step":"%s","command":"%s","status":%d,"seconds":%d,"commit":"%s","date":"%s"}\n' "$name" "$command" "$status" $((SECONDS - began)) \
    "$(git rev-parse --short HEAD)" "$(date -u +%FT%TZ)" >>build/nightly/results.json
  case $status in
    0) echo "   $name: passed in $((SECONDS - began)) s" ;;
    77) echo "   $name: skipped, see build/nightly/$name.log" ;;
    *)
      echo "   $name: FAILED with status $status, see build/nightly/$name.log"
      failed+=("$name")
      ;;
  esac
done
((${#failed[@]} == 0)) || die "failed: ${failed[*]}"
