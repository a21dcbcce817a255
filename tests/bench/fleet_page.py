#!/usr/bin/env python3
"""How soon the hospital's page has the first picture of a case of ten hours that lies in a real Ceph store. Goal: 1.5 s.

Usage: tests/bench/fleet_page.py PROGRAMS
  PROGRAMS  the folder of kiroku and kiroku-fleet, such as build/release/apps

The case's ledger and its 600 checkpoints and time-stamps are as long as those of ten hours; of its segments the store has the first twelve seconds. Each time a
new server is asked, which knows nothing of the case. Counted is from asking for the case until the first two seconds of pictures are there.
"""
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "fleet"))
from fleet_test import Fleet, start  # noqa: E402
from page_client import Server  # noqa: E402
from ship_test import Appliance, HERE, Store, USER  # noqa: E402

HOURS, STAMPS, TRIES = 10, 600, 5


def lengthened(lines):
    """A ledger of HOURS out of one of seconds: its segments go on as they began. It is read, not verified, so its tokens fit nothing."""
    entries = [json.loads(line) for line in lines]
    longer, end_ns = [entry for entry in entries if entry["type"] in ("open", "clock")][:2], HOURS * 3_600_000_000_000
    body = []
    for stream in ("endoscope", "vitals"):
        own = [entry for entry in entries if entry["type"] == "segment" and entry["stream"] == stream][:-1]
        length = own[0]["end_ns"] - own[0]["start_ns"]
        body += own
        for index in range(len(own), end_ns // length):
            entry = dict(own[-1], index=index, file=own[-1]["file"].replace(f"{own[-1]['index']:08}", f"{index:08}"))
            entry["start_ns"], entry["end_ns"] = index * length, (index + 1) * length
            entry["mono_ns"] = entry["end_ns"] + 1000
            entry["first_pts"] += (index - own[-1]["index"]) * length * int(entry["time_base"].partition("/")[2]) // 1_000_000_000
            body.append(entry)
    token = next(entry for entry in entries if entry["type"] == "token")
    for at in range(1, STAMPS + 1):
        body.append(dict(token, checkpoint=at, file=f"tokens/{at:08}.embedded.tsr", mono_ns=at * end_ns // (STAMPS + 1)))
    longer += sorted(body, key=lambda entry: entry["mono_ns"])
    longer.append(dict(next(entry for entry in entries if entry["type"] == "close"), mono_ns=end_ns))
    for number, entry in enumerate(longer):
        entry["seq"] = number
    return "".join(json.dumps(entry, separators=(",", ":"), ensure_ascii=False) + "\n" for entry in longer), token


def seconds_to_first_picture(server, name, identity):
    person, other = server.person(), server.person()
    person.read("session", {"link": server.link})
    person.tell("session/unlock", {"identity": identity})
    other.cookie = person.cookie
    begun, busy = time.monotonic(), server.processor_seconds()
    # As the page does: both at once.
    asked = threading.Thread(target=lambda: other.tell(f"cases/{name}/timeline"))
    asked.start()
    person.tell(f"cases/{name}")
    asked.join()
    known = time.monotonic()
    person.tell(f"cases/{name}/streams/endoscope/init.mp4")
    assert person.tell(f"cases/{name}/streams/endoscope/pieces/0.mp4")[4:8] == b"moof"
    return time.monotonic() - begun, known - begun, server.processor_seconds() - busy


def put_often(store, file, keys):
    """One file under many names, by one curl."""
    settings = "".join(f'upload-file = "{file}"\nurl = "{store.endpoint}/recordings/{key}"\noutput = "/dev/null"\n' for key in keys)
    subprocess.run(["curl", "-sS", "-f", "--aws-sigv4", "aws:amz:us-east-1:s3", "--user", USER, "-H",
                    f"x-amz-content-sha256: {hashlib.sha256(file.read_bytes()).hexdigest()}", "-K", "-"], input=settings, text=True, check=True)


def measure(programs, folder, store, connection):
    appliance = Appliance(programs, folder / "or-1", store.endpoint, "recordings")
    case = appliance.recorded(12)
    archive = appliance.home / "archive" / case
    text, token = lengthened((archive / "ledger.jsonl").read_text().splitlines())
    (folder / "ledger").write_text(text)
    (archive / "ledger.jsonl").write_text(text)
    note, stamp = (archive / f"checkpoints/{token['checkpoint']:08}.note"), archive / token["file"]
    store.put("recordings", f"or-1/{case}/ledger.jsonl", folder / "ledger")
    for file in archive.rglob("segments/*/*"):
        store.put("recordings", f"or-1/{case}/{file.relative_to(archive)}", file)
    put_often(store, note, [f"or-1/{case}/checkpoints/{at:08}.note" for at in range(1, STAMPS + 1)])
    put_often(store, stamp, [f"or-1/{case}/tokens/{at:08}.embedded.tsr" for at in range(1, STAMPS + 1)])
    fleet = Fleet(programs, folder / "fleet", store.endpoint, connection, {"or-1": appliance})
    fleet.ask("init")
    fleet.tell("index")
    subprocess.run([str(programs / "kiroku"), "init", "--demo", "--home", str(folder / "page")], check=True, capture_output=True)
    identity = (appliance.home / "identity.txt").read_text()
    print(f"{text.count(chr(10))} entries, a ledger of {len(text) / 1e6:.1f} MB; load {os.getloadavg()[0]:.1f}")
    for _ in range(TRIES):
        server = Server([fleet.program, "serve", "--home", folder / "page", "--config", fleet.configuration])
        try:
            whole, ledger, busy = seconds_to_first_picture(server, f"or-1~{case}", identity)
        finally:
            server.end()
        server = Server([programs / "kiroku", "view"], appliance.environment)
        try:
            own, _, own_busy = seconds_to_first_picture(server, case, identity)
        finally:
            server.end()
        print(f"first picture after {whole:.2f} s, of it case and time line {ledger:.2f} s; the server computed {busy:.2f} s. "
              f"The appliance's own viewer, from its disk: {own:.2f} s, computed {own_busy:.2f} s")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    programs = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        folder.chmod(0o755)
        started = []
        try:
            for script in ("store.sh", "postgres.sh"):
                started.append((script, folder / script.partition(".")[0], start(script, folder / script.partition(".")[0])))
            store = Store(started[0][2])
            store.make_bucket("recordings")
            measure(programs, folder, store, started[1][2])
        finally:
            for script, state, _ in reversed(started):
                subprocess.run([str(HERE / script), "down", str(state)], check=False)


if __name__ == "__main__":
    main()
