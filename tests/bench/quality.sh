#!/usr/bin/env bash
# What every profile of Kiroku and a ladder of other codings leave of the real laparoscopic film beside this checkout. Prints the values that
# docs/results/record.py takes, one a line; no speed is measured.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
film=$root/../shared/data/recording/video/rvimlab_endo.mp4
[[ -f $film ]] || { echo "the film is not there: $film" >&2; exit 77; }
"$kiroku" quality "$film" --json >"$scratch/quality.json"
jq -r '.clips[0].codings[] | (.coding + (if .bit_rate then "-\(.bit_rate / 1000000)M" else "" end)) as $id
  | "\($id).hour=\(.bytes_per_hour / 1e7 | round / 100)",
    "\($id).psnr=\(if .identical then "identical" else (.psnr_db * 10 | round / 10) end)",
    "\($id).ssim=\(.ssim * 10000 | round / 10000)",
    "\($id).ms=\(.ms_ssim * 10000 | round / 10000)",
    "\($id).fine=\(.fine_texture_kept * 1000 | round / 10)",
    "\($id).false=\(.fine_texture_false * 1000 | round / 10)",
    "\($id).colour=\(.colour_mean * 100 | round / 100)"' "$scratch/quality.json"
