#!/usr/bin/env python3
"""Keeps a catalogue of two appliances' cases in PostgreSQL, and verifies them out of a real Ceph store.

Usage: tests/fleet/fleet_test.py PROGRAMS
  PROGRAMS  the folder of kiroku and kiroku-fleet, such as build/release/apps

Exit status: 0 everything holds, 1 something does not, 77 Ceph or PostgreSQL is not installed.
"""
import contextlib
import json
import pathlib
import subprocess
import sys
import tempfile

from page_client import Server
from ship_test import Appliance, HERE, Store, eventually, require


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


def room_of_segments_while(fleet, *words):
    """How much of a disk segments take below the scratch folder while kiroku-fleet works, of those objects that have one version."""
    scratch = fleet.folder / "scratch"
    scratch.mkdir(exist_ok=True)
    working = subprocess.Popen([str(fleet.program), *words, "--scratch", str(scratch), "--config", str(fleet.configuration)],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    most = {}
    while working.poll() is None:
        with contextlib.suppress(OSError):  # a folder that is gone before all of it was listed
            for case in scratch.glob("*/cases/2*"):
                with contextlib.suppress(OSError, ValueError):  # its segments are gone already, or it has none yet
                    most[case.name] = max(most.get(case.name, 0), max(file.stat().st_blocks for file in case.glob("segments/*/*")))
    return min(most.values(), default=0)


def verified_on_page(person, case):
    """What a verification that somebody asks for on the page says of the case."""
    status, answer = person.ask(f"cases/{case}/verification", {})
    while status == 202:
        status, answer = person.ask(f"cases/{case}/verification")
    require(status == 200, f"the page's verification is answered with {status}: {answer}")
    return json.loads(answer)["verdict"]


def try_the_page(programs, folder, store, fleet, appliances, recorded):
    """The hospital's page: lists, plays and verifies out of the store, by two processes at once."""
    homes = [folder / "page-1", folder / "page-2"]
    for home in homes:
        subprocess.run([str(programs / "kiroku"), "init", "--demo", "--home", str(home)], check=True, capture_output=True)
    scratch = folder / "scratch"
    scratch.mkdir()

    def serve(home):
        return Server([fleet.program, "serve", "--home", home, "--scratch", scratch, "--config", fleet.configuration])

    def identity(name):
        return {"identity": (appliances[name].home / "identity.txt").read_text()}

    servers = [serve(home) for home in homes]
    own = Server([programs / "kiroku", "view"], appliances["or-1"].environment)
    try:
        person = servers[0].person()
        require(person.ask("fleet/cases")[0] == 401, "strangers see the list")
        person.read("session", {"link": servers[0].link})
        require({(row["appliance"], row["case"]) for row in person.read("fleet/cases")["cases"]} == recorded, "the list is another")
        page = person.read("fleet/cases?limit=2")
        rest = person.read(f"fleet/cases?limit=2&after={page['next']}")
        require({(row["appliance"], row["case"]) for row in page["cases"] + rest["cases"]} == recorded and rest["next"] is None, "pages lack cases")
        require([row["appliance"] for row in person.read("fleet/cases?appliance=or-2")["cases"]] == ["or-2"], "it is not found by appliance")
        require(person.read("fleet/cases?attention=true")["cases"] == [], "something needs a person")
        require([(one["name"], one["cases"], one["not_intact"]) for one in person.read("fleet/appliances")["appliances"]] ==
                [("or-1", 2, 0), ("or-2", 1, 0)], "the appliances are others")

        # Whoever has no key sees times and no pictures; a key opens its own appliance's.
        case = next(name for appliance, name in sorted(recorded) if appliance == "or-1")
        (foreign,) = [name for appliance, name in recorded if appliance == "or-2"]
        require(person.read(f"fleet/cases/or-1~{case}")["case"] == case, "the row is another's")
        require(person.read(f"cases/or-1~{case}")["id"] == f"or-1~{case}", "the case has another name")
        require(person.ask(f"cases/or-1~{case}/streams/endoscope/init.mp4")[0] == 423, "it plays without a key")
        person.tell("session/unlock", identity("or-1"))
        require(person.tell(f"cases/or-1~{case}/streams/endoscope/init.mp4")[4:8] == b"ftyp", "nothing plays")
        require(person.ask(f"cases/or-2~{foreign}/streams/endoscope/init.mp4")[0] == 403, "one appliance's key opens another's")
        for missing in (f"or-2~{case}", f"or-9~{case}", case):
            require(person.ask(f"cases/{missing}")[0] == 404, f"{missing} is there")

        # The store's pictures are the archive's, also where somebody put a newer version of the same size.
        surgeon = own.person()
        surgeon.read("session", {"link": own.link})
        picture = f"{case}/streams/endoscope/frame.png?at_ns=500000000"
        archived = surgeon.tell("cases/" + picture)
        require(person.tell("cases/or-1~" + picture) == archived, "the store's picture is another")
        require(person.tell(f"cases/or-1~{case}/streams/endoscope/pieces/0.mp4")[4:8] == b"moof", "no piece")
        segment = f"or-1/{case}/segments/endoscope/00000000.ts.age"
        flipped = bytearray((appliances["or-1"].home / "archive" / segment.partition("/")[2]).read_bytes())
        flipped[len(flipped) // 2] ^= 1
        (folder / "flipped").write_bytes(flipped)
        store.put("recordings", segment, folder / "flipped")
        other = servers[1].person()
        other.read("session", {"link": servers[1].link})
        other.tell("session/unlock", identity("or-1"))
        require(other.tell("cases/or-1~" + picture) == archived, "of two versions the ledger's was not taken")
        require(list(scratch.rglob("*.age")) == [], "segments were copied")

        # What proves the times comes a moment later.
        eventually(lambda: not person.read(f"cases/or-1~{case}/timeline")["proofs_coming"], "time-stamps never came")
        timeline, there = (who.read(f"cases/{name}/timeline") for who, name in ((person, f"or-1~{case}"), (surgeon, case)))
        require(timeline["tokens"] == there["tokens"] and timeline["checkpoints"] == there["checkpoints"] and
                timeline["tokens"] != [] and timeline["brackets"] == there["brackets"], "the time line is another")
        require(verified_on_page(person, f"or-1~{case}").startswith("intact"), "it does not hold")

        # Roles and the log are the viewer's.
        person.tell("users", {"user": "anna", "password": "a long enough password", "role": "auditor"})
        auditor = servers[0].person()
        auditor.read("session", {"user": "anna", "password": "a long enough password"})
        refused = auditor.ask(f"cases/or-1~{case}/streams/endoscope/init.mp4")
        require(refused[0] == 403, f"an auditor who would watch is answered with {refused}")
        deeds = {(each.get("case"), each.get("what")) for each in auditor.read("log")["entries"]}
        require((f"or-1~{case}", "watched endoscope") in deeds, f"the log has {deeds}")

        # Killing one loses nothing but who had signed in.
        servers[0].kill()
        require(other.tell("cases/or-1~" + picture) == archived, "the other does not go on")
        servers[0] = serve(homes[0])
        auditor = servers[0].person()
        auditor.read("session", {"user": "anna", "password": "a long enough password"})
        require((f"or-1~{case}", "watched endoscope") in {(each.get("case"), each.get("what")) for each in auditor.read("log")["entries"]},
                "the log is lost")
    finally:
        for server in (*servers, own):
            server.end()
    return case


def try_what_a_run_does_not_look_at(fleet, database):
    """"kiroku-fleet verify --all && …": what the run did not look at itself counts, too."""
    def left_with(change, status, words):
        subprocess.run([*database, "-c", f"UPDATE kiroku.cases SET {change} WHERE appliance = 'or-2'"], check=True)
        done = fleet.ask("verify", "--all")
        require(done.returncode == status and words in done.stdout, f"{change}: left with {done.returncode}: {done.stdout}{done.stderr}")

    left_with("verified = verified", 0, "3 cases verified")
    # Another worker verified it meanwhile.
    left_with("verdict = 'tampered', alarm = true, verified = now() + interval '1 hour'", 1, "1 NOT INTACT that this run did not verify")
    left_with("verdict = 'intact', alarm = false, verified = NULL, state = 'missing'", 1, "1 missing from the store")
    left_with("state = 'unreadable', pending = now()", 1, "1 whose ledger cannot be read")
    whole = fleet.configuration.read_text()
    fleet.configuration.write_text(whole.replace("settle_minutes = 0", "settle_minutes = 60"))
    left_with("state = 'closed', pending = now(), changed_at = now()", 3, "1 that changed just now")
    fleet.configuration.write_text(whole)
    left_with("verified = verified", 0, "3 cases verified")


def try_everything(programs, folder, store, connection):
    database = [*"psql -qtA -v ON_ERROR_STOP=1 -d".split(), connection]
    appliances = {}
    for name in ("or-1", "or-2"):
        appliances[name] = Appliance(programs, folder / name, store.endpoint, "recordings")
        toml = appliances[name].home / "kiroku.toml"
        toml.write_text(toml.read_text().replace('appliance = "or-1"', f'appliance = "{name}"'))
    recorded = {("or-1", appliances["or-1"].recorded(2)), ("or-1", appliances["or-1"].recorded(1)),
                ("or-2", appliances["or-2"].recorded(1))}
    # What a patient consented to lies beside the log, sealed, and is part of what the store's log must have.
    consented = next(case for name, case in sorted(recorded) if name == "or-1")
    (folder / "who").write_text("the patient herself\n")
    appliances["or-1"].kiroku("consent", "give", consented, "--purpose", "teaching", "--person", str(folder / "who"))
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
    (judged,) = fleet.tell("cases", "--appliance", "or-1", "--history", consented)["verifications"]
    require("consent" not in json.dumps(judged), f"the log out of the store lacks a consent: {judged}")
    require(fleet.tell("verify")["cases"] == [], "what is not due was verified again")
    require(fleet.tell("status")["unverified"] == 0, "something is not verified")
    mistyped = fleet.ask("cases", "--verdict", "tampred")
    require(mistyped.returncode == 2 and "tampered" in mistyped.stderr, f"a verdict that is none: {mistyped.stdout}{mistyped.stderr}")
    stranger = fleet.ask("cases", "--appliance", "or-9")
    require(stranger.returncode == 2 and "or-1, or-2" in stranger.stderr, f"an appliance that is none: {stranger.stdout}{stranger.stderr}")
    nobody = fleet.ask("cases", "--appliance", "or-1", "--history", "20200101T000000Z-00000000")
    require(nobody.returncode == 2, f"a case that is none: {nobody.stdout}{nobody.stderr}")
    try_what_a_run_does_not_look_at(fleet, database)

    try_the_page(programs, folder, store, fleet, appliances, recorded)
    fleet.tell("index")
    fleet.tell("verify")

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
    require(len(history) == 6 and history[-1]["verdict"] == "tampered" and history[-1]["detail"], f"history: {history}")

    # A case that the catalogue knows and the store does not: it is named at every look.
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
    require(len(fleet.tell("cases", "--appliance", "or-2", "--history", one)["verifications"]) == 6, "something was entered")
    fleet.configuration.write_text(whole)

    require(room_of_segments_while(fleet, "verify", "--all") == 0, "segments of one version are copied to be verified")

    # Without an appliance's key nothing is judged, and nothing is guessed.
    (fleet.folder / "devices/or-1.pub").rename(fleet.folder / "or-1.pub")
    told = fleet.tell("verify", "--all", status=1)
    require({verdict for (name, _), verdict in verdicts(told).items() if name == "or-1"} == {"could-not-check"}, f"told: {told}")
    kept = fleet.tell("cases", "--appliance", "or-1", "--state", "closed")["cases"]
    require(all(row["verdict"].startswith("intact") for row in kept), f"what was found before is forgotten: {kept}")
    (fleet.folder / "or-1.pub").rename(fleet.folder / "devices/or-1.pub")
    # An identity goes before the key beside it: whoever has both is not content with one signature.
    (fleet.folder / "devices/or-1.identity").write_text("kiroku/or-1/identity\nnonsense\n")
    told = fleet.tell("verify", "--all", status=1)
    require({verdict for (name, _), verdict in verdicts(told).items() if name == "or-1"} == {"could-not-check"}, f"told: {told}")
    (fleet.folder / "devices/or-1.identity").unlink()

    # Lost, it is made anew from the store.
    subprocess.run([*database, "-c", "DROP SCHEMA kiroku CASCADE"], check=True)
    require(fleet.ask("init").returncode == 0, "init failed")
    fleet.tell("index")
    require({(row["appliance"], row["case"]) for row in fleet.tell("cases")["cases"]} == recorded, "it is not what it was")


def with_store_and_postgres(what):
    """Calls it with the folder of the programs, one to work in, the store's endpoint and the database's connection."""
    if len(sys.argv) != 2:
        sys.exit(sys.modules["__main__"].__doc__)
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
            what(programs, folder, endpoint, connection)
        finally:
            for script, state in reversed(started):
                subprocess.run([str(HERE / script), "down", str(state)], check=False)


def main():
    def run(programs, folder, endpoint, connection):
        store = Store(endpoint)
        store.make_bucket("recordings")
        try_everything(programs, folder, store, connection)

    with_store_and_postgres(run)
    print("The catalogue is what the store holds, and its verdicts are of what lies there.")


if __name__ == "__main__":
    main()
