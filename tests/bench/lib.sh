# Shared by the measurements of this folder; sourced, not run. Each prints the figure, its peer's in the same run, and the ratio.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
kiroku=${KIROKU:-$root/build/release/apps/kiroku}
[[ -x $kiroku ]] || { echo "no program at $kiroku: run deploy/demo first, or set KIROKU" >&2; exit 2; }
scratch=$(mktemp -d "${KIROKU_BENCH_DIR:-${TMPDIR:-/tmp}}/kiroku-bench.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
export KIROKU_HOME=$scratch/home

# median NUMBER...
median() { printf '%s\n' "$@" | sort -g | awk '{ a[NR] = $1 } END { print a[int((NR + 1) / 2)] }'; }

# wall COMMAND...: seconds it took
wall() {
  local start=$EPOCHREALTIME
  "$@" >/dev/null 2>"$scratch/stderr" || { cat "$scratch/stderr" >&2; echo "failed: $*" >&2; exit 1; }
  awk -v a="$start" -v b="$EPOCHREALTIME" 'BEGIN { printf "%.4f\n", b - a }'
}

# usage COMMAND...: "USER+SYSTEM-SECONDS PEAK-KIB WALL-SECONDS" of it, from the kernel's accounting
usage() {
  python3 - "$@" <<'PYTHON'
import resource, subprocess, sys, time
start = time.monotonic()
run = subprocess.run(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
wall = time.monotonic() - start
if run.returncode:
    sys.stderr.write(run.stderr.decode() + "failed: " + " ".join(sys.argv[1:]) + "\n")
    sys.exit(1)
use = resource.getrusage(resource.RUSAGE_CHILDREN)
print(f"{use.ru_utime + use.ru_stime:.2f} {use.ru_maxrss} {wall:.2f}")
PYTHON
}

ratio() { awk -v a="$1" -v b="$2" 'BEGIN { printf "%.3f", a / b }'; }
