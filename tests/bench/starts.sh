#!/usr/bin/env bash
# What it costs to start each program, and to begin a recording: processor time (user and system), so that what else runs matters little; the median of 21 runs.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
programs=$(dirname "$kiroku")

# processor WHAT COMMAND...: milliseconds of a processor that it took, its children's among them
processor() {
  printf '%s: ' "$1"
  python3 - "${@:2}" <<'PYTHON'
import os, resource, statistics, subprocess, sys

def run():
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return 1000 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)

print(f"{statistics.median(run() for _ in range(21)):.0f} ms")
PYTHON
}

"$kiroku" init --demo >/dev/null
processor 'kiroku status' "$kiroku" status
processor 'kiroku record (kiroku-media)' "$kiroku" record --help
processor 'kiroku sim solve (kiroku-sim)' "$kiroku" sim solve --help
processor 'kiroku compare (kiroku-full)' "$kiroku" compare --help
processor kirokud "$programs/kirokud" --help
processor kiroku-fleet "$programs/kiroku-fleet" --help
processor kiroku-decoder "$programs/kiroku-decoder"
processor 'one picture of synthetic:endoscope, 1280x720' "$kiroku" record --endoscope 'synthetic:endoscope?rate=1&speed=max' --duration 1s
