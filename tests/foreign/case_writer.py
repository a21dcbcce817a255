"""Writes cases, excerpts and appliance logs by docs/reference/format.md. What is written is a list of steps that a test may change first."""
import dataclasses
import hashlib
import json
import pathlib

import merkle
import stamp

MS, SECOND = 1_000_000, 1_000_000_000
BOOT_ID = "6a2c1d0e-0000-4000-8000-000000000001"


def line_of(entry):
    """The format prescribes no order and no blanks, since the line's own bytes are hashed; this writer uses neither."""
    return json.dumps(entry, ensure_ascii=False, separators=(",", ":")).encode()


@dataclasses.dataclass
class Entry:
    """A line. `raw`, if given, stands in its place; `cut` bytes are left out at its end, the line feed first.

    `made` gives further fields for how many lines there are before it and the root over them.
    """
    type: str
    mono_ns: int
    fields: dict
    raw: bytes | None = None
    cut: int = 0
    utc_ns: int | None = None       # else by the case clock
    seq: int | None = None
    made: object = None


@dataclasses.dataclass
class Checkpoint:
    """A signed note over all lines before it. `change` may give other bytes for it; `name_size` another name."""
    change: object = None
    name_size: int | None = None
    signer: object = None
    origin: str | None = None
    kept: bool = True


@dataclasses.dataclass
class Token:
    """A token over the newest checkpoint, or over that of `size`, and its entry."""
    authority: object
    mono_ns: int
    gen_ns: int | None = None       # by the case clock; None: asked of `openssl ts` now
    asked: bool = True              # asked_ns and answered_ns are stated
    size: int | None = None
    fields: dict = dataclasses.field(default_factory=dict)   # of the entry, in place of the true ones
    response: bytes | None = None   # in place of the authority's
    change: object = None           # gives other bytes for the response
    stored: bool = True
    entered: bool = True
    accuracy_s: int = 1
    ordering: bool = False
    shared: object = None           # gives the lists of a hash tree for a note's SHA-256: the token is shared by way of it


class Case:
    """A case as steps and files; write() makes the folder."""
    folders = ("checkpoints", "tokens", "segments", "authorities")

    def __init__(self, case_id, signer, utc_ns, streams, log_state=(0, hashlib.sha256(b"").hexdigest())):
        self.id, self.signer, self.utc_ns = case_id, signer, utc_ns
        self.files, self.steps, self.serial = {"device.pub": f"{signer.key}\n".encode()}, [], 100
        self.streams = streams
        self.add("open", 0, format="kiroku-case/1", case=case_id, device=str(signer.key), boot_id=BOOT_ID, streams=streams,
                 appliance_log={"size": log_state[0], "root": log_state[1]})

    @property
    def origin(self):
        return f"kiroku/{self.signer.name}/{self.id}"

    def add(self, kind, mono_ns, **fields):
        self.steps.append(Entry(kind, mono_ns, fields))
        return self.steps[-1]

    def checkpoint(self, **options):
        self.steps.append(Checkpoint(**options))
        return self.steps[-1]

    def token(self, authority, mono_ns, **options):
        self.steps.append(Token(authority, mono_ns, **options))
        return self.steps[-1]

    def file(self, path, data):
        self.files[path] = data
        return {"file": path, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}

    def segment(self, stream, index, start_ns, end_ns, data, count, mono_ns=None, complete=True, extension=None, **more):
        info = next(s for s in self.streams if s["name"] == stream)
        extension = extension or {"video/mp2t": "ts", "video/x-matroska": "mkv", "application/jsonl": "jsonl"}[info["media"]]
        path = f"segments/{stream}/{index:08d}.{extension}.age" + ("" if complete else ".part")
        pictures = info["kind"] == "video"
        a_second = {"ts": 90_000, "mkv": 1_000, "jsonl": SECOND}[extension]
        clock = {"first_pts": start_ns * a_second // SECOND, "time_base": f"1/{a_second}"}
        return self.add("segment", end_ns + 20 * MS if mono_ns is None else mono_ns, stream=stream, index=index,
                        **self.file(path, data), start_ns=start_ns, end_ns=end_ns, **clock,
                        **{"frames" if pictures else "samples": count}, dropped=0, complete=complete, **more)

    def close(self, mono_ns, reason="operator"):
        totals = {}
        for info in self.streams:
            entries = [s.fields for s in self.steps if isinstance(s, Entry) and s.type == "segment" and s.fields["stream"] == info["name"]]
            totals[info["name"]] = {"segments": len(entries), "frames": sum(e.get("frames", e.get("samples", 0)) for e in entries),
                                    "dropped": sum(e.get("dropped", 0) for e in entries), "bytes": sum(e["bytes"] for e in entries)}
        return self.add("close", mono_ns, reason=reason, totals=totals)

    def find(self, kind, number=0):
        """The entry of a kind, in order."""
        return [s for s in self.steps if isinstance(s, Entry) and s.type == kind][number]

    def of(self, kind):
        """The steps that are checkpoints or tokens."""
        return [s for s in self.steps if isinstance(s, kind)]

    def refresh_totals(self):
        """close as the segments now add up."""
        at = next(i for i, s in enumerate(self.steps) if isinstance(s, Entry) and s.type == "close")
        old = self.steps.pop(at)
        new = self.close(old.mono_ns, old.fields["reason"])
        self.steps.insert(at, self.steps.pop())
        return new

    def write(self, archive, name=None):
        """Makes the folder; its lines, leaves and roots are in the Written that comes back."""
        folder = pathlib.Path(archive) / (name or self.id)
        written = Written(folder, self)
        for step in self.steps:
            written.take(step)
        written.finish()
        return written


class Written:
    """A folder that was made: `lines` without their line feed, `notes` by size."""

    def __init__(self, folder, case):
        self.folder, self.case, self.lines, self.leaves, self.notes, self.tail = folder, case, [], [], {}, b""
        self.files = dict(case.files)

    def root(self, size=None):
        return merkle.root(self.leaves[:size])

    def append(self, line, cut=0):
        if cut:
            self.tail = (line + b"\n")[:-cut]
            return
        self.lines.append(line)
        self.leaves.append(merkle.leaf(line))

    def _entry(self, step, fields):
        utc = self.case.utc_ns + step.mono_ns if getattr(step, "utc_ns", None) is None else step.utc_ns
        seq = getattr(step, "seq", None)
        return {"type": fields.pop("type"), "seq": len(self.lines) if seq is None else seq, "utc": stamp.text_of(utc), "mono_ns": step.mono_ns, **fields}

    def take(self, step):
        if isinstance(step, Entry):
            fields = {"type": step.type, **step.fields, **(step.made(len(self.lines), self.root()) if step.made else {})}
            self.append(step.raw if step.raw is not None else line_of(self._entry(step, fields)), step.cut)
        elif isinstance(step, Checkpoint):
            size = len(self.lines)
            made = (step.signer or self.case.signer).checkpoint(step.origin or self.case.origin, size, self.root())
            made = step.change(made) if step.change else made
            self.notes[size] = made
            if step.kept:
                self.files[f"checkpoints/{step.name_size or size:08d}.note"] = made
        else:
            self._token(step)

    def _token(self, step):
        size = max(self.notes) if step.size is None else step.size
        data = self.notes[size]
        self.case.serial += 1
        response, lists = step.response, step.shared(hashlib.sha256(data).digest()) if step.shared else None
        stamped = stamp.joined(lists) if lists else data
        if response is None and step.gen_ns is None:
            response = step.authority.ask(stamped)
        elif response is None:
            response = step.authority.at(stamped, self.case.utc_ns + step.gen_ns, self.case.serial, step.accuracy_s, step.ordering)
        response = stamp.shared_token(lists, stamp.parse(response).token) if step.shared else response
        response = step.change(response) if step.change else response
        authority = step.authority.name
        path = f"tokens/{size:08d}.{authority}.{'ers' if step.shared else 'tsr'}"
        if step.stored:
            self.files[path] = response
        self.files.setdefault(f"authorities/{authority}.pem", step.authority.chain.encode())
        try:
            read = stamp.parse(stamp.stamped(path, response)[0])
            facts = {"gen_time": stamp.text_of(read.gen_ns), "accuracy_ns": read.accuracy_ns, "serial": read.serial}
        except stamp.Malformed:
            facts = {"gen_time": stamp.text_of(self.case.utc_ns), "accuracy_ns": 0, "serial": "1"}
        exchange = {"asked_ns": step.mono_ns - 20 * MS, "answered_ns": step.mono_ns - 5 * MS} if step.asked else {}
        if step.entered:
            self.append(line_of(self._entry(step, {
                "type": "token", "checkpoint": size, "authority": authority, "file": path,
                "sha256": hashlib.sha256(response).hexdigest(), **facts, **exchange, **step.fields})))

    def finish(self):
        self.files["ledger.jsonl"] = b"".join(line + b"\n" for line in self.lines) + self.tail
        for path, data in self.files.items():
            if data is not None:
                (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
                (self.folder / path).write_bytes(data)
        for empty in self.case.folders:
            (self.folder / empty).mkdir(parents=True, exist_ok=True)


class Log(Case):
    """The appliance log: the same steps, an origin of its own, each entry with its checkpoint."""
    folders = ("checkpoints",)

    def __init__(self, signer, utc_ns):
        self.id, self.signer, self.utc_ns, self.files, self.steps, self.serial, self.streams = "log", signer, utc_ns, {}, [], 0, []
        self.add("boot", 0, boot_id=BOOT_ID, device=str(signer.key))

    def signed(self, kind, mono_ns, **fields):
        self.add(kind, mono_ns, **fields)
        self.checkpoint()


def write_excerpt(written, folder, from_ns, to_ns, streams, first, size, made_by="foreign", change=None):
    """Copies of a closed case the segments of `streams` in the time, with the lines [first, size) and what proves them."""
    folder = pathlib.Path(folder)
    entries = [json.loads(line) for line in written.lines]
    earlier = sorted({e["checkpoint"] for e in entries[first:size] if e["type"] == "token" and e["checkpoint"] <= first})
    leaves = written.leaves[:size]
    document = {"format": "kiroku-excerpt/1", "case": written.case.id, "from_ns": from_ns, "to_ns": to_ns, "streams": streams, "first_entry": first, "size": size,
                "open_proof": [h.hex() for h in merkle.inclusion(leaves, 0)], "left": [h.hex() for h in merkle.subtrees(leaves[:first])],
                "earlier": [{"size": s, "proof": [h.hex() for h in merkle.consistency(leaves, s)]} for s in earlier], "made_by": made_by}
    files = {"ledger-open.jsonl": written.lines[0] + b"\n", "ledger-part.jsonl": b"".join(line + b"\n" for line in written.lines[first:size]),
             "device.pub": written.files["device.pub"]}
    for entry in entries[first:size]:
        if entry["type"] == "token":
            note_name = f"checkpoints/{entry['checkpoint']:08d}.note"
            for name in (entry["file"], note_name, f"authorities/{entry['authority']}.pem"):
                files[name] = written.files[name]
        elif entry["type"] == "segment" and entry["stream"] in streams and entry["start_ns"] < to_ns and from_ns < entry["end_ns"]:
            files[entry["file"]] = written.files[entry["file"]]
    covering = f"checkpoints/{size:08d}.note"
    files[covering] = written.files[covering]
    if change:
        change(document, files)
    files["excerpt.json"] = line_of(document) + b"\n"
    for path, data in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(data)
    return folder


# What a small case holds


def stream(name, kind, media, recipients, source="synthetic", timing="arrival", profile=None, purpose=None):
    return {"name": name, "kind": kind, "media": media, "source": source, "profile": profile or ("jsonl" if media == "application/jsonl" else "mpeg2"),
            "purpose": purpose or name, "recipients": recipients, "timing": timing}


def event_line(salt, event):
    """A line of the events stream, and the commitment that its mark entry states."""
    text = json.dumps(event, ensure_ascii=False)
    return line_of({"event": text, "salt": salt.hex()}) + b"\n", hashlib.sha256(salt + text.encode()).hexdigest()
