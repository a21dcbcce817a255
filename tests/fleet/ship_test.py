#!/usr/bin/env python3
"""Ships cases to a real Ceph store with Object Lock, and holds `kiroku ship` to what it promises.

Usage: tests/fleet/ship_test.py PROGRAMS
  PROGRAMS  the folder of kiroku and kiroku-verify, such as build/release/apps

Exit status: 0 everything holds, 1 something does not, 77 Ceph is not installed.
"""
import contextlib
import datetime
import hashlib
import json
import os
import pathlib
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import urllib.parse
import xml.etree.ElementTree as xml

HERE = pathlib.Path(__file__).resolve().parent
USER = "testaccess:testsecret0123456789"
EMPTY = hashlib.sha256(b"").hexdigest()


def require(condition, sentence):
    if not condition:
        sys.exit(f"FAILED: {sentence}")


class Store:
    """The store as its administrator sees it, by curl alone."""

    def __init__(self, endpoint):
        self.endpoint = endpoint

    def ask(self, method, path, *headers):
        command = ["curl", "-sS", "-m", "60", "-X", method, "--aws-sigv4", "aws:amz:us-east-1:s3", "--user", USER,
                   "-H", f"x-amz-content-sha256: {EMPTY}", "-w", "\n%{http_code}", self.endpoint + path]
        for header in headers:
            command += ["-H", header]
        body, _, status = subprocess.run(command, check=True, capture_output=True).stdout.rpartition(b"\n")
        return int(status), body

    def has_no_request(self):
        """Whether the gateway has answered all that was asked of it, also by programs that are gone."""
        port = int(self.endpoint.rsplit(":", 1)[1])
        connections = [line.split() for line in pathlib.Path("/proc/net/tcp").read_text().splitlines()[1:]]
        established, closed_by_the_other = "01", "08"
        return not any(int(words[1].split(":")[1], 16) == port and words[3] in (established, closed_by_the_other)
                       for words in connections)

    def make_bucket(self, name, locked=True):
        status, body = self.ask("PUT", f"/{name}", *(["x-amz-bucket-object-lock-enabled: true"] if locked else []))
        require(status == 200, f"the bucket {name} was not made: {body}")

    def put(self, bucket, key, file):
        """A new version of an object, by somebody who has the access key."""
        self.send(f"{bucket}/{key}", file)

    def set_policy(self, bucket, file):
        self.send(f"{bucket}?policy=", file)

    def send(self, path, file):
        command = ["curl", "-sS", "-m", "60", "-T", str(file), "--aws-sigv4", "aws:amz:us-east-1:s3", "--user", USER, "-H",
                   f"x-amz-content-sha256: {hashlib.sha256(file.read_bytes()).hexdigest()}", "-f", f"{self.endpoint}/{path}"]
        require(subprocess.run(command, capture_output=True).returncode == 0, f"{path} was not put")

    def versions(self, bucket):
        """Every version of every object: {key: [version, ...]}."""
        return self.listed(bucket, "VersionId")

    def times(self, bucket):
        """When each object was put first, as text that can be ordered."""
        return {key: min(times) for key, times in self.listed(bucket, "LastModified").items()}

    def listed(self, bucket, what):
        found, after = {}, ""
        while True:
            status, body = self.ask("GET", f"/{bucket}?{after}versions=")
            require(status == 200, f"cannot list {bucket}: {body}")
            tree = xml.fromstring(body)
            space = tree.tag[: tree.tag.index("}") + 1]
            for version in tree.iter(space + "Version"):
                found.setdefault(version.findtext(space + "Key"), []).append(version.findtext(space + what))
            if tree.findtext(space + "IsTruncated") != "true":
                return found
            # Quoted and in this order, or curl signs another query than it asks. A marker without a version would begin with its key again.
            after = "".join(f"{name}={urllib.parse.quote(tree.findtext(space + told), safe='')}&"
                            for name, told in (("key-marker", "NextKeyMarker"), ("version-id-marker", "NextVersionIdMarker")))

    def get(self, bucket, key):
        status, body = self.ask("GET", f"/{bucket}/{key}")
        require(status == 200, f"cannot get {key}: {status}")
        return body


class Appliance:
    def __init__(self, programs, folder, endpoint, bucket):
        self.programs, self.home = programs, folder
        self.environment = dict(os.environ, KIROKU_HOME=str(folder))
        self.kiroku("init", "--demo")
        (folder / "store-credentials").touch(mode=0o600)
        (folder / "store-credentials").write_text("access_key = testaccess\nsecret_key = testsecret0123456789\n")
        with open(folder / "kiroku.toml", "a", encoding="utf-8") as toml:
            toml.write(f'\n[store]\nendpoint = "{endpoint}"\nbucket = "{bucket}"\nretain = "1d"\nappliance = "or-1"\n')

    def command(self, *words):
        return [str(self.programs / "kiroku"), *words]

    def ask(self, *words):
        return subprocess.run(self.command(*words), env=self.environment, capture_output=True, text=True, timeout=120)

    def kiroku(self, *words):
        done = self.ask(*words)
        require(done.returncode == 0, f"kiroku {' '.join(words)} left with {done.returncode}: {done.stderr}")
        return done.stdout

    def record(self, seconds):
        return subprocess.Popen(
            self.command("record", "--endoscope", "synthetic:endoscope?size=160x120&rate=10", "--vitals",
                         "synthetic:patient", "--duration", f"{seconds}s", "--json"),
            env=self.environment, stdout=subprocess.PIPE, text=True)

    def recorded(self, seconds):
        recording = self.record(seconds)
        require(recording.wait(timeout=120) == 0, "recording failed")
        return pathlib.Path(json.loads(recording.stdout.read())["case"]).name

    def archive_files(self):
        archive = self.home / "archive"
        return {str(file.relative_to(archive)): file for file in archive.rglob("*")
                if file.is_file() and not file.name.startswith(".") and ".part" not in file.name}


def eventually(condition, sentence):
    for _ in range(600):
        if condition():
            return
        time.sleep(0.1)
    sys.exit(f"FAILED: {sentence}, and did not within a minute")


def closed_cases_are_whole_in_the_store(appliance, store):
    case = appliance.recorded(4)
    told = json.loads(appliance.kiroku("ship", "--json"))
    require(told["waiting"] == 0 and not told["problems"], f"something was left: {told}")
    keys = store.versions("recordings")
    # The log's ledger always grows; all else stands under its own name.
    wanted = {f"or-1/{name}" for name in appliance.archive_files() if name != "log/ledger.jsonl"}
    require(wanted <= set(keys), f"not in the store: {sorted(wanted - set(keys))[:5]}")
    others = {key for key in set(keys) - wanted if not key.startswith("or-1/growing/log/")}
    require(not others, f"nobody asked for {sorted(others)[:5]}")
    require(told["sent"] == len(keys), f"{told['sent']} objects sent, and {len(keys)} are there")
    status, words = judged(appliance, store, case)
    require(status == 0 and "\nINTACT" in words, f"the store's copy is not intact: {words}")
    growth = b"".join(store.get("recordings", key) for key in sorted(keys) if key.startswith("or-1/growing/log/"))
    require(growth == (appliance.home / "archive/log/ledger.jsonl").read_bytes(), "the log's parts are not the log")


def nothing_is_put_twice(appliance, store):
    # So that the log is in the store in several parts.
    appliance.recorded(2)
    appliance.kiroku("ship")
    before = store.versions("recordings")
    require(sum(key.startswith("or-1/growing/log/") for key in before) > 1, "the log did not grow")
    again = json.loads(appliance.kiroku("ship", "--json"))
    require(again["sent"] == 0, f"sent again: {again}")
    # Without its list it asks the store.
    for each in appliance.home.glob("shipping-*.sqlite"):
        each.unlink()
    found = json.loads(appliance.kiroku("ship", "--json"))
    require(found["sent"] == 0 and found["found"] == len(before), f"not found again: {found}, of {len(before)}")
    require(store.versions("recordings") == before, "there are more versions than before")
    # What lies there whole is not looked at file by file any more, and a change in it is noticed all the same.
    time.sleep(2.5)
    appliance.kiroku("ship")
    (listed,) = appliance.home.glob("shipping-*.sqlite")
    with contextlib.closing(sqlite3.connect(listed)) as database:
        whole = {folder for (folder,) in database.execute("SELECT folder FROM whole")}
    cases = {each.name for each in (appliance.home / "archive").iterdir() if each.name.startswith("2")}
    require(whole == cases | {"log"}, f"whole in the store are {whole}, and cases are {cases}")
    case = min(cases)
    (appliance.home / "archive" / case / "authorities").mkdir(exist_ok=True)
    (appliance.home / "archive" / case / "authorities/another.pem").write_text("none")
    require(json.loads(appliance.kiroku("ship", "--json"))["sent"] == 1, "a new file in a whole case was not noticed")
    (appliance.home / "archive" / case / "authorities/another.pem").unlink()
    # A file that was written anew with the same bytes is there already.
    chain = next((appliance.home / "archive" / case / "authorities").iterdir())
    before, same = store.versions("recordings"), chain.read_bytes()
    chain.unlink()
    chain.write_bytes(same)
    again = json.loads(appliance.kiroku("ship", "--json"))
    require(again["sent"] == 0 and again["waiting"] == 0, f"a file with the same bytes is shipped again: {again}")
    require(store.versions("recordings") == before, "a file with the same bytes has a second version")


def a_killed_shipper_goes_on(appliance, store):
    case = appliance.recorded(6)
    for wait in (0.05, 0.1, 0.2, 0.4):
        shipping = subprocess.Popen(appliance.command("ship"), env=appliance.environment, stdout=subprocess.DEVNULL)
        time.sleep(wait)
        shipping.kill()
        shipping.wait()
        # What it had sent is not there yet, and would be put once more (docs/how-to/ship-to-a-store.md).
        eventually(store.has_no_request, "the gateway answers a killed program")
    told = json.loads(appliance.kiroku("ship", "--json"))
    require(told["waiting"] == 0, f"something was left: {told}")
    doubled = [key for key, versions in store.versions("recordings").items()
               if key.startswith(f"or-1/{case}/") and len(versions) > 1]
    require(not doubled, f"put twice: {doubled}")


def judged(appliance, store, case, name="or-1", trust=None):
    """What kiroku-verify says of the store's copy alone: its exit status and its words. `trust`: the root of an outside authority."""
    roots = ["--trust", str(trust)] if trust else []
    with tempfile.TemporaryDirectory() as copy:
        parts = b""
        for key in sorted(store.versions("recordings")):
            if key.startswith(f"{name}/growing/{case}/"):
                parts += store.get("recordings", key)
            if key.startswith(f"{name}/{case}/"):
                file = pathlib.Path(copy, key)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(store.get("recordings", key))
        folder = pathlib.Path(copy, name, case)
        ledger = folder / "ledger.jsonl"
        if ledger.exists():
            require(ledger.read_bytes().startswith(parts), "the parts of the ledger are not its beginning")
        else:
            ledger.write_bytes(parts)
        done = subprocess.run([str(appliance.programs / "kiroku-verify"), str(folder), "--device",
                               str(appliance.home / "device.pub"), "--own-authority",
                               str(appliance.home / "own-authority.pem"), *roots], capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr


def a_destroyed_appliances_case_reads_as_cut_off(appliance, store):
    for wait in (1.5, 2.2, 2.9, 3.3, 3.7):
        recording = appliance.record(30)
        following = subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment,
                                     stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        known = set(store.versions("recordings"))
        eventually(lambda: any("/growing/2" in key for key in set(store.versions("recordings")) - known),
                   "no line of the case came")
        time.sleep(wait)
        for each in (following, recording):
            each.kill()
            each.wait()
        case = next(key.split("/")[2] for key in set(store.versions("recordings")) - known if "/growing/2" in key)
        status, words = judged(appliance, store, case)
        require(status == 3 and "\nINCOMPLETE" in words, f"destroyed after {wait} s it reads: {status} {words}")
        # The appliance comes back.
        appliance.kiroku("recover")
        appliance.kiroku("ship")
        status, words = judged(appliance, store, case)
        require(status in (0, 3) and "TAMPERED" not in words, f"recovered it reads: {words}")


def another_machine_gets_the_cases_back(appliance, store):
    """A running case whose appliance is gone, and a closed one, by the store's keys and another home."""
    closed = appliance.recorded(4)
    appliance.kiroku("ship")
    recording = appliance.record(30)
    known = set(store.versions("recordings"))
    following = subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL)
    # The second part has the lines of segments, which are there before it.
    eventually(lambda: sum("/growing/2" in key for key in set(store.versions("recordings")) - known) > 1, "no line of a segment came")
    for each in (following, recording):
        each.kill()
        each.wait()
    running = next(key.split("/")[2] for key in set(store.versions("recordings")) - known if "/growing/2" in key)
    other = Appliance(appliance.programs, appliance.home.parent / "rescuer", store.endpoint, "recordings")
    listed = json.loads(other.kiroku("fetch", "--list", "--json"))["cases"]
    cases = {each.name for each in (appliance.home / "archive").iterdir() if each.name.startswith("2")}
    require(set(listed) == cases, f"listed {listed}, and there are {cases}")
    keys = ("--device", str(appliance.home / "device.pub"), "--own-authority", str(appliance.home / "own-authority.pem"))
    folder = appliance.home.parent / "fetched"
    told = other.ask("fetch", closed, "-o", str(folder), *keys)
    require(told.returncode == 0 and "\nINTACT" in told.stdout, f"closed: {told}")
    source = appliance.home / "archive" / closed
    same = {str(file.relative_to(source)): file.read_bytes() for file in source.rglob("*") if file.is_file()}
    require(same == {str(file.relative_to(folder / closed)): file.read_bytes() for file in (folder / closed).rglob("*") if file.is_file()},
            "what was fetched is not what was recorded")
    told = other.ask("fetch", running, "-o", str(folder), "--json", *keys)
    (case,) = json.loads(told.stdout)["cases"]
    require(told.returncode == 3 and case["report"]["verdict"] == "incomplete" and not case["closed"], f"running: {told}")
    require(case["report"]["streams"][0]["segments"] > 0, f"no segment of it: {case['report']}")
    again = other.ask("fetch", running, "-o", str(folder), *keys)
    require(again.returncode == 2 and "is there already" in again.stderr, f"written over: {again}")
    # As of 'kiroku verify': a case that nobody witnessed is not what the policy asks for.
    policy = appliance.home.parent / "witnesses.txt"
    witness = other.kiroku("witness", "init", str(appliance.home.parent / "witness"), "--name", "w", "--json")
    policy.write_text(f"witness w {json.loads(witness)['key']}\nquorum w\n")
    told = other.ask("fetch", closed, "-o", str(folder / "witnessed"), "--witnesses", str(policy), *keys)
    require(told.returncode == 3 and "\nINTACT" in told.stdout, f"not witnessed: {told}")
    told = other.ask("fetch", "--all", "-o", str(folder / "all"), "--against", str(policy), *keys)
    require(told.returncode == 2 and "are of one case" in told.stderr, f"--all --against: {told}")
    nothing = other.ask("fetch", "20200101T000000Z-00000000", "-o", str(folder))
    require(nothing.returncode == 2 and "has nothing of case" in nothing.stderr, f"{nothing}")
    # Somebody with the appliance's keys puts another version of a segment, and a name that leads out of the folder.
    segment = f"or-1/{closed}/segments/endoscope/00000000.ts.age"
    store.ask("PUT", f"/recordings/{segment}", "Content-Length: 0")
    store.ask("PUT", f"/recordings/or-1/{closed}/.hidden", "Content-Length: 0")
    told = other.ask("fetch", closed, "-o", str(folder / "second"), *keys)
    require(told.returncode == 0 and "another version was taken" in told.stderr and "'or-1/" in told.stderr, f"another version: {told}")
    require(not (folder / "second" / closed / ".hidden").exists(), "a hidden file came")
    appliance.kiroku("recover")
    appliance.kiroku("ship")


def another_device_states_what_a_lost_appliance_shipped(appliance, store):
    """A recorder is destroyed in the middle of a case: another appliance says how far the store has it, and nobody ends it."""
    other = Appliance(appliance.programs, appliance.home.parent / "or-2", store.endpoint, "recordings")
    toml = other.home / "kiroku.toml"
    toml.write_text(toml.read_text(encoding="utf-8").replace('appliance = "or-1"', 'appliance = "or-2"'), encoding="utf-8")
    closed = appliance.recorded(2)
    recording = appliance.record(600)  # it is killed
    known = set(store.versions("recordings"))
    following = subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL)
    eventually(lambda: sum("/growing/2" in key for key in set(store.versions("recordings")) - known) > 1, "no line of a segment came")
    for each in (following, recording):
        each.kill()
        each.wait()
    eventually(store.has_no_request, "the gateway answers a killed program")
    lost = next(key.split("/")[2] for key in set(store.versions("recordings")) - known if "/growing/2" in key)
    before = store.versions("recordings")
    folder = appliance.home.parent / "stated"
    device = ("--device", str(appliance.home / "device.pub"), "--own-authority", str(appliance.home / "own-authority.pem"))

    def refused(case, sentence, *words, by=other, into="refused"):
        told = by.ask("recover", "--from-store", case, "--appliance", "or-1", "-o", str(folder / into), *words)
        require(told.returncode == 2 and sentence in told.stderr, f"expected '{sentence}': {told}")
        require(store.versions("recordings") == before, f"something was put: {told}")

    # What came a moment ago may be of an appliance that goes on.
    refused(lost, "may still record", *device)
    refused(lost, "is not trusted here", "--force", into="strange")
    refused(closed, "was brought to its end by its own device", "--force", *device, into="closed")
    refused(lost, "is this device's own", "--force", by=appliance, into="own")
    refused("20200101T000000Z-00000000", "the store has nothing of case", *device)
    lonely = other.ask("recover", "--appliance", "or-1")
    require(lonely.returncode == 2 and "are for --from-store" in lonely.stderr, f"{lonely}")

    command = ("recover", "--from-store", lost, "--appliance", "or-1", "--force", *device)
    told = other.ask(*command, "-o", str(folder / "first"), "--json")
    require(told.returncode == 0, f"not stated: {told}")
    told = json.loads(told.stdout)
    require(told["report"]["verdict"] == "incomplete" and told["statement"]["entries"]["size"] == told["report"]["entries"], f"{told}")
    require(told["time"] == "self-issued" and len(told["in_store"]) == 2, f"no time-stamp of its own authority: {told}")
    after = store.versions("recordings")
    put = set(after) - set(before)
    require(put == {each["key"] for each in told["in_store"]} and all(key.startswith(f"or-1/store-statements/{lost}/") for key in put), f"put: {put}")
    require({key: after[key] for key in before} == before, "something of the case was put anew")
    for key in put:
        status, body = store.ask("DELETE", f"/recordings/{key}?versionId={after[key][0]}")
        require(status == 403, f"the statement could be removed: {status} {body}")
    # This device's log knows it, by its hash.
    statement = pathlib.Path(told["statement"]["file"])
    hashed = hashlib.sha256(statement.read_bytes()).hexdigest()
    entries = [json.loads(line) for line in (other.home / "archive/log/ledger.jsonl").read_text().splitlines()]
    require(any(each.get("case") == lost and hashed in each.get("what", "") for each in entries), "the log does not tell of it")
    require(entries.index(next(each for each in entries if hashed in each.get("what", ""))) >= told["statement"]["log"]["size"], "the log told before")

    # Whoever fetches the case gets the statement, and what it says is told by whoever trusts both devices.
    keys = (*device, "--device", str(other.home / "device.pub"), "--own-authority", str(other.home / "own-authority.pem"))

    def findings(into, *given):
        fetched = other.ask("fetch", lost, "--appliance", "or-1", "-o", str(folder / into), "--json", *given)
        report = json.loads(fetched.stdout)["cases"][0]["report"]
        require(fetched.returncode == {"incomplete": 3}.get(report["verdict"], 0), f"{fetched}")
        codes = {each["code"]: each["text"] for each in report["findings"] if each["code"].startswith("store-statement-")}
        foreign = subprocess.run([sys.executable, "-B", str(HERE.parent / "foreign/verify.py"), str(folder / into / lost), *map(str, given)],
                                 capture_output=True, text=True, check=True)
        theirs = json.loads(foreign.stdout)
        require({code for code in theirs["codes"] if code.startswith("store-statement-")} == set(codes) and theirs["verdict"] == report["verdict"],
                f"the other verifier says {theirs}, and this one {report['verdict']} {codes}")
        return report["verdict"], codes

    verdict, codes = findings("second", *keys)
    require(verdict == "incomplete" and set(codes) == {"store-statement-holds"}, f"{verdict} {codes}")
    require("as its own authority says" in codes["store-statement-holds"], f"{codes}")
    verdict, codes = findings("third", *device)
    require(verdict == "incomplete" and set(codes) == {"store-statement-untrusted"}, f"{verdict} {codes}")
    # What somebody with the appliance's keys to the store puts in its place is a newer version.
    empty = appliance.home.parent / "empty"
    empty.write_bytes(b"")
    store.put("recordings", told["in_store"][0]["key"], empty)
    require(set(findings("fourth", *keys)[1]) == {"store-statement-holds"}, "a newer version took the statement's place")
    # And what they take away from a copy is found out.
    ledger = folder / "fourth" / lost / "ledger.jsonl"
    ledger.write_bytes(b"".join(ledger.read_bytes().splitlines(True)[:-1]))
    done = subprocess.run([str(appliance.programs / "kiroku-verify"), str(folder / "fourth" / lost), "--json", *keys], capture_output=True, text=True)
    require("store-statement-differs" in done.stdout and json.loads(done.stdout)["verdict"] == "incomplete", f"{done}")

    # The appliance comes back, and ends its case itself.
    appliance.kiroku("recover")
    appliance.kiroku("ship")
    verdict, codes = findings("back", *keys)
    require(verdict == "intact-with-gaps" and set(codes) == {"store-statement-holds", "store-statement-outgrown"}, f"{verdict} {codes}")
    before = store.versions("recordings")
    refused(lost, "was brought to its end by its own device", "--force", *device, into="ended")


def an_appliance_of_the_same_name_is_told(appliance, store):
    other = Appliance(appliance.programs, appliance.home.parent / "other", store.endpoint, "recordings")
    other.recorded(2)
    told = other.ask("ship", "--json")
    require(told.returncode == 3 and "another appliance ships under the same name" in told.stdout,
            f"two logs were mixed: {told.stdout}")


def another_store_has_another_list(appliance, store):
    store.make_bucket("second")
    toml = appliance.home / "kiroku.toml"
    good = toml.read_text(encoding="utf-8")
    toml.write_text(good.replace('bucket = "recordings"', 'bucket = "second"'), encoding="utf-8")
    told = json.loads(appliance.ask("ship", "--status", "--json").stdout)
    require(told["in_store"] == 0 and told["waiting"] > 10, f"the first store's objects count as the second's: {told}")
    toml.write_text(good, encoding="utf-8")


def files_go_before_lines_and_lines_before_notes(store, case):
    times, parts = store.times("recordings"), []
    lines = store.get("recordings", f"or-1/{case}/ledger.jsonl").decode().splitlines()
    put = []  # when each line was
    for key in sorted(times):
        if key.startswith(f"or-1/growing/{case}/"):
            parts.append(key)
            put += [times[key]] * store.get("recordings", key).count(b"\n")
    require(len(parts) > 2, f"the ledger grew in {len(parts)} parts: nothing is shown")
    put += [times[f"or-1/{case}/ledger.jsonl"]] * (len(lines) - len(put))
    for line, when in zip(lines, put):
        entry = json.loads(line)
        if entry["type"] in ("segment", "token"):
            require(times[f"or-1/{case}/{entry['file']}"] <= when, f"{entry['file']} came after the line that names it")
    for key, when in times.items():
        if key.startswith(f"or-1/{case}/checkpoints/"):
            size = int(pathlib.Path(key).stem)
            require(put[size - 1] <= when, f"{key} came before the lines that it is of")


def a_running_case_goes_meanwhile(appliance, store):
    recording = appliance.record(20)
    following = subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment,
                                 stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    known = set(store.versions("recordings"))

    def grows():
        new = set(store.versions("recordings")) - known
        return any("/growing/2" in key for key in new) and any("/segments/endoscope/" in key for key in new)

    eventually(grows, "segments and lines of the running case did not come")
    require(recording.poll() is None, "the case ended before anything of it was in the store: nothing is shown")
    second = appliance.ask("ship")
    require(second.returncode == 2 and "another 'kiroku ship' is at work" in second.stderr,
            f"a second one was not refused: {second.stderr}")
    require(recording.wait(timeout=120) == 0, "recording failed")
    case = pathlib.Path(json.loads(recording.stdout.read())["case"]).name
    newest = sorted((appliance.home / "archive" / case / "checkpoints").iterdir())[-1].name
    eventually(lambda: f"or-1/{case}/checkpoints/{newest}" in store.versions("recordings"), "its end did not come")
    status, words = judged(appliance, store, case)
    require(status == 0 and "\nINTACT" in words, f"the store's copy is not intact: {words}")
    files_go_before_lines_and_lines_before_notes(store, case)
    following.send_signal(signal.SIGTERM)
    require(following.wait(timeout=60) == 0, f"it did not end: {following.stderr.read()}")


def locks_hold(appliance, store):
    require("The locks of this store hold" in appliance.kiroku("ship", "--probe"), "the locks were not told to hold")
    require("holds what it locks" in appliance.ask("doctor").stdout, "kiroku doctor says nothing of the store")
    key, versions = next((key, versions) for key, versions in store.versions("recordings").items() if "/segments/" in key)
    status, body = store.ask("DELETE", f"/recordings/{key}?versionId={versions[0]}",
                             "x-amz-bypass-governance-retention: true")
    require(status == 403, f"the store's user could remove {key}: {status} {body}")


def longer_locks_reach_what_is_there(appliance, store):
    def locks():
        """When the lock of each version ends: {(key, version): text}."""
        told = {}
        for key, versions in store.versions("recordings").items():
            for version in versions if key.startswith("or-1/") and not key.startswith("or-1/probe/") else ():
                _, body = store.ask("GET", f"/recordings/{key}?retention=&versionId={version}")
                told[key, version] = body.partition(b"<RetainUntilDate>")[2].partition(b"T")[0].decode()
        return told

    toml, before = appliance.home / "kiroku.toml", locks()
    text = toml.read_text(encoding="utf-8")
    toml.write_text(text.replace('retain = "1d"', 'retain = "3d"'), encoding="utf-8")
    told = json.loads(appliance.kiroku("ship", "--json"))
    require(told["lengthened"] > len(before) / 2 and told["locks_left"] is None, f"not lengthened: {told}, of {len(before)}")
    after = locks()
    short = [each for each, until in before.items() if until and datetime.date.fromisoformat(after[each]) - datetime.date.fromisoformat(until)
             < datetime.timedelta(days=2)]
    require(not short, f"still as short: {short[:5]}")
    toml.write_text(text, encoding="utf-8")
    require(json.loads(appliance.kiroku("ship", "--json"))["lengthened"] == 0 and locks().items() >= after.items(), "a lock was shortened")


def what_the_store_holds_may_be_erased(appliance, store):
    case = appliance.recorded(4)
    erase = ("erase", case, "--stream", "endoscope", "--policy", "reviewed")
    kept = appliance.ask(*erase)
    require(kept.returncode == 1 and "is not in the store yet" in kept.stderr, f"erased its only copy: {kept.stderr}")
    appliance.kiroku("ship")
    require("erased 2 segments of endoscope" in appliance.kiroku(*erase), "what the store holds was not erased")
    told = json.loads(appliance.kiroku("ship", "--json"))
    require(told["waiting"] == 0 and not told["problems"], f"the ledger that tells of it did not follow: {told}")
    require(f"or-1/{case}/segments/endoscope/00000000.ts.age" in store.versions("recordings"), "the store lost it, too")


def holds(store, case):
    """What the store tells of the legal hold of every version of the case's objects."""
    told = {}
    for key, versions in store.versions("recordings").items():
        if key.startswith((f"or-1/{case}/", f"or-1/growing/{case}/")):
            for version in versions:
                status, body = store.ask("GET", f"/recordings/{key}?legal-hold=&versionId={version}")
                told[key, version] = b"<Status>ON<" in body
    return told


def what_is_held_stays_here_and_there(appliance, store):
    case = appliance.recorded(4)
    appliance.kiroku("ship")
    require(not any(holds(store, case).values()), "something is held that nobody held")
    # Whoever has the appliance's keys may have put other versions.
    segment = f"or-1/{case}/segments/endoscope/00000000.ts.age"
    status, body = store.ask("PUT", f"/recordings/{segment}", "Content-Length: 0")
    require(status == 200, f"no second version: {body}")
    appliance.kiroku("hold", case, "--reason", "court order")
    told = appliance.ask("ship", "--status", "--json")
    require(told.returncode == 3 and json.loads(told.stdout)["holds_waiting"] == [case], f"not told: {told.stdout}")
    require(json.loads(appliance.kiroku("ship", "--json"))["holds_waiting"] == [], "the store did not confirm the hold")
    held = holds(store, case)
    require(len(held) > 5 and all(held.values()), f"not held: {[key for key, on in held.items() if not on]}")
    require(sum(key == segment for key, _ in held) == 2, "another version was not looked at")
    erase = ("erase", case, "--stream", "endoscope", "--policy", "reviewed", "--only-copy")
    kept = appliance.ask(*erase)
    require(kept.returncode == 1 and "under legal hold" in kept.stderr and "court order" in kept.stderr, f"not kept: {kept}")
    # What comes later is held when it is put.
    (appliance.home / "archive" / case / "authorities").mkdir(exist_ok=True)
    (appliance.home / "archive" / case / "authorities/another.pem").write_text("none")
    appliance.kiroku("ship")
    require(holds(store, case).keys() > held.keys() and all(holds(store, case).values()), "what came later is not held")
    (appliance.home / "archive" / case / "authorities/another.pem").unlink()
    second = json.loads(appliance.kiroku("hold", case, "--reason", "complaint", "--json"))["hold"]
    refused = appliance.ask("release", case, "--reason", "settled")
    require(refused.returncode == 2 and "2 legal holds" in refused.stderr, f"which one? {refused.stderr}")
    appliance.kiroku("release", case, "--hold", str(second), "--reason", "settled")
    appliance.kiroku("ship")
    require(all(holds(store, case).values()), "one of two holds ended, and the store let go")
    appliance.kiroku("release", case, "--reason", "settled")
    # Also by a list that knows of no hold.
    for each in appliance.home.glob("shipping-*.sqlite"):
        each.unlink()
    appliance.kiroku("ship")
    require(not any(holds(store, case).values()), "the store holds what was released")
    require("erased 2 segments" in appliance.kiroku(*erase), "released, and not erased")


def a_day_passes(appliance):
    """For what was confirmed of legal holds."""
    for each in appliance.home.glob("shipping-*.sqlite"):
        with contextlib.closing(sqlite3.connect(each)) as shipped, shipped:
            shipped.execute("UPDATE hold_check SET at_us = at_us - 86400000000")


def what_is_lifted_in_the_store_is_set_again(appliance, store):
    case = appliance.recorded(2)
    appliance.kiroku("hold", case, "--reason", "court order")
    appliance.kiroku("ship")
    require(all(holds(store, case).values()), "it is not held")
    (segment,) = [each for each in holds(store, case) if each[0].endswith("endoscope/00000000.ts.age")]
    off = appliance.home / "off"

    def lift():
        off.write_text("<LegalHold><Status>OFF</Status></LegalHold>")
        store.send(f"recordings/{segment[0]}?legal-hold=&versionId={segment[1]}", off)
        require(not holds(store, case)[segment], "the store did not lift it")

    def found(words):
        done = appliance.ask("ship", "--json")
        told = json.loads(done.stdout)
        require(done.returncode == 3 and len(told["lifted"]) == 1 and segment[0] in told["lifted"][0], f"{words}, it is not told: {told}")
        require(all(holds(store, case).values()), f"{words}, it is not set again")
        require(json.loads(appliance.kiroku("ship", "--json"))["lifted"] == [], f"{words}, it is told twice")

    lift()
    a_day_passes(appliance)
    found("a day later")
    entries = json.loads(appliance.kiroku("log", "--json"))["entries"]
    said = [each["what"] for each in entries if each["type"] == "access" and each["case"] == case]
    require(said == [f"found the legal hold of 1 object of the case lifted in the store, {segment[0]}, and set it again"], f"the log says {said}")
    # Another hold of the case is a reason to look at once.
    lift()
    appliance.kiroku("hold", case, "--reason", "complaint")
    found("with a second hold")
    # The service says so in its journal.
    lift()
    a_day_passes(appliance)
    with open(appliance.home / "journal", "w+", encoding="utf-8") as journal:
        following = subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment, stdout=subprocess.DEVNULL, stderr=journal)
        eventually(lambda: all(holds(store, case).values()), "the service does not set it again")
        following.send_signal(signal.SIGTERM)
        require(following.wait(timeout=60) == 0, "it did not end")
        journal.seek(0)
        require(f"{segment[0]}, and set it again" in journal.read(), "the journal does not say so")
    (appliance.home / "journal").unlink()
    off.unlink()
    for each in json.loads(appliance.kiroku("hold", "--list", "--json"))["holds"]:
        if each["case"] == case:
            appliance.kiroku("release", case, "--hold", str(each["hold"]), "--reason", "settled")
    appliance.kiroku("ship")
    require(not any(holds(store, case).values()), "the store holds what was released")


def a_running_case_is_held(appliance, store):
    recording = appliance.record(12)
    following = subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment, stdout=subprocess.DEVNULL)
    known = set(store.versions("recordings"))

    def begun():
        return [key.split("/")[2] for key in set(store.versions("recordings")) - known if "/growing/2" in key]

    eventually(begun, "no line of the case came")
    case = begun()[0]
    appliance.kiroku("hold", case, "--reason", "complaint")
    require(recording.wait(timeout=120) == 0, "recording failed")
    eventually(lambda: f"or-1/{case}/ledger.jsonl" in store.versions("recordings"), "its end did not come")
    following.send_signal(signal.SIGTERM)
    require(following.wait(timeout=60) == 0, "it did not end")
    require(json.loads(appliance.kiroku("ship", "--json"))["holds_waiting"] == [], "the store did not confirm the hold")
    held = holds(store, case)
    require(len(held) > 5 and all(held.values()), f"not held: {[key for key, on in held.items() if not on]}")
    appliance.kiroku("release", case, "--reason", "settled")


def a_file_that_cannot_go_keeps_no_other_from_going(appliance, store):
    case = appliance.recorded(2)
    folder = appliance.home / "archive" / case
    (folder / "a stray file").write_text("of somebody")
    told = appliance.ask("ship", "--json")
    require(told.returncode == 3 and "cannot be the name of an object" in told.stdout, f"not told: {told.stdout}")
    require(f"or-1/{case}/ledger.jsonl" in store.versions("recordings"), "it kept the case from the store")
    (folder / "a stray file").unlink()
    # Without one of its segments the ledger would claim what is not there.
    case = appliance.recorded(2)
    segment = next((appliance.home / "archive" / case / "segments/endoscope").iterdir())
    segment.rename(segment.with_suffix(".kept"))
    segment.symlink_to(segment.with_suffix(".kept"))
    told = appliance.ask("ship", "--json")
    require(told.returncode == 3 and "is no regular file" in told.stdout, f"not told: {told.stdout}")
    require(f"or-1/{case}/ledger.jsonl" not in store.versions("recordings"), "the ledger went without its segment")
    segment.unlink()
    segment.with_suffix(".kept").rename(segment)
    appliance.kiroku("ship")
    require(f"or-1/{case}/ledger.jsonl" in store.versions("recordings"), "the ledger did not follow")


def the_logs_tree_is_published_there(appliance, store):
    """Somebody without keys follows the appliance log, by what the store gives to anybody."""
    other = Appliance(appliance.programs, appliance.home.parent / "published", store.endpoint, "recordings")
    toml = other.home / "kiroku.toml"
    before, _, name = toml.read_text(encoding="utf-8").rpartition('"or-1"')
    toml.write_text(f'{before}"or-2"\npublish_log = true{name}', encoding="utf-8")
    policy = other.home / "policy.json"
    page = (HERE.parents[1] / "docs/how-to/ship-to-a-store.md").read_text(encoding="utf-8")
    policy.write_text(re.search(r"```json\n(.*?)```", page, re.DOTALL).group(1).replace("or-1", "or-2"), encoding="utf-8")
    store.set_policy("recordings", policy)

    def followed(expected, status=0):
        told = other.ask("log", "follow", f"{store.endpoint}/recordings/or-2/published", str(other.home / "copy"), "--device",
                         str(other.home / "device.pub"))
        require(told.returncode == status and told.stdout.startswith(expected), f"expected {expected}: {told}")

    followed("COULD NOT TELL", 3)
    other.recorded(2)
    other.kiroku("ship")
    followed("BEGUN")
    before = set(store.versions("recordings"))
    other.kiroku("ship")
    require(set(store.versions("recordings")) == before, "what had not changed was published again")
    followed("SAME")
    shutil.copytree(other.home, other.home.parent / "backup")
    other.recorded(2)
    other.kiroku("ship")
    followed("GOES ON")
    keys = [key for key in store.versions("recordings") if key.startswith("or-2/published/")]
    require(all(key == "or-2/published/checkpoint" or key.startswith("or-2/published/tile/") for key in keys), f"also published: {keys}")
    require(len(store.versions("recordings")["or-2/published/checkpoint"]) == 2, "a checkpoint is not a version of its own")
    # Anybody may read that, and nothing else: no stream of a case either, whatever its name.
    of_a_case = "or-2/20261126T091502Z-3f9c21ab/segments/published/00000000.ts.age"
    store.put("recordings", of_a_case, policy)
    for key, open_to_all in (("or-2/published/checkpoint", True), ("or-2/growing/log/000000000000", False), (of_a_case, False)):
        answer = subprocess.run(["curl", "-s", "-o", "/dev/null", "-w", "%{http_code}", f"{store.endpoint}/recordings/{key}"],
                                capture_output=True, text=True).stdout
        require((answer == "200") == open_to_all, f"to anybody {key} answers {answer}")
    # What does not go on from there is not published, and that is told; all else is shipped.
    shutil.rmtree(other.home / "archive")
    shutil.copytree(other.home.parent / "backup/archive", other.home / "archive")
    told = other.ask("ship", "--json")
    require(told.returncode == 3 and any("NOT PUBLISHED" in each for each in json.loads(told.stdout)["problems"]), f"not told: {told}")
    followed("SAME")


def what_is_wrong_is_said(appliance, store):
    toml = appliance.home / "kiroku.toml"
    good = toml.read_text(encoding="utf-8")

    def refused(change, sentence):
        toml.write_text(change(good), encoding="utf-8")
        told = appliance.ask("ship")
        require(told.returncode == 2 and sentence in told.stderr, f"expected '{sentence}': {told.returncode} {told.stderr}")
        toml.write_text(good, encoding="utf-8")

    refused(lambda text: text.replace('bucket = "recordings"', 'bucket = "nowhere"'), "there is no such bucket")
    store.make_bucket("unlocked", locked=False)
    refused(lambda text: text.replace('bucket = "recordings"', 'bucket = "unlocked"'), "has no Object Lock")
    refused(lambda text: text.replace("http://127.0.0.1:", "http://127.0.0.2:1"), "does not answer")
    refused(lambda text: text[: text.rindex("[store]")], "names no store")
    credentials = appliance.home / "store-credentials"
    whole = credentials.read_text(encoding="utf-8")
    credentials.write_text(whole.replace("testsecret", "other"), encoding="utf-8")
    refused(lambda text: text, "the secret key is not the one of access key 'testaccess'")
    credentials.write_text(whole.replace("testaccess", "nobody"), encoding="utf-8")
    refused(lambda text: text, "does not know the access key 'nobody'")
    credentials.write_text(whole, encoding="utf-8")
    credentials.chmod(0o644)
    refused(lambda text: text, "can be read or written by others than their owner")
    credentials.chmod(0o600)


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="kiroku-fleet-"))
    with contextlib.ExitStack() as at_end:
        at_end.callback(shutil.rmtree, scratch, ignore_errors=True)
        at_end.callback(subprocess.run, [HERE / "store.sh", "down", scratch / "store"])
        started = subprocess.run([HERE / "store.sh", "up", scratch / "store"], stdout=subprocess.PIPE, text=True)
        if started.returncode != 0:
            print(started.stdout, end="")
            sys.exit(77 if started.returncode == 77 else 1)
        store = Store(started.stdout.strip())
        store.make_bucket("recordings")
        appliance = Appliance(programs, scratch / "home", store.endpoint, "recordings")
        for promise in (closed_cases_are_whole_in_the_store, longer_locks_reach_what_is_there, nothing_is_put_twice, a_killed_shipper_goes_on,
                        a_running_case_goes_meanwhile, a_destroyed_appliances_case_reads_as_cut_off,
                        another_machine_gets_the_cases_back, another_device_states_what_a_lost_appliance_shipped,
                        an_appliance_of_the_same_name_is_told, another_store_has_another_list, locks_hold,
                        what_the_store_holds_may_be_erased, what_is_held_stays_here_and_there,
                        what_is_lifted_in_the_store_is_set_again, a_running_case_is_held, a_file_that_cannot_go_keeps_no_other_from_going,
                        the_logs_tree_is_published_there, what_is_wrong_is_said):
            promise(appliance, store)
            print(f"holds: {promise.__name__.replace('_', ' ')}", flush=True)


if __name__ == "__main__":
    main()
