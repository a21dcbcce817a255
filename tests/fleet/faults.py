#!/usr/bin/env python3
"""Ships cases to a real Ceph store through faults: kills at random moments, and a network that loses, tears and alters.

Usage: tests/fleet/faults.py PROGRAMS [--kills N] [--seed N]
  PROGRAMS   the folder of kiroku and kiroku-verify, such as build/release/apps
  --kills N  how often the shipper is killed (200)

A proxy stands between the shipper and the store. It forwards requests as they are, so that the store judges their
signatures, and makes one fault in four requests. Prints figures for docs/results/record.py.
Exit status: 0 everything holds, 1 something does not, 77 Ceph is not installed.
"""
import argparse
import contextlib
import hashlib
import http.client
import http.server
import json
import pathlib
import random
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time

from ship_test import HERE, Appliance, Store, eventually, judged, require

FAULTS = ("500", "503", "torn request", "lost answer", "torn answer", "wrong hash", "wrong etag", "no lock", "silence")
SLOW_S = 5
SAID = {
    "500": "it answered with status 500, InternalError",
    "503": "it answered with status 503, SlowDown",
    "torn request": "does not answer",
    "lost answer": "does not answer",
    "torn answer": "does not answer",
    "wrong hash": "does not hold it as it was put",
    "no lock": "does not hold it as it was put",
}


def refusal(code):
    return f'<?xml version="1.0" encoding="UTF-8"?><Error><Code>{code}</Code></Error>'.encode()


class Proxy:
    """Between the shipper and the store. `next_fault` names the fault of each request, or none."""

    def __init__(self, endpoint):
        self.host = endpoint.removeprefix("http://")
        self.next_fault = lambda method: None
        self.made = dict.fromkeys(FAULTS, 0)
        self.lied_of = set()  # keys of which another hash, or no lock, was told
        self.slow_s = 0
        proxy = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def log_message(self, *_):
                pass

            def handle_one(self):
                body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                proxy.answer(self, body)

            do_GET = do_PUT = do_HEAD = do_DELETE = handle_one

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        self.endpoint = f"http://127.0.0.1:{self.server.server_address[1]}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def answer(self, asked, body):
        fault = self.next_fault(asked.command)
        if fault in ("500", "503"):
            text = refusal("InternalError" if fault == "500" else "SlowDown")
            head = f"HTTP/1.1 {fault} Oops\r\nContent-Length: {len(text)}\r\nRetry-After: 1\r\nConnection: close\r\n\r\n".encode()
            return self.finish(asked, fault, head + (b"" if asked.command == "HEAD" else text))
        if fault == "torn request" and body:
            # The store has half of it when the network goes.
            host, _, port = self.host.partition(":")
            with socket.create_connection((host, int(port))) as upstream:
                head = f"{asked.command} {asked.path} HTTP/1.1\r\n" + "".join(f"{k}: {v}\r\n" for k, v in asked.headers.items() if k != "Expect")
                upstream.sendall(head.encode() + b"\r\n" + body[: len(body) // 2])
            return self.finish(asked, fault, b"")
        if fault == "silence":
            time.sleep(self.slow_s)
        upstream = http.client.HTTPConnection(self.host)
        upstream.putrequest(asked.command, asked.path, skip_host=True, skip_accept_encoding=True)
        for name, value in asked.headers.items():
            if name != "Expect":
                upstream.putheader(name, value)
        upstream.endheaders(body)
        told = upstream.getresponse()
        text = told.read()
        headers = [(name, value) for name, value in told.getheaders() if name.lower() not in ("transfer-encoding", "connection")]
        upstream.close()
        if fault in ("wrong hash", "no lock") and asked.command == "HEAD":
            self.lied_of.add(asked.path.partition("?")[0].removeprefix("/recordings/"))
        if fault == "wrong hash" and asked.command == "HEAD":
            headers = [(k, "0" * 64 if k.lower() == "x-amz-meta-kiroku-sha256" else v) for k, v in headers]
        elif fault == "no lock" and asked.command == "HEAD":
            headers = [(k, v) for k, v in headers if not k.lower().startswith("x-amz-object-lock")]
        elif fault == "wrong etag":
            headers = [(k, '"0"' if k.lower() == "etag" else v) for k, v in headers]
        elif fault in ("wrong hash", "no lock", "torn request"):
            fault = None
        if not any(name.lower() == "content-length" for name, _ in headers):
            headers.append(("Content-Length", str(len(text))))
        out = f"HTTP/1.1 {told.status} {told.reason}\r\n".encode() + "".join(f"{k}: {v}\r\n" for k, v in headers).encode() + b"Connection: close\r\n\r\n" + text
        if fault == "lost answer":
            out = b""
        elif fault == "torn answer":
            out = out[: len(out) // 3]
        self.finish(asked, fault, out)

    def finish(self, asked, fault, out):
        if fault:
            self.made[fault] += 1
        with contextlib.suppress(OSError):
            asked.wfile.write(out)
            asked.wfile.flush()
        asked.close_connection = True


def use(appliance, endpoint, name):
    """The appliance ships there, under this name."""
    toml = appliance.home / "kiroku.toml"
    text = toml.read_text(encoding="utf-8")
    head = text[: text.rindex("[store]")]
    toml.write_text(f'{head}[store]\nendpoint = "{endpoint}"\nbucket = "recordings"\nretain = "1d"\nappliance = "{name}"\n', encoding="utf-8")


def require_all_there(appliance, store, name, what, lied_of=frozenset()):
    """Nothing is lost, doubled or unconfirmed: every file of the archive is there once, as it is here, and confirmed.

    What the store was made to tell another hash of, or no lock, may be there again: it has to be put anew.
    """
    told = json.loads(appliance.kiroku("ship", "--status", "--json"))
    require(told["waiting"] == 0 and not told["problems"], f"{what}: something waits: {told}")
    versions = {key: found for key, found in store.versions("recordings").items() if key.startswith(name + "/")}
    files = {f"{name}/{path}": file for path, file in appliance.archive_files().items() if path != "log/ledger.jsonl"}
    lost = files.keys() - versions.keys()
    require(not lost, f"{what}: lost: {sorted(lost)[:5]}")
    doubled = [key for key, found in versions.items() if len(found) > 1 and key not in lied_of]
    require(not doubled, f"{what}: put twice: {doubled[:5]}")
    confirmed = set()
    for each in appliance.home.glob("shipping-*.sqlite"):
        with contextlib.closing(sqlite3.connect(each)) as database:
            confirmed |= {key for (key,) in database.execute("SELECT key FROM object")}
    require(versions.keys() <= confirmed, f"{what}: not confirmed: {sorted(versions.keys() - confirmed)[:5]}")
    for key, file in files.items():
        require(store.get("recordings", key) == file.read_bytes(), f"{what}: {key} is not what was recorded")
    growth = b"".join(store.get("recordings", key) for key in sorted(versions) if key.startswith(f"{name}/growing/log/"))
    require(growth == (appliance.home / "archive/log/ledger.jsonl").read_bytes(), f"{what}: the log's parts are not the log")
    return len(versions)


def kills(appliance, store, dice, wanted):
    """Kills of the shipper while it has work; a new name in the store makes all of the archive new work."""
    done, rounds, objects = 0, 0, 0
    while done < wanted:
        rounds += 1
        use(appliance, store.endpoint, f"killed-{rounds}")
        for _ in range(12):
            shipping = subprocess.Popen(appliance.command("ship"), env=appliance.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(dice.uniform(0.0, 0.5))
            if shipping.poll() is None and done < wanted:
                shipping.kill()
                shipping.wait()
                done += 1
                # What it had sent is not there yet, and would be put once more (docs/how-to/ship-to-a-store.md).
                eventually(store.has_no_request, "the gateway answers a killed program")
            elif shipping.poll() is not None:
                break
            shipping.wait()
        appliance.kiroku("ship")
        objects += require_all_there(appliance, store, f"killed-{rounds}", f"after {done} kills")
    return done, rounds, objects


def network(appliance, store, proxy, dice):
    """One fault in four requests until everything is there, and each kind at least once."""
    said, runs, rounds, objects = set(), 0, 0, 0
    proxy.next_fault = lambda method: dice.choice(FAULTS) if dice.random() < 0.25 else None
    while rounds == 0 or any(count == 0 for count in proxy.made.values()) or not SAID.keys() <= said:
        rounds += 1
        require(rounds < 20, f"some fault was never made or never said: {proxy.made}, {said}")
        use(appliance, proxy.endpoint, f"network-{rounds}")
        while True:
            runs += 1
            require(runs < 5000, "it never ends")
            told = appliance.ask("ship")
            said |= {fault for fault, words in SAID.items() if words in told.stderr}
            require(told.returncode in (0, 2, 3), f"left with {told.returncode}: {told.stderr}")
            require(told.returncode == 0 or told.stderr.strip(), "something was not shipped, and nothing was said")
            if told.returncode == 0:
                break
        faults, proxy.next_fault = proxy.next_fault, lambda method: None
        objects += require_all_there(appliance, store, f"network-{rounds}", "after the network's faults", proxy.lied_of)
        proxy.next_fault = faults
    proxy.next_fault = lambda method: None
    return runs, objects


def lost_answer(appliance, store, proxy):
    """A shipper whose list knows all, and which goes on after the answer to a put was lost, asks before it puts again."""
    use(appliance, proxy.endpoint, "followed")
    appliance.kiroku("ship")
    appliance.recorded(2)
    left = ["lost answer"]
    proxy.next_fault = lambda method: left.pop() if left and method == "PUT" else None
    following = subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    eventually(lambda: appliance.ask("ship", "--status").returncode == 0 and not left, "it did not catch up")
    following.kill()
    following.wait()
    proxy.next_fault = lambda method: None
    require_all_there(appliance, store, "followed", "after a lost answer")


def slow(appliance, store, proxy):
    """Each answer takes seconds; recording does not wait for it."""
    proxy.slow_s, proxy.next_fault = SLOW_S, lambda method: "silence"
    use(appliance, proxy.endpoint, "slow")
    following = subprocess.Popen(appliance.command("ship", "--follow"), env=appliance.environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    begun = time.monotonic()
    case = appliance.recorded(4)
    took = time.monotonic() - begun
    following.kill()
    require(not following.communicate()[1], "a slow store is no fault")
    proxy.slow_s, proxy.next_fault = 0, lambda method: None
    appliance.kiroku("ship")
    require_all_there(appliance, store, "slow", "after a slow store")
    status, words = judged(appliance, store, case, "slow")
    require(status == 0 and "\nINTACT" in words, f"recorded beside a slow store: {words}")
    return took


def clock(appliance, store):
    if not shutil.which("faketime"):
        print("SKIPPED: faketime is not installed: the store's clock was not tried")
        return
    use(appliance, store.endpoint, "clock")
    told = subprocess.run(["faketime", "-f", "+20m", *appliance.command("ship")], env=appliance.environment, capture_output=True, text=True)
    require(told.returncode == 2 and "set the clock" in told.stderr, f"20 minutes off: {told}")
    appliance.kiroku("ship")
    require_all_there(appliance, store, "clock", "after the clock was set")


def credentials(appliance, store, folder):
    use(appliance, store.endpoint, "suspended")

    def user(verb):
        subprocess.run(["radosgw-admin", "-c", folder / "ceph.conf", "user", verb, "--uid=test"], check=True, capture_output=True)

    user("suspend")
    told = appliance.ask("ship")
    user("enable")
    require(told.returncode == 2 and ("has expired or was suspended" in told.stderr or "does not know the access key" in told.stderr
                                      or "has no right" in told.stderr), f"a suspended user: {told}")
    appliance.kiroku("ship")
    require_all_there(appliance, store, "suspended", "after the user was enabled")


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0])
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=None)
    given = parser.parse_args()
    seed = given.seed if given.seed is not None else int.from_bytes(hashlib.sha256(str(time.time()).encode()).digest()[:4], "big")
    print(f"seed {seed}", flush=True)
    dice = random.Random(seed)
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="kiroku-faults-"))
    with contextlib.ExitStack() as at_end:
        at_end.callback(shutil.rmtree, scratch, ignore_errors=True)
        at_end.callback(subprocess.run, [HERE / "store.sh", "down", scratch / "store"])
        started = subprocess.run([HERE / "store.sh", "up", scratch / "store"], stdout=subprocess.PIPE, text=True)
        if started.returncode != 0:
            print(started.stdout, end="")
            sys.exit(77 if started.returncode == 77 else 1)
        store = Store(started.stdout.strip())
        store.make_bucket("recordings")
        appliance = Appliance(given.programs.resolve(), scratch / "home", store.endpoint, "recordings")
        for _ in range(3):
            appliance.recorded(4)
        killed, rounds, objects = kills(appliance, store, dice, given.kills)
        print(f"holds: {killed} kills in {rounds} rounds, {objects} objects, none lost, doubled or unconfirmed", flush=True)
        proxy = Proxy(store.endpoint)
        runs, through = network(appliance, store, proxy, dice)
        print(f"holds: {sum(proxy.made.values())} faults of the network in {runs} runs, {through} objects: {proxy.made}", flush=True)
        lost_answer(appliance, store, proxy)
        print("holds: after a lost answer the same process puts nothing twice", flush=True)
        print(f"holds: 4 s recorded in {slow(appliance, store, proxy):.1f} s beside a store of {SLOW_S} s an answer", flush=True)
        clock(appliance, store)
        credentials(appliance, store, scratch / "store")
        print("holds: a clock 20 minutes off, and a suspended user, are told")
        print(f"figures: kills={killed} kill_objects={objects} faults={sum(proxy.made.values())} fault_objects={through}")


if __name__ == "__main__":
    main()
