#!/usr/bin/env python3
"""How long lists and searches of a catalogue of a million cases take, as a person waits for them.

Usage: tests/bench/fleet_catalogue.py [--cases N] [PROGRAMS]
  PROGRAMS   the folder of kiroku-fleet, build/release/apps if absent
  --cases N  how many, 1,000,000 if absent; of 200 appliances, one in 50 never verified and one in 10,000 tampered

Starts a PostgreSQL server of its own. Each question is a run of the program, its start and connection included, asked
100 times for other appliances, days and places (seed 7). Prints p50 and p95, the catalogue's size, and then what
docs/results/record.py takes:

  docs/results/record.py fleet-catalogue --machine NAME $(tests/bench/fleet_catalogue.py | tail -1)

Exit status: 0 measured, 1 the program failed, 77 PostgreSQL is not installed.
"""
import argparse
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
SERVER = ROOT / "tests/fleet/postgres.sh"
TIMES = 100

FILL = """
INSERT INTO kiroku.cases (appliance, case_id, opened, duration_ns, state, streams, segments, bytes, tokens, ledger_bytes, changed,
                          verdict, verified, alarm, pending)
SELECT 'or-' || n % 200, to_char(began, 'YYYYMMDD"T"HH24MISS"Z-"') || lpad(to_hex(n), 8, '0'), began, 5400000000000,
       'closed', 'endoscope room vitals', 270, 2700000000, 92, 100000, n,
       CASE WHEN n % 50 = 0 THEN NULL WHEN n % 10000 = 1 THEN 'tampered' ELSE 'intact' END,
       CASE WHEN n % 50 = 0 THEN NULL ELSE began + interval '40 days' END, n % 10000 = 1,
       CASE WHEN n % 50 = 0 THEN began END
FROM (SELECT n, timestamptz '2016-01-01Z' + n * (interval '10 years' / {cases}) AS began
      FROM generate_series(0, {cases} - 1) AS n) AS made;
ANALYZE kiroku.cases;
"""


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0], description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="?", default=ROOT / "build/release/apps", type=pathlib.Path)
    parser.add_argument("--cases", default=1_000_000, type=int)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        folder.chmod(0o755)
        started = subprocess.run([SERVER, "up", folder / "server"], capture_output=True, text=True)
        if started.returncode != 0:
            print(started.stdout + started.stderr, end="")
            sys.exit(started.returncode)
        try:
            measure(options, folder, started.stdout.strip())
        finally:
            subprocess.run([SERVER, "down", folder / "server"], check=False)


def measure(options, folder, connection):
    configuration = folder / "fleet.toml"
    configuration.write_text(f'[store]\nendpoint = "http://127.0.0.1:1"\nbucket = "unused"\n[catalogue]\nconnection = "{connection}"\n')

    def fleet(*words):
        began = time.monotonic()
        done = subprocess.run([options.programs / "kiroku-fleet", *words, "--config", configuration], capture_output=True, text=True)
        if done.returncode not in (0, 1):
            sys.exit(f"fleet_catalogue.py: {done.stderr.strip()}")
        return 1000 * (time.monotonic() - began), done.stdout

    def query(sql):
        return subprocess.run(["psql", "-qtA", "-v", "ON_ERROR_STOP=1", "-d", connection, "-c", sql], check=True, capture_output=True,
                              text=True).stdout.strip()

    fleet("init")
    began = time.monotonic()
    query(FILL.format(cases=options.cases))
    print(f"{options.cases} cases in {time.monotonic() - began:.0f} s")
    chance = random.Random(7)

    def day():
        return f"{chance.randint(2016, 2025)}-{chance.randint(1, 12):02}-{chance.randint(1, 28):02}"

    def appliance():
        return f"or-{chance.randrange(200)}"

    questions = {
        "newest": lambda: ["cases"],
        "appliance": lambda: ["cases", "--appliance", appliance()],
        "until": lambda: ["cases", "--to", day()],
        "place": lambda: ["cases", "--after", f"{day()}T12:00:00Z,or-7,x"],
        "appliance_until": lambda: ["cases", "--appliance", appliance(), "--to", day()],
        "verdict": lambda: ["cases", "--verdict", "tampered", "--to", day()],
        "unverified": lambda: ["cases", "--unverified", "--to", day()],
        "attention": lambda: ["cases", "--attention", "--to", day()],
    }
    figures = {}
    for name, words in questions.items():
        times = []
        for _ in range(TIMES):
            took, out = fleet(*words(), "--json")
            json.loads(out)
            times.append(took)
        times.sort()
        figures[name] = f"{times[TIMES * 95 // 100]:.0f}"
        print(f"{name}: p50 {times[TIMES // 2]:.0f} ms, p95 {figures[name]} ms")
    took, _ = fleet("status")
    figures["status"] = f"{took:.0f}"
    figures["size"] = query("SELECT round(pg_total_relation_size('kiroku.cases') / 1e6)")
    print(f"status: {took:.0f} ms; the table and its indexes: {figures['size']} MB")
    print(" ".join(f"{key}={value}" for key, value in figures.items()))


if __name__ == "__main__":
    main()
