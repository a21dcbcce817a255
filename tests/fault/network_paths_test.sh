#!/usr/bin/env bash
# Real networks between the recorder and the authority, in two network namespaces joined by two links: "hospital" (the usual route) and "wwan0" (a modem). A
# blocked link swallows packets, as a firewall does. Usage: network_paths_test.sh KIROKU. Leaves with 77 where namespaces cannot be made.
set -euo pipefail
kiroku=$1
for tool in ip jq; do
  command -v "$tool" >/dev/null || { echo "SKIPPED: $tool is not installed"; exit 77; }
done
recorder=kiroku-r-$$ world=kiroku-w-$$
ip netns add "$recorder" 2>/dev/null || { echo "SKIPPED: network namespaces cannot be made here"; exit 77; }
scratch=$(mktemp -d)
authority=
cleanup() {
  if [[ -n $authority ]]; then kill "$authority" 2>/dev/null || true; fi
  ip netns del "$recorder" || true
  ip netns del "$world" 2>/dev/null || true
  rm -rf "$scratch"
}
trap cleanup EXIT
fail() { echo "FAILED: $*"; exit 1; }

ip netns add "$world"
link() { # NAME NUMBER
  ip link add "$1" netns "$recorder" type veth peer name "$1" netns "$world" || { echo "SKIPPED: no virtual links here"; exit 77; }
  ip -n "$recorder" address add "10.77.$2.1/24" dev "$1"
  ip -n "$world" address add "10.77.$2.2/24" dev "$1"
  ip -n "$recorder" link set "$1" up
  ip -n "$world" link set "$1" up
  ip -n "$recorder" route add 10.77.9.9 via "10.77.$2.2" metric "$2"
}
ip -n "$recorder" link set lo up
ip -n "$world" link set lo up
ip -n "$world" address add 10.77.9.9/32 dev lo
link hospital 1
link wwan0 2
block() { ip -n "$world" route add blackhole "10.77.$1.1/32"; }
unblock() { ip -n "$world" route del blackhole "10.77.$1.1/32"; }

export KIROKU_HOME=$scratch/home
in_or() { ip netns exec "$recorder" "$@"; }
"$kiroku" init --demo >/dev/null
cat >"$KIROKU_HOME/kiroku.toml" <<'TOML'
[[authority]]
name = "outside"
url = "http://10.77.9.9:3161/"
connect_timeout = "500ms"
[[authority.path]]
[[authority.path]]
interface = "wwan0"
TOML
ip netns exec "$world" "$kiroku" tsa serve --listen 10.77.9.9:3161 >"$scratch/authority.txt" 2>&1 &
authority=$!
for _ in {1..100}; do
  in_or bash -c 'exec 3<>/dev/tcp/10.77.9.9/3161' 2>/dev/null && break
  sleep 0.1
done
record() { in_or "$kiroku" record --json --vitals 'synthetic:patient' --duration "$1" --stamp-every 1s; }
verdict() { "$kiroku" verify --json "$1" | jq -r .verdict; }

echo "The usual route is open: it is taken"
answer=$(record 3s)
[[ $(jq -r '.authorities[0].path' <<<"$answer") == directly ]] || fail "not the usual route: $answer"
[[ $(verdict "$(jq -r .case <<<"$answer")") == intact ]] || fail "not intact"

echo "The usual route is blocked: the modem solves it, without one time-stamp missed"
block 1
answer=$(record 3s)
[[ $(jq -r '.authorities[0].path' <<<"$answer") == 'over wwan0' ]] || fail "not over the modem: $answer"
[[ $(jq -r .missed <<<"$answer") == 0 ]] || fail "missed: $answer"
[[ $(verdict "$(jq -r .case <<<"$answer")") == intact ]] || fail "not intact"

echo "The modem fails in the middle and the usual route is open again: time-stamps go on"
record 8s >"$scratch/answer.json" 2>"$scratch/record.txt" &
recording=$!
sleep 3
block 2
unblock 1
wait "$recording"
answer=$(cat "$scratch/answer.json")
[[ $(jq -r '.authorities[0].path' <<<"$answer") == directly ]] || fail "not back on the usual route: $answer"
[[ $(verdict "$(jq -r .case <<<"$answer")") == intact ]] || fail "not intact: $answer"

echo "Both are blocked: the recording goes on, and is stamped later over what opens first"
block 1
answer=$(record 2s)
case=$(jq -r .case <<<"$answer")
[[ $(jq -r .tokens <<<"$answer") == 0 ]] || fail "a token came through a blocked network: $answer"
[[ $(jq -r '.authorities[0].last_error' <<<"$answer") == *'over wwan0: '* ]] || fail "not both were tried: $answer"
[[ $(verdict "$case") == unproven ]] || fail "proven without a token"
if in_or "$kiroku" stamp; then fail "stamped through a blocked network"; fi
unblock 2
answer=$(in_or "$kiroku" stamp --json)
[[ $(jq -r '.stamped[0].path' <<<"$answer") == 'over wwan0' ]] || fail "not stamped over the modem: $answer"
[[ $(verdict "$case") == intact-with-gaps ]] || fail "not intact with gaps: $("$kiroku" verify "$case")"
echo "held"
