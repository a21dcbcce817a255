#!/usr/bin/env python3
"""Makes docs/reference/format-example.md: a whole case, byte by byte.

Usage: docs/reference/make_example.py [--check | --write FOLDER]
  --check          only says whether the page is what this makes; exit status 1 if not
  --write FOLDER   makes the case's folder below FOLDER instead

The case is written by the writer of tests/foreign from fixed keys and, in place of chance, hashes of numbers. So the
bytes are the same each time. It takes Python 3.11 and the program openssl.
"""
import hashlib
import itertools
import json
import pathlib
import struct
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/reference/format-example.md"
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "tests/foreign"))
import age  # noqa: E402
import case_writer as writer  # noqa: E402
import merkle  # noqa: E402
import note  # noqa: E402
import stamp  # noqa: E402

DEVICE = note.Signer("or3", bytes(range(32)))
READER = age.Identity(bytes(range(32, 64)))
BEGUN = stamp.nanoseconds("2026-08-05T09:15:02.000000Z")
SALT = bytes(range(64, 96))


class NoChance:
    """In place of random bytes: SHA-256 of 0, of 1, and so on."""

    def __init__(self):
        self.numbers = itertools.count()

    def __call__(self, size):
        return hashlib.sha256(struct.pack(">Q", next(self.numbers))).digest()[:size]


def make():
    """The case, and the plaintext of its segments."""
    chance, to = NoChance(), [READER.recipient]
    case = writer.Case("20260805T091502Z-3f9c21ab", DEVICE, BEGUN, [
        writer.stream("vitals", "vitals", "application/jsonl", to, source="monitor.csv"),
        writer.stream("events", "events", "application/jsonl", to, source="operator", purpose="marks of the operator")])
    vital = b'{"time_ns":500000000,"code":"MDC_PULS_OXIM_SAT_O2","mdc":150456,"value":97.5,"unit":"%","source":"","quality":"good"}\n'
    event, commitment = writer.event_line(SALT, {"time_ns": 600000000, "utc": "2026-08-05T09:15:02.600000Z", "kind": "mark", "text": "clip placed"})
    case.add("clock", 1_000_000, synchronised=True, offset_ns=-1200, error_ns=250000, step_ns=0)
    case.add("mark", 600_000_000, commitment=commitment)
    case.segment("vitals", 0, 0, 900_000_000, age.seal(vital, [READER.public], chance), 1)
    case.segment("events", 0, 0, 900_000_000, age.seal(event, [READER.public], chance), 1)
    case.close(1_000_000_000)
    case.checkpoint()
    return case, vital, event, commitment


def dump(data, parts):
    """Bytes in rows of sixteen; `parts` says what each run of them is: (length, words)."""
    at, rows = 0, []
    for length, words in parts:
        for begin in range(at, at + length, 16):
            row = data[begin:min(begin + 16, at + length)]
            shown = "".join(chr(b) if 32 <= b < 127 else "." for b in row)
            rows.append(f"{begin:04x}  {row.hex(' '):<47}  {shown:<16}  {words if begin == at else ''}".rstrip())
        at += length
    if at != len(data):
        raise ValueError(f"{len(data)} bytes, of which {at} are explained")
    return "\n".join(rows)


def age_parts(data):
    lines = data[:data.index(b"\n", data.index(b"\n---") + 1) + 1].split(b"\n")[:-1]
    payload = len(data) - sum(len(line) + 1 for line in lines) - 16
    return [(len(lines[0]) + 1, "the version, LF"), (len(lines[1]) + 1, "recipient: X25519, base64 of the ephemeral public key"),
            (len(lines[2]) + 1, "the file key, wrapped: base64 of 16 + 16 bytes"), (len(lines[3]) + 1, "HMAC of the header up to ---"),
            (16, "the nonce of the payload"), (payload - 16, "the one chunk: the plaintext, encrypted"), (16, "the tag of the chunk")]


def request_parts(digest):
    """A TimeStampReq over the note, without a nonce."""
    imprint = bytes.fromhex("300d06096086480165030402010500") + b"\x04\x20" + digest
    body = b"\x02\x01\x01" + bytes([0x30, len(imprint)]) + imprint + b"\x01\x01\xff"
    return bytes([0x30, len(body)]) + body, [(2, "SEQUENCE"), (3, "version 1"), (2, "MessageImprint, SEQUENCE"), (15, "AlgorithmIdentifier: SHA-256"),
                                             (34, "OCTET STRING: SHA-256 of the note's bytes"), (3, "certReq: TRUE")]


def tree(leaves):
    """Each step of the tree over six leaves."""
    pairs = [merkle.node(leaves[i], leaves[i + 1]) for i in (0, 2, 4)]
    four = merkle.node(pairs[0], pairs[1])
    root = merkle.node(four, pairs[2])
    rows = [(f"leaf {i}", f"SHA-256(00 ‖ line {i})", leaf) for i, leaf in enumerate(leaves)]
    rows += [(f"node {2 * i}-{2 * i + 1}", f"SHA-256(01 ‖ leaf {2 * i} ‖ leaf {2 * i + 1})", pair) for i, pair in enumerate(pairs)]
    rows += [("node 0-3", "SHA-256(01 ‖ node 0-1 ‖ node 2-3)", four), ("root", "SHA-256(01 ‖ node 0-3 ‖ node 4-5)", root)]
    return "\n".join(f"{name:<9} {how:<36} {value.hex()}" for name, how, value in rows), root


def page(written, vital, event, commitment):
    data = written.files
    size = len(written.lines)
    note_name = f"checkpoints/{size:08d}.note"
    signed = data[note_name]
    text = signed.split(b"\n\n")[0] + b"\n"
    steps, root = tree(written.leaves)
    if root != written.root():
        raise ValueError("the steps of the tree lead elsewhere")
    request, request_shown = request_parts(hashlib.sha256(signed).digest())
    sealed = data["segments/vitals/00000000.jsonl.age"]
    kinds = [json.loads(line)["type"] for line in written.lines]
    lines = "\n\n".join(f"Line {i}, `{kind}`:\n```json\n{line.decode()}\n```" for i, (kind, line) in enumerate(zip(kinds, written.lines)))
    listing = "\n".join(f"{len(content):>6}  {hashlib.sha256(content).hexdigest()}  {name}" for name, content in sorted(data.items()))
    message = json.loads(event)["event"]
    parts = text.decode().split("\n")
    fields = [(len(line) + 1, words) for line, words in zip(parts, ("origin, LF", "size, LF", "root in base64, LF"))]
    signature = len(signed) - len(text) - 1
    return f"""# A case byte by byte

A whole case of [format 1](format.md): two streams of lines, one segment each, a mark, one checkpoint. Keys and chance
are fixed, so everybody gets these bytes. This page is made from them:

```sh
docs/reference/make_example.py --write /tmp/example    # makes the folder below /tmp/example
docs/reference/make_example.py --check                 # tells whether this page is of those bytes
```
No token is in it, as no authority gives the same answer twice. So `kiroku verify` with this device's key says
`unproven`, with `no-token` as its one finding.

| key | bytes |
|---|---|
| private key of the device (Ed25519) | `{DEVICE.seed.hex()}` |
| verifier key of the device | `{DEVICE.key}` |
| recipient | `{READER.recipient}` |
| identity | `{READER}` |

Never use these keys: everybody has them.

## The folder
`20260805T091502Z-3f9c21ab` holds these files: bytes, SHA-256, name.
```
{listing}
```
The folders `tokens` and `authorities` are empty.

## The ledger
`ledger.jsonl` has {size} lines. Each ends with one LF, which is not part of the leaf.

{lines}

`sha256` of both segments is that of the list above. `totals` adds up the `segment` lines. `appliance_log` is that of a
recorder without a log: no entries, and SHA-256 of nothing.

## The tree
```
{steps}
```
Leaves are hashed with a zero byte in front, nodes with a one. Six is 4 + 2, so the left half has four leaves.

## The checkpoint
`{note_name}`: the text that is signed, an empty line, the signature.
```
{dump(signed, fields + [(1, "LF: an empty line"), (signature, "em dash, space, name, space, base64 of key identifier and signature, LF")])}
```
- The key identifier is the first four bytes of SHA-256 of `or3`, LF, 01 and the public key: `{DEVICE.key.id.hex()}`.
- The signature is Ed25519 of the first {len(text)} bytes:
  `{DEVICE.sign(text).hex()}`.

## The time-stamp request
What an authority is asked for this note, without a nonce:
```
{dump(request, request_shown)}
```
`openssl ts -query -data {note_name} -sha256 -cert -no_nonce` prints the same. The answer would be
`tokens/{size:08d}.<authority>.tsr`, and line {size} a `token` entry.

## A sealed segment
`segments/vitals/00000000.jsonl.age`:
```
{dump(sealed, age_parts(sealed))}
```
The identity opens it (`age -d -i identity.txt`). Inside is one line with its LF:
```json
{vital.decode().rstrip()}
```
The other segment holds the event:
```json
{event.decode().rstrip()}
```

## The mark
The event's text is {len(message.encode())} bytes:
```json
{message}
```
The salt is `{SALT.hex()}`. SHA-256 of its 32 bytes and of
the text's bytes is `{commitment}`: the `commitment` of
line 2.
"""


def main():
    case, vital, event, commitment = make()
    if sys.argv[1:2] == ["--write"] and len(sys.argv) == 3:
        print(case.write(sys.argv[2]).folder)
        return 0
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        made = page(case.write(folder), vital, event, commitment)
    if sys.argv[1:] == ["--check"]:
        if not PAGE.exists() or PAGE.read_text("utf-8") != made:
            print("docs/reference/format-example.md is not of the bytes that are made: run docs/reference/make_example.py", file=sys.stderr)
            return 1
        return 0
    PAGE.write_text(made, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
