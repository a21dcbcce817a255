#!/usr/bin/env bash
# kiroku verify of one case of about 1 GB: plain; with an evidence record; with one whose data was read again under SHA-512, its log witnessed. Beside
# it, what openssl needs to hash the same files under SHA-256, and under SHA-512: no verifier can compare two hashes of all data with less. Five runs
# each, turn about, from the page cache; then three from the disk. Last a case whose camera saw a display, with and without --light.
#   tests/bench/verify_evidence.sh        Goal: each at most 1.2 times as much as plain.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
running=()
trap '((${#running[@]} == 0)) || kill "${running[@]}"; rm -rf "$scratch"' EXIT
"$kiroku" init --demo >/dev/null
# About 1 GB: uncompressed 720p, as fast as it goes.
case=$("$kiroku" record --profile uncompressed --endoscope 'synthetic:pattern?size=1280x720&rate=50&speed=max' --duration 00:00:15 --json | jq -r .case)

# A camera that sees a display, in real time.
"$kiroku" display -o "$scratch/light.pgm" --cell 2 >/dev/null 2>&1 &
running+=($!)
lit=$("$kiroku" record --room "synthetic:room?size=1280x720&rate=25&light_height=60&light=$scratch/light.pgm" --duration 00:00:30 --json | jq -r .case)

# A witness of the log.
key=$("$kiroku" witness init "$scratch/witness" --name bench.example/w1 --json | jq -r .key)
"$kiroku" witness trust "$scratch/witness" "$KIROKU_HOME/device.pub" >/dev/null
"$kiroku" witness serve "$scratch/witness" --listen 127.0.0.1:0 --json >"$scratch/served" &
running+=($!)
until [[ -s $scratch/served ]]; do sleep 0.1; done
printf 'witness one %s %s\nquorum one\n' "$key" "$(jq -r .url "$scratch/served")" >"$scratch/witnesses.txt"
"$kiroku" witness ask --witnesses "$scratch/witnesses.txt" >/dev/null

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
mapfile -t files < <(find "$case" -type f)
cat "${files[@]}" >/dev/null

# PROCESSOR-SECONDS WALL-SECONDS of each way
plain() { usage "$kiroku" verify "$case" | cut -d' ' -f1,3; }
begun() { usage "$kiroku" verify "$case" --evidence "$scratch/begun/$(basename "$case").ers" | cut -d' ' -f1,3; }
hashed() {
  usage "$kiroku" verify "$case" --evidence "$scratch/hashed/$(basename "$case").ers" --witnesses "$scratch/witnesses.txt" | cut -d' ' -f1,3
}
openssl_of() { usage openssl dgst "-$1" "${files[@]}" | cut -d' ' -f1,3; }
# Takes the case's files out of the page cache, and no other file.
forget() {
  python3 -c 'import os, sys
for name in sys.argv[1:]:
    file = os.open(name, os.O_RDONLY)
    os.fsync(file)
    os.posix_fadvise(file, 0, 0, os.POSIX_FADV_DONTNEED)' "${files[@]}"
}
# median_of COLUMN RESULTS...
median_of() {
  local column=$1
  shift
  median "$(printf '%s\n' "$@" | cut -d' ' -f"$column")"
}
for i in 1 2 3 4 5; do
  a+=("$(plain)")
  b+=("$(begun)")
  c+=("$(hashed)")
  s+=("$(openssl_of sha256)")
  t+=("$(openssl_of sha512)")
done
for i in 1 2 3; do
  forget
  d+=("$(plain)")
  forget
  e+=("$(hashed)")
  unlit+=("$(usage "$kiroku" verify "$lit" -i "$KIROKU_HOME/identity.txt" | cut -d' ' -f1,3)")
  light+=("$(usage "$kiroku" verify "$lit" -i "$KIROKU_HOME/identity.txt" --light | cut -d' ' -f1,3)")
done
plain=$(median_of 1 "${a[@]}") renewed=$(median_of 1 "${c[@]}") sha256=$(median_of 1 "${s[@]}") sha512=$(median_of 1 "${t[@]}")
plain_wall=$(median_of 2 "${a[@]}") renewed_wall=$(median_of 2 "${c[@]}")
more=$(awk -v a="$plain" -v b="$renewed" 'BEGIN { printf "%.2f", b - a }')
bound=$(awk -v a="$sha256" -v b="$sha512" 'BEGIN { printf "%.3f", (a + b) / a }')
cat <<FIGURES
$(du -sb "$case" | cut -f1) bytes on $(nproc) cores; goal of each ratio 1.2
plain=$plain plain.peer=$sha256             s of a processor; openssl dgst -sha256
with=$(ratio "$(median_of 1 "${b[@]}")" "$plain")                            times as much, with a record
hashed=$(ratio "$renewed" "$plain") hashed.peer=$bound         times as much, read again under SHA-512, witnessed; openssl for both hashes, to its SHA-256
more=$more more.peer=$sha512               s of a processor that the latter adds; openssl dgst -sha512
wall=$(ratio "$renewed_wall" "$plain_wall")                            times as long, by the clock ($renewed_wall s to $plain_wall s)
disk=$(ratio "$(median_of 2 "${e[@]}")" "$(median_of 2 "${d[@]}")")                            times as long, from the disk ($(median_of 2 "${e[@]}") s to $(median_of 2 "${d[@]}") s)
light=$(ratio "$(median_of 1 "${light[@]}")" "$(median_of 1 "${unlit[@]}")")                           times as much with --light, of a case whose camera saw a display
FIGURES
