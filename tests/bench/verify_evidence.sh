#!/usr/bin/env bash
# kiroku verify of one case without an evidence record, with one, and with one whose data was read again under SHA-512; five runs each, turn
# about, by processor time. Goal: with a record at most 1.2 times as much as without.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
"$kiroku" init --demo >/dev/null
# About 1 GB: uncompressed 720p, as fast as it goes.
case=$("$kiroku" record --profile uncompressed --endoscope 'synthetic:pattern?size=1280x720&rate=50&speed=max' --duration 00:00:15 --json | jq -r .case)
records=$KIROKU_HOME/archive/evidence
"$kiroku" renew >/dev/null
mv "$records" "$scratch/begun"
mkdir "$records"
cp "$scratch/begun/"*.ers "$records"
# By this policy SHA-256 ends within the half year to come.
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
"$kiroku" renew --policy "$scratch/policy.toml" >/dev/null
mv "$records" "$scratch/hashed"
find "$case" -type f -print0 | xargs -0 cat >/dev/null
spent() { # FOLDER-OF-RECORDS or nothing
  local record=()
  [[ -z ${1-} ]] || record=(--evidence "$1/$(basename "$case").ers")
  usage "$kiroku" verify "$case" "${record[@]}" | cut -d' ' -f1
}
for i in 1 2 3 4 5; do
  plain+=("$(spent)")
  begun+=("$(spent "$scratch/begun")")
  hashed+=("$(spent "$scratch/hashed")")
done
a=$(median "${plain[@]}") b=$(median "${begun[@]}") c=$(median "${hashed[@]}")
echo "$(du -sb "$case" | cut -f1) bytes: verify $a s of a processor; with a record $b s, $(ratio "$b" "$a") times (goal 1.2); read again under SHA-512 $c s, $(ratio "$c" "$a") times"
