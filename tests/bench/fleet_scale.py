#!/usr/bin/env python3
"""What a hospital group's rooms ask of one report server, its database and the time-stamping authority.

Usage: tests/bench/fleet_scale.py [PROGRAMS] [--appliances N] [--every S] [--rounds N]
  PROGRAMS        the folder of kiroku, kiroku-fleet and kiroku-verify, build/release/apps if absent; fleet_scale_bench is in tests/bench beside it
  --appliances N  how many, 200 if absent, each with one room that records
  --every S       seconds of a round and between the checkpoints of a room, 60 if absent
  --rounds N      for how many rounds it is measured, 3 if absent

The server is `kiroku-fleet serve`, the database a PostgreSQL of its own that flushes what it commits, the authority `openssl ts` behind an HTTP server that
counts. The appliances are recorders' sessions and reporters in one process, by mutual TLS, each with a certificate of its own; they record the synthetic
patient and no pictures. Afterwards every case is verified. What a case with one camera weighs is taken from one that `kiroku record` makes.
Prints all of it, and last what docs/results/record.py takes:

  docs/results/record.py fleet-scale --machine NAME $(tests/bench/fleet_scale.py | tail -1)

Exit status: 0 measured, 1 a program failed, 77 PostgreSQL is not installed.
"""
import argparse
import concurrent.futures
import contextlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/fleet"))
from aggregate_test import CountingAuthority  # noqa: E402
from rooms_test import FleetServer  # noqa: E402

DATABASE = ROOT / "tests/fleet/postgres.sh"
TICKS = os.sysconf("SC_CLK_TCK")
WEIGHED_S, RATE = 20, 30


def cpu_seconds(process):
    """User and system time of a process, and of its children that have ended."""
    fields = pathlib.Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(int(field) for field in fields[11:15]) / TICKS


def children(parent):
    """Those that run, and the parent."""
    found = [parent]
    for entry in pathlib.Path("/proc").iterdir():
        with contextlib.suppress(OSError, IndexError):
            if entry.name.isdigit() and int((entry / "stat").read_text().rpartition(")")[2].split()[1]) == parent:
                found.append(int(entry.name))
    return found


def own_mib(process):
    """Its share of memory: pages that several have count for each in part."""
    text = pathlib.Path(f"/proc/{process}/smaps_rollup").read_text()
    return int(re.search(r"^Pss:\s+(\d+)", text, re.MULTILINE)[1]) / 1024


def of_all(processes, what):
    total = 0
    for each in processes:
        with contextlib.suppress(OSError):
            total += what(each)
    return total


class Wire:
    """Bytes of all connections of a server, both ways, as the kernel counts them. One that ends within a second after it spoke last is counted short."""

    def __init__(self, port):
        self.port, self.seen, self.goes_on = port, {}, True
        self.thread = threading.Thread(target=self.follow, daemon=True)
        self.thread.start()

    def follow(self):
        while self.goes_on:
            self.look()
            time.sleep(1)

    def look(self):
        told = subprocess.run(["ss", "-tiHn", f"( sport = :{self.port} )"], capture_output=True, text=True, check=True).stdout.splitlines()
        for place, facts in zip(told[::2], told[1::2]):
            # A connection by who is at its other end; the kernel gives a number again long after.
            key = place.split()[4]
            count = sum(int(number) for number in re.findall(r"\bbytes_(?:sent|received):(\d+)", facts))
            before, last = self.seen.get(key, (0, 0))
            self.seen[key] = (before + last, count) if count < last else (before, count)

    def total(self):
        self.look()
        return sum(before + last for before, last in list(self.seen.values()))


def run(programs, folder, count, every, rounds):
    """One hospital group. What it cost."""
    folder.mkdir()
    folder.chmod(0o755)
    started = subprocess.run([DATABASE, "up", folder / "database", "durable"], capture_output=True, text=True)
    if started.returncode != 0:
        print(started.stdout + started.stderr, end="")
        sys.exit(started.returncode)
    connection = started.stdout.strip()

    def query(sql):
        return int(subprocess.run(["psql", "-qtA", "-v", "ON_ERROR_STOP=1", "-d", connection, "-c", sql], check=True, capture_output=True,
                                  text=True).stdout)

    authority = CountingAuthority(folder / "outside")
    root = authority.authority.path("root.pem")
    configuration = folder / "fleet.toml"
    configuration.write_text(f'[store]\nendpoint = "https://127.0.0.1:1"\nbucket = "recordings"\n[catalogue]\nconnection = "{connection}"\n'
                             f'[verification]\ntrust = ["{root}"]\n[reports]\nauthority = "authority"\n'
                             f'[sharing]\nevery = "{every}s"\n[[authority]]\nname = "outside"\nurl = "{authority.url("aggregator")}"\n')
    with contextlib.ExitStack() as at_end:
        at_end.callback(subprocess.run, [DATABASE, "down", folder / "database"], check=False)
        subprocess.run([programs / "kiroku-fleet", "init", "--config", configuration], check=True, capture_output=True)
        server = FleetServer(programs, folder / "page", configuration)
        at_end.callback(server.kill)
        # In memory: appliances have disks of their own, and flush none of the server's.
        disks = pathlib.Path(at_end.enter_context(tempfile.TemporaryDirectory(dir="/dev/shm")))
        shutil.copytree(folder / "authority", disks / "authority")
        appliances = subprocess.Popen([programs.parent / "tests/bench/fleet_scale_bench", disks, server.reports, connection, str(count), authority.url("directly"),
                                       root, str(every), str(every * rounds)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        at_end.callback(appliances.kill)

        def told(word):
            line = appliances.stdout.readline()
            if line.strip() != word:
                sys.exit(f"fleet_scale.py: the appliances said {line!r} in place of {word!r}")

        told("records")
        wire = Wire(server.reports.rpartition(":")[2])
        postmaster = int((folder / "database/data/postmaster.pid").read_text().split()[0])
        told("window")

        def counters():
            return {"at": time.monotonic(), "shared": authority.asked["aggregator"], "direct": authority.asked["directly"], "server": cpu_seconds(server.process.pid),
                    "database": of_all(children(postmaster), cpu_seconds), "wire": wire.total(), "rows": query("SELECT pg_database_size(current_database())"),
                    "log": query("SELECT pg_current_wal_lsn() - '0/0'")}

        before = counters()
        told("over")
        after = counters()
        wire.goes_on = False
        cost = {key: after[key] - before[key] for key in before}
        cost["size"] = after["rows"]
        status = pathlib.Path(f"/proc/{server.process.pid}/status").read_text()
        cost["server_mib"] = int(re.search(r"^VmHWM:\s+(\d+)", status, re.MULTILINE)[1]) / 1024
        cost["database_mib"] = of_all(children(postmaster), own_mib)
        met = json.loads(appliances.communicate("\n", timeout=600)[0])
        if appliances.returncode != 0:
            sys.exit("fleet_scale.py: the appliances failed")
        cost.update(met)
        cost["verdicts"] = verdicts(programs, met["cases"], root)
        cost["proofs_of_cases"] = [proof_bytes(pathlib.Path(case["folder"])) for case in met["cases"]]
    return cost


def verdicts(programs, cases, root):
    def judge(case):
        done = subprocess.run([programs / "kiroku-verify", case["folder"], "--device", case["device"], "--trust", root, "--json"], capture_output=True, text=True)
        return json.loads(done.stdout)["verdict"]

    counted = {}
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as workers:
        for verdict in workers.map(judge, cases):
            counted[verdict] = counted.get(verdict, 0) + 1
    return counted


def proof_bytes(case):
    """What time-stamps take of a case: shared tokens, how many; bytes of all tokens, notes, and the ledger's lines of both."""
    files = [each for name in ("tokens", "checkpoints", "authorities") for each in (case / name).glob("*")]
    lines = [line for line in (case / "ledger.jsonl").read_bytes().splitlines(keepends=True) if json.loads(line)["type"] in ("token", "token-missed")]
    return {"shared": sum(each.suffix == ".ers" for each in files), "bytes": sum(each.stat().st_size for each in files) + sum(map(len, lines))}


def weigh(programs, folder):
    """Bytes a minute of a case with one camera of 720p, as `kiroku record` archives it if nobody says otherwise, and the vital signs.

    By the bytes of a frame, at 30 a second: a machine that is busy records fewer, and such a case would seem lighter than it is.
    """
    environment = dict(os.environ, KIROKU_HOME=str(folder))
    subprocess.run([programs / "kiroku", "init", "--demo"], env=environment, check=True, capture_output=True)
    done = subprocess.run([programs / "kiroku", "record", "--endoscope", "synthetic:endoscope?size=1280x720", "--vitals", "synthetic:patient", "--duration", f"{WEIGHED_S}s", "--json"],
                          env=environment, check=True, capture_output=True, text=True)
    told = json.loads(done.stdout)
    camera, vitals = (next(one for one in told["streams"] if one["name"] == name) for name in ("endoscope", "vitals"))
    return camera["bytes"] / camera["frames"] * RATE * 60 + vitals["bytes"] / told["duration_ns"] * 60e9


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0], description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="?", default=ROOT / "build/release/apps", type=pathlib.Path)
    parser.add_argument("--appliances", default=200, type=int)
    parser.add_argument("--every", default=60, type=int)
    parser.add_argument("--rounds", default=3, type=int)
    given = parser.parse_args()
    programs = given.programs.resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        folder.chmod(0o755)
        cost = run(programs, folder / "all", given.appliances, given.every, given.rounds)
        case_minute = weigh(programs, folder / "weighed")
        minutes = tell(cost, given.appliances)
    room_minutes = sum(case["duration_ns"] for case in cost["cases"]) / 60e9
    in_case = sum(each["bytes"] for each in cost["proofs_of_cases"]) / room_minutes
    on_wire = cost["wire"] / (given.appliances * minutes)
    in_database = cost["rows"] / (given.appliances * minutes)
    overhead = 100 * (in_case + on_wire + in_database) / case_minute
    print(f"a case of one camera: {case_minute / 1e6:.1f} MB a minute; of a room a minute in the case {in_case:.0f} B, on the wire {on_wire:.0f} B, "
          f"in the database {in_database:.0f} B")
    figures = {
        "requests": round(cost["shared"] / minutes, 2), "direct": cost["direct"],
        "proofs": cost["proofs"]["count"], "failures": cost["failures"], "intact": sum(cost["verdicts"].get(each, 0) for each in ("intact", "intact-with-gaps")),
        "proof_p50": round(cost["proofs"]["p50_ms"] / 1000, 1), "proof_p95": round(cost["proofs"]["p95_ms"] / 1000, 1),
        "behind_p50": round(cost["behind_the_round"]["p50_ms"]), "behind_p95": round(cost["behind_the_round"]["p95_ms"]),
        "behind_most": round(cost["behind_the_round"]["most_ms"]), "submit_p95": round(cost["submissions"]["p95_ms"], 1),
        "report_p50": round(cost["reports"]["p50_ms"], 1), "report_p95": round(cost["reports"]["p95_ms"], 1),
        "server_cores": round(cost["server"] / cost["at"], 3), "server_mib": round(cost["server_mib"]),
        "database_cores": round(cost["database"] / cost["at"], 3), "database_mib": round(cost["database_mib"]), "database_mb": round(cost["size"] / 1e6, 1),
        "database_growth": round(cost["rows"] / 1e6 / (minutes / 60), 1), "log_growth": round(cost["log"] / 1e6 / (minutes / 60)),
        "proof_bytes": round(cost["proof_bytes"] / max(cost["proofs"]["count"], 1)), "in_case": round(in_case), "on_wire": round(on_wire),
        "case_minute": round(case_minute / 1e6, 1), "overhead": round(overhead, 2),
    }
    print(" ".join(f"{key}={value}" for key, value in figures.items()))


def tell(cost, count):
    minutes = cost["at"] / 60
    shown = {key: value for key, value in cost.items() if key not in ("cases", "proofs_of_cases")}
    print(f"{count} appliances, {minutes:.2f} minutes: {json.dumps(shown)}", flush=True)
    print(f"  shared tokens in cases: {sum(each['shared'] for each in cost['proofs_of_cases'])}, missed: {sum(case['missed'] for case in cost['cases'])}", flush=True)
    return minutes


if __name__ == "__main__":
    main()
