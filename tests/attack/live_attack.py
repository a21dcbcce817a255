#!/usr/bin/env python3
"""Attacks a kirokud that records, its viewer, its ports for monitors and the hook, and a witness, as a stranger on
the network does: all at once, for some seconds. Then it asks whether the case is whole and the programs serve.

Usage: tests/attack/live_attack.py BUILD [--seconds N] [--only NAME,...] [--keep]
  BUILD         the folder of the programs: build/release/apps
  --seconds N   how long each attack lasts (20)
  --only NAMES  these attacks alone; without it all of them
  --keep        leaves the home where it is, and says where

Everything is synthetic, in a temporary home, on this machine's loopback addresses. Exit status 0: the case is intact
or has stated gaps, everything answers, and memory stayed bounded. 1: something of that is not so.
"""
import argparse
import base64
import hashlib
import http.client
import json
import multiprocessing
import os
import pathlib
import random
import resource
import shutil
import signal
import socket
import ssl
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
from ports import reserved_port  # noqa: E402

PASSWORD = "correct horse battery"
USER = "a-surgeon"
HOOK_TOKEN = "0123456789abcdef0123456789abcdef"
# Of kirokud, beyond what it takes by itself; what it records takes about 60 MB.
MOST_MEMORY_MB = 400
ATTACKS = {}


def attack(function):
    ATTACKS[function.__name__] = function
    return function


def connect(port, source="127.0.0.1", timeout=5.0):
    return socket.create_connection(("127.0.0.1", port), timeout=timeout, source_address=(source, 0))


def somebody():
    """One of many addresses."""
    return f"127.0.{random.randrange(1, 200)}.{random.randrange(1, 250)}"


def quietly(action):
    try:
        return action()
    except (OSError, ssl.SSLError, http.client.HTTPException, ValueError):
        return None


def unverified():
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


def hold(until, port, first, step, count, source=somebody):
    """Keeps `count` connections, each of which says `first` and then what step(number) gives, again and again."""
    held, number = [], 0
    while time.monotonic() < until:
        while len(held) < count:
            one = quietly(lambda: connect(port, source(), 2))
            if one is None:
                break
            one.setblocking(False)
            quietly(lambda: one.send(first))
            held.append(one)
        alive = []
        for one in held:
            number += 1
            try:
                one.send(step(number))
                alive.append(one)
            except BlockingIOError:
                alive.append(one)
            except OSError:
                one.close()
        held = alive
        time.sleep(0.05)
    for one in held:
        one.close()


# A TLS 1.2 ClientHello's head: handshake record, hello with a stated length, version, random.
def hello(stated, body):
    handshake = b"\x01" + stated.to_bytes(3, "big") + b"\x03\x03" + os.urandom(32) + body
    return b"\x16\x03\x01" + struct.pack(">H", len(handshake)) + handshake


@attack
def slow_hellos(ports, until):
    bytes_of_one = hello(0x1fc, bytes(500))
    hold(until, ports["viewer"], b"\x16", lambda n: bytes_of_one[n % 500:n % 500 + 1], 300)


@attack
def huge_hellos(ports, until):
    record = b"\x16\x03\x01\x40\x00" + b"\x01\xff\xff\xff\x03\x03" + bytes(0x4000 - 6)
    more = b"\x16\x03\x01\x40\x00" + bytes(0x4000)
    hold(until, ports["viewer"], record, lambda n: more, 100)


@attack
def many_hellos(ports, until):
    context = unverified()
    while time.monotonic() < until:
        def one():
            with connect(ports["viewer"], somebody(), 2) as raw:
                outgoing = ssl.MemoryBIO()
                shaking = context.wrap_bio(ssl.MemoryBIO(), outgoing)
                try:
                    shaking.do_handshake()
                except ssl.SSLWantReadError:
                    raw.sendall(outgoing.read())
        quietly(one)


@attack
def connections(ports, until):
    places = [ports[name] for name in ("viewer", "hook", "mllp", "witness")]
    while time.monotonic() < until:
        quietly(lambda: connect(random.choice(places), somebody(), 1).close())


@attack
def noise(ports, until):
    places = [ports[name] for name in ("viewer", "hook", "mllp", "witness")]
    while time.monotonic() < until:
        def one():
            with connect(random.choice(places), somebody(), 1) as raw:
                raw.sendall(os.urandom(random.randrange(1, 70000)))
        quietly(one)


@attack
def endless_message(ports, until):
    hold(until, ports["mllp"], b"\x0bMSH|^~\\&|M|H|||20260805||ORU^R01|1|P|2.6\r", lambda n: b"OBX|" * 4000, 20,
         lambda: "127.0.0.1")


def observations(count):
    lines = [b"MSH|^~\\&|MON|OR|||20260805091502||ORU^R01|%d|P|2.6" % random.randrange(10**6), b"PID|1||x",
             b"OBR|1|||1"]
    lines += [b"OBX|%d|NM|147842^MDC_ECG_HEART_RATE^MDC|1.7.4.%d|%d|264864^MDC_DIM_BEAT_PER_MIN^MDC|||||F" %
              (i, i, random.randrange(30, 200)) for i in range(count)]
    return b"\x0b" + b"\r".join(lines) + b"\r\x1c\x0d"


@attack
def huge_messages(ports, until):
    message = observations(5000)
    while time.monotonic() < until:
        def one():
            with connect(ports["mllp"], "127.0.0.1", 3) as raw:
                while time.monotonic() < until:
                    raw.sendall(message)
                    raw.recv(65536)
        quietly(one)


@attack
def many_messages(ports, until):
    message = observations(3)
    while time.monotonic() < until:
        def one():
            with connect(ports["mllp"], "127.0.0.1", 3) as raw:
                while time.monotonic() < until:
                    raw.sendall(message * 50)
                    raw.recv(65536)
        quietly(one)


@attack
def half_frames(ports, until):
    hold(until, ports["mllp"], b"\x0b", lambda n: b"\x0b\x1c\r" if n % 3 else b"M", 60)


@attack
def strangers_monitor(ports, until):
    message = observations(3)
    while time.monotonic() < until:
        def one():
            with connect(ports["mllp"], "127.0.0.77", 1) as raw:
                raw.sendall(message)
                raw.recv(100)
        quietly(one)


def ask(port, method, target, body=None, headers=None, source="127.0.0.1", timeout=10, tls=True):
    """Status and body of one answer over a connection of its own."""
    if tls:
        asked = http.client.HTTPSConnection("127.0.0.1", port, timeout=timeout, context=unverified(),
                                            source_address=(source, 0))
    else:
        asked = http.client.HTTPConnection("127.0.0.1", port, timeout=timeout, source_address=(source, 0))
    try:
        asked.request(method, target, body, headers or {})
        answer = asked.getresponse()
        return answer.status, answer.read(), answer
    finally:
        asked.close()


@attack
def sign_ins(ports, until):
    while time.monotonic() < until:
        body = json.dumps({"user": random.choice([USER, "nobody", "x" * 5000]), "password": os.urandom(8).hex()})
        quietly(lambda: ask(ports["viewer"], "POST", "/api/session", body,
                            {"Content-Type": "application/json", "X-Kiroku-Request": "1"}, somebody(), 3))


@attack
def hook_guesses(ports, until):
    while time.monotonic() < until:
        quietly(lambda: ask(ports["hook"], "POST", "/rooms/or-1/stop", "",
                            {"Authorization": "Bearer " + os.urandom(16).hex()}, somebody(), 2, tls=False))


SMUGGLED = [
    b"POST %s HTTP/1.1\r\nHost: x\r\nContent-Length: 6\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\nGET / HTTP/1.1\r\n\r\n",
    b"POST %s HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\nTransfer-Encoding: x\r\n\r\n0\r\n\r\n",
    b"POST %s HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: \x0bchunked\r\n\r\n0\r\n\r\n",
    b"POST %s HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\n12345",
    b"POST %s HTTP/1.1\r\nHost: x\r\nContent-Length: +5\r\n\r\n12345",
    b"POST %s HTTP/1.1\r\nHost: x\r\nContent-Length : 5\r\n\r\n12345",
    b"POST %s HTTP/1.1\r\nHost: x\r\n Content-Length: 5\r\n\r\n12345",
    b"POST %s HTTP/1.1\nHost: x\nContent-Length: 5\n\n12345",
    b"POST %s HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n5;a=\"\r\n\"\r\n12345\r\n0\r\n\r\n",
    b"POST %s HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nfffffffffffffffff\r\n",
    b"POST %s HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n-5\r\n12345\r\n0\r\n\r\n",
    b"GET %s HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n",
    b"GET http://elsewhere%s HTTP/1.1\r\nHost: x\r\n\r\n",
    b"GET //%s HTTP/1.1\r\nHost: x\r\n\r\n",
    b"GET /..%s/../../../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n",
    b"GET %s%%00%%0d%%0a HTTP/1.1\r\nHost: x\r\n\r\n",
    b"CONNECT %s HTTP/1.1\r\nHost: x\r\n\r\n",
    b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n%s",
    b"GET %s HTTP/9.9\r\nHost: x\r\n\r\n",
    b"GET %s HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\nContent-Length: 100000000000000000\r\n\r\n",
    b"GET %s HTTP/1.1\r\nHost: x\r\nRange: bytes=" + b"0-," * 5000 + b"\r\n\r\n",
    b"GET %s HTTP/1.1\r\nHost: x\r\nCookie: " + b"a=b; " * 6000 + b"\r\n\r\n",
    b"GET %s HTTP/1.1\r\nHost: x\r\nUpgrade: h2c\r\nConnection: Upgrade, HTTP2-Settings\r\nHTTP2-Settings: AAMAAABk\r\n\r\n",
]


@attack
def smuggling(ports, until):
    context = unverified()
    while time.monotonic() < until:
        form = random.choice(SMUGGLED)
        name, path = random.choice([("viewer", b"/api/session"), ("hook", b"/rooms/or-1/stop"),
                                    ("witness", b"/add-checkpoint"), ("viewer", b"/api/live/or-1/endoscope")])
        request = form.replace(b"%s", path).replace(b"%%", b"%")
        # What hides in the body would stop the case, if the hook took it.
        request += b"POST /rooms/or-1/stop HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n"

        def one():
            with connect(ports[name], somebody(), 2) as raw:
                spoken = context.wrap_socket(raw) if name == "viewer" else raw
                spoken.sendall(request)
                spoken.recv(4096)
        quietly(one)


@attack
def slow_bodies(ports, until):
    head = b"POST %s HTTP/1.1\r\nHost: x\r\nContent-Length: 60000\r\n\r\n"
    half = time.monotonic() + (until - time.monotonic()) / 2
    hold(half, ports["witness"], head % b"/add-checkpoint", lambda n: b"o", 200)
    hold(until, ports["hook"], head % b"/rooms/or-1/mark", lambda n: b"o", 200)


@attack
def long_polls(ports, until):
    """With somebody's session: pictures that nobody takes, web sockets that say too much, and half requests."""
    cookie = ports["cookie"]
    context = unverified()
    held = []

    def open_socket():
        spoken = context.wrap_socket(connect(ports["viewer"], "127.0.0.9", 5))
        key = base64.b64encode(os.urandom(16)).decode()
        spoken.sendall((f"GET /api/live/or-1/endoscope HTTP/1.1\r\nHost: 127.0.0.1:{ports['viewer']}\r\n"
                        f"Origin: https://127.0.0.1:{ports['viewer']}\r\nCookie: {cookie}\r\nUpgrade: websocket\r\n"
                        f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n").encode())
        return spoken

    frames = [b"\x82\xff" + b"\x7f" * 8 + bytes(4), b"\x01\x80" + bytes(4), b"\x89\xfd" + bytes(129), b"\x81\x05hello",
              b"\x88\x82" + bytes(4) + b"\x00\x00", b"\xf1\x80" + bytes(4), b"\x00\x80" + bytes(4),
              b"\x81\xfe\xff\xff" + bytes(4) + b"{" * 65535]
    while time.monotonic() < until:
        if len(held) < 40:
            one = quietly(open_socket)
            if one is not None:
                held.append(one)
                if len(held) % 2:
                    quietly(lambda: one.sendall(random.choice(frames)))
        elif random.random() < 0.3:
            held.pop(0).close()
        time.sleep(0.05)


@attack
def absurd_proofs(ports, until):
    """What a witness is sent: long proofs, huge sizes, notes of a hundred signatures, replays of what it cosigned."""
    kept = ports["submission"]
    line = base64.b64encode(bytes(32)).decode()
    signatures = "".join(f"\u2014 s{i} " + base64.b64encode(os.urandom(68)).decode() + "\n" for i in range(100))
    text = kept.split("\n\n", 1)[1]
    bodies = ["old 0\n" + (line + "\n") * 1400 + "\n" + text, "old 18446744073709551615\n\n" + text,
              f"old 1\n{line}\n\n" + text, "old 0\n\n" + text + signatures, "old 0\n" + "\n" * 60000, "old " + "9" * 60000,
              kept.split("\n\n", 1)[0] + "\n\n" + text.replace("\n\n", "\n\n\n\n"), "\xff" * 60000, ""]
    targets = ["/add-checkpoint", "/", "/../../witness.key", "//add-checkpoint", "/%2e%2e/witness.sqlite",
               "/" + "0" * 64 + "/checkpoint", "/' OR 1=1 --/checkpoint", "/checkpoint", "/" + "a" * 8000 + "/checkpoint",
               "/" + ports["hash"] + "/checkpoint", "/" + ports["hash"].upper() + "/checkpoint"]
    replay = kept.replace("old 0", "old " + kept.split("\n\n", 1)[1].split("\n")[1], 1)
    while time.monotonic() < until:
        if random.random() < 0.5:
            quietly(lambda: ask(ports["witness"], "POST", "/add-checkpoint", replay.encode(), {}, somebody(), 5, False))
        elif random.random() < 0.5:
            quietly(lambda: ask(ports["witness"], "POST", "/add-checkpoint", random.choice(bodies).encode("utf-8", "replace"),
                                {}, somebody(), 5, False))
        else:
            quietly(lambda: ask(ports["witness"], "GET", random.choice(targets), None, {}, somebody(), 5, False))


def sampled(pid):
    status = pathlib.Path(f"/proc/{pid}/status").read_text()
    fields = dict(line.split(":", 1) for line in status.splitlines() if ":" in line)
    return {"memory_mb": int(fields["VmHWM"].split()[0]) // 1024, "threads": int(fields["Threads"]),
            "descriptors": len(os.listdir(f"/proc/{pid}/fd"))}


class Home:
    """A home, kirokud and a witness on it."""

    def __init__(self, programs, keep):
        self.programs, self.keep = programs, keep
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="kiroku-attacked-"))
        self.environment = {**os.environ, "KIROKU_HOME": str(self.folder / "home"), "KIROKU_PASSPHRASE": PASSWORD}
        self.ports = {name: reserved_port() for name in ("viewer", "hook", "mllp", "witness")}
        self.served = []

    def run(self, *arguments, check=True):
        done = subprocess.run([self.programs / "kiroku", *arguments], env=self.environment, capture_output=True, text=True)
        if check and done.returncode != 0:
            raise SystemExit(f"kiroku {' '.join(arguments)} ended with {done.returncode}: {done.stderr}{done.stdout}")
        return done

    def serve(self, name, *arguments):
        log = open(self.folder / f"{name}.log", "w")

        def as_a_service():
            # A recorder that nobody gave more descriptors.
            resource.setrlimit(resource.RLIMIT_NOFILE, (1024, 4096))
        process = subprocess.Popen([self.programs / name, *arguments], env=self.environment, stdout=log, stderr=log,
                                   preexec_fn=as_a_service)
        self.served.append(process)
        return process

    def begin(self):
        home = self.folder / "home"
        self.run("init", "--demo")
        self.run("user", "add", USER, "--role", "surgeon")
        (home / "hook-token").write_text(HOOK_TOKEN + "\n")
        (home / "hook-token").chmod(0o600)
        with open(home / "kiroku.toml", "a") as file:
            file.write(f"""
[daemon]
listen = "127.0.0.1:{self.ports['hook']}"
hook_token_file = "hook-token"
[viewer]
listen = "127.0.0.1:{self.ports['viewer']}"
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=320x240&rate=25"
[[room.stream]]
name = "vitals"
kind = "vitals"
source = "mllp://127.0.0.1:{self.ports['mllp']}?allow=127.0.0.1"
""")
        self.recorder = self.serve("kirokud")
        self.wait_for("status")
        self.run("case", "start", "--room", "or-1")
        self.run("witness", "init", str(self.folder / "witness"), "--name", "w.example/1")
        self.run("witness", "trust", str(self.folder / "witness"), str(home / "device.pub"))
        self.witness = self.serve("kiroku", "witness", "serve", str(self.folder / "witness"), "--listen",
                                  f"127.0.0.1:{self.ports['witness']}")
        notes = sorted((home / "archive/log/checkpoints").iterdir())
        self.ports["submission"] = "old 0\n\n" + notes[-1].read_text("utf-8")
        origin = self.ports["submission"].split("\n")[2]
        self.ports["hash"] = hashlib.sha256(origin.encode()).hexdigest()
        self.wait_until(lambda: self.cosign()[0] in (200, 409), "the witness")
        self.ports["cookie"] = self.sign_in()

    def wait_for(self, *arguments):
        self.wait_until(lambda: self.run(*arguments, check=False).returncode == 0, "kirokud")

    @staticmethod
    def wait_until(is_so, what):
        for _ in range(300):
            if quietly(is_so):
                return
            time.sleep(0.1)
        raise SystemExit(f"{what} did not start")

    def cosign(self):
        return ask(self.ports["witness"], "POST", "/add-checkpoint", self.ports["submission"].encode(), timeout=30, tls=False)

    def sign_in(self, source="127.0.0.1"):
        status, body, answer = ask(self.ports["viewer"], "POST", "/api/session",
                                   json.dumps({"user": USER, "password": PASSWORD}),
                                   {"Content-Type": "application/json", "X-Kiroku-Request": "1"}, source, 60)
        if status != 200:
            raise SystemExit(f"signing in was answered with {status}: {body}")
        return "; ".join(each.split(";")[0] for each in answer.headers.get_all("Set-Cookie"))

    def end(self):
        for process in self.served:
            if process.poll() is None:
                process.kill()
                process.wait()
        if self.keep:
            print(f"left in {self.folder}")
        else:
            shutil.rmtree(self.folder)


def looked_at(home, until, results):
    """What somebody who has signed in is answered meanwhile, and how soon; and what kirokud takes."""
    while time.monotonic() < until:
        begin = time.monotonic()
        answer = quietly(lambda: ask(home.ports["viewer"], "GET", "/api/cases", None, {"Cookie": home.ports["cookie"]},
                                     "127.0.0.5", 15))
        results["answers"].append((answer[0] if answer else None, time.monotonic() - begin))
        begin = time.monotonic()
        answer = quietly(lambda: ask(home.ports["witness"], "GET", "/" + home.ports["hash"] + "/checkpoint", None, {},
                                     "127.0.0.5", 15, tls=False))
        results["witness"].append((answer[0] if answer else None, time.monotonic() - begin))
        for name, process in (("kirokud", home.recorder), ("witness-serve", home.witness)):
            if process.poll() is not None:
                results["ended"].append(f"{name} ended with {process.returncode}")
                return
            for key, value in sampled(process.pid).items():
                results[name][key] = max(results[name].get(key, 0), value)
        time.sleep(0.3)


def in_words(what, answers):
    good = [seconds for status, seconds in answers if status == 200]
    bad = [status for status, _ in answers if status != 200]
    slowest = f", the slowest after {max(good):.1f} s" if good else ""
    return f"{what}: {len(good)} of {len(answers)} answered{slowest}" + (f", others {bad[:8]}" if bad else "")


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0], description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--only")
    parser.add_argument("--keep", action="store_true")
    given = parser.parse_args()
    chosen = given.only.split(",") if given.only else list(ATTACKS)
    unknown = [name for name in chosen if name not in ATTACKS]
    if unknown:
        parser.error(f"there is no attack {', '.join(unknown)}; there are {', '.join(ATTACKS)}")
    home = Home(given.build.resolve(), given.keep)
    failures = []
    try:
        home.begin()
        print(f"attacking for {given.seconds:.0f} s: {', '.join(chosen)}", flush=True)
        until = time.monotonic() + given.seconds
        attackers = [multiprocessing.Process(target=ATTACKS[name], args=(home.ports, until), daemon=True)
                     for name in chosen]
        for each in attackers:
            each.start()
        results = {"answers": [], "witness": [], "kirokud": {}, "witness-serve": {}, "ended": []}
        looked_at(home, until, results)
        for each in attackers:
            each.join(10)
            each.terminate()
        failures += results["ended"]
        print(in_words("the viewer, during the attack", results["answers"]))
        print(in_words("the witness, during the attack", results["witness"]))
        print(json.dumps({name: results[name] for name in ("kirokud", "witness-serve")}))
        for name in ("kirokud", "witness-serve"):
            if results[name].get("memory_mb", 0) > MOST_MEMORY_MB:
                failures.append(f"{name} took {results[name]['memory_mb']} MB")
        if not any(status == 200 for status, _ in results["answers"]):
            failures.append("the viewer answered nobody who had signed in")
        if not any(status == 200 for status, _ in results["witness"]):
            failures.append("the witness answered nobody")
        if not failures:
            home.sign_in("127.0.0.6")
            home.cosign()
            home.run("case", "stop", "--room", "or-1")
            home.recorder.send_signal(signal.SIGTERM)
            if home.recorder.wait(60) != 0:
                failures.append(f"kirokud ended with {home.recorder.returncode}")
            cases = [each.name for each in (home.folder / "home/archive").iterdir() if each.name[0].isdigit()]
            for case in cases:
                done = home.run("verify", case, "--json", check=False)
                report = json.loads(done.stdout)
                print(f"{case}: {report['verdict']}")
                for finding in report["findings"]:
                    print(f"  {finding['severity']:12} {finding['code']}: {finding['text'][:160]}")
                if report["verdict"] not in ("intact", "intact-with-gaps"):
                    failures.append(f"{case} is {report['verdict']}")
            log = home.run("log", "--verify", "--json", check=False)
            print(f"the log: {json.loads(log.stdout)['verdict']}, {json.loads(log.stdout)['entries']} entries")
            if len(cases) != 1:
                failures.append(f"there are {len(cases)} cases")
        for line in (home.folder / "kirokud.log").read_text().splitlines()[-25:]:
            print("  journal:", line[:220])
    finally:
        home.end()
    for failure in failures:
        print("FAILED:", failure)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
