#!/usr/bin/env python3
"""Appliances that have their checkpoints stamped together: two recorders, kiroku-fleet, PostgreSQL, and an authority of `openssl ts` that counts who asks.

Usage: tests/fleet/aggregate_test.py PROGRAMS
  PROGRAMS  the folder of kiroku, kirokud, kiroku-fleet and kiroku-verify, such as build/release/apps

Exit status: 0 everything holds, 1 something does not, 77 PostgreSQL is not installed.
"""
import collections
import http.server
import json
import pathlib
import re
import subprocess
import sys
import threading

from rooms_test import Appliance, FleetServer, answer, foreign_identity, report_desk, with_postgres
from ship_test import HERE, eventually, require

sys.path.insert(0, str(HERE.parent / "foreign"))
import stamp  # noqa: E402  (a second implementation of the format, which has an authority)


TOO_MANY = "more requests came from this appliance in a minute than all its rooms need"


class PatientServer(http.server.ThreadingHTTPServer):
    request_queue_size = 256  # of a hospital whose rooms all ask at once


class CountingAuthority:
    """An outside authority. Whoever asks has an address of their own, by which they are counted."""

    def __init__(self, folder, name="Outside", **given):
        self.authority, self.asked = stamp.Authority(folder, name, **given), collections.Counter()
        counting = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                query = self.rfile.read(int(self.headers["Content-Length"]))
                counting.asked[self.path.strip("/")] += 1
                response = counting.authority.answer(query)
                self.send_response(200)
                self.send_header("Content-Type", "application/timestamp-reply")
                self.send_header("Content-Length", str(len(response)))
                self.end_headers()
                self.wfile.write(response)

            def log_message(self, *_):
                pass

        self.server = PatientServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def url(self, who):
        return f"http://127.0.0.1:{self.server.server_address[1]}/{who}"


class SharingAppliance(Appliance):
    """One room, whose authority is asked by the hospital's aggregator."""

    def __init__(self, programs, home, name, authority):
        super().__init__(programs, home, [name])
        self.name, self.log = name, home / "recorder.log"
        text = (home / "kiroku.toml").read_text()
        own = '[[authority]]\nname = "embedded"\nurl = "embedded"\n'
        require(own in text, "kiroku init writes another [[authority]]")
        text = text.replace(own, f'[[authority]]\nname = "outside"\nurl = "{authority.url(name)}"\nshared = true\nshared_patience = "20s"\n')
        text = re.sub(r'(?m)^stamp_every = .*$', 'stamp_every = "2s"', text)
        (home / "kiroku.toml").write_text(text)
        (home / "trust.pem").write_text(authority.authority.root)

    def switch_on(self):
        with open(self.log, "wb") as log:
            self.recorder = subprocess.Popen([str(self.programs / "kirokud"), "--home", str(self.home)], stdout=log, stderr=log)
        eventually(lambda: self.ask("status").returncode == 0, "the recorder does not answer")

    def begin(self):
        self.kiroku("case", "start", "--room", self.name, "--json")
        eventually(lambda: len(list((self.home / "archive").glob("2*/ledger.jsonl"))) == 1, "no case begins")
        self.case = next((self.home / "archive").glob("2*/ledger.jsonl")).parent

    def tokens(self):
        """The entries of tokens, in their order, but for a last line that is being written."""
        lines = (self.case / "ledger.jsonl").read_text("utf-8").splitlines(keepends=True)
        return [entry for entry in (json.loads(line) for line in lines if line.endswith("\n")) if entry["type"] == "token"]

    def shared(self):
        return [token for token in self.tokens() if token["file"].endswith(".ers")]

    def authority_status(self):
        rooms = json.loads(self.kiroku("status", "--json"))["rooms"]
        return rooms[0]["authorities"][0]


def enrol(programs, configuration, server, appliance):
    process, told = appliance.begin_to_enrol(server.reports, appliance.name)
    done = subprocess.run([programs / "kiroku-fleet", "enrol", told["code"], "--config", configuration], capture_output=True, text=True, check=False)
    require(done.returncode == 0, f"kiroku-fleet enrol says {done.stdout}{done.stderr}")
    require(process.wait(timeout=60) == 0, "the appliance was not told")


def require_intact(programs, authority, appliance):
    """By three verifiers: the small program, the second implementation, and `kiroku token verify` for each shared token."""
    root = authority.authority.path("root.pem")
    done = subprocess.run([programs / "kiroku-verify", appliance.case, "--device", appliance.home / "device.pub", "--trust", root], capture_output=True,
                          text=True, check=False)
    require(done.returncode == 0 and "INTACT" in done.stdout, f"{appliance.name} is not intact: {done.stdout}{done.stderr}")
    other = subprocess.run([sys.executable, HERE.parent / "foreign/verify.py", appliance.case, "--device", appliance.home / "device.pub", "--trust", root],
                           capture_output=True, text=True, check=True)
    require(json.loads(other.stdout)["verdict"] in ("intact", "gap"), f"the second verifier says {other.stdout}")
    for token in appliance.shared()[:3]:
        words = ["token", "verify", str(appliance.case / token["file"]), "--trust", root, "--json"]
        note = appliance.case / f"checkpoints/{token['checkpoint']:08d}.note"
        told = json.loads(appliance.kiroku(*words, "--data", str(note)))
        require(told["verdict"] == "valid" and told["shared"]["steps"] >= 1, f"kiroku token verify says {told}")
        refused = appliance.ask(*words, "--data", str(appliance.case / "ledger.jsonl"))
        require(refused.returncode == 1 and json.loads(refused.stdout)["code"] == "token-imprint-differs", f"over another file: {refused.stdout}")


def try_sharing(programs, authority, one, two):
    for appliance in (one, two):
        appliance.switch_on()
        appliance.begin()
    # One signature of the authority stands in both cases.
    eventually(lambda: {token["serial"] for token in one.shared()} & {token["serial"] for token in two.shared()}, "no token is shared")
    eventually(lambda: all(len(each.shared()) >= 3 for each in (one, two)), "rounds do not go on")
    require(authority.asked["or-1"] == authority.asked["or-2"] == 0, f"while tokens are shared, who asks is {authority.asked}")
    serials = {token["serial"] for each in (one, two) for token in each.shared()}
    require(authority.asked["aggregator"] <= len(serials) + 2, f"{authority.asked} requests gave {len(serials)} tokens")
    status = one.authority_status()
    require(status["path"].startswith("shared, by https://") and status["not_shared"] == "" and status["failures"] == 0, f"the status is {status}")
    require("shared, by https://" in one.kiroku("status"), "kiroku status does not say that tokens are shared")

    one.kiroku("case", "stop", "--room", "or-1")
    last = one.tokens()[-1]
    require(last["file"].endswith(".tsr") and authority.asked["or-1"] >= 1, f"the case's end waited for a round: {last}")
    require_intact(programs, authority, one)


def try_strangers(programs, configuration, server, folder, one, two):
    """By whoever has a certificate, or none; or-2 records meanwhile."""
    url = server.reports
    good = {"authority": "outside", "digest": "a" * 64, "nonce": "b" * 64}

    def told(identity, body, path="/stamp", method="POST"):
        connection = report_desk(url, identity, folder)
        return answer(connection, path, body if isinstance(body, (bytes, str)) else json.dumps(body), method)

    require(told(None, good)[0] == 401, "somebody without a certificate is let into a round")
    require(told(foreign_identity(folder, "or-1"), good)[0] == 0, "a certificate of another authority is let in")
    require(told(one.identity(), {**good, "authority": "nobody"})[0] == 404, "an authority of nobody is taken")
    for body in ("", "[", "{}", b"\xff", {**good, "digest": "a"}, {**good, "nonce": None}, {**good, "authority": "../x"}, "[" * 60000):
        status, sentence = told(one.identity(), body)
        require(status == 400 and sentence.isprintable(), f"{str(body)[:40]} is answered with {status} {sentence}")
    require(told(one.identity(), b" " * (65 << 10))[0] in (413, 0), "a body of 65 KiB is taken")

    connection = report_desk(url, one.identity(), folder)
    connection.request("POST", "/stamp", json.dumps(good), {"Content-Type": "application/json"})
    ticket = json.loads(connection.getresponse().read())["ticket"]
    require(told(two.identity(), None, f"/stamp/outside/{ticket}", "GET")[0] == 404, "or-2 hears of what or-1 gave")
    require(told(one.identity(), None, f"/stamp/outside/{'0' * 32}", "GET")[0] == 404, "a ticket of nobody is known")
    # It takes all that it may have, and more, on one connection; the other room's tokens are shared as before.
    before, statuses, sentences = len(two.shared()), collections.Counter(), set()
    for number in range(1500):
        connection.request("POST", "/stamp", json.dumps({**good, "digest": f"{number:064x}"}), {"Content-Type": "application/json"})
        given = connection.getresponse()
        sentences.add(json.loads(given.read()).get("error", ""))
        statuses[given.status] += 1
    connection.close()
    require(statuses[429] > 0 and set(statuses) <= {202, 429}, f"whoever asks without end is answered with {statuses}")
    require(TOO_MANY in sentences, f"no request is one too many in a minute: {sentences}")
    eventually(lambda: len(two.shared()) >= before + 2, "an appliance that asks without end keeps another one from its rounds")

    # What was asked with a certificate that was replaced is not counted against its successor of the same name.
    former = one.identity()
    one.kiroku("fleet", "report", "--renew")
    require(one.identity()["certificate"] != former["certificate"], "no other certificate was given")
    require(told(one.identity(), good)[1] != TOO_MANY, "a certificate that was replaced takes its successor's requests away")
    eventually(lambda: told(one.identity(), good)[0] == 202, "a new certificate is not let into a round")
    subprocess.run([programs / "kiroku-fleet", "revoke", "or-1", "--config", configuration], check=True, capture_output=True)
    status, sentence = told(one.identity(), good)
    require(status == 403 and "revoked" in sentence, f"a revoked appliance is answered with {status} {sentence}")


def try_falling_back(programs, configuration, authority, server, appliance):
    before = len(appliance.tokens())
    require(authority.asked[appliance.name] == 0, f"before the aggregator is killed, who asks is {authority.asked}")
    server.kill()
    eventually(lambda: any(token["file"].endswith(".tsr") for token in appliance.tokens()[before:]), "without an aggregator no token comes")
    require(authority.asked[appliance.name] >= 1, "the appliance's own request was not counted")
    status = appliance.authority_status()
    require(status["path"] == "directly" and status["not_shared"] and status["failures"] == 0, f"the status is {status}")
    require("not shared with other rooms: " in appliance.kiroku("status"), "kiroku status does not say why tokens are not shared")
    eventually(lambda: "not shared with other rooms: " in appliance.log.read_text(), "the log does not say why tokens are not shared")
    require(not any(json.loads(line)["type"] == "token-missed" for line in (appliance.case / "ledger.jsonl").read_text().splitlines()[:-1]),
            "falling back cost a time-stamp")
    # Another server takes the appliance's reports, and has no rounds: the hospital's page and the terminal say so.
    plain = configuration.with_name("plain.toml")
    plain.write_text(configuration.read_text().partition("[sharing]")[0])
    other = FleetServer(programs, configuration.parent / "other-page", plain)
    try:
        appliance.point_to(other.reports)
        appliance.kiroku("fleet", "report")
        row = next(row for row in other.rooms()["rooms"] if row["appliance"] == appliance.name)
        require("not-shared" in row["concerns"] and row["recorder"]["authorities"][0]["not_shared"], f"the page's room is {row}")
        told = subprocess.run([programs / "kiroku-fleet", "status", "--config", configuration], capture_output=True, text=True, check=True).stdout
        require(f"not shared        time-stamps of {appliance.name}: " in told, f"kiroku-fleet status says {told}")
    finally:
        other.kill()
    appliance.kiroku("case", "stop", "--room", appliance.name)
    require_intact(programs, authority, appliance)


def try_everything(programs, folder, connection):
    authority = CountingAuthority(folder / "outside")
    configuration = folder / "fleet.toml"
    configuration.write_text(f'[store]\nendpoint = "https://127.0.0.1:1"\nbucket = "recordings"\n[catalogue]\nconnection = "{connection}"\n'
                             f'[verification]\ntrust = ["{authority.authority.path("root.pem")}"]\n'
                             f'[sharing]\nevery = "2s"\n[[authority]]\nname = "outside"\nurl = "{authority.url("aggregator")}"\n')
    subprocess.run([programs / "kiroku-fleet", "init", "--config", configuration], check=True, capture_output=True)
    server = FleetServer(programs, folder / "page", configuration)
    appliances = []
    try:
        appliances = [SharingAppliance(programs, folder / name, name, authority) for name in ("or-1", "or-2")]
        one, two = appliances
        for appliance in appliances:
            enrol(programs, configuration, server, appliance)
        try_sharing(programs, authority, one, two)
        try_strangers(programs, configuration, server, folder, one, two)
        try_falling_back(programs, configuration, authority, server, two)
    finally:
        server.kill()
        for appliance in appliances:
            appliance.switch_off()


if __name__ == "__main__":
    with_postgres(__doc__, try_everything, "Rooms share one time-stamp, and have their own where nobody collects.")
