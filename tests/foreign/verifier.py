"""What judging a case, an excerpt and an appliance log have in common, by docs/reference/format.md."""
import collections
import dataclasses
import functools
import hashlib
import os
import pathlib
import re
import stat

import merkle
import note
import schema
import stamp
import strict_json
import tlog_proof

PAGE = schema.FOLDER.parent / "format.md"
SECOND = 1_000_000_000
LARGEST_LINE, LARGEST_NOTE, LARGEST_CERTIFICATES = 1 << 20, 1 << 17, 1 << 18
MOST_MALFORMED, MOST_OF_ONE_CODE, DEEPEST_FOLDER = 10_000, 1_000, 3
MOST_IN_NO_LINES = 64 << 20  # bytes in lines that are too long, or hold a zero byte
BLOCK = 4096
RANK = ("note", "gap", "unproven", "incomplete", "tampered")


@functools.lru_cache(maxsize=None)
def severities():
    """Every code with its severity, as the page lists them."""
    return dict(re.findall(r"^\| `([a-z-]+)` \| (tampered|incomplete|unproven|gap|note) \|", PAGE.read_text("utf-8"), re.M))


@functools.lru_cache(maxsize=None)
def _schema(name):
    return schema.load(name)


@dataclasses.dataclass
class Judgement:
    """What was found: each finding is a code and a sentence."""
    findings: list
    excerpt: bool = False

    @property
    def codes(self):
        counts = collections.Counter(code for code, _ in self.findings)
        return set(counts) | ({"more-findings"} if max(counts.values(), default=0) > MOST_OF_ONE_CODE else set())

    @property
    def verdict(self):
        gravest = RANK[max((RANK.index(severities()[code]) for code in self.codes), default=0)]
        if gravest in ("gap", "note"):
            return "intact-excerpt" if self.excerpt else {"note": "intact", "gap": "intact-with-gaps"}[gravest]
        return gravest


@dataclasses.dataclass
class Trust:
    """What a verifier is given: device keys, texts of PEM certificates, the log's folder, notes kept outside, a proof from the log."""
    devices: tuple = ()
    roots: str = ""
    own_roots: str = ""
    log: pathlib.Path | None = None
    against: tuple = ()
    proof: pathlib.Path | None = None


def has_hole(path, status):
    """512 bytes or more for which the file system says that nothing is stored."""
    with open(path, "rb") as file:
        try:
            hole = os.lseek(file.fileno(), 0, os.SEEK_HOLE)
        except OSError:
            return False
        return status.st_size - hole >= 512


def read_small(path, most):
    """The bytes of a small file; none of one that is longer, or has a hole, which costs whoever makes it nothing."""
    status = os.lstat(path)
    return b"" if status.st_size > most or status.st_size > BLOCK and has_hole(path, status) else path.read_bytes()


def read_lines(path):
    """A ledger as far as it is read: of a line that is too long as much as tells that it is."""
    lines, in_no_lines = [], 0
    with open(path, "rb") as file:
        while piece := file.readline(LARGEST_LINE + 2):
            if in_no_lines > MOST_IN_NO_LINES:
                lines.append(bytes(LARGEST_LINE + 1))
                break
            length, line = len(piece), piece
            while len(piece) > 0 and not piece.endswith(b"\n") and in_no_lines + length <= MOST_IN_NO_LINES:
                piece = file.readline(LARGEST_LINE)
                length += len(piece)
            line = line[:LARGEST_LINE + 1].removesuffix(b"\n")
            if not piece.endswith(b"\n"):
                lines.append(line)
                break
            lines.append(line + b"\n")
            in_no_lines += length - 1 if length - 1 > LARGEST_LINE or b"\0" in line else 0
    return b"".join(lines)


def first_line(path):
    """Nothing where it is not whole, too long, or holds a zero byte."""
    line = b""
    with open(path, "rb") as file:
        while (piece := file.read(BLOCK)) and b"\n" not in line and b"\0" not in line and len(line) <= LARGEST_LINE:
            line += piece
    line, end, _ = line.partition(b"\n")
    return line if end and b"\0" not in line and len(line) <= LARGEST_LINE else None


class Torn:
    """How a ledger ends that does not end with a whole line."""

    def __init__(self, length, too_long):
        self.length, self.too_long = length, too_long


class Ledger:
    """Lines of a ledger or of the log, their entries (None where a line is none) and the tree over them."""

    def __init__(self, data, schema_name, levels, report, first=0, newest_note=0):
        self.first, self.lines, self.entries, self.readable = first, [], [], True
        *lines, torn = data.split(b"\n")
        self.torn = Torn(len(torn), len(torn) > LARGEST_LINE) if torn else None
        malformed, closed = 0, False
        for number, line in enumerate(lines, first):
            too_long = len(line) > LARGEST_LINE
            # Blocks that were never flushed read as zeros: the ledger ends before such a line, unless a checkpoint covers it.
            if schema_name == "case-ledger" and b"\0" in line and newest_note <= number and not (closed and too_long):
                self.torn = Torn(len(line), too_long)
                break
            entry = None
            try:
                if too_long:
                    raise schema.Unfit("longer than 1 MiB")
                entry = parse_entry(line, schema_name, levels)
            except (strict_json.Malformed, schema.Unfit) as e:
                report("entry-too-long" if too_long else "entry-malformed", f"line {number}: {e}")
                malformed += 1
            self.lines.append(line)
            self.entries.append(entry)
            closed = closed or entry is not None and entry["type"] == "close"
            if malformed > MOST_MALFORMED:
                report("ledger-unreadable", f"more than {MOST_MALFORMED} lines are no entries")
                self.readable = False
                break
        self.leaves = [merkle.leaf(line) for line in self.lines]
        # A line that is too long is not read to its end, so nothing is known of the tree from it on.
        self.known = next((i for i, line in enumerate(self.lines, first) if len(line) > LARGEST_LINE), 1 << 62)
        self._roots = {}

    def __len__(self):
        return self.first + len(self.lines)

    def shows(self, size):
        """Whether the root of the first `size` lines may be known."""
        return self.first < size <= len(self)

    def root(self, size):
        """The root over the first `size` lines, of a ledger whose beginning is here."""
        if size not in self._roots:
            self._roots[size] = merkle.root(self.leaves[:size])
        return self._roots[size]


class Unread(Ledger):
    """Lines that nobody understands, up to one that is too long."""

    def __init__(self, data):
        lines = data.split(b"\n")[:-1]
        self.lines = lines[:next((i for i, line in enumerate(lines) if len(line) > LARGEST_LINE), len(lines))]
        self.readable = len(self.lines) == len(lines) and len(data) - data.rfind(b"\n") - 1 <= LARGEST_LINE
        self.first, self.known, self._roots = 0, 1 << 62, {}
        self.leaves = [merkle.leaf(line) for line in self.lines]


class Heads:
    """Of a ledger that is not here the roots that its notes state, by size."""
    first, known, readable = 0, 1 << 62, False

    def __init__(self, roots):
        self.roots = roots

    def __len__(self):
        return max(self.roots, default=0)

    def shows(self, size):
        return size in self.roots

    def root(self, size):
        return self.roots[size]


def parse_entry(line, schema_name, levels):
    """The entry in a line; raises Malformed or Unfit where it is none."""
    entry = strict_json.parse(line, levels)
    schema.check(entry, _schema(schema_name))
    _check_between_keys(entry)
    return entry


def _check_between_keys(entry):
    """Rules of an entry that a schema cannot state."""
    def must(holds, why):
        if not holds:
            raise schema.Unfit(why)

    for key in ("utc", "gen_time"):
        must(key not in entry or stamp.is_day(entry[key]), f"{key} is of no day")
    kind = entry["type"]
    if kind in ("segment", "gap"):
        must(entry["end_ns"] >= entry["start_ns"], "end_ns is before start_ns")
    elif kind == "token" and "asked_ns" in entry:
        must(entry["answered_ns"] >= entry["asked_ns"], "answered_ns is before asked_ns")
    elif kind == "erased" and "first_index" in entry:
        must(entry["last_index"] >= entry["first_index"], "last_index is before first_index")
    elif kind == "open":
        names = [stream["name"] for stream in entry["streams"]]
        must(len(set(names)) == len(names), "a stream stands twice")
        must(entry.get("begins_ns", 0) <= entry["mono_ns"], "begins_ns is after open itself")


@dataclasses.dataclass(frozen=True)
class Listed:
    path: str
    kind: str   # regular, folder, link, special; unreadable: what it is or holds
    size: int


def list_folder(folder, prefix="", depth=0):
    found = []
    for name in sorted(os.listdir(folder)):
        status = os.lstat(folder / name)
        kind = ("regular" if stat.S_ISREG(status.st_mode) else "folder" if stat.S_ISDIR(status.st_mode)
                else "link" if stat.S_ISLNK(status.st_mode) else "special")
        found.append(Listed(prefix + name, kind, status.st_size))
        if kind == "folder" and depth < DEEPEST_FOLDER:
            try:
                found += list_folder(folder / name, f"{prefix}{name}/", depth + 1)
            except PermissionError:
                found[-1] = Listed(prefix + name, "unreadable", 0)
    return found


def number_of(text):
    """Of a file's name: eight digits, or more without leading zeros."""
    return int(text) if re.fullmatch(r"[0-9]{8}|[1-9][0-9]{8,}", text) else None


def size_of_note(path):
    found = re.fullmatch(r"checkpoints/([0-9]+)\.note", path)
    return number_of(found[1]) if found and number_of(found[1]) else None


def token_of_path(path):
    """Size and authority of tokens/00000042.swiss.tsr or, of a shared token, .ers."""
    found = re.fullmatch(r"tokens/([0-9]+)\.([a-z0-9][a-z0-9-]{0,31})\.(?:tsr|ers)", path)
    return (number_of(found[1]), found[2]) if found and number_of(found[1]) is not None else None


def is_of_a_system(file):
    """Whether operating systems leave such a file or folder behind by themselves."""
    name, folder = file.path.split("/")[-1], file.kind == "folder"
    above = file.path.split("/") if folder else file.path.split("/")[:-1]
    return "@eaDir" in above or not folder and (name in (".DS_Store", "Thumbs.db", "desktop.ini") or bool(re.fullmatch("(?s).+:Zone[.]Identifier", name)))


def newer(line, kind):
    """A document that names a later version of its format than the first; None where it names none."""
    try:
        document = strict_json.parse(line)
    except strict_json.Malformed:
        return None
    found = re.fullmatch(rf"kiroku-{kind}/([1-9][0-9]{{0,8}})", document["format"]) if isinstance(document.get("format"), str) else None
    return document if found and int(found[1]) > 1 and not _holds_null(document) else None


def _holds_null(value):
    if isinstance(value, (dict, list)):
        return any(_holds_null(each) for each in (value.values() if isinstance(value, dict) else value))
    return value is None


class Folder:
    """A folder to judge, what was found of it so far, and its checkpoints."""

    def __init__(self, path, trust):
        self.path, self.trust, self.findings = pathlib.Path(path), trust, []
        self.listing = list_folder(self.path)
        self.note_sizes = sorted(size for size in (size_of_note(f.path) for f in self.listing if f.kind != "folder") if size)
        self.all_listed = not any(f.path == "checkpoints" and f.kind == "unreadable" for f in self.listing)
        self.unread = 0         # the largest note that is there and could not be read
        self.covered = 0        # lines that a checkpoint covers which holds
        self.changed = False
        self.alone_until = 0    # lines up to which a checkpoint may be by Ed25519 alone, of a device that has an ML-DSA key
        self.covered_by_ml_dsa = self.ml_dsa_unchecked = 0
        self.hardware_alone_until = self.covered_by_hardware = self.hardware_unchecked = self.hardware_missing = 0
        self.notes = {}         # size: bytes

    def report(self, code, text):
        if code not in severities():
            raise KeyError(f"the page has no code {code}")
        self.findings.append((code, text))

    def leads_elsewhere(self, name):
        """Whether a link or a special file stands where a folder above the file must."""
        def kind(path):
            try:
                return os.lstat(path).st_mode
            except (FileNotFoundError, NotADirectoryError):
                return stat.S_IFDIR
        above = [kind(self.path / parent) for parent in list(pathlib.PurePath(name).parents)[:-1]]
        return not all(stat.S_ISDIR(mode) or stat.S_ISREG(mode) for mode in above)

    def read(self, name, most=None):
        """The bytes of a regular file, without `most` of a ledger; None, and a finding, where there is none."""
        path = self.path / name
        if self.leads_elsewhere(name):
            self.report("file-not-regular", name)
            return None
        try:
            status = os.lstat(path)
        except (FileNotFoundError, NotADirectoryError):
            self.report("file-missing", name)
            return None
        except PermissionError as e:
            self.report("file-unreadable", f"{name}: {e}")
            return None
        if not stat.S_ISREG(status.st_mode):
            self.report("file-not-regular", name)
            return None
        try:
            return read_lines(path) if most is None else read_small(path, most)
        except OSError as e:
            self.report("file-unreadable", f"{name}: {e}")
            return None

    def judge_device(self, device):
        if not self.trust.devices:
            self.report("no-trusted-device", "no key was given")
        elif device not in self.trust.devices:
            self.report("device-not-trusted", str(device))

    def known_device(self, device):
        """The device with the keys beside Ed25519 that it is known to have."""
        for known in self.trust.devices:
            if known == device and known.ml_dsa and not device.ml_dsa:
                device = dataclasses.replace(device, ml_dsa=known.ml_dsa, since=known.since)
            if known == device and known.hardware and not device.hardware:
                device = dataclasses.replace(device, hardware=known.hardware, hardware_since=known.hardware_since,
                                             log_root_before_hardware=known.log_root_before_hardware)
        return device

    def judge_keys(self, device, claims, vouched):
        """What of the first `claims` lines was signed, or checked, by fewer keys than the device has.

        `vouched`: how many are known otherwise to be the device's, by its ML-DSA key and by its hardware.
        """
        if device is None or self.covered == 0:
            return
        known, needed = self.known_device(device), min(claims, self.covered)
        if known.ml_dsa is None:
            if self.ml_dsa_unchecked:
                self.report("checkpoint-ml-dsa-unchecked", f"{self.ml_dsa_unchecked} checkpoints")
        elif max(self.covered_by_ml_dsa, vouched[0]) < needed:
            self.report("checkpoint-not-by-both", f"of {claims} lines")
        if known.hardware is None:
            if self.hardware_unchecked:
                self.report("checkpoint-hardware-unchecked", f"{self.hardware_unchecked} checkpoints")
        elif max(self.covered_by_hardware, vouched[1]) < needed:
            self.report("checkpoint-not-by-hardware", f"of {claims} lines")
        elif self.hardware_missing:
            self.report("checkpoint-hardware-missing", f"{self.hardware_missing} checkpoints")

    def judge_note(self, size, root, device, origin, is_known=True):
        """A checkpoint against the root of the lines (None: there are too few), where that is known. True where it covers them."""
        name, by_ml_dsa, by_hardware = f"checkpoints/{size:08d}.note", None, None
        before = len(self.findings)
        data = self.read(name, LARGEST_NOTE)
        if data is None:
            is_unread = root is not None and self.findings[before][0] == "file-unreadable"
            self.unread = max(self.unread, size if is_unread else 0)
            return False
        self.notes[size] = data
        try:
            checkpoint = note.parse_checkpoint(data)
        except note.Malformed as e:
            self.report("checkpoint-malformed", f"{name}: {e}")
            return False
        if device is not None:
            ours = [s for s in checkpoint.signatures if s[0] == device.name]
            if not any(key == device.id for _, key, _ in ours) or len(ours) > 1:
                self.report("checkpoint-unknown-key", name)
                return False
            if not note.holds(device.public, checkpoint.text, ours[0][2]):
                self.report("checkpoint-signature-invalid", name)
                return False
            known, names = self.known_device(device), [s[0] for s in checkpoint.signatures]
            others = [each for each in names if each not in (device.name, device.ml_dsa_name, device.hardware_name)]
            if known.hardware is not None:
                by_hardware = known.by_hardware(checkpoint)
                if by_hardware is False:
                    self.report("checkpoint-signature-invalid", name)
                    return False
            if known.ml_dsa is None:
                self.ml_dsa_unchecked += device.ml_dsa_name in names
            else:
                by_ml_dsa = known.by_ml_dsa(checkpoint)
                if by_ml_dsa is False:
                    self.report("checkpoint-signature-invalid", name)
                    return False
                if by_ml_dsa is None and size > self.alone_until:
                    self.report("checkpoint-ml-dsa-missing", name)
                    return False
                self.alone_until = 0 if by_ml_dsa else self.alone_until
            if known.hardware is None:
                self.hardware_unchecked += device.hardware_name in names
            elif by_hardware is None:
                self.hardware_missing += size > self.hardware_alone_until
            if others:
                self.report("checkpoint-cosigned", name)
        if checkpoint.size != size:
            self.report("checkpoint-size-differs", name)
            return False
        if not is_known:
            return False
        foreign = device is not None and checkpoint.origin != origin
        if foreign:
            self.report("checkpoint-of-other-origin", name)
        if root is None:
            if not foreign:
                self.report("ledger-cut", name)
            return False
        if root != checkpoint.root:
            if not self.changed:
                self.report("ledger-changed", name)
            self.changed = True
            return False
        if not foreign:
            self.covered = size
            self.covered_by_ml_dsa = size if by_ml_dsa else self.covered_by_ml_dsa
            self.covered_by_hardware = size if by_hardware else self.covered_by_hardware
        return not foreign

    def judge_names(self, judge):
        """`judge` says of a file: named, part, token, segment or unnamed."""
        seen = {}
        for file in self.listing:
            if seen.setdefault(file.path.lower(), file.path) != file.path:
                self.report("name-clash", file.path)
            answer = judge(file)
            if answer == "named":
                continue
            if file.kind in ("link", "special", "unreadable"):
                self.report("file-unreadable" if file.kind == "unreadable" else "file-not-regular", file.path)
                continue
            if answer == "unnamed" and is_of_a_system(file):
                self.report("file-of-a-system", file.path)
                continue
            self.report({"part": "part-file", "token": "token-not-entered", "segment": "segment-not-entered", "unnamed": "file-unnamed"}[answer], file.path)

    def judge_outside(self, notes, shown, ledger, whole):
        """Notes kept outside. `shown`: origin and device of what is here; `ledger` is None where there is none; `whole`: it is here to its end."""
        alone, copies = [], {}   # those that are signed: the checkpoint, whether keys beside Ed25519 are missing, and who signed it; of copies by copy
        for kept in kept_outside(notes):
            judged = self._judge_kept(kept)
            if kept.copy is None:
                if isinstance(judged, str):
                    self.report(judged, kept.name)
                else:
                    alone.append((kept.name, *judged))
            else:
                copies.setdefault(kept.copy, []).append((kept, judged))
        seen = alone + [(kept.name, *judged) for notes_of in copies.values() for kept, judged in notes_of if not isinstance(judged, str)]
        for i, (name, one, lacks, keys) in enumerate(seen):
            against = [(others_lack, keys & theirs) for _, o, others_lack, theirs in seen[:i] if (o.origin, o.size) == (one.origin, one.size) and o.root != one.root and keys & theirs]
            ours = [others_lack for others_lack, both in against if not shown or any(device in both for _, device in shown)]
            if ours:
                self.report("outside-note-not-by-both" if lacks or all(ours) else "outside-notes-contradict", name)
            elif against:
                self.report("outside-note-of-other-origin", name)

        def answer(checkpoint, keys):
            if not shown:
                return "outside-note-unchecked"
            if not any(checkpoint.origin == origin and device in keys for origin, device in shown):
                return "outside-note-of-other-origin"
            if ledger is not None and ledger.shows(checkpoint.size) and checkpoint.size <= ledger.known:
                return "outside-note-holds" if ledger.root(checkpoint.size) == checkpoint.root else "outside-note-forked"
            return "outside-note-rolled-back" if whole and checkpoint.size > len(ledger) else "outside-note-unchecked"

        def tell(name, code, lacks):
            accuses = code in ("outside-note-forked", "outside-note-rolled-back")
            self.report("outside-note-not-by-both" if lacks and accuses else code, name)
        for name, checkpoint, lacks, keys in alone:
            tell(name, answer(checkpoint, keys), lacks)
        for copy, notes_of in copies.items():
            answers = {}   # of each the newest note, one that is by all keys first
            for kept, judged in notes_of:
                if not isinstance(judged, str):
                    answers.setdefault(answer(judged[0], judged[2]), []).append((not judged[1], judged[0].size, kept.name))
            told = [code for code in ("outside-note-forked", "outside-note-rolled-back") if code in answers]
            told = told or [code for code in ("outside-note-holds", "outside-note-unchecked", "outside-note-of-other-origin") if code in answers][:1]
            for code in told:
                by_all, _, name = max(answers[code])
                tell(name, code, not by_all)
            if not told:
                sized = [(kept.size, judged) for kept, judged in notes_of if kept.size is not None]
                last = max(sized, key=lambda each: each[0], default=(0, ""))
                self.report("outside-note-invalid" if last[0] == 0 else last[1], str(copy))

    def _judge_kept(self, kept):
        """Of a note kept outside its checkpoint, whether it lacks a signature by a key beside Ed25519, and who signed it; a code where it says nothing."""
        try:
            checkpoint = note.parse_checkpoint(kept.data)
        except note.Malformed:
            return "outside-note-invalid"
        keys = [k for k in self.trust.devices if re.fullmatch(rf"kiroku/{re.escape(k.name)}/(log|[0-9]{{8}}T[0-9]{{6}}Z-[0-9a-f]{{8}})", checkpoint.origin)]
        signed = [(k, s) for k in keys for s in checkpoint.signatures if s[:2] == (k.name, k.id)]
        if not signed:
            return "outside-note-untrusted"
        if not all(note.holds(k.public, checkpoint.text, s[2]) for k, s in signed):
            return "outside-note-invalid"
        if checkpoint.size == 0:
            return "outside-note-unchecked"
        both = [k.by_all(checkpoint) for k, _ in signed]
        return "outside-note-invalid" if False in both else (checkpoint, None in both, {k for k, _ in signed})

    def judge_proof(self, case_id, ledger, device=None, part=None):
        """A proof of the case's end in the log. `ledger` is None where there is none; `part`: of an excerpt, to how many entries its lines lead.

        How many lines it proves under signatures of `device` by its ML-DSA key and by its hardware: none by the latter, since a
        proof does not show what the log was before that.
        """
        if self.trust.proof is None:
            return 0, 0
        try:
            line, consistency, index, path, checkpoint = tlog_proof.parse(self.trust.proof.read_bytes())
            entry = parse_entry(line, "appliance-log", 2)
        except (note.Malformed, strict_json.Malformed, schema.Unfit) as e:
            return self._answer("log-proof-not-used", str(e))
        keys = [k for k in self.trust.devices if checkpoint.origin == f"kiroku/{k.name}/log"]
        signed = [(k, s) for k in keys for s in checkpoint.signatures if s[:2] == (k.name, k.id)]
        if not signed or not all(note.holds(k.public, checkpoint.text, s[2]) and k.by_all(checkpoint) for k, s in signed):
            return self._answer("log-proof-not-used", "not signed by a trusted device for its own log")
        if merkle.root_by_inclusion(merkle.leaf(line), index, checkpoint.size, path) != checkpoint.root:
            return self._answer("log-proof-not-used", "the audit path does not lead to the root")
        if entry["type"] != "case-closed" or entry["seq"] != index or entry["case"] != case_id:
            return self._answer("log-proof-not-used", "no end of this case")
        if device is None or checkpoint.origin != f"kiroku/{device.name}/log":
            return self._answer("log-proof-not-used", "of the log of another device than the case's")
        if all(k != device for k, _ in signed):
            return self._answer("log-proof-not-used", "by another key of the name of the case's device")
        size, root = entry["size"], bytes.fromhex(entry["root"])
        by = (any(k.ml_dsa and k == device for k, _ in signed), False)
        if part is None:
            known = 0 if ledger is None else min(len(ledger), ledger.known)
            if 0 < size <= known:
                holds = ledger.root(size) == root
                return self._answer("log-proof-holds" if holds else "log-proof-differs", "the root of the case's end", size if holds else 0, by)
            whole = ledger is not None and ledger.readable and size > len(ledger)
            return self._answer("log-proof-differs" if whole else "log-proof-not-used", "the case's end is not here")
        shown = ledger.root(part) if ledger is not None and len(ledger) == part else None
        if shown is None:
            return self._answer("log-proof-not-used", "the excerpt shows no root")
        if part == size and shown != root:
            return self._answer("log-proof-differs", "the excerpt is of another case")
        leads = merkle.consistent(part, shown, size, root, consistency) if part <= size else merkle.consistent(size, root, part, shown, consistency)
        return self._answer("log-proof-holds" if leads else "log-proof-not-used", "from the excerpt to the case's end", min(part, size) if leads else 0, by)

    def _answer(self, code, text, vouched=0, by=(False, False)):
        self.report(code, text)
        return tuple(vouched if each else 0 for each in by)


@dataclasses.dataclass(frozen=True)
class Kept:
    """A note kept outside, by itself or in an earlier copy of a folder. `size`: what it states; None where it is none."""
    name: str
    data: bytes
    copy: pathlib.Path | None
    size: int | None
    of_log: bool


def kept_outside(given):
    """All notes of what is given: files, folders, or what this gave."""
    return [kept for each in given for kept in ([each] if isinstance(each, Kept) else _kept_in(pathlib.Path(each)))]


def _kept_in(path):
    def kept(file, data, copy):
        try:
            checkpoint = note.parse_checkpoint(data)
        except note.Malformed:
            return Kept(file.name, data, copy, None, False)
        return Kept(file.name, data, copy, checkpoint.size, checkpoint.origin.endswith("/log"))
    if not path.is_dir():
        return [kept(path, path.read_bytes(), None)]
    files = sorted(file for file in (path / "checkpoints").iterdir() if size_of_note(f"checkpoints/{file.name}") and not file.is_dir())
    found = [kept(file, b"" if file.is_symlink() or not file.is_file() else read_small(file, LARGEST_NOTE), path) for file in files]
    return [each for each in found if each.size is not None] or found[:1]


def outside_notes(trust, of_logs):
    """The notes given that speak of logs, or the others."""
    return [kept for kept in kept_outside(trust.against) if kept.of_log == of_logs]


def sha256_of(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
