#!/usr/bin/env bash
# Builds the fuzz targets (Clang) and runs each for so many seconds of a processor behind the committed seeds, as many at once as there are cores. What they
# find stays in build/fuzz/found.
#   tests/fuzz/run.sh 600 [TARGET...]        ten minutes each
#   tests/fuzz/run.sh --quick                ten seconds each, of those that read what strangers send; without the target that measures time, which needs
#                                            a machine of its own, and without those that read a site's own files and stand on much code
#   tests/fuzz/run.sh --list                 the names of these targets
# Exit status: 0 nothing was found, 1 a crash, a hang (25 s; 300 s where the target itself measures processor time) or growth beyond 2 GB, 77 without
# Clang. At a low priority (nice) a hang is one of twelve times as long by the clock, or of as long by the processor at the end.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
seconds=${1:-60} left_out='' list=''
shift || true
if [[ $seconds == --quick || $seconds == --list ]]; then
  [[ $seconds == --quick ]] || list=yes
  seconds=10
  left_out=$'hostile_folder_fuzz\nmesh_fuzz\nconfiguration_fuzz'
fi
all=$(sed -n 's/^ *kiroku_fuzz_target(\([a-z0-9_]*_fuzz\) .*/\1/p' tests/fuzz/CMakeLists.txt)
targets=${*:-$(grep -vxF "$left_out" <<<"$all")}
if [[ $list ]]; then echo "$targets" && exit; fi
command -v clang++ >/dev/null || { echo "SKIPPED: clang is not installed (deploy/dependencies, group sanitize)"; exit 77; }
cmake --preset asan -DKIROKU_TESTS=ON >/dev/null
# shellcheck disable=SC2086 # names of targets
cmake --build --preset asan --target $targets
mkdir -p build/fuzz/found
# processor_of PID: how many hundredths of a second of a processor it has had; fails where it has ended.
processor_of() {
  local fields
  fields=$(cat "/proc/$1/stat" 2>/dev/null) || return
  read -r -a fields <<<"${fields##*) }"
  [[ ${fields[0]} != Z ]] || return
  echo $((fields[11] + fields[12]))
}
run() { # TARGET SECONDS
  local corpus=build/fuzz/corpus/$1 seeds=tests/fuzz/seeds/${1%_fuzz} log=build/fuzz/$1.log hang=25 limit pid had='' began='' asked=''
  if [ "$1" = hostile_folder_fuzz ]; then hang=300; fi
  limit=$hang
  if (($(nice) > 0)); then limit=$((12 * hang)); fi
  mkdir -p "$corpus" "$seeds"
  "build/asan/tests/fuzz/$1" "$corpus" "$seeds" -timeout="$limit" -rss_limit_mb=2048 -print_final_stats=1 -artifact_prefix="build/fuzz/found/$1-" >"$log" 2>&1 &
  pid=$!
  while had=$(processor_of "$pid"); do
    if [ -z "$began" ] && grep -q '^#[0-9]*[[:space:]]*INITED' "$log"; then began=$had; fi
    if [ -n "$began" ] && ((had - began >= 100 * $2)) && [ -z "$asked" ]; then
      kill -USR1 "$pid" # it ends behind the input that it is at
      asked=$had
    elif [ -n "$asked" ] && ((had - asked >= 100 * hang)); then
      kill -ABRT "$pid" # it keeps that input
      asked=$((had + 100 * hang))
    fi
    sleep 0.2
  done
  if wait "$pid"; then
    echo "$1: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") runs in $2 s, nothing found"
  else
    echo "$1: FOUND SOMETHING, see $log"
    return 1
  fi
}
export -f run processor_of
# shellcheck disable=SC2086
printf '%s\n' $targets | xargs -P "$(nproc)" -I{} bash -c "run {} $seconds"
