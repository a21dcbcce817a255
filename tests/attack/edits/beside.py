"""What lies beside a case: its evidence record, what is sealed in its segments, the proof of its end in the log, notes
that witnesses cosigned, legal holds, and two logs laid side by side. Edits of these, and what may at most be said then.

Each `objections_…` yields sentences, as oracle.py does, and shares no rule with the programs."""
import base64
import hashlib
import json
import struct
import subprocess

import tree as t
from grammar import Edit, Unfit, _bytes, _flipped, _guarded, of_value

PROOF, NOTE, POLICY = "case.tlog-proof", "cosigned.note", "policy.txt"


# Evidence records: any value of the DER (X.690), at any depth


def _values(data, begin=0, end=None, path=()):
    """Of each value: where it stands, from its identifier octet on, and its path."""
    end, number = len(data) if end is None else end, 0
    while begin < end:
        head, size = begin + 2, data[begin + 1]
        if size & 0x80:
            octets = size & 0x7f
            size, head = int.from_bytes(data[head:head + octets], "big"), head + octets
        if head + size > end:
            return
        yield begin, head, head + size, path + (number,)
        if data[begin] & 0x20:
            yield from _values(data, head, head + size, path + (number,))
        begin, number = head + size, number + 1


def _length(size):
    if size < 0x80:
        return bytes([size])
    octets = size.to_bytes((size.bit_length() + 7) // 8, "big")
    return bytes([0x80 | len(octets)]) + octets


def _with(data, target, change):
    """The DER with another value (or none, or several) in the place of one; lengths above it fit again."""
    made, at = b"", 0
    for begin, head, end, path in list(_values(data)):
        if len(path) != 1 or path[0] != target[0]:
            continue
        if len(target) == 1:
            inner = change(data[begin:end])
        else:
            content = _with(data[head:end], target[1:], change)
            inner = data[begin:begin + 1] + _length(len(content)) + content
        made += data[at:begin] + inner
        at = end
    return made + data[at:]


def of_record(record, path):
    """Of each value of the record down to the tokens' certificates: gone, twice, changed, before the one before it."""
    def edit(name, where, change):
        def apply(tree, hands):
            made = _with(_bytes(tree, path), where, change)
            if made == tree[path]:
                raise Unfit(name)
            tree[path] = made
        return Edit(f"record {'.'.join(map(str, where))}: {name}", False, apply)

    def content(change):
        return lambda value: value[:1] + _length(len(made := change(value[len(value) - size_of(value):]))) + made

    def size_of(value):
        return next(end - head for _, head, end, where in _values(value) if len(where) == 1)

    for begin, head, end, where in _values(record):
        yield edit("removed", where, lambda value: b"")
        yield edit("twice", where, lambda value: value + value)
        if end > head:
            yield edit("emptied", where, lambda value: value[:1] + b"\0")
            for name, at in (("first", 0), ("last", end - head - 1)):
                yield edit(f"a bit of the {name} octet", where, content(lambda inner, at=at: _flipped(inner, at)))
            yield edit("longer", where, content(lambda inner: inner + b"\0"))
        yield edit("another tag", where, lambda value: bytes([value[0] ^ 1]) + value[1:])


def is_same_proof(record, other):
    """Of the newest token nobody signs which certificates travel with it, nor the names of algorithms outside of what is signed (RFC 5652: digestAlgorithms,
    a signer's digestAlgorithm and signatureAlgorithm): those that are no part of its path, and names that do not keep the signature from holding, decide
    nothing. Nor does the record's own list of algorithms (RFC 4998 section 3.2: digestAlgorithms), which no step of a verification reads. The newest
    ArchiveTimeStamp need not state its algorithm where that is its token's (section 4.1), as it is in every record that is edited here."""
    def bare(data):
        bags = [path for begin, _, _, path in _values(data) if len(path) == 8 and path[:2] == (0, 2) and path[5:] == (1, 0, 3) and data[begin] == 0xa0]
        if not bags:
            return data
        signed_data = max(bags)[:-1]
        for unsigned in ((4, 0, 4), (4, 0, 2), (3,), (1,)):
            data = _with(data, signed_data + unsigned, lambda value: b"")
        return _with(data, (0, 1), lambda value: b"")

    def without_algorithm(data):
        newest = max(path for begin, _, _, path in _values(data) if len(path) == 4 and path[:2] == (0, 2))
        return _with(data, newest + (0,), lambda value: b"" if value[0] == 0xa0 else value)
    return isinstance(record, bytes) and bare(record) in (bare(other), bare(without_algorithm(other)))


# What is sealed in a segment, by whoever holds the device's key


def _parts(data):
    """Of an age v1 file: the header with its MAC's line, the nonce, the chunks of 64 KiB."""
    end = data.index(b"\n", data.index(b"\n--- ") + 1) + 1
    body = data[end + 16:]
    return data[:end], data[end:end + 16], [body[i:i + 65_552] for i in range(0, len(body), 65_552)]


def _sealed_changes():
    def of_chunks(change):
        return lambda header, nonce, chunks: (header, nonce, change(chunks))

    yield "no stanza", lambda header, nonce, chunks: (header.split(b"\n-> ")[0] + b"\n" + header[header.index(b"--- "):], nonce, chunks)
    yield "a stanza twice", lambda header, nonce, chunks: (header[:header.index(b"--- ")] + header[header.index(b"-> "):], nonce, chunks)
    yield "another stanza beside it", lambda header, nonce, chunks: (header[:header.index(b"--- ")] + b"-> grease\nAAAA\n" + header[header.index(b"--- "):], nonce, chunks)
    yield "a bit of the stanza's share", lambda header, nonce, chunks: (_digit(header, header.index(b"-> X25519 ") + 15), nonce, chunks)
    yield "a bit of the file key", lambda header, nonce, chunks: (_digit(header, header.index(b"--- ") - 12), nonce, chunks)
    yield "a bit of the header's MAC", lambda header, nonce, chunks: (_digit(header, header.index(b"--- ") + 8), nonce, chunks)
    yield "another version", lambda header, nonce, chunks: (header.replace(b"/v1", b"/v2"), nonce, chunks)
    yield "another nonce", lambda header, nonce, chunks: (header, _flipped(nonce, 3), chunks)
    yield "no chunk", of_chunks(lambda chunks: [])
    yield "the last chunk gone", of_chunks(lambda chunks: chunks[:-1])
    yield "the last chunk twice", of_chunks(lambda chunks: chunks + chunks[-1:])
    yield "the first chunk at the end", of_chunks(lambda chunks: chunks[1:] + chunks[:1])
    yield "cut within the last chunk", of_chunks(lambda chunks: chunks[:-1] + [chunks[-1][:-1]])
    yield "the last chunk's tag alone", of_chunks(lambda chunks: chunks[:-1] + [chunks[-1][-16:]])
    yield "a byte behind the last chunk", of_chunks(lambda chunks: chunks[:-1] + [chunks[-1] + b"\0"])
    yield "a bit of the first chunk", of_chunks(lambda chunks: [_flipped(chunks[0], 1)] + chunks[1:])
    yield "a bit of the last tag", of_chunks(lambda chunks: chunks[:-1] + [_flipped(chunks[-1], len(chunks[-1]) - 1)])


def _digit(header, at):
    return header[:at] + (b"A" if header[at:at + 1] != b"A" else b"B") + header[at + 1:]


def of_sealed(steps):
    """The file is another one, and its line states just that."""
    for number, step in enumerate(steps):
        if step.entry is None or step.entry["type"] != "segment":
            continue
        for name, change in _sealed_changes():
            def apply(steps, files, hands, number=number, change=change):
                if number >= len(steps) or steps[number].entry is None or steps[number].entry["type"] != "segment":
                    raise Unfit("no segment")
                _guarded(_sealed_anew)(steps, number, (files, change))
            yield Edit(f"sealed segment {step.entry['seq']}: {name}", True, apply)


def _sealed_anew(steps, number, given):
    files, change = given
    entry = steps[number].entry
    header, nonce, chunks = change(*_parts(_bytes(files, entry["file"])))
    data = header + nonce + b"".join(chunks)
    if data == files[entry["file"]]:
        raise Unfit("the same")
    files[entry["file"]] = data
    entry.update({"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)})


def objections_to_inspection(verdict, names):
    """None of the changes leaves a film that can be opened."""
    if verdict in ("intact", "intact-with-gaps", "intact-excerpt"):
        yield f"{verdict} after its segments were opened with an identity, of which one cannot be: {' + '.join(names)}"


# The proof of a case's end (C2SP tlog-proof)


def of_proof(proof):
    def edit(name, change):
        def apply(tree, hands):
            made = change(_bytes(tree, PROOF), hands)
            if made == tree[PROOF]:
                raise Unfit(name)
            tree[PROOF] = made
        return Edit(f"proof: {name}", False, apply)

    lines = proof.split(b"\n")
    for number, line in enumerate(lines[:-1]):
        def at(replace, number=number):
            def change(data, hands):
                lines = data.split(b"\n")
                return b"\n".join(lines[:number] + replace(lines[number]) + lines[number + 1:])
            return change
        yield edit(f"without line {number}", at(lambda line: []))
        yield edit(f"line {number} twice", at(lambda line: [line, line]))
        yield edit(f"blank behind line {number}", at(lambda line: [line + b" "]))
        for where in (0, len(line) // 2, len(line) - 2):
            if 0 <= where < len(line):
                yield edit(f"character {where} of line {number}", at(lambda line, where=where: [_digit(line, where)]))
        yield edit(f"lines {number} and the next exchanged",
                   lambda data, hands, number=number: b"\n".join((each := data.split(b"\n"))[:number] + each[number:number + 2][::-1] + each[number + 2:]))
        yield edit(f"up to line {number}", lambda data, hands, number=number: b"\n".join(data.split(b"\n")[:number]) + b"\n")
    extra = json.loads(base64.b64decode(next(line[6:] for line in lines if line.startswith(b"extra "))))
    for key, value in extra.items():
        for name, made in of_value(value):
            def change(data, hands, key=key, made=made):
                text = json.dumps({**extra, key: made}, separators=(",", ":")).encode()
                return b"\n".join(b"extra " + base64.b64encode(text) if line.startswith(b"extra ") else line for line in data.split(b"\n"))
            yield edit(f"{key} {name}", change)
    yield edit("cosigned", lambda data, hands: data + hands.outsider.line(data.split(b"\n\n", 1)[1].rpartition(b"\n\n")[0] + b"\n"))
    yield edit("signed by another", lambda data, hands: data.rpartition(b"\n\n")[0] + b"\n\n" + hands.outsider.line(data.split(b"\n\n", 1)[1].rpartition(b"\n\n")[0] + b"\n"))


def objections_to_proof(base, edited, said):
    """Nobody but the device can make one that says anything."""
    body, _, signatures = edited.rpartition(b"\n\n")
    was, _, signed = base.rpartition(b"\n\n")
    genuine = body == was and signed in signatures
    if "log-proof-holds" in said.codes and not genuine:
        yield "an edited proof holds"
    if "log-proof-differs" in said.codes:
        yield "an edited proof speaks against the case"
    if said.verdict == "tampered":
        yield "a case that was not touched is tampered"


# Notes that witnesses cosigned (C2SP tlog-cosignature, tlog-policy)


class Witness:
    """Cosigns whatever it is given."""

    def __init__(self, signer):
        self.signer = signer
        self.id = hashlib.sha256(signer.name.encode() + b"\n\x04" + signer.key.public).digest()[:4]

    @property
    def key(self):
        return f"{self.signer.name}+{self.id.hex()}+{base64.b64encode(bytes([4]) + self.signer.key.public).decode()}"

    def line(self, text, time_s, name=None):
        signature = self.signer.sign(f"cosignature/v1\ntime {time_s}\n".encode() + text)
        return f"\u2014 {name or self.signer.name} {base64.b64encode(self.id + struct.pack('>Q', time_s) + signature).decode()}\n".encode()


def cosigned_tree(note, witnesses, time_s):
    """Two of three must have cosigned, and two did."""
    text = note.partition(b"\n\n")[0] + b"\n"
    policy = "".join(f"witness {each.signer.name} {each.key}\n" for each in witnesses)
    policy += f"group all 2 {' '.join(each.signer.name for each in witnesses)}\nquorum all\n"
    return t.Tree({NOTE: note + b"".join(each.line(text, time_s) for each in witnesses[:2]), POLICY: policy.encode()})


def of_cosigned(tree, witnesses, other_note, time_s):
    """Cosignatures gone, changed, moved, repeated; none of them by a third witness of the policy."""
    def edit(name, change):
        def apply(tree, hands):
            text, _, signatures = _bytes(tree, NOTE).partition(b"\n\n")
            made = change(text + b"\n", signatures.split(b"\n")[:-1], hands)
            if made == tree[NOTE]:
                raise Unfit(name)
            tree[NOTE] = made
        return Edit(f"cosigned note: {name}", False, apply)

    def note(text, lines):
        return text + b"\n" + b"".join(line + b"\n" for line in lines)

    count = _bytes(tree, NOTE).partition(b"\n\n")[2].count(b"\n")
    for number in range(count):
        yield edit(f"without signature {number}", lambda text, lines, hands, number=number: note(text, lines[:number] + lines[number + 1:]))
        yield edit(f"signature {number} twice", lambda text, lines, hands, number=number: note(text, lines + lines[number:number + 1]))
        for where in (4, 7, 20, 40, 60, 80):
            yield edit(f"octet {where} of signature {number}", lambda text, lines, hands, number=number, where=where:
                       note(text, lines[:number] + [_octet(lines[number], where)] + lines[number + 1:]))
        for other in range(count + 1):
            name = witnesses[other].signer.name if other < len(witnesses) else "outsider"
            yield edit(f"signature {number} in the name of {name}", lambda text, lines, hands, number=number, name=name:
                       note(text, lines[:number] + [b"\xe2\x80\x94 " + name.encode() + b" " + lines[number].split(b" ")[2]] + lines[number + 1:]))
    text = _bytes(tree, NOTE).partition(b"\n\n")[0] + b"\n"
    other_text = other_note.partition(b"\n\n")[0] + b"\n"
    yield edit("cosignatures of an older checkpoint", lambda text, lines, hands: note(text, lines[:1]) + b"".join(each.line(other_text, time_s) for each in witnesses[:2]))
    yield edit("on the text of an older checkpoint", lambda text, lines, hands: note(other_text, lines))
    for name, by in (("the device", lambda hands: None), ("an outsider", lambda hands: hands.outsider)):
        def change(_, lines, hands, by=by):
            signer = by(hands)
            return note(text, lines[:2]) + (signer.line(text) if signer else lines[0] + b"\n")
        yield edit(f"a plain signature of {name} in the place of a cosignature", change)
    yield edit("a cosignature of an outsider in a witness's name",
               lambda text, lines, hands: note(text, lines[:2]) + Witness(hands.outsider).line(text, time_s, witnesses[1].signer.name))
    yield edit("a cosignature of no time", lambda text, lines, hands: note(text, lines[:2]) + witnesses[1].line(text, 0))
    yield edit("a cosignature of all time", lambda text, lines, hands: note(text, lines[:2]) + witnesses[1].line(text, (1 << 64) - 1))


def _octet(line, at):
    head, _, blob = line.rpartition(b" ")
    return head + b" " + base64.b64encode(_flipped(base64.b64decode(blob), at))


def objections_to_witnesses(base, edited, report):
    text, _, lines = base.partition(b"\n\n")
    now, _, left = edited.partition(b"\n\n")
    genuine = now == text and all(line in left.split(b"\n") for line in lines.split(b"\n"))
    if (report["witnesses"] or {}).get("quorum") and not genuine:
        yield "the policy's quorum is met, where a cosignature that it needs was changed"


# Legal holds, and two logs side by side


def _standing(lines):
    holds = set()
    for number, line in enumerate(lines):
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if not isinstance(entry, dict):
            continue
        if entry.get("type") == "case-held":
            holds.add((entry.get("case"), number))
        elif entry.get("type") == "case-released":
            holds.discard((entry.get("case"), entry.get("hold")))
    return holds


def _log_lines(edited):
    node = edited.tree.get("ledger.jsonl")
    return node.split(b"\n")[:-1] if isinstance(node, bytes) else None


def ask_holds(program, home):
    """Nothing where it says that nobody can tell."""
    done = subprocess.run([program, "hold", "--list", "--json", "--home", home], capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=60)
    if done.returncode == 2:
        return None
    if done.returncode != 0:
        raise RuntimeError(f"kiroku hold --list ended with {done.returncode}: {done.stderr}")
    return {(hold["case"], hold["hold"]) for hold in json.loads(done.stdout)["holds"]}


def objections_to_holds(edited, holds):
    if holds is None:
        return
    lines = _log_lines(edited)
    if lines is None:
        yield "tells which cases are held, of a log that is not there"
        return
    signed = edited.signed_lines if edited.signed_lines is not None else edited.recorded
    same = next((i for i, (a, b) in enumerate(zip(lines, signed)) if a != b), min(len(lines), len(signed)))
    missing = _standing(signed[:same]) - holds
    if missing:
        yield f"does not tell of the holds {sorted(missing)}, which nobody released who holds the device's key"
    if edited.signed_lines is None and any(size > same and edited.tree.get(f"checkpoints/{size:08d}.note") == note for size, note in edited.base.notes.items()):
        yield f"tells which cases are held, where a checkpoint covers more than the {same} entries that are as they were"


def ask_compare(program, edited_folder, other, device, home):
    done = subprocess.run([program, "log", "compare", edited_folder, other, "--device", device, "--json", "--home", home], capture_output=True, text=True,
                          stdin=subprocess.DEVNULL, timeout=60)
    if done.returncode == 2:
        return None
    return done.returncode, json.loads(done.stdout)


def objections_to_comparison(edited, said):
    if said is None:
        return
    status, comparison = said
    lines, recorded = _log_lines(edited), edited.recorded
    if comparison["two_histories"] and edited.signed_lines is None:
        yield "accuses the device of two histories, of which it signed one"
    if status != 0:
        return
    if lines is None:
        yield "finds one history, of no log"
        return
    short = min(len(lines), len(recorded))
    if lines[:short] != recorded[:short]:
        yield "finds one history, where the lines part"
    if edited.signed_lines is None and len(lines) > len(recorded) and comparison["logs"][0]["unsigned_from"] is None:
        yield "finds one history, and does not say that nobody signed its end"
