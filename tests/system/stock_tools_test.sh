#!/usr/bin/env bash
# docs/verify-with-stock-tools.md, run as it stands against a fresh case: intact; and against changed copies: not intact, for the right reason.
# Usage: stock_tools_test.sh KIROKU SOURCE_DIR
set -euo pipefail
kiroku=$1 source=$2
for tool in openssl sha256sum jq awk age ffmpeg; do
  command -v "$tool" >/dev/null || { echo "SKIPPED: $tool is not installed"; exit 77; }
done
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export KIROKU_HOME=$scratch/home
fail() { echo "FAILED: $*"; exit 1; }

awk '/^```bash$/ { on = 1; next } /^```$/ { on = 0 } on' "$source/docs/verify-with-stock-tools.md" >"$scratch/verify.sh"
lines=$(wc -l <"$scratch/verify.sh")
((lines > 20 && lines <= 80)) || fail "the script in the page has $lines lines; it must have at most 80"

"$kiroku" init --demo >/dev/null
for profile in mpeg2 lossless; do
  case=$("$kiroku" record --endoscope 'synthetic:endoscope?size=160x120&rate=10' --room 'synthetic:room?size=160x120&rate=10' --vitals synthetic:patient \
    --profile "$profile" --duration 00:00:05 --json | jq -r .case)
  expect() { # PATTERN DIRECTORY [IDENTITY]
    local output
    output=$(bash "$scratch/verify.sh" "$2" "$KIROKU_HOME/own-authority.pem" "$KIROKU_HOME/device.pub" ${3+"$3"} 2>&1) || true
    grep -q "$1" <<<"$output" || fail "$profile: expected '$1', got: $output"
  }
  expect '^INTACT: ' "$case"
  expect '^INTACT: ' "$case" "$KIROKU_HOME/identity.txt"
  expect ': they existed on ' "$case"
  OWN_ROOTS=$KIROKU_HOME/own-authority.pem expect ': self-issued, so the recorder says' "$case"

  copy=$scratch/copy
  tampered() { # PATTERN COMMAND: in a copy of the case
    rm -rf "$copy"
    cp -r "$case" "$copy"
    (cd "$copy" && eval "$2")
    expect "^NOT INTACT: .*$1" "$copy"
  }
  tampered 'missing or changed' 'printf x | dd of=$(ls segments/endoscope/*.age | head -1) bs=1 seek=300 conv=notrunc status=none'
  tampered 'missing or changed' 'rm $(ls segments/vitals/*.age | head -1)'
  tampered 'unnamed files' 'touch segments/room/stray'
  tampered 'hole' 'sed -i 3d ledger.jsonl'
  tampered 'another root' 'sed -i "2s/\"utc\":\"2/\"utc\":\"3/" ledger.jsonl'
  tampered 'not signed' 'sed -i -e "3{s/^A/B/;t;s/^./A/" -e "}" "$(ls checkpoints/*.note | head -1)"'
  tampered 'not one recording' 'sed -i "\$d" ledger.jsonl; sed -i "/\"type\":\"close\"/,\$d" ledger.jsonl'
done
echo "PASSED: the page's $lines lines find what they should"
