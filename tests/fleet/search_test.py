#!/usr/bin/env python3
"""Finds cases by patient and procedure with a site's search key, in PostgreSQL and a real Ceph store that hold hashes
alone.

Usage: tests/fleet/search_test.py PROGRAMS
  PROGRAMS  the folder of kiroku and kiroku-fleet, such as build/release/apps

Exit status: 0 everything holds, 1 something does not, 77 Ceph or PostgreSQL is not installed.
"""
import hashlib
import hmac
import json
import pathlib
import subprocess

from fleet_test import Fleet, with_store_and_postgres
from page_client import Server
from ship_test import Appliance, Store, require

PATIENT, OTHER, CODE = "0047110815", "0047110816", "K653-ZZ"


def search_key(programs, *words):
    return subprocess.run([str(programs / "kiroku-fleet"), "search-key", *map(str, words)], capture_output=True, text=True)


def opted_in(programs, folder, appliance):
    """Gives the appliance a search key under the name or-1. The site's key."""
    site = folder / "site-search.key"
    require(search_key(programs, "-o", site).returncode == 0, "no key of a site was made")
    again = search_key(programs, "-o", site)
    require(again.returncode == 2 and "not overwritten" in again.stderr, f"a key is written over: {again.stderr}")
    done = search_key(programs, "--from", site, "--appliance", "or-1", "-o", appliance.home / "search.key")
    require(done.returncode == 0, f"no key of an appliance was made: {done.stderr}")
    for file in (site, appliance.home / "search.key"):
        require(file.stat().st_mode & 0o77 == 0, f"others may read {file}")
    with open(appliance.home / "kiroku.toml", "a", encoding="utf-8") as toml:
        toml.write('\n[search]\nkey = "search.key"\n')
    return site


def recorded(appliance, subject=None):
    """A case, about somebody or not."""
    words = []
    if subject is not None:
        file = appliance.home / "subject.json"
        file.write_text(json.dumps(subject), encoding="utf-8")
        words = ["--subject", str(file)]
    told = json.loads(appliance.kiroku("record", "--endoscope", "synthetic:endoscope?size=160x120&rate=10", "--duration", "1s",
                                       *words, "--json"))
    if subject is not None:
        file.unlink()
    return pathlib.Path(told["case"]).name


class Search:
    """Who has a key and asks the catalogue."""

    def __init__(self, fleet, key):
        self.fleet, self.key = fleet, key

    def told(self, *words):
        return self.fleet.tell("cases", "--search-key", str(self.key), *words)

    def found(self, *words):
        return {row["case"] for row in self.told(*words)["cases"]}


def finds_what_was_recorded(fleet, search, cases):
    patients = {cases["coded"], cases["again"]}
    told = search.told("--patient", PATIENT)
    require({row["case"] for row in told["cases"]} == patients, f"the patient's cases are {told}")
    require((told["looked_at"], told["without_note"], told["not_by_this_key"]) == (5, 2, 0), f"told: {told}")
    for number in (PATIENT.lstrip("0"), "４７１１０８１５", " 47 110 815 "):
        require(search.found("--patient", number) == patients, f"'{number}' is another number")
    require(search.found("--patient", PATIENT, "--authority", "northern hospital") == {cases["coded"]}, "not by who gave it")
    require(search.found("--patient", PATIENT, "--authority", "southern") == set(), "found by who did not give it")
    require(search.found("--procedure", CODE.lower()) == {cases["coded"], cases["other"]}, "not found by the procedure")
    require(search.found("--procedure", CODE, "--coding-system", "jp") == {cases["coded"]}, "not found by the coding system")
    require(search.found("--patient", OTHER, "--procedure", CODE) == {cases["other"]}, "not found by both")
    require(search.found("--patient", PATIENT, "--procedure", "K654") == set(), "found by what is no procedure of theirs")
    require(search.found("--patient", PATIENT, "--appliance", "or-2") == set(), "found on another appliance")
    first = search.told("--patient", PATIENT, "--limit", "1")
    rest = search.told("--patient", PATIENT, "--limit", "1", "--after", first["next"])
    require({row["case"] for row in first["cases"] + rest["cases"]} == patients, "pages are not the whole answer")
    shown = fleet.ask("cases", "--search-key", str(search.key), "--patient", PATIENT)
    require("Looked at 5 cases, of which 2 cannot be searched" in shown.stdout, f"shown: {shown.stdout}{shown.stderr}")


def is_what_the_format_says(store, site, case):
    """By docs/reference/format-recovery.md alone, with nothing of Kiroku's."""
    def mac(key, *lines):
        return hmac.new(key, "\n".join(lines).encode(), hashlib.sha256).digest()

    secret = bytes.fromhex(site.read_text().split()[1])
    note = json.loads(store.get("recordings", f"or-1/search/{case}.json"))
    series = note["series"]
    require(series[16:] == mac(secret, "kiroku search series", "or-1", series[:16])[:8].hex(), "the series is not the site's")
    # HKDF to one block.
    extracted = hmac.new(series.encode(), secret, hashlib.sha256).digest()
    chain = mac(extracted, "kiroku search appliance", "or-1\x01")
    for _ in range(note["step"]):
        chain = mac(chain, "kiroku search step")
    key = mac(chain, "kiroku search note")
    about = (["patient", "47110815"], ["patient of", "47110815", "northernhospital"], ["procedure", "k653-zz"],
             ["procedure of", "k653-zz", "jp"])
    words = "".join(mac(key, "kiroku search word", case, *what)[:16].hex() for what in about)
    require(note["words"] == words, f"the words are {note['words']}, not {words}")
    require(note["mac"] == mac(key, "kiroku search mac", case, series, str(note["step"]), case, series, str(note["step"]), words).hex(),
            "the MAC is another")


def says_nothing_to_others(programs, folder, store, fleet, search, cases, connection, appliance):
    stranger = Search(fleet, folder / "stranger.key")
    require(search_key(programs, "-o", stranger.key).returncode == 0, "no other key was made")
    told = stranger.told("--patient", PATIENT)
    require(told["cases"] == [] and told["not_by_this_key"] == 3, f"another key finds {told}")
    for words, why in ((["--search-key", str(appliance.home / "search.key"), "--patient", PATIENT], "of an appliance"),
                       (["--patient", PATIENT], "--search-key FILE"), (["--search-key", str(search.key)], "--patient NUMBER"),
                       (["--search-key", str(search.key), "--procedure", CODE, "--authority", "x"], "stands beside"),
                       (["--search-key", str(search.key), "--patient", "000"], "nothing can be searched")):
        done = fleet.ask("cases", *words)
        require(done.returncode == 2 and why in done.stderr, f"{words} left with {done.returncode}: {done.stderr}")

    keys = store.versions("recordings")
    notes = sorted(key for key in keys if "/search/" in key)
    require(notes == sorted(f"or-1/search/{cases[name]}.json" for name in ("coded", "again", "other")), f"notes are {notes}")
    everything = subprocess.run(["pg_dump", "--inserts", "-d", connection], check=True, capture_output=True).stdout
    everything += b"".join(store.get("recordings", key) for key in keys)
    everything += b"".join(file.read_bytes() for file in appliance.home.rglob("*") if file.is_file())
    for secret in (PATIENT, PATIENT.lstrip("0"), OTHER, CODE, "Northern Hospital", "northernhospital"):
        require(not any(text.encode() in everything for text in (secret, secret.lower())), f"{secret} is in the clear")
    parts = []
    for key in notes:
        words = json.loads(store.get("recordings", key))["words"]
        parts += [words[at:at + 32] for at in range(0, len(words), 32)]
    require(len(parts) == 12 and len(set(parts)) == 12, "two notes have a word in common")


def the_page_finds_and_tells_of_it(programs, folder, fleet, site, cases):
    home = folder / "page"
    subprocess.run([str(programs / "kiroku"), "init", "--demo", "--home", str(home)], check=True, capture_output=True)
    serve = [fleet.program, "serve", "--home", home, "--config", fleet.configuration]
    server = Server([*serve, "--search-key", site])
    try:
        person = server.person()
        require(person.read("session", {"link": server.link})["searches"] is True, "the page does not offer to search")

        def found(**asked):
            told = person.read("fleet/cases/search", asked)
            return {row["case"] for row in told["cases"]}, told

        patients, told = found(patient=PATIENT)
        require(patients == {cases["coded"], cases["again"]}, f"the page finds {told}")
        require((told["looked_at"], told["without_note"], told["not_by_this_key"], told["next"]) == (5, 2, 0, None), f"told: {told}")
        require(found(patient=PATIENT, authority="northern hospital")[0] == {cases["coded"]}, "not by who gave it")
        require(found(procedure=CODE.lower())[0] == {cases["coded"], cases["other"]}, "not by the procedure")
        require(found(patient=OTHER, procedure=CODE)[0] == {cases["other"]}, "not by both")
        require(found(patient=PATIENT, appliance="or-2")[0] == set(), "on another appliance")
        first, told = found(patient=PATIENT, limit=1)
        require(first | found(patient=PATIENT, limit=1, after=told["next"])[0] == patients, "pages are not the whole answer")
        for asked, why in (({}, b"to search give 'patient' or 'procedure'"), ({"patient": "000"}, b"nothing can be searched"),
                           ({"procedure": CODE, "authority": "x"}, b"stands beside"), ({"patient": PATIENT, "limit": 0}, b"'limit' must be"),
                           ({"patient": 47}, b"'patient'")):
            status, text = person.ask("fleet/cases/search", asked)
            require(status == 400 and why in text, f"{asked} is answered with {status}: {text}")
        require(server.person().ask("fleet/cases/search", {"patient": PATIENT})[0] == 401, "a stranger searches")
        # Who may list cases and not watch them sees no search, and is refused one.
        person.tell("users", {"user": "auditor", "password": "a long password of theirs", "role": "auditor"})
        auditor = server.person()
        session = auditor.read("session", {"user": "auditor", "password": "a long password of theirs"})
        require(session["searches"] is False and auditor.ask("fleet/cases")[0] == 200, f"an auditor's session is {session}")
        require(auditor.ask("fleet/cases/search", {"patient": PATIENT})[0] == 403, "an auditor searches")
    finally:
        server.end()
    entered = (home / "archive" / "log" / "ledger.jsonl").read_text()
    for deed in ("searched for cases of a patient", "searched for cases of a procedure", "searched for cases of a patient and a procedure"):
        require(f'"{deed}"' in entered, f"the log does not tell that somebody {deed}")
    kept = b"".join(file.read_bytes() for file in home.rglob("*") if file.is_file())
    require(not any(secret.encode() in kept for secret in (PATIENT, PATIENT.lstrip("0"), OTHER)), "whom somebody sought is kept")
    server = Server(serve)
    try:
        person = server.person()
        require(person.read("session", {"link": server.link})["searches"] is False, "it offers to search without a key")
        require(person.ask("fleet/cases/search", {"patient": PATIENT})[0] == 404, "it searches without a key")
    finally:
        server.end()


def forged_notes_are_refused(folder, store, fleet, search, cases, of_or_2):
    """By somebody who has an appliance's access key of the store, and no search key."""
    note = store.get("recordings", f"or-1/search/{cases['coded']}.json")
    renamed = note.replace(cases["coded"].encode(), cases["free"].encode())
    body = folder / "forged"

    def put(what, case, appliance="or-1"):
        body.write_bytes(what)
        store.put("recordings", f"{appliance}/search/{case}.json", body)

    put(note.replace(cases["coded"].encode(), of_or_2.encode()), of_or_2, "or-2")
    put(renamed, cases["free"])
    put(note, cases["again"])
    put(b"x" * 5_000_000, cases["other"])
    put(note, "not-a-case")
    put(b"", "20200101T000000Z-00000000")
    done = fleet.ask("index")
    require(done.returncode == 3 and done.stderr.count("none of this case") == 3, f"the index says {done.returncode}: {done.stderr}")
    done = fleet.ask("index")
    require(done.returncode == 0 and done.stderr == "", f"what was refused is read again: {done.stderr}")
    told = search.told("--patient", PATIENT)
    require([row["case"] for row in told["cases"]] == [cases["coded"]] and told["not_by_this_key"] == 4, f"told: {told}")
    shown = fleet.ask("cases", "--search-key", str(search.key), "--patient", PATIENT)
    require("notes of 4 of them were not made by this key" in shown.stdout, f"shown: {shown.stdout}")
    # The true ones are there yet, and can be put anew.
    versions = store.listed("recordings", "VersionId")
    require(all(len(versions[f"or-1/search/{cases[name]}.json"]) == 2 for name in ("again", "other")), "a version is gone")


def without_its_key_it_records_all_the_same(programs, fleet, search, appliance):
    (appliance.home / "search.key").rename(appliance.home / "away.key")
    done = appliance.ask("record", "--endoscope", "synthetic:endoscope?size=160x120&rate=10", "--duration", "1s")
    require(done.returncode == 0 and "there is no search key in" in done.stderr, f"left with {done.returncode}: {done.stderr}")
    require("search key" in appliance.ask("doctor").stdout, "the doctor is silent about it")
    (appliance.home / "away.key").rename(appliance.home / "search.key")
    # Nobody would find by the key of another name.
    (appliance.home / "search.key").unlink()
    require(search_key(programs, "--from", search.key, "--appliance", "or-7", "-o", appliance.home / "search.key").returncode == 0, "no key")
    done = appliance.ask("ship")
    require("the key of [search] is of the appliance or-7" in done.stderr, f"shipped with another's key: {done.stderr}")
    (appliance.home / "search.key").unlink()
    # A key that follows another one, of which nothing is there any more.
    require(search_key(programs, "--from", search.key, "--appliance", "or-1", "-o", appliance.home / "search.key").returncode == 0, "no key")
    newest = recorded(appliance, {"patient": {"id": PATIENT}})
    appliance.kiroku("ship")
    fleet.tell("index")
    require(newest in search.found("--patient", PATIENT), "a second key's case is not found")


def run(programs, folder, endpoint, connection):
    store = Store(endpoint)
    store.make_bucket("recordings")
    appliances = {}
    for name in ("or-1", "or-2"):
        appliances[name] = Appliance(programs, folder / name, store.endpoint, "recordings")
        toml = appliances[name].home / "kiroku.toml"
        toml.write_text(toml.read_text().replace('appliance = "or-1"', f'appliance = "{name}"'))
    appliance = appliances["or-1"]
    site = opted_in(programs, folder, appliance)
    procedure = {"code": CODE, "coding_system": "JP", "description": "EMR"}
    cases = {"free": recorded(appliance),
             "coded": recorded(appliance, {"patient": {"id": PATIENT, "id_issuer": "Northern Hospital"}, "procedure": procedure}),
             "again": recorded(appliance, {"patient": {"id": int(PATIENT)}}),
             "other": recorded(appliance, {"patient": {"id": OTHER}, "procedure": {"code": CODE}})}
    # A site opts in appliance by appliance.
    of_or_2 = recorded(appliances["or-2"], {"patient": {"id": PATIENT}, "procedure": procedure})
    for each in appliances.values():
        each.kiroku("ship")
    again = json.loads(appliance.kiroku("ship", "--json"))
    require(again["sent"] == 0 and again["waiting"] == 0, f"sent again: {again}")

    fleet = Fleet(programs, folder / "fleet", store.endpoint, connection, appliances)
    require(fleet.ask("init").returncode == 0, "init failed")
    told = fleet.tell("index")["appliances"]
    require([(each["notes"], each["notes_read"]) for each in told] == [(3, 3), (0, 0)], f"the index says {told}")
    require(all(each["notes_read"] == 0 for each in fleet.tell("index")["appliances"]), "what did not change was read again")
    search = Search(fleet, site)
    finds_what_was_recorded(fleet, search, cases)
    is_what_the_format_says(store, site, cases["coded"])
    says_nothing_to_others(programs, folder, store, fleet, search, cases, connection, appliance)

    the_page_finds_and_tells_of_it(programs, folder, fleet, site, cases)

    # Lost, the catalogue is made anew from the store.
    subprocess.run([*"psql -qtA -v ON_ERROR_STOP=1 -d".split(), connection, "-c", "DROP SCHEMA kiroku CASCADE"], check=True)
    require(fleet.ask("init").returncode == 0, "init failed")
    fleet.tell("index")
    finds_what_was_recorded(fleet, search, cases)
    require(all(row["verdict"].startswith("intact") for row in fleet.tell("verify")["cases"]), "a case with a note does not hold")

    forged_notes_are_refused(folder, store, fleet, search, cases, of_or_2)
    without_its_key_it_records_all_the_same(programs, fleet, search, appliance)


def main():
    with_store_and_postgres(run)
    print("Cases are found by who has the site's search key, and the store and the database hold hashes alone.")


if __name__ == "__main__":
    main()
