"""What may at most be said of an edited folder, known from the edit alone: from the folder before and after it, and from
who held which key. It shares no rule with the verifier: it compares bytes, and adds up what the lines say."""
import dataclasses
import functools
import hashlib
import json
import pathlib
import re

import beside
import stamp
import tree as t
from case_writer import MS, SECOND
from grammar import LATER_NS

INTACT = ("intact", "intact-with-gaps", "intact-excerpt")
EXIT_OF = {"intact": 0, "intact-with-gaps": 0, "tampered": 1, "incomplete": 3, "unproven": 3, "intact-excerpt": 4}
MOST_SECONDS, MOST_MEGABYTES = 2.0, 200


@dataclasses.dataclass
class Said:
    """What the program said, and what it took for it."""
    report: dict
    exit_status: int
    seconds: float
    megabytes: float

    @property
    def verdict(self):
        return self.report["verdict"]

    @property
    def codes(self):
        return {finding["code"] for finding in self.report["findings"]}


@dataclasses.dataclass
class Edited:
    """A folder after its edits. `signed_lines` are those of the ledger, of the whole case also for an excerpt, where the
    device's key signed them anew; `tokens` is what became of tokens then."""
    base: object
    tree: t.Tree
    signed_lines: list | None = None
    tokens: str = "kept"
    with_log: bool = False
    against: bool = False

    @property
    def recorded(self):
        """The lines as they were recorded, of the whole case."""
        return self.base.lines

    @property
    def whole_lines(self):
        return self.signed_lines if self.signed_lines is not None else self.recorded


def _lines(node):
    """None where a ledger is no file of whole lines."""
    if not isinstance(node, bytes) or (node and not node.endswith(b"\n")):
        return None
    return node.split(b"\n")[:-1]


def _parsed(lines):
    try:
        entries = [json.loads(line) for line in lines]
    except ValueError:
        return None
    return entries if all(isinstance(e, dict) and "type" in e for e in entries) else None


def _same(one, other):
    """How many lines two ledgers have in common from the beginning."""
    for number, (a, b) in enumerate(zip(one, other)):
        if a != b:
            return number
    return min(len(one), len(other))


def objections(edited, said):
    """Sentences about what was said and must not be."""
    found = list(_of_the_run(said))
    if edited.base.form == "log":
        found += _of_a_log(edited, said)
    elif "excerpt.json" in edited.tree and "ledger.jsonl" not in edited.tree:
        found += _of_an_excerpt(edited, said)
    else:
        found += _of_a_case(edited, said)
    found += _of_nodes(edited, said)
    if edited.base.form != "log":
        found += _of_time(edited, said)
    found += _of_evidence(edited, said)
    return found


def _of_the_run(said):
    if said.exit_status != EXIT_OF[said.verdict]:
        yield f"exit status {said.exit_status} of {said.verdict}"
    if said.seconds > MOST_SECONDS:
        yield f"took {said.seconds:.1f} s of a processor"
    if said.megabytes > MOST_MEGABYTES:
        yield f"took {said.megabytes:.0f} MB"


def _of_nodes(edited, said):
    if said.verdict not in INTACT:
        return
    for path, node in edited.tree.items():
        if not path.startswith(("../", "authorities/", "device.pub")) and not isinstance(node, bytes) and node is not t.FOLDER:
            yield f"{said.verdict}, where {path} is {node!r}"
        if path.startswith("segments/") and path not in edited.base.tree and edited.signed_lines is None and not path.endswith(".part"):
            yield f"{said.verdict}, where {path} was put there"


def _holds(tree, entry):
    data = tree.get(entry["file"])
    return isinstance(data, bytes) and len(data) == entry.get("bytes", len(data)) and hashlib.sha256(data).hexdigest() == entry["sha256"]


def _of_a_case(edited, said):
    if said.verdict not in INTACT:
        return
    if said.verdict == "intact-excerpt":
        yield "a case reads as an excerpt"
        return
    lines = _lines(edited.tree.get("ledger.jsonl"))
    entries = _parsed(lines) if lines else None
    if not entries:
        yield f"{said.verdict}, of a ledger of no whole lines"
        return
    if lines != edited.whole_lines:
        yield f"{said.verdict}, of lines that nobody signed"
    if said.report["entries"] != len(lines):
        yield f"says {said.report['entries']} entries where there are {len(lines)}"
    yield from _of_its_files(edited, entries, said)
    yield from _of_its_streams(entries, said)
    newest = _recorded_size(edited)
    if edited.with_log and _same(lines, edited.recorded) < newest:
        yield f"{said.verdict} beside the log, which knows {newest} other lines"
    if edited.against and _same(lines, edited.recorded) < newest:
        yield f"{said.verdict} beside a note that was kept of {newest} other lines"


def _recorded_size(edited):
    """Lines under the newest checkpoint of the case as it was recorded, which log and kept note know."""
    whole = edited.base.whole or edited.base
    return max(whole.notes)


def _end_of(entries):
    return next((i for i, e in enumerate(entries) if e["type"] == "close"), len(entries))


def _erased_behind_the_end(entries):
    """Whether an entry behind `close` says that a segment was erased, of the segment's entry."""
    erased = [(e["stream"], e["first_index"], e["last_index"]) for e in entries[_end_of(entries):] if e["type"] == "erased"]
    return lambda segment: any(s == segment["stream"] and first <= segment["index"] <= last for s, first, last in erased)


def _of_its_files(edited, entries, said):
    is_erased = _erased_behind_the_end(entries)
    for entry in entries:
        if entry["type"] == "segment":
            gone = is_erased(entry)
            if gone and said.verdict == "intact":
                yield f"intact, where {entry['file']} is stated as erased"
            if not gone and not _holds(edited.tree, entry):
                yield f"{said.verdict}, where {entry['file']} is not what its line states"
            if gone and entry["file"] in edited.tree and edited.tree[entry["file"]] is not t.FOLDER and not _holds(edited.tree, entry):
                yield f"{said.verdict}, where {entry['file']} is no longer what its line states, though its erasure is stated"
        elif entry["type"] == "token" and not _holds(edited.tree, entry):
            yield f"{said.verdict}, where {entry['file']} is not what its line states"
    subject = entries[0].get("subject")
    if subject and not _holds(edited.tree, subject):
        yield f"{said.verdict}, without the subject of the case"
    notes = [int(path[12:-5]) for path in edited.tree.files() if re.fullmatch(r"checkpoints/[0-9]{8}\.note", path)]
    if max(notes, default=0) <= _end_of(entries):
        yield f"{said.verdict}, where nothing signed covers the end"


def _of_its_streams(entries, said):
    stated = {s["name"]: s for s in said.report["streams"]}
    if set(stated) != {info["name"] for info in entries[0]["streams"]}:
        yield "says other streams than open does"
        return
    for info in entries[0]["streams"]:
        name = info["name"]
        segments = [e for e in entries if e["type"] == "segment" and e["stream"] == name]
        gaps = [(e["start_ns"], e["end_ns"]) for e in entries if e["type"] == "gap" and e["stream"] == name and e.get("of") != "sound"]
        sums = {"segments": len(segments), "frames": sum(e.get("frames", e.get("samples", 0)) for e in segments), "dropped": sum(e.get("dropped", 0) for e in segments),
                "bytes": sum(e["bytes"] for e in segments)}
        for key, value in sums.items():
            if stated[name][key] != value:
                yield f"says {stated[name][key]} {key} of {name}, where its lines have {value}"
        if said.verdict == "intact" and (gaps or sums["dropped"] or any(not e["complete"] for e in segments)):
            yield f"intact without gaps, where {name} lacks something by its own lines"
        if [e["index"] for e in segments] != list(range(len(segments))):
            yield f"{said.verdict}, where segments of {name} do not follow one another"
        yield from _breaks(name, segments, gaps, said)
    if said.verdict == "intact" and any(e["type"] in ("recovered", "token-missed") for e in entries):
        yield "intact without gaps, of a case that was cut off or lacks a token"


def _breaks(name, segments, gaps, said):
    for one, other in zip(segments, segments[1:]):
        at = one["end_ns"]
        for start, end in sorted(gaps):
            if start <= at + MS:
                at = max(at, end)
        if other["start_ns"] > at + MS:
            yield f"{said.verdict}, where {name} has a hole from {at} to {other['start_ns']} ns that no gap states"
        if other["start_ns"] < one["end_ns"] - MS:
            yield f"{said.verdict}, where segments of {name} overlap"


def _is_segment(entry):
    return entry["type"] == "segment" and all(isinstance(entry.get(key), kind) for key, kind in
                                              (("stream", str), ("file", str), ("sha256", str), ("start_ns", int), ("end_ns", int)))


def _wanted_of(stream, entries, shown, document):
    """The segments of a stream in the excerpt's time. What no sound case has of one outside of the part, the part does not show: that it reaches into the
    next, or begins at its end or later."""
    segments = [e for e in entries if _is_segment(e) and e["stream"] == stream]
    for number, entry in enumerate(segments):
        end = max(entry["end_ns"], entry["start_ns"] + 1)
        if entry not in shown:
            end = min(entry["end_ns"], segments[number + 1]["start_ns"] if number + 1 < len(segments) else entry["end_ns"])
        if entry["start_ns"] < document["to_ns"] and document["from_ns"] < end:
            yield entry


def _lacking_in(document, entries, shown):
    """Holes before segments on the lines of the excerpt's live streams, by all lines of the case, that reach into its time."""
    begin, end = document["from_ns"], document["to_ns"]
    live = [s["name"] for s in entries[0]["streams"] if s["timing"] == "arrival" and (s["kind"], s["media"]) != ("events", "application/jsonl")]
    for name in [name for name in document["streams"] if name in live]:
        segments = [e for e in entries if _is_segment(e) and e["stream"] == name]
        gaps = [(e["start_ns"], e["end_ns"]) for e in entries if e["type"] == "gap" and e.get("stream") == name and "of" not in e
                and isinstance(e.get("start_ns"), int) and isinstance(e.get("end_ns"), int)]
        for one, other in zip(segments, segments[1:]):
            at = one["end_ns"]
            for start, stop in sorted(gaps):
                if start <= at + MS:
                    at = max(at, stop)
            if other in shown and min(other["start_ns"], end) - max(at, begin) > MS:
                yield f"intact-excerpt, where {name} has a hole from {at} to {other['start_ns']} ns that no gap states"


def _of_an_excerpt(edited, said):
    if said.verdict not in INTACT:
        return
    if said.verdict != "intact-excerpt":
        yield f"an excerpt reads as {said.verdict}"
        return
    tree, lines = edited.tree, edited.whole_lines
    try:
        document = json.loads(tree["excerpt.json"])
        first, size = document["first_entry"], document["size"]
    except (ValueError, KeyError, TypeError):
        yield "intact-excerpt, without excerpt.json"
        return
    part, opening = _lines(tree.get("ledger-part.jsonl")), _lines(tree.get("ledger-open.jsonl"))
    if part != lines[first:size] or opening != lines[:1]:
        yield "intact-excerpt, of other lines than the case has there"
        return
    entries = _parsed(lines)
    shown = _parsed(part)
    if any(e["type"] == "segment" and not _is_segment(e) for e in shown):
        yield "intact-excerpt, with a line of a segment that lacks something"
        return
    wanted = [e for name in document["streams"] for e in _wanted_of(name, entries, shown, document)]
    if not wanted:
        yield "intact-excerpt, of nothing"
    for entry in wanted:
        if entry not in shown:
            yield f"intact-excerpt, without the line of {entry['file']}, which lies in its time"
        if not _holds(tree, entry):
            yield f"intact-excerpt, without {entry['file']}, which lies in its time"
    held = {s["name"]: s["held_segments"] for s in said.report["excerpt"]["streams"] if s["selected"]}
    for name in document["streams"]:
        count = sum(e["stream"] == name for e in wanted)
        if held.get(name) != count:
            yield f"says {held.get(name)} segments of {name}, where it holds {count}"
    yield from _lacking_in(document, entries, shown)
    if document["case"] != entries[0]["case"]:
        yield "intact-excerpt, of another case"
    log = said.report["log"]
    known = log and log["entries"]
    if not edited.with_log:
        if known is not None:
            yield f"says that the log knows {known} entries, which was not given"
        return
    # An excerpt shows the roots of its own entries alone, and a log states few of a case's.
    stated = [size_of for size_of in _sizes_in_log(edited.base.log, document["case"]) if first < size_of <= size]
    if any(_same(lines, edited.recorded) < size_of for size_of in stated):
        yield "intact-excerpt beside the log, which knows other lines"
    if known != max(stated, default=0):
        yield f"says that the log knows {known} entries of it, where it states the roots of {stated}"


@functools.lru_cache
def _sizes_in_log(folder, case):
    entries = map(json.loads, (folder / "ledger.jsonl").read_text("utf-8").splitlines())
    return tuple(e["size"] for e in entries if e["type"] in ("case-checkpoint", "case-closed") and e["case"] == case)


def _of_time(edited, said):
    """An authority outside gave no token but those of the recording, and what the forger asked for later."""
    if said.verdict == "tampered":
        return
    lines = _lines(edited.tree.get("ledger.jsonl"))
    if lines is None:
        lines = edited.whole_lines
    same = _same(lines, edited.recorded)
    recorded = _parsed(edited.recorded)
    tokens = [e["checkpoint"] for e in recorded if e["type"] == "token" and e["authority"] == "outside" and e["checkpoint"] <= same]
    proved = said.report["outside_entries"]
    if edited.signed_lines is None or edited.tokens != "late":
        if proved > max(tokens, default=0):
            yield f"says that {proved} entries are proved from outside, where {max(tokens, default=0)} can be"
    if said.report["time"] not in ("external", "external-in-part"):
        return
    asked_ns = stamp.nanoseconds(recorded[0]["utc"]) + LATER_NS
    for bracket in said.report["brackets"]:
        if bracket["last_entry"] >= same and bracket["not_after"] is not None and stamp.nanoseconds(bracket["not_after"]) < asked_ns - 10 * SECOND:
            yield f"says of entries up to {bracket['last_entry']}, which were written later, that they were there by {bracket['not_after']}"
    close = next((i for i, line in enumerate(lines) if b'"type":"close"' in line), None)
    if said.report["time"] == "external" and close is not None and "excerpt.json" not in edited.tree and proved <= close:
        yield "says that all of its time is external, where the end is not covered"


EVIDENCE = "../evidence"


def _record(tree, path):
    """What is read at this path, also where its folder is a link: a record proves what it proves wherever it lies."""
    folder = tree.get(EVIDENCE)
    if not isinstance(folder, t.Link):
        return tree.get(path)
    file = pathlib.Path(folder) / pathlib.PurePosixPath(path).name
    return file.read_bytes() if file.is_file() else None


def _of_evidence(edited, said):
    evidence = said.report["evidence"]
    if not evidence or not evidence["holds"]:
        return
    node, count = edited.tree.get("ledger.jsonl"), evidence["entries"]
    lines = node.split(b"\n")[:-1] if isinstance(node, bytes) else None
    record = f"{EVIDENCE}/{edited.base.folder_name}.ers"
    if not beside.is_same_proof(_record(edited.tree, record), edited.base.tree.get(record)):
        yield "the record holds, and is another one"
    if lines is None or lines[:count] != edited.recorded[:count]:
        yield f"the record holds, of other lines than its {count}"
    elif said.verdict in INTACT:
        is_erased = _erased_behind_the_end(_parsed(lines) or [])  # what was erased since takes nothing from what is left
        for entry in _parsed(lines[:count]):
            if entry["type"] == "segment" and not is_erased(entry) and not _holds(edited.tree, entry):
                yield f"the record holds and the case is {said.verdict}, without {entry['file']}"


def _of_a_log(edited, said):
    if said.verdict not in INTACT:
        return
    node = edited.tree.get("ledger.jsonl")
    lines = node.split(b"\n")[:-1] if isinstance(node, bytes) else None  # half a line behind them is what a power cut leaves
    if not lines:
        yield f"{said.verdict}, of a log of no whole lines"
        return
    if edited.signed_lines is None and lines != edited.recorded[:len(lines)]:
        yield f"{said.verdict}, of lines that nobody signed"
    if edited.signed_lines is not None and lines != edited.signed_lines[:len(lines)]:
        yield f"{said.verdict}, of other lines than those that were signed"
    if edited.against and _same(lines, edited.recorded) < max(edited.base.notes):
        yield f"{said.verdict} beside a note that was kept of {max(edited.base.notes)} other lines"


def objections_to_answers(edited, said, answered_yes):
    """Of a report about a case, whatever its verdict: what is answered with Yes must be so."""
    yes = " / ".join(answered_yes)
    lines = _lines(edited.tree.get("ledger.jsonl"))
    entries = _parsed(lines) if lines else None
    if "excerpt.json" in edited.tree:
        return
    of_lines = [each for each in answered_yes if each.startswith(("Is every file", "Was it recorded", "Was the recording"))]
    if of_lines and said.verdict != "incomplete" and (entries is None or lines != edited.whole_lines[:len(lines)]):
        yield f"of lines that nobody signed the report says Yes to: {' / '.join(of_lines)}"
    if entries is None:
        return
    if "Is the list of everything recorded" in yes and lines != edited.whole_lines:
        yield "the report says that the list is unchanged"
    if "Is every file there" in yes and entries[0]["type"] == "open":
        close = next((i for i, e in enumerate(entries) if e["type"] == "close"), len(entries))
        erased = [(e["stream"], e["first_index"], e["last_index"]) for e in entries[close:] if e["type"] == "erased"]
        for entry in entries:
            if entry["type"] == "segment" and not any(s == entry["stream"] and a <= entry["index"] <= b for s, a, b in erased) and not _holds(edited.tree, entry):
                yield f"the report says that every file is there, without {entry['file']}"
    if "without a break" in yes:
        for info in entries[0].get("streams", ()):
            segments = [e for e in entries if e["type"] == "segment" and e.get("stream") == info["name"]]
            if any(e["type"] == "gap" and e.get("stream") == info["name"] for e in entries):
                yield f"the report says that there was no break, where a gap of {info['name']} is stated"
            for one, other in zip(segments, segments[1:]):
                if other["start_ns"] > one["end_ns"] + MS:
                    yield f"the report says that there was no break, where {info['name']} has a hole"
    if "Does somebody outside prove" in yes and edited.tokens != "late":
        same = _same(lines, edited.recorded)
        if not any(e["type"] == "token" and e["authority"] == "outside" and e["checkpoint"] <= same for e in _parsed(edited.recorded)):
            yield "the report says that somebody outside proves when it existed"
    if "own log know this case" in yes and (not edited.with_log or _same(lines, edited.recorded) < _recorded_size(edited)):
        yield "the report says that the log knows the case"
