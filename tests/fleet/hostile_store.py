#!/usr/bin/env python3
"""A store that lies: what `kiroku fetch` and `kiroku ship` make of it. The store is a program of this test, and needs no Ceph.

Usage: tests/fleet/hostile_store.py PROGRAMS
  PROGRAMS  the folder of kiroku, such as build/release/apps

Exit status: 0 everything holds, 1 something does not.
"""
import datetime
import http.server
import json
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import urllib.parse
from xml.sax.saxutils import escape

from fleet_test import Fleet
from ship_test import HERE, Appliance, a_day_passes, eventually, require


HOLD, MODE, UNTIL = (f"x-amz-object-lock-{what}" for what in ("legal-hold", "mode", "retain-until-date"))


class Version:
    def __init__(self, name, body, headers):
        self.name, self.body, self.headers = name, body, headers
        self.put = datetime.datetime.now(datetime.timezone.utc)


class HostileStore:
    """Keeps versions as a store does, until one of its lies is set.

    `listing(query)` answers a listing, `object_of(key, version)` says which version is given for which was asked,
    `cut(key)` after how many bytes an answer ends; each gives None for the truth.
    """

    def __init__(self):
        self.objects, self.count = {}, 0
        self.honest()
        store = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def log_message(self, *_):
                pass

            def reply(self, status, body=b"", headers=()):
                out = f"HTTP/1.1 {status} Told\r\nContent-Length: {len(body)}\r\n".encode()
                out += "".join(f"{name}: {value}\r\n" for name, value in headers).encode("latin-1") + b"\r\n"
                self.send(out + (b"" if self.command == "HEAD" else body))

            def send(self, out):
                try:
                    self.wfile.write(out)
                    self.wfile.flush()
                except OSError:
                    self.close_connection = True

            def any(self):
                length = int(self.headers.get("Content-Length", 0))
                body = self.rfile.read(length)
                if len(body) < length:  # who asked was killed meanwhile: no store does half of what was said
                    self.close_connection = True
                    return
                parts = urllib.parse.urlsplit(self.path)
                query = dict(urllib.parse.parse_qsl(parts.query, keep_blank_values=True))
                store.answer(self, urllib.parse.unquote(parts.path)[len("/recordings/"):], query, body)

            do_GET = do_PUT = do_HEAD = do_DELETE = any

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        self.endpoint = f"http://127.0.0.1:{self.server.server_address[1]}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def honest(self):
        self.listing = lambda query: None
        self.object_of = lambda key, version: None
        self.cut = lambda key: None
        self.status_of = lambda method, key, query: None
        self.takes_locks = True
        self.asked = []

    def put(self, key, body, headers=()):
        self.count += 1
        version = Version(f"v{self.count}", body, dict(headers))
        self.objects.setdefault(key, []).insert(0, version)
        return version

    def answer(self, asked, key, query, body):
        self.asked.append((asked.command, key, query))
        told = self.status_of(asked.command, key, query)
        if told is not None:
            asked.reply(*told)
        elif "object-lock" in query:
            asked.reply(200, b"<ObjectLockConfiguration><ObjectLockEnabled>Enabled</ObjectLockEnabled></ObjectLockConfiguration>")
        elif "versions" in query:
            text = self.listing(query)
            asked.reply(200, (self.list_of(query) if text is None else text).encode())
        elif asked.command == "PUT" and {"legal-hold", "retention"} & query.keys():
            if self.takes_locks:
                self.lock(next(each for each in self.objects[key] if each.name == query["versionId"]), body.decode())
            asked.reply(200)
        elif asked.command == "PUT":
            kept = [(name.lower(), value) for name, value in asked.headers.items()
                    if name.lower().startswith(("x-amz-meta", "x-amz-object-lock"))]
            asked.reply(200, b"", [("x-amz-version-id", self.put(key, body, kept).name)])
        elif asked.command == "DELETE":
            asked.reply(403, b"<Error><Code>AccessDenied</Code></Error>")
        else:
            self.give(asked, key, query.get("versionId"))

    @staticmethod
    def lock(version, text):
        def of(name):
            return text.partition(f"<{name}>")[2].partition("<")[0]

        if "LegalHold" in text:
            version.headers[HOLD] = of("Status")
        else:
            version.headers.update({MODE: of("Mode"), UNTIL: of("RetainUntilDate")})

    def give(self, asked, key, wanted):
        found = self.object_of(key, wanted)
        if found is None:
            found = next((each for each in self.objects.get(key, []) if wanted in (None, each.name)), None)
        if found is None:
            return asked.reply(404, b"<Error><Code>NoSuchKey</Code></Error>")
        headers = [*found.headers.items(), ("x-amz-version-id", found.name)]
        at = self.cut(key)
        if at is None or asked.command == "HEAD":
            part = re.fullmatch(r"bytes=(\d+)-(\d+)", asked.headers.get("Range", ""))
            if part is None or asked.command != "GET":
                return asked.reply(200, found.body, headers)
            first, last = int(part[1]), min(int(part[2]), len(found.body) - 1)
            told = f"bytes {first}-{last}/{len(found.body)}"
            return asked.reply(206, found.body[first:last + 1], [*headers, ("Content-Range", told)])
        # Without a length the end of the connection is the end of the object, and nobody sees that it was cut.
        asked.send(b"HTTP/1.1 200 Told\r\nConnection: close\r\n" + "".join(f"{n}: {v}\r\n" for n, v in headers).encode() + b"\r\n" + found.body[:at])
        asked.close_connection = True

    def list_of(self, query):
        prefix, after, folders = query.get("prefix", ""), query.get("key-marker", ""), set()
        if query.get("delimiter") == "/":
            for key in self.objects:
                rest = key[len(prefix):] if key.startswith(prefix) else ""
                if "/" in rest:
                    folders.add(prefix + rest[: rest.index("/") + 1])
            return page([], folders)
        # As Ceph does: where the marker names no version, the key itself comes again.
        return page([(key, version.name, len(version.body), i == 0, version.put)
                     for key in sorted(self.objects) if key.startswith(prefix) and (key > after or (key == after and "version-id-marker" not in query))
                     for i, version in enumerate(self.objects[key])])


def time_text(time):
    return time.strftime("%Y-%m-%dT%H:%M:%S.000Z")


def page(versions, folders=(), more=None):
    """One answer of ListObjectVersions: (key, version, bytes, newest) each, and when it was put where that is told;
    `more`: the next (key, version)."""
    text = '<?xml version="1.0" encoding="UTF-8"?><ListVersionsResult>'
    text += f"<IsTruncated>{'true' if more else 'false'}</IsTruncated>"
    if more:
        text += f"<NextKeyMarker>{escape(more[0])}</NextKeyMarker><NextVersionIdMarker>{escape(more[1])}</NextVersionIdMarker>"
    for key, version, size, newest, *put in versions:
        text += f"<Version><Key>{escape(key)}</Key><VersionId>{version}</VersionId><Size>{size}</Size><IsLatest>{'true' if newest else 'false'}</IsLatest>"
        text += "".join(f"<LastModified>{time_text(each)}</LastModified>" for each in put) + "</Version>"
    for folder in folders:
        text += f"<CommonPrefixes><Prefix>{escape(folder)}</Prefix></CommonPrefixes>"
    return text + "</ListVersionsResult>"


class Attack:
    """An appliance that recorded two cases and shipped them, and what a fetch of the first one gives."""

    def __init__(self, programs, folder):
        self.programs, self.folder = programs, folder
        self.store = HostileStore()
        self.appliance = Appliance(programs, folder / "home", self.store.endpoint, "recordings")
        self.case, self.other = self.appliance.recorded(2), self.appliance.recorded(1)
        self.appliance.kiroku("ship")
        self.shipped = {key: list(versions) for key, versions in self.store.objects.items()}

    def of_case(self, path=""):
        return f"or-1/{self.case}/{path}"

    def segment(self):
        return next(key for key in self.shipped if key.startswith(self.of_case("segments/endoscope/")))

    def anew(self):
        self.store.honest()
        self.store.objects = {key: list(versions) for key, versions in self.shipped.items()}

    def fetched(self, *words, name=None, megabytes=None, seconds=60):
        """Exit status, what the JSON says, what stands on stderr; the store is honest again afterwards."""
        out = self.folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()

        def limits():
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
            if megabytes:
                resource.setrlimit(resource.RLIMIT_AS, (megabytes << 20, megabytes << 20))

        which = [name or self.case] if "--all" not in words else []
        done = subprocess.run(self.appliance.command("fetch", *which, "-o", str(out), "--json", *words), capture_output=True, text=True,
                              env=self.appliance.environment, preexec_fn=limits, timeout=300)
        stray = [each.name for each in self.folder.iterdir() if each.name not in ("home", "out", "fleet", "postgres")]
        require(not stray, f"something was written beside the folder: {stray}")
        self.anew()
        return done.returncode, json.loads(done.stdout)["cases"][0] if done.stdout else None, done.stderr

    def refused(self, words, what, **limits):
        status, told, said = self.fetched(**limits)
        require(status == 2 and told is None and words in said, f"{what}: {status}, {said[-500:]}")


def verdict(told):
    return told["report"]["verdict"]


def truth(attack):
    status, told, _ = attack.fetched()
    require(status == 0 and verdict(told) == "intact" and not told["remarks"], f"an honest store's case: {told}")
    # One stream of it is exported without a look at what signed the ledger, and says so.
    film = str(attack.folder / "out" / "vitals.csv")
    for words in ((), ("--json", "--force")):
        said = attack.appliance.kiroku("export", str(attack.folder / "out" / attack.case), "--stream", "vitals", "-i",
                                       str(attack.appliance.home / "identity.txt"), "-o", film, *words)
        require(json.loads(said)["verified"] is False if words else "was not verified" in said, f"an export: {said}")


def another_case(attack):
    """One case's objects under another's name: nobody may take them for the case that was asked for."""
    def another(key, _):
        return attack.store.objects.get(key.replace(attack.case, attack.other), [None])[0]

    def listed(query):
        return attack.store.list_of({**query, "prefix": query["prefix"].replace(attack.case, attack.other)}).replace(attack.other, attack.case)

    attack.store.object_of, attack.store.listing = another, listed
    status, told, _ = attack.fetched()
    codes = {finding["code"] for finding in told["report"]["findings"]}
    require(status == 3 and verdict(told) == "unproven" and "folder-of-another-case" in codes, f"another case: {status}, {codes}")


def endless_lists(attack):
    turns = iter(range(1 << 62))
    attack.store.listing = lambda query: page([], more=("or-1/a" if next(turns) % 2 else "or-1/b", "v"))
    attack.refused("goes on with what it told before", "a list that goes in a circle")
    many = page([("@", "v", 1, True)] * 20_000, more=("@", "v"))

    def endless(query):
        turn = next(turns)
        text = many.replace("@</NextKeyMarker>", f"{query['prefix']}{turn:020d}</NextKeyMarker>")
        return text.replace("<Key>@", f"<Key>{query['prefix']}segments/endoscope/{turn:08d}.ts.age")

    attack.store.listing = endless
    attack.refused("which no recording has", "a list without end", megabytes=2048, seconds=120)
    attack.store.listing = lambda query: page([(attack.of_case("x"), "v", 1, True)] * 200_000)
    status, _, said = attack.fetched(seconds=10)
    require(status == 2 and said, f"one version many times: {status}, {said[-500:]}")


def names(attack):
    """What lies under names that no case has neither leads out of the folder nor keeps the case from it."""
    odd = ["../stray", "/stray", "a/../../../stray", ".hidden", "segments//x", "segments/./x", "a b", "%2e%2e/stray", "x" * 300, "\u202ex",
           "ledger.jsonl/x", "segments/endoscope", "checkpoints", "segments/endoscope/00000000.ts.age/x", "a/b/c/d"]
    for name in odd:
        attack.store.put(attack.of_case(name), b"odd")
    status, told, _ = attack.fetched()
    require(status == 0 and verdict(told) == "intact", f"odd names: {status}, {told['report']['findings']}")
    require(len(told["remarks"]) == len(odd), f"odd names are not all told: {told['remarks']}")
    attack.store.put(attack.of_case("stray"), b"in a plain place")
    require(attack.fetched()[0] == 1, "a file that nobody named is not found")


def versions(attack):
    """Whoever has the appliance's keys puts newer versions; the recorded ones remain, and can be had."""
    def newer(path, body):
        attack.store.put(attack.of_case(path), body)
        return attack.fetched()

    others = attack.shipped[f"or-1/{attack.other}/ledger.jsonl"][0].body
    for body in (b"none\n", others):
        status, told, _ = newer("ledger.jsonl", body)
        require(status == 0 and "another version was taken" in str(told["remarks"]), f"a ledger of nothing: {status}, {told['remarks']}")
    note = next(key for key in attack.shipped if key.startswith(attack.of_case("checkpoints/"))).rpartition(attack.of_case())[2]
    status, told, _ = newer(note, b"none\n")
    require(status == 1 and f"several versions of {note}" in str(told["remarks"]), f"another note: {status}, {told['remarks']}")
    attack.store.put(attack.of_case(note), b"none\n")
    status, told, _ = attack.fetched("--oldest")
    require(status == 0 and verdict(told) == "intact", f"the oldest note: {status}, {told}")
    for _ in range(150):
        attack.store.put(attack.segment(), b"\0" * len(attack.shipped[attack.segment()][0].body))
    attack.store.put(attack.segment(), b"of another size")
    asked = attack.store.asked
    status, told, _ = attack.fetched()
    tries = sum(key == attack.segment() for _, key, _ in asked)
    # The newest and the oldest are tried: nobody puts one that is older than the recorded one.
    require(status == 0 and verdict(told) == "intact" and "another version was taken" in str(told["remarks"]) and tries < 110, f"{tries} tries: {told}")
    for _ in range(150):
        attack.store.put(attack.segment(), b"of another size")
    status, told, _ = attack.fetched()
    require(status == 0, f"versions of other sizes hide the recorded one: {told['remarks']}")


def sizes(attack):
    attack.store.cut = lambda key: 100 if key == attack.segment() else None
    attack.refused("does not say how long", "an object that is cut")
    attack.store.listing = lambda query: attack.store.list_of(query).replace("<Size>", "<Size>9")
    attack.refused("bytes where it told of", "an object that is shorter than it is listed")
    attack.store.listing = lambda query: attack.store.list_of(query).replace("<Size>", "<Size>99999999")
    attack.refused("has room for", "more than the disk has room for")
    attack.store.listing = lambda query: attack.store.list_of(query).replace("<Size>", "<Size>0</Size><Size>")
    attack.refused("is longer than 0 bytes", "an object that is longer than it is listed")
    attack.store.object_of = lambda key, version: attack.store.objects[key][0] if key == attack.segment() else None
    attack.store.put(attack.segment(), b"another")
    attack.store.listing = lambda query: page([(key, found[-1].name, len(b"another"), True) for key, found in attack.store.objects.items()
                                               if key == attack.segment() and key.startswith(query["prefix"])])
    attack.refused("and tells of version", "another version than was asked for")
    attack.store.status_of = lambda method, key, query: (307, b"", [("Location", "file:///etc/passwd")]) if key == attack.segment() else None
    attack.refused("status 307", "a redirect")


def nothing_at_all(attack):
    attack.store.listing = lambda query: page([])
    status, told, said = attack.fetched("--all")
    require(status == 2 and told is None and "tells of no case" in said, f"a store that tells of nothing: {status}, {said}")


def the_end_withheld(attack):
    """A closed case whose ledger a store does not list, beside what grew while it was recorded."""
    ledger = attack.of_case("ledger.jsonl")
    body = attack.shipped[ledger][0].body
    del attack.store.objects[ledger]
    attack.store.put(f"or-1/growing/{attack.case}/000000000000", body[: body.index(b"\n", 1000) + 1])
    status, told, _ = attack.fetched()
    require(status == 1 and not told["closed"], f"an end that is withheld: {status}, {told}")


def unconfirmed(attack):
    """What the store tells of other than as it was put counts as not shipped, and is told."""
    attack.store.object_of = lambda key, version: Version("v0", b"", {}) if version else None
    attack.appliance.recorded(1)
    done = attack.appliance.ask("ship", "--json")
    told = json.loads(done.stdout) if done.stdout else {}
    require(done.returncode in (2, 3) and not told.get("sent"), f"a store that tells of other versions: {done}")
    attack.anew()


def holds_lifted_below_the_appliance(attack):
    """Somebody who owns the store takes a hold, and a lock that nobody may shorten, off objects of a held case."""
    appliance, key = attack.appliance, attack.segment()
    appliance.kiroku("hold", attack.case, "--reason", "court order")
    appliance.kiroku("ship")
    require(all(version.headers[HOLD] == "ON" for name, found in attack.store.objects.items()
                for version in found if name.startswith(attack.of_case())), "it is not held")
    (held,) = attack.store.objects[key]
    until = held.headers[UNTIL]

    def shipped():
        a_day_passes(appliance)
        attack.store.asked = []
        done = appliance.ask("ship", "--json")
        return done.returncode, json.loads(done.stdout), done.stderr

    status, told, _ = shipped()
    require((status, told["lifted"]) == (0, []) and any(asked == "HEAD" for asked, _, _ in attack.store.asked), f"nothing was lifted: {told}")
    held.headers = {name: value for name, value in held.headers.items() if not name.startswith("x-amz-object-lock")}
    status, told, _ = shipped()
    require(status == 3 and len(told["lifted"]) == 2 and all(key in each for each in told["lifted"]), f"it is not told: {told}")
    require((held.headers[HOLD], held.headers[MODE]) == ("ON", "COMPLIANCE") and held.headers[UNTIL] == until, f"not set again: {held.headers}")
    entries = json.loads(appliance.kiroku("log", "--json"))["entries"]
    said = [each["what"] for each in entries if each["type"] == "access" and each["case"] == attack.case and "in the store" in each["what"]]
    require(len(said) == 2 and f"found the legal hold of 1 object of the case lifted in the store, {key}, and set it again" in said, f"the log: {said}")
    appliance.kiroku("ship")

    # A store that takes it and does nothing.
    attack.store.takes_locks = False
    held.headers[HOLD] = "OFF"
    status, told, _ = shipped()
    require(status == 3 and told["holds_waiting"] == [attack.case] and "could not set it again everywhere" in told["lifted"][0] and
            "does not tell of it so" in told["problems"][0], f"a store that does nothing: {told}")
    attack.store.takes_locks = True
    appliance.kiroku("ship")
    require(held.headers[HOLD] == "ON", "it is not held at last")
    appliance.kiroku("release", attack.case, "--reason", "settled")
    appliance.kiroku("ship")
    require(held.headers[HOLD] == "OFF", "it is held for good")


def locks_are_lengthened(attack):
    """Who corrects `retain` has the locks of what is in the store already lengthened, and never shortened."""
    appliance, store = attack.appliance, attack.store
    toml = appliance.home / "kiroku.toml"
    before = toml.read_text(encoding="utf-8")

    def asked_for(days):
        toml.write_text(before.replace('retain = "1d"', f'retain = "{days}d"'), encoding="utf-8")

    def shipped(*words):
        store.asked = []
        done = appliance.ask("ship", "--json", *words)
        told = json.loads(done.stdout)
        return done.returncode, told, " ".join(told["problems"])

    def of_versions(days):
        """By how much each lock is longer than asked for: the store dates an object a moment after it was locked."""
        return {key: datetime.datetime.fromisoformat(version.headers[UNTIL].replace("Z", "+00:00")) - version.put - datetime.timedelta(days=days)
                for key, found in store.objects.items() for version in found if UNTIL in version.headers and "/probe/" not in key}

    def last(days):
        return all(abs(each) < datetime.timedelta(minutes=1) for each in of_versions(days).values())

    for version in (version for found in store.objects.values() for version in found):
        version.put -= datetime.timedelta(hours=2)
        version.headers[UNTIL] = time_text(version.put + datetime.timedelta(days=1))
    until = {key: version.headers[UNTIL] for key, found in store.objects.items() for version in found}
    appliance.ask("ship", "--probe")
    (probe,) = [version for key, found in store.objects.items() if key.startswith("or-1/probe/") for version in found if UNTIL in version.headers][:1]
    in_a_minute, mended = probe.headers[UNTIL], attack.segment()
    # What mended the segment a while later lasts no longer than the segment.
    store.put(mended, b"mended", {HOLD: "OFF", MODE: "COMPLIANCE", UNTIL: until[mended]})
    loose = store.put(mended, b"that nobody locked")
    stranger = store.put("or-1/notes.txt", b"of somebody", {MODE: "COMPLIANCE", UNTIL: until[mended]})
    asked_for(30)
    status, told, _ = shipped("--status")
    require(status == 3 and told["locks_left"] and told["locks_left"]["failed"] == 0 and not store.asked, f"short locks are not told: {told}")
    # A store that takes it and does nothing.
    store.takes_locks = False
    status, told, said = shipped()
    require(status == 3 and told["lengthened"] == 0 and told["locks_left"]["failed"] == len(until) + 1 and "its locks cannot be relied on" in said,
            f"a store that does nothing: {told}, {said}")
    store.takes_locks = True
    # One object that the store refuses keeps no other short, and stays told.
    store.status_of = lambda method, key, query: (403, b"<Error><Code>AccessDenied</Code></Error>") if method == "PUT" and key == mended else None
    status, told, said = shipped()
    require(status == 3 and told["lengthened"] == len(until) - 1 and told["locks_left"]["failed"] == 2 and f"{mended}: cannot lock" in said,
            f"what is refused: {told}, {said}")
    status, told, said = shipped("--status")
    require(status == 3 and mended in said and told["locks_left"]["failed"] == 2, f"it is forgotten: {told}, {said}")
    store.status_of = lambda *_: None
    status, told, _ = shipped()
    require(status == 0 and told["lengthened"] == 2 and told["locks_left"] is None, f"not lengthened at last: {told}")
    # Only what is not known to be long enough is asked about: the three versions that the list has not, or had not.
    heads = [key for method, key, _ in store.asked if method == "HEAD"]
    require(set(heads) == {mended} and len(heads) == 5, f"asked about {heads}")
    lasting = of_versions(30)
    require(len(lasting) > len(until) and len({version.headers[UNTIL] for version in store.objects[mended] if UNTIL in version.headers}) == 1,
            f"the mended version lasts otherwise: {[version.headers for version in store.objects[mended]]}")
    store.objects[mended][1].put = store.objects[mended][-1].put
    del store.objects["or-1/notes.txt"]
    require(last(30), f"they do not last 30 days: {of_versions(30)}")
    require(UNTIL not in loose.headers and stranger.headers[UNTIL] == until[mended] and probe.headers[UNTIL] == in_a_minute, "what is nobody's was locked")
    # Done is done: nothing is listed once more.
    status, told, _ = shipped()
    require(status == 0 and told["lengthened"] == 0 and not any("versions" in query for _, _, query in store.asked), f"asked again: {store.asked}")
    # A shorter time shortens nothing, and what is put meanwhile is lengthened with a longer one.
    asked_for(10)
    later = appliance.recorded(1)
    status, told, _ = shipped()
    require(status == 0 and told["lengthened"] == 0 and all(each > datetime.timedelta(days=19) for key, each in of_versions(10).items() if attack.case in key),
            f"shortened: {of_versions(10)}")
    require(all(abs(each) < datetime.timedelta(minutes=1) for key, each in of_versions(10).items() if later in key), "what is new lasts otherwise")
    asked_for(30)
    status, told, _ = shipped()
    require(status == 0 and 0 < told["lengthened"] < len(until) and last(30), f"what was put meanwhile: {told}, {of_versions(30)}")
    # Times that cannot be: nobody can shorten a lock again.
    asked_for(60)
    for put in (None, datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(days=365)):
        store.listing = lambda query, put=put: page([(key, version.name, len(version.body), i == 0, *([put] if put else []))
                                                     for key, found in sorted(store.objects.items())
                                                     if key.startswith(query["prefix"]) and key > query.get("key-marker", "") for i, version in enumerate(found)])
        status, told, said = shipped()
        words = "is yet to come" if put else "does not tell when it was put"
        require(status == 3 and told["lengthened"] == 0 and words in said and last(30), f"a store without times: {told}, {said}")
    store.listing = lambda query: None
    # Lists in no order, and without an end.
    store.listing = lambda query: page([(f"or-1/log/{name}", "v", 1, True) for name in "ba"])
    status, told, said = shipped()
    require(status == 3 and "its lists are in no order" in said, f"a list in no order: {told}, {said}")
    store.listing = lambda query: None
    # A list that is new, of an archive that has nothing any more: the store has it.
    for each in appliance.home.glob("shipping-*.sqlite"):
        each.unlink()
    archive, aside = appliance.home / "archive", appliance.home / "aside"
    archive.rename(aside)
    archive.mkdir()
    status, told, _ = shipped()
    locked = sum(UNTIL in version.headers for key, found in store.objects.items() if "/probe/" not in key for version in found)
    require(told["lengthened"] == locked and last(60), f"by a new list: {told}, of {locked}")
    archive.rmdir()
    aside.rename(archive)
    asked_for(90)
    # In small steps, as the service does it, and after it was killed it goes on.
    for _ in range(1200):
        old = store.put(mended.replace("00000000", f"{store.count:08d}"), b"old", {MODE: "COMPLIANCE", UNTIL: until[mended]})
        old.put = store.objects[mended][-1].put
    store.asked = []

    def followed(condition):
        with subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment, stdout=subprocess.PIPE, text=True) as following:
            try:
                eventually(condition, "nothing was lengthened")
            finally:
                following.kill()

    def set_so_far():
        return [key for method, key, query in store.asked if method == "PUT" and "retention" in query]

    followed(lambda: len(set_so_far()) >= 100)
    first = set_so_far()
    require(len(first) <= 510, f"{len(first)} in one step")
    status, told, _ = shipped("--status")
    require(status == 3 and told["locks_left"]["looked_at"] >= len(first) - 64, f"a killed one is not remembered: {told}")
    status, told, _ = shipped()
    again = set(first) & set(set_so_far())
    require(status == 0 and told["locks_left"] is None and last(90) and not again, f"{len(again)} were lengthened twice: {told}")
    toml.write_text(before, encoding="utf-8")
    appliance.kiroku("ship")


def erased_film_is_damaged(attack):
    """The appliance erased its own because the store keeps it: that its disks do not is told, as long as they were to."""
    appliance, store = attack.appliance, attack.store
    case = appliance.recorded(3)
    appliance.kiroku("ship")
    appliance.kiroku("erase", case, "--stream", "endoscope", "--policy", "reviewed")
    appliance.kiroku("ship")
    path = "segments/endoscope/00000000.ts.age"
    key = f"or-1/{case}/{path}"
    (version,) = store.objects[key]

    def mended():
        done = appliance.ask("ship", "--mend", case, "--json")
        told = json.loads(done.stdout)
        require(told["mended"] == [] and len(store.objects[key]) == 1, f"it was put again: {told}")
        return done.returncode, {each["file"]: each["why"] for each in told["not_mended"]}, told["erased"]

    require(mended() == (0, {}, []), "a sound store is not whole")
    version.body = bytes([version.body[0] ^ 1]) + version.body[1:]
    status, left, erased = mended()
    require(status == 3 and list(left) == [path] and "has other bytes, locked until" in left[path] and erased == [path], f"damaged under its lock: {status}, {left}")
    done = appliance.ask("ship", "--mend", case)
    require(done.returncode == 3 and f"could not mend {path}" in done.stderr and path not in done.stdout, f"told: {done}")
    entries = json.loads(appliance.kiroku("log", "--json"))["entries"]
    said = [each["what"] for each in entries if each["type"] == "access" and each["case"] == case and path in each["what"]]
    require(len(said) == 1 and said[0].startswith(f"could not mend {path}: the appliance erased it"), f"the log says {said}")
    store.status_of = lambda method, asked, query: (404, b"<Error><Code>NoSuchKey</Code></Error>") if asked == key and method in ("GET", "HEAD") else None
    status, left, erased = mended()
    require(status == 3 and "lists it and does not give it" in left[path] and erased == [path], f"lost, and still listed: {status}, {left}")
    store.status_of = lambda *_: None
    version.headers.update({HOLD: "ON", UNTIL: "2020-01-01T00:00:00Z"})
    status, left, _ = mended()
    require(status == 3 and "under legal hold" in left[path], f"damaged under a legal hold: {status}, {left}")
    version.headers[HOLD] = "OFF"
    require(mended() == (0, {}, [path]), "what nobody was to keep any more is missed")
    del store.objects[key]
    done = appliance.ask("ship", "--mend", case)
    require(done.returncode == 0 and "nothing is to be mended" in done.stdout, f"removed after its time: {done}")


def a_log_published_meanwhile(attack):
    """A checkpoint that another program publishes while hashes go to a slow store waits for those that it names."""
    home, store = attack.appliance.home, attack.store
    toml = (home / "kiroku.toml").read_text(encoding="utf-8")
    (home / "kiroku.toml").write_text(toml + "publish_log = true\n", encoding="utf-8")
    published = []

    def meanwhile(method, key, _):
        if method == "PUT" and key.startswith("or-1/published/tile/") and not published:
            published.append(key)
            attack.appliance.kiroku("export", attack.case, "--stream", "vitals", "-i", str(home / "identity.txt"),
                                    "-o", str(attack.folder / "out" / "meanwhile.csv"), "--force")
            attack.appliance.kiroku("log", "publish", str(home / "published-log"))

    def of_the_checkpoint():
        """The hashes that the store's checkpoint names, as long as they are fewer than 256."""
        found = store.objects.get("or-1/published/checkpoint")
        return found and f"or-1/published/tile/0/000.p/{int(found[0].body.splitlines()[1])}"

    (attack.folder / "out").mkdir(exist_ok=True)
    store.status_of = meanwhile
    attack.appliance.ask("ship")
    require(published, "nothing was published")
    require(of_the_checkpoint() is None, f"the checkpoint went before {of_the_checkpoint()}")
    attack.appliance.kiroku("ship")
    require(of_the_checkpoint() in store.objects, f"the checkpoint names {of_the_checkpoint()}, which is not there")
    (home / "kiroku.toml").write_text(toml, encoding="utf-8")


def segments_listed(fleet, case):
    return next(each["segments"] for each in fleet.tell("cases")["cases"] if each["case"] == case)


def catalogue(attack):
    """What kiroku-fleet makes of such a store, where PostgreSQL is installed."""
    started = subprocess.run([str(HERE / "postgres.sh"), "up", str(attack.folder / "postgres")], capture_output=True, text=True)
    if started.returncode == 77:
        return print(started.stdout.strip())
    try:
        connection = started.stdout.strip().splitlines()[-1]
        fleet = Fleet(attack.programs, attack.folder / "fleet", attack.store.endpoint, connection, {"or-1": attack.appliance})
        require(fleet.ask("init").returncode == 0, "init failed")
        # Whoever may write rows names folders outside.
        precious = attack.folder / "fleet" / "precious"
        precious.mkdir()
        (attack.folder / "fleet/precious.pub").write_bytes((attack.appliance.home / "device.pub").read_bytes())
        subprocess.run([*"psql -qtA -v ON_ERROR_STOP=1 -d".split(), connection, "-c",
                        "INSERT INTO kiroku.cases (appliance, case_id, opened, state, streams, segments, bytes, tokens, ledger_bytes, changed)"
                        f" VALUES ('../precious', '{attack.case}', now(), 'closed', '', 0, 0, 0, 0, 0)"], check=True)
        told = fleet.tell("verify", status=3)["cases"]
        require("names no case" in told[0]["detail"] and precious.is_dir(), f"a folder outside: {told}")
        fleet.tell("index", status=1)
        # One case's objects become another's: newer versions under the same keys.
        for key, found in attack.shipped.items():
            if key.startswith(f"or-1/{attack.other}/"):
                attack.store.put(key.replace(attack.other, attack.case), found[0].body)
        del attack.store.objects[attack.segment()][1:]
        attack.store.objects[attack.of_case("ledger.jsonl")][1:] = []
        told = fleet.tell("verify", "--all", status=1)["cases"]
        found = {each["case"]: each["verdict"] for each in told if each["appliance"] == "or-1"}
        require(found[attack.other] == "intact" and found[attack.case] not in ("intact", "intact-with-gaps"), f"another case: {told}")
        # A ledger that is read whole where somebody watches: none is as long, and an older one that is not is taken.
        ledger = f"or-1/{attack.other}/ledger.jsonl"
        recorded = attack.store.objects[ledger][0].body
        lines = recorded.splitlines(keepends=True)
        segment = next(line for line in lines if b'"type":"segment"' in line)
        attack.store.put(ledger, lines[0] + segment * (2**25 // len(segment) + 1))
        told = fleet.tell("index", "--anew", status=1)["appliances"]
        require(not any(each["problems"] for each in told), f"an older ledger was not taken: {told}")
        require(segments_listed(fleet, attack.other) == recorded.count(b'"type":"segment"'), "the long ledger was listed")
        attack.store.objects[ledger][1:] = []
        told = fleet.tell("index", "--anew", status=1)["appliances"]
        require(any("no recording of a hundred hours" in problem for each in told for problem in each["problems"]), f"a long ledger: {told}")
        changed_and_unreadable(attack, fleet, ledger, recorded)
    finally:
        subprocess.run([str(HERE / "postgres.sh"), "down", str(attack.folder / "postgres")], check=False)


def changed_and_unreadable(attack, fleet, ledger, recorded):
    """What the index sees and cannot read is no longer what was verified."""
    def row_of_other():
        (row,) = [each for each in fleet.tell("cases", "--appliance", "or-1")["cases"] if each["case"] == attack.other]
        return row

    attack.store.objects[ledger] = []
    attack.store.put(ledger, recorded)
    fleet.tell("index", "--anew", status=1)
    fleet.ask("verify", "--all")
    require(row_of_other()["verdict"] == "intact", f"before: {row_of_other()}")
    # By whoever may put, under a key of their own: the store answers 400.
    unread = attack.store.put(ledger, recorded)
    attack.store.status_of = lambda method, key, query: (
        (400, b"<Error><Code>InvalidRequest</Code></Error>") if key == ledger and query.get("versionId") in (None, unread.name) else None)
    attack.store.objects[ledger][1:] = []
    for _ in range(2):
        told = fleet.tell("index", status=1)["appliances"]
        require(any(attack.other in problem for each in told for problem in each["problems"]), f"it is not told each time: {told}")
        row = row_of_other()
        require(row["state"] == "unreadable" and row["verdict"] is None and row["opened"], f"an old verdict stands beside it: {row}")
        require(fleet.tell("status", status=1)["unreadable"] == 1, "the status does not tell")
    attack.store.honest()
    fleet.tell("index", status=1)
    require(row_of_other()["state"] == "closed", f"it is not read again: {row_of_other()}")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as name:
        pathlib.Path(name).chmod(0o755)
        attack = Attack(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(name))
        for attempt in (truth, another_case, endless_lists, names, versions, sizes, nothing_at_all, the_end_withheld, unconfirmed,
                        holds_lifted_below_the_appliance, locks_are_lengthened, erased_film_is_damaged, a_log_published_meanwhile,
                        catalogue):
            attempt(attack)
            attack.anew()
            print(f"holds: {attempt.__name__.replace('_', ' ')}", flush=True)


if __name__ == "__main__":
    main()
