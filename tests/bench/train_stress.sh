#!/usr/bin/env bash
# Stress and forces of one to five fingers, spread and together, that lift the border of objects A and B by a centimetre. Prints the values that
# docs/results/record.py takes, one a line; no speed is measured. With a folder as its argument the pictures are left there.
set -euo pipefail
pictures=$(realpath -m "${1:-/nonexistent}")
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
for object in a b; do
  "$kiroku" train stress --object $object -o "$scratch/$object" --json >"$scratch/$object.json"
  [[ ${1-} ]] && cp -r "$scratch/$object" "$pictures-$object"
  jq -r 'def digits($n): if . == 0 then 0 else (. as $x | ($x | fabs | log10 | floor) as $e | pow(10; $n - 1 - $e) as $f | ($x * $f | round) / $f) end;
    .object as $object | .lifts[] | "\($object).\(.fingers)-\(.manner)" as $id
    | "\($id).largest=\(.largest_von_mises_pa / 1000 | digits(3))",
      "\($id).of95=\(.von_mises_95_percent_pa / 1000 | digits(3))",
      "\($id).of99=\(.von_mises_99_percent_pa / 1000 | digits(3))",
      "\($id).forces=\([.forces_n[] | . * 100 | round / 100 | tostring] | join(", "))",
      "\($id).all=\(.wrist_force_n | digits(3))",
      "\($id).seen=\(.visible_share * 100 | round)",
      (.away_from_fingers // empty
       | "\($id).away=\(.largest_von_mises_pa / 1000 | digits(3))", "\($id).interface=\(if .at_interface then "where stiffness changes" else "elsewhere" end)",
         "\($id).uniform=\(.of_uniform_object_pa / 1000 | digits(3))",
         "\($id).ratio=\(.largest_von_mises_pa / .of_uniform_object_pa | digits(3))")' "$scratch/$object.json"
done
