"""Folders that reach every finding code, made by the writer: sound ones with one thing wrong, signed by whoever would sign it.

Each function has the codes that it is for in its decorator. It gets a World, in which it may write below `folder`, and
gives back what a verifier is to be given.
"""
import base64
import dataclasses
import hashlib
import json
import os
import pathlib
import shutil

import age
import case_writer as w
import merkle
import note
import stamp
import tlog_proof
import tpm_quote
from case_writer import MS, SECOND, Checkpoint, Entry, Token

ALL = []


@dataclasses.dataclass
class Given:
    """A folder, and what a verifier is given beside it."""
    path: pathlib.Path
    devices: list
    roots: list                  # texts of PEM certificates of outside authorities
    own: list = dataclasses.field(default_factory=list)
    log: pathlib.Path | None = None
    against: list = dataclasses.field(default_factory=list)
    proof: pathlib.Path | None = None
    as_log: bool = False
    identity: str | None = None  # then our program alone judges
    unprivileged: bool = False   # judged by a user who may not read all
    never: list = dataclasses.field(default_factory=list)  # codes that nobody may find


def reaches(*codes):
    def mark(function):
        ALL.append((function.__name__, codes, function))
        return function
    return mark


@dataclasses.dataclass
class World:
    """Keys and authorities that all forgeries share, and the folder of one."""
    device: note.Signer
    stranger: note.Signer
    outside: stamp.Authority
    second: stamp.Authority
    own: stamp.Authority
    reader: age.Identity
    utc_ns: int
    folder: pathlib.Path = None
    sealed: dict = dataclasses.field(default_factory=dict)
    beside: dict = dataclasses.field(default_factory=dict)   # files to be written beside a log, by path

    def seal(self, name, plain):
        """A small age file; the same for the same name."""
        if name not in self.sealed:
            self.sealed[name] = age.seal(plain, [self.reader.public])
        return self.sealed[name]

    @property
    def case_id(self):
        return stamp.text_of(self.utc_ns)[:19].replace("-", "").replace(":", "") + "Z-3f9c21ab"

    def given(self, path, **more):
        return Given(**{"path": pathlib.Path(path), "devices": [self.device.key], "roots": [self.outside.root], **more})

    def streams(self, **timing):
        to = [self.reader.recipient]
        return [w.stream("endoscope", "video", "video/mp2t", to, source="/dev/video0", timing=timing.get("endoscope", "arrival")),
                w.stream("vitals", "vitals", "application/jsonl", to, source="synthetic:patient"),
                w.stream("events", "events", "application/jsonl", to, source=timing.get("events", "operator"), purpose="marks")]

    def begin(self, log_state=None, case_id=None, utc_ns=None, stamped=True, streams=None):
        case = w.Case(case_id or self.case_id, self.device, utc_ns or self.utc_ns, self.streams() if streams is None else streams, *([log_state] if log_state else []))
        case.add("clock", MS, synchronised=True, offset_ns=-1200, error_ns=250_000, step_ns=0)
        case.checkpoint()
        if stamped:
            case.token(self.outside, 100 * MS, gen_ns=90 * MS)
        return case

    def record(self, case, first, end, only=("endoscope", "vitals")):
        """Segments of 5 s, numbers [first, end)."""
        for i in range(first, end):
            for name, count in (("endoscope", 125), ("vitals", 5)):
                if name in only:
                    case.segment(name, i, 5 * i * SECOND, 5 * (i + 1) * SECOND, self.seal(f"{name} {i}", f"{name} {i}\n".encode()), count)

    def end(self, case, at, authority=None, **token):
        case.close(at)
        case.checkpoint()
        case.token(authority or self.outside, at + 150 * MS, **{"gen_ns": at + 140 * MS, **token})
        case.checkpoint()
        return case

    def sound(self, **begin):
        """20 s of a film and a monitor, a mark, four checkpoints, three tokens."""
        case = self.begin(**begin)
        self.record(case, 0, 2)
        case.checkpoint()
        case.token(self.outside, 10_100 * MS, gen_ns=10_090 * MS)
        line, commitment = w.event_line(bytes(range(32)), {"time_ns": 11 * SECOND, "utc": stamp.text_of(self.utc_ns + 11 * SECOND), "kind": "mark", "text": "clip placed"})
        case.add("mark", 11 * SECOND, commitment=commitment)
        self.record(case, 2, 4)
        case.segment("events", 0, 10 * SECOND, 12 * SECOND, self.seal("events", line), 1, mono_ns=20_030 * MS)
        return self.end(case, 20_040 * MS)

    def write(self, case, **more):
        return self.given(case.write(self.folder).folder, **more)


@reaches()
def sound(world):
    return world.write(world.sound())


# The ledger's lines


@reaches("entry-malformed")
def unknown_key(world):
    case = world.sound()
    case.find("mark").fields["more"] = 1
    return world.write(case)


@reaches("entry-malformed")
def fraction(world):
    case = world.sound()
    case.find("mark").raw = b'{"type":"mark","seq":9,"utc":"2026-08-05T09:15:02.000000Z","mono_ns":1.0,"commitment":"' + b"0" * 64 + b'"}'
    return world.write(case)


@reaches()
def other_order_of_keys_and_blanks(world):
    case = world.sound()
    mark = case.find("mark")
    number = sum(isinstance(s, (Entry, Token)) for s in case.steps[:case.steps.index(mark)])
    mark.raw = json.dumps({"commitment": mark.fields["commitment"], "mono_ns": mark.mono_ns, "utc": stamp.text_of(world.utc_ns + mark.mono_ns), "seq": number, "type": "mark"},
                          indent=3).replace("\n", " ").encode()
    return world.write(case)


@reaches("entry-too-long")
def long_line(world):
    case = world.sound()
    case.find("mark").raw = b'{"type":"mark"' + b" " * (1 << 20) + b"}"
    return world.write(case)


@reaches("ledger-unreadable", "more-findings")
def lines_that_are_none(world):
    case = world.sound()
    at = case.steps.index(case.find("mark"))
    case.steps[at:at] = [Entry("mark", 11 * SECOND, {}, raw=b"x") for _ in range(10_001)]
    case.steps = [s for s in case.steps if not isinstance(s, (Checkpoint, Token))]
    return world.write(case)


@reaches("entry-out-of-sequence")
def two_of_one_number(world):
    case = world.sound()
    case.find("mark").seq = 3
    return world.write(case)


@reaches("entry-after-close")
def gap_after_close(world):
    case = world.sound()
    case.steps.insert(-1, Entry("gap", 20_300 * MS, {"stream": "vitals", "start_ns": 0, "end_ns": 1, "cause": "paused"}))
    return world.write(case)


def cut_off(world):
    """A recording that a power cut ended after 10 s, found again at 15 s."""
    case = world.begin()
    world.record(case, 0, 2)
    case.checkpoint()
    case.token(world.outside, 10_100 * MS, gen_ns=10_090 * MS)
    case.add("recovered", 15 * SECOND, boot_id="6a2c1d0e-0000-4000-8000-000000000002", after="power-loss", truncated="")
    return case


def recovered_end(world, case, begin=10 * SECOND):
    for name in ("endoscope", "vitals"):
        case.add("gap", 15 * SECOND, stream=name, start_ns=begin, end_ns=15 * SECOND, cause="interrupted")
    case.close(15_100 * MS, "recovered")
    case.checkpoint()
    case.token(world.outside, 15_200 * MS, gen_ns=15_190 * MS)
    case.checkpoint()
    return case


@reaches("entry-after-recovered")
def clock_after_recovered(world):
    case = cut_off(world)
    case.add("clock", 15 * SECOND, synchronised=True, offset_ns=0, error_ns=0, step_ns=0)
    return world.write(recovered_end(world, case))


@reaches("erased-before-close")
def early_erasure(world):
    case = world.sound()
    case.steps.insert(case.steps.index(case.find("mark")), Entry("erased", 11 * SECOND, {"stream": "vitals", "first_index": 0, "last_index": 0, "policy": "none"}))
    return world.write(case)


@reaches("open-missing")
def no_open(world):
    case = world.sound()
    del case.steps[0]
    return world.write(case)


@reaches("open-repeated")
def two_opens(world):
    case = world.sound()
    first = case.steps[0]
    case.steps.insert(case.steps.index(case.find("mark")), Entry("open", 11 * SECOND, first.fields))
    return world.write(case)


@reaches("device-invalid")
def no_device(world):
    case = world.sound()
    case.steps[0].fields["device"] = "or3"
    case.files["device.pub"] = b"or3\n"
    return world.write(case)


@reaches("clock-went-back")
def back_in_time(world):
    case = world.sound()
    mark = case.find("mark")
    mark.utc_ns, mark.mono_ns = world.utc_ns + 11 * SECOND, 5 * SECOND
    return world.write(case)


@reaches("ledger-changed")
def changed_line(world):
    written = world.sound().write(world.folder)
    path = written.folder / "ledger.jsonl"
    path.write_bytes(path.read_bytes().replace(b'"dropped":0', b'"dropped":1', 1))
    return world.given(written.folder)


@reaches("ledger-cut")
def removed_end(world):
    written = world.sound().write(world.folder)
    (written.folder / "ledger.jsonl").write_bytes(b"".join(line + b"\n" for line in written.lines[:-3]))
    return world.given(written.folder)


@reaches("ledger-not-covered")
def unsigned_end(world):
    case = world.sound()
    case.steps[-1] = Entry("mark", 20_300 * MS, {"commitment": "0" * 64})
    return world.write(case)


@reaches("ledger-end-damaged")
def no_line_feed(world):
    written = world.sound().write(world.folder)
    path = written.folder / "ledger.jsonl"
    path.write_bytes(path.read_bytes()[:-1])
    return world.given(written.folder)


@reaches("ledger-torn", "not-closed")
def torn_line(world):
    case = world.begin()
    world.record(case, 0, 2)
    case.add("mark", 11 * SECOND, commitment="0" * 64).cut = 20
    return world.write(case)


@reaches("ledger-torn")
def never_flushed(world):
    case = world.begin()
    world.record(case, 0, 2)
    case.add("mark", 11 * SECOND, commitment="0" * 64).raw = bytes(80)
    return world.write(case)


@reaches("close-not-covered")
def unsigned_close(world):
    case = world.sound()
    case.steps = case.steps[:-3]
    return world.write(case)


@reaches("token-not-covered")
def unsigned_token(world):
    case = world.sound()
    del case.steps[-1]
    return world.write(case)


@reaches("end-not-covered")
def unsigned_missed_token(world):
    case = world.sound()
    case.steps[-1] = Entry("token-missed", 20_300 * MS, {"checkpoint": 3, "authority": "second", "cause": "it did not answer"})
    return world.write(case)


@reaches("recovered", "segment-incomplete", "segment-uncounted", "gap")
def power_cut(world):
    case = cut_off(world)
    entry = case.segment("endoscope", 2, 10 * SECOND, 12 * SECOND, world.seal("endoscope 2", b"endoscope 2\n"), 0, mono_ns=15 * SECOND, complete=False)
    for key in ("first_pts", "time_base", "frames", "dropped"):
        del entry.fields[key]
    case.add("gap", 15 * SECOND, stream="endoscope", start_ns=12 * SECOND, end_ns=15 * SECOND, cause="interrupted")
    case.add("gap", 15 * SECOND, stream="vitals", start_ns=10 * SECOND, end_ns=15 * SECOND, cause="interrupted")
    case.close(15_100 * MS, "recovered")
    case.checkpoint()
    case.token(world.outside, 15_200 * MS, gen_ns=15_190 * MS)
    case.checkpoint()
    return world.write(case, never=BOUNDS_OF_FOUND_FILM)


BOUNDS_OF_FOUND_FILM = ["segment-in-future", "segment-too-long", "segments-entered-late", "first-stamped-late"]


def found(world, case, seconds, length, at):
    """Film of so many seconds, in segments of that length, that a recovery at `at` is said to find."""
    case.add("recovered", at, boot_id=w.BOOT_ID, after="crash", truncated="")
    for i in range(seconds // length):
        for name in ("endoscope", "vitals"):
            entry = case.segment(name, i, length * i * SECOND, length * (i + 1) * SECOND, world.seal(f"{name} 0", f"{name} 0\n".encode()), 0, mono_ns=at)
            for key in ("first_pts", "time_base", "frames", "samples", "dropped"):
                entry.fields.pop(key, None)
    return case


@reaches("segment-in-future")
def old_film_that_is_said_to_be_found(world):
    """An hour of it, in a case of less than a second."""
    return world.write(world.end(found(world, world.begin(), 3600, 10, 200 * MS), 300 * MS))


@reaches("segment-too-long")
def old_film_that_is_said_to_be_found_in_one_piece(world):
    return world.write(world.end(found(world, world.begin(), 60, 60, 60 * SECOND), 60_100 * MS), never=["segment-in-future", "segments-entered-late"])


@reaches("segment-in-future")
def old_film_that_is_said_to_be_found_an_hour_later(world):
    """By the case clock, which nothing bounds over a crash; by the authority's no second passed."""
    return world.write(world.end(found(world, world.begin(), 3600, 10, 3600 * SECOND), 3600_100 * MS, gen_ns=400 * MS), never=["segment-too-long", "segments-entered-late"])


@reaches("recovered")
def token_of_before_the_crash_that_is_entered_behind_what_was_found(world):
    """It says nothing of film that came after it."""
    case = world.begin()
    world.record(case, 0, 2)
    case.checkpoint()
    found_at = 300 * SECOND
    case.add("recovered", found_at, boot_id=w.BOOT_ID, after="crash", truncated="")
    for name in ("endoscope", "vitals"):
        for i in range(2, 16):
            entry = case.segment(name, i, 10 * (i - 1) * SECOND, 10 * i * SECOND, world.seal(f"{name} 0", f"{name} 0\n".encode()), 0, mono_ns=found_at)
            for key in ("first_pts", "time_base", "frames", "samples", "dropped"):
                entry.fields.pop(key, None)
        case.add("gap", found_at, stream=name, start_ns=150 * SECOND, end_ns=found_at, cause="interrupted")
    case.token(world.outside, found_at, gen_ns=10 * SECOND, asked=False)
    return world.write(world.end(case, found_at + 100 * MS), never=BOUNDS_OF_FOUND_FILM)


@reaches("segments-entered-late", "recovered")
def old_film_that_is_said_to_be_found_behind_a_later_token(world):
    case = world.begin()
    case.checkpoint()
    case.token(world.outside, 200_100 * MS, gen_ns=200_090 * MS)
    return world.write(world.end(found(world, case, 200, 10, 200_200 * MS), 200_300 * MS), never=["segment-in-future", "segment-too-long"])


@reaches("recovered", "segment-uncounted")
def film_that_was_found_a_day_later(world):
    case = world.begin()
    at = 86_400 * SECOND
    found(world, case, 20, 10, at)
    for name in ("endoscope", "vitals"):
        case.add("gap", at, stream=name, start_ns=20 * SECOND, end_ns=at, cause="interrupted")
    return world.write(world.end(case, at + 100 * MS), never=BOUNDS_OF_FOUND_FILM)


@reaches("clock-stepped")
def stepped(world):
    case = world.sound()
    case.find("clock").fields["step_ns"] = -20 * MS
    return world.write(case)


@reaches("clock-slewed")
def slewed(world):
    case = world.sound()
    case.find("clock").fields["rate_ppb"] = 300_000
    case.steps.insert(case.steps.index(case.find("mark")), Entry("clock", 11 * SECOND, {"synchronised": True, "offset_ns": 0, "error_ns": 0, "step_ns": 0, "rate_ppb": 0}))
    return world.write(case)


@reaches("clock-slews-allowed-for", "clock-slewed")
def fast_slew(world):
    case = world.sound()
    case.find("clock").fields["rate_ppb"] = 400_000_000
    return world.write(case)


@reaches("clock-not-synchronised")
def not_synchronised(world):
    case = world.sound()
    case.find("clock").fields["synchronised"] = False
    return world.write(case)


@reaches("clock-differs")
def wall_clock_wrong(world):
    case = world.sound()
    for token in case.of(Token):
        token.gen_ns += 120 * SECOND
    return world.write(case)


@reaches("utc-went-back")
def utc_back(world):
    case = world.sound()
    case.find("mark").utc_ns = world.utc_ns
    return world.write(case)


def ahead(world):
    """A case that is said to begin an hour before it was opened; nothing is there of that hour."""
    case, later = world.sound(), 3600 * SECOND
    case.utc_ns -= later
    for step in case.steps:
        if isinstance(step, (Entry, Token)):
            step.mono_ns += later
        if isinstance(step, Token):
            step.gen_ns += later
        if isinstance(step, Entry) and step.type == "segment":
            step.fields["start_ns"] += later
            step.fields["end_ns"] += later
            step.fields["first_pts"] += 3600 * int(step.fields["time_base"].partition("/")[2])
    case.steps[0].fields["begins_ns"] = 1
    return case


@reaches("stream-begins-late")
def said_to_be_recorded_ahead(world):
    return world.write(ahead(world))


@reaches("close-utc-differs")
def ended_a_year_later(world):
    case = world.sound()
    year_ns, at = 365 * 86_400 * SECOND, case.steps.index(case.find("close"))
    for step in case.steps[at:]:
        if isinstance(step, (Entry, Token)):
            step.utc_ns = world.utc_ns + year_ns + step.mono_ns
    return world.write(case)


@reaches("clock-stepped")
def ended_a_year_later_behind_a_stated_step(world):
    case = world.sound()
    year_ns, at = 365 * 86_400 * SECOND, case.steps.index(case.find("close"))
    case.steps.insert(at, Entry("clock", case.steps[at].mono_ns, {"synchronised": True, "offset_ns": 0, "error_ns": 0, "step_ns": year_ns // 8}))
    for step in case.steps[at:]:
        if isinstance(step, (Entry, Token)):
            step.utc_ns = world.utc_ns + year_ns // 8 + step.mono_ns
    return world.write(case)


@reaches("folder-name-differs")
def renamed_folder(world):
    return world.given(world.sound().write(world.folder, "evidence").folder)


@reaches("folder-of-another-case")
def case_in_anothers_place(world):
    return world.given(world.sound().write(world.folder, "20250101T000000Z-00000000").folder)


# Checkpoints


@reaches("checkpoint-malformed")
def note_of_nonsense(world):
    case = world.sound()
    case.of(Checkpoint)[1].change = lambda data: b"nonsense\n"
    return world.write(case)


@reaches("checkpoint-unknown-key")
def note_of_a_stranger(world):
    case = world.sound()
    case.of(Checkpoint)[1].signer = world.stranger
    return world.write(case)


@reaches("checkpoint-unknown-key")
def note_in_the_devices_name(world):
    case = world.sound()
    case.of(Checkpoint)[1].signer = note.Signer(world.device.name, world.stranger.seed)
    return world.write(case)


@reaches("checkpoint-signature-invalid")
def note_with_another_signature(world):
    case = world.sound()
    other = world.device.checkpoint("kiroku/or3/other", 3, bytes(32)).split(b"\n\n")[1]
    case.of(Checkpoint)[1].change = lambda data: data.split(b"\n\n")[0] + b"\n\n" + other
    return world.write(case)


@reaches("checkpoint-of-other-origin")
def note_of_another_case(world):
    case = world.sound()
    case.of(Checkpoint)[1].origin = "kiroku/or3/20200101T000000Z-00000000"
    return world.write(case)


@reaches("checkpoint-size-differs")
def note_of_another_size(world):
    case = world.sound()
    case.steps.insert(case.steps.index(case.find("mark")), Checkpoint(name_size=11))
    return world.write(case)


@reaches("checkpoint-missing")
def note_removed(world):
    case = world.sound()
    case.of(Checkpoint)[1].kept = False
    return world.write(case)


@reaches("checkpoint-cosigned")
def note_with_a_witness(world):
    case = world.sound()
    witness = world.stranger
    case.of(Checkpoint)[1].change = lambda data: data + witness.line(data.split(b"\n\n")[0] + b"\n")
    return world.write(case)


@reaches("device-not-trusted")
def other_device(world):
    return world.write(world.sound(), devices=[world.stranger.key])


@reaches("no-trusted-device")
def no_device_given(world):
    return world.write(world.sound(), devices=[])


@reaches("device-file-differs")
def device_file_of_a_stranger(world):
    case = world.sound()
    case.files["device.pub"] = f"{world.stranger.key}\n".encode()
    return world.write(case)


# Tokens


@reaches("token-name-differs")
def token_of_another_name(world):
    case = world.sound()
    case.of(Token)[1].fields = {"file": "tokens/00000001.outside.tsr"}
    return world.write(case)


@reaches("token-covers-later")
def token_over_the_future(world):
    case = world.sound()
    case.of(Token)[1].fields = {"checkpoint": 99, "file": "tokens/00000099.outside.tsr"}
    return world.write(case)


@reaches("token-repeated")
def token_twice(world):
    case = world.sound()
    first = case.of(Token)[0]
    case.steps.insert(case.steps.index(first) + 1, dataclasses.replace(first))
    return world.write(case)


@reaches("token-imprint-differs")
def token_over_something_else(world):
    case = world.sound()
    case.of(Token)[1].response = world.outside.at(b"something else", world.utc_ns + 10_090 * MS, 7)
    return world.write(case)


@reaches("token-refused")
def token_with_a_changed_signature(world):
    case = world.sound()
    case.of(Token)[1].change = lambda data: data[:-1] + bytes([data[-1] ^ 1])
    return world.write(case)


@reaches("token-refused")
def token_before_its_certificate(world):
    case = world.sound()
    case.of(Token)[1].gen_ns = -365 * 24 * 3600 * SECOND
    return world.write(case)


@reaches("token-refused")
def token_of_no_form(world):
    case = world.sound()
    case.of(Token)[1].response = b"\x30\x03\x02\x01\x00"
    return world.write(case)


def in_a_round(digest):
    """The path of a note in a round of some others."""
    return [[digest, hashlib.sha256(b"another appliance's").digest()], [hashlib.sha256(b"a pair").digest()], [hashlib.sha256(b"four").digest()]]


def shared(world, change=None, path=in_a_round, **more):
    """A sound case whose second token is one that others share."""
    case = world.sound()
    token = case.of(Token)[1]
    token.shared, token.change = path, change
    for name, value in more.items():
        setattr(token, name, value)
    return case


@reaches()
def shared_with_others(world):
    case = shared(world)
    case.of(Token)[2].shared = lambda digest: [[hashlib.sha256(b"0").digest(), digest, hashlib.sha256(b"1").digest()]]
    return world.write(case)


@reaches()
def alone_in_its_round(world):
    return world.write(shared(world, path=lambda digest: []))


@reaches()
def shared_by_a_longest_path(world):
    return world.write(shared(world, path=lambda digest: [[digest]] + [[hashlib.sha256(bytes([i])).digest()] for i in range(63)]))


@reaches()
def excerpt_with_a_shared_token(world):
    case = shared(world)
    written = case.write(world.folder)
    return world.given(w.write_excerpt(written, world.folder / "excerpt", 0, 20 * SECOND, ["endoscope"], 0, len(written.lines)))


@reaches("token-not-entered")
def shared_token_came_later(world):
    case = world.sound()
    case.token(world.second, 20_040 * MS, gen_ns=3600 * SECOND, entered=False, shared=in_a_round)
    return world.write(case)


@reaches("file-unnamed")
def shared_token_of_another_came_later(world):
    case = world.sound()
    case.token(world.second, 20_040 * MS, gen_ns=3600 * SECOND, entered=False, shared=lambda digest: in_a_round(hashlib.sha256(b"other").digest()))
    return world.write(case)


@reaches("token-imprint-differs")
def path_of_another_leaf(world):
    return world.write(shared(world, path=lambda digest: in_a_round(hashlib.sha256(b"another note").digest())))


@reaches("token-imprint-differs")
def leaf_deeper_in_the_path(world):
    return world.write(shared(world, path=lambda digest: [[hashlib.sha256(b"another note").digest()], [digest]]))


@reaches("token-imprint-differs")
def path_to_another_root(world):
    def change(data):
        lists, token = stamp.parse_shared(data)
        return stamp.shared_token([*lists[:-1], [hashlib.sha256(b"five").digest()]], token)
    return world.write(shared(world, change))


@reaches("token-imprint-differs")
def path_that_ends_too_soon(world):
    def change(data):
        lists, token = stamp.parse_shared(data)
        return stamp.shared_token(lists[:-1], token)
    return world.write(shared(world, change))


@reaches("token-imprint-differs")
def path_left_out(world):
    return world.write(shared(world, lambda data: stamp.shared_token([], stamp.parse_shared(data)[1])))


@reaches("token-imprint-differs")
def token_over_another_root(world):
    other = world.outside.at(stamp.joined(in_a_round(hashlib.sha256(b"another note").digest())), world.utc_ns + 10_090 * MS, 7)
    return world.write(shared(world, lambda data: stamp.shared_token(stamp.parse_shared(data)[0], stamp.parse(other).token)))


@reaches("token-refused")
def path_too_long(world):
    return world.write(shared(world, path=lambda digest: [[digest]] + [[hashlib.sha256(bytes([i])).digest()] for i in range(64)]))


@reaches("token-refused")
def hashes_too_short(world):
    return world.write(shared(world, path=lambda digest: [[digest, bytes(20)]]))


def record_of(*chains, algorithm=stamp.SHA256_NAMED, before=b""):
    chains = b"".join(stamp.der(0x30, b"".join(chain)) for chain in chains)
    return stamp.der(0x30, b"\x02\x01\x01" + stamp.der(0x30, algorithm) + before + stamp.der(0x30, chains))


def archive_time_stamp(data, attributes=b"", algorithm=stamp.SHA256_NAMED):
    lists, token = stamp.parse_shared(data)
    tree = stamp.der(0xA2, b"".join(stamp.der(0x30, b"".join(stamp.der(0x04, value) for value in values)) for values in lists))
    return stamp.der(0x30, b"\xa0" + algorithm[1:] + attributes + tree + token)


@reaches("token-refused")
def several_time_stamps(world):
    return world.write(shared(world, lambda data: record_of([archive_time_stamp(data)] * 2)))


@reaches("token-refused")
def several_chains(world):
    return world.write(shared(world, lambda data: record_of([archive_time_stamp(data)], [archive_time_stamp(data)])))


@reaches("token-refused")
def a_record_that_names_another_hash(world):
    sha512 = stamp.SHA256_NAMED[:-1] + b"\x03"
    return world.write(shared(world, lambda data: record_of([archive_time_stamp(data, algorithm=sha512)], algorithm=sha512)))


@reaches("token-refused")
def a_record_with_more_in_it(world):
    info = stamp.der(0xA1, b"\x06\x03\x2a\x03\x04" + stamp.der(0x04, b"hidden"))
    return world.write(shared(world, lambda data: record_of([archive_time_stamp(data)], before=info)))


@reaches("token-refused")
def a_record_that_goes_on(world):
    return world.write(shared(world, lambda data: data + b"\x05\x00"))


@reaches("token-refused")
def a_record_that_names_the_parameters_of_its_hash(world):
    with_null = b"\x30\x0d" + stamp.SHA256_NAMED[2:] + b"\x05\x00"
    return world.write(shared(world, lambda data: record_of([archive_time_stamp(data, algorithm=with_null)], algorithm=with_null)))


@reaches("token-refused")
def a_response_called_shared(world):
    response = b"".join([stamp.der(0x30, b"\x02\x01\x00")])
    return world.write(shared(world, lambda data: stamp.der(0x30, response + stamp.parse_shared(data)[1]), path=lambda digest: []))


@reaches("token-refused")
def a_shared_token_called_a_response(world):
    case = world.sound()
    case.of(Token)[1].change = lambda data: stamp.shared_token([], stamp.parse(data).token)
    return world.write(case)


@reaches("token-refused")
def a_shared_token_with_a_changed_signature(world):
    return world.write(shared(world, lambda data: data[:-1] + bytes([data[-1] ^ 1])))


@reaches("token-repeated")
def own_and_shared_over_one_checkpoint(world):
    case = world.sound()
    first = case.of(Token)[0]
    case.steps.insert(case.steps.index(first) + 1, dataclasses.replace(first, shared=in_a_round))
    return world.write(case)


@reaches("token-entry-differs")
def another_time_than_the_shared_token_has(world):
    return world.write(shared(world, fields={"gen_time": stamp.text_of(world.utc_ns + 10_091 * MS)}))


@reaches("token-entry-differs")
def another_serial(world):
    case = world.sound()
    case.of(Token)[1].fields = {"serial": "ff"}
    return world.write(case)


@reaches("token-exchange-impossible")
def answered_before_it_was_signed(world):
    case = world.sound()
    case.of(Token)[1].fields = {"asked_ns": 1, "answered_ns": 10_095 * MS}
    return world.write(case)


@reaches("token-order")
def ordered_backwards(world):
    case = world.begin(stamped=False)
    case.token(world.outside, 100 * MS, gen_ns=95_200_000, accuracy_s=0, ordering=True)
    world.record(case, 0, 2)
    case.checkpoint()
    case.steps.insert(case.steps.index(case.find("segment")), Checkpoint())
    case.steps.insert(case.steps.index(case.find("segment")), Token(world.outside, 150 * MS, gen_ns=85_200_000, accuracy_s=0, ordering=True))
    return world.write(world.end(case, 10_040 * MS))


@reaches("authorities-disagree")
def two_clocks(world):
    case = world.sound()
    at = case.steps.index(case.find("mark"))
    case.steps[at:at] = [Checkpoint(), Token(world.second, 10_400 * MS, gen_ns=2 * SECOND)]
    return world.write(case, roots=[world.outside.root, world.second.root])


def both_authorities(world, outside_ns, second_ns, **clock):
    """Tokens of two authorities at the beginning and the end, the later ones shifted."""
    case = world.begin(stamped=False)
    case.token(world.second, 50 * MS, gen_ns=40 * MS)
    case.token(world.outside, 100 * MS, gen_ns=90 * MS)
    world.record(case, 0, 4)
    case.close(20_040 * MS)
    case.checkpoint()
    case.token(world.outside, 20_200 * MS, gen_ns=20_190 * MS + outside_ns)
    case.token(world.second, 20_300 * MS, gen_ns=20_290 * MS + second_ns)
    case.checkpoint()
    return world.write(case, roots=[world.outside.root, world.second.root])


@reaches("clock-contradicted")
def case_clock_made_up(world):
    return both_authorities(world, 60 * SECOND, 60 * SECOND)


@reaches("authority-clock-set")
def one_clock_set(world):
    return both_authorities(world, 60 * SECOND, 0)


def left_out(world, accuracy_s=1, slow=False):
    """Ninety seconds of six and a half minutes are left out, and both authorities say so; the second's time is right to so much, or is stated to have come slowly."""
    case = world.begin(stamped=False)

    def real(mono_ns):
        return mono_ns - 10 * MS + (90 * SECOND if mono_ns > 150 * SECOND else 0)

    def second(mono_ns, **token):
        case.token(world.second, mono_ns, **{"gen_ns": real(mono_ns), "accuracy_s": accuracy_s, **token})
    second(80 * MS)
    case.token(world.outside, 100 * MS, gen_ns=90 * MS)
    sizes = {}
    for minute in range(1, 6):
        world.record(case, 12 * (minute - 1), 12 * minute)
        case.checkpoint()
        sizes[minute] = len([s for s in case.steps if not isinstance(s, Checkpoint)])
        at = 60 * minute * SECOND + 100 * MS
        case.token(world.outside, at, gen_ns=real(at))
        if not slow:
            second(at + 20 * MS)
        elif minute in (3, 5):  # asked for two minutes before, and answered in between
            second(at + 200 * MS, gen_ns=60 * minute * SECOND, size=sizes[minute - 2],
                   fields={"asked_ns": 60 * (minute - 2) * SECOND + 350 * MS, "answered_ns": at + 150 * MS})
    case.close(300_400 * MS)
    case.checkpoint()
    second(300_500 * MS, asked=False)
    case.token(world.outside, 300_550 * MS, gen_ns=real(300_550 * MS), asked=False)
    case.checkpoint()
    return case


def both_roots(world):
    return {"roots": [world.outside.root, world.second.root], "never": ["authority-clock-set"]}


@reaches("clock-contradicted")
def film_left_out_beside_two_clocks(world):
    return world.write(left_out(world), **both_roots(world))


@reaches("authority-clock-differs")
def a_clock_right_to_a_minute_clears_nothing(world):
    return world.write(left_out(world, accuracy_s=60), **both_roots(world))


@reaches("authority-clock-differs")
def a_slow_answer_clears_nothing(world):
    return world.write(left_out(world, slow=True), **both_roots(world))


@reaches("authority-clock-differs")
def two_clocks_set_at_different_times(world):
    """Each is as the case clock where the other is not: neither clears it."""
    case = world.begin(stamped=False)
    for i, (first, later) in enumerate([(0, 0), (0, 60), (60, 60)]):
        world.record(case, 4 * i, 4 * i + 4)
        case.checkpoint()
        at = 20 * (i + 1) * SECOND
        case.token(world.second, at + 100 * MS, gen_ns=at + 90 * MS + later * SECOND)
        case.token(world.outside, at + 200 * MS, gen_ns=at + 190 * MS + first * SECOND)
    return world.write(world.end(case, 60_300 * MS, gen_ns=120_440 * MS), **both_roots(world))


@reaches("clock-disagreement")
def own_clock_of_which_the_last_difference_is_not_stated(world):
    """From the token before, more than is stated; from the first one, no more than that."""
    case = world.begin(stamped=False)
    for at, says in ((10, 10_000), (20, 21_900), (30, 34_500)):
        world.record(case, (at - 10) // 5, at // 5)
        case.checkpoint()
        case.token(world.own, at * SECOND + 100 * MS, gen_ns=says * MS + 90 * MS, accuracy_s=0)
        if at == 10:
            case.add("clock", 15 * SECOND, synchronised=True, offset_ns=0, error_ns=250_000, step_ns=3 * SECOND)
    return world.write(world.end(case, 30_300 * MS, authority=world.own, gen_ns=34_940 * MS, accuracy_s=0), roots=[], own=[world.own.root])


@reaches("authority-clock-differs")
def one_clock_alone(world):
    case = world.sound()
    case.of(Token)[2].gen_ns += 60 * SECOND
    return world.write(case)


@reaches("clock-disagreement")
def own_clock_set(world):
    case = world.sound()
    for token in case.of(Token):
        token.authority = world.own
    case.of(Token)[2].gen_ns += 60 * SECOND
    return world.write(case, roots=[], own=[world.own.root])


@reaches("end-stamped-late")
def end_stamped_later(world):
    case = world.sound()
    last = case.of(Token)[2]
    last.asked, last.gen_ns, last.mono_ns = False, 3600 * SECOND, 20_040 * MS
    return world.write(case)


@reaches("stamped-after-close")
def stamped_after_the_end_alone(world):
    case = world.sound()
    for token in case.of(Token)[:2]:
        case.steps.remove(token)
    return world.write(case)


def stamped_late(world, seconds, authority=None):
    """Film of so long, and then the first token."""
    case = world.begin(stamped=False)
    world.record(case, 0, seconds // 5)
    case.checkpoint()
    case.token(authority or world.outside, seconds * SECOND + 150 * MS, gen_ns=seconds * SECOND + 140 * MS)
    case.add("mark", seconds * SECOND + 200 * MS, commitment="0" * 64)
    return world.end(case, seconds * SECOND + 300 * MS)


@reaches("first-stamped-late")
def film_of_before_the_first_token(world):
    return world.write(stamped_late(world, 200))


@reaches("first-stamped-late")
def first_token_is_entered_behind_the_end(world):
    case = world.begin(stamped=False)
    world.record(case, 0, 40)
    case.checkpoint()
    case.close(200_040 * MS)
    case.token(world.outside, 200_150 * MS, gen_ns=200_140 * MS)
    case.checkpoint()
    case.token(world.outside, 200_300 * MS, gen_ns=200_290 * MS)
    case.checkpoint()
    return world.write(case)


@reaches()
def an_authority_that_answers_late(world):
    """Two minutes of film come first, but for the time that the token itself takes."""
    return world.write(stamped_late(world, 115), never=["first-stamped-late"])


@reaches("first-stamped-late")
def an_authority_that_answers_too_late(world):
    return world.write(stamped_late(world, 120))


@reaches("first-stamped-late")
def own_token_first(world):
    """The recorder's own authority bounds nothing of what the outside one comes too late for."""
    case = stamped_late(world, 200)
    case.steps.insert(case.steps.index(case.of(Checkpoint)[0]) + 1, Token(world.own, 100 * MS, gen_ns=90 * MS))
    return world.write(case, own=[world.own.root])


def entered_at_once(world, seconds, first_token=True, **begin):
    """Film of so long, all of which is entered behind a token that comes at its end."""
    case = world.begin(stamped=first_token, **begin)
    at = seconds * SECOND
    case.checkpoint()
    case.token(world.outside, at + 100 * MS, gen_ns=at + 90 * MS)
    names = [stream["name"] for stream in case.steps[0].fields["streams"]]
    for i in range(seconds // 5):
        for name, count in (("endoscope", 125), ("vitals", 5)):
            if name not in names:
                continue
            case.segment(name, i, 5 * i * SECOND, 5 * (i + 1) * SECOND, world.seal(f"{name} {i}", f"{name} {i}\n".encode()), count, mono_ns=at + 200 * MS + i)
    return world.end(case, at + 500 * MS)


@reaches("first-stamped-late", "segments-entered-late")
def old_film_behind_the_first_token(world):
    return world.write(entered_at_once(world, 200, first_token=False))


@reaches("segments-entered-late")
def old_film_in_the_midst(world):
    """A token at the beginning says nothing of film that is entered behind a later one."""
    return world.write(entered_at_once(world, 200), never=["first-stamped-late"])


@reaches("first-stamped-late", "segments-entered-late")
def old_film_that_is_called_a_file_behind_the_first_token(world):
    return world.write(entered_at_once(world, 200, first_token=False, streams=world.streams(endoscope="source")[:1]))


@reaches("segments-entered-late")
def old_film_that_is_called_a_file_in_the_midst(world):
    return world.write(entered_at_once(world, 200, streams=world.streams(endoscope="source")[:1]), never=["first-stamped-late"])


@reaches()
def a_file_that_is_read_as_fast_as_it_can_be(world):
    """Its times lie ahead of the case clock."""
    case = world.begin(streams=world.streams(endoscope="source")[:1])
    for i in range(40):
        case.segment("endoscope", i, 5 * i * SECOND, 5 * (i + 1) * SECOND, world.seal(f"endoscope {i}", f"endoscope {i}\n".encode()), 125, mono_ns=200 * MS + i)
    return world.write(world.end(case, 20_040 * MS), never=["first-stamped-late", "segments-entered-late"])


@reaches()
def a_slow_disk(world):
    return world.write(entered_at_once(world, 115, first_token=False), never=["first-stamped-late", "segments-entered-late"])


@reaches()
def old_film_without_an_outside_token_in_front_of_it(world):
    """It has no earlier limit that could be read as its own."""
    case = world.begin()
    world.record(case, 0, 40)
    for i, segment in enumerate(s for s in case.steps if isinstance(s, Entry) and s.type == "segment"):
        segment.mono_ns = 200 * SECOND + i
    return world.write(world.end(case, 200_100 * MS), never=["first-stamped-late", "segments-entered-late"])


@reaches()
def marks_that_are_entered_at_the_end(world):
    case = world.begin()
    world.record(case, 0, 40)
    case.checkpoint()
    case.token(world.outside, 200_100 * MS, gen_ns=200_090 * MS)
    line, commitment = w.event_line(bytes(range(32)), {"time_ns": 11 * SECOND, "utc": stamp.text_of(world.utc_ns + 11 * SECOND), "kind": "mark", "text": "clip placed"})
    case.add("mark", 200_110 * MS, commitment=commitment)
    case.segment("events", 0, 10 * SECOND, 12 * SECOND, world.seal("events", line), 1, mono_ns=200_120 * MS)
    return world.write(world.end(case, 200_130 * MS), never=["first-stamped-late", "segments-entered-late"])


def ahead_behind_a_token(world, seconds):
    """Film of before `open`, entered behind the first token."""
    case = entered_at_once(world, seconds, first_token=False)
    case.steps[0].mono_ns, case.steps[0].fields["begins_ns"] = seconds * SECOND, 1
    case.find("clock").mono_ns = seconds * SECOND + MS
    return world.write(case, never=["segments-entered-late"])


@reaches("first-stamped-late")
def recorded_long_ahead_behind_the_first_token(world):
    return ahead_behind_a_token(world, 200)


@reaches()
def recorded_ahead_behind_the_first_token(world):
    given = ahead_behind_a_token(world, 60)
    given.never.append("first-stamped-late")
    return given


@reaches("end-stamped-late")
def end_stamped_later_and_asked_for_later(world):
    case = world.sound()
    last = case.of(Token)[2]
    last.gen_ns = last.mono_ns = 3600 * SECOND
    return world.write(case)


@reaches("token-untrusted")
def unknown_authority(world):
    return world.write(world.sound(), roots=[world.second.root])


@reaches("no-trusted-authority")
def no_root_given(world):
    return world.write(world.sound(), roots=[])


@reaches("no-token")
def no_token(world):
    case = world.sound()
    case.steps = [s for s in case.steps if not isinstance(s, Token)]
    return world.write(case)


@reaches("end-not-stamped")
def end_without_a_token(world):
    case = world.sound()
    case.steps = [s for s in case.steps if s is not case.of(Token)[2]]
    return world.write(case)


@reaches("token-missed")
def missed(world):
    case = world.sound()
    case.steps.insert(case.steps.index(case.find("mark")), Entry("token-missed", 10_500 * MS, {"checkpoint": 7, "authority": "outside", "cause": "HTTP 503"}))
    return world.write(case)


@reaches("second-token-untrusted")
def a_second_authority(world):
    case = world.sound()
    case.steps.insert(case.steps.index(case.find("mark")), Token(world.second, 10_300 * MS, gen_ns=10_290 * MS))
    return world.write(case)


@reaches()
def self_issued(world):
    case = world.sound()
    for token in case.of(Token):
        token.authority = world.own
    return world.write(case, roots=[], own=[world.own.root])


# Streams


@reaches("stream-unknown")
def gap_of_no_stream(world):
    case = world.sound()
    case.steps.insert(case.steps.index(case.find("mark")), Entry("gap", 10_500 * MS, {"stream": "ghost", "start_ns": 0, "end_ns": 1, "cause": "paused"}))
    return world.write(case)


@reaches("stream-form-unknown")
def profile_that_is_none_of_its_media(world):
    streams = world.streams()
    streams[0]["profile"] = "lossless"
    return world.write(world.sound(streams=streams))


@reaches("stream-form-unknown")
def camera_that_is_called_marks(world):
    streams = world.streams()
    streams[0]["kind"] = "events"
    return world.write(world.sound(streams=streams))


@reaches("stream-form-unknown")
def camera_that_is_called_marks_looked_into(world):
    """What its film holds is no line of events."""
    streams = world.streams()
    streams[0]["kind"] = "events"
    return world.write(world.sound(streams=streams), identity=str(world.reader))


@reaches("stream-form-unknown")
def excerpt_of_a_profile_that_is_none_of_its_media(world):
    streams = world.streams()
    streams[0]["profile"] = "lossless"
    return excerpt_of(world, world.sound(streams=streams), 6 * SECOND, 9 * SECOND, 0)


@reaches("stream-for-nobody")
def sealed_for_nobody(world):
    streams = world.streams()
    streams[0]["recipients"] = []
    return world.write(world.sound(streams=streams))


@reaches("stream-for-nobody")
def sealed_for_everybody(world):
    streams = world.streams()
    streams[1]["recipients"] = ["everybody", "age1", "AGE1QQQQ"]
    return world.write(world.sound(streams=streams))


@reaches("stream-for-nobody")
def excerpt_of_what_is_sealed_for_nobody(world):
    streams = world.streams()
    streams[0]["recipients"] = []
    return excerpt_of(world, world.sound(streams=streams), 6 * SECOND, 9 * SECOND, 0)


def in_place_of_films(world, change):
    """Files that are no sealed films, of which the ledger states frames."""
    films = {f"{name} {i}": change(age.seal(f"{name} {i}\n".encode(), [world.reader.public])) for name in ("endoscope", "vitals") for i in range(4)}
    # What is sealed is kept for all forgeries.
    return dataclasses.replace(world, sealed=world.sealed | films).sound()


def _header_of(sealed):
    return sealed[:sealed.index(b"\n", sealed.index(b"\n---") + 1) + 1]


@reaches("segment-not-sealed")
def empty_files_in_place_of_films(world):
    return world.write(in_place_of_films(world, lambda sealed: b""))


@reaches("segment-not-sealed")
def texts_in_place_of_films(world):
    return world.write(in_place_of_films(world, lambda sealed: b"no film\n"))


@reaches("segment-not-sealed")
def headers_in_place_of_films(world):
    return world.write(in_place_of_films(world, _header_of))


@reaches("segment-not-sealed")
def headers_and_nonces_in_place_of_films(world):
    return world.write(in_place_of_films(world, lambda sealed: _header_of(sealed) + bytes(16)))


@reaches("segment-not-sealed")
def sealed_nothings_in_place_of_films(world):
    return world.write(in_place_of_films(world, lambda sealed: age.seal(b"", [world.reader.public])))


@reaches("segment-not-sealed")
def films_behind_headers_that_are_none(world):
    return world.write(in_place_of_films(world, lambda sealed: sealed.replace(b"\n--- ", b"\n--- -", 1)))


@reaches("segment-not-sealed")
def films_whose_last_chunk_is_too_short(world):
    return world.write(in_place_of_films(world, lambda sealed: _header_of(sealed) + bytes(16 + 65_552 + 16)))


@reaches()
def films_that_end_with_a_whole_chunk(world):
    return world.write(in_place_of_films(world, lambda sealed: age.seal(bytes(65_536), [world.reader.public])), never=["segment-not-sealed"])


@reaches("segment-not-sealed")
def excerpt_of_empty_files_in_place_of_films(world):
    return excerpt_of(world, in_place_of_films(world, lambda sealed: b""), 6 * SECOND, 9 * SECOND, 0)


def without_film(world, seconds, data=b"", count=0, length=SECOND, apart=0):
    """A camera of whose film so many seconds from 10 s on are segments of that length and distance, with that in their files."""
    case = world.begin()
    world.record(case, 0, 2)
    case.checkpoint()
    case.token(world.outside, 10_100 * MS, gen_ns=10_090 * MS)
    at, end, i = 10 * SECOND, 10 * SECOND + int(seconds * SECOND), 2
    while at + apart + length <= end:
        case.segment("endoscope", i, at + apart, at + apart + length, data, count, mono_ns=max(at + apart + length, 10_100 * MS) + 20 * MS)
        at, i = at + apart + length, i + 1
    for _ in range(2):
        case.segment("endoscope", i, end, end + 5 * SECOND, world.seal("endoscope 0", b"endoscope 0\n"), 125)
        end, i = end + 5 * SECOND, i + 1
    for i in range(2, end // (5 * SECOND)):
        case.segment("vitals", i, 5 * i * SECOND, 5 * (i + 1) * SECOND, world.seal("vitals 0", b"vitals 0\n"), 5, mono_ns=end + 20 * MS)
    return world.end(case, end + 40 * MS)


def sealed_nothing(world):
    if "nothing" not in world.sealed:
        world.sealed["nothing"] = age.seal(b"", [world.reader.public])
    return world.sealed["nothing"]


@reaches("segments-empty", "segment-not-sealed")
def a_minute_of_empty_files_of_a_second(world):
    return world.write(without_film(world, 60))


@reaches("segments-empty")
def a_minute_of_sealed_nothings_of_a_second(world):
    return world.write(without_film(world, 60, sealed_nothing(world)), never=["segment-not-sealed"])


@reaches("segments-empty")
def more_than_five_seconds_of_sealed_nothings(world):
    return world.write(without_film(world, 5.5, sealed_nothing(world), length=500 * MS))


@reaches("segments-sparse")
def five_seconds_of_sealed_nothings(world):
    """As long as a recorder waits for a picture."""
    return world.write(without_film(world, 5, sealed_nothing(world)), never=["segments-empty", "segment-not-sealed"])


@reaches("gap")
def a_minute_of_sealed_nothings_in_a_gap(world):
    case = without_film(world, 60, sealed_nothing(world))
    case.steps.insert(case.steps.index(case.find("close")), Entry("gap", 80_030 * MS, {"stream": "endoscope", "start_ns": 10 * SECOND, "end_ns": 70 * SECOND, "cause": "signal-lost"}))
    return world.write(case, never=["segments-empty", "segment-hole"])


@reaches("segments-empty", "gap")
def a_minute_of_sealed_nothings_with_gaps_of_no_length(world):
    case = without_film(world, 60, sealed_nothing(world))
    for second in range(10, 70):
        case.steps.insert(case.steps.index(case.find("close")), Entry("gap", 80_030 * MS, {"stream": "endoscope", "start_ns": second * SECOND, "end_ns": second * SECOND, "cause": "overload"}))
    return world.write(case)


@reaches("segments-empty")
def a_camera_that_holds_nothing(world):
    """For less than 5 s, and all of it."""
    case = world.begin()
    for i in range(3):
        case.segment("endoscope", i, i * SECOND, (i + 1) * SECOND, sealed_nothing(world), 0)
    case.segment("vitals", 0, 0, 3 * SECOND, world.seal("vitals 0", b"vitals 0\n"), 3, mono_ns=3_030 * MS)
    return world.write(world.end(case, 3_040 * MS))


@reaches("segments-sparse")
def three_seconds_of_one_picture_each(world):
    """No single segment lacks more than a second's."""
    return world.write(without_film(world, 3, world.seal("endoscope 0", b"endoscope 0\n"), 1), never=["segments-empty"])


@reaches("segments-empty")
def excerpt_of_a_minute_without_film(world):
    return excerpt_of(world, without_film(world, 60, sealed_nothing(world)), 20 * SECOND, 60 * SECOND, 1, streams=("endoscope",))


@reaches("segments-empty")
def excerpt_of_two_seconds_without_film(world):
    """No longer than a silence may be, and there is nothing else."""
    return excerpt_of(world, without_film(world, 4, sealed_nothing(world)), 11 * SECOND, 13 * SECOND, 1, streams=("endoscope",))


@reaches("segments-sparse")
def excerpt_of_seconds_without_film_between_others(world):
    return excerpt_of(world, without_film(world, 4, sealed_nothing(world)), 8 * SECOND, 16 * SECOND, 0, streams=("endoscope",), never=["segments-empty"])


@reaches("segment-hole")
def seams_that_add_up(world):
    """Segments of no length with a picture each, a millisecond apart."""
    return world.write(without_film(world, 0.2, world.seal("endoscope 0", b"endoscope 0\n"), 1, length=0, apart=MS))


@reaches()
def seams_that_are_few(world):
    return world.write(without_film(world, 0.09, world.seal("endoscope 0", b"endoscope 0\n"), 1, length=0, apart=MS), never=["segment-hole", "segment-overlap"])


@reaches("segment-hole", "gap")
def gaps_of_no_length_that_are_joined_over_a_hole(world):
    case = without_film(world, 0.2)
    for ms in range(10_000, 10_201):
        case.steps.insert(case.steps.index(case.find("close")), Entry("gap", 20_230 * MS, {"stream": "endoscope", "start_ns": ms * MS, "end_ns": ms * MS, "cause": "overload"}))
    return world.write(case)


def said_to_be_found(world, data, complete=True, names=("endoscope", "vitals"), segments=9):
    """Files of 10 s each of which a recovery is said to know no more than that they are there."""
    case, at = world.begin(), (10 * segments + 10) * SECOND
    case.add("recovered", at, boot_id=w.BOOT_ID, after="power-loss", truncated="")
    for name in ("endoscope", "vitals"):
        for i in range(segments):
            there = data if name in names else world.seal(f"{name} 0", f"{name} 0\n".encode())
            entry = case.segment(name, i, 10 * i * SECOND, 10 * (i + 1) * SECOND, there, 0, mono_ns=at, complete=complete)
            for key in ("first_pts", "time_base", "frames", "samples", "dropped"):
                entry.fields.pop(key, None)
        case.add("gap", at, stream=name, start_ns=10 * segments * SECOND, end_ns=at, cause="interrupted")
    return world.end(case, at + 100 * MS)


@reaches("segments-found-many", "recovered")
def more_parts_than_a_recorder_that_dies_leaves(world):
    return world.write(said_to_be_found(world, b"", complete=False, names=("endoscope",), segments=65), never=["segment-not-sealed"])


@reaches("segment-incomplete", "recovered")
def as_many_parts_as_a_recorder_that_dies_leaves(world):
    return world.write(said_to_be_found(world, b"", complete=False, names=("endoscope",), segments=64), never=["segments-found-many"])


@reaches("segment-not-sealed", "recovered")
def empty_files_that_are_said_to_be_found(world):
    return world.write(said_to_be_found(world, b""))


@reaches("segment-not-sealed", "recovered")
def texts_that_are_said_to_be_found(world):
    return world.write(said_to_be_found(world, b"hello\n"))


@reaches("segment-not-sealed", "recovered")
def sealed_nothings_that_are_said_to_be_found_of_a_camera(world):
    return world.write(said_to_be_found(world, sealed_nothing(world)))


@reaches("segment-uncounted", "recovered")
def sealed_nothings_that_were_found_of_a_monitor(world):
    """It may have said nothing."""
    return world.write(said_to_be_found(world, sealed_nothing(world), names=("vitals",)), never=["segment-not-sealed", "segments-empty"])


@reaches("segment-incomplete", "recovered")
def parts_that_a_power_cut_left_empty(world):
    return world.write(said_to_be_found(world, b"", complete=False), never=["segment-not-sealed", "segments-empty", "segment-hole"])


@reaches("segment-incomplete", "recovered")
def parts_of_which_a_power_cut_left_a_block_and_zeros(world):
    header = _header_of(world.seal("endoscope 0", b"endoscope 0\n"))
    return world.write(said_to_be_found(world, header + bytes(16) + bytes(4096 - 16 - len(header)), complete=False), never=["segment-not-sealed", "segments-empty"])


def counted_parts(world, data, count):
    """A minute of segments that were cut off, each with a gap of no length."""
    case = world.begin()
    for i in range(12):
        for name, its in (("endoscope", 125 * count), ("vitals", 5 * count)):
            case.segment(name, i, 5 * i * SECOND, 5 * (i + 1) * SECOND, data, its, complete=False)
            case.add("gap", 5 * (i + 1) * SECOND + 20 * MS, stream=name, start_ns=5 * (i + 1) * SECOND, end_ns=5 * (i + 1) * SECOND, cause="overload")
    return world.end(case, 60 * SECOND + 40 * MS)


@reaches("segment-not-sealed", "segment-incomplete", "gap")
def empty_parts_with_as_many_frames_as_there_should_be(world):
    return world.write(counted_parts(world, b"", 1))


@reaches("segment-not-sealed", "segment-incomplete", "gap")
def headers_alone_with_as_many_frames_as_there_should_be(world):
    return world.write(counted_parts(world, _header_of(world.seal("endoscope 0", b"endoscope 0\n")) + bytes(16), 1))


@reaches("segments-empty", "segment-incomplete", "gap")
def empty_parts_without_a_frame(world):
    return world.write(counted_parts(world, b"", 0), never=["segment-not-sealed"])


@reaches("segment-incomplete", "gap")
def parts_of_which_some_was_written(world):
    sealed = world.seal("endoscope 0", b"endoscope 0\n")
    return world.write(counted_parts(world, sealed[:len(_header_of(sealed)) + 17], 1), never=["segment-not-sealed", "segments-empty"])


def with_subject(world, data, **given):
    case = world.sound()
    case.steps[0].fields["subject"] = case.file("subject.json.age", data)
    return world.write(case, **given)


@reaches("subject-not-sealed")
def empty_subject(world):
    return with_subject(world, b"")


@reaches("subject-not-sealed")
def subject_in_the_clear(world):
    return with_subject(world, b'{"patient":"Taro Yamada"}')


@reaches("subject-not-sealed")
def subject_that_is_a_sealed_nothing(world):
    return with_subject(world, sealed_nothing(world))


@reaches()
def subject_that_is_sealed(world):
    return with_subject(world, world.seal("subject", b'{"patient":"Taro Yamada"}'), never=["subject-not-sealed"])


@reaches("segment-undecodable")
def subject_that_opens(world):
    """With a key the film of such a case is found to be none."""
    return with_subject(world, world.seal("subject", b'{"patient":"Taro Yamada"}'), identity=str(world.reader),
                        never=["subject-undecodable", "subject-undecryptable", "subject-not-decrypted"])


@reaches("subject-undecryptable")
def subject_of_sealed_nonsense(world):
    sealed = world.seal("subject", b'{"patient":"Taro Yamada"}')
    return with_subject(world, sealed[:-1] + bytes([sealed[-1] ^ 1]), identity=str(world.reader), never=["subject-undecodable"])


@reaches("subject-undecodable")
def subject_that_names_nobody(world):
    return with_subject(world, world.seal("a subject of lines", b"Taro Yamada\n"), identity=str(world.reader))


@reaches("subject-undecodable")
def subject_deeper_than_anybody_reads(world):
    return with_subject(world, world.seal("a deep subject", b'{"a":' * 100_000 + b"1" + b"}" * 100_000), identity=str(world.reader))


@reaches("subject-not-decrypted")
def subject_sealed_for_somebody_else(world):
    sealed = age.seal(b'{"patient":"Taro Yamada"}', [age.Identity(bytes([9] * 32)).public])
    return with_subject(world, sealed, identity=str(world.reader), never=["subject-undecodable"])


@reaches("file-hash-differs")
def rekeyed_from_an_empty_file(world):
    def change(document, files):
        files["segments/endoscope/00000001.ts.age.header"] = b""
        files["segments/endoscope/00000001.ts.age"] = age.header(bytes(16), [world.reader.public], [bytes([7] * 32)])
    written = in_place_of_films(world, lambda sealed: b"").write(world.folder / "whole")
    return world.given(w.write_excerpt(written, world.folder / "excerpt", 6 * SECOND, 9 * SECOND, ["endoscope"], 2, len(written.lines), change=change))


@reaches("segment-name-differs")
def segment_of_another_name(world):
    case = world.sound()
    entry = case.find("segment", 2)
    data = case.files.pop(entry.fields["file"])
    entry.fields["file"] = "segments/endoscope/film.ts.age"
    case.files[entry.fields["file"]] = data
    return world.write(case)


@reaches("segment-name-differs")
def profile_of_another_container(world):
    case = world.sound()
    case.find("segment", 2).fields["profile"] = "lossless"
    return world.write(case)


@reaches()
def profile_changed(world):
    case = world.sound()
    entry = case.find("segment", 2)
    data = case.files.pop(entry.fields["file"])
    entry.fields |= {"profile": "lossless", "time_base": "1/1000", "first_pts": 5_000, **case.file("segments/endoscope/00000001.mkv.age", data)}
    return world.write(case)


@reaches("segment-out-of-order")
def index_left_out(world):
    case = world.sound()
    entry = case.find("segment", 6)
    data = case.files.pop(entry.fields["file"])
    entry.fields |= {"index": 9, **case.file("segments/endoscope/00000009.ts.age", data)}
    return world.write(case)


@reaches("segment-overlap")
def overlap(world):
    case = world.sound()
    case.find("segment", 2).fields["start_ns"] = 4 * SECOND
    return world.write(case)


@reaches()
def seams_of_a_millisecond(world):
    case = world.sound()
    case.find("segment", 2).fields["start_ns"] += MS
    case.find("segment", 3).fields["start_ns"] -= MS
    case.find("segment", 3).fields["first_pts"] -= MS
    return world.write(case)


def stamped(world, stamps, seconds=5):
    """Segments of film of five seconds, first stamped so; by their times they follow one another."""
    case, n = world.begin(), len(stamps)
    for i, stamp_s in enumerate(stamps):
        of = case.segment("endoscope", i, i * seconds * SECOND, (i + 1) * seconds * SECOND, world.seal("endoscope 0", b"endoscope 0\n"), 125, mono_ns=n * seconds * SECOND)
        of.fields["first_pts"] = int(stamp_s * 90_000)
        case.segment("vitals", i, i * seconds * SECOND, (i + 1) * seconds * SECOND, world.seal("vitals 0", b"vitals 0\n"), 5, mono_ns=n * seconds * SECOND)
    return world.end(case, n * seconds * SECOND + 40 * MS)


@reaches("segment-times-differ", "segment-times-late")
def segments_that_change_places_by_their_stamps(world):
    return world.write(stamped(world, [0, 10, 5, 15]))


@reaches("segment-times-late")
def film_moved_by_minutes(world):
    """An older recorder may have stamped so of a camera that stated a picture in minutes."""
    return world.write(stamped(world, [0, 5, 310, 315]), never=["segment-times-differ"])


@reaches("segment-times-late")
def film_moved_by_seconds(world):
    return world.write(stamped(world, [0, 5, 20, 25]), never=["segment-times-differ"])


@reaches("segment-times-late")
def film_moved_by_minutes_behind_dropped_frames(world):
    """What was never coded has no stamp."""
    case = stamped(world, [0, 5, 310, 315])
    case.find("segment", 1).fields["dropped"] = 1 << 32
    case.refresh_totals()
    return world.write(case, never=["segment-times-differ"])


@reaches("segment-times-late")
def a_segment_stamped_a_second_and_a_half_late(world):
    return world.write(stamped(world, [0, 5, 11.5, 15]), never=["segment-times-differ"])


@reaches()
def bursts_of_a_second(world):
    return world.write(stamped(world, [0.5, 6.5, 11.2, 15.5]), never=["segment-times-differ", "segment-times-late"])


@reaches()
def stamps_with_another_constant(world):
    return world.write(stamped(world, [1000, 1005, 1010, 1015]), never=["segment-times-differ", "segment-times-late"])


@reaches("segment-times-differ")
def another_unit_of_stamps(world):
    case = world.sound()
    case.find("segment", 2).fields.update(time_base="1/1000", first_pts=5000)
    return world.write(case, never=["segment-times-late"])


@reaches("segment-times-differ")
def vital_signs_that_begin_elsewhere(world):
    case = world.sound()
    case.find("segment", 3).fields["first_pts"] += 1
    return world.write(case)


@reaches("segment-times-late", "gap")
def an_earlier_stamp_behind_a_gap(world):
    case = stamped(world, [0, 10, 5, 15])
    case.steps.insert(case.steps.index(case.find("segment", 4)), Entry("gap", 20 * SECOND, {"stream": "endoscope", "start_ns": 10 * SECOND, "end_ns": 10 * SECOND, "cause": "interrupted"}))
    return world.write(case, never=["segment-times-differ"])


@reaches("segment-hole")
def hole(world):
    case = world.sound()
    case.find("segment", 2).fields["start_ns"] += MS + 1
    return world.write(case)


@reaches("no-stream")
def no_stream_at_all(world):
    return world.write(world.end(world.begin(streams=[]), 20_040 * MS))


@reaches("no-stream")
def no_stream_but_of_marks(world):
    case = world.begin(streams=world.streams()[2:])
    line, commitment = w.event_line(bytes(range(32)), {"time_ns": 11 * SECOND, "utc": stamp.text_of(world.utc_ns + 11 * SECOND), "kind": "mark", "text": "clip placed"})
    case.add("mark", 11 * SECOND, commitment=commitment)
    case.segment("events", 0, 10 * SECOND, 12 * SECOND, world.seal("events", line), 1, mono_ns=20_030 * MS)
    return world.write(world.end(case, 20_040 * MS), never=["stream-empty"])


@reaches("stream-empty")
def nothing_of_a_stream(world):
    case = world.begin()
    world.record(case, 0, 4, ("endoscope",))
    return world.write(world.end(case, 20_040 * MS))


@reaches("stream-begins-late")
def late_beginning(world):
    case = world.begin()
    world.record(case, 0, 4, ("endoscope",))
    for i in range(3):
        case.segment("vitals", i, 5 * (i + 1) * SECOND, 5 * (i + 2) * SECOND, world.seal(f"vitals {i}", f"vitals {i}\n".encode()), 5, mono_ns=20_021 * MS)
    return world.write(world.end(case, 20_040 * MS))


@reaches("stream-ends-early")
def early_end(world):
    case = world.begin()
    world.record(case, 0, 1)
    world.record(case, 1, 4, ("endoscope",))
    return world.write(world.end(case, 20_040 * MS))


@reaches("gap-beyond-end")
def gap_beyond_the_end(world):
    case = world.sound()
    at = case.steps.index(case.find("close"))
    case.steps.insert(at, Entry("gap", case.steps[at].mono_ns, {"stream": "vitals", "start_ns": 20 * SECOND, "end_ns": 36_000 * SECOND, "cause": "signal-lost"}))
    return world.write(case)


@reaches("segment-in-future")
def segment_of_the_future(world):
    case = world.sound()
    case.find("segment", 2).mono_ns = case.find("segment", 3).mono_ns = 5_020 * MS
    return world.write(case)


@reaches("segment-too-long")
def long_segment(world):
    case = world.begin()
    case.segment("endoscope", 0, 0, 12 * SECOND, world.seal("endoscope 0", b"endoscope 0\n"), 300)
    case.segment("vitals", 0, 0, 12 * SECOND, world.seal("vitals 0", b"vitals 0\n"), 12)
    return world.write(world.end(case, 12_040 * MS))


@reaches("segment-too-long")
def long_segment_of_a_monitor(world):
    case = world.begin()
    world.record(case, 0, 4, ("endoscope",))
    case.segment("vitals", 0, 0, 20 * SECOND, world.seal("vitals 0", b"vitals 0\n"), 20)
    return world.write(world.end(case, 20_040 * MS))


@reaches("segment-cut-unexplained")
def cut_and_nothing_happened(world):
    case = world.begin()
    case.segment("endoscope", 0, 0, 5 * SECOND, world.seal("endoscope 0", b"endoscope 0\n"), 125, complete=False)
    world.record(case, 0, 1, ("vitals",))
    world.record(case, 1, 4)
    return world.write(world.end(case, 20_040 * MS))


@reaches("segment-uncounted-unexplained")
def uncounted(world):
    case = world.sound()
    for key in ("first_pts", "time_base", "frames", "dropped"):
        del case.find("segment", 2).fields[key]
    case.refresh_totals()
    return world.write(case)


@reaches("totals-differ")
def other_totals(world):
    case = world.sound()
    case.find("close").fields["totals"]["vitals"]["frames"] += 1
    return world.write(case)


@reaches("totals-differ", "stream-unknown")
def totals_of_other_streams(world):
    case = world.sound()
    totals = case.find("close").fields["totals"]
    totals["ghost"] = totals.pop("vitals")
    return world.write(case)


@reaches("sound-gap")
def no_sound(world):
    case = world.sound()
    case.steps.insert(case.steps.index(case.find("mark")), Entry("gap", 10_500 * MS, {"stream": "endoscope", "start_ns": 0, "end_ns": SECOND, "cause": "signal-lost", "of": "sound"}))
    return world.write(case)


@reaches("segment-hole", "sound-gap")
def sound_excuses_no_hole(world):
    case = world.sound()
    case.find("segment", 2).fields["start_ns"] += SECOND
    case.steps.insert(case.steps.index(case.find("mark")), Entry("gap", 10_500 * MS, {"stream": "endoscope", "start_ns": 5 * SECOND, "end_ns": 6 * SECOND, "cause": "signal-lost", "of": "sound"}))
    return world.write(case)


@reaches("gap", "segment-incomplete")
def disk_full(world):
    case = world.begin()
    world.record(case, 0, 2, ("vitals",))
    case.segment("endoscope", 0, 0, 5 * SECOND, world.seal("endoscope 0", b"endoscope 0\n"), 125, mono_ns=10_021 * MS, complete=False)
    case.add("gap", 10_022 * MS, stream="endoscope", start_ns=5 * SECOND, end_ns=10 * SECOND, cause="disk-full")
    world.record(case, 2, 4)
    for entry, index in ((case.find("segment", 3), 1), (case.find("segment", 5), 2)):
        entry.fields |= {"index": index, **case.file(f"segments/endoscope/{index:08d}.ts.age", case.files.pop(entry.fields["file"]))}
    return world.write(world.end(case, 20_040 * MS))


def erased(world, removed=True):
    case = world.sound()
    case.add("erased", 20_300 * MS, stream="vitals", first_index=0, last_index=1, policy="vitals after 30 days")
    case.checkpoint()
    if removed:
        for i in (0, 1):
            case.files[f"segments/vitals/{i:08d}.jsonl.age"] = None
    return case


@reaches("segments-erased")
def retention(world):
    return world.write(erased(world))


@reaches("erased-never-recorded")
def erased_what_never_was(world):
    case = world.sound()
    case.add("erased", 20_300 * MS, stream="endoscope", first_index=4, last_index=900, policy="room pictures after a day")
    case.checkpoint()
    return world.write(case)


@reaches("erased-never-recorded", "segments-erased")
def erased_more_than_there_was(world):
    case = erased(world)
    case.find("erased").fields["last_index"] = 700
    return world.write(case)


@reaches("segment-within-gap", "gap")
def pictures_of_a_gap(world):
    case = world.sound()
    end = case.steps.index(case.find("close"))
    case.steps.insert(end, Entry("gap", 20_035 * MS, {"stream": "endoscope", "start_ns": 2 * SECOND, "end_ns": 18 * SECOND, "cause": "signal-lost"}))
    return world.write(case)


@reaches("segments-erased", "erased-file-present")
def retention_cut_off(world):
    return world.write(erased(world, False))


@reaches("end-not-covered")
def unsigned_erasure(world):
    case = erased(world, False)
    del case.steps[-1]
    return world.write(case)


@reaches("frames-dropped")
def dropped(world):
    case = world.sound()
    case.find("segment", 2).fields["dropped"] = 3
    case.refresh_totals()
    return world.write(case)


@reaches("segments-sparse")
def few_frames(world):
    case = world.sound()
    case.find("segment", 2).fields["frames"] = 20
    case.refresh_totals()
    return world.write(case)


@reaches("segments-sparse")
def monitor_said_nothing(world):
    case = world.sound()
    for i in (1, 3, 5, 7):
        case.find("segment", i).fields["samples"] = 0
    case.refresh_totals()
    return world.write(case)


@reaches("segments-sparse")
def less_than_a_frame_a_second(world):
    case = world.sound()
    for i in (0, 2, 4, 6):
        case.find("segment", i).fields["frames"] = 2
    case.refresh_totals()
    return world.write(case)


@reaches("monitor-silent")
def silent_monitor(world):
    case = world.begin()
    world.record(case, 0, 14)
    for i in range(1, 14):
        case.find("segment", 2 * i + 1).fields["samples"] = 0
    return world.write(world.end(case, 70_040 * MS))


@reaches("stream-shorter")
def short_file(world):
    case = world.begin(streams=world.streams(endoscope="source"))
    world.record(case, 0, 1)
    world.record(case, 1, 4, ("vitals",))
    return world.write(world.end(case, 20_040 * MS))


@reaches("segment-undecryptable")
def sealed_nonsense(world):
    case = world.sound()
    entry = case.find("segment", 2)
    entry.fields |= case.file(entry.fields["file"], b"age-encryption.org/v1\nnonsense" * 20)
    case.refresh_totals()
    return world.write(case, identity=str(world.reader))


@reaches("segment-not-for-recipient")
def sealed_for_somebody_else(world):
    case = world.sound()
    entry = case.find("segment", 3)
    entry.fields |= case.file(entry.fields["file"], age.seal(b"{}\n", [age.Identity(bytes([9] * 32)).public]))
    case.refresh_totals()
    return world.write(case, identity=str(world.reader))


@reaches("segment-not-decrypted")
def another_reader(world):
    return world.write(world.sound(), identity=str(age.Identity(bytes([9] * 32))))


@reaches("segment-undecodable")
def lines_that_are_no_vital_signs(world):
    return world.write(world.sound(), identity=str(world.reader))


def case_with_events(world, *events, reason=None, complete=True, utc_at=lambda at: max(0, min(at, 60 * SECOND))):
    """A sound case whose one mark was entered, with other events sealed than its own; each is a time and a text."""
    case = world.sound()
    mark = case.find("mark")
    lines = []
    for at, text in events:
        line, commitment = w.event_line(bytes(range(32)), {"time_ns": at, "utc": stamp.text_of(world.utc_ns + utc_at(at)), "kind": "mark", "text": text})
        lines.append(line)
        mark.fields["commitment"] = commitment if not lines[1:] else mark.fields["commitment"]
    sealed = next(entry for entry in case.steps if isinstance(entry, Entry) and entry.type == "segment" and entry.fields["stream"] == "events")
    case.files.pop(sealed.fields["file"])
    name = sealed.fields["file"] + ("" if complete else ".part")
    sealed.fields |= case.file(name, age.seal(b"".join(lines), [world.reader.public])) | {"complete": complete}
    sealed.fields["samples"] = len(lines)
    if not complete:
        case.steps.insert(case.steps.index(sealed) + 1, Entry("gap", sealed.mono_ns, {"stream": "events", "start_ns": 12 * SECOND, "end_ns": 20 * SECOND, "cause": "overload"}))
    if reason:
        case.find("close").fields["reason"] = reason
    case.refresh_totals()
    return case


def with_events(world, *events, never=(), **how):
    return world.write(case_with_events(world, *events, **how), identity=str(world.reader), never=list(never))


@reaches("event-missing")
def a_mark_of_which_nothing_is_sealed(world):
    return with_events(world)


@reaches("event-not-committed")
def an_event_of_no_mark(world):
    return with_events(world, (11 * SECOND, "clip placed"), (11 * SECOND, "artery cut"))


@reaches("event-not-committed")
def an_event_that_stands_there_twice(world):
    return with_events(world, (11 * SECOND, "clip placed"), (11 * SECOND, "clip placed"))


@reaches("event-not-committed")
def an_event_of_no_mark_where_the_disk_was_full(world):
    """A recorder enters the marks of a segment before the segment, whatever ends the case."""
    return with_events(world, (11 * SECOND, "clip placed"), (11 * SECOND, "artery cut"), reason="disk-full")


@reaches("event-not-committed")
def an_event_of_no_mark_where_the_recorder_failed(world):
    return with_events(world, (11 * SECOND, "clip placed"), (11 * SECOND, "artery cut"), reason="error: the camera broke")


@reaches("event-not-committed")
def an_event_of_no_mark_in_a_segment_that_is_said_to_be_cut_off(world):
    return with_events(world, (11 * SECOND, "clip placed"), (11 * SECOND, "artery cut"), complete=False)


@reaches("event-missing")
def a_mark_of_which_nothing_is_sealed_long_before_the_disk_was_full(world):
    return with_events(world, reason="disk-full")


@reaches("event-missing")
def a_mark_and_no_segment_of_events(world):
    case = world.sound()
    sealed = next(entry for entry in case.steps if isinstance(entry, Entry) and entry.type == "segment" and entry.fields["stream"] == "events")
    case.files.pop(sealed.fields["file"])
    case.steps.remove(sealed)
    case.refresh_totals()
    return world.write(case, identity=str(world.reader))


@reaches("events-not-compared")
def a_mark_of_the_last_moment_before_the_disk_was_full(world):
    """The recorder could not seal it any more."""
    case = case_with_events(world, (11 * SECOND, "clip placed"), reason="disk-full")
    close = case.find("close")
    case.steps.insert(case.steps.index(close), Entry("mark", close.mono_ns, {"commitment": "00" * 32}))
    return world.write(case, identity=str(world.reader), never=["event-missing"])


@reaches("events-not-compared")
def a_mark_of_which_a_segment_that_was_cut_off_may_have_lost_the_event(world):
    return with_events(world, complete=False, never=["event-missing"])


@reaches("segment-undecodable")
def an_event_in_a_segment_that_was_cut_off(world):
    """With a key the film of such a case is found to be none."""
    return with_events(world, (11 * SECOND, "clip placed"), complete=False, never=["event-not-committed", "event-missing", "events-not-compared"])


def found_events(world, time_ns, cut_off_ns=40 * SECOND):
    """Recovery found an events segment whose one event no mark entry commits to. The recorder died at `cut_off_ns`."""
    case = world.begin()
    world.record(case, 0, cut_off_ns // SECOND // 5)
    case.checkpoint()
    case.token(world.outside, cut_off_ns + 100 * MS, gen_ns=cut_off_ns + 90 * MS)
    at = cut_off_ns + 5 * SECOND
    case.add("recovered", at, boot_id=w.BOOT_ID, after="crash", truncated="")
    line, _ = w.event_line(bytes(range(32)), {"time_ns": time_ns, "utc": stamp.text_of(world.utc_ns), "kind": "mark", "text": "artery cut"})
    entry = case.segment("events", 0, 0, 9 * SECOND, age.seal(line, [world.reader.public]), 0, mono_ns=at)
    for key in ("first_pts", "time_base", "samples", "dropped"):
        entry.fields.pop(key, None)
    for name in ("endoscope", "vitals"):
        case.add("gap", at, stream=name, start_ns=cut_off_ns, end_ns=at, cause="interrupted")
    return world.end(case, at + 100 * MS)


@reaches("event-not-committed")
def an_event_of_no_mark_that_is_said_to_be_found(world):
    """Of half a minute before the recorder died, which had entered its mark long since."""
    return world.write(found_events(world, 10 * SECOND), identity=str(world.reader))


@reaches("events-not-compared")
def an_event_whose_mark_was_not_entered_when_the_recorder_died(world):
    return world.write(found_events(world, 39 * SECOND), identity=str(world.reader), never=["event-not-committed"])


def excerpt_with_events(world, case, begins="token", behind=0):
    """From 9 s to 19 s, with the lines from the first one of that type on, or so many behind it."""
    written = case.write(world.folder / "whole")
    first = behind + next(i for i, line in enumerate(written.lines) if f'"type":"{begins}"'.encode() in line)
    names = ["endoscope", "vitals", "events"]
    folder = w.write_excerpt(written, world.folder / "excerpt", 9 * SECOND, 19 * SECOND, names, first, len(written.lines))
    return world.given(folder, identity=str(world.reader))


@reaches("event-not-committed")
def excerpt_with_an_event_of_no_mark(world):
    return excerpt_with_events(world, case_with_events(world, (11 * SECOND, "clip placed"), (11 * SECOND, "artery cut")))


@reaches("event-missing")
def excerpt_with_a_mark_of_which_nothing_is_sealed(world):
    return excerpt_with_events(world, case_with_events(world))


@reaches("event-time-differs")
def excerpt_with_a_mark_that_states_an_earlier_moment(world):
    return excerpt_with_events(world, case_with_events(world, (2 * SECOND, "clip placed")))


@reaches("events-not-compared")
def excerpt_whose_lines_begin_behind_the_mark(world):
    given = excerpt_with_events(world, case_with_events(world, (11 * SECOND, "clip placed")), begins="mark", behind=1)
    given.never = ["event-not-committed", "event-missing"]
    return given


@reaches("segment-undecodable")
def excerpt_with_its_mark_and_its_event(world):
    """With a key the film of such a case is found to be none."""
    given = excerpt_with_events(world, case_with_events(world, (11 * SECOND, "clip placed")))
    given.never = ["event-not-committed", "event-missing", "event-time-differs", "events-not-compared"]
    return given


@reaches("event-time-differs")
def a_mark_that_states_an_earlier_moment(world):
    return with_events(world, (2 * SECOND, "clip placed"))


@reaches("event-time-differs")
def a_mark_that_states_the_earliest_moment(world):
    return with_events(world, (-(1 << 63), "clip placed"))


@reaches("event-time-differs")
def a_mark_that_states_the_latest_moment(world):
    return with_events(world, ((1 << 64) - 1, "clip placed"))


@reaches("event-time-differs")
def a_mark_that_states_a_later_moment(world):
    return with_events(world, (13 * SECOND, "clip placed"))


@reaches("event-time-differs")
def a_mark_that_states_another_utc(world):
    return with_events(world, (11 * SECOND, "clip placed"), utc_at=lambda at: at - 3600 * SECOND)


@reaches("event-not-committed")
def a_line_with_two_events(world):
    """Readers take another one of the two."""
    case = case_with_events(world, (11 * SECOND, "clip placed"))
    line, commitment = w.event_line(bytes(range(32)), {"time_ns": 11 * SECOND, "utc": stamp.text_of(world.utc_ns + 11 * SECOND), "kind": "mark", "text": "clip placed"})
    sealed = next(entry for entry in case.steps if isinstance(entry, Entry) and entry.type == "segment" and entry.fields["stream"] == "events")
    case.find("mark").fields["commitment"] = commitment
    twice = line.replace(b'{"event"', b'{"event":"{}","event"', 1)
    sealed.fields |= case.file(sealed.fields["file"], age.seal(twice, [world.reader.public]))
    case.refresh_totals()
    return world.write(case, identity=str(world.reader))


@reaches("segment-part-lost")
def part_not_flushed(world):
    case = cut_off(world)
    entry = case.segment("vitals", 2, 10 * SECOND, 12 * SECOND, world.seal("vitals 2", b"vitals 2\n")[:-20] + bytes(20), 0, mono_ns=15 * SECOND, complete=False)
    for key in ("first_pts", "time_base", "samples", "dropped"):
        del entry.fields[key]
    case.add("gap", 15 * SECOND, stream="endoscope", start_ns=10 * SECOND, end_ns=15 * SECOND, cause="interrupted")
    case.add("gap", 15 * SECOND, stream="vitals", start_ns=12 * SECOND, end_ns=15 * SECOND, cause="interrupted")
    case.close(15_100 * MS, "recovered")
    case.checkpoint()
    case.token(world.outside, 15_200 * MS, gen_ns=15_190 * MS)
    case.checkpoint()
    return world.write(case, identity=str(world.reader))


# Files


@reaches("file-missing")
def segment_removed(world):
    case = world.sound()
    case.files["segments/endoscope/00000001.ts.age"] = None
    return world.write(case)


@reaches("file-size-differs")
def segment_longer(world):
    case = world.sound()
    case.files["segments/endoscope/00000001.ts.age"] += b"x"
    return world.write(case)


@reaches("file-too-large")
def giant(world):
    case = world.sound()
    entry = case.find("segment", 2)
    entry.fields["bytes"] = (1 << 30) + 1
    case.refresh_totals()
    written = case.write(world.folder)
    os.truncate(written.folder / entry.fields["file"], (1 << 30) + 1)
    return world.given(written.folder)


@reaches("file-has-hole")
def hole_in_a_file(world):
    case = world.sound()
    entry = case.find("segment", 2)
    entry.fields |= {"bytes": 1 << 20, "sha256": hashlib.sha256(bytes(1 << 20)).hexdigest()}
    case.refresh_totals()
    written = case.write(world.folder)
    path = written.folder / entry.fields["file"]
    path.write_bytes(b"")
    os.truncate(path, 1 << 20)
    return world.given(written.folder)


@reaches("file-hash-differs")
def bit_flipped(world):
    case = world.sound()
    data = bytearray(case.files["segments/endoscope/00000001.ts.age"])
    data[-1] ^= 1
    case.files["segments/endoscope/00000001.ts.age"] = bytes(data)
    return world.write(case)


@reaches("file-hash-differs")
def token_replaced(world):
    case = world.sound()
    case.of(Token)[1].fields = {"sha256": "0" * 64}
    return world.write(case)


@reaches("file-unnamed")
def smuggled(world):
    case = world.sound()
    case.files["readme.txt"] = b"hello\n"
    case.files["segments/other/00000000.ts.age"] = b"hello\n"
    return world.write(case)


@reaches("file-not-regular")
def linked(world):
    written = world.sound().write(world.folder)
    path = written.folder / "segments/endoscope/00000001.ts.age"
    path.rename(world.folder / "elsewhere")
    path.symlink_to(world.folder / "elsewhere")
    return world.given(written.folder)


@reaches("file-not-regular")
def one_file_of_two_names(world):
    case = world.sound()
    data = case.files["segments/endoscope/00000001.ts.age"]
    entry = case.find("segment", 4)
    entry.fields |= case.file(entry.fields["file"], data)
    case.refresh_totals()
    written = case.write(world.folder)
    (written.folder / entry.fields["file"]).unlink()
    os.link(written.folder / "segments/endoscope/00000001.ts.age", written.folder / entry.fields["file"])
    return world.given(written.folder)


@reaches("name-clash", "file-unnamed")
def names_that_differ_in_case(world):
    case = world.sound()
    case.files["Device.pub"] = b"x"
    return world.write(case)


@reaches("file-unreadable")
def unreadable(world):
    written = world.sound().write(world.folder)
    (written.folder / "segments/endoscope/00000001.ts.age").chmod(0)
    return world.given(written.folder, unprivileged=True)


@reaches("file-unreadable")
def unreadable_newest_checkpoint(world):
    written = world.sound().write(world.folder)
    max((written.folder / "checkpoints").iterdir()).chmod(0)
    return dataclasses.replace(world.given(written.folder, unprivileged=True), never=["ledger-not-covered", "close-not-covered", "token-not-covered"])


@reaches("file-unreadable")
def excerpt_with_unreadable_lines(world):
    given = excerpt(world)
    (given.path / "ledger-part.jsonl").chmod(0)
    return dataclasses.replace(given, unprivileged=True, never=["file-unnamed"])


@reaches("file-unreadable")
def excerpt_with_an_unreadable_beginning(world):
    given = excerpt(world)
    (given.path / "ledger-open.jsonl").chmod(0)
    return dataclasses.replace(given, unprivileged=True, never=["file-unnamed"])


def with_files_of_systems(world, *names):
    written = world.sound().write(world.folder)
    for name in names:
        (written.folder / name).parent.mkdir(exist_ok=True)
        (written.folder / name).write_bytes(b"x")
    return world.given(written.folder)


@reaches("file-of-a-system")
def looked_at_by_other_systems(world):
    return dataclasses.replace(with_files_of_systems(world, ".DS_Store", "segments/.DS_Store", "checkpoints/Thumbs.db", "desktop.ini", "@eaDir/ledger.jsonl@SynoEAStream",
                                                     "segments/endoscope/00000000.ts.age:Zone.Identifier"), never=["file-unnamed"])


@reaches("file-unnamed")
def files_that_only_seem_to_be_of_a_system(world):
    return dataclasses.replace(with_files_of_systems(world, "film.DS_Store", "Thumbs.db.ts.age", ":Zone.Identifier"), never=["file-of-a-system"])


@reaches("file-unnamed")
def file_with_the_name_of_a_system_s_folder(world):
    return dataclasses.replace(with_files_of_systems(world, "@eaDir"), never=["file-of-a-system"])


@reaches("format-newer")
def case_of_a_later_version(world):
    case = world.sound()
    case.steps[0].fields["format"] = "kiroku-case/2"
    return dataclasses.replace(world.write(case), never=["entry-malformed"])


@reaches("entry-malformed", "ledger-changed")
def case_changed_into_one_of_a_later_version(world):
    written = world.sound().write(world.folder)
    path = written.folder / "ledger.jsonl"
    path.write_bytes(path.read_bytes().replace(b"kiroku-case/1", b"kiroku-case/3", 1))
    return dataclasses.replace(world.given(written.folder), never=["format-newer"])


def of_a_later_version(case):
    case.steps[0].fields["format"] = "kiroku-case/2"
    return case


NO_FORGERY = ["log-opening-differs", "log-checkpoint-differs", "log-knows-more", "log-end-differs", "log-head-differs", "log-case-unknown", "log-proof-differs", "outside-note-forked",
              "outside-note-rolled-back", "ledger-changed", "ledger-cut", "log-silent", "entry-malformed"]


def later_beside_its_log(world, change=lambda log, written: None, made=lambda case: None):
    log = w.Log(world.device, world.utc_ns - 60 * SECOND)
    log.checkpoint()
    empty = log.write(world.folder / "before", "log")
    case = of_a_later_version(world.sound(log_state=(1, empty.root().hex())))
    made(case)
    return with_log(world, change, case=case)


@reaches("format-newer")
def case_of_a_later_version_that_its_log_knows(world):
    return dataclasses.replace(later_beside_its_log(world), never=NO_FORGERY)


@reaches("format-newer", "log-proof-holds", "outside-note-holds")
def case_of_a_later_version_with_a_proof_and_a_kept_note(world):
    given = by_proof(world, later_beside_its_log(world))
    against = kept(world, max((given.path / "checkpoints").iterdir()).read_bytes(), "case.note")
    return dataclasses.replace(given, against=against, never=NO_FORGERY)


def made_anew(world, given, **opening):
    """By whoever has the device's key: the same case with another mark, in a later version."""
    case = of_a_later_version(world.sound(log_state=(1, "0" * 64)))
    case.steps[0].fields.update(opening)
    case.find("mark").fields["commitment"] = "0" * 64
    shutil.rmtree(given.path)
    case.write(world.folder)
    return given


@reaches("format-newer", "log-opening-differs", "log-checkpoint-differs", "log-head-differs")
def case_made_anew_in_a_later_version_beside_its_log(world):
    return made_anew(world, with_log(world))


@reaches("format-newer", "log-opening-differs")
def case_made_anew_in_a_later_version_that_says_nothing_of_the_log(world):
    return dataclasses.replace(made_anew(world, with_log(world), appliance_log="none", case="another", device="another"), never=["log-head-differs"])


@reaches("format-newer", "outside-note-forked")
def case_made_anew_in_a_later_version_beside_a_kept_note(world):
    given = world.write(world.sound())
    return made_anew(world, dataclasses.replace(given, against=kept(world, max((given.path / "checkpoints").iterdir()).read_bytes())))


@reaches("format-newer", "log-proof-differs")
def case_made_anew_in_a_later_version_beside_a_proof(world):
    given = by_proof(world, with_log(world))
    return made_anew(world, dataclasses.replace(given, log=None))


@reaches("format-newer", "log-knows-more")
def case_of_a_later_version_whose_end_was_cut_off(world):
    def cut(case):
        del case.steps[next(i for i, step in enumerate(case.steps) if isinstance(step, Entry) and step.type == "close"):]
        case.checkpoint()

    def more(log, written):
        log.find("case-closed").fields.update(size=len(written.lines) + 4, root="0" * 64)
    return later_beside_its_log(world, more, cut)


@reaches("format-newer", "log-entry-doubted")
def case_of_a_later_version_whose_log_has_a_line_that_nobody_signed(world):
    def change(log, written):
        log.add("case-checkpoint", 90 * SECOND, case=written.case.id, size=900, root="0" * 64)
        log.signed("access", 91 * SECOND, case="*", what="unlocked", who="sato")
    return dataclasses.replace(later_beside_its_log(world, change), never=NO_FORGERY)


@reaches("format-newer", "log-case-unknown")
def case_of_a_later_version_that_its_log_does_not_know(world):
    def change(log, written):
        del log.steps[2:]
        for _ in range(65):
            log.signed("access", 90 * SECOND, case="*", what="unlocked", who="sato")
    return later_beside_its_log(world, change)


@reaches("format-newer", "log-silent")
def case_of_a_later_version_that_does_not_say_what_its_log_was(world):
    def change(log, written):
        del log.steps[2:]
        for _ in range(65):
            log.signed("access", 90 * SECOND, case="*", what="unlocked", who="sato")
    return dataclasses.replace(later_beside_its_log(world, change, lambda case: case.steps[0].fields.pop("appliance_log")), never=["log-case-unknown"])


@reaches("format-newer", "log-of-another-device")
def case_of_a_later_version_whose_log_a_stranger_carried_on(world):
    def change(log, written):
        for step in log.of(Checkpoint):
            step.signer, step.origin = log.signer, log.origin
        for kind, fields in (("boot", {"boot_id": w.BOOT_ID, "device": str(world.stranger.key)}), ("case-closed", {"case": written.case.id, "size": 900, "root": "0" * 64})):
            log.signed(kind, 91 * SECOND, **fields)
            log.steps[-1].signer, log.steps[-1].origin = world.stranger, f"kiroku/{world.stranger.name}/log"
    return dataclasses.replace(later_beside_its_log(world, change), never=NO_FORGERY)


@reaches("format-newer", "ledger-changed")
def case_of_a_later_version_with_a_changed_line(world):
    given = world.write(of_a_later_version(world.sound()))
    change_byte(given.path / "ledger.jsonl", last_line(given.path) + 40)
    return given


@reaches("format-newer", "ledger-cut")
def case_of_a_later_version_without_its_last_line(world):
    given = world.write(of_a_later_version(world.sound()))
    (given.path / "ledger.jsonl").write_bytes((given.path / "ledger.jsonl").read_bytes()[:last_line(given.path)])
    return given


@reaches("format-newer")
def case_of_a_later_version_with_a_note_of_another_form(world):
    case = of_a_later_version(world.sound())
    case.of(Checkpoint)[-1].change = lambda made: made + b"more\n"
    return dataclasses.replace(world.write(case), never=["checkpoint-malformed", "checkpoint-unknown-key", *NO_FORGERY])


@reaches("format-newer", "folder-of-another-case")
def case_of_a_later_version_in_another_s_place(world):
    written = of_a_later_version(world.sound()).write(world.folder, "20200101T000000Z-00000000")
    return world.given(written.folder)


@reaches("format-newer", "log-of-another-device")
def case_of_a_later_version_where_no_device_is_known(world):
    given = later_beside_its_log(world, made=lambda case: case.steps[0].fields.pop("device"))
    return dataclasses.replace(given, devices=[], never=NO_FORGERY)


@reaches("entry-malformed")
def case_of_a_later_version_that_is_signed_as_something_else(world):
    case = of_a_later_version(world.sound())
    for step in case.of(Checkpoint):
        step.origin = "kiroku/or3/log"
    return dataclasses.replace(world.write(case), never=["format-newer"])


@reaches("entry-malformed", "open-missing")
def case_whose_first_line_holds_nothing_for_a_name(world):
    case = of_a_later_version(world.sound())
    case.steps[0].fields["more"] = None
    return dataclasses.replace(world.write(case), never=["format-newer"])


@reaches("entry-too-long", "open-missing")
def case_of_a_later_version_with_too_long_a_first_line(world):
    case = of_a_later_version(world.sound())
    case.steps[0].fields["more"] = "x" * (1 << 20)
    return dataclasses.replace(world.write(case), never=["format-newer"])


@reaches("format-newer", "outside-note-forked")
def excerpt_of_a_later_version_beside_a_kept_note_of_another_history(world):
    given = excerpt(world, change=lambda document, files: document.update(format="kiroku-excerpt/2"))
    size = max(int(path.stem) for path in (given.path / "checkpoints").iterdir())
    return dataclasses.replace(given, against=kept(world, world.device.checkpoint(f"kiroku/or3/{world.case_id}", size, bytes(32))))


@reaches("format-newer", "log-checkpoint-differs")
def excerpt_of_a_later_version_beside_a_log_of_another_history(world):
    given = with_log(world, lambda log, written: log.find("case-closed").fields.update(root="0" * 64))
    part = excerpt(dataclasses.replace(world, folder=world.folder / "part"), change=lambda document, files: document.update(format="kiroku-excerpt/2"))
    return dataclasses.replace(given, path=part.path)


@reaches("format-newer", "log-opening-differs")
def excerpt_of_a_case_of_a_later_version_beside_a_log_of_another(world):
    given = with_log(world)
    return dataclasses.replace(given, path=excerpt_of_a_case_of_a_later_version(dataclasses.replace(world, folder=world.folder / "part")).path)


@reaches("format-newer", "log-silent")
def excerpt_of_a_later_version_where_no_device_is_known(world):
    given = with_log(world, devices=[])
    part = excerpt(dataclasses.replace(world, folder=world.folder / "part"), change=lambda document, files: document.update(format="kiroku-excerpt/2"))
    return dataclasses.replace(given, path=part.path, never=NO_FORGERY[:-2])


@reaches("format-newer")
def excerpt_of_a_later_version(world):
    def change(document, files):
        document["format"] = "kiroku-excerpt/2"
    return excerpt(world, change=change)


@reaches("entry-malformed")
def excerpt_changed_into_one_of_a_later_version(world):
    given = excerpt(world)
    path = given.path / "ledger-open.jsonl"
    path.write_bytes(path.read_bytes().replace(b"kiroku-case/1", b"kiroku-case/3", 1))
    return dataclasses.replace(given, never=["format-newer"])


@reaches("format-newer")
def excerpt_of_a_case_of_a_later_version(world):
    case = world.sound()
    case.steps[0].fields["format"] = "kiroku-case/2"
    written = case.write(world.folder / "whole")
    tokens = [i for i, line in enumerate(written.lines) if b'"type":"token"' in line]
    return world.given(w.write_excerpt(written, world.folder / "excerpt", 6 * SECOND, 9 * SECOND, ["endoscope"], tokens[0], len(written.lines)))


@reaches("authority-file-malformed")
def authority_of_nonsense(world):
    case = world.sound()
    case.files["authorities/outside.pem"] = b"nonsense\n"
    return world.write(case)


@reaches("authority-not-named")
def unknown_authority_file(world):
    case = world.sound()
    case.files["authorities/second.pem"] = world.second.chain.encode()
    return world.write(case)


@reaches("part-file", "segment-not-entered", "token-not-entered", "not-closed")
def being_recorded(world):
    case = world.begin()
    world.record(case, 0, 2)
    case.checkpoint()
    case.token(world.outside, 10_100 * MS, gen_ns=10_090 * MS, entered=False)
    case.files["segments/endoscope/00000002.ts.age"] = b"x"
    case.files["segments/endoscope/00000003.ts.age"] = b"x"
    case.files["segments/endoscope/00000004.ts.age.part"] = b"x"
    case.files["segments/vitals/00000002.jsonl.age.part"] = b"x"
    return world.write(case)


@reaches("segment-not-entered", "gap")
def flush_failed(world):
    case = world.begin()
    world.record(case, 0, 4, ("vitals",))
    world.record(case, 0, 3, ("endoscope",))
    for i in range(3):
        case.find("segment", 4 + i).mono_ns = 20_021 * MS
    case.add("gap", 20_030 * MS, stream="endoscope", start_ns=15 * SECOND, end_ns=20 * SECOND, cause="disk-full")
    case.files["segments/endoscope/00000003.ts.age"] = b"x"
    return world.write(world.end(case, 20_040 * MS))


@reaches("token-not-entered")
def token_came_later(world):
    case = world.sound()
    case.token(world.second, 20_040 * MS, gen_ns=3600 * SECOND, entered=False)
    return world.write(case)


# The appliance log


def with_log(world, change=lambda log, written: None, case=None, head=None, device=None, **more):
    """An archive: the log, and a case that it knows. `change` may alter the log's steps before it is written."""
    log = w.Log(device or world.device, world.utc_ns - 60 * SECOND)
    log.checkpoint()
    empty = log.write(world.folder / "before", "log")
    made = case or world.sound(log_state=head or (1, empty.root().hex()))
    written = made.write(world.folder)
    final = json.loads([line for line in written.lines if b'"token"' in line][-1]) if any(b'"type":"token"' in line for line in written.lines) else None
    log.signed("case-opened", 60 * SECOND, case=made.id, sha256=hashlib.sha256(written.lines[0]).hexdigest())
    log.signed("case-checkpoint", 61 * SECOND, case=made.id, size=3, root=written.root(3).hex())
    log.signed("case-closed", 81 * SECOND, case=made.id, size=len(written.lines), root=written.root().hex(), **({"final_token": final["sha256"]} if final else {}))
    change(log, written)
    log.write(world.folder, "log")
    return world.given(written.folder, log=world.folder / "log", **more)


def the_log(world, change=lambda log, written: None, **more):
    """The log of such an archive, to be judged itself."""
    given = with_log(world, change, **more)
    return dataclasses.replace(given, path=given.log, log=None, as_log=True)


@reaches()
def known_to_the_log(world):
    return with_log(world)


@reaches()
def log_with_its_cases(world):
    return the_log(world)


@reaches("log-case-unknown")
def unknown_to_the_log(world):
    return log_without_the_case(world, 65)


@reaches("log-silent")
def log_copied_while_the_case_was_being_opened(world):
    """Other rooms enter something between the state that `open` has and the line of the case."""
    return dataclasses.replace(log_without_the_case(world, 64), never=OF_A_LOG_THAT_ACCUSES)


def log_without_the_case(world, more):
    """It goes on by that many entries behind the state that `open` has."""
    def change(log, written):
        del log.steps[2:]
        for _ in range(more):
            log.signed("access", 90 * SECOND, case="*", what="unlocked", who="sato")
    return with_log(world, change)


OF_A_LOG_THAT_ACCUSES = ["log-case-unknown", "log-head-differs", "file-unnamed", "entry-malformed", "ledger-changed", "ledger-cut", "checkpoint-malformed",
                         "checkpoint-signature-invalid", "outside-note-rolled-back"]


def with_faulty_log(world, harm, change=None, judge=with_log, **more):
    """A sound case that the log knows to its end, beside a copy of the log in which something else is wrong."""
    def used(log, written):
        log.signed("access", 90 * SECOND, case="*", what="unlocked", who="sato")
        log.signed("access", 91 * SECOND, case="*", what="unlocked", who="sato")
    given = judge(world, change or used, **more)
    harm(given.log or given.path)
    return dataclasses.replace(given, never=[] if given.as_log else OF_A_LOG_THAT_ACCUSES)


def change_byte(path, at):
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(bytes(data))


def last_line(log):
    return (log / "ledger.jsonl").read_bytes()[:-1].rfind(b"\n") + 1


@reaches("log-silent")
def log_from_before_the_case(world):
    def change(log, written):
        del log.steps[2:]
    return with_faulty_log(world, lambda log: None, change)


@reaches("log-silent")
def log_shorter_than_open_states(world):
    return with_faulty_log(world, lambda log: None, lambda log, written: log.steps.__delitem__(slice(2, None)), head=(9, "0" * 64))


def unsigned_log(world, *lines):
    """Anybody writes a log in the device's name."""
    made = world.sound()
    written = made.write(world.folder)
    log = w.Log(world.device, world.utc_ns - 60 * SECOND)
    for kind, fields in lines:
        log.add(kind, 60 * SECOND, **fields)
    log.write(world.folder, "log")
    return dataclasses.replace(world.given(written.folder, log=world.folder / "log"), never=OF_A_LOG_THAT_ACCUSES)


@reaches("log-silent")
def log_that_nobody_signed(world):
    return unsigned_log(world)


@reaches("log-silent", "log-tail-unsigned")
def longer_log_that_nobody_signed(world):
    return unsigned_log(world, *[("access", {"case": "*", "what": "unlocked", "who": "sato"})] * 3)


@reaches("log-silent", "log-tail-unsigned")
def excerpt_beside_a_log_that_nobody_signed(world):
    given = unsigned_log(world, *[("access", {"case": "*", "what": "unlocked", "who": "sato"})] * 3)
    part = excerpt(dataclasses.replace(world, folder=world.folder / "part"))
    return dataclasses.replace(given, path=part.path)


@reaches("log-silent")
def log_of_the_device_that_a_stranger_signed_on(world):
    """What the device signed of it ends before the case; whoever carried it on is not trusted."""
    def change(log, written):
        del log.steps[2:]
        for step in log.of(Checkpoint):
            step.signer = world.device
        log.signer = world.stranger
        log.signed("device-key-changed", 70 * SECOND, device=str(world.stranger.key))
        log.signed("access", 90 * SECOND, case="*", what="unlocked", who="sato")
    return with_faulty_log(world, lambda log: None, change)


@reaches("log-not-sound")
def log_with_a_changed_line_about_something_else(world):
    return with_faulty_log(world, lambda log: change_byte(log / "ledger.jsonl", last_line(log) + 40))


@reaches("ledger-changed")
def log_itself_with_a_changed_line(world):
    return with_faulty_log(world, lambda log: change_byte(log / "ledger.jsonl", last_line(log) + 40), judge=the_log)


@reaches("log-not-sound", "log-silent")
def log_whose_line_of_the_opening_is_broken(world):
    def harm(log):
        change_byte(log / "ledger.jsonl", (log / "ledger.jsonl").read_bytes().index(b"case-opened"))
    return with_faulty_log(world, harm)


@reaches("log-not-sound", "log-silent")
def log_whose_first_line_is_broken(world):
    """No other line names the device."""
    given = with_faulty_log(world, lambda log: change_byte(log / "ledger.jsonl", (log / "ledger.jsonl").read_bytes().index(b"boot_id")))
    return dataclasses.replace(given, never=[*given.never, "log-of-another-device"])


@reaches("log-not-sound")
def log_with_an_entry_of_a_newer_type(world):
    return with_faulty_log(world, lambda log: None, lambda log, written: log.signed("quota-stated", 90 * SECOND, case="*", n=1))


@reaches("log-not-sound")
def log_copied_before_its_newest_checkpoint(world):
    return with_faulty_log(world, lambda log: (log / "ledger.jsonl").write_bytes((log / "ledger.jsonl").read_bytes()[:last_line(log)]))


@reaches("log-not-sound")
def log_whose_last_line_is_zeros(world):
    def harm(log):
        data, at = (log / "ledger.jsonl").read_bytes(), last_line(log)
        (log / "ledger.jsonl").write_bytes(data[:at] + bytes(len(data) - at))
    return with_faulty_log(world, harm)


@reaches("log-not-sound")
def log_older_than_a_kept_note(world):
    kept_elsewhere = []

    def harm(log):
        newest = max((log / "checkpoints").iterdir())
        kept_elsewhere.extend(kept(world, newest.read_bytes()))
        newest.unlink()
        (log / "ledger.jsonl").write_bytes((log / "ledger.jsonl").read_bytes()[:last_line(log)])
    given = with_faulty_log(world, harm)
    return dataclasses.replace(given, against=kept_elsewhere)


@reaches("log-not-sound")
def excerpt_beside_a_log_with_a_changed_line(world):
    cases = []

    def change(log, written):
        cases.append(written)
        log.signed("access", 90 * SECOND, case="*", what="unlocked", who="sato")
    given = with_faulty_log(world, lambda log: change_byte(log / "ledger.jsonl", last_line(log) + 40), change)
    tokens = [i for i, line in enumerate(cases[0].lines) if b'"type":"token"' in line]
    part = w.write_excerpt(cases[0], world.folder / "part", 6 * SECOND, 9 * SECOND, ["endoscope"], tokens[0], len(cases[0].lines))
    return dataclasses.replace(given, path=part)


@reaches("log-not-tidy")
def log_with_a_checkpoint_that_does_not_hold(world):
    return with_faulty_log(world, lambda log: change_byte(max((log / "checkpoints").iterdir()), -10))


@reaches("log-not-tidy")
def log_with_a_file_that_nothing_names(world):
    return with_faulty_log(world, lambda log: (log / "notes.txt").write_bytes(b"x"))


@reaches("file-of-a-system")
def log_that_somebody_looked_at(world):
    return with_faulty_log(world, lambda log: (log / ".DS_Store").write_bytes(b"Bud1"))


@reaches("file-of-a-system")
def log_itself_that_somebody_looked_at(world):
    return with_faulty_log(world, lambda log: (log / "checkpoints/Thumbs.db").write_bytes(b"x"), judge=the_log)


@reaches("log-case-not-entered", "not-closed")
def being_begun(world):
    case = world.begin(stamped=False)
    del case.steps[1:]
    log = w.Log(world.device, world.utc_ns - 60 * SECOND)
    log.checkpoint()
    case.steps[0].fields["appliance_log"] = {"size": 1, "root": log.write(world.folder, "log").root().hex()}
    return world.given(case.write(world.folder).folder, log=world.folder / "log")


@reaches("log-opening-differs")
def another_opening(world):
    def change(log, written):
        log.find("case-opened").fields["sha256"] = "0" * 64
    return with_log(world, change)


@reaches("log-checkpoint-differs")
def another_root(world):
    def change(log, written):
        log.find("case-checkpoint").fields["root"] = "0" * 64
    return with_log(world, change)


@reaches("log-knows-more")
def log_knows_more(world):
    def change(log, written):
        log.find("case-closed").fields["size"] += 2
    return with_log(world, change)


@reaches("log-end-differs")
def another_final_token(world):
    def change(log, written):
        log.find("case-closed").fields["final_token"] = "0" * 64
    return with_log(world, change)


@reaches("log-entry-doubted")
def unsigned_accusation(world):
    def change(log, written):
        entry = log.find("case-checkpoint")
        entry.fields["root"] = "0" * 64
        del log.steps[log.steps.index(entry) + 1]
    return with_log(world, change)


@reaches("log-case-erased")
def copy_of_an_erased_case(world):
    return with_log(world, lambda log, written: log.signed("erased", 90 * SECOND, case=written.case.id, policy="after ten years"))


@reaches("log-case-erased")
def erased_case_in_its_archive(world):
    return the_log(world, lambda log, written: log.signed("erased", 90 * SECOND, case=written.case.id, policy="after ten years"))


def held_and_erased(log, written, between=lambda log, case: None):
    case = written.case.id
    log.signed("case-held", 90 * SECOND, case=case, reason="court order", who="anna")
    between(log, case)
    log.signed("erased", 93 * SECOND, case=case, stream="vitals", policy="30 days")


def release(hold, sign=True, of=None):
    """Between a hold and an erasure: a release that names `hold` entries before it."""
    def add(log, case):
        lines = sum(isinstance(step, w.Entry) for step in log.steps)
        (log.signed if sign else log.add)("case-released", 91 * SECOND, case=of or case, hold=lines - hold, reason="settled", who="ben")
    return add


@reaches("erased-while-held")
def erased_while_held(world):
    return the_log(world, held_and_erased)


@reaches("erased-while-held")
def case_whose_stream_was_erased_while_held(world):
    return with_log(world, held_and_erased)


@reaches()
def erased_after_the_release(world):
    return the_log(world, lambda log, written: held_and_erased(log, written, release(1)))


@reaches("erased-while-held")
def released_of_another_entry(world):
    return the_log(world, lambda log, written: held_and_erased(log, written, release(2)))


@reaches("erased-while-held")
def released_by_another_case(world):
    return the_log(world, lambda log, written: held_and_erased(log, written, release(1, of="20200101T000000Z-00000000")))


@reaches("erased-while-held")
def released_by_nobody_who_signed(world):
    return the_log(world, lambda log, written: held_and_erased(log, written, release(1, sign=False)))


@reaches()
def held_by_nobody_who_signed(world):
    def change(log, written):
        held_and_erased(log, written)
        del log.steps[-3]
    return the_log(world, change)


@reaches("erased-while-held")
def one_of_two_holds_released(world):
    def between(log, case):
        log.signed("case-held", 90 * SECOND, case=case, reason="second", who="ben")
        release(1)(log, case)
    return the_log(world, lambda log, written: held_and_erased(log, written, between))


@reaches()
def another_case_held(world):
    def change(log, written):
        log.signed("case-held", 90 * SECOND, case="20200101T000000Z-00000000", reason="court order", who="anna")
        log.signed("erased", 93 * SECOND, case=written.case.id, stream="vitals", policy="30 days")
    return with_log(world, change)


def consented(world, log, written, kind="consent-given", at=90, of=None, purposes=("teaching",), sign=True, form=None, keep=True):
    """An entry of a consent with its sealed statement, which lies beside the log."""
    case = of or written.case.id
    sealed = world.seal(f"{kind} {case} {purposes}", json.dumps({"case": case, "kind": kind[8:], "purposes": list(purposes), "person": "Hana Mori, patient", "since": "2026-08-01"}).encode())
    digest = hashlib.sha256(sealed).hexdigest()
    if keep:
        world.beside[f"log/consents/{digest}.age"] = sealed
    (log.signed if sign else log.add)(kind, at * SECOND, case=case, purposes=list(purposes), statement=digest, who="anna")
    return digest


def with_consents(world, change, judge=None):
    """A log with consents, alone or beside its case; their files are written once the log's folder is there."""
    world.beside = {}
    given = (judge or the_log)(world, lambda log, written: change(log, written))
    folder = (given.log or given.path).parent
    for name, data in world.beside.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    return given


def used(log, written, at, purpose="teaching", sign=True):
    (log.signed if sign else log.add)("access", at * SECOND, case=written.case.id, what="exported endoscope", who="anna", purpose=purpose)


@reaches()
def consent_given_used_and_withdrawn(world):
    def change(log, written):
        consented(world, log, written)
        used(log, written, 91)
        consented(world, log, written, "consent-withdrawn", 92)
        consented(world, log, written, at=93)
    return with_consents(world, change)


@reaches()
def consent_of_the_case_beside_its_log(world):
    return with_consents(world, lambda log, written: consented(world, log, written), with_log)


@reaches("access-without-consent")
def used_after_the_withdrawal(world):
    def change(log, written):
        consented(world, log, written)
        consented(world, log, written, "consent-withdrawn", 91)
        used(log, written, 92)
    return with_consents(world, change)


@reaches("access-without-consent")
def used_for_another_purpose(world):
    def change(log, written):
        consented(world, log, written)
        used(log, written, 91, "publication")
    return with_consents(world, change)


@reaches("access-without-consent", "consent-case-unknown")
def used_by_the_consent_of_another_case(world):
    def change(log, written):
        consented(world, log, written, of="20200101T000000Z-00000000")
        used(log, written, 91)
    return with_consents(world, change)


@reaches("access-without-consent", "consent-doubted")
def used_by_a_consent_that_nobody_signed(world):
    def change(log, written):
        consented(world, log, written, sign=False)
        used(log, written, 91)
    return with_consents(world, change)


@reaches("access-without-consent", "consent-doubted")
def used_after_a_withdrawal_that_nobody_signed(world):
    def change(log, written):
        consented(world, log, written)
        consented(world, log, written, "consent-withdrawn", 91, sign=False)
        used(log, written, 92)
    return with_consents(world, change)


@reaches("consent-given-twice")
def consent_given_twice(world):
    def change(log, written):
        consented(world, log, written)
        consented(world, log, written, at=91, purposes=("research", "teaching"))
    return with_consents(world, change)


@reaches("consent-not-given")
def consent_withdrawn_that_was_never_given(world):
    return with_consents(world, lambda log, written: consented(world, log, written, "consent-withdrawn"))


@reaches("consent-not-given")
def consent_withdrawn_twice_beside_its_case(world):
    def change(log, written):
        consented(world, log, written)
        consented(world, log, written, "consent-withdrawn", 91)
        consented(world, log, written, "consent-withdrawn", 92)
    return with_consents(world, change, with_log)


@reaches("consent-doubted")
def withdrawal_that_nobody_signed_entered_again(world):
    def change(log, written):
        consented(world, log, written)
        consented(world, log, written, "consent-withdrawn", 91, sign=False)
        consented(world, log, written, "consent-withdrawn", 92)
    return dataclasses.replace(with_consents(world, change), never=["consent-not-given"])


@reaches("consent-doubted", "consent-not-given")
def withdrawal_that_nobody_signed_entered_again_twice(world):
    def change(log, written):
        consented(world, log, written)
        consented(world, log, written, "consent-withdrawn", 91, sign=False)
        consented(world, log, written, "consent-withdrawn", 92)
        consented(world, log, written, "consent-withdrawn", 93)
    return with_consents(world, change)


@reaches("consent-case-unknown")
def consent_of_an_unknown_case(world):
    return with_consents(world, lambda log, written: consented(world, log, written, of="20200101T000000Z-00000000"))


@reaches()
def consent_of_an_unknown_case_says_nothing_of_this_one(world):
    return with_consents(world, lambda log, written: consented(world, log, written, of="20200101T000000Z-00000000", keep=False), with_log)


@reaches("consent-file-missing")
def statement_of_a_consent_removed(world):
    return with_consents(world, lambda log, written: consented(world, log, written, keep=False))


@reaches("file-hash-differs")
def statement_of_a_consent_altered(world):
    def change(log, written):
        digest = consented(world, log, written)
        world.beside[f"log/consents/{digest}.age"] += b"x"
    return with_consents(world, change)


def consented_by(world, data, judge=None):
    """A statement of consent whose file holds that."""
    def change(log, written):
        digest = hashlib.sha256(data).hexdigest()
        world.beside[f"log/consents/{digest}.age"] = data
        log.signed("consent-given", 90 * SECOND, case=written.case.id, purposes=["teaching"], statement=digest, who="anna")
    return with_consents(world, change, judge)


@reaches("consent-not-sealed")
def statement_of_a_consent_in_the_clear(world):
    return consented_by(world, b'{"person":"Hana Mori, patient"}')


@reaches("consent-not-sealed")
def case_beside_a_statement_of_a_consent_in_the_clear(world):
    return consented_by(world, b'{"person":"Hana Mori, patient"}', with_log)


@reaches("consent-not-sealed")
def empty_statement_of_a_consent(world):
    return consented_by(world, b"")


@reaches("consent-not-entered")
def consent_whose_entry_was_removed(world):
    def change(log, written):
        world.beside["log/consents/" + "a" * 64 + ".age"] = world.seal("lost", b"{}")
    return with_consents(world, change)


@reaches()
def consent_whose_entry_was_removed_says_nothing_of_this_case(world):
    def change(log, written):
        world.beside["log/consents/" + "a" * 64 + ".age"] = world.seal("lost", b"{}")
    return with_consents(world, change, with_log)


@reaches("file-unnamed")
def another_name_among_the_consents(world):
    def change(log, written):
        world.beside["log/consents/note.txt"] = b"teaching is fine"
    return with_consents(world, change)


@reaches("entry-malformed")
def consent_to_a_purpose_that_reads_backwards(world):
    return with_consents(world, lambda log, written: consented(world, log, written, purposes=("teach\u202eing",), keep=False))


@reaches("case-missing")
def two_cases_of_one_identifier(world):
    return the_log(world, lambda log, written: log.signed("case-opened", 90 * SECOND, case=written.case.id, sha256="0" * 64))


@reaches("log-of-another-device")
def known_to_the_log_of_another_device(world):
    return with_log(world, device=world.stranger, devices=[world.device.key, world.stranger.key])


@reaches("log-of-another-device")
def unknown_to_the_log_of_another_device(world):
    def change(log, written):
        del log.steps[2:]
    return with_log(world, change, head=(9, "0" * 64), device=world.stranger, devices=[world.device.key, world.stranger.key])


@reaches("log-of-another-device")
def accused_by_the_log_of_another_device(world):
    def change(log, written):
        log.signed("case-checkpoint", 82 * SECOND, case=written.case.id, size=2, root="0" * 64)
    return with_log(world, change, head=(9, "0" * 64), device=world.stranger, devices=[world.device.key, world.stranger.key])


def carried_on_by(world, signer, entries, name_it="device-key-changed", back=False, judge=None, trusted=False):
    """The device's log, which knows its case to the end, carried on under another key by whoever has a copy of it.

    `entries` gives kinds and fields of what it says then, each with its own checkpoint; `back`: then the device's own start follows, signed by it.
    """
    def change(log, written):
        for step in log.of(Checkpoint):
            step.signer, step.origin = log.signer, log.origin

        def add(by, kind, **fields):
            log.signed(kind, 91 * SECOND, **fields)
            log.steps[-1].signer, log.steps[-1].origin = by, f"kiroku/{by.name}/log"
        add(signer, name_it, device=str(signer.key), **({"boot_id": w.BOOT_ID} if name_it == "boot" else {}))
        for kind, fields in entries(written):
            add(signer, kind, **({"case": written.case.id} | fields))
        if back:
            add(world.device, "boot", boot_id=w.BOOT_ID, device=str(world.device.key))
            add(world.device, "access", case="*", what="unlocked", who="sato")
    given = (judge or with_log)(world, change)
    return dataclasses.replace(given, devices=[*given.devices, *([signer.key] if trusted else [])])


def accused(world, *entries, **more):
    given = carried_on_by(world, entries=lambda written: entries, **{"signer": world.stranger, **more})
    return dataclasses.replace(given, never=["log-checkpoint-differs", "log-knows-more", "log-end-differs", "log-case-unknown", "log-head-differs", "log-opening-differs", "log-case-erased",
                                             "erased-while-held", "case-missing", "device-not-trusted" if given.log else "log-not-tidy"])


@reaches("log-of-another-device")
def case_whose_log_a_stranger_carried_on_with_another_root(world):
    return accused(world, ("case-checkpoint", {"size": 3, "root": "0" * 64}))


@reaches("log-of-another-device")
def case_whose_log_a_stranger_carried_on_with_more_entries(world):
    return accused(world, ("case-checkpoint", {"size": 900, "root": "0" * 64}))


@reaches("log-of-another-device")
def case_whose_log_a_stranger_carried_on_with_another_end(world):
    return accused(world, ("case-closed", {"size": 900, "root": "0" * 64}))


@reaches("log-of-another-device")
def case_whose_log_names_a_stranger_for_two_lines(world):
    """Its recorder goes on behind them, and signs over them."""
    return accused(world, ("case-closed", {"size": 900, "root": "0" * 64}), name_it="boot", back=True)


@reaches("log-of-another-device")
def case_whose_log_another_trusted_device_carried_on(world):
    return accused(world, ("case-closed", {"size": 900, "root": "0" * 64}), signer=ANOTHER_DEVICE, trusted=True)


@reaches("log-of-another-device")
def case_that_a_stranger_opens_once_more_in_its_log(world):
    return accused(world, ("case-opened", {"sha256": "0" * 64}))


@reaches("log-of-another-device")
def case_that_a_stranger_says_was_erased(world):
    return accused(world, ("erased", {"policy": "after ten years"}))


@reaches("log-of-another-device")
def case_that_a_stranger_says_was_erased_while_held(world):
    return accused(world, ("case-held", {"reason": "court", "who": "judge"}), ("erased", {"stream": "endoscope", "policy": "after ten years"}))


@reaches()
def case_that_a_stranger_says_is_held(world):
    return accused(world, ("case-held", {"reason": "court", "who": "judge"}))


@reaches("erased-while-held")
def case_whose_hold_a_stranger_released(world):
    def change(log, written):
        for step in log.of(Checkpoint):
            step.signer, step.origin = log.signer, log.origin
        held = sum(isinstance(step, Entry) for step in log.steps)
        log.signed("case-held", 90 * SECOND, case=written.case.id, reason="court", who="sato")
        for by, kind, fields in ((world.stranger, "boot", {"boot_id": w.BOOT_ID, "device": str(world.stranger.key)}),
                                 (world.stranger, "case-released", {"case": written.case.id, "hold": held, "reason": "none", "who": "nobody"}),
                                 (world.device, "boot", {"boot_id": w.BOOT_ID, "device": str(world.device.key)}),
                                 (world.device, "erased", {"case": written.case.id, "stream": "endoscope", "policy": "after ten years"})):
            log.signed(kind, 91 * SECOND, **fields)
            log.steps[-1].signer, log.steps[-1].origin = by, f"kiroku/{by.name}/log"
        log.of(Checkpoint)[-5].signer, log.of(Checkpoint)[-5].origin = world.device, log.origin
    return with_log(world, change)


@reaches()
def case_of_whose_use_a_stranger_tells(world):
    given = accused(world, ("access", {"what": "exported", "who": "sato", "purpose": "teaching"}), ("consent-given", {"purposes": ["teaching"], "statement": "a" * 64, "who": "sato"}))
    return dataclasses.replace(given, never=[*given.never, "access-without-consent", "consent-file-missing", "consent-doubted"])


@reaches("access-without-consent")
def case_whose_consent_a_stranger_states(world):
    def change(log, written):
        for by, kind, fields in ((world.stranger, "boot", {"boot_id": w.BOOT_ID, "device": str(world.stranger.key)}),
                                 (world.stranger, "consent-given", {"case": written.case.id, "purposes": ["teaching"], "statement": "a" * 64, "who": "sato"}),
                                 (world.device, "boot", {"boot_id": w.BOOT_ID, "device": str(world.device.key)}),
                                 (world.device, "access", {"case": written.case.id, "what": "exported", "who": "sato", "purpose": "teaching"})):
            log.signed(kind, 91 * SECOND, **fields)
            log.steps[-1].signer, log.steps[-1].origin = by, f"kiroku/{by.name}/log"
    return with_log(world, change)


@reaches("device-not-trusted")
def log_in_which_a_stranger_states_a_consent(world):
    """Its file is named by an entry of the log, whoever wrote that."""
    given = accused(world, ("consent-given", {"purposes": ["teaching"], "statement": "a" * 64, "who": "sato"}), judge=the_log)
    (given.path / "consents").mkdir()
    (given.path / "consents" / ("a" * 64 + ".age")).write_bytes(world.seal("stated", b"{}"))
    return dataclasses.replace(given, never=[*given.never, "consent-not-entered", "file-hash-differs"])


def nobody_opened(world, signer, trusted):
    """In the device's name nothing is signed; another key vouches for the case's end."""
    made = world.sound(log_state=(0, hashlib.sha256(b"").hexdigest()))
    written = made.write(world.folder)
    final = json.loads([line for line in written.lines if b'"type":"token"' in line][-1])["sha256"]
    log = w.Log(world.device, world.utc_ns - 60 * SECOND)
    log.add("case-opened", 60 * SECOND, case=made.id, sha256=hashlib.sha256(written.lines[0]).hexdigest())
    log.signer = signer
    log.signed("device-key-changed", 61 * SECOND, device=str(signer.key))
    log.signed("case-closed", 81 * SECOND, case=made.id, size=len(written.lines), root=written.root().hex(), final_token=final)
    for step in log.of(Checkpoint):
        step.origin = f"kiroku/{signer.name}/log"
    log.write(world.folder, "log")
    return world.given(written.folder, log=world.folder / "log", devices=[world.device.key, *([signer.key] if trusted else [])])


@reaches("log-of-another-device", "log-case-open")
def case_for_whose_end_another_trusted_device_vouches(world):
    return nobody_opened(world, ANOTHER_DEVICE, True)


def with_log_carried_on_by_its_namesake(world, entries, judge=None, **more):
    given = carried_on_by(world, NAMESAKE, entries, judge=judge, trusted=True, **more)
    never = ["log-checkpoint-differs", "log-knows-more", "log-end-differs", "log-opening-differs", "log-case-erased", "erased-while-held", "device-not-trusted"]
    return dataclasses.replace(given, never=never)


@reaches("log-of-another-device", "log-case-open")
def case_whose_end_another_key_of_its_name_entered(world):
    """Nothing shows that the key is its device's: the newer key alone signs that it is, and whoever has a copy of the log can carry it on so."""
    def change(log, written):
        end = log.steps[-2:]
        del log.steps[-2:]
        for step in log.of(Checkpoint):
            step.signer = log.signer
        log.signed("device-key-changed", 80 * SECOND, device=str(NAMESAKE.key))
        log.steps += end
        for step in log.of(Checkpoint)[-2:]:
            step.signer = NAMESAKE
    given = with_log(world, change)
    return dataclasses.replace(given, devices=[*given.devices, NAMESAKE.key])


@reaches("log-of-another-device")
def case_whose_other_end_another_key_of_its_name_entered(world):
    return with_log_carried_on_by_its_namesake(world, lambda written: [("case-closed", {"size": len(written.lines), "root": written.root().hex(), "final_token": "0" * 64})])


@reaches("log-of-another-device")
def case_of_which_another_key_of_its_name_states_another_root(world):
    return with_log_carried_on_by_its_namesake(world, lambda written: [("case-checkpoint", {"size": 3, "root": "0" * 64}), ("case-closed", {"size": 900, "root": "0" * 64})], name_it="boot", back=True)


def log_with_another_case(world, *entries, **more):
    """The log itself; its case was taken away, and another one lies there."""
    given = carried_on_by(world, entries=lambda written: entries, judge=the_log, **{"signer": world.stranger, **more})
    (world.folder / world.case_id).rename(world.folder / "20200101T000000Z-00000000")
    return given


@reaches("case-missing", "log-of-another-device", "device-not-trusted")
def case_that_was_taken_away_and_a_stranger_says_erased(world):
    return log_with_another_case(world, ("erased", {"policy": "after ten years"}))


@reaches("case-missing", "log-of-another-device")
def case_that_was_taken_away_and_another_trusted_device_says_erased(world):
    return log_with_another_case(world, ("erased", {"policy": "after ten years"}), signer=ANOTHER_DEVICE, trusted=True)


@reaches("case-missing", "log-of-another-device")
def case_that_another_key_of_its_name_says_was_erased(world):
    return log_with_another_case(world, ("erased", {"policy": "after ten years"}), signer=NAMESAKE, trusted=True)


@reaches("log-of-another-device", "device-not-trusted")
def case_that_a_stranger_says_was_opened_and_is_not_there(world):
    given = accused(world, ("case-opened", {"case": "20200101T000000Z-00000000", "sha256": "0" * 64}), judge=the_log)
    return given


@reaches("case-missing")
def case_of_another_trusted_device_that_is_not_there(world):
    return carried_on_by(world, ANOTHER_DEVICE, lambda written: [("case-opened", {"case": "20200101T000000Z-00000000", "sha256": "0" * 64})], judge=the_log, trusted=True)


@reaches("log-case-unknown", "log-of-another-device")
def case_that_a_stranger_enters_in_the_log_that_lacks_it(world):
    """The device's log goes on without the case; what others write there excuses it not."""
    def change(log, written):
        line = log.find("case-opened").fields
        del log.steps[2:]
        for _ in range(65):
            log.signed("access", 90 * SECOND, case="*", what="unlocked", who="sato")
        for step in log.of(Checkpoint):
            step.signer, step.origin = log.signer, log.origin
        for kind, fields in (("boot", {"boot_id": w.BOOT_ID, "device": str(world.stranger.key)}), ("case-opened", line)):
            log.signed(kind, 91 * SECOND, **fields)
            log.steps[-1].signer, log.steps[-1].origin = world.stranger, f"kiroku/{world.stranger.name}/log"
    return with_log(world, change)


@reaches("log-opening-differs", "device-not-trusted")
def case_of_a_strangers_key_that_the_stranger_entered_behind_the_one_in_whose_place_it_is(world):
    def change(log, written):
        for step in log.of(Checkpoint):
            step.signer, step.origin = log.signer, log.origin
        for kind, fields in (("boot", {"boot_id": w.BOOT_ID, "device": str(world.stranger.key)}),
                             ("case-opened", {"case": written.case.id, "sha256": hashlib.sha256(written.lines[0]).hexdigest()})):
            log.signed(kind, 91 * SECOND, **fields)
            log.steps[-1].signer, log.steps[-1].origin = world.stranger, f"kiroku/{world.stranger.name}/log"
    return put_in_its_place(world, change)


@reaches("log-of-another-device")
def excerpt_beside_the_log_that_a_stranger_carried_on(world):
    cases = []

    def entries(written):
        cases.append(written)
        return [("case-checkpoint", {"size": len(written.lines), "root": "0" * 64})]
    given = carried_on_by(world, world.stranger, entries)
    first = next(i for i, line in enumerate(cases[0].lines) if b'"type":"token"' in line)
    part = w.write_excerpt(cases[0], world.folder / "part", 6 * SECOND, 9 * SECOND, ["endoscope"], first, len(cases[0].lines))
    return dataclasses.replace(given, path=part, never=["log-checkpoint-differs", "device-not-trusted"])


@reaches("outside-note-of-other-origin")
def note_of_another_device_that_makes_no_entry_the_device_s_own(world):
    """Whoever has another trusted device's key signs the unsigned opening of a case that never was."""
    def change(log, written):
        log.add("case-opened", 90 * SECOND, case="20200101T000000Z-00000000", sha256="0" * 64)
    given = the_log(world, change)
    lines = (given.path / "ledger.jsonl").read_bytes().split(b"\n")[:-1]
    against = kept(world, ANOTHER_DEVICE.checkpoint("kiroku/or4/log", len(lines), merkle.root([merkle.leaf(line) for line in lines])))
    return dataclasses.replace(given, devices=[*given.devices, ANOTHER_DEVICE.key], against=against, never=["case-missing"])


def put_in_its_place(world, change=lambda log, written: None, **more):
    """A case of a stranger's key, by the identifier of one that the device's log knows."""
    strangers = dataclasses.replace(world, device=world.stranger, folder=world.folder / "forged").sound()

    def other(log, written):
        log.find("case-opened").fields["sha256"] = "0" * 64
        change(log, written)
    return with_log(world, other, strangers, device=world.device, **more)


@reaches("log-opening-differs", "device-not-trusted")
def case_of_a_strangers_key_in_the_place_of_one_that_the_log_knows(world):
    return put_in_its_place(world)


@reaches("log-opening-differs", "device-not-trusted")
def excerpt_of_a_strangers_key_of_a_case_that_the_log_knows(world):
    part = excerpt(dataclasses.replace(world, device=world.stranger, folder=world.folder / "part"))
    return dataclasses.replace(put_in_its_place(world), path=part.path)


@reaches("log-of-another-device")
def case_in_anothers_place_where_both_devices_are_trusted(world):
    return dataclasses.replace(put_in_its_place(world, devices=[world.device.key, world.stranger.key]), never=["log-opening-differs"])


@reaches("log-of-another-device", "no-trusted-device")
def case_in_anothers_place_where_no_device_is_known(world):
    return dataclasses.replace(put_in_its_place(world, devices=[]), never=["log-opening-differs"])


@reaches("log-of-another-device")
def case_in_anothers_place_whose_opening_nobody_signed(world):
    def change(log, written):
        del log.steps[log.steps.index(log.find("case-opened")) + 1]
    return dataclasses.replace(put_in_its_place(world, change), never=["log-opening-differs"])


@reaches("log-of-another-device", "device-not-trusted")
def case_of_a_strangers_key_that_the_log_knows_by_its_own_line(world):
    strangers = dataclasses.replace(world, device=world.stranger).sound()
    return dataclasses.replace(with_log(world, case=strangers, device=world.device), never=["log-opening-differs"])


@reaches("log-head-differs")
def opened_over_another_log(world):
    return with_log(world, head=(1, "0" * 64))


@reaches("case-missing")
def case_removed(world):
    given = the_log(world)
    (world.folder / world.case_id).rename(world.folder / "20200101T000000Z-00000000")
    return given


@reaches("log-entry-doubted")
def unsigned_case(world):
    def change(log, written):
        log.steps += [Entry("case-opened", 90 * SECOND, {"case": "20200101T000000Z-00000000", "sha256": "0" * 64})]
        log.signed("access", 91 * SECOND, case="*", what="unlocked", who="sato")
    return the_log(world, change)


@reaches()
def case_erased(world):
    def change(log, written):
        log.signed("erased", 90 * SECOND, case=written.case.id, policy="after ten years")
    given = the_log(world, change)
    (world.folder / world.case_id).rename(world.folder / "20200101T000000Z-00000000")
    return given


@reaches("case-missing")
def erased_before_it_was_opened(world):
    def change(log, written):
        log.steps[2:2] = [Entry("erased", 59 * SECOND, {"case": written.case.id, "policy": "after ten years"}), Checkpoint()]
    given = the_log(world, change)
    (world.folder / world.case_id).rename(world.folder / "20200101T000000Z-00000000")
    return given


@reaches()
def erased_and_opened_again_by_nobody(world):
    def change(log, written):
        log.signed("erased", 90 * SECOND, case=written.case.id, policy="after ten years")
        log.add("case-opened", 91 * SECOND, case=written.case.id, sha256=hashlib.sha256(written.lines[0]).hexdigest())
        log.signed("access", 92 * SECOND, case="*", what="unlocked", who="sato")
    given = the_log(world, change)
    (world.folder / world.case_id).rename(world.folder / "20200101T000000Z-00000000")
    return given


@reaches("case-missing")
def removed_and_never_entered_as_opened(world):
    def change(log, written):
        del log.steps[2:4]
    given = the_log(world, change)
    (world.folder / world.case_id).rename(world.folder / "20200101T000000Z-00000000")
    return given


@reaches()
def there_and_never_entered_as_opened(world):
    def change(log, written):
        del log.steps[2:4]
    return the_log(world, change)


@reaches("outside-note-unchecked")
def note_of_nothing(world):
    given = the_log(world)
    (world.folder / "kept.note").write_bytes(world.device.checkpoint("kiroku/or3/log", 0, hashlib.sha256(b"").digest()))
    return dataclasses.replace(given, against=[world.folder / "kept.note"])


@reaches("cases-not-looked-for")
def log_alone(world):
    given = the_log(world)
    (world.folder / "log").rename(world.folder / "kept")
    return dataclasses.replace(given, path=world.folder / "kept")


@reaches("log-signed-late")
def log_signed_later(world):
    def change(log, written):
        for i in range(3):
            log.add("access", (90 + i) * SECOND, case="*", what="unlocked", who="sato")
        log.signed("access", 95 * SECOND, case="*", what="unlocked", who="sato")
    return the_log(world, change)


@reaches("log-damage-stated")
def log_that_was_changed(world):
    """The checkpoint over the line that was changed is gone: the log alone tells of it."""
    def change(log, written):
        lines = len(log.of(w.Entry))
        log.add("access", 89 * SECOND, case="*", what="changed", who="sato")
        log.add("damage-found", 90 * SECOND, size=lines + 1, stated_root="0" * 64, root="1" * 64)
        log.signed("access", 91 * SECOND, case="*", what="unlocked", who="sato")
    return the_log(world, change)


@reaches("log-damage-refuted")
def log_that_was_not_changed(world):
    def change(log, written):
        log.add("damage-found", 90 * SECOND, size=3, stated_root="0" * 64, root="1" * 64)
        log.signed("access", 91 * SECOND, case="*", what="unlocked", who="sato")
    return the_log(world, change)


@reaches("log-damage-refuted")
def log_that_says_too_late_that_its_end_was_cut_off(world):
    def change(log, written):
        log.add("damage-found", 90 * SECOND, size=len(log.of(w.Entry)), stated_root="0" * 64)
        log.signed("access", 91 * SECOND, case="*", what="unlocked", who="sato")
    return the_log(world, change)


@reaches("log-tail-not-covered")
def damage_that_nobody_signed(world):
    def change(log, written):
        log.add("damage-found", 90 * SECOND, size=99, stated_root="0" * 64)
    return dataclasses.replace(the_log(world, change), never=["log-damage-stated", "log-damage-refuted"])


@reaches("log-damage-stated", "device-not-trusted")
def damage_that_a_strangers_checkpoint_does_not_refute(world):
    """What a stranger signed over the changed lines is no checkpoint of the device's."""
    stranger = note.Signer("stranger", bytes([77] * 32))

    def change(log, written):
        lines = len(log.of(w.Entry))
        log.add("access", 89 * SECOND, case="*", what="changed", who="sato")
        boot = log.find("boot").fields["boot_id"]
        log.signed("boot", 90 * SECOND, boot_id=boot, device=str(stranger.key))
        step = log.of(Checkpoint)[-1]
        step.signer, step.origin = stranger, "kiroku/stranger/log"
        log.add("boot", 90 * SECOND, boot_id=boot, device=str(world.device.key))
        log.add("damage-found", 90 * SECOND, size=lines + 1, stated_root="0" * 64, root="1" * 64)
        log.signed("access", 91 * SECOND, case="*", what="unlocked", who="sato")
    return the_log(world, change)


@reaches("log-tail-not-covered")
def ml_dsa_key_that_nobody_signed(world):
    def change(log, written):
        log.add("device-ml-dsa-added", 90 * SECOND, ml_dsa="or3")
    return dataclasses.replace(the_log(world, change), never=["device-ml-dsa-differs", "device-invalid"])


@reaches("log-tail-unsigned")
def log_unsigned(world):
    def change(log, written):
        for i in range(2):
            log.add("access", (90 + i) * SECOND, case="*", what="unlocked", who="sato")
    return the_log(world, change)


@reaches("log-tail-unsigned")
def log_emptied(world):
    given = the_log(world)
    (given.path / "ledger.jsonl").write_bytes(b"")
    for path in (given.path / "checkpoints").iterdir():
        path.unlink()
    return given


@reaches("log-tail-not-covered")
def log_end_unsigned(world):
    def change(log, written):
        log.add("access", 90 * SECOND, case="*", what="unlocked", who="sato")
    return the_log(world, change)


@reaches("log-case-open")
def log_without_an_end(world):
    def change(log, written):
        del log.steps[-2:]
    return with_log(world, change)


@reaches("log-case-open")
def log_of_an_open_case(world):
    def change(log, written):
        del log.steps[-2:]
    return the_log(world, change)


@reaches("entry-malformed")
def log_line_of_nonsense(world):
    def change(log, written):
        log.find("case-checkpoint").raw = b'{"type":"nonsense"}'
    return the_log(world, change)


@reaches("clock-went-back", "entry-out-of-sequence")
def log_back_in_time(world):
    def change(log, written):
        entry = log.find("case-closed")
        entry.mono_ns, entry.seq = 1, 1
    return the_log(world, change)


@reaches("open-missing")
def log_without_boot(world):
    def change(log, written):
        log.steps[0] = Entry("shutdown", 0, {})
    return the_log(world, change)


@reaches("device-invalid")
def log_of_no_device(world):
    def change(log, written):
        log.steps[0].fields["device"] = ""
        for checkpoint in log.of(Checkpoint):
            checkpoint.signer = world.stranger
    return the_log(world, change)


@reaches("ledger-cut")
def log_cut(world):
    given = the_log(world)
    path = given.path / "ledger.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(True)[:-1]))
    return given


# Notes kept outside


def kept(world, data, name="kept.note"):
    path = world.folder / name
    path.write_bytes(data)
    return [path]


@reaches("outside-note-holds")
def note_that_fits(world):
    written = world.sound().write(world.folder)
    return world.given(written.folder, against=kept(world, written.notes[max(written.notes)]))


@reaches("outside-note-rolled-back")
def note_of_more(world):
    case = world.sound()
    written = case.write(world.folder / "before")
    newest = written.notes[max(written.notes)]
    case.steps = case.steps[:-2]
    return world.given(case.write(world.folder).folder, against=kept(world, newest))


@reaches("outside-note-forked")
def note_of_another_history(world):
    case = world.sound()
    written = case.write(world.folder / "before")
    case.find("mark").fields["commitment"] = "0" * 64
    return world.given(case.write(world.folder).folder, against=kept(world, written.notes[max(written.notes)]))


def copy_of(world, written, strays):
    """A folder that was copied before, and what somebody put there: notes by the numbers in their names."""
    copy = world.folder / "copy"
    shutil.copytree(written.folder, copy)
    for name, data in strays.items():
        (copy / "checkpoints" / f"{name:08d}.note").write_bytes(data)
    return [copy]


def strays_in(world, written):
    """An old note under a large number, one that nobody signed, one of another case, and what is none."""
    stranger = note.Signer("or3", bytes([9] * 32))
    return {99_999_999: written.notes[min(written.notes)], 99_999_998: stranger.checkpoint(f"kiroku/or3/{world.case_id}", 99_999_998, bytes(32)),
            99_999_997: world.device.checkpoint("kiroku/or3/20200101T000000Z-00000000", 99_999_997, bytes(32)), 99_999_996: b"nothing"}


@reaches("outside-note-holds")
def copy_with_notes_that_were_put_there(world):
    written = world.sound().write(world.folder)
    return world.given(written.folder, against=copy_of(world, written, strays_in(world, written)))


@reaches("outside-note-rolled-back")
def copy_of_more_with_notes_that_were_put_there(world):
    case = world.sound()
    written = case.write(world.folder / "before")
    against = copy_of(world, written, strays_in(world, written))
    case.steps = case.steps[:-2]
    return world.given(case.write(world.folder).folder, against=against)


@reaches("outside-note-forked")
def copy_of_another_history_with_notes_that_were_put_there(world):
    case = world.sound()
    written = case.write(world.folder / "before")
    against = copy_of(world, written, strays_in(world, written))
    case.find("mark").fields["commitment"] = "0" * 64
    return world.given(case.write(world.folder).folder, against=against)


@reaches("outside-note-of-other-origin")
def copy_of_another_case_alone(world):
    written = world.sound().write(world.folder)
    copy = world.folder / "copy"
    (copy / "checkpoints").mkdir(parents=True)
    (copy / "checkpoints/00000003.note").write_bytes(world.device.checkpoint("kiroku/or3/20200101T000000Z-00000000", 3, bytes(32)))
    return world.given(written.folder, against=[copy])


# Two machines of one name: names of devices are not unique, and the verifier trusts the keys of both.
NAMESAKE = note.Signer("or3", bytes([9] * 32))
ACCUSES = ["outside-note-forked", "outside-note-rolled-back", "outside-notes-contradict", "outside-note-not-by-both", "outside-note-holds"]


def beside_its_namesake(given, against, never=None):
    return dataclasses.replace(given, devices=[*given.devices, NAMESAKE.key], against=against, never=ACCUSES if never is None else never)


@reaches("outside-note-of-other-origin")
def notes_by_another_key_of_its_name(world):
    """Of another history, of more entries than there are, and of just these."""
    written = world.sound().write(world.folder)
    against = [kept(world, NAMESAKE.checkpoint(written.case.origin, size, root), f"{size}.note")[0]
               for size, root in ((2, bytes(32)), (3, written.root(3)), (900, bytes(32)))]
    return beside_its_namesake(world.given(written.folder), against)


@reaches("outside-note-of-other-origin", "outside-note-holds")
def notes_of_one_size_by_two_keys_of_one_name(world):
    """Each signed one history."""
    written = world.sound().write(world.folder)
    size = max(written.notes)
    against = kept(world, written.notes[size]) + kept(world, NAMESAKE.checkpoint(written.case.origin, size, bytes(32)), "other.note")
    return beside_its_namesake(world.given(written.folder), against, [code for code in ACCUSES if code != "outside-note-holds"])


@reaches("outside-note-of-other-origin", "outside-note-forked")
def notes_of_one_size_by_two_keys_of_which_its_own_is_of_another_history(world):
    case = world.sound()
    written = case.write(world.folder / "before")
    case.find("mark").fields["commitment"] = "0" * 64
    size = max(written.notes)
    against = kept(world, written.notes[size]) + kept(world, NAMESAKE.checkpoint(case.origin, size, bytes(32)), "other.note")
    return beside_its_namesake(world.given(case.write(world.folder).folder), against, ["outside-notes-contradict", "outside-note-holds"])


@reaches("outside-note-of-other-origin")
def two_histories_by_another_key_of_its_name(world):
    """That key did sign two, which says nothing of what is shown."""
    written = world.sound().write(world.folder)
    against = kept(world, NAMESAKE.checkpoint(written.case.origin, 3, bytes(32))) + kept(world, NAMESAKE.checkpoint(written.case.origin, 3, written.root(3)), "other.note")
    return beside_its_namesake(world.given(written.folder), against)


@reaches("outside-notes-contradict", "outside-note-of-other-origin")
def two_histories_of_another_record_by_the_device(world):
    """The very key that signed what is shown."""
    origin = "kiroku/or3/20200101T000000Z-00000000"
    against = kept(world, world.device.checkpoint(origin, 3, bytes(32))) + kept(world, world.device.checkpoint(origin, 3, bytes([1] * 32)), "other.note")
    return world.given(world.sound().write(world.folder).folder, against=against)


@reaches("outside-note-of-other-origin")
def copy_by_another_key_of_its_name(world):
    written = world.sound().write(world.folder)
    copy = world.folder / "copy"
    (copy / "checkpoints").mkdir(parents=True)
    for size in (3, 900):
        (copy / f"checkpoints/{size:08d}.note").write_bytes(NAMESAKE.checkpoint(written.case.origin, size, bytes(32)))
    return beside_its_namesake(world.given(written.folder), [copy])


@reaches("outside-note-holds")
def copy_with_notes_by_another_key_of_its_name(world):
    """They hide none of those that are the device's."""
    written = world.sound().write(world.folder)
    strays = {size: NAMESAKE.checkpoint(written.case.origin, size, bytes(32)) for size in (max(written.notes) + 1, 900, 901)}
    return beside_its_namesake(world.given(written.folder), copy_of(world, written, strays), [code for code in ACCUSES if code != "outside-note-holds"])


@reaches("outside-note-of-other-origin")
def log_and_the_log_of_its_namesake(world):
    """The newest note of a machine of the same name, whose log is longer."""
    given = the_log(world)
    return beside_its_namesake(given, kept(world, NAMESAKE.checkpoint("kiroku/or3/log", 3, bytes(32))) + kept(world, NAMESAKE.checkpoint("kiroku/or3/log", 900, bytes(32)), "more.note"))


@reaches("outside-note-of-other-origin")
def case_beside_the_log_of_its_device_and_a_note_of_its_namesake(world):
    given = with_log(world)
    return beside_its_namesake(given, kept(world, NAMESAKE.checkpoint("kiroku/or3/log", 3, bytes(32))), [*ACCUSES, "log-not-sound"])


@reaches("outside-note-of-other-origin", "log-tail-not-covered")
def log_to_which_somebody_added_the_name_of_its_namesake(world):
    """Without a key."""
    def change(log, written):
        log.add("boot", 90 * SECOND, boot_id=w.BOOT_ID, device=str(NAMESAKE.key))
    return beside_its_namesake(the_log(world, change), kept(world, NAMESAKE.checkpoint("kiroku/or3/log", 3, bytes(32))))


@reaches("outside-note-forked")
def log_that_its_namesake_carried_on_against_a_note_of_its_own(world):
    """That key signed two histories: this one and its own."""
    given = carried_on_by(world, NAMESAKE, lambda written: [("access", {"case": "*", "what": "unlocked", "who": "sato"})], judge=the_log, trusted=True)
    return dataclasses.replace(given, against=kept(world, NAMESAKE.checkpoint("kiroku/or3/log", 3, bytes(32))))


@reaches("outside-note-of-other-origin")
def note_of_its_namesake_that_makes_no_entry_the_device_s_own(world):
    """As of another trusted device: it signs the unsigned opening of a case that never was."""
    def change(log, written):
        log.add("case-opened", 90 * SECOND, case="20200101T000000Z-00000000", sha256="0" * 64)
    given = the_log(world, change)
    lines = (given.path / "ledger.jsonl").read_bytes().split(b"\n")[:-1]
    return beside_its_namesake(given, kept(world, NAMESAKE.checkpoint("kiroku/or3/log", len(lines), merkle.root([merkle.leaf(line) for line in lines]))), ["case-missing", *ACCUSES])


@reaches("outside-note-invalid")
def copy_without_a_checkpoint_in_its_files(world):
    written = world.sound().write(world.folder)
    copy = world.folder / "copy"
    (copy / "checkpoints").mkdir(parents=True)
    (copy / "checkpoints/00000003.note").write_bytes(b"nothing")
    return world.given(written.folder, against=[copy])


@reaches("log-tail-not-covered", "entry-too-long")
def log_of_lines_that_are_holes(world):
    given = the_log(world)
    with open(given.path / "ledger.jsonl", "r+b") as file:
        for _ in range(40):
            file.seek(60 << 20, os.SEEK_END)
            file.write(b"\n")
    return given


@reaches("file-hash-differs")
def token_that_is_a_hole(world):
    written = world.sound().write(world.folder)
    token = next((written.folder / "tokens").iterdir())
    os.truncate(token, 0)
    os.truncate(token, 1 << 20)
    return world.given(written.folder)


@reaches("outside-notes-contradict", "outside-note-forked", "outside-note-holds")
def two_histories(world):
    case = world.sound()
    written = case.write(world.folder / "before")
    case.find("mark").fields["commitment"] = "0" * 64
    again = case.write(world.folder)
    size = max(written.notes)
    return world.given(again.folder, against=kept(world, written.notes[size]) + kept(world, again.notes[size], "other.note"))


@reaches("outside-note-invalid")
def note_of_no_form(world):
    return world.given(world.sound().write(world.folder).folder, against=kept(world, b"nonsense\n"))


@reaches("outside-note-invalid")
def note_of_no_signature(world):
    written = world.sound().write(world.folder)
    notes = [written.notes[s] for s in sorted(written.notes)]
    return world.given(written.folder, against=kept(world, notes[0].split(b"\n\n")[0] + b"\n\n" + notes[1].split(b"\n\n")[1]))


@reaches("outside-note-untrusted")
def note_of_an_unknown_device(world):
    written = world.sound().write(world.folder)
    return world.given(written.folder, against=kept(world, world.stranger.checkpoint(written.case.origin, 3, written.root(3))))


@reaches("outside-note-of-other-origin")
def note_of_some_other_case(world):
    written = world.sound().write(world.folder)
    return world.given(written.folder, against=kept(world, world.device.checkpoint("kiroku/or3/20200101T000000Z-00000000", 3, written.root(3))))


@reaches("outside-note-rolled-back")
def log_rolled_back(world):
    given = the_log(world)
    newest = max((given.path / "checkpoints").iterdir())
    data = newest.read_bytes()
    newest.unlink()
    path = given.path / "ledger.jsonl"
    path.write_bytes(b"".join(path.read_bytes().splitlines(True)[:-1]))
    return dataclasses.replace(given, against=kept(world, data))


# Proofs of a case's end from the log


def by_proof(world, given, change=lambda parts: None, part=None):
    """The folder of `given` with a proof from its log in the log's place. `part`: of an excerpt, how many entries of the case at `part[1]` it leads to."""
    lines = (given.log / "ledger.jsonl").read_bytes().split(b"\n")[:-1]
    index = max(i for i, line in enumerate(lines) if b'"type":"case-closed"' in line)
    leaves = [merkle.leaf(line) for line in lines]
    consistency = []
    if part:
        size, of_case = part
        ended = json.loads(lines[index])["size"]
        of_case = [merkle.leaf(line) for line in of_case[:max(size, ended)]]
        consistency = merkle.consistency(of_case, min(size, ended)) if size != ended else []
    parts = {"line": lines[index], "consistency": consistency, "index": index, "path": merkle.inclusion(leaves, index),
             "signed": world.device.checkpoint(f"kiroku/{world.device.name}/log", len(lines), merkle.root(leaves))}
    change(parts)
    path = world.folder / "case.tlog-proof"
    path.write_bytes(tlog_proof.make(**parts))
    return dataclasses.replace(given, log=None, proof=path)


@reaches("log-proof-holds")
def proof_of_the_end(world):
    return by_proof(world, with_log(world))


@reaches("log-proof-differs")
def proof_of_another_end(world):
    def change(log, written):
        log.find("case-closed").fields["root"] = "0" * 64
    return by_proof(world, with_log(world, change))


@reaches("log-proof-differs")
def proof_of_a_later_end(world):
    def change(log, written):
        log.find("case-closed").fields["size"] = len(written.lines) + 1
    return by_proof(world, with_log(world, change))


@reaches("log-proof-not-used")
def proof_of_nothing(world):
    given = by_proof(world, with_log(world))
    given.proof.write_bytes(b"nonsense\n")
    return given


@reaches("log-proof-not-used")
def proof_of_another_case(world):
    def change(log, written):
        log.find("case-closed").fields["case"] = "20200101T000000Z-00000000"
    return by_proof(world, with_log(world, change))


@reaches("log-proof-not-used")
def proof_of_no_end(world):
    def change(parts):
        parts["line"] = parts["line"].replace(b"case-closed", b"case-opened")
    return by_proof(world, with_log(world), change)


@reaches("log-proof-not-used")
def proof_with_another_line(world):
    def change(parts):
        entry = json.loads(parts["line"])
        parts["line"] = parts["line"].replace(entry["root"].encode(), b"0" * 64)
    return by_proof(world, with_log(world), change)


@reaches("log-proof-not-used")
def proof_at_another_place(world):
    def change(parts):
        parts["index"] -= 1
    return by_proof(world, with_log(world), change)


@reaches("log-proof-not-used")
def proof_by_a_stranger(world):
    def change(parts):
        checkpoint = note.parse_checkpoint(parts["signed"])
        parts["signed"] = world.stranger.checkpoint(checkpoint.origin, checkpoint.size, checkpoint.root)
    return by_proof(world, with_log(world), change)


ANOTHER_DEVICE = note.Signer("or4", bytes([9] * 32))


def by_proof_of_another_device(world, case, root=None):
    """A case, and what the log of another device says of its end; the verifier trusts both devices."""
    written = case.write(world.folder)
    log = w.Log(ANOTHER_DEVICE, world.utc_ns - 60 * SECOND)
    log.checkpoint()
    log.signed("case-closed", 81 * SECOND, case=written.case.id, size=len(written.lines), root=root or written.root().hex())
    log.write(world.folder, "log")
    given = world.given(written.folder, log=world.folder / "log", devices=[world.device.key, ANOTHER_DEVICE.key])
    return by_proof(dataclasses.replace(world, device=ANOTHER_DEVICE), given)


def log_of_the_end(world, written, device=None):
    """A log that knows of the case its beginning and its end alone, and its newest checkpoint."""
    log = w.Log(device or world.device, world.utc_ns - 60 * SECOND)
    log.checkpoint()
    log.signed("case-opened", 60 * SECOND, case=written.case.id, sha256=hashlib.sha256(written.lines[0]).hexdigest())
    final = json.loads([line for line in written.lines if b'"type":"token"' in line][-1])["sha256"]
    log.signed("case-closed", 81 * SECOND, case=written.case.id, size=len(written.lines), root=written.root().hex(), final_token=final)
    known = log.write(world.folder, "log")
    return known.folder, known.notes[max(known.notes)]


@reaches("log-proof-not-used")
def proof_of_another_end_by_another_device(world):
    """Its key accuses no case of this one."""
    given = by_proof_of_another_device(world, world.sound(), "0" * 64)
    given.never = ["log-proof-differs"]
    return given


@reaches("log-proof-not-used")
def proof_of_a_rewritten_case_by_another_device(world):
    """Nor does it vouch for one that a copied key signed anew."""
    case = world.sound()
    case.find("mark").fields["commitment"] = "0" * 64
    given = by_proof_of_another_device(world, case)
    given.never = ["log-proof-holds"]
    return given


@reaches("log-proof-not-used")
def excerpt_by_the_proof_of_another_device(world):
    given = by_proof_of_another_device(dataclasses.replace(world, folder=world.folder / "other"), world.sound())
    given = dataclasses.replace(excerpt(world), devices=given.devices, proof=given.proof)
    given.never = ["log-proof-holds"]
    return given


def by_proof_of_its_namesake(world, given):
    given = by_proof(dataclasses.replace(world, device=NAMESAKE), given)
    return dataclasses.replace(given, devices=[*given.devices, NAMESAKE.key], never=["log-proof-holds", "log-proof-differs"])


@reaches("log-proof-not-used")
def proof_by_another_key_of_its_name(world):
    """Two machines have one name, and the verifier trusts the keys of both. A proof has no line that tells which of them goes on with the other's cases."""
    return by_proof_of_its_namesake(world, with_log(world))


@reaches("log-proof-not-used")
def proof_of_a_rewritten_case_by_another_key_of_its_name(world):
    """It vouches for none that a copied key signed anew."""
    case = world.sound()
    case.find("mark").fields["commitment"] = "0" * 64
    return by_proof_of_its_namesake(world, with_log(world, case=case))


@reaches("log-proof-not-used")
def proof_of_another_end_by_another_key_of_its_name(world):
    def change(log, written):
        log.find("case-closed").fields["root"] = "0" * 64
    return by_proof_of_its_namesake(world, with_log(world, change))


@reaches("log-proof-not-used")
def proof_of_more_entries_by_another_key_of_its_name(world):
    def change(log, written):
        log.find("case-closed").fields["size"] = len(written.lines) + 1
    return by_proof_of_its_namesake(world, with_log(world, change))


@reaches("log-proof-not-used")
def proof_by_another_key_of_its_name_whose_own_device_is_not_trusted(world):
    given = by_proof_of_its_namesake(world, with_log(world))
    return dataclasses.replace(given, devices=[NAMESAKE.key])


@reaches("log-proof-not-used")
def excerpt_by_the_proof_of_another_key_of_its_name(world):
    other = by_proof_of_its_namesake(dataclasses.replace(world, folder=world.folder / "other"), with_log(dataclasses.replace(world, folder=world.folder / "other")))
    return dataclasses.replace(excerpt(world), devices=other.devices, proof=other.proof, never=other.never)


def excerpt_by_proof(world, size, change=lambda parts: None, **fields):
    """An excerpt that leads to `size` entries of its case (None: all), and a log that knows the case's end."""
    written = world.sound().write(world.folder / "again")
    log = w.Log(world.device, world.utc_ns - 60 * SECOND)
    log.checkpoint()
    log.signed("case-closed", 81 * SECOND, **({"case": written.case.id, "size": len(written.lines), "root": written.root().hex()} | fields))
    log.write(world.folder, "log")
    part = excerpt(world) if size is None else excerpt(world, size=size, from_ns=SECOND, to_ns=2 * SECOND, first=1)
    given = dataclasses.replace(part, log=world.folder / "log")
    return by_proof(world, given, change, (size or len(written.lines), written.lines))


@reaches("log-proof-holds")
def excerpt_of_the_end_by_proof(world):
    return excerpt_by_proof(world, None)


@reaches("log-proof-holds")
def excerpt_of_the_beginning_by_proof(world):
    return excerpt_by_proof(world, 7)


@reaches("log-proof-not-used")
def excerpt_by_the_proof_of_the_case(world):
    return excerpt_by_proof(world, 7, lambda parts: parts.update(consistency=[]))


@reaches("log-proof-not-used")
def excerpt_by_a_wrong_way(world):
    return excerpt_by_proof(world, 7, lambda parts: parts.update(consistency=parts["consistency"][::-1] + [bytes(32)]))


@reaches("log-proof-differs")
def excerpt_of_another_end_by_proof(world):
    return excerpt_by_proof(world, None, root="0" * 64)


# Two cases of one operation


def operation(world, root=None, announced=True, later_only=False):
    """A case that a crash ended, and the one that carries it on."""
    later_id = stamp.text_of(world.utc_ns + 60 * SECOND)[:19].replace("-", "").replace(":", "") + "Z-0badcafe"
    case = cut_off(world)
    for name in ("endoscope", "vitals"):
        case.add("gap", 15 * SECOND, stream=name, start_ns=10 * SECOND, end_ns=15 * SECOND, cause="interrupted")
    case.close(15_100 * MS, f"recovered; to be carried on as case {later_id}" if announced else "recovered")
    case.checkpoint()
    case.token(world.outside, 15_200 * MS, gen_ns=15_190 * MS)
    case.checkpoint()
    earlier = case.write(world.folder / ("elsewhere" if later_only else "."))
    size = 1 + next(i for i, line in enumerate(earlier.lines) if b'"type":"close"' in line)
    source = f"operator; carries on case {case.id}, {size} entries, root {root or earlier.root(size).hex()}"
    later = world.begin(case_id=later_id, utc_ns=world.utc_ns + 60 * SECOND, streams=world.streams(events=source))
    world.record(later, 0, 2)
    written = world.end(later, 10_040 * MS).write(world.folder)
    return earlier, written


@reaches("carrying-on-holds")
def carried_on(world):
    return world.given(operation(world)[1].folder)


@reaches("carrying-on-holds")
def carries_on(world):
    return world.given(operation(world)[0].folder)


@reaches("carrying-on-broken")
def carried_on_from_others(world):
    return world.given(operation(world, root="0" * 64)[1].folder)


@reaches("carrying-on-broken")
def not_announced(world):
    return world.given(operation(world, announced=False)[1].folder)


@reaches("carried-on-not-here")
def carried_on_alone(world):
    return world.given(operation(world, later_only=True)[1].folder)


# What other devices state of a case that only a store has


def shipped(world):
    """A case whose recorder never came back: what a store would have of it."""
    case = world.begin()
    world.record(case, 0, 2)
    case.checkpoint()
    case.token(world.outside, 10_100 * MS, gen_ns=10_090 * MS, entered=False)
    return case


def rescuer(world):
    """Another device of the same hospital, of two keys."""
    return note.Signer("or4", bytes([4] * 32), ml_dsa_seed=bytes([5] * 32))


def state_of(world, written, maker=None, **changed):
    """The text of a statement of all that is there."""
    root = lambda size: base64.b64encode(written.root(size)).decode()  # noqa: E731
    size = len(written.lines)
    named = {entry.get("file") for entry in map(json.loads, written.lines)}
    paths = sorted(str(path.relative_to(written.folder)) for path in written.folder.rglob("*") if path.is_file())
    files = {path: hashlib.sha256((written.folder / path).read_bytes()).hexdigest() for path in paths
             if path.split("/")[0] in ("checkpoints", "tokens", "segments") and path not in named}
    values = {"origin": f"kiroku/{(maker or rescuer(world)).name}/store-statement", "case": world.case_id, "device": str(world.device.key),
              "store": "https://store.hospital.example/recordings/or3", "looked": stamp.text_of(world.utc_ns + 3600 * SECOND), "newest": "unknown",
              "log": f"0 {base64.b64encode(hashlib.sha256(b'').digest()).decode()}", "entries": f"{size} {root(size)}", "signed": f"3 {root(3)}", "files": files, "missing": (),
              **changed}
    lines = [values["origin"], *(f"{key} {values[key]}" for key in ("case", "device", "store", "looked", "newest", "log", "entries", "signed")),
             *(f"file {sha256}  {path}" for path, sha256 in values["files"].items()), *(f"missing {path}" for path in values["missing"])]
    return "".join(f"{line}\n" for line in lines)


def stated(world, written, text, maker=None, name="20260805T170000Z-5e6f7a8b.note", trusted=True, line=None):
    """The case with a statement beside it, and what a verifier is given: the key of its maker, too, where it is trusted."""
    maker = maker or rescuer(world)
    path = world.folder / "store-statements" / world.case_id / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode() + b"\n" + (line or maker.line(text.encode())))
    return world.given(written.folder, devices=[world.device.key] + ([maker.identity] if trusted and maker != world.device else []), never=["file-unnamed"])


@reaches("store-statement-holds", "not-closed")
def stated_by_another_device(world):
    written = shipped(world).write(world.folder)
    return stated(world, written, state_of(world, written))


@reaches("store-statement-holds")
def stated_of_a_case_that_was_ended_since(world):
    written = world.sound().write(world.folder)
    return dataclasses.replace(stated(world, written, state_of(world, written)), never=["store-statement-outgrown"])


@reaches("store-statement-holds", "store-statement-outgrown")
def entries_came_since_it_was_stated(world):
    written = world.sound().write(world.folder)
    text = state_of(world, written, entries=f"5 {base64.b64encode(written.root(5)).decode()}", files={})
    return stated(world, written, text)


@reaches("store-statement-outgrown")
def a_file_came_since_it_was_stated(world):
    written = shipped(world).write(world.folder)
    text = state_of(world, written)
    (written.folder / "segments/endoscope/00000002.ts.age").write_bytes(b"x")
    return stated(world, written, text)


@reaches("store-statement-outgrown")
def what_was_missing_when_it_was_stated_is_here(world):
    written = shipped(world).write(world.folder)
    return stated(world, written, state_of(world, written, missing=["segments/endoscope/00000001.ts.age"]))


@reaches("store-statement-differs")
def more_was_stated_than_is_here(world):
    written = shipped(world).write(world.folder)
    return stated(world, written, state_of(world, written, entries=f"{len(written.lines) + 1} {base64.b64encode(bytes(32)).decode()}"))


@reaches("store-statement-differs")
def other_entries_were_stated(world):
    written = shipped(world).write(world.folder)
    return stated(world, written, state_of(world, written, entries=f"{len(written.lines)} {base64.b64encode(bytes(32)).decode()}"))


@reaches("store-statement-differs")
def other_signed_entries_were_stated(world):
    written = shipped(world).write(world.folder)
    return stated(world, written, state_of(world, written, signed=f"3 {base64.b64encode(bytes(32)).decode()}"))


@reaches("store-statement-differs")
def a_file_that_was_stated_is_another(world):
    written = shipped(world).write(world.folder)
    text = state_of(world, written)
    (written.folder / "tokens").joinpath(max(os.listdir(written.folder / "tokens"))).write_bytes(b"another")
    return stated(world, written, text)


@reaches("store-statement-differs")
def a_file_that_was_stated_is_gone(world):
    written = shipped(world).write(world.folder)
    text = state_of(world, written)
    (written.folder / "tokens").joinpath(max(os.listdir(written.folder / "tokens"))).unlink()
    return stated(world, written, text)


@reaches("store-statement-untrusted")
def stated_by_a_stranger(world):
    written = shipped(world).write(world.folder)
    return stated(world, written, state_of(world, written, world.stranger), world.stranger, trusted=False)


@reaches("store-statement-untrusted")
def stated_by_a_stranger_of_a_trusted_name(world):
    written = shipped(world).write(world.folder)
    text = state_of(world, written)
    return stated(world, written, text, line=note.Signer("or4", bytes([6] * 32)).line(text.encode()))


def refused_statement(world, change=None, **more):
    written = shipped(world).write(world.folder)
    return stated(world, written, change(state_of(world, written)) if change else state_of(world, written), **more)


@reaches("store-statement-refused")
def stated_without_the_second_key(world):
    written = shipped(world).write(world.folder)
    text = state_of(world, written)
    return stated(world, written, text, line=dataclasses.replace(rescuer(world), ml_dsa_seed=None).line(text.encode()))


@reaches("store-statement-refused")
def stated_with_a_signature_of_another_text(world):
    return refused_statement(world, line=rescuer(world).line(b"another\n"))


@reaches("store-statement-refused")
def stated_by_the_cases_own_device(world):
    written = shipped(world).write(world.folder)
    return stated(world, written, state_of(world, written, world.device), world.device)


@reaches("store-statement-refused")
def stated_of_another_case(world):
    return refused_statement(world, lambda text: text.replace(world.case_id, "20260101T000000Z-00000000"))


@reaches("store-statement-refused")
def stated_of_another_devices_case(world):
    return refused_statement(world, lambda text: text.replace(str(world.device.key), str(world.stranger.key)))


@reaches("store-statement-refused")
def a_statement_with_a_line_too_many(world):
    return refused_statement(world, lambda text: text + "more 1\n")


@reaches("store-statement-refused")
def a_statement_whose_paths_do_not_rise(world):
    return refused_statement(world, lambda text: text + "missing b\nmissing a\n")


@reaches("store-statement-refused")
def a_statement_of_a_path_that_leads_out(world):
    return refused_statement(world, lambda text: text + "missing ../a\n")


@reaches("store-statement-refused")
def a_statement_of_no_entries(world):
    return refused_statement(world, lambda text: "".join(f"{line.split(' ')[0]} 0 {line.split(' ')[2]}" if line.startswith("entries") else line for line in text.splitlines(True)))


@reaches("store-statement-refused")
def a_statement_of_a_day_that_is_none(world):
    return refused_statement(world, lambda text: text.replace("newest unknown", "newest 2026-02-30T00:00:00.000000Z"))


@reaches("store-statement-refused")
def a_statement_that_is_a_link(world):
    given = refused_statement(world)
    path = world.folder / "store-statements" / world.case_id
    os.rename(path / "20260805T170000Z-5e6f7a8b.note", world.folder / "elsewhere")
    (path / "20260805T170000Z-5e6f7a8b.note").symlink_to(world.folder / "elsewhere")
    return given


@reaches("store-statement-refused")
def more_statements_than_are_read(world):
    given = refused_statement(world, lambda text: "x\n", name="20260805T170000Z-00000000.note")
    path = world.folder / "store-statements" / world.case_id
    for number in range(1, 102):
        shutil.copy(path / "20260805T170000Z-00000000.note", path / f"20260805T170000Z-{number:08x}.note")
    return given


@reaches("not-closed")
def a_statement_of_another_name_is_none(world):
    return dataclasses.replace(refused_statement(world, lambda text: "x\n", name="notes.txt"), never=["store-statement-refused"])


def beside_a_later_case(world, harm):
    """A sound case that carries another one on, and what became of that one's folder."""
    earlier, later = operation(world)
    harm(earlier.folder)
    return dataclasses.replace(world.given(later.folder), never=["carrying-on-broken"])


@reaches("carried-on-not-compared")
def carries_on_a_case_with_one_bit_changed(world):
    return beside_a_later_case(world, lambda folder: change_byte(folder / "ledger.jsonl", 300))


@reaches("carried-on-not-compared")
def carries_on_a_case_of_which_the_beginning_was_copied(world):
    return beside_a_later_case(world, lambda folder: (folder / "ledger.jsonl").write_bytes((folder / "ledger.jsonl").read_bytes()[:2000]))


@reaches("carried-on-not-compared")
def carries_on_what_anybody_wrote(world):
    return beside_a_later_case(world, lambda folder: (folder / "ledger.jsonl").write_bytes(b"hello\n"))


@reaches("carried-on-not-compared")
def is_carried_on_by_what_anybody_wrote(world):
    earlier, later = operation(world)
    (later.folder / "ledger.jsonl").write_bytes(b"hello\n")
    return dataclasses.replace(world.given(earlier.folder), never=["carrying-on-broken"])


@reaches("carried-on-not-compared")
def is_carried_on_by_a_first_line_that_nobody_signed(world):
    """The later case was taken away; anybody who saw it can write its first line, or one like it."""
    earlier, later = operation(world)
    line = (later.folder / "ledger.jsonl").read_bytes().split(b"\n")[0] + b"\n"
    shutil.rmtree(later.folder)
    later.folder.mkdir()
    (later.folder / "ledger.jsonl").write_bytes(line)
    return dataclasses.replace(world.given(earlier.folder), never=["carrying-on-holds", "carrying-on-broken"])


@reaches("carrying-on-broken")
def is_carried_on_from_others(world):
    return world.given(operation(world, root="0" * 64)[0].folder)


# Excerpts


def excerpt(world, from_ns=6 * SECOND, to_ns=9 * SECOND, streams=("endoscope",), first=None, size=None, change=None, **more):
    """Of the second segments of a sound case, with the lines from the first token to the second."""
    written = world.sound().write(world.folder / "whole")
    tokens = [i for i, line in enumerate(written.lines) if b'"type":"token"' in line]
    first = tokens[0] if first is None else first
    size = len(written.lines) if size is None else size
    folder = w.write_excerpt(written, world.folder / "excerpt", from_ns, to_ns, list(streams), first, size, change=change)
    return world.given(folder, **more)


@reaches()
def sound_excerpt(world):
    return excerpt(world)


@reaches()
def excerpt_from_the_middle(world):
    return excerpt(world, 11 * SECOND, 14 * SECOND, first=7)


def excerpt_from_its_opening_on(world, case, from_ns, to_ns):
    written = case.write(world.folder / "whole")
    return world.given(w.write_excerpt(written, world.folder / "excerpt", from_ns, to_ns, ["endoscope"], 0, len(written.lines)))


@reaches("stamped-after-close")
def excerpt_of_a_case_that_was_stamped_after_its_end_alone(world):
    case = world.sound()
    for token in case.of(Token)[:2]:
        case.steps.remove(token)
    return excerpt_from_its_opening_on(world, case, 6 * SECOND, 9 * SECOND)


@reaches("stamped-after-close")
def excerpt_of_before_the_first_token(world):
    """Its case has a token before its end, but none before this part."""
    case = world.sound()
    case.steps.remove(case.of(Token)[0])
    return excerpt_from_its_opening_on(world, case, SECOND, 9 * SECOND)


@reaches("stamped-after-close")
def excerpt_without_the_token_before_it(world):
    """Its lines begin behind the token that would say that it is no older."""
    return excerpt(world, first=3)


@reaches()
def excerpt_around_the_first_token(world):
    case = world.sound()
    case.steps.remove(case.of(Token)[0])
    given = excerpt_from_its_opening_on(world, case, SECOND, 14 * SECOND)
    given.never = ["stamped-after-close", "first-stamped-late"]
    return given


@reaches("first-stamped-late")
def excerpt_of_film_of_before_the_first_token(world):
    case = stamped_late(world, 200)
    case.steps = case.steps[:case.steps.index(case.find("close"))]
    world.record(case, 40, 41)
    return excerpt_from_its_opening_on(world, world.end(case, 205_040 * MS), SECOND, 204 * SECOND)


@reaches("segments-entered-late")
def excerpt_of_old_film_in_the_midst(world):
    case = entered_at_once(world, 200)
    return excerpt_of(world, case, 20 * SECOND, 60 * SECOND, 0, streams=("endoscope",))


def slewed_from_before_the_tokens(world, gained):
    """Of its second minute both authorities' clocks have so many seconds less; that the case clock is slewed is stated before the first token."""
    case = world.begin(stamped=False)
    case.add("clock", 5 * MS, synchronised=True, offset_ns=0, error_ns=250_000, step_ns=0, rate_ppb=83_333_000)
    world.record(case, 0, 12)
    for at, says in ((60, 60), (120, 120 - gained), (180, 180 - gained)):
        case.checkpoint()
        for i, authority in enumerate((world.outside, world.second)):
            case.token(authority, at * SECOND + 100 * (i + 1) * MS, gen_ns=says * SECOND + 100 * (i + 1) * MS - 10 * MS)
        if at < 180:
            world.record(case, at // 5, at // 5 + 12)
    case.close(180_400 * MS)
    case.checkpoint()
    case.token(world.outside, 180_500 * MS, gen_ns=(180 - gained) * SECOND + 490 * MS)
    case.checkpoint()
    return case


@reaches("authority-clock-differs")
def excerpt_that_does_not_show_a_slew(world):
    """The case is intact; what states the slew lies before the lines."""
    given = excerpt_of(world, slewed_from_before_the_tokens(world, 9), 70 * SECOND, 80 * SECOND, 0, roots=[world.outside.root, world.second.root])
    given.never = ["clock-contradicted"]
    return given


@reaches("clock-contradicted")
def excerpt_of_more_than_a_slew(world):
    return excerpt_of(world, slewed_from_before_the_tokens(world, 20), 70 * SECOND, 80 * SECOND, 0, roots=[world.outside.root, world.second.root])


@reaches("excerpt-malformed")
def excerpt_of_nonsense(world):
    def change(document, files):
        document["more"] = 1
    return excerpt(world, change=change)


@reaches("excerpt-malformed")
def excerpt_of_a_stream_that_is_none(world):
    def change(document, files):
        document["streams"].append("ghost")
    return excerpt(world, change=change)


@reaches("excerpt-malformed")
def excerpt_of_another_case(world):
    def change(document, files):
        document["case"] = "20200101T000000Z-00000000"
    return excerpt(world, change=change)


@reaches("excerpt-empty")
def excerpt_of_nothing(world):
    return excerpt(world, streams=("events",), from_ns=SECOND, to_ns=2 * SECOND)


@reaches("excerpt-outside-case")
def excerpt_of_later(world):
    return excerpt(world, from_ns=3600 * SECOND, to_ns=3601 * SECOND)


@reaches("excerpt-proof-invalid")
def excerpt_with_a_wrong_proof(world):
    def change(document, files):
        document["open_proof"][0] = "0" * 64
    return excerpt(world, change=change)


@reaches("excerpt-proof-invalid")
def excerpt_with_another_left(world):
    def change(document, files):
        document["left"][0] = "0" * 64
    return excerpt(world, change=change)


@reaches("excerpt-proof-invalid")
def excerpt_without_its_earlier_proof(world):
    def change(document, files):
        document["earlier"] = []
    return excerpt(world, change=change)


@reaches("excerpt-range-short", "excerpt-no-later-token")
def excerpt_of_too_few_lines(world):
    return excerpt(world, from_ns=6 * SECOND, to_ns=12 * SECOND, size=7)


def excerpt_of(world, case, from_ns, to_ns, token, streams=("endoscope", "vitals"), size=None, **more):
    """Of any case, with the lines from its token of that number on, or from `open` (None)."""
    written = case.write(world.folder / "whole")
    tokens = [i for i, line in enumerate(written.lines) if b'"type":"token"' in line]
    folder = w.write_excerpt(written, world.folder / "excerpt", from_ns, to_ns, list(streams), 1 if token is None else tokens[token], size or len(written.lines))
    return world.given(folder, **more)


def pausing(world, *stated, again=None, last=6, gap_at=None):
    """A camera that has nothing from 5 s on, or until its segment `again`; the gaps of it that are `stated`, entered behind the segments of number `gap_at`."""
    case = world.begin()
    for i in range(last):
        if i == 2:
            case.checkpoint()
            case.token(world.outside, 10_100 * MS, gen_ns=10_090 * MS)
        case.segment("vitals", i, 5 * i * SECOND, 5 * (i + 1) * SECOND, world.seal(f"vitals {i}", f"vitals {i}\n".encode()), 5)
        if i == 0 or again is not None and i >= again:
            case.segment("endoscope", 0 if i == 0 else i - again + 1, 5 * i * SECOND, 5 * (i + 1) * SECOND, world.seal(f"endoscope {i}", f"endoscope {i}\n".encode()), 125)
        if i == gap_at:
            for start, end in stated:
                case.add("gap", 5 * (i + 1) * SECOND + 20 * MS, stream="endoscope", start_ns=start * SECOND, end_ns=end * SECOND, cause="signal-lost")
    return world.end(case, 5 * last * SECOND + 40 * MS)


SHORT = ["excerpt-range-short", "stream-begins-late", "stream-ends-early", "stream-empty", "segment-hole", "gap-beyond-end", "totals-differ"]


@reaches("excerpt-range-short")
def excerpt_of_a_camera_that_is_not_there(world):
    """The case is unproven; the lines begin behind the camera's last segment."""
    return excerpt_of(world, pausing(world), 12 * SECOND, 28 * SECOND, 1)


@reaches("stream-ends-early")
def excerpt_of_a_camera_that_fell_silent(world):
    return excerpt_of(world, pausing(world), 12 * SECOND, 28 * SECOND, 0)


@reaches("stream-ends-early")
def excerpt_of_a_second_of_a_long_silence(world):
    return excerpt_of(world, pausing(world), 29 * SECOND, 30 * SECOND, 0)


@reaches("excerpt-range-short")
def excerpt_from_within_a_hole(world):
    """The case is tampered; the lines begin behind the segment before the hole."""
    return excerpt_of(world, pausing(world, again=3), 11 * SECOND, 14 * SECOND, 1)


@reaches("excerpt-range-short")
def excerpt_from_within_a_hole_in_front_of_a_gap(world):
    return excerpt_of(world, pausing(world, (13, 15), again=3, gap_at=3), 11 * SECOND, 14 * SECOND, 1)


@reaches("gap")
def excerpt_from_within_a_gap(world):
    return excerpt_of(world, pausing(world, (5, 15), again=3, gap_at=3), 11 * SECOND, 14 * SECOND, 1, never=SHORT)


@reaches("gap")
def excerpt_from_behind_a_gap(world):
    return excerpt_of(world, pausing(world, (5, 15), again=3, gap_at=3), 16 * SECOND, 19 * SECOND, 0, never=SHORT)


@reaches("gap")
def excerpt_of_a_gap_until_the_end(world):
    return excerpt_of(world, pausing(world, (5, 30), gap_at=5), 12 * SECOND, 28 * SECOND, 1, never=SHORT)


@reaches("gap", "stream-ends-early")
def excerpt_from_behind_a_gap_that_ends_too_soon(world):
    return excerpt_of(world, pausing(world, (5, 15), gap_at=4), 16 * SECOND, 19 * SECOND, 0)


@reaches()
def excerpt_of_the_last_seconds(world):
    """A recorder may have nothing of the last 10 s."""
    case = world.begin()
    world.record(case, 0, 2)
    case.checkpoint()
    case.token(world.outside, 10_100 * MS, gen_ns=10_090 * MS)
    world.record(case, 2, 3)
    world.record(case, 3, 4, ("vitals",))
    return excerpt_of(world, world.end(case, 20_040 * MS), 14 * SECOND, 19 * SECOND, 0)


def late(world, *stated):
    """A camera that begins at 10 s, and the gaps of it that are stated before."""
    case = world.begin()
    for start, end in stated:
        case.add("gap", 5 * SECOND + 10 * MS, stream="endoscope", start_ns=start * SECOND, end_ns=end * SECOND, cause="signal-lost")
    world.record(case, 0, 2, ("vitals",))
    case.checkpoint()
    case.token(world.outside, 10_100 * MS, gen_ns=10_090 * MS)
    for i in range(2, 4):
        case.segment("vitals", i, 5 * i * SECOND, 5 * (i + 1) * SECOND, world.seal(f"vitals {i}", f"vitals {i}\n".encode()), 5)
        case.segment("endoscope", i - 2, 5 * i * SECOND, 5 * (i + 1) * SECOND, world.seal(f"endoscope {i}", f"endoscope {i}\n".encode()), 125)
    return world.end(case, 20_040 * MS)


@reaches("stream-begins-late")
def excerpt_of_a_camera_that_begins_late(world):
    return excerpt_of(world, late(world), 6 * SECOND, 14 * SECOND, None)


@reaches("excerpt-range-short")
def excerpt_that_does_not_show_why_a_camera_begins_late(world):
    return excerpt_of(world, late(world, (0, 10)), 6 * SECOND, 14 * SECOND, 1, streams=("endoscope",))


@reaches("gap")
def excerpt_of_a_camera_that_begins_behind_a_gap(world):
    return excerpt_of(world, late(world, (0, 10)), 6 * SECOND, 14 * SECOND, 0, never=SHORT)


def one_alone(world):
    case = world.begin()
    world.record(case, 0, 2, ("endoscope",))
    case.checkpoint()
    case.token(world.outside, 10_100 * MS, gen_ns=10_090 * MS)
    world.record(case, 2, 4, ("endoscope",))
    return world.end(case, 20_040 * MS)


@reaches("stream-empty")
def excerpt_of_a_monitor_that_never_was_there(world):
    return excerpt_of(world, one_alone(world), 6 * SECOND, 14 * SECOND, None)


@reaches("excerpt-range-short")
def excerpt_that_does_not_show_why_a_monitor_was_not_there(world):
    return excerpt_of(world, one_alone(world), 11 * SECOND, 14 * SECOND, 1)


@reaches("stream-shorter")
def excerpt_of_time_behind_a_file(world):
    case = world.begin(streams=world.streams(endoscope="source"))
    world.record(case, 0, 1)
    world.record(case, 1, 4, ("vitals",))
    return excerpt_of(world, world.end(case, 20_040 * MS), 3 * SECOND, 9 * SECOND, 0)


@reaches()
def excerpt_of_a_file(world):
    case = world.begin(streams=world.streams(endoscope="source"))
    world.record(case, 0, 1)
    world.record(case, 1, 4, ("vitals",))
    return excerpt_of(world, world.end(case, 20_040 * MS), 2 * SECOND, 5 * SECOND, 0)


@reaches("stream-begins-late")
def excerpt_of_time_said_to_be_recorded_ahead(world):
    return excerpt_of(world, ahead(world), SECOND, 3610 * SECOND, None)


@reaches("excerpt-range-short")
def excerpt_of_time_said_to_be_recorded_ahead_without_its_beginning(world):
    return excerpt_of(world, ahead(world), SECOND, 3610 * SECOND, 0)


@reaches("totals-differ")
def excerpt_of_all_lines_with_other_totals(world):
    case = world.sound()
    case.find("close").fields["totals"]["vitals"]["frames"] += 1
    return excerpt_of(world, case, 6 * SECOND, 9 * SECOND, None)


def excerpt_of_totals(world, **less):
    """Of the case's second half; `close` states less of both streams than its lines show."""
    case = world.sound()
    for name in ("endoscope", "vitals"):
        case.find("close").fields["totals"][name] |= less
    return excerpt_of(world, case, 10 * SECOND, 20 * SECOND, 1)


@reaches("totals-differ")
def excerpt_whose_totals_are_those_of_its_lines(world):
    return excerpt_of_totals(world, segments=2)


@reaches("totals-differ")
def excerpt_whose_totals_have_fewer_frames_than_its_lines(world):
    return excerpt_of_totals(world, frames=9)


@reaches("totals-differ")
def excerpt_whose_totals_leave_a_stream_out(world):
    case = world.sound()
    del case.find("close").fields["totals"]["vitals"]
    return excerpt_of(world, case, 10 * SECOND, 20 * SECOND, 1, streams=("endoscope",))


@reaches()
def excerpt_of_the_second_half(world):
    return world.given(excerpt_of(world, world.sound(), 10 * SECOND, 20 * SECOND, 1).path, never=["totals-differ"])


@reaches("segments-erased")
def excerpt_of_what_was_erased(world):
    def change(document, files):
        for i in (0, 1):
            files.pop(f"segments/vitals/{i:08d}.jsonl.age", None)
    written = erased(world, removed=False).write(world.folder / "whole")
    return world.given(w.write_excerpt(written, world.folder / "excerpt", 3 * SECOND, 18 * SECOND, ["endoscope", "vitals"], 2, len(written.lines), change=change))


@reaches()
def excerpt_that_goes_on_behind_the_end(world):
    return excerpt_of(world, world.sound(), 6 * SECOND, 36_000 * SECOND, 0)


@reaches("segment-out-of-order")
def excerpt_from_open_on_without_a_first_segment(world):
    case = world.sound()
    for step in case.of(Entry):
        if step.type == "segment" and step.fields["stream"] == "vitals":
            step.fields["index"] += 1
            name = step.fields["file"]
            step.fields |= case.file(f"segments/vitals/{step.fields['index']:08d}.jsonl.age", world.seal(name, name.encode()))
    return excerpt_of(world, case, 6 * SECOND, 9 * SECOND, None)


@reaches("gap-beyond-end")
def excerpt_with_a_gap_beyond_the_end(world):
    case = world.sound()
    at = case.steps.index(case.find("close"))
    case.steps.insert(at, Entry("gap", case.steps[at].mono_ns, {"stream": "vitals", "start_ns": 20 * SECOND, "end_ns": 36_000 * SECOND, "cause": "signal-lost"}))
    return excerpt_of(world, case, 6 * SECOND, 9 * SECOND, 0)


@reaches("rekeyed-not-opened")
def rekeyed(world, key_differs=False, identity=None):
    reader = age.Identity(bytes([5] * 32))

    def change(document, files):
        name = "segments/endoscope/00000001.ts.age"
        sealed = files[name]
        end = sealed.index(b"\n", sealed.index(b"\n---") + 1) + 1
        files[name + ".header"] = sealed[:end]
        files[name] = age.header(bytes(16), [reader.public], [bytes([7] * 32)]) + sealed[end:]
    return excerpt(world, change=change, identity=identity)


@reaches("rekeyed-key-differs")
def rekeyed_to_another_film(world):
    return rekeyed(world, identity=str(age.Identity(bytes([5] * 32))))


@reaches("outside-note-unchecked")
def excerpt_against_a_later_note(world):
    written = world.sound().write(world.folder / "again")
    return excerpt(world, size=7, from_ns=SECOND, to_ns=2 * SECOND, first=1, against=kept(world, written.notes[max(written.notes)]))


@reaches("file-missing")
def excerpt_without_its_segment(world):
    def change(document, files):
        del files["segments/endoscope/00000001.ts.age"]
    return excerpt(world, change=change)


@reaches("file-unnamed")
def excerpt_with_too_much(world):
    def change(document, files):
        files["segments/endoscope/00000003.ts.age"] = b"x"
        files["subject.json.age"] = b"x"
    return excerpt(world, change=change)


# -- a device that signs by Ed25519 and ML-DSA-65


def both(world, since=0):
    """The world of a device that has an ML-DSA key, since its log had so many entries."""
    return dataclasses.replace(world, device=dataclasses.replace(world.device, ml_dsa_seed=bytes([9] * 32), since=since))


def by_both(world, given):
    """Judged by whoever knows the ML-DSA key."""
    return dataclasses.replace(given, devices=[world.device.identity])


def alone(world):
    """The same device before, or in the hand of whoever can forge Ed25519."""
    return dataclasses.replace(world, device=dataclasses.replace(world.device, ml_dsa_seed=None))


def without_ml_dsa(data):
    return b"".join(line for line in data.splitlines(True) if b"/ml-dsa-65 " not in line)


@reaches()
def signed_by_both(world):
    world = both(world)
    return by_both(world, world.given(world.sound().write(world.folder).folder))


@reaches()
def signed_by_both_beside_its_log(world):
    world = both(world)
    return by_both(world, with_log(world))


@reaches("checkpoint-ml-dsa-unchecked")
def signed_by_both_to_one_who_knows_one_key(world):
    written = both(world).sound().write(world.folder)
    return world.given(written.folder, devices=[alone(world).device.key])


@reaches("checkpoint-ml-dsa-missing")
def an_ml_dsa_signature_taken_away(world):
    world = both(world)
    case = world.sound()
    case.of(Checkpoint)[1].change = without_ml_dsa
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-ml-dsa-missing")
def a_case_by_ed25519_alone(world):
    written = alone(world).sound().write(world.folder)
    return by_both(both(world), world.given(written.folder))


@reaches("checkpoint-ml-dsa-missing")
def a_case_of_later_by_ed25519_alone(world):
    written = alone(world).sound(log_state=(8, "0" * 64)).write(world.folder)
    return by_both(both(world, 7), world.given(written.folder))


@reaches("checkpoint-ml-dsa-missing")
def a_case_that_falls_back_to_ed25519(world):
    world = both(world, 7)
    case = world.sound()
    for step in case.of(Checkpoint)[2:]:
        step.signer = alone(world).device
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-signature-invalid")
def an_ml_dsa_signature_of_another_text(world):
    world = both(world)
    case = world.sound()

    def change(data):
        other = world.device.line(b"another text\n").splitlines(True)[1]
        return without_ml_dsa(data) + other
    case.of(Checkpoint)[1].change = change
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-signature-invalid")
def an_ml_dsa_signature_by_another_key(world):
    world = both(world)
    case = world.sound()
    case.of(Checkpoint)[1].signer = dataclasses.replace(world.device, ml_dsa_seed=bytes([8] * 32))
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-not-by-both")
def a_case_from_before_the_ml_dsa_key(world):
    written = alone(world).sound(log_state=(5, "0" * 64)).write(world.folder)
    return by_both(both(world, 7), world.given(written.folder))


def upgraded(world, change=lambda log, written: None, signer=None):
    """A case from before the device had its ML-DSA key, and the log that states that key behind it."""
    new = both(world, 4)

    def add(log, written):
        log.signed("device-ml-dsa-added", 90 * SECOND, ml_dsa=new.device.key.ml_dsa_text)
        log.of(Checkpoint)[-1].signer = signer or new.device
        change(log, written)
    return by_both(new, with_log(alone(world), add))


@reaches()
def a_case_from_before_by_the_log_that_goes_on(world):
    return upgraded(world)


@reaches()
def the_log_that_goes_on(world):
    given = upgraded(world)
    return dataclasses.replace(given, path=given.log, log=None, as_log=True)


@reaches("log-checkpoint-differs")
def a_case_from_before_that_is_not_the_logs(world):
    def change(log, written):
        log.find("case-closed").fields["root"] = "0" * 64
    return upgraded(world, change)


@reaches("checkpoint-ml-dsa-missing")
def the_log_that_goes_on_by_ed25519_alone(world):
    given = upgraded(world, signer=alone(world).device)
    return dataclasses.replace(given, path=given.log, log=None, as_log=True)


@reaches("checkpoint-not-by-both")
def the_log_cut_back_to_before_the_ml_dsa_key(world):
    given = the_log(alone(world))
    return by_both(both(world, 4), given)


@reaches("device-ml-dsa-differs")
def a_log_that_states_another_ml_dsa_key(world):
    other = dataclasses.replace(both(world).device, ml_dsa_seed=bytes([8] * 32))

    def change(log, written):
        log.find("device-ml-dsa-added").fields["ml_dsa"] = other.key.ml_dsa_text
    given = upgraded(world, change)
    return dataclasses.replace(given, path=given.log, log=None, as_log=True)


@reaches("device-invalid")
def a_log_that_states_no_ml_dsa_key(world):
    def change(log, written):
        log.find("device-ml-dsa-added").fields["ml_dsa"] = "or3"
    given = upgraded(world, change)
    return dataclasses.replace(given, path=given.log, log=None, as_log=True)


@reaches("outside-note-not-by-both")
def a_forged_note_of_more_entries(world):
    world = both(world)
    written = world.sound().write(world.folder)
    forged = alone(world).device.checkpoint(written.case.origin, len(written.lines) + 5, bytes(32))
    return by_both(world, world.given(written.folder, against=kept(world, forged)))


@reaches("outside-note-not-by-both")
def a_forged_note_of_other_entries(world):
    world = both(world)
    written = world.sound().write(world.folder)
    forged = alone(world).device.checkpoint(written.case.origin, max(written.notes), bytes(32))
    return by_both(world, world.given(written.folder, against=kept(world, forged)))


@reaches("outside-note-holds")
def a_kept_note_without_its_ml_dsa_signature(world):
    world = both(world)
    written = world.sound().write(world.folder)
    return by_both(world, world.given(written.folder, against=kept(world, without_ml_dsa(written.notes[max(written.notes)]))))


@reaches("log-proof-holds")
def a_proof_by_both(world):
    world = both(world)
    return by_both(world, by_proof(world, with_log(world)))


@reaches("log-proof-not-used")
def a_proof_without_its_ml_dsa_signature(world):
    world = both(world)

    def change(parts):
        parts["signed"] = without_ml_dsa(parts["signed"])
    return by_both(world, by_proof(world, with_log(world), change))


@reaches("log-proof-holds")
def a_case_from_before_by_a_proof(world):
    new = both(world, 4)
    return by_both(new, by_proof(new, upgraded(world)))


@reaches("checkpoint-not-by-both")
def an_excerpt_from_before_the_ml_dsa_key(world):
    return by_both(both(world, 7), excerpt(alone(world)))


@reaches()
def an_excerpt_signed_by_both(world):
    world = both(world)
    return by_both(world, excerpt(world))


# -- a device whose hardware signs, too


def hard(world, since=0):
    """The world of a device with a key in hardware, since its log had so many entries."""
    return dataclasses.replace(world, device=dataclasses.replace(world.device, hardware_seed=bytes([7] * 32), hardware_since=since))


def copied(world):
    """The same device in the hand of somebody who copied the keys that are files, or while its hardware is silent."""
    return dataclasses.replace(world, device=dataclasses.replace(world.device, hardware_seed=None))


def without_hardware(data):
    return b"".join(line for line in data.splitlines(True) if b"/ecdsa-p256 " not in line)


@reaches()
def signed_by_hardware(world):
    world = hard(world)
    return by_both(world, world.given(world.sound().write(world.folder).folder))


@reaches()
def signed_by_hardware_and_ml_dsa_beside_its_log(world):
    world = hard(both(world))
    return by_both(world, with_log(world))


@reaches("checkpoint-hardware-unchecked")
def signed_by_hardware_to_one_who_knows_one_key(world):
    written = hard(world).sound().write(world.folder)
    return world.given(written.folder, devices=[copied(world).device.key])


@reaches("checkpoint-not-by-hardware")
def a_case_by_a_copied_key(world):
    written = copied(world).sound().write(world.folder)
    return by_both(hard(world), world.given(written.folder))


@reaches("checkpoint-not-by-hardware")
def a_case_by_copied_keys_both(world):
    world = both(world)
    written = copied(world).sound().write(world.folder)
    return by_both(hard(world), world.given(written.folder))


@reaches("checkpoint-not-by-hardware")
def a_case_that_a_copied_key_carries_on(world):
    world = hard(world)
    case = world.sound()
    for step in case.of(Checkpoint)[2:]:
        step.signer = copied(world).device
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-hardware-missing")
def hardware_that_was_silent_for_a_while(world):
    world = hard(world)
    case = world.sound()
    case.of(Checkpoint)[1].change = without_hardware
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-signature-invalid")
def a_signature_by_other_hardware(world):
    world = hard(world)
    case = world.sound()
    case.of(Checkpoint)[1].signer = dataclasses.replace(world.device, hardware_seed=bytes([8] * 32))
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-signature-invalid")
def a_signature_by_hardware_of_another_text(world):
    world = hard(world)
    case = world.sound()

    def change(data):
        return without_hardware(data) + world.device.line(b"another text\n").splitlines(True)[1]
    case.of(Checkpoint)[1].change = change
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-ml-dsa-missing")
def hardware_does_not_stand_for_ml_dsa(world):
    world = hard(both(world))
    case = world.sound()
    case.of(Checkpoint)[1].change = without_ml_dsa
    return by_both(world, world.given(case.write(world.folder).folder))


@reaches("checkpoint-not-by-hardware")
def a_case_from_before_the_hardware(world):
    written = copied(world).sound(log_state=(5, "0" * 64)).write(world.folder)
    return by_both(hard(world, 7), world.given(written.folder))


def with_hardware_added(world, change=lambda log, written: None, signer=None, root=None):
    """A case from before the device had its key in hardware, and the log that states that key behind it.

    `root`: of the log's first four lines, by the identity, where it is not theirs.
    """
    new = hard(world, 4)

    def add(log, written):
        log.signed("device-hardware-added", 90 * SECOND, hardware=new.device.key.hardware_text)
        log.of(Checkpoint)[-1].signer = signer or new.device
        change(log, written)
    given = with_log(copied(world), add)
    return by_both(knowing_the_log_before(new, given, root), given)


def knowing_the_log_before(world, given, root=None):
    """The device with the identity that states what its log was before it had a key in hardware."""
    lines = (given.log / "ledger.jsonl").read_bytes().split(b"\n")[:world.device.hardware_since]
    root = root or merkle.root([merkle.leaf(line) for line in lines])
    return dataclasses.replace(world, device=dataclasses.replace(world.device, log_root_before_hardware=root))


@reaches("checkpoint-not-by-hardware")
def a_case_that_a_copied_key_put_before_the_hardware(world):
    """The whole log is made anew by copied keys, up to the hardware; the recorder then goes on in it, and its hardware signs."""
    return with_hardware_added(world, root=hashlib.sha256(b"the log at the ceremony").digest())


@reaches()
def a_case_from_before_the_hardware_by_the_log_that_goes_on(world):
    return with_hardware_added(world)


@reaches("checkpoint-not-by-hardware")
def a_case_from_before_the_hardware_by_a_log_that_a_copied_key_carries_on(world):
    return with_hardware_added(world, signer=copied(world).device)


@reaches()
def a_case_from_before_the_hardware_by_the_log_of_a_device_that_changed_its_key_since(world):
    other = note.Signer("or3", bytes([9] * 32))

    def change(log, written):
        log.signed("device-key-changed", 95 * SECOND, device=str(other.key))
        _sign_last(log, other)
    given = with_hardware_added(world, change)
    return dataclasses.replace(given, devices=[*given.devices, other.key])


@reaches("checkpoint-not-by-hardware")
def a_case_by_a_copied_key_that_the_log_ends(world):
    """The hardware signs what the log had when it began to; a line behind that speaks for no case."""
    given = with_log(copied(world), lambda log, written: _sign_last(log, hard(world).device))
    return by_both(knowing_the_log_before(hard(world, 1), given), given)


def _sign_last(log, signer):
    log.of(Checkpoint)[-1].signer = signer


@reaches("device-hardware-differs")
def a_log_that_states_other_hardware(world):
    other = dataclasses.replace(hard(world).device, hardware_seed=bytes([8] * 32))

    def change(log, written):
        log.find("device-hardware-added").fields["hardware"] = other.key.hardware_text
    given = with_hardware_added(world, change)
    return dataclasses.replace(given, path=given.log, log=None, as_log=True)


@reaches("device-invalid")
def a_log_that_states_no_hardware(world):
    def change(log, written):
        log.find("device-hardware-added").fields["hardware"] = "or3/ecdsa-p256+00000000+Ag=="
    given = with_hardware_added(world, change)
    return dataclasses.replace(given, path=given.log, log=None, as_log=True)


@reaches("outside-note-not-by-both")
def a_note_by_a_copied_key_of_other_entries(world):
    world = hard(world)
    written = world.sound().write(world.folder)
    forged = copied(world).device.checkpoint(written.case.origin, max(written.notes), bytes(32))
    return by_both(world, world.given(written.folder, against=kept(world, forged)))


@reaches("log-proof-holds")
def a_proof_by_hardware(world):
    world = hard(world)
    return by_both(world, by_proof(world, with_log(world)))


@reaches("checkpoint-not-by-hardware", "log-proof-holds")
def a_proof_by_hardware_of_a_case_from_before(world):
    """It shows that the log has the case's end among its first lines, and not that the log was so at the ceremony."""
    new = hard(world, 4)
    given = with_log(copied(world))
    new = knowing_the_log_before(new, given)
    return by_both(new, by_proof(new, given))


@reaches("log-proof-not-used")
def a_proof_by_a_copied_key(world):
    world = hard(world)

    def change(parts):
        parts["signed"] = without_hardware(parts["signed"])
    return by_both(world, by_proof(world, with_log(world), change))


@reaches()
def an_excerpt_signed_by_hardware(world):
    world = hard(world)
    return by_both(world, excerpt(world))


@reaches("checkpoint-not-by-hardware")
def an_excerpt_by_a_copied_key(world):
    return by_both(hard(world), excerpt(copied(world)))


# -- a device whose TPM quotes the boot


def quoted(world, change=lambda log, tpm: None, tpm=None, stated=None, **more):
    """The log of a device whose TPM quotes: its key is stated, then the machine starts twice more; `change` goes on from there."""
    tpm = tpm or tpm_quote.Forger()

    def add(log, written):
        attested(log, 90 * SECOND, tpm, stated)
        another_boot(log, tpm, 2)
        another_boot(log, tpm, 3)
        change(log, tpm)
        log.signed("shutdown", 5 * SECOND)
    return the_log(world, add, **more)


def with_quote(log, entry, tpm, boot_id):
    """The entry with the quote that the TPM makes now of its boot, for the place where it will stand."""
    device, tpm = str(log.signer.key), dataclasses.replace(tpm)
    entry.made = lambda size, root: tpm.quote(tpm_quote.qualifying_data(device, size, root, boot_id))
    return entry


def attested(log, mono_ns, tpm, stated=None):
    """The attestation key is stated, with a quote of the boot of now."""
    entry = log.add("device-attestation-added", mono_ns, attestation=stated or tpm.stated)
    return with_quote(log, entry, tpm, boots_of(log)[-1].fields["boot_id"])


def boot_fields(log, number):
    return {"boot_id": w.BOOT_ID[:-1] + str(number), "device": str(log.signer.key)}


def another_boot(log, tpm, number, **start):
    tpm.boot(**start)
    fields = boot_fields(log, number)
    return with_quote(log, log.add("boot", 0, **fields), tpm, fields["boot_id"])


def with_fields(entry, **changed):
    """The entry with other fields than the TPM gave."""
    made = entry.made
    entry.made = lambda size, root: {**made(size, root), **changed}


def boots_of(log):
    return [step for step in log.steps if isinstance(step, Entry) and step.type == "boot"]


@reaches("boot-quotes-hold")
def boots_that_are_quoted(world):
    given = quoted(world)
    given.never = ["measured-boot-changed", "boots-not-entered", "boot-not-quoted", "boot-quote-missing", "boot-not-measured", "boot-without-reset"]
    return given


@reaches()
def a_case_beside_a_log_with_quotes(world):
    """Of a case its log tells no more than it did before."""
    log = quoted(world)
    case = next(path for path in world.folder.iterdir() if (path / "segments").exists())
    return dataclasses.replace(log, path=case, log=log.path, as_log=False, never=["boot-quotes-hold"])


@reaches("log-not-sound")
def a_quote_replayed_in_a_case_s_log(world):
    """What was forged in the log is told of the case, too."""
    given = quoted(world, lambda log, tpm: replay(log))
    case = next(path for path in world.folder.iterdir() if (path / "segments").exists())
    return dataclasses.replace(given, path=case, log=given.path, as_log=False)


def replay(log):
    """The newest boot with the quote of the one before."""
    *_, before, newest = boots_of(log)
    kept = {}
    made = before.made
    before.made = lambda size, root: kept.setdefault("quote", made(size, root))
    newest.made = lambda size, root: kept["quote"]


@reaches("boot-quote-of-elsewhere")
def a_quote_of_another_boot(world):
    return quoted(world, lambda log, tpm: replay(log))


@reaches("boot-quote-of-elsewhere")
def a_quote_of_another_device_s_log(world):
    def change(log, tpm):
        newest, stranger = boots_of(log)[-1], str(world.stranger.key)
        newest.made = lambda size, root: tpm.quote(tpm_quote.qualifying_data(stranger, size, root, newest.fields["boot_id"]))
    return quoted(world, change)


@reaches("boot-quote-of-elsewhere")
def lines_changed_before_a_quote(world):
    """Somebody with the device's key signs another history in which the TPM's quote is to stand."""
    def change(log, tpm):
        newest = boots_of(log)[-1]
        newest.made = lambda size, root: tpm.quote(tpm_quote.qualifying_data(newest.fields["device"], size, bytes(32), newest.fields["boot_id"]))
    return quoted(world, change)


@reaches("boot-quote-signature-invalid")
def a_quote_by_another_key(world):
    def change(log, tpm):
        other = dataclasses.replace(tpm, seed=bytes([6] * 32))
        newest = boots_of(log)[-1]
        newest.made = lambda size, root: other.quote(tpm_quote.qualifying_data(newest.fields["device"], size, root, newest.fields["boot_id"]))
    return quoted(world, change)


@reaches("boot-quote-signature-invalid")
def a_quote_without_a_key(world):
    def change(log, written):
        another_boot(log, tpm_quote.Forger(), 2)
        log.signed("shutdown", 5 * SECOND)
    return the_log(world, change)


@reaches("boot-quote-signature-invalid")
def a_quote_whose_signature_is_none(world):
    return quoted(world, lambda log, tpm: with_fields(boots_of(log)[-1], quote_signature="AAAA"))


@reaches("boot-pcrs-differ")
def registers_that_were_not_quoted(world):
    return quoted(world, lambda log, tpm: with_fields(boots_of(log)[-1], pcrs=[f"{index}:{bytes([index + 1] * 32).hex()}" for index in (*range(10), 15)]))


@reaches("boot-pcrs-differ")
def values_that_were_not_quoted(world):
    return quoted(world, lambda log, tpm: with_fields(boots_of(log)[-1], pcrs=[f"{index}:{bytes([index or 99] * 32).hex()}" for index in (*range(10), 14)]))


@reaches("boot-quote-malformed")
def registers_out_of_their_order(world):
    return quoted(world, lambda log, tpm: with_fields(boots_of(log)[-1], pcrs=[f"{index}:{bytes([index + 1] * 32).hex()}" for index in (14, *range(10))]))


def _quote_changed(change):
    def with_change(world):
        def spoil(log, tpm):
            newest = boots_of(log)[-1]
            made = newest.made

            def spoiled(size, root):
                fields = made(size, root)
                attest = change(bytearray(note.from_base64(fields["quote"])))
                return {**fields, "quote": base64.b64encode(attest).decode(), "quote_signature": base64.b64encode(tpm.sign(bytes(attest))).decode()}
            newest.made = spoiled
        return quoted(world, spoil)
    return with_change


def _byte(at, value):
    def change(attest):
        attest[at] = value
        return attest
    return change


# Where in a TPMS_ATTEST: 0 magic, 4 type, 6 name (2 + 34), 42 qualifying data (2 + 32), 76 clock, 84 resets, 88 restarts, 92 safe, 93 firmware,
# 101 banks, 105 hash, 107 bytes of the selection, 108 these, 111 digest.
for _name, _change in {"a_quote_cut_short": lambda attest: attest[:-1], "a_quote_with_more_behind_it": lambda attest: attest + b"\0", "an_empty_quote": lambda attest: b"",
                       "a_quote_that_no_tpm_made": _byte(0, 0), "another_attestation_than_a_quote": _byte(5, 0x17), "a_quote_with_a_huge_name": _byte(6, 0xFF),
                       "a_quote_that_is_neither_safe_nor_unsafe": _byte(92, 2), "a_quote_of_two_banks": _byte(104, 2), "a_quote_of_another_bank": _byte(106, 4),
                       "a_quote_of_more_registers_than_there_are": _byte(107, 4), "a_quote_with_a_shorter_digest": _byte(112, 31)}.items():
    ALL.append((_name, ("boot-quote-malformed",), _quote_changed(_change)))


ALL.append(("a_quote_by_that_key_elsewhere_in_the_tpm", ("boot-quote-signature-invalid",), _quote_changed(_byte(20, 0xAA))))


@reaches("boot-quote-malformed")
def a_quote_that_is_no_base64(world):
    return quoted(world, lambda log, tpm: with_fields(boots_of(log)[-1], quote="é"))


@reaches("entry-malformed")
def a_quote_beside_a_word_why_there_is_none(world):
    return quoted(world, lambda log, tpm: with_fields(boots_of(log)[-1], no_quote="no TPM"))


@reaches("boot-clock-went-back")
def fewer_resets_than_before(world):
    return quoted(world, lambda log, tpm: another_boot(log, tpm, 4, resets=-1))


@reaches("boot-clock-went-back")
def fewer_restarts_than_before(world):
    def change(log, tpm):
        tpm.restarts += 1
        another_boot(log, tpm, 4, resets=0, restarts=tpm.restarts)
        another_boot(log, tpm, 5, resets=0, restarts=tpm.restarts - 1)
    return quoted(world, change)


@reaches("boot-clock-went-back")
def a_safe_clock_that_went_back(world):
    return quoted(world, lambda log, tpm: another_boot(log, dataclasses.replace(tpm, clock_ms=-4999), 4))


@reaches("boot-quotes-hold")
def a_clock_that_lost_time_with_its_power(world):
    """It says itself that it is not safe."""
    given = quoted(world, lambda log, tpm: another_boot(log, dataclasses.replace(tpm, clock_ms=-4999, safe=0), 4))
    given.never = ["boot-clock-went-back"]
    return given


@reaches("measured-boot-changed")
def another_boot_loader(world):
    return quoted(world, lambda log, tpm: another_boot(log, tpm, 4, pcr4=b"another boot loader"))


@reaches("measured-boot-changed")
def other_registers_than_before(world):
    def change(log, tpm):
        tpm.pcrs = {index: value for index, value in tpm.pcrs.items() if index != 14}
        another_boot(log, tpm, 4)
    return quoted(world, change)


@reaches("boots-not-entered")
def boots_without_the_recorder(world):
    return quoted(world, lambda log, tpm: another_boot(log, tpm, 4, resets=3))


@reaches("boot-not-quoted")
def a_boot_that_the_tpm_did_not_quote(world):
    def change(log, tpm):
        tpm.boot()
        log.add("boot", 0, **boot_fields(log, 4), no_quote="the TPM did not answer")
        another_boot(log, tpm, 5)
    given = quoted(world, change)
    given.never = ["boot-quote-missing", "boots-not-entered"]
    return given


@reaches("boot-not-measured")
def registers_into_which_nothing_was_measured(world):
    """The firmware uses another bank: whoever starts the machine puts in what they like."""
    return quoted(world, lambda log, tpm: another_boot(log, tpm, 4), tpm=tpm_quote.Forger(pcrs={index: bytes(32) for index in (*range(10), 14)}))


@reaches("boot-not-measured")
def registers_of_which_one_is_empty(world):
    return quoted(world, tpm=tpm_quote.Forger(pcrs={index: bytes([(index != 7) * (index + 1)] * 32) for index in (*range(10), 14)}))


@reaches("boot-not-measured")
def registers_that_no_firmware_measures_into(world):
    return quoted(world, tpm=tpm_quote.Forger(pcrs={14: bytes([1] * 32), 16: bytes([2] * 32)}))


@reaches("boot-without-reset")
def another_kernel_out_of_the_running_one(world):
    """kexec: the registers tell of the kernel before."""
    given = quoted(world, lambda log, tpm: another_boot(log, tpm, 4, resets=0))
    given.never = ["measured-boot-changed", "boots-not-entered"]
    return given


@reaches("boot-quotes-hold")
def a_machine_that_woke_up(world):
    """A TPM restart is a start."""
    given = quoted(world, lambda log, tpm: another_boot(log, tpm, 4, resets=0, restarts=8))
    given.never = ["boot-without-reset"]
    return given


@reaches("boot-not-quoted")
def boots_without_a_quote_under_another_device_key(world):
    """With its key the device loses the attestation key; what it starts from then on nobody quotes."""
    def change(log, tpm):
        log.signed("device-key-changed", 5 * SECOND, device=str(log.signer.key))
        log.add("boot", 0, **boot_fields(log, 4))
    given = quoted(world, change)
    given.never = ["boot-quote-missing"]
    return given


@reaches("boot-quote-missing")
def a_boot_whose_quote_was_taken_away(world):
    return quoted(world, lambda log, tpm: log.add("boot", 0, **boot_fields(log, 4)))


@reaches("device-attestation-differs")
def a_second_attestation_key(world):
    def change(log, tpm):
        attested(log, 0, dataclasses.replace(tpm, seed=bytes([6] * 32)))
    return quoted(world, change)


@reaches("boot-quotes-hold")
def another_key_of_the_device_with_another_tpm(world):
    """Of another device in the same log another TPM quotes."""
    other = note.Signer("or3", bytes([9] * 32))

    def change(log, tpm):
        for step in log.of(Checkpoint):
            step.signer = world.device
        log.signer = other
        log.signed("device-key-changed", 0, device=str(other.key))
        tpm = tpm_quote.Forger(bytes([6] * 32))
        attested(log, 0, tpm)
        another_boot(log, tpm, 4)
    given = quoted(world, change)
    return dataclasses.replace(given, devices=[*given.devices, other.key], never=["device-attestation-differs", "boot-quote-signature-invalid"])


@reaches("device-invalid")
def an_attestation_key_that_signs_anything(world):
    return quoted(world, tpm=tpm_quote.Forger(attributes=tpm_quote.Forger().attributes & ~(1 << 16)))


@reaches("device-invalid")
def an_attestation_key_that_is_none(world):
    return quoted(world, stated="AAAA")


@reaches("boot-quote-missing")
def an_attestation_key_that_no_quote_follows(world):
    """The recorder's log was carried on by a program from before."""
    def change(log, tpm):
        for step in boots_of(log)[1:]:
            step.made = None
    return quoted(world, change)
