"""The edits: of files by anybody, of lines by anybody, and of entries by whoever holds the device's key and writes the
format as an honest implementation does."""
import base64
import copy
import dataclasses
import hashlib
import json
import pathlib
import shutil
import types
from collections.abc import Callable

import case_writer as w
import merkle
import note
import stamp
import tree as t
from case_writer import SECOND

LATER_NS = 2 * 3600 * SECOND        # after `open`: when the forger asks an outside authority


class Unfit(Exception):
    """An edit has nothing to change here."""


@dataclasses.dataclass(frozen=True)
class Edit:
    """`of_entries` is done before lines are signed again, what is not is done to the folder as it lies there."""
    name: str
    of_entries: bool
    apply: Callable


@dataclasses.dataclass
class Hands:
    """What a forger has beside the folder: other folders, the keys of authorities."""
    others: list                    # trees of other cases, of this device and of another one
    outside: stamp.Authority        # answers anybody, at the time of the forgery
    own: stamp.Authority | None     # the recorder's: says any time
    stranger: stamp.Authority       # says any time, and nobody trusts it
    outsider: note.Signer
    elsewhere: pathlib.Path         # a folder to which links lead


# Files


def _of(tree, path):
    if path not in tree:
        raise Unfit(path)
    return tree[path]


def _bytes(tree, path):
    node = _of(tree, path)
    if not isinstance(node, bytes):
        raise Unfit(path)
    return node


def _put(path, change):
    def apply(tree, hands):
        tree[path] = change(_bytes(tree, path))
    return apply


def _node(path, node):
    def apply(tree, hands):
        _of(tree, path)
        tree.remove(path)
        tree[path] = node
    return apply


def _removed(path):
    def apply(tree, hands):
        if path not in tree and not tree.below(path):
            raise Unfit(path)
        tree.remove(path)
    return apply


def _named(path, to, keep=False):
    def apply(tree, hands):
        if to == path or to in tree:
            raise Unfit(to)
        tree[to] = _of(tree, path)
        if not keep:
            del tree[path]
    return apply


def _exchanged(one, other):
    def apply(tree, hands):
        tree[one], tree[other] = _bytes(tree, other), _bytes(tree, one)
    return apply


def _linked(path):
    """The same bytes, elsewhere."""
    def apply(tree, hands):
        data = _bytes(tree, path)
        at = hands.elsewhere / hashlib.sha256(data).hexdigest()[:16]
        at.write_bytes(data)
        tree[path] = t.Link(at)
    return apply


def _folder_linked(path):
    """A folder that lies elsewhere, with all that was in it."""
    def apply(tree, hands):
        below = {each: _bytes(tree, each) for each in tree.below(path) if tree[each] is not t.FOLDER}
        at = hands.elsewhere / hashlib.sha256(repr(sorted(below)).encode()).hexdigest()[:16]
        for each, data in below.items():
            to = at / pathlib.PurePosixPath(each).relative_to(path)
            to.parent.mkdir(parents=True, exist_ok=True)
            to.write_bytes(data)
        tree.remove(path)
        tree[path] = t.Link(at)
    return apply


def _foreign(path, number):
    """The file of this name in another case; of another name where there is none."""
    def apply(tree, hands):
        other = hands.others[number % len(hands.others)]
        here = path if path in other else next((each for each in other.files() if each.rsplit("/", 1)[0] == path.rsplit("/", 1)[0]), None)
        if here is None or other[here] == _bytes(tree, path):
            raise Unfit(path)
        tree[path] = other[here]
    return apply


def _flipped(data, at):
    at %= len(data)
    return data[:at] + bytes([data[at] ^ 1 << at % 8]) + data[at + 1:]


def of_files(tree):
    """Every edit of one file or folder; of exchanges those with the next of its folder."""
    def edit(name, path, apply):
        return Edit(f"{name} {path}", False, apply)

    files = tree.files()
    for at, path in enumerate(files):
        folder, _, name = path.rpartition("/")
        size = len(tree[path])
        yield edit("remove", path, _removed(path))
        yield edit("empty", path, _put(path, lambda data: b""))
        yield edit("cut the last byte of", path, _put(path, lambda data: data[:-1]))
        yield edit("halve", path, _put(path, lambda data: data[:len(data) // 2]))
        yield edit("append a line feed to", path, _put(path, lambda data: data + b"\n"))
        yield edit("append itself to", path, _put(path, lambda data: data + data))
        yield edit("put zeros into", path, _put(path, lambda data: bytes(len(data))))
        for where in (0, size // 3, size - 1):
            yield edit(f"flip a bit at {where} of", path, _put(path, lambda data, where=where: _flipped(data, where)))
        yield edit("link elsewhere", path, _linked(path))
        yield edit("link to itself", path, _node(path, t.Link(name)))
        yield edit("link to nothing", path, _node(path, t.Link("nothing")))
        yield edit("FIFO in place of", path, _node(path, t.FIFO))
        yield edit("socket in place of", path, _node(path, t.SOCKET))
        yield edit("folder in place of", path, _node(path, t.FOLDER))
        yield edit("hole in place of", path, _node(path, t.Hole(size)))
        yield edit("hole of 1 TiB in place of", path, _node(path, t.Hole(1 << 40)))
        for to in (path + ".part", path.upper(), f"{folder}/.{name}".lstrip("/"), f"{folder}/{name[:-1]}".lstrip("/"), _next_name(path), "extra/" + name):
            yield edit(f"rename to {to}:", path, _named(path, to))
            yield edit(f"copy to {to}:", path, _named(path, to, keep=True))
        for number in (0, 1):
            yield edit(f"from another case ({number}):", path, _foreign(path, number))
        if at + 1 < len(files) and files[at + 1].rpartition("/")[0] == folder:
            other = files[at + 1]
            yield edit(f"exchange with {other}:", path, _exchanged(path, other))
            yield edit(f"copy of {other} in place of", path, lambda tree, hands, path=path, other=other: tree.update({path: _bytes(tree, other)}))
            yield edit(f"second name of {other} in place of", path, _node(path, t.Second(other)))
    for path in tree.folders():
        yield edit("remove", path, _removed(path))
        yield edit("link elsewhere", path, _folder_linked(path))
        yield edit("rename", path, lambda tree, hands, path=path: _move_folder(tree, path, path + "-old"))
        yield edit("FIFO in place of", path, _node_of_folder(path, t.FIFO))
        yield edit("file in place of", path, _node_of_folder(path, b"x"))
        for name in ("x", ".hidden", "x.part", "00000001.note", "\u202e", "LEDGER.JSONL"):
            yield edit(f"add {name!r} to", path, lambda tree, hands, path=path, name=name: tree.setdefault(f"{path}/{name}", b"x"))


def _next_name(path):
    head, _, name = path.rpartition("/")
    number, dot, rest = name.partition(".")
    made = f"{int(number) + 1:08d}{dot}{rest}" if number.isdigit() else "more-" + name
    return f"{head}/{made}".lstrip("/")


def _move_folder(tree, path, to):
    below = tree.below(path)
    if not below:
        raise Unfit(path)
    for each in below:
        tree[to + each[len(path):]] = tree.pop(each)


def _node_of_folder(path, node):
    def apply(tree, hands):
        if not tree.below(path) and path not in tree:
            raise Unfit(path)
        tree.remove(path)
        tree[path] = node
    return apply


# Lines, by whoever has no key


def _lines(path, change):
    def apply(tree, hands):
        lines = _bytes(tree, path).split(b"\n")[:-1]
        made = change(lines)
        if made == lines:
            raise Unfit(path)
        tree[path] = b"".join(line + b"\n" for line in made)
    return apply


def of_lines(tree, path):
    """Of a ledger, line by line, as text."""
    def edit(name, change):
        return Edit(f"{name} of {path}", False, _lines(path, change))

    def at(number, replace):
        """`replace` gives the lines in the place of one."""
        def change(lines):
            if number >= len(lines):
                raise Unfit(path)
            return lines[:number] + replace(lines[number]) + lines[number + 1:]
        return change

    count = len(_bytes(tree, path).split(b"\n")) - 1
    for number in range(count):
        yield edit(f"remove line {number}", at(number, lambda line: []))
        yield edit(f"line {number} twice", at(number, lambda line: [line, line]))
        yield edit(f"empty line before {number}", at(number, lambda line: [b"", line]))
        yield edit(f"blank in line {number}", at(number, lambda line: [line.replace(b":", b": ", 1)]))
        yield edit(f"carriage return in line {number}", at(number, lambda line: [line + b"\r"]))
        yield edit(f"zero byte in line {number}", at(number, lambda line: [line[:9] + b"\0" + line[9:]]))
        yield edit(f"half of line {number}", at(number, lambda line: [line[:len(line) // 2]]))
        yield edit(f"key twice in line {number}", at(number, lambda line: [line[:-1] + b',"seq":' + str(number).encode() + b"}"]))
        yield edit(f"digit in line {number}", at(number, lambda line: [_other_digit(line)]))
        yield edit(f"lines up to {number} alone", lambda lines, number=number: lines[:number])
        yield edit(f"lines from {number} on alone", lambda lines, number=number: lines[number:])
        yield edit(f"lines {number} and the next exchanged", lambda lines, number=number: lines[:number] + lines[number:number + 2][::-1] + lines[number + 2:])
        yield edit(f"line {number} at the end", lambda lines, number=number: lines[:number] + lines[number + 1:] + lines[number:number + 1])
    yield Edit(f"{path} without its last line feed", False, _put(path, lambda data: data[:-1]))
    yield Edit(f"half a line behind {path}", False, _put(path, lambda data: data + b'{"type":"gap"'))
    yield Edit(f"zeros behind {path}", False, _put(path, lambda data: data + bytes(4096)))
    yield Edit(f"byte order mark before {path}", False, _put(path, lambda data: b"\xef\xbb\xbf" + data))


def _other_digit(line):
    at = line.rfind(b"1")
    return line[:at] + b"7" + line[at + 1:] if at >= 0 else line + b" "


def of_notes(tree, base):
    """Text and signatures of checkpoints, by whoever can sign as somebody else."""
    for path in [each for each in tree.files() if each.startswith("checkpoints/")]:
        def part(change, path=path):
            def apply(tree, hands):
                text, _, signatures = _bytes(tree, path).partition(b"\n\n")
                tree[path] = change(text, signatures, hands)
            return apply

        def cosigned(text, signatures, hands):
            return text + b"\n\n" + signatures + hands.outsider.line(text + b"\n")

        def changed(number, value):
            def change(text, signatures, hands):
                lines = text.split(b"\n")
                lines[number] = value(lines[number])
                return b"\n".join(lines) + b"\n\n" + signatures
            return change

        def of_another(text, signatures, hands):
            signer = note.Signer(base.signer.name, hands.outsider.seed)
            return text + b"\n\n" + signer.line(text + b"\n")

        for name, change in (("cosign", cosigned), ("sign in the device's name", of_another), ("size", changed(1, lambda v: str(int(v) + 1).encode())),
                             ("root", changed(2, lambda v: base64.b64encode(bytes(32)))), ("origin", changed(0, lambda v: v + b"0")),
                             ("signature twice", lambda text, signatures, hands: text + b"\n\n" + signatures * 2),
                             ("no signature", lambda text, signatures, hands: text + b"\n"),
                             ("more lines", lambda text, signatures, hands: text + b"\nmore\n\n" + signatures)):
            yield Edit(f"note {path}: {name}", False, part(change))


def of_excerpt(tree):
    """Of excerpt.json: each member, and which files there are with it."""
    document = json.loads(tree["excerpt.json"])

    def edit(name, change):
        def apply(tree, hands):
            made = json.loads(_bytes(tree, "excerpt.json"))
            change(made, tree)
            tree["excerpt.json"] = w.line_of(made) + b"\n"
        return Edit(f"excerpt.json: {name}", False, apply)

    for key, value in document.items():
        for name, made in of_value(value, lambda: [document[other] for other in document if isinstance(document[other], type(value)) and other != key]):
            yield edit(f"{key} {name}", lambda made_document, tree, key=key, made=made: made_document.update({key: copy.deepcopy(made)}))
        yield edit(f"without {key}", lambda made_document, tree, key=key: made_document.pop(key))
    yield edit("more", lambda made, tree: made.update({"more": 1}))

    def without(stream):
        def change(made, tree):
            if stream not in made["streams"]:
                raise Unfit(stream)
            made["streams"].remove(stream)
            tree.remove(f"segments/{stream}")
        return change

    def shorter(made, tree):
        """As whoever cuts an excerpt from an excerpt, and forgets none of its files."""
        lines = [json.loads(line) for line in tree["ledger-part.jsonl"].split(b"\n")[:-1]]
        segments = [e for e in lines if e["type"] == "segment" and e["file"] in tree]
        if len(segments) < 2:
            raise Unfit("one segment")
        made["to_ns"] = segments[-1]["start_ns"]
        del tree[segments[-1]["file"]]

    def of_a_case(made, tree):
        """The case's form without its pictures: what the first attempt did."""
        made.update({"streams": [], "first_entry": 0, "open_proof": [], "left": [], "earlier": []})
        tree.remove("segments")

    for stream in document["streams"]:
        yield edit(f"without stream {stream} and its files", without(stream))
    yield edit("a shorter time, without the last segment", shorter)
    yield edit("no stream and no segment", of_a_case)


# Entries, by whoever has the device's key


@dataclasses.dataclass
class Step:
    """A line, or a note over all lines before it."""
    entry: dict | None
    of: "Step | None" = None        # of a token's or a missed token's entry: its note
    original: bytes | None = None   # of a note: its bytes


def steps_of(base):
    steps, notes = [], {}
    kept = base.notes if base.whole is None else base.whole.notes
    for number, entry in enumerate(base.entries):
        steps.append(Step(entry))
        if entry["type"] in ("token", "token-missed"):
            steps[-1].of = notes.get(entry["checkpoint"])
        if number + 1 in kept:
            steps.append(Step(None, original=kept[number + 1]))
            notes[number + 1] = steps[-1]
    return steps


def of_value(value, others=list):
    """Other values in the place of one, each with a name."""
    if isinstance(value, bool):
        return [("turned", not value)]
    if isinstance(value, int):
        made = [("one more", value + 1), ("one less", value - 1), ("a second more", value + SECOND), ("a second less", value - SECOND), ("doubled", 2 * value),
                ("nothing", 0), ("far", (1 << 53) - 1)]
    elif isinstance(value, str):
        made = [("empty", ""), ("longer", value + "0"), ("other first", ("1" if value[:1] == "0" else "0") + value[1:]),
                ("other last", value[:-1] + ("1" if value[-1:] == "0" else "0"))]
    elif isinstance(value, list):
        made = [("none", []), ("without the first", value[1:]), ("without the last", value[:-1]), ("the last twice", value + value[-1:])]
    else:
        made = [("empty", {})]
    return [(name, each) for name, each in made + [("another's", other) for other in others()] if each != value]


def of_entries(base):
    """One entry, or one value of one, changed: every entry, every value."""
    steps = steps_of(base)
    lines = [i for i, step in enumerate(steps) if step.entry is not None]

    def edit(name, change):
        return Edit(name, True, change)

    def at(number, kind, change):
        """What one edit moved away another one does not find."""
        def apply(steps, files, hands):
            if number >= len(steps) or steps[number].entry is None or steps[number].entry["type"] != kind:
                raise Unfit(kind)
            change(steps, number, files)
        return apply

    for number in lines:
        entry = steps[number].entry
        kind, what = entry["type"], f"{entry['type']} {entry['seq']}"

        def paths(value, path=()):
            for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
                yield path + (key,)
                yield from paths(value[key], path + (key,))

        for path in paths(entry):
            if path[0] in ("type", "seq"):
                continue
            value = _inner(entry, path[:-1])[path[-1]]
            alike = [steps[i].entry for i in lines if steps[i].entry["type"] == kind and i != number]
            found = [e[path[0]] for e in alike if len(path) == 1 and path[0] in e and isinstance(e[path[0]], type(value))]
            for name, made in of_value(value, lambda found=found: found[:1] + found[-1:]):
                def change(steps, number, files, path=path, made=made):
                    within = _inner(steps[number].entry, path[:-1])
                    within[path[-1]] = copy.deepcopy(made)
                yield edit(f"{what}: {'.'.join(map(str, path))} {name}", at(number, kind, _guarded(change)))

            def removed(steps, number, files, path=path):
                del _inner(steps[number].entry, path[:-1])[path[-1]]
            yield edit(f"{what}: without {'.'.join(map(str, path))}", at(number, kind, _guarded(removed)))
        for key, value in (("more", 1), ("profile", "lossless"), ("of", "sound"), ("frames", 1), ("begins_ns", 1), ("rate_ppb", 300_000), ("plan", "0" * 64)):
            if key not in entry:
                yield edit(f"{what}: with {key}", at(number, kind, lambda steps, number, files, key=key, value=value: steps[number].entry.update({key: value})))
        yield edit(f"{what}: removed", at(number, kind, lambda steps, number, files: steps.pop(number)))
        yield edit(f"{what}: removed with its file", at(number, kind, _without_file))
        yield edit(f"{what}: twice", at(number, kind, lambda steps, number, files: steps.insert(number, copy.deepcopy(steps[number]))))
        yield edit(f"{what}: at the end", at(number, kind, lambda steps, number, files: steps.append(steps.pop(number))))
        yield edit(f"{what}: at the beginning", at(number, kind, lambda steps, number, files: steps.insert(1, steps.pop(number))))
        for other in [i for i in lines if i > number][:2]:
            yield edit(f"{what}: exchanged with {steps[other].entry['seq']}", at(number, kind, lambda steps, number, files, other=other: _exchange_steps(steps, number, other)))
        if "file" in entry and kind == "segment":
            yield edit(f"{what}: another film", at(number, kind, lambda steps, number, files: _other_film(steps[number].entry, files)))
        if base.form != "log":
            for name, made in _inserted(entry["mono_ns"], entry["utc"], steps[0].entry["streams"]):
                yield edit(f"before {what}: {name}", at(number, kind, lambda steps, number, files, made=made: steps.insert(number, Step(copy.deepcopy(made)))))
    if base.form == "log":
        return
    yield edit("time goes by half as fast", _slower)
    yield edit("an hour earlier", _earlier)
    for stream in [info["name"] for info in steps[0].entry["streams"]]:
        yield edit(f"without stream {stream}", lambda steps, files, hands, stream=stream: _without_stream(steps, files, stream))
        yield edit(f"without the second half of {stream}", lambda steps, files, hands, stream=stream: _without_end(steps, files, stream))
        yield edit(f"{stream} erased, and nobody says so", lambda steps, files, hands, stream=stream: files.remove(f"segments/{stream}"))
        yield edit(f"{stream} erased, and said so behind the end", lambda steps, files, hands, stream=stream: _erase(steps, files, stream))
    yield edit("without notes but the last", lambda steps, files, hands: _without_notes(steps))


def _inner(value, path):
    for key in path:
        value = value[key]
    return value


def _guarded(change):
    def apply(steps, number, files):
        try:
            change(steps, number, files)
        except (KeyError, IndexError, TypeError) as e:
            raise Unfit(str(e)) from e
    return apply


def _without_file(steps, number, files):
    entry = steps.pop(number).entry
    if entry.get("file") not in files:
        raise Unfit("no file")
    del files[entry["file"]]


def _exchange_steps(steps, one, other):
    if other >= len(steps) or steps[other].entry is None:
        raise Unfit("a note")
    steps[one], steps[other] = steps[other], steps[one]


def _other_film(entry, files):
    if not isinstance(files.get(entry.get("file")), bytes):
        raise Unfit("no film")
    data = _flipped(files[entry["file"]], len(files[entry["file"]]) // 2)
    files[entry["file"]] = data
    entry["sha256"] = hashlib.sha256(data).hexdigest()


def _inserted(mono_ns, utc, streams):
    def made(kind, **fields):
        return {"type": kind, "seq": 0, "utc": utc, "mono_ns": mono_ns, **fields}
    first = streams[0]["name"]
    yield "a gap", made("gap", stream=first, start_ns=0, end_ns=mono_ns, cause="signal-lost")
    yield "a gap of all time", made("gap", stream=first, start_ns=0, end_ns=1 << 52, cause="paused")
    yield "an erasure", made("erased", stream=first, first_index=0, last_index=0, policy="p")
    yield "an erasure of all", made("erased", stream=first, first_index=0, last_index=(1 << 53) - 1, policy="p")
    yield "a crash", made("recovered", boot_id="b", after="crash", truncated="")
    yield "a step of the clock", made("clock", synchronised=True, offset_ns=0, error_ns=0, step_ns=3600 * SECOND)
    yield "a slew", made("clock", synchronised=True, offset_ns=0, error_ns=0, step_ns=0, rate_ppb=100_000_000)
    yield "a missed token", made("token-missed", checkpoint=1, authority="outside", cause="HTTP 503")
    yield "a mark", made("mark", commitment="0" * 64)
    yield "a close", made("close", reason="operator", totals={info["name"]: {"segments": 0, "frames": 0, "dropped": 0, "bytes": 0} for info in streams})


def _moments(steps, change):
    for step in steps:
        for key in ("mono_ns", "start_ns", "end_ns", "asked_ns", "answered_ns"):
            if step.entry is not None and key in step.entry:
                step.entry[key] = change(step.entry[key])


def _slower(steps, files, hands):
    _moments(steps, lambda ns: ns * 2)


def _earlier(steps, files, hands):
    for step in steps:
        if step.entry is not None:
            step.entry["utc"] = stamp.text_of(stamp.nanoseconds(step.entry["utc"]) - 3600 * SECOND)


def _segments(steps, stream):
    return [step for step in steps if step.entry is not None and step.entry["type"] == "segment" and step.entry["stream"] == stream]


def _drop(steps, files, segments):
    if not segments:
        raise Unfit("no segment")
    for step in segments:
        steps.remove(step)
        files.pop(step.entry["file"], None)


def _without_stream(steps, files, stream):
    _drop(steps, files, _segments(steps, stream))
    steps[0].entry["streams"] = [info for info in steps[0].entry["streams"] if info["name"] != stream]
    for step in steps:
        if step.entry is not None and step.entry["type"] == "close":
            step.entry["totals"].pop(stream, None)


def _without_end(steps, files, stream):
    segments = _segments(steps, stream)
    _drop(steps, files, segments[(len(segments) + 1) // 2:])


def _erase(steps, files, stream):
    segments = _segments(steps, stream)
    if not segments:
        raise Unfit("no segment")
    for step in segments:
        files.pop(step.entry["file"], None)
    last = [step.entry for step in steps if step.entry is not None][-1]
    indexes = [step.entry["index"] for step in segments]
    steps.append(Step({"type": "erased", "seq": 0, "utc": last["utc"], "mono_ns": last["mono_ns"] + SECOND, "stream": stream, "first_index": min(indexes),
                       "last_index": max(indexes), "policy": "after a day"}))
    steps.append(Step(None))


def _without_notes(steps):
    steps[:] = [step for step in steps if step.entry is not None] + [Step(None)]


TOKENS = ("kept", "dropped", "own", "late", "missed", "stranger")


@dataclasses.dataclass
class Signed:
    """What whoever signs the ledger again has made: its tree, and its lines."""
    tree: t.Tree
    lines: list


def sign(base, steps, files, hands, tokens, count_again):
    """The folder with these steps. `tokens`: what becomes of a token whose note is another one now. `count_again`: close
    states what the segments add up to."""
    made, lines, leaves, notes = t.Tree({path: node for path, node in files.items() if not path.startswith(("checkpoints/", "tokens/")) and path != "ledger.jsonl"}), [], [], {}
    made.update({path: t.FOLDER for path in files if files[path] is t.FOLDER})
    origin = f"kiroku/{base.signer.name}/{base.entries[0].get('case', 'log')}"
    entries = [step.entry for step in steps if step.entry is not None]
    for step in steps:
        if step.entry is None:
            size = len(lines)
            data = base.signer.checkpoint(origin, size, merkle.root(leaves))
            notes[id(step)] = size, data
            made[f"checkpoints/{size:08d}.note"] = data
            continue
        entry = {**step.entry, "seq": len(lines)}
        if entry["type"] == "close" and count_again:
            entry["totals"] = _totals(entries)
        if entry["type"] == "token" and step.of is not None and id(step.of) in notes:
            entry = _token(base, entry, step.of, notes[id(step.of)], files, made, hands, tokens)
        if entry is not None:
            lines.append(w.line_of(entry))
            leaves.append(merkle.leaf(lines[-1]))
    made["ledger.jsonl"] = b"".join(line + b"\n" for line in lines)
    return Signed(made, lines)


def _totals(entries):
    totals = {info["name"]: {"segments": 0, "frames": 0, "dropped": 0, "bytes": 0} for info in entries[0].get("streams", ())}
    for entry in entries:
        if entry["type"] == "segment" and entry.get("stream") in totals:
            of = totals[entry["stream"]]
            of["segments"] += 1
            of["frames"] += entry.get("frames", entry.get("samples", 0))
            of["dropped"] += entry.get("dropped", 0)
            of["bytes"] += entry.get("bytes", 0)
    return totals


def _token(base, entry, of, signed, files, made, hands, tokens):
    """A token's entry over its note as it is now; None where there is none any more."""
    size, data = signed
    file = entry.get("file")
    if not isinstance(files.get(file), bytes):
        return entry
    response = files[file]
    if data != of.original and tokens != "kept":
        if tokens == "dropped":
            return None
        if tokens == "missed":
            return {**{key: entry[key] for key in ("type", "seq", "utc", "mono_ns")}, "type": "token-missed", "checkpoint": size, "authority": entry["authority"],
                    "cause": "HTTP 503"}
        opened = stamp.nanoseconds(base.entries[0]["utc"])
        was = stamp.parse(response).gen_ns
        authority, gen_ns = {"own": (hands.own, was), "late": (hands.outside, opened + LATER_NS), "stranger": (hands.stranger, was)}[tokens]
        if authority is None:
            return None
        response = authority.at(data, gen_ns, 1000 + size)
        read = stamp.parse(response)
        entry = {**entry, "gen_time": stamp.text_of(read.gen_ns), "accuracy_ns": read.accuracy_ns, "serial": read.serial}
        if tokens == "late":  # as a token that came behind the end has none
            entry.pop("asked_ns", None)
            entry.pop("answered_ns", None)
    entry = {**entry, "checkpoint": size, "file": f"tokens/{size:08d}.{entry['authority']}.tsr", "sha256": hashlib.sha256(response).hexdigest()}
    made[entry["file"]] = response
    return entry


def excerpt_of(signed, base, scratch):
    """The excerpt of a case that was signed again, of the same time and streams."""
    document = json.loads(base.tree["excerpt.json"])
    first = min(document["first_entry"], len(signed.lines) - 1)
    sizes = [int(path[12:-5]) for path in signed.tree.files() if path.startswith("checkpoints/")]
    size = max(sizes, default=0)
    if size <= first:
        raise Unfit("no note")
    written = types.SimpleNamespace(lines=signed.lines, leaves=[merkle.leaf(line) for line in signed.lines], files=signed.tree,
                                    case=types.SimpleNamespace(id=document["case"]))
    folder = scratch / "again"
    shutil.rmtree(folder, ignore_errors=True)
    try:
        w.write_excerpt(written, folder, document["from_ns"], document["to_ns"], document["streams"], first, size)
    except (KeyError, TypeError) as e:
        raise Unfit(str(e)) from e
    return t.read(folder)
