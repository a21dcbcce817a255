#!/usr/bin/env python3
"""Keeps a catalogue of two appliances' cases in PostgreSQL, and verifies them out of a real Ceph store.

Usage: tests/fleet/fleet_test.py PROGRAMS
  PROGRAMS  the folder of kiroku and kiroku-fleet, such as build/release/apps

Exit status: 0 everything holds, 1 something does not, 77 Ceph or PostgreSQL is not installed.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

from ship_test import Appliance, HERE, Store, require


class Fleet:
    """kiroku-fleet with a configuration of its own, as one user of the database."""

    def __init__(self, programs, folder, endpoint, connection, appliances):
        self.program, self.folder = programs / "kiroku-fleet", folder
        (folder / "devices").mkdir(parents=True)
        for name, appliance in appliances.items():
            (folder / f"devices/{name}.pub").write_bytes((appliance.home / "device.pub").read_bytes())
        (folder / "store-credentials").touch(mode=0o600)
        (folder / "store-credentials").write_text("access_key = testaccess\nsecret_key = testsecret0123456789\n")
        own = ", ".join(f'"{appliance.home}/own-authority.pem"' for appliance in appliances.values())
        self.configuration = folder / "fleet.toml"
        self.configuration.write_text(
            f'[store]\nendpoint = "{endpoint}"\nbucket = "recordings"\n'
            f'[catalogue]\nconnection = "{connection}"\n'
            f'[verification]\nown_authority = [{own}]\nsettle_minutes = 0\n')

    def ask(self, *words):
        return subprocess.run([str(self.program), *words, "--config", str(self.configuration)], capture_output=True,
                              text=True, timeout=300)

    def tell(self, *words, status=0):
        done = self.ask(*words, "--json")
        require(done.returncode == status,
                f"kiroku-fleet {' '.join(words)} left with {done.returncode}, not {status}: {done.stderr}{done.stdout}")
        return json.loads(done.stdout)


def start(script, folder):
    done = subprocess.run([str(HERE / script), "up", str(folder)], capture_output=True, text=True)
    if done.returncode == 77:
        print(done.stdout.strip())
        sys.exit(77)
    require(done.returncode == 0, f"{script} did not start: {done.stderr}")
    return done.stdout.strip().splitlines()[-1]


def verdicts(told):
    return {(each["appliance"], each["case"]): each["verdict"] for each in told["cases"]}


def try_everything(programs, folder, store, connection):
    appliances = {}
    for name in ("or-1", "or-2"):
        appliances[name] = Appliance(programs, folder / name, store.endpoint, "recordings")
        toml = appliances[name].home / "kiroku.toml"
        toml.write_text(toml.read_text().replace('appliance = "or-1"', f'appliance = "{name}"'))
    recorded = {("or-1", appliances["or-1"].recorded(2)), ("or-1", appliances["or-1"].recorded(1)),
                ("or-2", appliances["or-2"].recorded(1))}
    for appliance in appliances.values():
        appliance.kiroku("ship")

    fleet = Fleet(programs, folder / "fleet", store.endpoint, connection, appliances)
    refused = fleet.ask("cases")
    require(refused.returncode == 2 and "run 'kiroku-fleet init'" in refused.stderr, f"no catalogue: {refused.stderr}")
    require(fleet.ask("init").returncode == 0, "init failed")
    require(fleet.ask("init").returncode == 0, "init a second time failed")

    # The catalogue is what the store holds; nothing is read twice.
    told = fleet.tell("index")["appliances"]
    require([(each["appliance"], each["cases"], each["read"]) for each in told] == [("or-1", 2, 2), ("or-2", 1, 1)],
            f"the index says {told}")
    require(all(each["read"] == 0 for each in fleet.tell("index")["appliances"]), "what did not change was read again")
    rows = fleet.tell("cases")["cases"]
    require({(row["appliance"], row["case"]) for row in rows} == recorded, f"listed are {rows}")
    require(all(row["state"] == "closed" and row["segments"] > 0 and row["verdict"] is None for row in rows), f"rows: {rows}")
    page = fleet.tell("cases", "--limit", "2")
    rest = fleet.tell("cases", "--limit", "2", "--after", page["next"])
    require(page["cases"] + rest["cases"] == rows and rest["next"] is None, "pages are not the whole list")

    # Two workers at once: each case is verified once.
    workers = [subprocess.Popen([str(fleet.program), "verify", "--json", "--config", str(fleet.configuration)],
                                stdout=subprocess.PIPE, text=True) for _ in range(2)]
    found = [json.loads(worker.communicate(timeout=300)[0])["cases"] for worker in workers]
    require([worker.returncode for worker in workers] == [0, 0], f"the workers found {found}")
    done = [(each["appliance"], each["case"]) for part in found for each in part]
    require(sorted(done) == sorted(recorded), f"verified were {done}")
    require(all(row["verdict"] in ("intact", "intact-with-gaps") for row in fleet.tell("cases")["cases"]), "not intact")
    require(fleet.tell("verify")["cases"] == [], "what is not due was verified again")
    require(fleet.tell("status")["never_verified"] == 0, "something was never verified")

    # Whoever has an appliance's access key puts another version of a segment: the index sees it. The fetch takes the
    # version that the ledger names, so the case holds.
    (one,) = [case for name, case in recorded if name == "or-2"]
    segment = next(key for key in store.versions("recordings") if key.startswith(f"or-2/{one}/segments/"))
    body = folder / "other"
    body.write_bytes(b"not what was recorded")
    store.put("recordings", segment, body)
    require([each["read"] for each in fleet.tell("index")["appliances"]] == [0, 1], "a new version was not seen")
    require(verdicts(fleet.tell("verify")).keys() == {("or-2", one)}, "the changed case is not due")
    require(fleet.tell("cases", "--appliance", "or-2")["cases"][0]["verdict"].startswith("intact"), "it does not hold")

    # Another ledger is no change that a lock forbids: it is found.
    ledger = appliances["or-2"].home / "archive" / one / "ledger.jsonl"
    body.write_bytes(ledger.read_bytes().replace(b'"frames":', b'"frames":1', 1))
    store.put("recordings", f"or-2/{one}/ledger.jsonl", body)
    fleet.tell("index")
    told = fleet.tell("verify", status=1)
    require(verdicts(told) == {("or-2", one): "tampered"}, f"a changed ledger is {told}")
    require(fleet.ask("status").returncode == 1, "status is silent about it")
    require([row["case"] for row in fleet.tell("cases", "--verdict", "tampered")["cases"]] == [one], "it is not found by verdict")
    # Who put it cannot take the alarm back by putting something else.
    body.write_bytes(b"something else")
    store.put("recordings", segment, body)
    fleet.tell("index")
    (row,) = fleet.tell("cases", "--appliance", "or-2")["cases"]
    require(row["verdict"] is None and row["alarm"], f"the alarm is forgotten: {row}")
    require(fleet.ask("status").returncode == 1 and "changed since" in fleet.ask("cases").stdout, "nobody is told")
    require([each["case"] for each in fleet.tell("cases", "--attention")["cases"]] == [one], "it is not among what needs a person")
    require(verdicts(fleet.tell("verify", status=1)) == {("or-2", one): "tampered"}, "it was not verified anew")
    history = fleet.tell("cases", "--appliance", "or-2", "--history", one)["verifications"]
    require(len(history) == 4 and history[-1]["verdict"] == "tampered" and history[-1]["detail"], f"history: {history}")

    # A case that the catalogue knows and the store does not: it is named at every look.
    database = [*"psql -qtA -v ON_ERROR_STOP=1 -d".split(), connection]
    subprocess.run([*database, "-c", "INSERT INTO kiroku.cases (appliance, case_id, opened, duration_ns, state, streams, segments, bytes, tokens, ledger_bytes, changed)"
                    " SELECT appliance, '20200101T000000Z-00000000', opened, duration_ns,"
                    " state, streams, segments, bytes, tokens, ledger_bytes, changed FROM kiroku.cases LIMIT 1"], check=True)
    for _ in range(2):
        done = fleet.ask("index")
        require(done.returncode == 1 and "20200101T000000Z-00000000 any more" in done.stderr, f"not named: {done.stderr}")
    require(len(fleet.tell("cases", "--state", "missing")["cases"]) == 1, "it is not listed as missing")

    # A store that is away says nothing of any case.
    whole = fleet.configuration.read_text()
    fleet.configuration.write_text(whole.replace(store.endpoint, "http://127.0.0.2:1"))
    done = fleet.ask("verify", "--all")
    require(done.returncode == 2 and "does not answer" in done.stderr, f"a store that is away: {done.returncode}, {done.stderr}")
    require(len(fleet.tell("cases", "--appliance", "or-2", "--history", one)["verifications"]) == 4, "something was entered")
    fleet.configuration.write_text(whole)

    # Without an appliance's key nothing is judged, and nothing is guessed.
    (fleet.folder / "devices/or-1.pub").rename(fleet.folder / "or-1.pub")
    told = fleet.tell("verify", "--all", status=1)
    require({verdict for (name, _), verdict in verdicts(told).items() if name == "or-1"} == {"could-not-check"}, f"told: {told}")
    kept = fleet.tell("cases", "--appliance", "or-1", "--state", "closed")["cases"]
    require(all(row["verdict"].startswith("intact") for row in kept), f"what was found before is forgotten: {kept}")
    (fleet.folder / "or-1.pub").rename(fleet.folder / "devices/or-1.pub")

    # Lost, it is made anew from the store.
    subprocess.run([*database, "-c", "DROP SCHEMA kiroku CASCADE"], check=True)
    require(fleet.ask("init").returncode == 0, "init failed")
    fleet.tell("index")
    require({(row["appliance"], row["case"]) for row in fleet.tell("cases")["cases"]} == recorded, "it is not what it was")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    programs = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        folder.chmod(0o755)
        started = []
        try:
            started.append(("store.sh", folder / "ceph"))
            endpoint = start("store.sh", folder / "ceph")
            started.append(("postgres.sh", folder / "postgres"))
            connection = start("postgres.sh", folder / "postgres")
            store = Store(endpoint)
            store.make_bucket("recordings")
            try_everything(programs, folder, store, connection)
        finally:
            for script, state in reversed(started):
                subprocess.run([str(HERE / script), "down", str(state)], check=False)
    print("The catalogue is what the store holds, and its verdicts are of what lies there.")


if __name__ == "__main__":
    main()
