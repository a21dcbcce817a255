#!/usr/bin/env bash
# The script for evidence records of docs/how-to/verify-with-stock-tools.md, run as it stands against records that `kiroku renew` made: proved; against
# changed cases, other cases' records, records cut and changed, and other roots: not proved, for the right reason.
# Usage: evidence_tools_test.sh KIROKU SOURCE_DIR
set -euo pipefail
kiroku=$1 source=$2
source "$source/tests/support/flip_bit.sh"
for tool in openssl jq awk; do
  command -v "$tool" >/dev/null || { echo "SKIPPED: $tool is not installed"; exit 77; }
done
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export KIROKU_HOME=$scratch/home
fail() { echo "FAILED: $*"; exit 1; }

awk '/^```bash evidence$/ { on = 1; next } /^```$/ { on = 0 } on' "$source/docs/how-to/verify-with-stock-tools.md" >"$scratch/verify-evidence.sh"
lines=$(wc -l <"$scratch/verify-evidence.sh")
((lines > 20 && lines <= 140)) || fail "the script has $lines lines; it must have at most 140"

"$kiroku" init --demo >/dev/null
KIROKU_HOME=$scratch/other "$kiroku" init --demo >/dev/null
record() {
  "$kiroku" record --endoscope 'synthetic:endoscope?size=64x48&rate=10&speed=max' --vitals 'synthetic:patient?speed=max' --duration 00:00:05 --json | jq -r .case
}
case=$(record) second=$(record)
"$kiroku" renew >/dev/null
records=$KIROKU_HOME/archive/evidence roots=$KIROKU_HOME/own-authority.pem
ers=$records/$(basename "$case").ers
expect() { # STATUS PATTERN CASE RECORD
  local output status=0
  output=$(bash "$scratch/verify-evidence.sh" "$3" "$4" "$roots" 2>&1) || status=$?
  [[ $status == "$1" ]] && grep -q "$2" <<<"$output" || fail "expected $1 and '$2', got $status: $output"
}
expect 0 '^PROVED by 1 links' "$case" "$ers"
expect 0 '^PROVED by 1 links' "$second" "$records/$(basename "$second").ers"
expect 1 'does not cover the ledger of this case' "$case" "$records/$(basename "$second").ers"
roots=$scratch/other/own-authority.pem expect 1 'the token of link 1 does not hold' "$case" "$ers"

# A new hash: all data again, with the chain before.
cat >"$scratch/policy.toml" <<POLICY
new_hash = "sha512"
[[algorithm]]
name = "sha256"
until = $(date -u -d '+100 days' +%F)
[[algorithm]]
name = "sha512"
[[algorithm]]
name = "ecdsa"
[[algorithm]]
name = "ed25519"
POLICY
cp "$ers" "$scratch/begun.ers"
"$kiroku" renew --policy "$scratch/policy.toml" >/dev/null
expect 0 '^PROVED by 2 links' "$case" "$ers"
expect 0 '^link 2: .*, sha512$' "$case" "$ers"

# A segment, a note and the ledger changed; a record cut, and one with a bit flipped in a hash value.
changed() { # FILE
  rm -rf "$scratch/copy"
  cp -r "$case" "$scratch/copy"
  flip_bit "$scratch/copy/$1" 20
}
changed segments/endoscope/00000000.ts.age
expect 1 'does not cover segments/endoscope/00000000.ts.age' "$scratch/copy" "$ers"
changed "checkpoints/$(ls "$case/checkpoints" | head -n 1)"
expect 1 'does not cover checkpoints/' "$scratch/copy" "$ers"
changed ledger.jsonl
expect 1 'the ledger has an entry of another form' "$scratch/copy" "$ers"
jq -c 'if .seq == 1 then .mono_ns += 1 else . end' "$case/ledger.jsonl" >"$scratch/copy/ledger.jsonl"
expect 1 'does not cover the ledger of this case' "$scratch/copy" "$ers"

# What the folder's maker wrote is neither run nor shown as it stands; what is not there, or ends too early, is not proved.
changed ledger.jsonl
cp "$case/ledger.jsonl" "$scratch/copy/ledger.jsonl"
expect 0 '^PROVED by 2 links' "$scratch/copy" "$ers"
mv "$scratch/copy/segments/endoscope/00000000.ts.age" "$scratch/away"
expect 2 '^COULD NOT CHECK: .* are not there' "$scratch/copy" "$ers"
mkfifo "$scratch/copy/segments/endoscope/00000000.ts.age"
expect 1 'no plain file' "$scratch/copy" "$ers"
rm "$scratch/copy/segments/endoscope/00000000.ts.age"
mv "$scratch/away" "$scratch/copy/segments/endoscope/00000000.ts.age"
cp "$(ls "$case"/checkpoints/*.note | head -n 1)" "$scratch/copy/checkpoints/1+links[\$(touch ran)].note"
expect 1 'is no checkpoint' "$scratch/copy" "$ers"
[[ ! -e $scratch/copy/ran ]] || fail "a note's name was run"
rm "$scratch"/copy/checkpoints/1+*
touch "$scratch/copy/$(printf 'x\r\033[2KPROVED by 1 links')"
output=$(bash "$scratch/verify-evidence.sh" "$scratch/copy" "$ers" "$roots" 2>&1) && fail "a name that rewrites the terminal's line was passed over"
! LC_ALL=C grep -q '[[:cntrl:]]' <<<"$output" || fail "control characters were shown: $(cat -v <<<"$output")"
rm "$scratch"/copy/x*
jq -c 'if .seq == 0 then .file = "x\r\u001b[2KPROVED by 1 links" else . end' "$case/ledger.jsonl" >"$scratch/copy/ledger.jsonl"
expect 1 'entry of another form' "$scratch/copy" "$ers"
jq -c 'select(.type != "close")' "$case/ledger.jsonl" >"$scratch/copy/ledger.jsonl"
expect 1 'not one close' "$scratch/copy" "$ers"

head -c 2000 "$ers" >"$scratch/cut.ers"
expect 1 '^NOT PROVED: ' "$case" "$scratch/cut.ers"
at=$(openssl asn1parse -inform DER -in "$ers" | awk -F: '!found && /d=6 .*OCTET STRING/ { print $1 + 10; found = 1 }')
cp "$ers" "$scratch/flipped.ers"
flip_bit "$scratch/flipped.ers" "$at"
expect 1 '^NOT PROVED: ' "$case" "$scratch/flipped.ers"
echo "ok"
