#!/usr/bin/env bash
# Checks that includes go one way: up the table of docs/explanation/architecture.md between its folders, and never round in a circle between
# any two folders. Prints what goes wrong, with one file that does it.
#
# Usage: tests/lint/rooms.sh
#
# Exit status: 0 includes go one way, 1 they do not.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

page=docs/explanation/architecture.md
mapfile -t rooms < <(sed -nE 's/^\| `([a-z]+)\/` \|.*/\1/p' "$page" | grep -vxE 'tests|deploy|docs')
((${#rooms[@]} > 5)) || { echo "$page has no table of folders" >&2; exit 1; }

# A line for each include: the folder that includes, the one that is included, the file.
includes() {
  git grep -E '^#include "[^"]+/[^"]+"' -- "${rooms[@]/%//*.h}" "${rooms[@]/%//*.cpp}" |
    sed -E 's/^(.*)\/([^\/]+):#include "(.*)\/[^\/]+".*/\1 \3 \1\/\2/'
}

found=0
declare -A place
for n in "${!rooms[@]}"; do place[${rooms[n]}]=$n; done
while read -r from to file; do
  above=${place[${to%%/*}]-}
  [[ $above ]] || continue  # of a library that is installed
  if ((above > ${place[${from%%/*}]})); then
    echo "$file includes something of $to, which stands below ${from%%/*} in $page"
    found=1
  fi
done < <(includes)

# tsort names the folders of each circle on its standard error.
if ! circles=$(includes | awk '$1 != $2 { print $1, $2 }' | sort -u | tsort 2>&1 >/dev/null); then
  echo "Includes between these folders go round in a circle:"
  sed 's/^tsort: //; s/^-: input contains a loop:/circle:/' <<<"$circles"
  found=1
fi
exit "$found"
