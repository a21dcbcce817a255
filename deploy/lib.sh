# Shared by the scripts of this folder; sourced, not run.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

say() { printf '\n\033[1m== %s\033[0m\n' "$*"; }
die() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; exit 1; }

# is_there PACKAGE: whether a package is installed, or what it is for came another way: node and npm are often newer than Debian's, and would clash.
is_there() {
  [[ $(dpkg-query -W -f '${db:Status-Abbrev}' "$1" 2>/dev/null) == "ii "* ]] && return
  case $1 in
    nodejs | npm) command -v npm >/dev/null && [[ $(node --version 2>/dev/null) =~ ^v([0-9]+) ]] && ((BASH_REMATCH[1] >= 18)) ;;
    *) false ;;
  esac
}

# alive WHAT: passes lines on; where none comes for eight seconds it says that WHAT goes on, so that nobody waits before a silent screen.
alive() {
  local what=$1 line part='' status began=$SECONDS
  while true; do
    if IFS= read -r -t 8 line; then
      printf '%s\n' "$part$line"
      part=
    else
      status=$?
      part+=$line
      ((status > 128)) || break
      printf '   ... %s: %d s\n' "$what" $((SECONDS - began))
    fi
  done
  [[ -z $part ]] || printf '%s\n' "$part"
}

# counted WHAT: reads ninja's or apt's lines and shows every few seconds how far they are: one line on a terminal, a line each elsewhere.
counted() {
  local what=$1 line status count='' began=$SECONDS shown=$SECONDS end='\n'
  [[ ! -t 1 ]] || end='\r'
  while true; do
    status=0
    IFS= read -r -t 5 line || status=$?
    ((status == 0 || status > 128)) || break
    if [[ $line =~ ^\[([0-9]+)/([0-9]+)\] ]]; then
      count=" ${BASH_REMATCH[1]} of ${BASH_REMATCH[2]}"
    elif [[ $line =~ ^(Unpacking|Setting\ up)\ ([^ ]+) ]]; then
      count=" ${BASH_REMATCH[1],} ${BASH_REMATCH[2]}"
    fi
    if ((SECONDS - shown >= 5)); then
      shown=$SECONDS
      printf "   %s:%s, %d s        $end" "$what" "$count" $((SECONDS - began))
    fi
  done
  [[ ! -t 1 ]] || printf '\r%*s\r' 78 ''
}

# debian_release: 12, 13 and so on; nothing where it has no number, as in Debian's own testing.
debian_release() { sed -n 's/^VERSION_ID="\{0,1\}\([0-9]*\).*/\1/p' /etc/os-release; }

# packages_of RELEASE GROUP...: the packages of deploy/dependencies that this release has, one a line.
packages_of() {
  awk -v release="$1" -v groups=" ${*:2} " '!/^#/ && NF && index(groups, " " $1 " ") && (NF == 2 || $3 == release) { print $2 }' \
    "$root/deploy/dependencies" | sort -u
}

# install_missing GROUP...: installs the packages of deploy/dependencies that are not there yet, and says which.
install_missing() {
  command -v dpkg-query >/dev/null || die "this is not a Debian system; install what deploy/dependencies lists by hand, then run cmake --preset release"
  local package missing=()
  while read -r package; do
    is_there "$package" || missing+=("$package")
  done < <(packages_of "$(debian_release)" "$@")
  if ((${#missing[@]} == 0)); then
    echo "Nothing to install: every package is there."
    return
  fi
  echo "Installing ${#missing[@]} Debian packages: ${missing[*]}"
  local sudo=()
  if ((EUID != 0)); then
    command -v sudo >/dev/null || die "not root and no sudo; as root run: apt-get install --no-install-recommends ${missing[*]}"
    sudo=(sudo)
  fi
  local log
  log=$(mktemp)
  if ! { "${sudo[@]}" apt-get update && "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}"; } 2>&1 |
    tee "$log" | counted "installing"; then
    tail -20 "$log" >&2
    die "installing failed; the whole output is in $log"
  fi
  rm -f "$log"
}

# build PRESET TARGET...: configures and builds, and counts the objects meanwhile; on failure shows what the compiler said. What KIROKU_CMAKE_OPTIONS holds
# goes to CMake.
build() {
  local preset=$1 log targets=()
  shift
  (($# == 0)) || targets=(--target "$@")
  log=$(mktemp)
  # shellcheck disable=SC2086 # several options
  if ! { cd "$root" && cmake --preset "$preset" ${KIROKU_CMAKE_OPTIONS-} && cmake --build --preset "$preset" "${targets[@]}"; } 2>&1 |
    tee "$log" | counted "building"; then
    grep -E -A5 'error|Error|FAILED' "$log" | head -60 >&2
    die "building preset '$preset' failed; the whole output is in $log"
  fi
  rm -f "$log"
}

# The folder in which run_tests keeps its counts (a line "passed failed skipped" a run) and what failed tests printed. A script that sets the variable
# has the results of the scripts it calls added to its own.
test_results=${KIROKU_TEST_RESULTS-}

# failures_of REPORT SAID: of a JUnit report each failed test's name, how it ended by what CTest said (the report does not tell a crash from a limit of time),
# how long it took, the last 60 lines that it printed, and before these up to 20 earlier lines that tell of an error: tests of the page print a long summary
# after theirs.
failures_of() {
  awk '
    function text(line) {
      gsub(/&lt;/, "<", line); gsub(/&gt;/, ">", line); gsub(/&quot;/, "\"", line); gsub(/&apos;/, "\x27", line); gsub(/&amp;/, "\\&", line)
      return line
    }
    NR == FNR && match($0, /^[ \t]*[0-9]+ - .* \([^()]*\)/) {
      how = substr($0, RSTART, RLENGTH); sub(/^[ \t]*[0-9]+ - /, "", how)
      name = how; sub(/ \([^()]*\)$/, "", name); sub(/.* \(/, "", how); sub(/\)$/, "", how)
      ended[name] = how
    }
    NR == FNR { next }
    /<testcase / {
      lines = 0; bad = /status="fail"/
      name = $0; sub(/.*<testcase name="/, "", name); sub(/".*/, "", name)
      time = $0; sub(/.* time="/, "", time); sub(/".*/, "", time)
    }
    bad && /<system-out>/ { sub(/.*<system-out>/, ""); inside = 1 }
    inside && /<\/system-out>/ { sub(/<\/system-out>.*/, ""); kept[lines++] = $0; inside = 0 }
    inside { kept[lines++] = $0 }
    bad && /<\/testcase>/ {
      printf "\n-- %s: %s after %.1f s\n", text(name), text(name) in ended ? ended[text(name)] : "failed", time
      first = lines > 60 ? lines - 60 : 0
      for (i = told = 0; i < first && told < 20; ++i) if (kept[i] ~ /FAIL|Error:|Failure/) { print "   " text(kept[i]); ++told }
      for (i = first; i < lines; ++i) print "   " text(kept[i])
      bad = 0
    }' "$2" "$1"
}

# counts_of REPORT: how many tests of a JUnit report passed, failed and were skipped. A program of GoogleTest says how many cases it ran; what says nothing, as
# it is none or was killed, is one test. Whether one failed is CTest's to say, by the program's exit status: what a program of a test prints may stand before
# GoogleTest's words in their line, or push them beyond what CTest keeps.
counts_of() {
  awk '
    /<testcase / { status = $0; sub(/.*status="/, "", status); sub(/".*/, "", status); said = ran = passed = skipped = 0 }
    { sub(/^[ \t]*<system-out>/, "") }
    /^\[==========\] [0-9]+ tests? from .* ran\./ { said = 1; ran = $2 }
    /^\[  PASSED  \] [0-9]+ test/ { passed = $4 }
    /^\[  SKIPPED \] [0-9]+ test/ { skipped = $4 }
    /<\/testcase>/ {
      failed = 0
      if (status == "run") passed = (said ? ran - skipped : 1)
      else if (status == "notrun") { passed = 0; if (!said) skipped = 1 }
      else if ((failed = ran - passed - skipped) < 1) failed = 1
      all_passed += passed; all_failed += failed; all_skipped += skipped
    }
    END { print all_passed + 0, all_failed + 0, all_skipped + 0 }' "$1"
}

# skips_of REPORT: why GoogleTest's cases of a JUnit report were skipped, each reason once.
skips_of() { awk '/: Skipped$/ { getline; sub(/<\/system-out>.*/, ""); if (!told[$0]++) print "   skipped: " $0 }' "$1"; }

# slowest_of REPORT: of a JUnit report how long all tests took together, and the ten that took longest.
slowest_of() {
  awk '
    /<testcase / {
      name = $0; sub(/.*<testcase name="/, "", name); sub(/".*/, "", name)
      time = $0; sub(/.* time="/, "", time); sub(/".*/, "", time)
      sum += time
      ++count
      printf "%8.1f s  %s\n", time, name | slowest
    }
    END { close(slowest); printf "%8.1f s  all %d, one after the other\n", sum, count }' slowest='sort -rn | head -10' "$1"
}

# How many tests run at once. Half of their time they wait for programs of theirs and for pictures to come: measured, all tests together need
# half of the processor time that two cores have meanwhile.
jobs=$(($(nproc) + 4))

# give_way: from now on this shell, and what it starts, has the processors where others leave them; a thirtieth where these leave nothing, so that no test
# waits until its limit.
give_way() { renice -n 10 -p "$BASHPID" >/dev/null; }

# run_tests PRESET [CTEST OPTION...]: runs CTest and keeps its counts, and what failed tests printed, for tally.
run_tests() {
  local preset=$1 report said
  shift
  : "${test_results:=$(mktemp -d)}"
  report=$(mktemp) said=$(mktemp)
  (cd "$root" && ctest --preset "$preset" --output-junit "$report" "$@" 2>&1) | tee "$said" | alive "tests go on" || true
  local passed failures skips
  read -r passed failures skips < <(counts_of "$report")
  ((passed + failures + skips > 0)) || die "CTest ran no test of preset '$preset'"
  echo "$passed $failures $skips" >>"$test_results/counts"
  skips_of "$report"
  ((failures == 0)) || { echo "   preset $preset:"; failures_of "$report" "$said"; } >>"$test_results/failed"
  { echo "   preset $preset:"; slowest_of "$report"; } >>"$test_results/slowest"
  rm -f "$report" "$said"
}

# minutes WHAT: how long WHAT took since the last call, so that a log shows where the time goes; tally says it once more.
stage_began=$SECONDS
minutes() {
  : "${test_results:=$(mktemp -d)}"
  printf '   %s: %d min %02d s\n' "$1" $(((SECONDS - stage_began) / 60)) $(((SECONDS - stage_began) % 60)) | tee -a "$test_results/stages"
  stage_began=$SECONDS
}

# help_of FILE: prints the comment at the head of a script, without the line of the interpreter.
help_of() { sed -n '2,/^[^#]/{s/^# \{0,1\}//p}' "$1"; }

# count_tests: how many tests passed, failed and were skipped so far.
count_tests() { awk '{ p += $1; f += $2; s += $3 } END { print p + 0, f + 0, s + 0 }' "$test_results/counts"; }

# tally: where the time went and what failed, once more at the end, where a log cut to its tail still has it, and the closing line; fails if a test did.
tally() {
  local passed failed skipped
  say "The slowest tests"
  cat "$test_results/slowest"
  if [[ -s $test_results/stages ]]; then
    say "Where the time went"
    cat "$test_results/stages"
  fi
  if [[ -s $test_results/failed ]]; then
    say "Failed tests, with the end of what each printed"
    cat "$test_results/failed"
  fi
  read -r passed failed skipped < <(count_tests)
  echo
  echo "$passed passed, $failed failed, $skipped skipped"
  ((failed == 0))
}
