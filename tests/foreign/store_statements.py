"""What other devices state of a case that a store had without its end, by docs/reference/format.md ("Cases that only a store has")."""
import dataclasses
import hashlib
import os
import re

import ml_dsa
import note
import stamp

LARGEST, MOST, LARGEST_SEALED = 1_000_000, 100, 1 << 30
NAME = re.compile(r"[0-9]{8}T[0-9]{6}Z-[0-9a-f]{8}\.note")
CASE = re.compile(r"[0-9]{8}T[0-9]{6}Z-[0-9a-f]{8}")
PATH = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*(/[A-Za-z0-9_][A-Za-z0-9._-]*)*")
LONGEST_PATH, LONGEST_STORE = 3 * 256, 1000


def speaks_of(path):
    """The subject, notes, tokens and segments."""
    return path == "subject.json.age" or path.split("/")[0] in ("checkpoints", "tokens", "segments") and "/" in path and is_path(path)


def is_path(path):
    return len(path) <= LONGEST_PATH and bool(PATH.fullmatch(path))


@dataclasses.dataclass(frozen=True)
class Statement:
    maker: str
    case: str
    device: str
    entries: tuple      # how many lines, their root
    signed: tuple
    files: dict         # path: SHA-256
    missing: tuple
    note: note.Checkpoint   # whose text was signed, and by whom


def _time(text):
    return re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z", text) and stamp.is_day(text) and text[11:19] <= "23:59:59" and "60" not in text[11:19].split(":")[1:]


def _lines(text):
    found = re.fullmatch(r"(0|[1-9][0-9]*) (\S+)", text)
    if not found or int(found[1]) >= 1 << 64:
        raise note.Malformed("no number of lines and their root")
    root = note.from_base64(found[2])
    if len(root) != 32:
        raise note.Malformed("the root has not 32 bytes")
    return int(found[1]), root


def parse(data):
    """Raises note.Malformed for what is no statement."""
    if len(data) > LARGEST:
        raise note.Malformed("larger than a signed note may be")
    try:
        text, signatures = note.parts(data.decode("utf-8"))
    except UnicodeDecodeError as e:
        raise note.Malformed("no UTF-8") from e
    lines = text.split("\n")[:-1]
    origin = re.fullmatch("kiroku/(.+)/store-statement", lines[0])
    values = {}
    for key, line in zip(("case", "device", "store", "looked", "newest", "log", "entries", "signed"), lines[1:9]):
        if not line.startswith(key + " "):
            raise note.Malformed(f"where {key} stands in a statement, {line!r} does")
        values[key] = line[len(key) + 1:]
    if not origin or len(values) < 8 or not CASE.fullmatch(values["case"]) or not 0 < len(values["store"].encode()) <= LONGEST_STORE:
        raise note.Malformed("no statement")
    if not _time(values["looked"]) or not (values["newest"] == "unknown" or _time(values["newest"])):
        raise note.Malformed("a time is none")
    _lines(values["log"])
    entries, signed = _lines(values["entries"]), _lines(values["signed"])
    if entries[0] == 0 or signed[0] > entries[0]:
        raise note.Malformed("no entries, or more signed ones than there are")
    files, missing = {}, []
    for line in lines[9:]:
        file = re.fullmatch("file ([0-9a-f]{64})  (.+)", line)
        if file and not missing and is_path(file[2]) and (not files or file[2].encode() > max(files).encode()):
            files[file[2]] = file[1]
        elif line.startswith("missing ") and is_path(line[8:]) and (not missing or line[8:] > missing[-1]):
            missing.append(line[8:])
        else:
            raise note.Malformed(f"{line!r} is no line of a statement")
    return Statement(origin[1], values["case"], values["device"], entries, signed, files, tuple(missing),
                     note.Checkpoint(lines[0], 0, b"", text.encode(), signatures))


def _keys_of(device):
    """Of each of a device's keys: its name, its identifier, and what tells whether a signature is its."""
    keys = [(device.name, device.id, lambda text, signature: note.holds(device.public, text, signature))]
    if device.ml_dsa:
        keys.append((device.ml_dsa_name, device.ml_dsa_id, lambda text, signature: ml_dsa.verify(ml_dsa.ML_DSA_65, device.ml_dsa, text, signature)))
    if device.hardware:
        keys.append((device.hardware_name, device.hardware_id, lambda text, signature: note.holds_ecdsa(device.hardware, text, signature)))
    return keys


def signature_says(statement, device, trusted):
    """None where a trusted device that is not the case's own signed it by all its keys; else a code."""
    known = {key: _keys_of(key) for key in trusted if key.name == statement.maker}
    lines = {s[:2]: s[2] for s in statement.note.signatures}
    held = {key: [holds(statement.note.text, lines[name, of]) if (name, of) in lines else None for name, of, holds in keys] for key, keys in known.items()}
    if any(False in answers for answers in held.values()):
        return "store-statement-refused"
    signers = [key for key, answers in held.items() if answers[0]]
    if not signers:
        return "store-statement-untrusted"
    exact = {(name, of) for keys in known.values() for name, of, _ in keys}
    is_forged = any(line[0] in {name for name, _ in exact} and line not in exact for line in lines)
    return "store-statement-refused" if is_forged or any(None in held[key] for key in signers) or device in signers else None


def judge(folder, opening, device, ledger):
    """Reports what the statements beside the folder say of the case, whose ledger these lines are."""
    beside = folder.path.resolve().parent / "store-statements"
    if any(not os.path.isdir(each) or os.path.islink(each) for each in (beside, beside / opening["case"])):
        return
    beside, read = beside / opening["case"], 0
    for name in sorted(os.listdir(beside)):
        if not NAME.fullmatch(name):
            continue
        read += 1
        if read > MOST:
            folder.report("store-statement-refused", f"{name}, after {MOST} others")
            return
        folder.report(*_judge(folder, beside / name, opening, device, ledger))
        if folder.findings[-1][0] == "store-statement-holds" and _has_grown(folder, parse((beside / name).read_bytes()), ledger):
            folder.report("store-statement-outgrown", name)


def _judge(folder, path, opening, device, ledger):
    try:
        if os.path.islink(path) or not path.is_file() or path.stat().st_size > LARGEST:
            raise note.Malformed("no file, or too large")
        statement = parse(path.read_bytes())
    except (note.Malformed, OSError) as e:
        return "store-statement-refused", f"{path.name}: {e}"
    if statement.case != opening["case"] or statement.device != opening["device"]:
        return "store-statement-refused", f"{path.name} is of another case"
    if code := signature_says(statement, device, folder.trust.devices):
        return code, f"{path.name}, in the name of {statement.maker}"
    for size, root in (statement.entries, statement.signed):
        if size > len(ledger) or ledger.root(size) != root:
            return "store-statement-differs", f"{path.name}: {size} entries"
    there = {file.path for file in folder.listing if file.kind == "regular" and speaks_of(file.path)}
    for file, sha256 in statement.files.items():
        try:
            if file not in there or (folder.path / file).stat().st_size > LARGEST_SEALED or hashlib.sha256((folder.path / file).read_bytes()).hexdigest() != sha256:
                return "store-statement-differs", f"{path.name}: {file}"
        except OSError as e:
            return "store-statement-differs", f"{path.name}: {file} cannot be compared: {e}"
    return "store-statement-holds", path.name


def named_by(entries):
    """Files that entries name."""
    named = {}
    for number, entry in enumerate(entries):
        file = entry and (entry.get("subject", {}).get("file") if entry["type"] == "open" else entry.get("file") if entry["type"] in ("segment", "token") else None)
        if file:
            named.setdefault(file, number)
    return named


def _has_grown(folder, statement, ledger):
    size, named = statement.entries[0], named_by(ledger.entries)
    there = {file.path for file in folder.listing if file.kind == "regular" and speaks_of(file.path)}
    known = set(statement.files) | ({path for path, number in named.items() if number < size} - set(statement.missing))
    return len(ledger) > size or bool(there - known)
