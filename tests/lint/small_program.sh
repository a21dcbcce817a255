#!/usr/bin/env bash
# Programs answer at once: `kiroku` itself loads no library of cameras, codecs or solvers, but becomes another program where a command needs them. No program
# loads libavfilter when it starts, which with what it needs takes as long as all others (media/libav_filter_library.h), or libavdevice.
# Usage: tests/lint/small_program.sh KIROKU [PROGRAM...]. Exit status: 0 so it is, 1 one loads more.
set -euo pipefail
program=$1
failed=0

# loads PROGRAM PATTERN WHY: tells which of these libraries it loads.
loads() {
  local found
  found=$(ldd "$1" | awk '{ print $1 }' | grep -E "$2" || true)
  [[ -z $found ]] || { printf '%s loads libraries %s:\n%s\n' "$1" "$3" "$found" >&2; failed=1; }
}

loads "$program" '^lib(av|sw|asound|opencv|ITK|itk|dcm|cairo|cholmod|openblas)' 'that its commands do not need; a file that it links uses one that uses them'
echo "$program loads $(ldd "$program" | wc -l) libraries."
for other in "${@:2}"; do
  loads "$other" '^lib(avfilter|avdevice)[.]' 'that are to be loaded by whoever uses them'
  echo "$other loads $(ldd "$other" | wc -l) libraries."
done
exit $failed
