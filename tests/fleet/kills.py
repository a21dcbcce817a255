#!/usr/bin/env python3
"""Kills whatever a hospital's recordings pass through, at random, while rooms record and ship: `kill -9`, again and again.

Usage: tests/fleet/kills.py PROGRAMS [--kills N] [--rooms N] [--seed N]
  PROGRAMS   the folder of kiroku, kirokud, kiroku-fleet and kiroku-verify, such as build/release/apps
  --kills N  how often something is killed (200)
  --rooms N  how many appliances record, each one room (3)

What is killed: a shipper, the server to which appliances report and which has their checkpoints stamped together, the server of the page, the worker that
verifies, PostgreSQL, and the store's gateway and OSD. Each is started anew at once, as systemd does it. Meanwhile each room records one case after the other.
Afterwards every file of each archive must be in the store once, as it was recorded, and confirmed; and every case must verify from the store alone, by
kiroku-verify and by kiroku-fleet. What is there twice, or confirmed by nobody, is told once all of it was looked at. Prints figures for docs/results/record.py.
Exit status: 0 everything holds, 1 something does not, 77 Ceph or PostgreSQL is not installed.
"""
import argparse
import collections
import contextlib
import json
import pathlib
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time

from aggregate_test import CountingAuthority, SharingAppliance, enrol
from fleet_test import start
from page_client import Person
from ship_test import HERE, Store, eventually, judged, require

sys.path.insert(0, str(HERE.parent / "support"))
import ports  # noqa: E402

CASE_S = 20
STORE = "[store]\nendpoint = \"{endpoint}\"\nbucket = \"recordings\"\n"


class Program:
    """What runs until it is killed, and is started anew."""

    def __init__(self, command, log, environment=None):
        self.command, self.log, self.environment = command, log, environment
        self.start()

    def start(self):
        with open(self.log, "ab") as log:
            self.process = subprocess.Popen(self.command, env=self.environment, stdout=log, stderr=log)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def revive(self):
        """As systemd does, where it left with an error: a program that is started while the database is away says so and leaves."""
        left = self.process.poll()
        if left is not None:
            require(left > 0, f"{self.command[:2]} ended with {left}: {self.log.read_text()[-2000:]}")
            self.start()

    def kill_and_start(self):
        self.revive()
        self.kill()
        self.start()


class Server(Program):
    """kiroku-fleet serve, at addresses that it keeps."""

    def __init__(self, programs, folder, name, configuration):
        home = folder / name
        subprocess.run([programs / "kiroku", "init", "--demo", "--home", home], check=True, capture_output=True)
        self.port, reports = ports.reserved_port(), ports.reserved_port()
        self.reports = f"https://127.0.0.1:{reports}"
        super().__init__([programs / "kiroku-fleet", "serve", "--home", home, "--config", configuration, "--listen", f"127.0.0.1:{self.port}", "--reports",
                          f"127.0.0.1:{reports}", "--scratch", folder], folder / f"{name}.log")
        eventually(self.answers, f"the server of {name} does not begin")

    def answers(self):
        with contextlib.suppress(OSError):
            return Person(self.port).ask("session")[0] in (200, 401)
        return False


class Room(SharingAppliance):
    """An appliance that records one case after the other, ships and reports."""

    def __init__(self, programs, home, name, authority, endpoint):
        super().__init__(programs, home, name, authority)
        with open(home / "kiroku.toml", "a", encoding="utf-8") as toml:
            toml.write("\n" + STORE.format(endpoint=endpoint) + f'retain = "1d"\nappliance = "{name}"\n')
        (home / "store-credentials").touch(mode=0o600)
        (home / "store-credentials").write_text("access_key = testaccess\nsecret_key = testsecret0123456789\n")
        self.stopping, self.problem = threading.Event(), ""

    def begin_work(self):
        self.switch_on()
        self.shipper = Program(self.command("ship", "--follow"), self.home / "shipper.log", self.environment)
        self.reporter = Program(self.command("fleet", "report", "--follow"), self.home / "reporter.log", self.environment)
        self.thread = threading.Thread(target=self.record, daemon=True)
        self.thread.start()

    def record(self):
        """What goes wrong in this thread ends the run, in end_work()."""
        try:
            self.record_cases()
        except Exception as error:
            self.problem = repr(error)

    def record_cases(self):
        while not self.stopping.is_set() and not self.problem:
            for words in (("start", "--room", self.name, "--json"), ("stop", "--room", self.name)):
                done = self.ask("case", *words)
                if done.returncode != 0:
                    self.problem = f"kiroku case {words[0]}: {done.stderr}"
                    return
                if words[0] == "start":
                    self.stopping.wait(CASE_S)

    def end_work(self):
        self.stopping.set()
        self.thread.join(timeout=120)
        require(not self.thread.is_alive() and not self.problem, f"recording did not go on: {self.problem}")
        for each in (self.shipper, self.reporter):
            each.kill()
        self.switch_off()
        self.kiroku("recover")

    def cases(self):
        return sorted(folder.name for folder in (self.home / "archive").glob("2*"))

    def files(self):
        archive = self.home / "archive"
        return {f"{self.name}/{file.relative_to(archive)}": file for file in archive.rglob("*")
                if file.is_file() and not file.name.startswith(".") and ".part" not in file.name}


def entries(room, case, kind):
    lines = (room.home / "archive" / case / "ledger.jsonl").read_text("utf-8").splitlines()
    return [entry for entry in map(json.loads, lines) if entry["type"] == kind]


def require_all_there(room, store, found, tags):
    """Each file of its archive as it is here, and nothing else than that and the parts of ledgers. What was counted: the caller judges what is there twice,
    or confirmed by nobody."""
    told = json.loads(room.kiroku("ship", "--status", "--json"))
    require(told["waiting"] == 0 and not told["problems"], f"{room.name}: something waits: {told}")
    versions = {key: its for key, its in found.items() if key.startswith(room.name + "/")}
    files = {key: file for key, file in room.files().items() if key != f"{room.name}/log/ledger.jsonl"}
    lost = files.keys() - versions.keys()
    require(not lost, f"{room.name}: lost: {sorted(lost)[:5]}")
    others = [key for key in versions.keys() - files.keys() if not key.startswith(f"{room.name}/growing/")]
    require(not others, f"{room.name}: nobody recorded {others[:5]}")
    # What was on its way when its shipper was killed may arrive beside what the next one put: it is the same then.
    doubled = [key for key, its in versions.items() if len(its) > 1]
    differing = [key for key in doubled if len(set(tags[key])) > 1]
    require(not differing, f"{room.name}: put twice, and not the same: {differing[:5]}")
    if doubled:
        print(f"  {room.name}: put twice: {doubled}", flush=True)
    confirmed = set()
    for each in room.home.glob("shipping-*.sqlite"):
        with contextlib.closing(sqlite3.connect(each)) as database:
            confirmed |= {key for (key,) in database.execute("SELECT key FROM object")}
    unconfirmed = versions.keys() - confirmed
    if unconfirmed:
        print(f"  {room.name}: not confirmed: {sorted(unconfirmed)}", flush=True)
    for key, file in files.items():
        require(store.get("recordings", key) == file.read_bytes(), f"{key} is not what was recorded")
    growth = b"".join(store.get("recordings", key) for key in sorted(versions) if key.startswith(f"{room.name}/growing/log/"))
    require(growth == (room.home / "archive/log/ledger.jsonl").read_bytes(), f"{room.name}: the log's parts are not the log")
    return collections.Counter(objects=len(versions), lost=len(lost), doubled=len(doubled), unconfirmed=len(unconfirmed))


class Hospital:
    def __init__(self, programs, folder, at_end, wanted):
        self.programs, self.folder = programs, folder
        self.database, self.ceph = folder / "database", folder / "store"
        at_end.callback(subprocess.run, [HERE / "store.sh", "down", self.ceph])
        endpoint = start("store.sh", self.ceph)
        self.store = Store(endpoint)
        self.store.make_bucket("recordings")
        at_end.callback(subprocess.run, [HERE / "postgres.sh", "down", self.database], capture_output=True)
        self.connection = start("postgres.sh", self.database)
        self.authority = CountingAuthority(folder / "outside")
        self.configuration = folder / "fleet.toml"
        (folder / "devices").mkdir()
        (folder / "store-credentials").touch(mode=0o600)
        (folder / "store-credentials").write_text("access_key = testaccess\nsecret_key = testsecret0123456789\n")
        self.configuration.write_text(STORE.format(endpoint=endpoint) + f'[catalogue]\nconnection = "{self.connection}"\n'
                                      f'[verification]\ntrust = ["{self.authority.authority.path("root.pem")}"]\nsettle_minutes = 0\n'
                                      f'[reports]\nauthority = "authority"\n'
                                      f'[sharing]\nevery = "2s"\n[[authority]]\nname = "outside"\nurl = "{self.authority.url("aggregator")}"\n')
        self.fleet("init")
        self.aggregator = Server(programs, folder, "aggregator", self.configuration)
        at_end.callback(self.aggregator.kill)
        self.page = Server(programs, folder, "page", self.configuration)
        at_end.callback(self.page.kill)
        self.rooms = []
        for number in range(1, wanted + 1):
            room = Room(programs, folder / f"or-{number}", f"or-{number}", self.authority, endpoint)
            at_end.callback(room.switch_off)
            shutil.copy(room.home / "device.pub", folder / f"devices/{room.name}.pub")
            enrol(programs, self.configuration, self.aggregator, room)
            self.rooms.append(room)
        for room in self.rooms:
            room.begin_work()
            at_end.callback(room.shipper.kill)
            at_end.callback(room.reporter.kill)
        self.worker = Program([programs / "kiroku-fleet", "verify", "--follow", "--scratch", folder, "--config", self.configuration], folder / "worker.log")
        at_end.callback(self.worker.kill)
        # As its timer does it; what it is told while the store or the database is away is no matter.
        self.ending = threading.Event()
        self.indexing = threading.Thread(target=self.index, daemon=True)
        self.indexing.start()

    def fleet(self, *words, statuses=(0,)):
        done = subprocess.run([self.programs / "kiroku-fleet", *words, "--config", self.configuration], capture_output=True, text=True, timeout=600)
        require(done.returncode in statuses, f"kiroku-fleet {' '.join(words)} left with {done.returncode}: {done.stderr}{done.stdout}")
        return done.stdout

    def index(self):
        while not self.ending.wait(3):
            subprocess.run([self.programs / "kiroku-fleet", "index", "--config", self.configuration], capture_output=True, timeout=600)

    def kill_database(self):
        (pid, *_) = (self.database / "data/postmaster.pid").read_text().split()
        require("postgres" in pathlib.Path(f"/proc/{pid}/comm").read_text(), "PostgreSQL does not run")
        subprocess.run(["kill", "-KILL", pid], check=True)
        # It does not start while one of its processes is left.
        for _ in range(100):
            if subprocess.run([HERE / "postgres.sh", "up", self.database], capture_output=True).returncode == 0:
                return
            time.sleep(0.1)
        sys.exit("FAILED: PostgreSQL does not start anew")

    def kill_store(self, part):
        killed = subprocess.run([HERE / "store.sh", "kill", self.ceph, part])
        require(killed.returncode == 0, f"the store's {part} did not run")
        time.sleep(0.5)
        require(subprocess.run([HERE / "store.sh", "again", self.ceph, part]).returncode == 0, f"the store's {part} does not start anew")
        eventually(self.store_answers, "the store does not come back")

    def store_answers(self):
        with contextlib.suppress(subprocess.CalledProcessError):
            return self.store.ask("GET", "/recordings?max-keys=1")[0] == 200
        return False

    def end(self):
        for room in self.rooms:
            room.end_work()
        self.ending.set()
        self.indexing.join(timeout=600)
        self.worker.kill()


def campaign(hospital, dice, wanted):
    """How often what was killed, while it ran."""
    targets = {
        "shipper": lambda: dice.choice(hospital.rooms).shipper.kill_and_start(),
        "aggregator": hospital.aggregator.kill_and_start,
        "page": hospital.page.kill_and_start,
        "worker": hospital.worker.kill_and_start,
        "database": hospital.kill_database,
        "gateway": lambda: hospital.kill_store("gateway"),
        "osd": lambda: hospital.kill_store("osd"),
    }
    # Shippers most: theirs is the work that could be lost or doubled.
    weights = {"shipper": 6, "aggregator": 3, "page": 1, "worker": 3, "database": 3, "gateway": 2, "osd": 2}
    done = collections.Counter()
    # Each once, whatever the dice say.
    order = dice.sample(list(targets), len(targets))
    order += dice.choices(list(weights), list(weights.values()), k=max(0, wanted - len(order)))
    for name in order[:wanted]:
        time.sleep(dice.uniform(0.1, 2.0))
        begun = time.monotonic()
        targets[name]()
        done[name] += 1
        for each in (hospital.aggregator, hospital.page, hospital.worker, *(program for room in hospital.rooms for program in (room.shipper, room.reporter))):
            each.revive()
        print(f"  {sum(done.values())}: {name}, {time.monotonic() - begun:.1f} s", flush=True)
        for room in hospital.rooms:
            require(not room.problem, f"{room.name} stopped recording: {room.problem}")
    return done


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0])
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--rooms", type=int, default=3)
    parser.add_argument("--seed", type=int, default=None)
    given = parser.parse_args()
    seed = given.seed if given.seed is not None else random.SystemRandom().getrandbits(32)
    print(f"seed {seed}", flush=True)
    dice = random.Random(seed)
    folder = pathlib.Path(tempfile.mkdtemp(prefix="kiroku-kills-"))
    folder.chmod(0o755)
    with contextlib.ExitStack() as at_end:
        at_end.callback(shutil.rmtree, folder, ignore_errors=True)
        hospital = Hospital(given.programs.resolve(), folder, at_end, given.rooms)
        eventually(lambda: all(room.cases() for room in hospital.rooms), "no case begins")
        done = campaign(hospital, dice, given.kills)
        hospital.end()
        print(f"killed: {dict(done)}", flush=True)
        there, cases, verified, missed, shared, own = collections.Counter(), 0, 0, 0, 0, 0
        for room in hospital.rooms:
            room.kiroku("ship")
        found, tags = hospital.store.versions("recordings"), hospital.store.listed("recordings", "ETag")
        for room in hospital.rooms:
            there += require_all_there(room, hospital.store, found, tags)
            for case in room.cases():
                cases += 1
                status, words = judged(room, hospital.store, case, room.name, trust=hospital.authority.authority.path("root.pem"))
                require(status == 0 and "\nINTACT" in words, f"{room.name}, {case} from the store alone: {words}")
                verified += 1
                missed += len(entries(room, case, "token-missed"))
                tokens = entries(room, case, "token")
                shared += sum(token["file"].endswith(".ers") for token in tokens)
                own += sum(not token["file"].endswith(".ers") for token in tokens)
        print(f"holds: {there['objects']} objects, none lost; {cases} cases verify from the store alone", flush=True)
        require(shared > 0, "no token was shared")
        # What the fleet knows is the same.
        hospital.fleet("index")
        told = json.loads(hospital.fleet("verify", "--all", "--scratch", str(folder), "--json"))
        verdicts = collections.Counter(each["verdict"] for each in told["cases"])
        # A machine that does all of this at once may drop frames, which a case states.
        require(sum(verdicts.values()) == cases and verdicts.keys() <= {"intact", "intact-with-gaps"}, f"kiroku-fleet verify says {verdicts} of {cases} cases")
        require(json.loads(hospital.fleet("status", "--json"))["cases"] == cases, "the catalogue has another number of cases")
        print(f"holds: kiroku-fleet has {cases} cases and finds each intact; {shared} shared time-stamps, {own} of a room's own, {missed} missed")
        figures = {"kills": sum(done.values()), **{each: done[each] for each in ("shipper", "aggregator", "page", "worker", "database", "gateway", "osd")},
                   **{each: there[each] for each in ("objects", "lost", "doubled", "unconfirmed")}, "cases": cases, "verified": verified, "shared": shared, "own": own, "missed": missed}
        print(" ".join(f"{key}={value}" for key, value in figures.items()), flush=True)
        require(there["doubled"] + there["unconfirmed"] == 0, f"{there['doubled']} objects were put twice, {there['unconfirmed']} are confirmed by nobody")


if __name__ == "__main__":
    main()
