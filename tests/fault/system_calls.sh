#!/usr/bin/env bash
# Every file system call of recording one short case by the real program, with a fault in it (strace), then recovery and verification.
#   tests/fault/system_calls.sh                all points, some minutes; prints a table
#   tests/fault/system_calls.sh --every 40     a fortieth of them
#   tests/fault/system_calls.sh --jobs 4 --keep FOLDER   how many at once; where homes of points that do not hold are kept
# A point is a system call and a number N; strace counts calls of each thread by itself, so that the N-th call of every thread is hit, or, where
# "from then on" stands, that one and all later ones. After each: the next start must recover, `verify` must say intact or intact-with-gaps, every whole
# line that stood in the ledger must still stand there, and the appliance log must hold. "unstamped": no time-stamp could be had, as verify then says.
# Exit status: 0 all hold, 1 some do not, 77 strace cannot be used here.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
export kiroku=${KIROKU:-$root/build/release/apps/kiroku}
every=1 jobs=$(nproc) keep=
while (($#)); do
  case $1 in
    --every) every=$2 ;;
    --jobs) jobs=$2 ;;
    --keep) keep=$2 ;;
    *) echo "usage: $0 [--every N] [--jobs N] [--keep FOLDER]" >&2; exit 2 ;;
  esac
  shift 2
done
[[ -x $kiroku ]] || { echo "no program at $kiroku: build it, or set KIROKU" >&2; exit 2; }
for tool in strace jq; do command -v $tool >/dev/null || { echo "$tool is not installed" >&2; exit 77; }; done
memory=/dev/shm
[[ -d $memory ]] || memory=${TMPDIR:-/tmp}
scratch=$(mktemp -d "$memory/kiroku-fault.XXXXXX")
export scratch keep
trap 'rm -rf "$scratch"' EXIT
strace -qq -o /dev/null -e inject=fsync:error=EIO true 2>/dev/null || { echo "strace cannot trace here (ptrace is not permitted)" >&2; exit 77; }
[[ -z $keep ]] || mkdir -p "$keep"

calls=openat,mkdir,rename,unlink,rmdir,read,pread64,write,pwrite64,fsync,fdatasync,ftruncate,fallocate,sync_file_range,flock,fcntl,newfstatat,lseek,getdents64,close
record_case() {
  "$@" "$kiroku" record --duration 1s --segment 500ms --endoscope 'synthetic:pattern?size=64x48&rate=10&speed=max' --vitals 'synthetic:patient?waves=0&speed=max'
}
export -f record_case

# Which calls there are: those of one recording that touch its home.
KIROKU_HOME=$scratch/template "$kiroku" init --demo >/dev/null
cp -a "$scratch/template" "$scratch/listed"
KIROKU_HOME=$scratch/listed record_case strace -f -qq -y -s 0 -e "trace=$calls" -o "$scratch/list" >/dev/null 2>&1
awk -v home="$scratch/listed" '
  / resumed>/ || / \+\+\+ / || / --- / { next }
  { call = $2; sub(/\(.*/, "", call); n = ++seen[$1 " " call]; total += index($0, home) > 0
    if (index($0, home)) point[call " " n] = 1 }
  END { for (p in point) print p; print total > "/dev/stderr" }' "$scratch/list" 2>"$scratch/total" | sort -k1,1 -k2,2n >"$scratch/points"
faults='error=EIO: error=EIO:+ error=ENOSPC: error=ENOSPC:+ signal=SIGKILL:'
while read -r call n; do
  for fault in $faults; do echo "$call $n $fault"; done
done <"$scratch/points" | awk -v every="$every" '(int((NR - 1) / 5) + 7 * ((NR - 1) % 5)) % every == 0' >"$scratch/todo"
echo "$(cat "$scratch/total") calls of one recording touch its home; $(wc -l <"$scratch/points") pairs of call and number, 5 faults each: $(wc -l <"$scratch/todo") points are tried"

# try_point CALL N FAULT: one line "CALL FAULT OUTCOME"
try_point() {
  local call=$1 n=$2 fault=${3%:*} on=${3##*:} work home outcome=
  work=$(mktemp -d "$scratch/point.XXXXXX")
  home=$work/home
  cp -a "$scratch/template" "$home"
  export KIROKU_HOME=$home
  local status=0
  record_case timeout -s KILL 60 strace -f -qq --signal=none -e "trace=$call" -e "inject=$call:$fault:when=$n$on" -o /dev/null >"$work/out" 2>"$work/err" || status=$?
  local case_folder
  case_folder=$(find "$home/archive" -maxdepth 1 -type d -name '2*' | head -1)
  if [[ -n $case_folder ]]; then grep -a '}$' "$case_folder/ledger.jsonl" >"$work/claimed" || true; fi
  if ! "$kiroku" recover --json >"$work/recovered" 2>"$work/recover-err"; then
    outcome=not-recovered
  elif case_folder=$(find "$home/archive" -maxdepth 1 -type d -name '2*' | head -1); [[ -n $case_folder ]]; then
    "$kiroku" verify --json --identity "$home/identity.txt" "$case_folder" >"$work/report" 2>"$work/verify-err" || true
    outcome=$(jq -r '.verdict // "unreadable"' "$work/report" 2>/dev/null || echo unreadable)
    [[ $outcome != unproven ]] || [[ $(jq -r '[.findings[] | select(.severity == "unproven") | .code] | unique | join(" ")' "$work/report") != no-token ]] || outcome=unstamped
    local claimed=0
    [[ ! -e $work/claimed ]] || claimed=$(wc -l <"$work/claimed")
    # A close that nobody had signed yet is cut off and stated again by recovery, which says so.
    if grep -q 'from a close or an erasure on that nobody had signed' "$case_folder/ledger.jsonl" && tail -n 1 "$work/claimed" | grep -q '"type":"close"'; then
      sed -i '$d' "$work/claimed"
      claimed=$((claimed - 1))
    fi
    head -n "$claimed" "$case_folder/ledger.jsonl" | cmp -s - <(cat "$work/claimed" 2>/dev/null) || outcome=claim-lost
  elif ((status == 0)); then
    outcome=no-case-though-done
  else
    outcome=no-case
  fi
  "$kiroku" log --verify --json >"$work/log-report" 2>/dev/null || [[ $(jq -r .verdict "$work/log-report" 2>/dev/null) != tampered ]] || outcome=log-tampered
  if [[ -n $keep && $outcome != intact* && $outcome != no-case && $outcome != unstamped ]]; then cp -a "$work" "$keep/$call-$n-${fault#*=}$on"; fi
  rm -rf "$work"
  echo "$call $fault:$on $outcome $n"
}
export -f try_point
xargs -a "$scratch/todo" -P "$jobs" -L 1 bash -c 'try_point "$@"' _ >"$scratch/results"

awk '
  { split($2, f, /[=:]/); name = f[2] ($2 ~ /\+$/ ? ", from then on" : ""); key = name; tried[key]++; outcome[key, $3]++; kinds[$3] = 1
    held = $3 ~ /^intact/ || $3 == "no-case" || $3 == "unstamped"
    if (!held) { bad++; print "does not hold: " $1 " " $4 " " $2 ": " $3 } total++ }
  END {
    printf "%-24s %7s %7s %17s %10s %10s %14s\n", "fault", "tried", "intact", "intact-with-gaps", "unstamped", "no case", "does not hold"
    for (k in tried) {
      ok = outcome[k, "intact"] + outcome[k, "intact-with-gaps"] + outcome[k, "unstamped"] + outcome[k, "no-case"]
      printf "%-24s %7d %7d %17d %10d %10d %14d\n", k, tried[k], outcome[k, "intact"], outcome[k, "intact-with-gaps"], outcome[k, "unstamped"], outcome[k, "no-case"], tried[k] - ok | "sort"
    }
    close("sort"); printf "%d points, %d do not hold\n", total, bad; exit bad > 0 }' "$scratch/results"
