#!/usr/bin/env bash
# Builds the fuzz targets (Clang) and runs each for so many seconds, as many at once as there are cores, from the committed seeds. What they find stays
# in build/fuzz/found.
#   tests/fuzz/run.sh 600 [TARGET...]        ten minutes each
#   tests/fuzz/run.sh --quick                ten seconds each, of those that read what strangers send; without the target that measures time, which needs
#                                            a machine of its own, and without those that read a site's own files and stand on much code
#   tests/fuzz/run.sh --list                 the names of these targets
# Exit status: 0 nothing was found, 1 a crash, a hang (25 s; 300 s where the target itself measures processor time) or growth beyond 2 GB, 77 without
# Clang.
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
run() { # TARGET SECONDS
  local corpus=build/fuzz/corpus/$1 seeds=tests/fuzz/seeds/${1%_fuzz} log=build/fuzz/$1.log hang=25
  if [ "$1" = hostile_folder_fuzz ]; then hang=300; fi
  mkdir -p "$corpus" "$seeds"
  if "build/asan/tests/fuzz/$1" "$corpus" "$seeds" -max_total_time="$2" -timeout="$hang" -rss_limit_mb=2048 -artifact_prefix="build/fuzz/found/$1-" >"$log" 2>&1; then
    echo "$1: $(sed -n 's/^Done \([0-9]*\) runs in \([0-9]*\) second.*/\1 runs in \2 s, nothing found/p' "$log")"
  else
    echo "$1: FOUND SOMETHING, see $log"
    return 1
  fi
}
export -f run
# shellcheck disable=SC2086
printf '%s\n' $targets | xargs -P "$(nproc)" -I{} bash -c "run {} $seconds"
