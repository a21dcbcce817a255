#!/usr/bin/env bash
# Checks the source without running it. What needs seconds comes first; clang-tidy needs most of an hour and is asked for.
#
# Usage: tests/lint/run.sh [--tidy [FILE...]]
#   tests/lint/run.sh                           formatting (clang-format 14), shell scripts (shellcheck), ways of includes, sleeping tests, links, figures and generated pages of docs/
#   tests/lint/run.sh --tidy                    clang-tidy on every source file of the preset release, too, which must be configured
#   tests/lint/run.sh --tidy archive/writing/ledger.cpp clang-tidy on these files alone
#
# Exit status: 0 nothing was found, 1 something was, 2 a tool is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
tidy=
if [[ ${1-} == --tidy ]]; then
  tidy=yes
  shift
fi
need() { command -v "$1" >/dev/null || { echo "$1 is not installed (deploy/dependencies, group lint)" >&2; exit 2; }; }
need shellcheck
need python3

# Each version of clang-format lays out some things in another way, so one of them rules: Debian 12's.
format_version=14
format=clang-format-$format_version
command -v "$format" >/dev/null || format=clang-format
need "$format"

found=0
if [[ $("$format" --version) == *" version $format_version."* ]]; then
  git ls-files '*.h' '*.cpp' | xargs "$format" --dry-run -Werror || found=1
else
  echo "formatting is NOT checked: it takes clang-format $format_version (Debian 12), and here is$("$format" --version | sed 's/.* version/ version/')" >&2
fi

# Sourced files define what the scripts use (SC2154), and counting loops need their variable for nothing else (SC2034).
git grep -lE '^#!.*\b(bash|sh)$' -- ':!*.md' | xargs shellcheck -x -S warning -e SC2154,SC2034 || found=1

# Which folder includes what.
tests/lint/rooms.sh || found=1

# No test sleeps that could move a clock.
tests/lint/waits.py || found=1

# What only the nightly run tries has a shorter test of its kind.
tests/lint/long_tests.py || found=1

# Links and lines of the documents; tables of figures are what their JSON says, and so is the page of the papers; the configuration's page is deploy/kiroku.toml; the worked example of the format is of the bytes that its writer makes. The page of commands
# needs the built programs: CTest's CommandsPage.
tests/lint/pages.py || found=1
docs/results/make_tables.py --check || found=1
docs/papers/make_page.py --check || found=1
tests/papers/regenerate.py --check || found=1
docs/reference/make_configuration.py --check || found=1
docs/reference/make_example.py --check || found=1

if [[ $tidy ]]; then
  need clang-tidy
  [[ -f build/release/compile_commands.json ]] || { echo "there is no build/release: run cmake --preset release first" >&2; exit 2; }
  files=("$@")
  ((${#files[@]} > 0)) || mapfile -t files < <(git ls-files '*.cpp')
  # GCC's options for precompiled headers mean nothing to Clang.
  printf '%s\n' "${files[@]}" | xargs -P "$(nproc)" -n 1 clang-tidy -p build/release --quiet --extra-arg=-Wno-unknown-warning-option || found=1
fi
exit "$found"
