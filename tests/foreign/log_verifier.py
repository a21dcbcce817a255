"""Judges an appliance log, alone or as what a case is compared with, by docs/reference/format.md, "The appliance log"."""
import dataclasses
import hashlib
import os
import pathlib
import re

import age_form
import note
import tpm_quote
from verifier import Folder, Judgement, Ledger, first_line, has_hole, kept_outside, outside_notes, severities, size_of_note

FOLLOWED_BY_NONE = ("boot", "config-changed", "device-ml-dsa-added", "device-hardware-added", "device-attestation-added", "device-hardware-silent")  # entries that no checkpoint need follow at once
MOST_WITHOUT_THEIR_OWN = 3
# What tampers with a log and hides no line of it.
HIDES_NO_LINE = {"file-unnamed", "name-clash", "checkpoint-malformed", "checkpoint-unknown-key", "checkpoint-signature-invalid", "checkpoint-ml-dsa-missing",
                 "checkpoint-of-other-origin", "checkpoint-size-differs"}
CONSENT_FILE, LARGEST_CONSENT = re.compile("consents/([0-9a-f]{64})[.]age"), 64 << 20


@dataclasses.dataclass
class KnownRoot:
    size: int
    root: str
    entry: int


@dataclasses.dataclass(frozen=True)
class Named:
    """A device as the log names it: its text, its key where that is one, and whether the verifier trusts it. Another key of its name is another device."""
    text: str | None
    key: object = None
    trusted: bool = False

    def is_also(self, other):
        return self.text == other.text or self.key is not None and self.key == other.key


def named_device(text, trust):
    try:
        key = note.parse_key(text) if text else None
    except note.Malformed:
        key = None
    return Named(text or None, key, key is not None and key in trust.devices)


@dataclasses.dataclass
class OpenedByAnother:
    """An opening of the case that is judged, under a key that is not its device's."""
    entry: int
    opening_line: str
    device: str | None
    accuses: bool


@dataclasses.dataclass
class KnownCase:
    """By lines of the case's own device alone."""
    opened: int | None = None
    opening_line: str = ""
    device: Named | None = None  # where the log is judged itself: who told of it first
    accuses: bool = True         # that device is trusted, or began the log
    roots: list = dataclasses.field(default_factory=list)
    closed: KnownRoot | None = None
    final_token: str | None = None
    erased: bool = False
    vouched: bool = False
    further: list = dataclasses.field(default_factory=list)  # other openings of the identifier: entry, line, vouched


class Consents:
    """Consents to the use of cases: what does not fit in their order, and the sealed files that they name."""

    def __init__(self, folder):
        self.folder, self.standing, self.doubted, self.unsigned, self.files, self.found = folder, set(), set(), None, {}, []

    def take(self, number, entry, own, opened, ours):
        """`ours`: of the case's own device. Of what others say only the files are named."""
        kind, case = entry["type"], entry.get("case")
        if not ours:
            for digest in filter(None, (entry["statement"], entry.get("form"))) if kind in ("consent-given", "consent-withdrawn") else ():
                self.files.setdefault(f"consents/{digest}.age", {})
            return
        if kind == "access" and "purpose" in entry:
            if own and (case, entry["purpose"]) not in self.standing:
                self.found.append((case, "access-without-consent", number))
        if kind not in ("consent-given", "consent-withdrawn"):
            return
        for digest in filter(None, (entry["statement"], entry.get("form"))):
            self.files.setdefault(f"consents/{digest}.age", {}).setdefault(case, number)
        if not own:
            self.unsigned = (case, number)
        elif not opened:
            self.found.append((case, "consent-case-unknown", number))
        for purpose in entry["purposes"]:
            key = (case, purpose)
            stands = key in self.standing
            if own and kind == "consent-given" and stands:
                self.found.append((case, "consent-given-twice", number))
            if own and kind == "consent-withdrawn" and not stands and key not in self.doubted:
                self.found.append((case, "consent-not-given", number))
            if kind == "consent-withdrawn":
                self.standing.discard(key)
                if not own and stands:
                    self.doubted.add(key)
            elif own:
                self.standing.add(key)
            if own:
                self.doubted.discard(key)

    def followed(self):
        if self.unsigned:
            self.found.append((self.unsigned[0], "consent-doubted", self.unsigned[1]))
            self.unsigned = None

    def names(self, file):
        return file.path == "consents" and file.kind == "folder" or file.kind != "folder" and bool(CONSENT_FILE.fullmatch(file.path)) and (file.kind == "regular" or file.path in self.files)

    def finish(self, lines):
        """What no entry names, by the log as it is now: its first `lines` were judged, and more may have come meanwhile."""
        unnamed = [file.path for file in self.folder.listing if file.kind == "regular" and CONSENT_FILE.fullmatch(file.path) and file.path not in self.files]
        since = self._named_since(lines) if unnamed else ()
        self.found += [(None, "consent-not-entered", path) for path in unnamed if path not in since]

    def _named_since(self, lines):
        added = (self.folder.read("ledger.jsonl") or b"").split(b"\n")[lines:-1]
        entries = Ledger(b"".join(line + b"\n" for line in added), "appliance-log", 2, lambda code, where: None).entries
        of_consents = [entry for entry in entries if entry is not None and entry["type"] in ("consent-given", "consent-withdrawn")]
        return {f"consents/{digest}.age" for entry in of_consents for digest in filter(None, (entry["statement"], entry.get("form")))}

    def report_of(self, case, report):
        """What was found of one case, or of the log itself; of which case a file is that no entry names, nothing says."""
        for name, code, where in self.found:
            if case is None or name == case:
                report(code, f"{name}, {where}")
        for path, cases in sorted(self.files.items()):
            if cases and (case is None or case in cases):
                self._judge_file(path, report)

    def _judge_file(self, path, report):
        where = self.folder.path / path
        if not os.path.lexists(where):
            return report("consent-file-missing", path)
        if where.is_symlink() or not where.is_file():
            return report("file-not-regular", path)
        status = where.stat()
        if status.st_size > LARGEST_CONSENT or has_hole(where, status) or hashlib.sha256(where.read_bytes()).hexdigest() != CONSENT_FILE.fullmatch(path)[1]:
            report("file-hash-differs", path)
        elif age_form.form_of(where, status.st_size) != "holding":
            report("consent-not-sealed", path)


class LogRead:
    """What the log says; findings are in `folder`. `alone`: it is judged itself, so all notes kept outside are about it.

    `opening`: of the case that is judged by it. What stands there under a key that is not of that case's device counts for nothing.
    """

    def __init__(self, path, trust, alone=False, opening=None):
        self.path, self.folder, self.cases, self.doubted, self.held_and_erased = pathlib.Path(path), Folder(path, trust), {}, set(), []
        self.of_case = named_device(opening["device"], trust) if opening else None
        self.case_id = opening["case"] if opening else None
        self.opened_by_another = self.told_by_another = self.stranger = None
        self.was_case_devices, self.accusing = False, 0   # lines that a checkpoint of the case's device covers
        first_named = None
        folder, report = self.folder, self.folder.report
        data = folder.read("ledger.jsonl") or b""
        self.ledger = Ledger(data, "appliance-log", 2, report)
        device, origin, shown, mono, since_note, to_be_followed = None, None, [], 0, 0, []
        self.now = Named(None)   # the device as the newest entry says it
        named = None   # the device's key as the newest entry says it
        claims = []            # code, line and words of what counts once a checkpoint covers the line
        fitting = {}           # lines that a checkpoint covers, by the device that signed it
        signer = None          # the device of now, where its key can be read
        self.covered_by = {}   # of each device that signed the log: lines covered by its ML-DSA key, and by its hardware
        notes = trust.against if alone else outside_notes(trust, True)
        outside, holds = _held(notes, trust), {}   # entries of the holds that stand, by case
        self.consents, boots = Consents(folder), tpm_quote.Boots(report, alone)
        for number, entry in enumerate(self.ledger.entries):
            told, erased, closed = None, None, None
            self.consents.followed()
            if entry is not None:
                kind = entry["type"]
                if entry["seq"] != number:
                    report("entry-out-of-sequence", f"line {number} of the log")
                if number == 0 and kind != "boot":
                    report("open-missing", "the log does not begin with boot")
                if kind != "boot" and entry["mono_ns"] < mono:
                    report("clock-went-back", f"line {number} of the log")
                mono = entry["mono_ns"]
                if kind in ("boot", "device-key-changed"):
                    named = entry["device"]
                if kind not in FOLLOWED_BY_NONE:
                    since_note += kind not in ("recovered", "damage-found")
                    to_be_followed.append(number)
                if kind in ("boot", "device-key-changed"):
                    signer = None if device is None or str(device) != entry["device"] else str(device)
                if kind in ("boot", "device-key-changed") and signer is None:
                    try:
                        later = note.parse_key(entry["device"])
                        self._keep_covered(device)
                        if later != device:
                            folder.covered_by_ml_dsa = folder.covered_by_hardware = 0
                        device, signer = later, str(later)
                        origin = f"kiroku/{device.name}/log"
                        shown += [(origin, device)] if first_named is None else []   # another key that a line names is shown once it signed
                        self._judge_named(device)
                        folder.alone_until = folder.known_device(device).since
                        folder.hardware_alone_until = folder.known_device(device).hardware_since
                    except note.Malformed as e:
                        report("device-invalid", str(e))
                if kind in ("boot", "device-key-changed") and named is not None:
                    self.now = named_device(named, trust)
                    first_named = first_named or self.now
                    self.was_case_devices = self.was_case_devices or self._is_its_devices(self.case_id)
                if kind == "device-ml-dsa-added":
                    self._judge_ml_dsa_key(entry["ml_dsa"], device, lambda code, text, at=number: claims.append((code, at, text)))
                if kind == "device-hardware-added":
                    self._judge_hardware_key(entry["hardware"], device, lambda code, text, at=number: claims.append((code, at, text)))
                if kind == "damage-found":
                    refuted = signer is not None and fitting.get(signer, -1) >= entry["size"]
                    claims.append(("log-damage-refuted" if refuted else "log-damage-stated", number, f"line {number}"))
                boots.take(number, entry, self.ledger.root(number) if "quote" in entry and number <= self.ledger.known else None)
                told, erased, closed = self._take(number, entry, kind, first_named)
            size = number + 1
            if size in folder.note_sizes:
                folder.judge_note(size, self.ledger.root(size), device, origin, size <= self.ledger.known)
                if folder.covered == size:
                    claims = self._tell(claims, size, report)
                    if signer is not None:
                        fitting[signer] = size
                        shown.append((origin, device))
                    if since_note > MOST_WITHOUT_THEIR_OWN:
                        report("log-signed-late", f"line {number}")
                    since_note = 0
            kept_elsewhere = any(c.size == size and c.root == self.ledger.root(size) and c.origin == origin and device in keys for c, keys in outside)
            own = folder.covered == size or kept_elsewhere
            if own and self.of_case and self._is_its_devices(self.case_id):
                self.accusing = size
            if entry is not None and entry["type"] == "case-opened":
                self._judge_opening_by_another(number, entry, own)
            if erased and own:
                erased.erased = True
            if own and entry is not None:
                self._judge_holds(holds, number, entry)
            if entry is not None:
                known = self.cases.get(entry.get("case"))
                self.consents.take(number, entry, own, known is not None and known.opened is not None, self._is_its_devices(entry.get("case")))
            if told:
                if own and kind == "case-opened":
                    told.erased = False
                if closed and (own or not told.closed):
                    told.closed, told.final_token = closed, entry.get("final_token")
                told.vouched = told.vouched or own
                if told.further and told.further[-1][0] == number:
                    told.further[-1][2] = own
                if not own:
                    self.doubted.add(number)
        self._keep_covered(device)
        for size in folder.note_sizes:
            if size > len(self.ledger):
                folder.judge_note(size, None, device, origin)
        if self.ledger.torn:
            report("log-tail-not-covered", "the last line is not whole")
        if self.ledger.readable:
            self._judge_tail(to_be_followed)
            folder.judge_names(lambda file: "named" if self.consents.names(file) else _judge_name(file))
            self.consents.finish(len(self.ledger))
            boots.finish()
            folder.judge_keys(device, len(self.ledger), (0, 0))
        folder.judge_outside(notes, shown, self.ledger, self.ledger.readable)
        self.device = device
        if self.stranger and self.was_case_devices:
            report("log-not-tidy", f"the log names {self.stranger}")
        elif self.stranger:
            folder.judge_device(self.stranger)

    def beside_a_case(self):
        """What was found of the log itself, as it weighs for a case beside it; whether its lines are sound."""
        weighed = [(code if severities()[code] != "tampered" else "log-not-tidy" if code in HIDES_NO_LINE else "log-not-sound", text)
                   for code, text in self.folder.findings]
        return weighed, all(code != "log-not-sound" for code, _ in weighed)

    def _judge_named(self, device):
        """Beside a case nothing rests on a device that is not the case's."""
        trusted = self.folder.trust.devices
        if self.of_case and self.of_case.key != device and trusted and device not in trusted:
            self.stranger = self.stranger or device
        else:
            self.folder.judge_device(device)

    def _is_its_devices(self, case):
        """Whether the log is the device's now that speaks for the case."""
        if self.of_case:
            return self.of_case.text is not None and self.of_case.is_also(self.now)
        known = self.cases.get(case)
        return known is None or known.device is None or known.device.text is None or known.device.is_also(self.now)

    def _note_another(self, case, number):
        if self.told_by_another is None and (self.of_case is None or case == self.case_id):
            self.told_by_another = number

    def _judge_opening_by_another(self, number, entry, own):
        if self.of_case is None or entry["case"] != self.case_id or self._is_its_devices(self.case_id):
            return
        accuses, first = own and self.now.trusted and not self.of_case.trusted, self.opened_by_another
        if first is None or accuses and not first.accuses:
            self.opened_by_another = OpenedByAnother(number, entry["sha256"], self.now.text, accuses)

    @staticmethod
    def _tell(claims, covered, report):
        """Those of which a checkpoint covers the line; the others are left."""
        for code, number, text in claims:
            if number < covered:
                report(code, text)
        return [claim for claim in claims if claim[1] >= covered]

    def _keep_covered(self, device):
        known = self.covered_by.get(str(device), (0, 0))
        self.covered_by[str(device)] = max(known[0], self.folder.covered_by_ml_dsa), max(known[1], self.folder.covered_by_hardware)

    def from_before_hardware(self, device):
        """How many lines are from before the device had its key in hardware, by the root that its identity states."""
        since, root = device.hardware_since, device.log_root_before_hardware
        return since if 0 < since <= min(len(self.ledger), self.ledger.known) and self.ledger.root(since) == root else 0

    def _judge_ml_dsa_key(self, text, device, report):
        try:
            name, public = note.parse_ml_dsa_key(text)
        except note.Malformed as e:
            return report("device-invalid", str(e))
        known = self.folder.known_device(device) if device else None
        if known and (name != known.name or known.ml_dsa not in (None, public)):
            report("device-ml-dsa-differs", name)

    def _judge_hardware_key(self, text, device, report):
        try:
            name, public = note.parse_hardware_key(text)
        except note.Malformed as e:
            return report("device-invalid", str(e))
        known = self.folder.known_device(device) if device else None
        if known and (name != known.name or known.hardware not in (None, public)):
            report("device-hardware-differs", name)

    def _take(self, number, entry, kind, first_named):
        """The case that the entry tells of, one that it erases as a whole, its end."""
        erases = kind == "erased" and "stream" not in entry
        if kind not in ("case-opened", "case-checkpoint", "case-closed") and not erases:
            return None, None, None
        if not self._is_its_devices(entry["case"]):
            self._note_another(entry["case"], number)
            return None, None, None
        case = self.cases.setdefault(entry["case"], KnownCase())
        if erases:
            return None, case, None
        if self.of_case is None and (case.device is None or case.device.text is None):
            case.device = self.now
            case.accuses = self.now.trusted or first_named is None or first_named.is_also(self.now)
        if kind == "case-opened":
            if case.opened is None:
                case.opened, case.opening_line = number, entry["sha256"]
            elif case.opening_line != entry["sha256"]:
                case.further.append([number, entry["sha256"], False])
            return case, None, None
        root = KnownRoot(entry["size"], entry["root"], number)
        case.roots.append(root)
        return case, None, root if kind == "case-closed" else None

    def _judge_holds(self, holds, number, entry):
        own, of_others = holds.setdefault(entry.get("case"), (set(), set()))
        ours = self._is_its_devices(entry.get("case"))
        if entry["type"] == "case-held":
            (own if ours else of_others).add(number)
        elif entry["type"] == "case-released":
            of_others.discard(entry["hold"])
            if ours:
                own.discard(entry["hold"])
        elif entry["type"] == "erased" and ours and own:
            self.held_and_erased.append((entry["case"], number))
        elif entry["type"] == "erased" and (own or of_others):
            self._note_another(entry["case"], number)

    def _judge_tail(self, to_be_followed):
        covered, is_empty = self.folder.covered, len(self.ledger) == 0
        if covered == len(self.ledger) and not is_empty:
            return
        two = len(to_be_followed) >= 2 and to_be_followed[-2] >= covered
        nothing = covered == 0 and (is_empty or to_be_followed)
        self.folder.report("log-tail-unsigned" if nothing or two else "log-tail-not-covered", f"from line {covered}")

    def root_at(self, size):
        return self.ledger.root(size).hex() if size <= len(self.ledger) else None


def _held(notes, trust):
    """Checkpoints kept outside that a trusted device signed, and the keys that did."""
    kept = []
    for each in kept_outside(notes):
        try:
            checkpoint = note.parse_checkpoint(each.data)
        except note.Malformed:
            continue
        signatures = [(key, s[2]) for key in trust.devices for s in checkpoint.signatures if s[:2] == (key.name, key.id)]
        signatures = [(key, signature) for key, signature in signatures if checkpoint.origin == f"kiroku/{key.name}/log"]
        if signed := {key for key, signature in signatures if note.holds(key.public, checkpoint.text, signature) and key.by_all(checkpoint)}:
            kept.append((checkpoint, signed))
    return kept


def _judge_name(file):
    if (file.path == "checkpoints" and file.kind == "folder") or file.path == "ledger.jsonl" or (file.kind != "folder" and size_of_note(file.path)):
        return "named"
    whole = file.path.removesuffix(".part")
    return "part" if file.kind == "regular" and whole != file.path and (size_of_note(whole) or CONSENT_FILE.fullmatch(whole)) else "unnamed"


def verify_log(path, trust):
    log = LogRead(path, trust, alone=True)
    for name, number in log.held_and_erased:
        log.folder.report("erased-while-held", f"{name}, line {number}")
    log.consents.report_of(None, log.folder.report)
    if log.ledger.readable and log.told_by_another is not None:
        log.folder.report("log-of-another-device", f"line {log.told_by_another}")
    if log.ledger.readable:
        _look_for_cases(log, pathlib.Path(path).resolve())
    return Judgement(log.folder.findings)


def _look_for_cases(log, path):
    report, archive = log.folder.report, path.parent
    is_case = re.compile("[0-9]{8}T[0-9]{6}Z-[0-9a-f]{8}")
    search = path.name == "log" and any(is_case.fullmatch(p.name) or p.name == ".reserve" for p in archive.iterdir())
    unknown = False
    for name, case in log.cases.items():
        if case.opened is None:
            if case.roots and search and not case.erased and not _has_ledger(archive / name):
                report(_missing(case, case.vouched), name)
            continue
        if not search and not case.erased:
            unknown = True
        if search and not case.erased and not _holds(archive / name, case.opening_line):
            report(_missing(case, case.vouched), name)
        elif not case.closed and not case.erased:
            report("log-case-open", name)
        for _, line, vouched in case.further:
            if search and not case.erased and not _holds(archive / name, line):
                report(_missing(case, vouched), name)
        if search and case.erased and _holds(archive / name, case.opening_line):
            report("log-case-erased", name)
    if unknown:
        report("cases-not-looked-for", "no case lies beside the log")


def _missing(case, vouched):
    return "log-entry-doubted" if not vouched else "case-missing" if case.accuses else "log-of-another-device"


def _has_ledger(folder):
    try:
        return first_line(folder / "ledger.jsonl") is not None
    except OSError:
        return False


def _holds(folder, opening_line):
    try:
        line = first_line(folder / "ledger.jsonl")
    except OSError:
        return False
    return line is not None and hashlib.sha256(line).hexdigest() == opening_line
