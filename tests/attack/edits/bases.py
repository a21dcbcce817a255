"""What is edited: a case that the programs recorded a moment ago, an excerpt, a renewed one, the proof of its end, and a
log of it with legal holds, also as witnesses cosigned it; and cases of the writer in tests/foreign, whose keys are
known."""
import base64
import dataclasses
import http.server
import json
import os
import pathlib
import re
import subprocess
import threading

import beside
import case_writer as w
import forgeries
import merkle
import note
import stamp
import tree
from case_writer import SECOND

LONGEST_WAIT_S = 60   # it only ends a test that fails


@dataclasses.dataclass
class Base:
    """A sound folder, and what its verifier is given."""
    name: str
    form: str                       # case, excerpt, log, proof or note
    folder_name: str
    tree: tree.Tree
    lines: list                     # of the whole case's ledger, or of the log, without line feeds
    signer: note.Signer             # the device's
    devices: list
    roots: list
    own: list = dataclasses.field(default_factory=list)
    log: pathlib.Path | None = None
    at: pathlib.Path | None = None  # the folder as it was recorded; of proof and note that of their case or log
    whole: "Base | None" = None     # of an excerpt: its case

    @property
    def entries(self):
        return [json.loads(line) for line in self.lines]

    @property
    def notes(self):
        """By size."""
        return {int(path[12:-5]): self.tree[path] for path in self.tree.files() if re.fullmatch(r"checkpoints/[0-9]+\.note", path)}

    @property
    def origin(self):
        first = self.entries[0]
        return f"kiroku/{self.signer.name}/{first.get('case', 'log')}"


def ledger_lines(data):
    return data.split(b"\n")[:-1]


class _Answer(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        query = self.rfile.read(int(self.headers["Content-Length"]))
        answer = self.server.authority.answer(query)
        self.send_response(200)
        self.send_header("Content-Type", "application/timestamp-reply")
        self.send_header("Content-Length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)

    def log_message(self, *_):
        pass


class ServedAuthority(stamp.Authority):
    """An outside authority that the recorder asks over HTTP."""

    def answer(self, query):
        with self.serial:
            (self.folder / "query.tsq").write_bytes(query)
            self._run("ts", "-reply", "-config", self.path("authority.cnf"), "-queryfile", self.path("query.tsq"), "-out", self.path("reply.tsr"))
            return (self.folder / "reply.tsr").read_bytes()

    def __enter__(self):
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Answer)
        self.server.authority = self
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.server.server_close()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server.server_address[1]}/"


class Programs:
    """kiroku in a home of its own."""

    def __init__(self, folder, home):
        self.folder, self.home = pathlib.Path(folder), pathlib.Path(home)

    def ask(self, program, *arguments):
        done = subprocess.run([self.folder / program, *map(str, arguments)], capture_output=True, text=True, timeout=LONGEST_WAIT_S,
                              env={**os.environ, "KIROKU_HOME": str(self.home)})
        if done.returncode != 0:
            raise RuntimeError(f"{program} {' '.join(map(str, arguments))}: {done.stderr}")
        return done.stdout


def record(programs_folder, scratch):
    """The bases of one recording: its case, an excerpt, the renewed case and the log."""
    programs = Programs(programs_folder, scratch / "home")
    programs.ask("kiroku", "init", "--demo", "--device-name", "or3")
    home = programs.home
    subject = scratch / "subject.json"
    subject.write_text('{"patient":{"id":"7"},"procedure":{"description":"cholecystectomy"},"staff":[]}')
    with ServedAuthority(scratch / "outside", "outside") as outside:
        config = home / "kiroku.toml"
        config.write_text(config.read_text() + f'\n[[authority]]\nname = "outside"\nurl = "{outside.url}"\n')
        with open(home / "trust.pem", "a", encoding="ascii") as trust:
            trust.write(outside.root)
        done = json.loads(programs.ask("kiroku", "record", "--json", "--endoscope", "synthetic:endoscope?size=64x48&rate=10", "--vitals", "synthetic:patient",
                                       "--duration", "3s", "--segment", "700ms", "--stamp-every", "1s", "--subject", subject))
        programs.ask("kiroku", "renew")
    case = pathlib.Path(done["case"])
    seed = base64.b64decode("".join((home / "device.key").read_text().splitlines()[1:-1]))[-32:]
    signer = note.Signer("or3", seed)
    if str(signer.key) != (home / "device.pub").read_text().strip():
        raise RuntimeError("the device's key has another form than expected")
    given = {"signer": signer, "devices": [signer.key], "roots": [outside.root], "own": [(home / "own-authority.pem").read_text()]}
    whole_tree = tree.read(case)
    whole = Base("recorded", "case", case.name, whole_tree, ledger_lines(whole_tree["ledger.jsonl"]), log=home / "archive/log", at=case, **given)
    first = hold(programs, case, "court")
    hold(programs, case, "insurer")
    programs.ask("kiroku", "release", case, "--hold", first, "--reason", "settled")
    programs.ask("kiroku", "log", "prove", case, "-o", scratch / beside.PROOF)
    programs.ask("kiroku", "excerpt", case, "--from", "1", "--to", "2", "--stream", "endoscope", "-o", scratch / "excerpt")
    part = Base("excerpt", "excerpt", "excerpt", tree.read(scratch / "excerpt"), whole.lines, log=whole.log, whole=whole, **given)
    log_tree = tree.read(home / "archive/log")
    log = Base("log", "log", "log", log_tree, ledger_lines(log_tree["ledger.jsonl"]), at=whole.log, **given)
    renewed = dataclasses.replace(whole, name="renewed", tree=tree.read(case, [f"../evidence/{case.name}.ers"]))
    proof = dataclasses.replace(whole, name="proof", form="proof", tree=tree.Tree({beside.PROOF: (scratch / beside.PROOF).read_bytes()}))
    cosigned = dataclasses.replace(log, name="cosigned", form="note", tree=beside.cosigned_tree(log.notes[max(log.notes)], WITNESSES, TIME_S))
    return [whole, part, renewed, log, proof, cosigned], outside


WITNESSES = [beside.Witness(note.Signer(f"w{number}", bytes([20 + number] * 32))) for number in range(3)]
TIME_S = 1_796_000_000


def hold(programs, case, reason):
    return json.loads(programs.ask("kiroku", "hold", case, "--reason", reason, "--json"))["hold"]


def written(scratch, outside, signer, utc_ns):
    """A case that the writer made and signed, with an erasure behind its end in the second one."""
    world = forgeries.World(signer, note.Signer("stranger", bytes([3] * 32)), outside, None, None, forgeries.age.Identity(bytes([1] * 32)), utc_ns, scratch / "written")
    case = world.sound()
    made = case.write(scratch / "written")
    given = {"signer": signer, "devices": [signer.key], "roots": [outside.root]}
    sound = Base("written", "case", made.folder.name, tree.read(made.folder), made.lines, **given)
    world = dataclasses.replace(world, utc_ns=utc_ns + 3600 * SECOND)
    case = world.sound()
    case.add("erased", 20_400 * w.MS, stream="vitals", first_index=1, last_index=2, policy="after a month")
    case.checkpoint()
    made = case.write(scratch / "written")
    for number in (1, 2):
        (made.folder / f"segments/vitals/{number:08d}.jsonl.age").unlink()
    return [sound, Base("erased", "case", made.folder.name, tree.read(made.folder), made.lines, **given)]


def root_of(lines):
    return merkle.root([merkle.leaf(line) for line in lines])
