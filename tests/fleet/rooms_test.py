#!/usr/bin/env python3
"""Appliances that report to the hospital's page: a real recorder, two servers and PostgreSQL, and whoever would report in another's name.

Usage: tests/fleet/rooms_test.py PROGRAMS
  PROGRAMS  the folder of kiroku, kirokud and kiroku-fleet, such as build/release/apps

Exit status: 0 everything holds, 1 something does not, 77 PostgreSQL is not installed.
"""
import contextlib
import fcntl
import hashlib
import http.client
import json
import os
import pathlib
import shutil
import socket
import ssl
import stat
import subprocess
import sys
import tempfile
import time

from fleet_test import start
from page_client import Person
from ship_test import HERE, eventually, require

ROOM = '''
[[room]]
name = "{name}"
[[room.stream]]
name = "endoscope"
kind = "video"
source = "synthetic:endoscope?size=160x120&rate=10"
[[room.stream]]
name = "vitals"
kind = "vitals"
source = "synthetic:patient"
'''


class FleetServer:
    """kiroku-fleet serve, with a page and an address for reports."""

    def __init__(self, programs, home, configuration):
        subprocess.run([programs / "kiroku", "init", "--demo", "--home", home], check=True, capture_output=True)
        self.process = subprocess.Popen(
            [programs / "kiroku-fleet", "serve", "--home", home, "--config", configuration, "--listen", "127.0.0.1:0", "--reports", "127.0.0.1:0",
             "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        told = ""
        for line in self.process.stdout:
            told += line
            if line.rstrip() == "}":
                break
        else:
            raise AssertionError(f"kiroku-fleet does not serve: {self.process.communicate()[1]}")
        told = json.loads(told)
        self.reports = told["reports"]
        self.administrator = Person(int(told["url"].split(":")[2].strip("/")))
        self.administrator.read("session", {"link": told["sign_in"].split("sign-in=")[1]})

    def rooms(self):
        return self.administrator.read("fleet/rooms")

    def kill(self):
        self.process.kill()
        self.process.communicate(timeout=60)


class Appliance:
    """A home with rooms of its own."""

    def __init__(self, programs, home, rooms):
        self.programs, self.home = programs, home
        self.environment = dict(os.environ, KIROKU_HOME=str(home))
        self.recorder = None
        self.kiroku("init", "--demo")
        with open(home / "kiroku.toml", "a", encoding="utf-8") as toml:
            toml.write("".join(ROOM.format(name=name) for name in rooms))

    def command(self, *words):
        return [str(self.programs / "kiroku"), *words]

    def ask(self, *words):
        return subprocess.run(self.command(*words), env=self.environment, capture_output=True, text=True, timeout=120)

    def kiroku(self, *words):
        done = self.ask(*words)
        require(done.returncode == 0, f"kiroku {' '.join(words)} left with {done.returncode}: {done.stderr}")
        return done.stdout

    def switch_on(self):
        self.recorder = subprocess.Popen([str(self.programs / "kirokud"), "--home", str(self.home)], stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL)
        eventually(lambda: self.ask("status").returncode == 0, "the recorder does not answer")

    def switch_off(self):
        if self.recorder:
            self.recorder.kill()
            self.recorder.wait(timeout=60)

    def begin_to_enrol(self, url, name):
        """The process that waits, and the code that it shows."""
        process = subprocess.Popen(self.command("fleet", "enrol", url, "--name", name, "--json"), env=self.environment, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        told = ""
        for line in process.stdout:
            told += line
            if line.rstrip() == "}":
                return process, json.loads(told)
        raise AssertionError(f"no code was shown: {process.communicate()[1]}")

    def identity(self):
        return json.loads((self.home / "reporting.json").read_text())

    def point_to(self, url):
        (self.home / "reporting.json").write_text(json.dumps({**self.identity(), "url": url}))

    @contextlib.contextmanager
    def following(self):
        """What kiroku-report.service does, meanwhile."""
        process = subprocess.Popen(self.command("fleet", "report", "--follow"), env=self.environment, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        try:
            yield process
        finally:
            process.terminate()
            process.communicate(timeout=60)


def report_desk(url, identity=None, folder=None):
    """A connection of somebody with this certificate, or without one."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    if identity:
        file = folder / "shown.pem"
        file.write_text(identity["key"] + identity["certificate"])
        context.load_cert_chain(file)
    host, _, port = url.removeprefix("https://").partition(":")
    return http.client.HTTPSConnection(host, int(port), context=context, timeout=60)


def answer(connection, path, body, method="POST"):
    """Status and sentence; 0 where the connection was ended."""
    try:
        connection.request(method, path, body, {"Content-Type": "application/json"})
        given = connection.getresponse()
        text = given.read().decode()
        return given.status, json.loads(text).get("error", "") if text else ""
    except (ssl.SSLError, ConnectionError, http.client.HTTPException):
        return 0, ""
    finally:
        connection.close()


def only(rows, appliance, room):
    found = [row for row in rows if row["appliance"] == appliance and (row["room"] or {}).get("room") == room]
    require(len(found) == 1, f"{appliance} has {len(found)} rows of {room}: {rows}")
    return found[0]


def try_enrolling(servers, appliance, twin):
    process, told = appliance.begin_to_enrol(servers[0].reports, "or-1")
    require(told["appliance"] == "or-1" and len(told["fingerprint"]) == 95, f"what it shows is {told}")
    admin = servers[0].administrator
    status, text = admin.ask("fleet/enrolments", {"code": "0000-0000-0000-0000"})
    require(status == 400 and b"no appliance that waits" in text, f"a wrong code is answered with {status}: {text}")
    require(process.poll() is None, "a wrong code enrolled it")
    twin_process, twin_told = twin.begin_to_enrol(servers[1].reports, "or-1")
    require(twin_told["code"] != told["code"], "two requests show one code")
    # The other server takes the code, too, in small letters.
    done = servers[1].administrator.read("fleet/enrolments", {"code": told["code"].lower()})
    require(done == {"appliance": "or-1", "fingerprint": told["fingerprint"]}, f"what was enrolled is {done}")
    require(process.wait(timeout=60) == 0, f"it was not told: {process.stderr.read()}")
    mode = stat.S_IMODE((appliance.home / "reporting.json").stat().st_mode)
    require(mode == 0o600, f"the key is open: {mode:o}")
    status, text = admin.ask("fleet/enrolments", {"code": twin_told["code"]})
    require(status in (400, 409) and b"is enrolled already" in text, f"a second or-1 is answered with {status}: {text}")
    twin_process.terminate()
    twin_process.communicate(timeout=60)
    refused = twin.ask("fleet", "enrol", servers[0].reports, "--name", "or-1")
    require(refused.returncode == 2 and "revoke" in refused.stderr, f"a second or-1 hears {refused.stderr}")
    log = subprocess.run(appliance.command("log", "--home", str(servers[1].home)), capture_output=True, text=True, check=True).stdout
    require("enrols appliance or-1" in log, f"the log does not say who enrolled: {log}")


def try_spoiling_enrolment(server, folder, appliance, psql):
    """By whoever reaches the address for reports, without a certificate."""
    url = server.reports
    psql("DELETE FROM kiroku.enrolments")
    # What stands before a request is not the request: a zero byte there must not end what the database keeps.
    for before in ("\0\n", "\0"):
        status, sentence = answer(report_desk(url), "/enrol", json.dumps({"request": before + certificate_request(folder, "or-9")}))
        require(status in (202, 400), f"a request behind a zero byte is answered with {status} {sentence}")
    process, told = appliance.begin_to_enrol(url, "or-8")
    try:
        status, text = server.administrator.ask("fleet/enrolments", {"code": "0000-0000-0000-0000"})
        require(b"no appliance that waits" in text, f"while a stranger's request waits, a code is answered with {status}: {text}")
        # Text that is no UTF-8 would end the connection to the database that all reports share.
        statuses = [raw_status(url, target) for target in (b"/enrol/\xff", b"/enrol/" + b"0" * 5000, b"/enrol/" + b"0" * 32, b"/enrol/'")]
        require(statuses == [404] * 4, f"addresses of nobody are answered with {statuses}")
        statuses = [raw_status(url, b"/enrol/" + b"1" * 64) for _ in range(8)]
        require(429 in statuses, f"whoever guesses again and again is answered with {statuses}")

        def ask_to_be_enrolled(number):
            return answer(report_desk(url), "/enrol", json.dumps({"request": certificate_request(folder, f"or-{number}")}))[0]

        statuses = [ask_to_be_enrolled(number) for number in range(20, 28)]
        require(429 in statuses, f"whoever asks to be enrolled again and again is answered with {statuses}")
        # Whom they share their address with is told of its certificate none the less.
        code = told["code"]
        server.administrator.read("fleet/enrolments", {"code": code})
        eventually(lambda: raw_status(url, b"/enrol/" + b"1" * 64) and process.poll() is not None,
                   "an appliance is not told of its certificate while somebody at its address guesses")
        require(process.returncode == 0 and appliance.identity()["appliance"] == "or-8", f"it was told {process.stderr.read()}")
        require(raw_status(url, b"/enrol/" + b"1" * 64) == 429, "whoever guesses is not slowed down any more")
        # Twenty rooms behind one proxy do not wait for each other.
        status = ask_to_be_enrolled(28)
        require(status != 429, f"after one of this address was enrolled, the next one is answered with {status}")
    finally:
        process.terminate()
        process.communicate(timeout=60)
        psql("DELETE FROM kiroku.enrolments")


def try_taking_a_name(server, folder, appliance, admit, psql):
    """By a copy of an enrolled appliance."""
    def concerns():
        return {concern for row in server.rooms()["rooms"] if row["appliance"] == "or-1" for concern in row["concerns"]}

    def enrol_anew():
        server.administrator.tell("fleet/appliances/or-1/revocation", {})
        process, told = appliance.begin_to_enrol(server.reports, "or-1")
        admit(told)
        require(process.wait(timeout=60) == 0, "it was not told")

    def told_by(thief, run):
        return answer(report_desk(server.reports, thief, folder), "/report", json.dumps({**report, "run": run * 32}))[0]

    psql("UPDATE kiroku.appliances SET doubled = NULL")
    report = json.loads(appliance_report(appliance, server.reports))
    # With a new run each time, so that none of its own comes twice.
    require("two-of-one-name" not in concerns(), f"before there was a copy it is {concerns()}")
    require([told_by(appliance.identity(), run) for run in "12"] == [200, 200], "the copy is refused")
    appliance.kiroku("fleet", "report")
    require("two-of-one-name" in concerns(), "a copy whose runs are new each time is not seen")
    enrol_anew()
    require("two-of-one-name" not in concerns(), "an appliance that was enrolled anew is two yet")

    # What whoever has the original's disk can work out: its path, and the boot identifier out of a ledger.
    boot = pathlib.Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    of_the_disk = hashlib.sha256(f"{boot} {appliance.home.resolve()}".encode()).hexdigest()[:32]
    appliance.kiroku("fleet", "report")
    require(answer(report_desk(server.reports, appliance.identity(), folder), "/report", json.dumps({**report, "run": of_the_disk}))[0] == 200, "the copy is refused")
    appliance.kiroku("fleet", "report")
    require("two-of-one-name" in concerns(), "a copy that names the run of the original, as far as its disk tells it, is not seen")
    enrol_anew()

    # Several at one moment: what stays there is the certificate that counts.
    before = appliance.identity()["certificate"]
    held = os.open(appliance.home, os.O_RDONLY | os.O_DIRECTORY)
    fcntl.flock(held, fcntl.LOCK_EX)
    refused = appliance.ask("fleet", "report", "--renew")
    require(refused.returncode == 2 and "another process of this appliance renews" in refused.stderr and appliance.identity()["certificate"] == before,
            f"while another process renews, a renewal says {refused.stderr}")
    appliance.kiroku("fleet", "report")
    os.close(held)
    for _ in range(3):
        at_once = [subprocess.Popen(appliance.command("fleet", "report", "--renew"), env=appliance.environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                   for _ in range(4)]
        said = [(process.communicate(timeout=120)[1], process.returncode) for process in at_once]
        require(any(status == 0 for _, status in said), f"of several renewals at one moment none was made: {said}")
        require(all(status == 0 or "another process of this appliance renews" in words for words, status in said), f"a renewal at the same moment says {said}")
        appliance.kiroku("fleet", "report")
    require("two-of-one-name" not in concerns(), "renewals at one moment count as a second appliance")

    # The service takes up what was renewed by hand, and is no copy.
    with appliance.following():
        for _ in range(3):
            appliance.kiroku("fleet", "report", "--renew")
        eventually(lambda: "not-heard" not in concerns() and "never-heard" not in concerns(), "it is not heard of")
        before = heard(server)
        eventually(lambda: heard(server) > before, "the service does not report by what was renewed by hand")
    require("two-of-one-name" not in concerns(), "a renewal by hand counts as a second appliance")

    copy = Appliance.__new__(Appliance)
    copy.programs, copy.home, copy.recorder = appliance.programs, folder / "copy", None
    copy.environment = dict(os.environ, KIROKU_HOME=str(copy.home))
    # Without its cases, which go on meanwhile.
    shutil.copytree(appliance.home, copy.home, ignore=lambda _, names: [name for name in names if name == "archive" or "sock" in name])
    copy.kiroku("fleet", "report", "--renew")
    for _ in range(2):
        refused = appliance.ask("fleet", "report")
        require(refused.returncode == 2 and "a copy of this appliance did" in refused.stderr, f"whose name was taken hears {refused.stderr}")
    require(told_by(copy.identity(), "3") == 200, "the copy is refused")
    require("two-of-one-name" in concerns(), "a copy that renewed the certificate is not seen")
    # Nobody is there any more who could contradict it.
    psql("UPDATE kiroku.appliances SET replaced_shown = replaced_shown - interval '3 days' WHERE name = 'or-1'")
    require(told_by(copy.identity(), "3") == 200 and "two-of-one-name" in concerns(), "the copy is forgotten")
    enrol_anew()
    require(copy.ask("fleet", "report").returncode == 2, "the copy reports yet")
    require("two-of-one-name" not in concerns(), "who was revoked tells of who has the name now")


def heard(server):
    return max((row["heard"] or "" for row in server.rooms()["rooms"] if row["appliance"] == "or-1"), default="")


def raw_status(url, target):
    """Of a request whose address http.client would not send."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    host, _, port = url.removeprefix("https://").partition(":")
    with socket.create_connection((host, int(port)), timeout=60) as plain, context.wrap_socket(plain) as tls:
        tls.sendall(b"GET " + target + b" HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
        return int(tls.recv(100).split(b" ")[1])


def try_reporting(servers, appliance, psql):
    row = only(servers[0].rooms()["rooms"], "or-1", None)
    require(row["concerns"] == ["never-heard"] and not row["is_heard"], f"before its first report it is {row}")
    appliance.kiroku("fleet", "report")
    row = only(servers[1].rooms()["rooms"], "or-1", None)
    require(row["concerns"] == ["no-recorder"], f"without a recorder it is {row}")
    appliance.switch_on()
    appliance.kiroku("case", "start", "--room", "or-1", "--json")

    def live():
        rows = [row for row in servers[1].rooms()["rooms"] if row["room"] and row["room"]["room"] == "or-1"]
        return bool(rows) and rows[0]["is_heard"] and rows[0]["room"]["state"] == "recording" and rows[0]["room"]["recording_since"]

    with appliance.following():
        eventually(live, "the page does not show that or-1 records")
        rows = servers[1].rooms()["rooms"]
        require({row["room"]["room"] for row in rows} == {"or-1", "or-2"}, f"rooms are {rows}")
        require(only(rows, "or-1", "or-2")["room"]["state"] != "recording", "or-2 records, too")
        require(only(rows, "or-1", "or-1")["recorder"]["disk"]["free_bytes"] > 0, "no disk is told")

        # One server dies: nothing is lost, and the other one says the same.
        before = only(servers[1].rooms()["rooms"], "or-1", "or-1")["heard"]
        servers[0].kill()
    after = only(servers[1].rooms()["rooms"], "or-1", "or-1")
    require(after["heard"] >= before, "a report went with the server that was killed")

    # Long ago, as the database sees it.
    psql("UPDATE kiroku.appliances SET heard = heard - interval '1 hour' WHERE name = 'or-1'")
    rows = servers[1].rooms()["rooms"]
    unheard = only(rows, "or-1", "or-1")
    require(not unheard["is_heard"] and unheard["concerns"] == ["not-heard"] and unheard["urgent"], f"an appliance that fell silent is {unheard}")
    refused = appliance.ask("fleet", "report")
    require(refused.returncode == 2 and "cannot reach" in refused.stderr, f"without a server it says {refused.stderr}")
    require(appliance.ask("status").returncode == 0, "the recorder minds that nobody takes its reports")


def try_attacks(server, appliance, other, folder, psql):
    url, good = server.reports, appliance.identity()
    report = json.loads(appliance_report(appliance, url))

    def told(identity, body, path="/report"):
        return answer(report_desk(url, identity, folder), path, body if isinstance(body, (bytes, str)) else json.dumps(body))

    require(told(good, report) == (200, ""), f"its own report is answered with {told(good, report)}")
    status, sentence = told(None, report)
    require(status == 401 and "enrol" in sentence, f"without a certificate: {status} {sentence}")
    # A certificate of the same name by another authority, which whoever has the files of another fleet can make.
    require(told(foreign_identity(folder, "or-1"), report)[0] == 0, "a foreign certificate is let in")
    # The server's own certificate is none of a client; a second appliance's is that of the second alone.
    require(told(other.identity(), {**report, "appliance": "or-1", "name": "or-1"})[0] == 200, "or-7 cannot report")
    require(only(server.rooms()["rooms"], "or-7", "or-1")["appliance"] == "or-7", "a report counted as another appliance's")
    request = json.dumps({"request": certificate_request(folder, "or-1")})
    status, sentence = told(other.identity(), request, "/renew")
    require(status == 403 and "another name" in sentence, f"or-7 that asks for a certificate of or-1: {status} {sentence}")

    require(told(good, b" " * (65 << 10))[0] in (413, 0), "a body of 65 KiB is taken")
    require(told(good, b"[" * 60000)[0] == 400, "brackets are taken")
    for change in ({"room": "or-1\u001b[2J"}, {"room": "<img src=x>"}, {"room": "\u0000"}, {"case": "../x"}, {"recording_s": -5}, {"lost": 1e300}):
        hostile = json.loads(json.dumps(report))
        hostile["recorder"]["rooms"][0].update(change)
        status, sentence = told(good, hostile)
        require(status == 400 and sentence.isprintable(), f"{change} is answered with {status}: {sentence!r}")
    for lie in ("1970-01-01T00:00:00Z", "9999-12-31T23:59:59Z"):
        require(told(good, {**report, "now": lie})[0] == 200, "a clock that lies is not taken")
        row = only(server.rooms()["rooms"], "or-1", "or-1")
        require(row["is_heard"] and "clock-off" in row["concerns"] and abs(since(row)) < 3600, f"a clock that lies makes it {row}")
    require(answer(report_desk(url), "/enrol", json.dumps({"request": "x"}))[0] in (400, 429), "nonsense asks to be enrolled")
    require(answer(report_desk(url), "/enrol/../report", None, "GET")[0] == 404, "an address of nothing")
    require(answer(report_desk(url), "/api/fleet/rooms", None, "GET")[0] == 404, "the page is served where appliances report")
    statuses = [answer(report_desk(url), "/enrol", json.dumps({"request": "x"}))[0] for _ in range(8)]
    require(429 in statuses, f"whoever asks again and again is answered with {statuses}")

    # A report by hand beside the service is no second appliance.
    with appliance.following() as _:
        eventually(lambda: json.loads(appliance.kiroku("fleet", "report", "--json")) and only(server.rooms()["rooms"], "or-1", "or-1")["is_heard"],
                   "it is not heard of")
        for _ in range(2):
            appliance.kiroku("fleet", "report")
    require("two-of-one-name" not in only(server.rooms()["rooms"], "or-1", "or-1")["concerns"], "a report by hand counts as a second appliance")
    # A copy that goes on beside the original is seen; a certificate that was replaced or revoked is none.
    for run in ("a" * 32, "b" * 32, "a" * 32):
        require(told(good, {**report, "run": run})[0] == 200, "a run is refused")
    require("two-of-one-name" in only(server.rooms()["rooms"], "or-1", "or-1")["concerns"], "a copy is not seen")
    appliance.kiroku("fleet", "report", "--renew")
    status, sentence = told(good, report)
    require(status == 403 and "another certificate" in sentence, f"what was replaced: {status} {sentence}")
    appliance.kiroku("fleet", "report")
    server.administrator.tell("fleet/appliances/or-1/revocation", {})
    refused = appliance.ask("fleet", "report")
    require(refused.returncode == 2 and "revoked" in refused.stderr, f"a revoked appliance hears {refused.stderr}")
    require(all(row["appliance"] != "or-1" for row in server.rooms()["rooms"]), "a revoked appliance is shown")
    require(server.administrator.ask("fleet/appliances/or-1/revocation", {})[0] == 404, "it is revoked twice")
    psql("UPDATE kiroku.wrong_codes SET failures = 20, last = now(), open_again = now() + interval '5 minutes'")
    status, text = server.administrator.ask("fleet/enrolments", {"code": "0000-0000-0000-0000"})
    require(status == 400 and b"too many wrong codes" in text, f"guessing is answered with {status}: {text}")


def try_another_fleet(other, appliance):
    """A server that shares everything but the authority with which the appliance was enrolled."""
    url = appliance.identity()["url"]
    refused = None
    try:
        appliance.point_to(other.reports)
        refused = appliance.ask("fleet", "report")
    finally:
        appliance.point_to(url)
    require(refused.returncode == 2 and "is not the fleet" in refused.stderr, f"it reports to a stranger: {refused.returncode} {refused.stderr}")


def try_enrolling_anew(server, appliance, admit, psql):
    """While the service runs, whose certificate was revoked."""
    psql("UPDATE kiroku.wrong_codes SET failures = 0, open_again = now()")
    with appliance.following() as follower:
        require("revoked" in follower.stderr.readline(), "the service does not say that it was revoked")
        process, told = appliance.begin_to_enrol(server.reports, "or-1")
        admit(told)
        require(process.wait(timeout=60) == 0, "it was not told")
        eventually(lambda: any(row["appliance"] == "or-1" and row["is_heard"] for row in server.rooms()["rooms"]),
                   "the service does not report by what it was enrolled with anew")


def since(row):
    """Seconds between now and when the row's room began to record."""
    began = time.strptime(row["room"]["recording_since"][:19], "%Y-%m-%dT%H:%M:%S")
    return time.mktime(time.gmtime()) - time.mktime(began)


def appliance_report(appliance, url):
    """What it reports, to this server from now on."""
    appliance.point_to(url)
    return appliance.kiroku("fleet", "report", "--json")


def openssl(folder, *words):
    subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)


def certificate_request(folder, name):
    openssl(folder, "req", "-new", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", "foreign.key", "-subj", f"/CN={name}",
            "-out", "foreign.csr")
    return (folder / "foreign.csr").read_text()


def foreign_identity(folder, name):
    openssl(folder, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", "foreign.key", "-subj",
            f"/O=Kiroku fleet/CN={name}", "-days", "2", "-out", "foreign.pem")
    return {"key": (folder / "foreign.key").read_text(), "certificate": (folder / "foreign.pem").read_text()}


def try_everything(programs, folder, connection):
    configuration = folder / "fleet.toml"
    configuration.write_text(f'[store]\nendpoint = "https://127.0.0.1:1"\nbucket = "recordings"\n[catalogue]\nconnection = "{connection}"\n')
    subprocess.run([programs / "kiroku-fleet", "init", "--config", configuration], check=True, capture_output=True)

    def psql(statement):
        subprocess.run(["psql", connection, "-v", "ON_ERROR_STOP=1", "-c", statement], check=True, capture_output=True)

    servers = []
    appliances = []
    try:
        for number in (1, 2):
            servers.append(FleetServer(programs, folder / f"page-{number}", configuration))
            servers[-1].home = folder / f"page-{number}"
        for name, rooms in (("one", ["or-1", "or-2"]), ("twin", ["or-1"]), ("seven", ["or-1"])):
            appliances.append(Appliance(programs, folder / name, rooms))
        one, twin, seven = appliances
        try_enrolling(servers, one, twin)
        try_reporting(servers, one, psql)
        process, told = seven.begin_to_enrol(servers[1].reports, "or-7")

        def admit(told):
            done = subprocess.run([programs / "kiroku-fleet", "enrol", told["code"], "--config", configuration], capture_output=True, text=True,
                                  check=False)
            require(done.returncode == 0 and told["fingerprint"] in done.stdout, f"kiroku-fleet enrol says {done.stdout}{done.stderr}")

        admit(told)
        require(process.wait(timeout=60) == 0, "or-7 was not told")
        other_fleet = folder / "other-fleet.toml"
        other_fleet.write_text(configuration.read_text() + '[reports]\nauthority = "other-authority"\n')
        servers.append(FleetServer(programs, folder / "page-3", other_fleet))
        try_another_fleet(servers[2], seven)
        try_attacks(servers[1], one, seven, folder, psql)
        # Of a server that was not asked too often, as the one that was attacked.
        servers.append(FleetServer(programs, folder / "page-4", configuration))
        try_enrolling_anew(servers[3], one, admit, psql)
        try_spoiling_enrolment(servers[3], folder, twin, psql)
        servers.append(FleetServer(programs, folder / "page-5", configuration))
        try_taking_a_name(servers[4], folder, one, admit, psql)
        listed = subprocess.run([programs / "kiroku-fleet", "rooms", "--config", configuration], capture_output=True, text=True, check=False)
        require("or-7" in listed.stdout, f"kiroku-fleet rooms says {listed.stdout}{listed.stderr}")
    finally:
        for server in servers:
            server.kill()
        for appliance in appliances:
            appliance.switch_off()


def with_postgres(usage, try_everything, well):
    """The program of a test: tries everything beside a database of its own, then says that all was well."""
    if len(sys.argv) != 2:
        sys.exit(usage)
    programs = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        folder.chmod(0o755)
        connection = start("postgres.sh", folder / "postgres")
        try:
            try_everything(programs, folder, connection)
        finally:
            subprocess.run([str(HERE / "postgres.sh"), "down", str(folder / "postgres")], capture_output=True, check=False)
            shutil.rmtree(folder / "postgres", ignore_errors=True)
    print(well)


if __name__ == "__main__":
    with_postgres(__doc__, try_everything, "Appliances report, and nobody reports in their name.")
