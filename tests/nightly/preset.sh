#!/usr/bin/env bash
# Builds a preset and runs its tests. Usage: preset.sh PRESET [TARGET] [CTEST OPTION...]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../deploy/lib.sh"
preset=$1
shift
targets=()
if [[ ${1-} == [a-z]* ]]; then
  targets=("$1")
  shift
fi
build "$preset" "${targets[@]}"
run_tests "$preset" -j"$(nproc)" "$@"
tally
