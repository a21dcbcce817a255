#!/usr/bin/env bash
# kiroku unseal against age -d, the same 1 GB file in the page cache, five runs each, turn about. Goal: at least 2.5 times age's speed. Beside them what the
# machine takes to copy the file (cp), and to open it into /dev/null.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
age-keygen -o "$scratch/identity" 2>/dev/null
head -c 1000000000 /dev/urandom >"$scratch/plain"
age -r "$(age-keygen -y "$scratch/identity")" -o "$scratch/sealed" "$scratch/plain"
rm "$scratch/plain"
cat "$scratch/sealed" >/dev/null
for i in 1 2 3 4 5; do
  rm -f "$scratch/a" "$scratch/b"
  limit+=("$(wall cp --reflink=never "$scratch/sealed" "$scratch/a")")
  rm "$scratch/a"
  theirs+=("$(wall age -d -i "$scratch/identity" -o "$scratch/a" "$scratch/sealed")")
  ours+=("$(wall "$kiroku" unseal -i "$scratch/identity" -o "$scratch/b" "$scratch/sealed")")
  nowhere+=("$(wall "$kiroku" unseal -i "$scratch/identity" -o /dev/null "$scratch/sealed")")
done
cmp "$scratch/a" "$scratch/b"
a=$(median "${theirs[@]}") b=$(median "${ours[@]}")
echo "age -d: $a s; kiroku unseal: $b s for 1 GB; kiroku is $(ratio "$a" "$b") times as fast (goal 2.5)"
echo "copying the file: $(median "${limit[@]}") s; kiroku unseal to /dev/null: $(median "${nowhere[@]}") s"
