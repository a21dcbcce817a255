#!/usr/bin/env python3
"""Lets a real Ceph store rot below its locks, and has `kiroku-fleet verify` mend it from other copies.

Usage: tests/fleet/mend_test.py PROGRAMS
  PROGRAMS  the folder of kiroku and kiroku-fleet, such as build/release/apps

Exit status: 0 everything holds, 1 something does not, 77 Ceph or PostgreSQL is not installed.
"""
import datetime
import hashlib
import json
import shutil
import subprocess
import sys

from fleet_test import Fleet, with_store_and_postgres
from page_client import Server
from ship_test import HERE, Appliance, Store, require

sys.path.insert(0, str(HERE.parent / "foreign"))
import age  # noqa: E402
import case_writer  # noqa: E402
import note  # noqa: E402

BUCKET, COPIES = "recordings", "copies"


class Disks:
    """What lies below the gateway: bytes change there without anybody's key, and without a new version."""

    def __init__(self, ceph):
        self.ceph = ceph

    def rados(self, *words, **more):
        return subprocess.run(["rados", "-c", str(self.ceph / "ceph.conf"), "-p", "default.rgw.buckets.data", *words], check=True,
                              capture_output=True, timeout=120, **more).stdout

    def name_of(self, key, version):
        (name,) = [each for each in self.rados("ls").decode().splitlines() if each.endswith(f":{version}_{key}")]
        return name

    def has(self, key, version):
        return any(each.endswith(f":{version}_{key}") for each in self.rados("ls").decode().splitlines())

    def rot(self, key, version, change):
        """`change` makes other bytes of a version's; None removes them."""
        name = self.name_of(key, version)
        if change is None:
            self.rados("rm", name)
        else:
            self.rados("put", name, "-", input=change(self.rados("get", name, "-")))


def flipped(body):
    other = bytearray(body)
    other[len(other) // 2] ^= 1
    return bytes(other)


def truncated(body):
    return body[:len(body) // 2]


def of_other_hash(body):
    return body.replace(b'"sha256":"', b'"sha256":"0', 1)[:len(body)]


class Place:
    """A case in the store, its copies, and what a look at them tells."""

    def __init__(self, store, disks, appliance, case):
        self.store, self.disks, self.appliance, self.case = store, disks, appliance, case
        self.folder = appliance.home / "archive" / case

    def key(self, path):
        return f"or-1/{self.case}/{path}"

    def versions(self, path):
        return self.store.versions(BUCKET)[self.key(path)]

    def file(self, beginning):
        return min(str(file.relative_to(self.folder)) for file in self.folder.rglob("*")
                   if file.is_file() and str(file.relative_to(self.folder)).startswith(beginning))

    def rot(self, path, change):
        self.disks.rot(self.key(path), self.versions(path)[0], change)

    def rot_wholly(self, path):
        """Every version of it whose bytes are there."""
        rotten = flipped((self.folder / path).read_bytes())
        for version in self.versions(path):
            if self.disks.has(self.key(path), version):
                self.disks.rot(self.key(path), version, lambda _: rotten)

    def headers(self, path, version):
        done = subprocess.run(["curl", "-sSI", "--aws-sigv4", "aws:amz:us-east-1:s3", "--user", "testaccess:testsecret0123456789",
                               "-H", f"x-amz-content-sha256: {hashlib.sha256(b'').hexdigest()}",
                               f"{self.store.endpoint}/{BUCKET}/{self.key(path)}?versionId={version}"], check=True, capture_output=True, text=True)
        require(" 200" in done.stdout.splitlines()[0], f"the store does not tell of {path} {version}: {done.stdout}")
        return {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in done.stdout.splitlines())}

    def lock_of(self, path, version):
        return self.headers(path, version)["x-amz-object-lock-retain-until-date"]

    def is_whole(self):
        """What a plain copy of the bucket takes, the newest version of everything, is what was recorded."""
        for file in self.folder.rglob("*"):
            if file.is_file():
                path = str(file.relative_to(self.folder))
                require(self.store.get(BUCKET, self.key(path)) == file.read_bytes(), f"the newest version of {path} is not what was recorded")

    def judged(self, folder):
        """What 'kiroku fetch' says, which neither mends nor knows of copies."""
        shutil.rmtree(folder, ignore_errors=True)
        done = self.appliance.ask("fetch", self.case, "-o", str(folder), "--device", str(self.appliance.home / "device.pub"),
                                  "--own-authority", str(self.appliance.home / "own-authority.pem"), "--json")
        return json.loads(done.stdout)["cases"][0]["report"]["verdict"] if done.stdout else done.stderr


class Mending:
    """kiroku-fleet with copies, and with the home whose log tells what it mended."""

    def __init__(self, programs, folder, endpoint, connection, appliance):
        self.fleet = Fleet(programs, folder, endpoint, connection, {"or-1": appliance})
        self.programs, self.home, self.replica = programs, folder / "mending", folder / "replica"
        subprocess.run([str(programs / "kiroku"), "init", "--demo", "--home", str(self.home)], check=True, capture_output=True)
        (folder / "mending-credentials").write_bytes((folder / "store-credentials").read_bytes())
        (folder / "mending-credentials").chmod(0o600)
        with open(self.fleet.configuration, "a", encoding="utf-8") as toml:
            toml.write('[mending]\nhome = "mending"\ncredentials = "mending-credentials"\n'
                       f'[[copy]]\nname = "second"\nendpoint = "{endpoint}"\nbucket = "{COPIES}"\n'
                       '[[copy]]\nname = "replica"\nfolder = "replica"\n')

    def log(self):
        done = subprocess.run([str(self.programs / "kiroku"), "log", "--home", str(self.home), "--json"], check=True, capture_output=True, text=True)
        return [each for each in json.loads(done.stdout)["entries"] if each["type"] == "access"]

    def deeds(self):
        return [each["what"] for each in self.log()]

    def require_signed(self):
        done = subprocess.run([str(self.programs / "kiroku"), "log", "--verify", "--home", str(self.home)], capture_output=True, text=True)
        require(done.returncode == 0, f"the log of what was mended does not hold: {done.stdout}{done.stderr}")

    def verify(self, case, verdict, status=0):
        """{file: from}, {file: why not} of the one case."""
        # What rots has no new version, so the index does not see it: it is due by its time.
        told = self.fleet.tell("verify", "--all", status=status)
        (one,) = [each for each in told["cases"] if each["case"] == case]
        require(one["verdict"] == verdict or verdict == "intact" and one["verdict"].startswith("intact"), f"{case} is {one}")
        return ({each["file"]: each["from"] for each in one["mended"]}, {each["file"]: each["why"] for each in one["not_mended"]})


def rot_is_mended_from_whichever_copy_fits(mending, place, folder):
    require(mending.verify(place.case, "intact") == ({}, {}) and mending.deeds() == [], "what is whole was mended")
    segment, other, third = (f"segments/endoscope/{number:08}.ts.age" for number in range(3))
    token, note = place.file("tokens/"), place.file("checkpoints/")
    rotten = {segment: flipped, other: truncated, third: None, token: flipped, note: flipped}
    before = {path: place.versions(path) for path in rotten}
    ends = {path: place.lock_of(path, before[path][-1]) for path in rotten}
    # Of a version that the disks lost wholly the store tells no lock: the ledger that closed the case has it.
    ends[third] = place.lock_of("ledger.jsonl", place.versions("ledger.jsonl")[-1])
    for path, change in rotten.items():
        place.rot(path, change)
    # One copy has rotted as well, another has not: no copy is believed.
    for path in (token, other):
        body = folder / "body"
        body.write_bytes(flipped((place.folder / path).read_bytes()))
        place.store.put(COPIES, place.key(path), body)
    require(not str(place.judged(folder / "fetched")).startswith("intact"), "nothing has rotted")

    mended, left = mending.verify(place.case, "intact")
    second, replica = "the copy 'second'", "the copy 'replica'"
    require(mended == {segment: second, other: replica, third: second, token: replica, note: second} and not left, f"mended {mended}, left {left}")
    place.is_whole()
    require(place.judged(folder / "fetched").startswith("intact"), "what was mended is not read")
    for path, versions in before.items():
        now = place.versions(path)
        require(len(now) == len(versions) + 1 and set(versions) < set(now), f"{path} had {versions}, and has {now}")
        (new,) = set(now) - set(versions)
        require(place.headers(path, new)["x-amz-object-lock-mode"] == "COMPLIANCE", f"nothing locks {path}")
        require(place.lock_of(path, new) == ends[path], f"{path} was locked until {ends[path]}, and is until {place.lock_of(path, new)}")
        require(place.store.ask("DELETE", f"/{BUCKET}/{place.key(path)}?versionId={new}")[0] == 403, f"{path} could be removed")
        told = {each["what"]: each for each in mending.log()}
        first = f"mends {path} from {mended[path]}"
        done = f"mended {path} from {mended[path]}, sha256 {hashlib.sha256((place.folder / path).read_bytes()).hexdigest()}, version {new}"
        require(first in told and done in told and told[done]["case"] == f"or-1~{place.case}", f"the log does not tell of {path}: {list(told)}")
    mending.require_signed()
    count = len(mending.deeds())
    require(mending.verify(place.case, "intact") == ({}, {}) and len(mending.deeds()) == count, "what was mended is mended again")


def a_ledger_is_mended_by_what_the_device_signed(mending, place, folder):
    place.rot("ledger.jsonl", of_other_hash)
    mended, left = mending.verify(place.case, "intact")
    require(mended == {"ledger.jsonl": "the copy 'second'"} and not left, f"mended {mended}, left {left}")
    # Somebody with the appliance's key puts another ledger, and other pictures that fit it: the device signed none.
    segment = place.file("segments/endoscope/")
    body = folder / "body"
    body.write_bytes(flipped((place.folder / segment).read_bytes()))
    place.store.put(BUCKET, place.key(segment), body)
    was, now = (hashlib.sha256(each).hexdigest().encode() for each in ((place.folder / segment).read_bytes(), body.read_bytes()))
    body.write_bytes((place.folder / "ledger.jsonl").read_bytes().replace(was, now))
    place.store.put(BUCKET, place.key("ledger.jsonl"), body)
    mended, left = mending.verify(place.case, "intact")
    require(mended == {"ledger.jsonl": "an older version", segment: "an older version"} and not left, f"mended {mended}, left {left}")
    place.is_whole()
    # Where every copy has that ledger, nothing is mended by it.
    for each in place.versions("ledger.jsonl"):
        place.disks.rot(place.key("ledger.jsonl"), each, lambda _: body.read_bytes())
    place.store.put(COPIES, place.key("ledger.jsonl"), body)
    copy = mending.replica / "or-1" / place.case / "ledger.jsonl"
    copy.write_bytes(body.read_bytes())
    before = place.store.versions(BUCKET)
    mended, left = mending.verify(place.case, "tampered", status=1)
    require(not mended and "no copy fits the checkpoint that the device signed" in left["ledger.jsonl"], f"mended {mended}, left {left}")
    require(place.store.versions(BUCKET) == before, "something was put by a ledger that nobody signed")
    # With one true copy it is.
    copy.write_bytes((place.folder / "ledger.jsonl").read_bytes())
    mended, left = mending.verify(place.case, "intact")
    require(mended == {"ledger.jsonl": "the copy 'replica'"} and not left, f"mended {mended}, left {left}")
    place.is_whole()


def entry_like(line, **fields):
    """A line that says what another says, but for these fields."""
    return json.dumps({**json.loads(line), **fields}, separators=(",", ":")).encode() + b"\n"


def only_signed_lines_name_anything(mending, place, folder):
    """Somebody with the appliance's key to the store has X as an older version, and a line that names it behind the signed ones."""
    path = place.file("segments/endoscope/")
    ledger, body = place.folder / "ledger.jsonl", folder / "body"
    wrong = flipped((place.folder / path).read_bytes())
    for each in (wrong, (place.folder / path).read_bytes()):
        body.write_bytes(each)
        place.store.put(BUCKET, place.key(path), body)
    (line,) = [each for each in ledger.read_bytes().splitlines() if path.encode() in each]
    body.write_bytes(ledger.read_bytes() + entry_like(line, seq=3, sha256=hashlib.sha256(wrong).hexdigest()))
    place.store.put(BUCKET, place.key("ledger.jsonl"), body)
    before = place.versions(path)
    for looks, expected in enumerate(({"ledger.jsonl": "an older version"}, {})):
        mended, left = mending.verify(place.case, "intact")
        require(mended == expected and not left, f"look {looks}: mended {mended}, left {left}")
    require(place.versions(path) == before, "a line that nobody signed named a segment")
    place.is_whole()
    # What a device enters behind the end, and may die before it signs that, is not taken for somebody else's.
    token = [each for each in ledger.read_bytes().splitlines() if b'"type":"token"' in each][-1]
    body.write_bytes(ledger.read_bytes() + entry_like(token, seq=len(ledger.read_bytes().splitlines())))
    place.store.put(BUCKET, place.key("ledger.jsonl"), body)
    before = place.store.versions(BUCKET)
    done = json.loads(mending.fleet.ask("verify", "--all", "--json").stdout)
    (one,) = [each for each in done["cases"] if each["case"] == place.case]
    require(one["mended"] == [] and [each["file"] for each in one["not_mended"]] == ["ledger.jsonl"] and
            "may have died before it signed" in one["not_mended"][0]["why"], f"told: {one}")
    require(place.store.versions(BUCKET) == before, "something was put")
    place.store.put(BUCKET, place.key("ledger.jsonl"), ledger)


def a_ledger_ends_with_its_last_line(mending, place, folder):
    """Bytes without a line's end behind true lines are none of the case's, in the store and in copies."""
    ledger, body = place.folder / "ledger.jsonl", folder / "body"
    body.write_bytes(ledger.read_bytes() + b"x" * 100_000)
    place.store.put(BUCKET, place.key("ledger.jsonl"), body)
    mended, left = mending.verify(place.case, "intact")
    require(mended == {"ledger.jsonl": "an older version"} and not left, f"mended {mended}, left {left}")
    place.is_whole()
    for version in place.versions("ledger.jsonl"):
        if place.disks.has(place.key("ledger.jsonl"), version):
            place.disks.rot(place.key("ledger.jsonl"), version, of_other_hash)
    place.store.put(COPIES, place.key("ledger.jsonl"), body)
    mended, left = mending.verify(place.case, "intact")
    require(mended == {"ledger.jsonl": "the copy 'replica'"} and not left, f"mended {mended}, left {left}")
    place.is_whole()


def the_log_says_each_thing_once(mending, place, folder):
    """Whoever may put makes as many names as they like: few are stated, with how many there are, and once."""
    body = folder / "body"
    body.write_text("no note")
    names = [f"checkpoints/{90_000_000 + number:08}.note" for number in range(30)]
    for name in names:
        place.store.put(BUCKET, place.key(name), body)
    before = len(mending.deeds())
    done = mending.fleet.ask("verify", "--all", "--json")
    (one,) = [each for each in json.loads(done.stdout)["cases"] if each["case"] == place.case]
    require({each["file"] for each in one["not_mended"]} == set(names) and one["mended"] == [], f"told: {one}")
    said = mending.deeds()[before:]
    require(len(said) == 21 and said[-1] == "could not mend more: 10 other files", f"the log says {said}")
    mending.fleet.ask("verify", "--all", "--json")
    require(len(mending.deeds()) == before + len(said), f"the log repeats {mending.deeds()[before + len(said):]}")
    # What is another one than it said is stated.
    for version in place.versions(names[0]):
        place.store.ask("DELETE", f"/{BUCKET}/{place.key(names[0])}?versionId={version}")
    mending.fleet.ask("verify", "--all", "--json")
    said = mending.deeds()[before + len(said):]
    require(len(said) == 2 and said[-1] == "could not mend more: 9 other files", f"the log says {said}")
    for name in names[1:]:
        for version in place.versions(name):
            place.store.ask("DELETE", f"/{BUCKET}/{place.key(name)}?versionId={version}")
    mending.require_signed()


def no_number_of_versions_hides_the_recorded_one(mending, place, folder):
    """Whoever may put makes a hundred newer versions, which nothing locks."""
    segment, ledger, junk = place.file("segments/endoscope/"), "ledger.jsonl", folder / "junk"
    before = {path: set(place.versions(path)) for path in (segment, ledger)}
    ends = place.lock_of(segment, place.versions(segment)[-1])
    junk.write_bytes(flipped((place.folder / segment).read_bytes()))
    for _ in range(101):
        place.store.put(BUCKET, place.key(segment), junk)
        place.store.put(BUCKET, place.key(ledger), place.folder / ledger)
    # One of them under a lock that nobody asked for.
    retention = folder / "retention"
    retention.write_text("<Retention><Mode>COMPLIANCE</Mode><RetainUntilDate>2130-01-01T00:00:00Z</RetainUntilDate></Retention>")
    place.store.send(f"{BUCKET}/{place.key(segment)}?retention=&versionId={place.versions(segment)[0]}", retention)
    mended, left = mending.verify(place.case, "intact")
    require(mended == {segment: "an older version"} and not left, f"mended {mended}, left {left}")
    newest = place.versions(segment)[0]
    require(place.lock_of(segment, newest) == ends, f"{segment} was locked until {ends}, and is until {place.lock_of(segment, newest)}")
    for path, known in before.items():
        for version in set(place.versions(path)) - known - {newest}:
            place.store.ask("DELETE", f"/{BUCKET}/{place.key(path)}?versionId={version}")


def an_appliance_says_what_it_cannot_mend(place):
    """No line names the device's key beside a case: where the store lost it, the case is not told to be whole."""
    place.rot("device.pub", None)
    done = place.appliance.ask("ship", "--mend", place.case)
    require(done.returncode == 3 and "could not mend device.pub" in done.stderr and "nothing is to be mended" not in done.stdout,
            f"told: {done.returncode} {done.stdout}{done.stderr}")
    place.store.put(BUCKET, place.key("device.pub"), place.folder / "device.pub")
    require("nothing is to be mended" in place.appliance.kiroku("ship", "--mend", place.case), "it is told to lack something")


def what_cannot_be_mended_is_said(mending, place, folder):
    segment = place.file("segments/endoscope/")
    copy = mending.replica / "or-1" / place.case / segment
    place.rot_wholly(segment)
    body = folder / "body"
    body.write_bytes(flipped(copy.read_bytes()))
    place.store.put(COPIES, place.key(segment), body)
    copy.write_bytes(flipped(copy.read_bytes()))
    before = place.store.versions(BUCKET)
    mended, left = mending.verify(place.case, "tampered", status=1)
    require(not mended and set(left) == {segment} and "no copy has the bytes" in left[segment], f"mended {mended}, left {left}")
    require(place.store.versions(BUCKET) == before, "something was put that does not fit")
    require(mending.deeds()[-1].startswith(f"could not mend {segment}: "), f"the log says {mending.deeds()[-1]}")
    told = mending.fleet.tell("cases", "--appliance", "or-1", "--history", place.case)["verifications"]
    require("1 object could not be mended" in told[-1]["detail"], f"the history says {told[-1]}")
    # A copy that is not there is not one that has nothing.
    away = mending.replica.rename(mending.replica.parent / "away")
    left = mending.verify(place.case, "tampered", status=1)[1]
    require("the copy 'replica' could not be asked" in left[segment], f"left {left}")
    # Why it could not be asked is told in other words each time, and not stated again for that.
    count = len(mending.deeds())
    mending.replica.mkdir()
    (mending.replica / "or-1").write_text("no folder")
    (mending.replica / "or-1").unlink()
    (mending.replica / "or-1").symlink_to("or-1")
    left = mending.verify(place.case, "tampered", status=1)[1]
    require("the copy 'replica' could not be asked" in left[segment], f"left {left}")
    require(len(mending.deeds()) == count, f"the log says {mending.deeds()[count:]}")
    shutil.rmtree(mending.replica)
    away.rename(mending.replica)

    # A key that may not put mends nothing, and takes no verdict away.
    copy.write_bytes((place.folder / segment).read_bytes())
    credentials = mending.fleet.folder / "mending-credentials"
    whole = credentials.read_text()
    for key, words in (("reader", "has no right to do this"), ("nobody", "does not know the access key 'nobody'")):
        credentials.write_text(f"access_key = {key}\nsecret_key = readersecret0123456789\n")
        mended, left = mending.verify(place.case, "tampered", status=1)
        require(not mended and words in left[segment], f"mended {mended}, left {left}")
        require(place.store.versions(BUCKET) == before, f"{key} put something")
    credentials.write_text(whole)
    # Without a log nothing is put.
    log = mending.home / "archive/log"
    moved = log.rename(mending.home / "moved")
    log.write_text("no folder")
    done = mending.fleet.ask("verify", "--all")
    require(done.returncode == 2 and place.store.versions(BUCKET) == before, f"mended without a log: {done.stdout}{done.stderr}")
    log.unlink()
    moved.rename(log)
    require(mending.verify(place.case, "intact")[0] == {segment: "the copy 'replica'"}, "it is not mended at last")
    place.is_whole()


def a_legal_hold_goes_on(mending, place):
    segment = place.file("segments/endoscope/")
    place.appliance.kiroku("hold", place.case, "--reason", "court of Kyoto")
    place.appliance.kiroku("ship")
    mending.fleet.tell("index")
    place.rot(segment, flipped)
    before = place.versions(segment)
    require(mending.verify(place.case, "intact")[0].keys() == {segment}, "it is not mended")
    (new,) = set(place.versions(segment)) - set(before)
    require(place.headers(segment, new)["x-amz-object-lock-legal-hold"] == "ON", "what was mended is not under the hold")
    # Where somebody lifts it in the store, the fleet tells; the verdict is of what is there.
    off = place.appliance.home / "off"
    for on, status in (("OFF", 3), ("ON", 0)):
        off.write_text(f"<LegalHold><Status>{on}</Status></LegalHold>")
        place.store.send(f"{BUCKET}/{place.key(segment)}?legal-hold=&versionId={new}", off)
        told = mending.fleet.tell("verify", "--all", status=status)
        (one,) = [each for each in told["cases"] if each["case"] == place.case]
        require(one["verdict"].startswith("intact") and one["legal_hold_lifted"] == (on == "OFF"), f"{on}: {one}")
        require(("the store does not hold 1 of " in one["detail"] and place.key(segment) in one["detail"]) == (on == "OFF"), f"{on}: {one}")
    off.unlink()
    place.appliance.kiroku("release", place.case, "--reason", "settled")
    place.appliance.kiroku("ship")
    require(place.headers(segment, new)["x-amz-object-lock-legal-hold"] == "OFF", "the hold is not lifted of what was mended")


def what_was_erased_stays_away(mending, place):
    """The appliance erased it, and its copies have it still."""
    gone, rotten, other = (f"segments/endoscope/{number:08}.ts.age" for number in range(3))
    ledger_was = place.lock_of("ledger.jsonl", place.versions("ledger.jsonl")[-1])
    place.appliance.kiroku("erase", place.case, "--stream", "endoscope", "--policy", "reviewed")
    require(not (place.folder / gone).exists(), "it is not erased")
    place.appliance.kiroku("ship")
    mending.fleet.tell("index")
    require(len(place.versions("ledger.jsonl")) == 2, "no ledger tells of it in the store")
    before = {path: place.versions(path) for path in (gone, rotten, other)}
    place.rot(gone, None)
    place.rot(rotten, flipped)
    # What was not erased is mended as before, and for no longer than the case was to be kept from its end.
    vitals = place.file("segments/vitals/")
    place.rot(vitals, None)
    told = mending.fleet.tell("verify", "--all", status=3)
    (one,) = [each for each in told["cases"] if each["case"] == place.case]
    require([each["file"] for each in one["mended"]] == [vitals] and one["erased"] == [gone, rotten], f"told: {one}")
    # The store was to keep it, and the appliance erased its own because of that.
    require([each["file"] for each in one["not_mended"]] == [gone, rotten] and all("the appliance erased it" in each["why"] for each in one["not_mended"]), f"told: {one}")
    require(one["verdict"].startswith("intact") and "2 objects erased by the appliance and lost or damaged" in one["detail"], f"told: {one}")
    require({path: place.versions(path) for path in before} == before, "what was erased was put again")
    require(place.lock_of(vitals, place.versions(vitals)[0]) == ledger_was, "it is kept for longer than the ledger that closed the case")
    # Nor by the appliance, whoever puts it back there.
    (place.folder / gone).write_bytes((mending.replica / "or-1" / place.case / gone).read_bytes())
    done = place.appliance.ask("ship", "--mend", place.case)
    require(done.returncode == 3 and f"could not mend {gone}: the appliance erased it" in done.stderr and {path: place.versions(path) for path in before} == before,
            f"told: {done}")
    (place.folder / gone).unlink()
    # It is told each time, until the store has it again or its lock ends.
    mending.fleet.tell("verify", "--all", status=3)
    place.rot(rotten, flipped)
    place.store.put(BUCKET, place.key(gone), mending.replica / "or-1" / place.case / gone)
    mending.fleet.tell("verify", "--all")


def an_appliance_mends_what_it_still_has(place):
    segment, ledger = place.file("segments/endoscope/"), "ledger.jsonl"
    require(json.loads(place.appliance.kiroku("ship", "--mend", place.case, "--json"))["mended"] == [], "what is whole was mended")
    place.rot_wholly(segment)
    place.rot_wholly(ledger)
    told = json.loads(place.appliance.kiroku("ship", "--mend", place.case[:15], "--json"))
    require({each["file"]: each["from"] for each in told["mended"]} == dict.fromkeys((ledger, segment), "the appliance's archive") and
            told["not_mended"] == [], f"mended were {told}")
    place.is_whole()
    entries = json.loads(place.appliance.kiroku("log", "--json"))["entries"]
    said = [each["what"] for each in entries if each["type"] == "access" and each["case"] == place.case]
    require(f"mends {segment} from the appliance's archive" in said and said[-1].startswith(f"mended {segment} from"), f"the log says {said}")
    require("nothing is to be mended" in place.appliance.kiroku("ship", "--mend", place.case), "it is mended again")
    require(place.appliance.ask("ship", "--mend", place.case, "--follow").returncode == 2, "two things at once")
    # What it has lost itself it cannot mend, and says so.
    own, kept = place.folder / segment, (place.folder / segment).read_bytes()
    place.rot_wholly(segment)
    own.write_bytes(flipped(kept))
    done = place.appliance.ask("ship", "--mend", place.case)
    require(done.returncode == 3 and f"could not mend {segment}: no copy has the bytes" in done.stderr, f"told: {done.stdout}{done.stderr}")
    own.write_bytes(kept)
    place.appliance.kiroku("ship", "--mend", place.case)
    place.is_whole()


def the_page_plays_what_was_mended(programs, mending, place, folder):
    segment = place.file("segments/endoscope/")
    picture = f"{place.case}/streams/endoscope/frame.png?at_ns=500000000"
    own = Server([programs / "kiroku", "view"], place.appliance.environment)
    subprocess.run([str(programs / "kiroku"), "init", "--demo", "--home", str(folder / "page")], check=True, capture_output=True)

    def page():
        server = Server([mending.fleet.program, "serve", "--home", folder / "page", "--config", mending.fleet.configuration])
        person = server.person()
        person.read("session", {"link": server.link})
        person.tell("session/unlock", {"identity": (place.appliance.home / "identity.txt").read_text()})
        return server, person

    place.rot_wholly(segment)
    server, person = page()
    try:
        surgeon = own.person()
        surgeon.read("session", {"link": own.link})
        archived = surgeon.tell("cases/" + picture)
        require(person.ask("cases/or-1~" + picture)[0] >= 400, "pictures out of rotten bytes")
        # The page's own verification mends nothing: its keys may only read.
        before = place.versions(segment)
        status, answer = person.ask(f"cases/or-1~{place.case}/verification", {})
        while status == 202:
            status, answer = person.ask(f"cases/or-1~{place.case}/verification")
        require(json.loads(answer)["verdict"] == "tampered" and place.versions(segment) == before, "the page mends")
        # Whoever asked is not alone to know: the store's list says nothing of rotten bytes.
        (row,) = mending.fleet.tell("cases", "--attention")["cases"]
        require((row["case"], row["alarm"], row["verdict"]) == (place.case, True, None), f"the list goes on saying {row}")
        require(mending.fleet.tell("status", status=1)["not_intact"] == 1, "the status does not tell")
        require(mending.verify(place.case, "intact")[0].keys() == {segment}, "it is not mended")
        server.end()
        server, person = page()
        require(person.tell("cases/or-1~" + picture) == archived, "what was mended does not play")
    finally:
        server.end()
        own.end()


def a_signed_ledger_names_nothing_outside(mending, store, folder):
    """An appliance that somebody has taken over signs what it likes: a file of another's, above its own folder."""
    device = note.Signer("or-3", bytes(range(32)))
    (mending.fleet.folder / "devices/or-3.pub").write_text(f"{device.key}\n")
    reader = age.Identity(bytes(range(32)))
    case = case_writer.Case("20260805T091502Z-3f9c21ab", device, 1785921302 * case_writer.SECOND,
                            [case_writer.stream("room", "video", "video/mp2t", [reader.recipient])])
    sealed = age.seal(b"pictures", [reader.public])
    for number in range(2):
        case.segment("room", number, number * case_writer.SECOND, (number + 1) * case_writer.SECOND, sealed, 10)
    outside = "../../or-1/stolen"
    case.find("segment").fields["file"] = outside
    case.close(3 * case_writer.SECOND)
    case.checkpoint()
    written = case.write(folder / "or-3").folder
    (written / "segments/room/00000000.ts.age").rename(mending.replica / "or-1/stolen")
    missing = "segments/room/00000001.ts.age"
    for file in written.rglob("*"):
        path = str(file.relative_to(written))
        if file.is_file() and path != missing:
            store.put(BUCKET, f"or-3/{case.id}/{path}", file)
    shutil.copytree(written, mending.replica / "or-3" / case.id)
    mending.fleet.tell("index")
    before = store.versions(BUCKET)
    told = mending.fleet.tell("verify", status=3)
    (one,) = [each for each in told["cases"] if each["appliance"] == "or-3"]
    # What it truly lacks is found, and nothing locks it: it was put without Kiroku.
    require(one["mended"] == [] and [each["file"] for each in one["not_mended"]] == [missing] and
            "nothing locks" in one["not_mended"][0]["why"], f"told: {told}")
    require(store.versions(BUCKET) == before, f"put were {set(store.versions(BUCKET)) - set(before)}")
    require(not list(folder.rglob("stolen")) or [each.parent.name for each in folder.rglob("stolen")] == ["or-1"], "it was written elsewhere")


def cases_from_before_a_key_are_mended(mending, store, folder):
    """A device that got an ML-DSA key, and one in hardware, has sound cases that it signed by Ed25519 alone."""
    root = hashlib.sha256(b"").hexdigest()
    keys = {"ml_dsa_seed": bytes([9] * 32), "hardware_seed": bytes([7] * 32)}
    now = note.Signer("or-4", bytes([4] * 32), since=9, hardware_since=9, **keys)
    (mending.fleet.folder / "devices/or-4.identity").write_text(now.identity.identity)
    reader = age.Identity(bytes(range(32)))
    sealed = age.seal(b"pictures", [reader.public])

    def written(case_id, signer, log_size):
        case = case_writer.Case(case_id, signer, 1785921302 * case_writer.SECOND,
                                [case_writer.stream("room", "video", "video/mp2t", [reader.recipient])], (log_size, root))
        for number in range(2):
            case.segment("room", number, number * case_writer.SECOND, (number + 1) * case_writer.SECOND, sealed, 10)
            case.checkpoint()
        case.close(3 * case_writer.SECOND)
        case.checkpoint()
        return case.write(folder / "or-4")

    def put(made, without):
        retention = folder / "retention"
        ends = (datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(days=1)).strftime("%Y-%m-%dT%H:%M:%SZ")
        retention.write_text(f"<Retention><Mode>COMPLIANCE</Mode><RetainUntilDate>{ends}</RetainUntilDate></Retention>")
        for file in made.folder.rglob("*"):
            path = str(file.relative_to(made.folder))
            if file.is_file() and path not in without:
                store.put(BUCKET, f"or-4/{made.case.id}/{path}", file)
        store.send(f"{BUCKET}/or-4/{made.case.id}/ledger.jsonl?retention=", retention)
        shutil.copytree(made.folder, mending.replica / "or-4" / made.case.id)
        mending.fleet.tell("index")

    def told_of(made):
        told = json.loads(mending.fleet.ask("verify", "--all", "--json").stdout)
        (one,) = [each for each in told["cases"] if each["case"] == made.case.id and each["appliance"] == "or-4"]
        return {each["file"]: each["from"] for each in one["mended"]}, {each["file"]: each["why"] for each in one["not_mended"]}

    missing, replica = "segments/room/00000001.ts.age", "the copy 'replica'"
    before = written("20260805T091502Z-00000001", note.Signer("or-4", bytes([4] * 32)), 5)
    put(before, {missing})
    require(told_of(before) == ({missing: replica}, {}), f"of a case from before the key: {told_of(before)}")
    require(told_of(before) == ({}, {}), f"of the same case: {told_of(before)}")
    # A case that is not from before, and whose notes somebody puts without what the ML-DSA key signed: the true ones are mended back.
    after = written("20260805T091502Z-00000002", now, 12)
    put(after, {missing})
    notes = sorted(f"checkpoints/{size:08}.note" for size in after.notes)
    body = folder / "body"
    for path in notes:
        text, _, lines = (after.folder / path).read_bytes().rpartition(b"\n\n")
        body.write_bytes(text + b"\n\n" + lines.splitlines(keepends=True)[0])
        store.put(BUCKET, f"or-4/{after.case.id}/{path}", body)
    require(told_of(after) == ({missing: replica, **dict.fromkeys(notes, "an older version")}, {}), f"of stripped notes: {told_of(after)}")
    # A copy whose line by hardware is gone is taken only where no other has it.
    body.write_text("no note")
    for version in store.versions(BUCKET)[f"or-4/{after.case.id}/{notes[0]}"]:
        store.ask("DELETE", f"/{BUCKET}/or-4/{after.case.id}/{notes[0]}?versionId={version}")
    for version in store.versions(BUCKET).get(f"or-4/{after.case.id}/{notes[0]}", []):
        Disks(folder / "ceph").rot(f"or-4/{after.case.id}/{notes[0]}", version, flipped)
    text, _, lines = (after.folder / notes[0]).read_bytes().rpartition(b"\n\n")
    store.put(BUCKET, f"or-4/{after.case.id}/{notes[0]}", body)
    body.write_bytes(text + b"\n\n" + b"".join(lines.splitlines(keepends=True)[:2]))
    store.put(COPIES, f"or-4/{after.case.id}/{notes[0]}", body)
    require(told_of(after) == ({notes[0]: replica}, {}), f"of a copy without hardware's line: {told_of(after)}")
    # Nor where only a smaller note has a copy that all keys signed.
    stripped = written("20260805T091502Z-00000003", now, 12)
    notes = sorted(f"checkpoints/{size:08}.note" for size in stripped.notes)
    put(stripped, {missing, *notes})
    for path in notes:
        text, _, lines = (stripped.folder / path).read_bytes().rpartition(b"\n\n")
        body.write_bytes(text + b"\n\n" + lines.splitlines(keepends=True)[0])
        store.put(BUCKET, f"or-4/{stripped.case.id}/{path}", body)
    shutil.copy(body, mending.replica / "or-4" / stripped.case.id / notes[-1])
    mended, left = told_of(stripped)
    require(mended == {missing: replica, **dict.fromkeys(notes[:-1], replica)} and set(left) == {"ledger.jsonl", notes[-1]},
            f"of notes of which the largest has no whole copy: mended {mended}, left {left}")
    # What only a line behind the signed ones says to be erased was not.
    said = written("20260805T091502Z-00000004", note.Signer("or-4", bytes([4] * 32)), 5)
    put(said, {missing})
    lines = (said.folder / "ledger.jsonl").read_bytes()
    last = json.loads(lines.splitlines()[-1])
    erased = {"type": "erased", "seq": last["seq"] + 1, "utc": last["utc"], "mono_ns": last["mono_ns"], "stream": "room", "first_index": 0,
              "last_index": 1, "policy": "made up"}
    body.write_bytes(lines + json.dumps(erased, separators=(",", ":")).encode() + b"\n")
    store.put(BUCKET, f"or-4/{said.case.id}/ledger.jsonl", body)
    mended, left = told_of(said)
    require(mended == {missing: replica} and set(left) == {"ledger.jsonl"}, f"of a made-up erasure: mended {mended}, left {left}")


def two_workers_mend_once(mending, place):
    segments = [f"segments/endoscope/{number:08}.ts.age" for number in range(3)]
    before = {path: place.versions(path) for path in segments}
    for path in segments:
        place.rot_wholly(path)
    workers = [subprocess.Popen([str(mending.fleet.program), "verify", "--all", "--json", "--config", str(mending.fleet.configuration)],
                                stdout=subprocess.PIPE, text=True) for _ in range(2)]
    told = [json.loads(worker.communicate(timeout=300)[0]) for worker in workers]
    mended = [each["file"] for part in told for one in part["cases"] for each in one["mended"]]
    require(sorted(mended) == segments, f"mended were {mended}")
    require(all(len(place.versions(path)) == len(before[path]) + 1 for path in segments), "something was put twice")
    mending.require_signed()


def try_everything(programs, folder, store, connection):
    appliance = Appliance(programs, folder / "or-1", store.endpoint, BUCKET)
    cases = [appliance.recorded(9), appliance.recorded(3), appliance.recorded(7)]
    appliance.kiroku("ship")
    mending = Mending(programs, folder / "fleet", store.endpoint, connection, appliance)
    for key in store.versions(BUCKET):
        file = folder / "body"
        file.write_bytes(store.get(BUCKET, key))
        store.put(COPIES, key, file)
    for case in cases:
        shutil.copytree(appliance.home / "archive" / case, mending.replica / "or-1" / case)
    require(mending.fleet.ask("init").returncode == 0, "init failed")
    mending.fleet.tell("index")
    disks = Disks(folder / "ceph")
    first, second, third = (Place(store, disks, appliance, case) for case in cases)
    rot_is_mended_from_whichever_copy_fits(mending, first, folder)
    a_legal_hold_goes_on(mending, first)
    what_was_erased_stays_away(mending, third)
    an_appliance_mends_what_it_still_has(second)
    the_page_plays_what_was_mended(programs, mending, first, folder)
    two_workers_mend_once(mending, first)
    an_appliance_says_what_it_cannot_mend(first)
    only_signed_lines_name_anything(mending, first, folder)
    a_ledger_ends_with_its_last_line(mending, first, folder)
    the_log_says_each_thing_once(mending, first, folder)
    no_number_of_versions_hides_the_recorded_one(mending, first, folder)
    a_ledger_is_mended_by_what_the_device_signed(mending, second, folder)
    what_cannot_be_mended_is_said(mending, second, folder)
    a_signed_ledger_names_nothing_outside(mending, store, folder)
    cases_from_before_a_key_are_mended(mending, store, folder)


def add_reader(folder, store):
    """Somebody who may list and read, and no more."""
    subprocess.run(["radosgw-admin", "-c", str(folder / "ceph/ceph.conf"), "user", "create", "--uid=reader", "--display-name=Reader",
                    "--access-key=reader", "--secret-key=readersecret0123456789"], check=True, capture_output=True)
    policy = folder / "policy"
    actions = ["s3:ListBucket", "s3:ListBucketVersions", "s3:GetObject", "s3:GetObjectVersion", "s3:GetObjectRetention", "s3:GetObjectLegalHold"]
    policy.write_text(json.dumps({"Version": "2012-10-17", "Statement": [
        {"Effect": "Allow", "Principal": {"AWS": ["arn:aws:iam:::user/reader"]}, "Action": actions,
         "Resource": [f"arn:aws:s3:::{BUCKET}", f"arn:aws:s3:::{BUCKET}/*"]}]}))
    store.set_policy(BUCKET, policy)


def main():
    def run(programs, folder, endpoint, connection):
        store = Store(endpoint)
        store.make_bucket(BUCKET)
        store.make_bucket(COPIES, locked=False)
        add_reader(folder, store)
        try_everything(programs, folder, store, connection)

    if shutil.which("rados") is None:
        print("SKIPPED: rados is not installed")
        sys.exit(77)
    with_store_and_postgres(run)
    print("What rots in the store is mended from a copy that fits, and nothing else is.")


if __name__ == "__main__":
    main()
