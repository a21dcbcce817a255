#!/usr/bin/env bash
# `kiroku` itself answers at once: it loads no library of cameras, codecs or solvers, but becomes another program where a command needs them.
# Usage: tests/lint/small_program.sh KIROKU. Exit status: 0 so it is, 1 it loads more.
set -euo pipefail
program=$1
heavy=$(ldd "$program" | awk '{ print $1 }' | grep -E '^lib(av|sw|asound|opencv|ITK|itk|dcm|cairo|cholmod|openblas)' || true)
[[ -z $heavy ]] || { printf '%s loads libraries that its commands do not need; a file that it links uses one that uses them:\n%s\n' "$program" "$heavy" >&2; exit 1; }
echo "It loads $(ldd "$program" | wc -l) libraries."
