#!/usr/bin/env bash
# A backlog into a store, by `kiroku ship` and by curl: the same files, locks and hashes, one connection, one after the other. Three rounds turn about,
# the best of each counts. curl is given the hashes, which `kiroku ship` computes, and asks nothing afterwards. Goal: 0.8 of curl's speed.
# Usage: tests/bench/ship.sh [SECONDS OF UNCOMPRESSED VIDEO]; needs Ceph (group fleet of deploy/dependencies), else leaves with 77.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
kiroku=${KIROKU:-$root/build/release/apps/kiroku} seconds=${1:-10}
[[ -x $kiroku ]] || { echo "no program at $kiroku: build the target kiroku first" >&2; exit 2; }
scratch=$(mktemp -d)
trap '"$root/tests/fleet/store.sh" down "$scratch/store"; rm -rf "$scratch"' EXIT
endpoint=$("$root/tests/fleet/store.sh" up "$scratch/store") || { status=$?; echo "$endpoint"; exit "$status"; }
signed=(-sS --aws-sigv4 aws:amz:us-east-1:s3 --user testaccess:testsecret0123456789)
empty=$(sha256sum </dev/null | cut -d' ' -f1)

export KIROKU_HOME=$scratch/home
"$kiroku" init --demo >/dev/null
"$kiroku" record --endoscope 'synthetic:endoscope?size=1280x720' --vitals synthetic:patient --profile uncompressed --duration "${seconds}s" >/dev/null
touch "$KIROKU_HOME/store-credentials" && chmod 600 "$KIROKU_HOME/store-credentials"
printf 'access_key = testaccess\nsecret_key = testsecret0123456789\n' >"$KIROKU_HOME/store-credentials"
cp "$KIROKU_HOME/kiroku.toml" "$scratch/kiroku.toml"
cd "$KIROKU_HOME/archive"
mapfile -t files < <(find . -type f ! -name '.*' ! -name '*.part' | sed 's,^\./,,')
bytes=$(printf '%s\0' "${files[@]}" | xargs -0 stat -c %s | awk '{ sum += $1 } END { print sum }')
ends=$(date -u -d '+1 day' +%Y-%m-%dT%H:%M:%SZ)

for round in 1 2 3; do
  for bucket in "ship-$round" "curl-$round"; do
    curl "${signed[@]}" -o /dev/null -X PUT -H "x-amz-content-sha256: $empty" -H 'x-amz-bucket-object-lock-enabled: true' "$endpoint/$bucket"
    # The first access to a new bucket takes Ceph a second or two.
    curl "${signed[@]}" -o /dev/null -T /dev/null -H "x-amz-content-sha256: $empty" "$endpoint/$bucket/first"
    curl "${signed[@]}" -o /dev/null -I -H "x-amz-content-sha256: $empty" "$endpoint/$bucket/none"
  done
  rm -f "$KIROKU_HOME/shipping.sqlite"
  { cat "$scratch/kiroku.toml"; printf '\n[store]\nendpoint = "%s"\nbucket = "ship-%s"\nretain = "1d"\nappliance = "or-1"\n' "$endpoint" "$round"; } >"$KIROKU_HOME/kiroku.toml"
  began=$(date +%s%N)
  "$kiroku" ship >/dev/null
  echo "ship $(($(date +%s%N) - began))"

  : >"$scratch/transfers"
  for file in "${files[@]}"; do
    [[ ! -s $scratch/transfers ]] || echo next >>"$scratch/transfers"
    cat >>"$scratch/transfers" <<EOF
silent
show-error
fail
output = "/dev/null"
aws-sigv4 = "aws:amz:us-east-1:s3"
user = "testaccess:testsecret0123456789"
upload-file = "$file"
url = "$endpoint/curl-$round/or-1/$file"
header = "x-amz-content-sha256: $(sha256sum "$file" | cut -d' ' -f1)"
header = "x-amz-object-lock-mode: COMPLIANCE"
header = "x-amz-object-lock-retain-until-date: $ends"
EOF
  done
  began=$(date +%s%N)
  curl -K "$scratch/transfers"
  echo "curl $(($(date +%s%N) - began))"
done | awk -v bytes="$bytes" -v files="${#files[@]}" '
  { if (!($1 in best) || $2 < best[$1]) best[$1] = $2 }
  END {
    printf "%d files, %.0f MB\n", files, bytes / 1e6
    for (name in best) printf "%s %.1f MB/s\n", name, bytes * 1e3 / best[name]
    printf "kiroku ship reaches %.2f of the speed of curl (goal 0.8)\n", best["curl"] / best["ship"]
  }'
