#!/usr/bin/env bash
# Checks the source without running it. What needs seconds comes first; clang-tidy needs most of an hour and is asked for.
#
# Usage: tests/lint/run.sh [--tidy [FILE...]]
#   tests/lint/run.sh                           formatting (clang-format 14), shell scripts (shellcheck), links, figures and generated pages of docs/
#   tests/lint/run.sh --tidy                    clang-tidy on every source file of the preset release, too, which must be configured
#   tests/lint/run.sh --tidy archive/ledger.cpp clang-tidy on these files alone
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
need clang-format
need shellcheck
need python3

found=0
git ls-files '*.h' '*.cpp' | xargs clang-format --dry-run -Werror || found=1

# Sourced files define what the scripts use (SC2154), and counting loops need their variable for nothing else (SC2034).
git grep -lE '^#!.*\b(bash|sh)$' -- ':!*.md' | xargs shellcheck -x -S warning -e SC2154,SC2034 || found=1

# Links and lines of the documents; tables of figures are what their JSON says; the configuration's page is deploy/kiroku.toml. The page of commands
# needs the built programs: CTest's CommandsPage.
tests/lint/pages.py || found=1
docs/results/make_tables.py --check || found=1
docs/reference/make_configuration.py --check || found=1

if [[ $tidy ]]; then
  need clang-tidy
  [[ -f build/release/compile_commands.json ]] || { echo "there is no build/release: run cmake --preset release first" >&2; exit 2; }
  files=("$@")
  ((${#files[@]} > 0)) || mapfile -t files < <(git ls-files '*.cpp')
  # GCC's options for precompiled headers mean nothing to Clang.
  printf '%s\n' "${files[@]}" | xargs -P "$(nproc)" -n 1 clang-tidy -p build/release --quiet --extra-arg=-Wno-unknown-warning-option || found=1
fi
exit "$found"
