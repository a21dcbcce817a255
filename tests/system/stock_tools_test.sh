#!/usr/bin/env bash
# The scripts of docs/how-to/verify-with-stock-tools.md, run as they stand against a fresh case and excerpts of it: intact; against changed copies: not intact, for
# the right reason; with inputs that do not fit: could not be checked.
# Usage: stock_tools_test.sh KIROKU SOURCE_DIR [--every-profile]
# With --every-profile (the nightly run) each change is made to a copy of each profile's case. Else those are that the words of a verdict rest on (`central`), of
# the others one in three, and of a case of MPEG-2 alone: the scripts read ledgers, and of pictures nothing but hashes.
set -euo pipefail
kiroku=$1 source=$2 every=${3-}
source "$source/tests/support/flip_bit.sh"
for tool in openssl sha256sum jq awk age ffmpeg; do
  command -v "$tool" >/dev/null || { echo "SKIPPED: $tool is not installed"; exit 77; }
done
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export KIROKU_HOME=$scratch/home
fail() { echo "FAILED: $*"; exit 1; }
hashes_alone() { [[ $profile != mpeg2 && $every != --every-profile ]]; }
nth_change=0
central='^(not signed|another root.*|unnamed files|missing or changed|not what was recorded|is missing|no checkpoint over all|control characters)$'
left_out() { # PATTERN: whether this change is for the nightly run alone
  hashes_alone || { [[ $every != --every-profile && ! $1 =~ $central ]] && ((nth_change++ % 3 != 0)); }
}

page=$source/docs/how-to/verify-with-stock-tools.md
awk '/^```bash$/ { on = 1; next } /^```$/ { on = 0 } on' "$page" >"$scratch/verify.sh"
awk '/^```bash excerpt$/ { on = 1; next } /^```$/ { on = 0 } on' "$page" >"$scratch/verify-excerpt.sh"
lines=$(wc -l <"$scratch/verify.sh") excerpt_lines=$(wc -l <"$scratch/verify-excerpt.sh")
# People read them whole: a line more is a rule more, and none grows unseen.
((lines > 20 && lines <= 320)) || fail "the script for cases has $lines lines; it must have at most 320"
((excerpt_lines > 20 && excerpt_lines <= 385)) || fail "the script for excerpts has $excerpt_lines lines; it must have at most 385"

"$kiroku" init --demo >/dev/null
KIROKU_HOME=$scratch/other "$kiroku" init --demo >/dev/null
# A network camera's pictures come in bursts, and keep the times at which they came: none of them is left out.
burst() { # PORT: 40 pictures, five at a time
  python3 - "$scratch/burst.ts" "$1" <<'SENDER'
import socket, sys, time
film = open(sys.argv[1], "rb").read()
packets = [film[at:at + 1316] for at in range(0, len(film), 1316)]
to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for _ in range(3):  # until the recorder listens
    for part in range(8):
        for packet in packets[part * len(packets) // 8:(part + 1) * len(packets) // 8]: to.sendto(packet, ("127.0.0.1", int(sys.argv[2])))
        time.sleep(0.5)
SENDER
}
ffmpeg -v error -f lavfi -i 'testsrc=size=160x120:rate=10' -frames:v 40 -c:v mpeg2video -g 5 -bf 0 -f mpegts "$scratch/burst.ts"
port=$(python3 -c 'import socket; s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
burst "$port" &
of_burst=$("$kiroku" record --endoscope "udp://127.0.0.1:$port" --duration 00:00:05 --json | jq -r .case)
wait
said=$(bash "$scratch/verify.sh" "$of_burst" "$KIROKU_HOME/own-authority.pem" "$KIROKU_HOME/device.pub" "$KIROKU_HOME/identity.txt" 2>&1) || fail "bursts: $said"
grep -q '^INTACT: ' <<<"$said" || fail "bursts: $said"

for profile in mpeg2 lossless; do
  case=$("$kiroku" record --endoscope 'synthetic:endoscope?size=160x120&rate=10' --room 'synthetic:room?size=160x120&rate=10' --vitals synthetic:patient \
    --profile "$profile" --duration 00:00:05 --json | jq -r .case)
  roots=$KIROKU_HOME/own-authority.pem device=$KIROKU_HOME/device.pub
  expect() { # STATUS PATTERN SCRIPT DIRECTORY [IDENTITY]
    local output status=0
    output=$(bash "$scratch/$3" "$4" "$roots" "$device" ${5+"$5"} 2>&1) || status=$?
    [[ $status == "$1" ]] && grep -q "$2" <<<"$output" || fail "$profile: expected $1 and '$2', got $status: $output"
  }
  expect 0 '^INTACT: ' verify.sh "$case"
  expect 0 '^INTACT: ' verify.sh "$case" "$KIROKU_HOME/identity.txt"

  # By its name and policy, whatever it is given as.
  expect 0 ': self-issued, so the recorder says' verify.sh "$case"
  OWN_ROOTS=$KIROKU_HOME/own-authority.pem expect 0 ': self-issued, so the recorder says' verify.sh "$case"

  # What a person gives that does not fit is no fault of the case, and no proof of it either.
  wrong_inputs() { # SCRIPT DIRECTORY
    ! hashes_alone || return 0
    roots=$scratch/other/own-authority.pem expect 2 '^COULD NOT CHECK: .*no root in your ROOTS.pem' "$@"
    roots=$scratch/none.pem expect 2 '^COULD NOT CHECK: there is no readable' "$@"
    roots=$device expect 2 '^COULD NOT CHECK: .*no root in your ROOTS.pem' "$@"
    device=$scratch/other/device.pub expect 2 '^COULD NOT CHECK: .*not the one of your DEVICE.pub' "$@"
    expect 2 '^COULD NOT CHECK: .*your IDENTITY does not open' "$@" "$scratch/other/identity.txt"
    expect 2 '^COULD NOT CHECK: .*your IDENTITY does not open' "$@" "$roots"
  }
  wrong_inputs verify.sh "$case"
  device=$scratch/other/device.pub expect 1 '^NOT INTACT: .*missing or changed' verify.sh "$(rm -rf "$scratch/less"; cp -r "$case" "$scratch/less"; rm -r "$scratch/less/segments/vitals"; echo "$scratch/less")"

  expect 2 '^COULD NOT CHECK: the folder is called by the identifier of another case' verify.sh "$(rm -rf "$scratch/20250101T000000Z-00000000"; cp -r "$case" "$scratch/20250101T000000Z-00000000"; echo "$scratch/20250101T000000Z-00000000")"
  copy=$scratch/copy
  tampered() { # PATTERN COMMAND: in a copy of the case
    ! left_out "$1" || return 0
    rm -rf "$copy"
    cp -r "$case" "$copy"
    (cd "$copy" && eval "$2")
    expect 1 "^NOT INTACT: .*$1" verify.sh "$copy"
  }
  tampered 'missing or changed' 'flip_bit "$(ls segments/endoscope/*.age | sed -n 1p)" 300'
  tampered 'missing or changed' 'rm $(ls segments/vitals/*.age | sed -n 1p)'
  tampered 'unnamed files' 'touch segments/room/stray'
  tampered 'hole' 'sed -i 3d ledger.jsonl'
  tampered 'another root' 'sed -i "2s/\"utc\":\"2/\"utc\":\"3/" ledger.jsonl'
  tampered 'not signed' 'sed -i -e "3{s/^A/B/;t;s/^./A/" -e "}" "$(ls checkpoints/*.note | sed -n 1p)"'
  tampered 'not one recording' 'sed -i "\$d" ledger.jsonl; sed -i "/\"type\":\"close\"/,\$d" ledger.jsonl'

  tampered 'does not hold for' 'rm "$(ls checkpoints/*.note | sed -n 1p)"'
  # What a checkpoint says beside size and root no verifier reads.
  with_more() { # NOTE: signed by the device, with one more line
    local name id
    IFS=+ read -r name id _ <"$device"
    sed '/^$/,$d' "$1" >"$scratch/text" && echo more >>"$scratch/text"
    openssl pkeyutl -sign -rawin -inkey "$KIROKU_HOME/device.key" -in "$scratch/text" -out "$scratch/signature"
    { cat "$scratch/text"; echo; echo "— $name $( (printf "$(sed 's/../\\x&/g' <<<"$id")"; cat "$scratch/signature") | base64 -w0)"; } >"$1"
  }
  tampered 'states another size, or more' 'with_more "$(ls checkpoints/*.note | tail -1)"'

  tampered 'no plain file' 'film=$(ls segments/endoscope/* | sed -n 1p); mv "$film" ../film; ln -s "$PWD/../film" "$film"'
  tampered 'no plain file' "mkdir -p \$'authorities/a.pem\\nf authorities'; touch \$'authorities/a.pem\\nf authorities/b.pem'"
  tampered 'not whole' 'tail -1 ledger.jsonl | tr -d "\n" >>ledger.jsonl'
  tampered 'another form' 'sed -i "s/\"frames\":[0-9]*/\"frames\":\"leaf[\$(touch ..\/ran)]\"/" ledger.jsonl'
  # Zero bytes, which the shell drops before it hashes and behind which jq skips, hide what a line says.
  tampered 'control characters' 'line=$(grep -n "\"type\":\"segment\"" ledger.jsonl | sed -n 1p | cut -d: -f1); sed -i "${line}s/\"type\":\"segment\"/\"type\":\"s\x00egment\"/" ledger.jsonl'
  # A signature of somebody else beside the device's is no fault; no token is over the last checkpoint's bytes.
  rm -rf "$copy"; cp -r "$case" "$copy"
  echo "— witness $(head -c 68 /dev/urandom | base64 -w0)" >>"$(ls "$copy"/checkpoints/*.note | tail -1)"
  expect 0 '^INTACT: ' verify.sh "$copy"

  # Who made a folder may have signed it with a key of their own. The scripts run nothing of it, and no word of it passes for theirs.
  evil_size='leaf[$(touch '$scratch'/ran)]'
  evil() { # LINES: the folder's, signed anew by nobody's device; the first checkpoint's size is a command
    openssl genpkey -algorithm ed25519 -out "$scratch/evil.pem" 2>/dev/null
    local key
    key=or3+00000000+$( (printf '\1'; openssl pkey -in "$scratch/evil.pem" -pubout -outform DER | tail -c 32) | base64 -w0)
    rm -f "$copy"/checkpoints/* && jq -c --arg key "$key" 'if .type == "open" then .device = $key else . end' "$copy/$1" >"$scratch/lines" && mv "$scratch/lines" "$copy/$1"
    printf '%s\n' "kiroku/or3/x" "$evil_size" AAAA >"$scratch/text"
    openssl pkeyutl -sign -rawin -inkey "$scratch/evil.pem" -in "$scratch/text" -out "$scratch/signature"
    { cat "$scratch/text"; echo; echo "— or3 $( (printf '\0\0\0\0'; cat "$scratch/signature") | base64 -w0)"; } >"$copy/checkpoints/00000001.note"
  }
  rm -rf "$copy"; cp -r "$case" "$copy"; evil ledger.jsonl
  expect 1 '^NOT INTACT: .*states another size' verify.sh "$copy"
  [[ ! -e $scratch/ran ]] || fail "$profile: the script ran what a case says"

  # Who holds the device's key may sign anything, and have it stamped. What the format's rules refuse the script refuses, as `kiroku verify` does.
  sign() { # FILTER [SED]: of the case's entries, changed, renumbered, signed and stamped anew
    tried=true
    rm -rf "$copy"
    cp -r "$case" "$copy"
    jq -c -s "$1 | to_entries[] | .value + {seq: .key}" "$case/ledger.jsonl" | sed "${2-}" >"$copy/ledger.jsonl"
    python3 "$source/tests/system/sign_anew.py" "$copy" "$KIROKU_HOME"
  }
  fresh='map(select(.type != "token"))'
  of_kiroku() { # STATUS
    local status=0
    $tried || return 0
    "$kiroku" verify "$copy" >/dev/null 2>&1 || status=$?
    [[ $status == "$1" ]] || fail "$profile: kiroku verify left with $status, not $1"
  }
  forge() { # PATTERN FILTER [SED]
    sign "$fresh | $2" "${3-}"
    expect 1 "^NOT INTACT: .*$1" verify.sh "$copy"
  }
  forged() { # PATTERN FILTER [SED]
    ! left_out "$1" || { tried=false; return 0; }
    forge "$@"
  }
  forged_excerpt() { # PATTERN FILTER [SED]: the same of an excerpt of it
    ! left_out "$1" || { tried=false; return 0; }
    forge "$@"
    rm -rf "$scratch/part"
    "$kiroku" excerpt "$copy" -o "$scratch/part" --from 00:00:00 --to 00:00:04 >/dev/null
    expect 1 "^NOT INTACT: .*$1" verify-excerpt.sh "$scratch/part"
  }
  if [[ $profile == mpeg2 ]]; then
    # Nobody was asked before the end, or the end was stamped long after it: no deviation. The remarks on outside tokens that a script makes
    # are asked for where there is an outside authority (tests/attack/readers).
    sign "$fresh" && of_kiroku 0
    expect 0 '^INTACT: ' verify.sh "$copy"
    sign 'map(select(.type != "token" or .checkpoint < 5))' && of_kiroku 0
    expect 0 '^INTACT: ' verify.sh "$copy"
    sign "$fresh"' | .[0].streams[0].kind = "audio"' && of_kiroku 1
    expect 1 '^NOT INTACT: ' verify.sh "$copy"
    forged_excerpt 'begins before the segment before it ends' '(.[] | select(.stream == "room" and .index == 1) | .start_ns) -= 5e8' && of_kiroku 1
    forged_excerpt 'not the next segment' '([.[] | select(.stream == "room")][:2]) as [$a, $b]
      | map(if . == $a then $b + ($a | {utc, mono_ns, start_ns, end_ns}) elif . == $b then $a + ($b | {utc, mono_ns, start_ns, end_ns}) else . end)' && of_kiroku 1
    forged 'goes on, behind recovered' '.[:3] + [.[2] | {type: "recovered", utc, mono_ns, boot_id: "x", after: "crash", truncated: ""}] + .[3:]' && of_kiroku 1
    sign "$fresh"' | (.[] | select(.stream == "room" and .index == 2) | .end_ns) += 15e9 | .[-1].mono_ns += 1e9' && of_kiroku 3
    expect 2 '^COULD NOT CHECK: .*more than 11 s' verify.sh "$copy"
    sign "$fresh"' | (.[] | select(.stream == "room" and .index == 2) | .end_ns) += 3e9 | .[-1].mono_ns += 1e9' && of_kiroku 3
    expect 2 '^COULD NOT CHECK: .*was written before its segment could end' verify.sh "$copy"
    sign "$fresh"' | (.[] | select(.stream == "room" and .index == 2) | .end_ns) += 15e9 | .[-1].mono_ns += 1e9'
    rm -rf "$scratch/part" && "$kiroku" excerpt "$copy" -o "$scratch/part" --from 00:00:00 --to 00:00:05 >/dev/null
    expect 2 '^COULD NOT CHECK: .*more than 11 s' verify-excerpt.sh "$scratch/part"
    forged 'other totals' '.[-1].totals.room.frames += 100' && of_kiroku 1
    forged 'a key twice' . '0,/"type":"segment"/s//"type":"gap","type":"segment"/' && of_kiroku 1
    forged 'type that nobody knows' '.[:3] + [.[2] | {type: "annulled", utc, mono_ns}] + .[3:]' && of_kiroku 1
    forged 'earlier case clock' '.[-2].mono_ns = 5' && of_kiroku 1
    forged 'open does not name' '(.[] | select(.stream == "vitals") | .stream) = "secret"' && of_kiroku 1
    forged 'other keys' '.[2].note = "x"' && of_kiroku 1
    forged 'names its segment otherwise' '(.[] | select(.stream == "vitals" and .index == 1) | .file) |= sub("00000001"; "1")'
    forged 'another size' '(.[] | select(.stream == "room" and .index == 0) | .bytes) += 1 | .[-1].totals.room.bytes += 1' && of_kiroku 1
    forged 'room has nothing from 2 to 2.5 s' '(.[] | select(.stream == "room" and .index == 1) | .start_ns) += 5e8' && of_kiroku 1
    forged 'does not say what its segment holds' '(.[] | select(.stream == "room" and .index == 0)) |= del(.first_pts, .time_base, .frames, .dropped)' && of_kiroku 1
    # The first token stays. The case clock goes on for ten minutes to the next; of a few seconds its authority tells.
    sign 'del(.[-1]) | .[3:] |= map(.mono_ns += 6e11)' && of_kiroku 3
    expect 2 '^COULD NOT CHECK: .*the case clock went on by another time' verify.sh "$copy"
    sign 'del(.[-1]) | .[2].accuracy_ns += 1' && of_kiroku 1
    expect 1 '^NOT INTACT: .*another accuracy' verify.sh "$copy"
    # A stream that is stated to be read from a file may be shorter than the case; nobody is left to think otherwise.
    sign "$fresh"' | .[0].streams[].timing = "source" | .[-1].mono_ns += 12e9' && of_kiroku 0
    expect 0 '^remark: endoscope, which was read from .* of a case from 0 to 17' verify.sh "$copy"
    expect 0 '^INTACT: ' verify.sh "$copy"
    # A gap of ten hours in a case of a few seconds.
    sign "$fresh"' | .[-1] as $close | .[:-1] + [{type: "gap", stream: "room", start_ns: $close.mono_ns, end_ns: 36e12, cause: "signal-lost"} + ($close | {utc, mono_ns}), $close]' && of_kiroku 3
    expect 2 '^COULD NOT CHECK: .*a gap of room is stated until 36000 s' verify.sh "$copy"
    # Nothing was recorded in the hour of which the opening says that it was recorded ahead.
    sign "$fresh"' | .[].mono_ns += 36e11 | (.[] | select(.start_ns)) |= (.start_ns += 36e11 | .end_ns += 36e11 | if .time_base == "1/1000000000" then .first_pts += 36e11 else . end) | .[0].begins_ns = 1' && of_kiroku 3
    expect 2 '^COULD NOT CHECK: .*nothing is there before' verify.sh "$copy"
  fi

  # An excerpt out of the middle, one from the beginning to the end, and one for a new reader.
  excerpt=$scratch/excerpt
  take() { rm -rf "$excerpt" && "$kiroku" excerpt "$case" -o "$excerpt" "$@" >/dev/null; }
  take --from 00:00:02 --to 00:00:04 --stream endoscope
  expect 4 '^INTACT EXCERPT: .*endoscope from 2000000000 to 4000000000 ns' verify-excerpt.sh "$excerpt"
  expect 4 '^INTACT EXCERPT: ' verify-excerpt.sh "$excerpt" "$KIROKU_HOME/identity.txt"
  OWN_ROOTS=$KIROKU_HOME/own-authority.pem expect 4 ': self-issued, so the recorder says' verify-excerpt.sh "$excerpt"
  expect 2 '^COULD NOT CHECK: this is an excerpt' verify.sh "$excerpt"
  expect 2 '^COULD NOT CHECK: this is not an excerpt' verify-excerpt.sh "$case"
  wrong_inputs verify-excerpt.sh "$excerpt"
  tampered_excerpt() { # PATTERN COMMAND: in a copy of the excerpt
    ! left_out "$1" || return 0
    rm -rf "$copy"
    cp -r "$excerpt" "$copy"
    (cd "$copy" && eval "$2")
    expect 1 "^NOT INTACT: .*$1" verify-excerpt.sh "$copy"
  }
  tampered_excerpt 'not what was recorded' 'flip_bit "$(ls segments/endoscope/* | sed -n 1p)" 300'
  tampered_excerpt 'is missing' 'rm $(ls segments/endoscope/* | sed -n 1p)'
  tampered_excerpt 'unnamed files' 'touch segments/stray'
  tampered_excerpt 'no excerpt of this case' 'jq -c ".streams = []" excerpt.json >x; mv x excerpt.json'
  tampered_excerpt 'no excerpt of this case' 'jq -c ".streams += .streams" excerpt.json >x; mv x excerpt.json'
  tampered_excerpt 'no excerpt of this case' 'jq -c ".streams = [\"kitchen\"]" excerpt.json >x; mv x excerpt.json'
  tampered_excerpt 'no excerpt of this case' 'jq -c ".to_ns = .from_ns" excerpt.json >x; mv x excerpt.json'
  tampered_excerpt 'no excerpt of this case' 'jq -c ".from_ns = -1" excerpt.json >x; mv x excerpt.json'
  tampered_excerpt 'control characters' 'sed -i "1s/^{/{\x00/" ledger-part.jsonl'
  tampered_excerpt 'excerpt of nothing' 'jq -c ".from_ns += 900000000000 | .to_ns += 900000000000" excerpt.json >x; mv x excerpt.json'
  tampered_excerpt 'are not the entries' 'sed -i 2d ledger-part.jsonl'
  tampered_excerpt 'another root\|not entry 0' 'sed -i "2s/\"utc\":\"2/\"utc\":\"3/" ledger-part.jsonl'
  tampered_excerpt 'not entry 0' 'sed -i "s/\"boot_id\":\"/&0/" ledger-open.jsonl'
  tampered_excerpt 'no checkpoint over all' 'rm "$(ls checkpoints/*.note | tail -1)"'
  tampered_excerpt 'not signed' 'sed -i -e "3{s/^A/B/;t;s/^./A/" -e "}" "$(ls checkpoints/*.note | tail -1)"'
  rm -rf "$copy"; cp -r "$excerpt" "$copy"; evil ledger-open.jsonl
  rm -r "$copy/tokens"
  jq -c '.first_entry = 0 | .size = ([inputs | select(.type != "token")] | length) + 1' "$excerpt/excerpt.json" "$excerpt/ledger-part.jsonl" >"$copy/excerpt.json"
  cp "$copy/ledger-open.jsonl" "$scratch/lines" && jq -c -s 'map(select(.type != "token")) | to_entries[] | .value + {seq: (.key + 1)}' "$excerpt/ledger-part.jsonl" >>"$scratch/lines" &&
    mv "$scratch/lines" "$copy/ledger-part.jsonl"
  expect 1 '^NOT INTACT: .*states another size' verify-excerpt.sh "$copy"
  [[ ! -e $scratch/ran ]] || fail "$profile: the script ran what an excerpt says"
  take --from 00:00:00 --to 00:00:05
  tampered_excerpt 'another form' 'jq -c ".to_ns = \"9 ns\nINTACT: $(basename "$case"), all of it\"" excerpt.json >x; mv x excerpt.json'
  tampered_excerpt 'another form' 'cat excerpt.json excerpt.json >x; mv x excerpt.json'
  expect 4 '^INTACT EXCERPT: ' verify-excerpt.sh "$excerpt" "$KIROKU_HOME/identity.txt"
  age-keygen -o "$scratch/expert.txt" 2>/dev/null
  take --from 00:00:02 --to 00:00:04 --to-recipient "$(age-keygen -y "$scratch/expert.txt")"
  expect 2 '^COULD NOT CHECK: .*re-keyed for a new reader' verify-excerpt.sh "$excerpt" "$scratch/expert.txt"
  tampered_excerpt 'not what was recorded' 'cp $(ls segments/endoscope/*.header | sed -n 1p) x; (cat x; echo) >$(ls segments/endoscope/*.header | sed -n 1p); rm x'
  rm "$scratch/expert.txt"
done
# A case that was cut off and found again is no whole one, and the script says what is missing.
timeout -s KILL 4 "$kiroku" record --endoscope 'synthetic:endoscope?size=160x120&rate=10' --segment 1s --duration 00:01:00 >/dev/null 2>&1 || true
"$kiroku" recover >/dev/null
case=$(grep -l '"type":"recovered"' "$KIROKU_HOME"/archive/2*/ledger.jsonl | sed -n 1p)
expect 0 '^INTACT WITH GAPS: .*recording was cut off and found again; .*endoscope: 1 gap' verify.sh "$(dirname "$case")"
echo "PASSED: the page's $lines and $excerpt_lines lines find what they should"
