#!/usr/bin/env python3
"""Who is on the table outlives a start of the recorder, where systemd holds what messages said; where nothing does, a newer program waits.

Usage: tests/system/kept_patients_test.py PROGRAMS
  PROGRAMS  the folder of kiroku, kirokud and kiroku-decoder, such as build/release/apps

The test plays systemd: it takes the descriptors that kirokud gives it (FDSTORE=), and gives them to the next one.
Exit status: 0 everything holds, 1 something does not.
"""
import array
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import ports  # noqa: E402

LIMIT_S = 120
ROOM = '''
[[room]]
name = "or-1"
[room.procedure.hl7]
listen = "mllp://127.0.0.1:{port}?zone=UTC"
locations = ["OR1"]
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=64x48&rate=10"
[daemon]
socket = "{socket}"
'''
ENDS_FOR_A_NEWER = "a newer version was installed and nothing is being recorded"


def require(holds, what):
    if not holds:
        raise AssertionError(what)


def eventually(holds, what, look=lambda: None):
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        look()
        if holds():
            return
        threading.Event().wait(0.05)
    raise AssertionError(f"not in {LIMIT_S} s: {what}")


class Manager:
    """What systemd is to one service. Without a store it closes what it is given, as with FileDescriptorStoreMax=0."""

    def __init__(self, folder, has_store):
        self.has_store, self.kept, self.is_ready, self.failure = has_store, {}, False, None
        self.path = str(folder / ("notify" if has_store else "notify-without"))
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.path)
        threading.Thread(target=self.keep_listening, daemon=True).start()

    def keep_listening(self):
        """What goes wrong in this thread ends the test, in the other one."""
        try:
            self.listen()
        except BaseException as error:
            self.failure = error

    def look(self):
        if self.failure:
            raise AssertionError(f"what plays systemd failed: {self.failure!r}") from self.failure

    def wait(self, process):
        """Its exit status."""
        eventually(lambda: process.poll() is not None, "kirokud ends", self.look)
        return process.returncode

    def listen(self):
        while True:
            words, more, _, _ = self.socket.recvmsg(4096, socket.CMSG_SPACE(16 * 4))
            given = array.array("i")
            for _, _, content in more:
                given.frombytes(content[:len(content) - len(content) % given.itemsize])
            told = dict(line.split("=", 1) for line in words.decode().splitlines())
            name = told.get("FDNAME", "")
            if told.get("FDSTOREREMOVE") == "1":
                os.close(self.kept.pop(name)) if name in self.kept else None
            elif told.get("FDSTORE") == "1" and self.has_store:
                require(len(given) == 1 and name not in self.kept, f"{name} is given twice")
                self.kept[name] = given[0]
                continue
            self.is_ready = self.is_ready or told.get("READY") == "1"
            for descriptor in given:  # a barrier's, too
                os.close(descriptor)

    def start(self, command, log):
        self.is_ready = False
        names = sorted(self.kept)
        # Out of the way of where they must be.
        sources = [os.dup(self.kept[name]) for name in names]
        high = [os.dup2(source, 200 + at) for at, source in enumerate(sources)]

        def place():
            for at, source in enumerate(high):
                os.dup2(source, 3 + at)

        environment = {**os.environ, "NOTIFY_SOCKET": self.path}
        if names:
            environment.update(LISTEN_FDS=str(len(names)), LISTEN_FDNAMES=":".join(names))
        process = subprocess.Popen(["/bin/sh", "-c", 'test -z "$LISTEN_FDS" || export LISTEN_PID=$$; exec "$@"', "sh", *command], env=environment,
                                   stdout=log, stderr=log, preexec_fn=place, close_fds=True, pass_fds=[3 + at for at in range(len(names))])
        for descriptor in sources + high:
            os.close(descriptor)
        eventually(lambda: self.is_ready or process.poll() is not None, "kirokud is ready", self.look)
        require(process.poll() is None, "kirokud ended as it started")
        return process


def deliver(port, *segments):
    message = "\r".join(segments) + "\r"
    with socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) as engine:
        engine.sendall(b"\x0b" + message.encode() + b"\x1c\r")
        answer = b""
        while not answer.endswith(b"\x1c\r"):
            more = engine.recv(4096)
            require(more, "the recorder hangs up")
            answer += more
    require(b"MSA|AA|" in answer, answer)


def adt(event, patient, name):
    return ("MSH|^~\\&|HIS|H|KIROKU|K|20261128080000||ADT^" + event + "|m" + event + patient + "|P|2.5", f"PID|1||{patient}^^^H^MR||{name}", "PV1|1|I|SURG^OR1")


def siu(event, appointment, patient, name, hours):
    when = time.strftime("%Y%m%d%H%M%S", time.gmtime(time.time() + 3600 * hours))
    return ("MSH|^~\\&|HIS|H|KIROKU|K|20261128080000||SIU^" + event + "|s" + event + appointment + "|P|2.5",
            f"SCH|{appointment}|{appointment}|||||||||^^^{when}+0000", f"PID|1||{patient}^^^H^MR||{name}", "RGS|1", f"AIS|1||LAP^Hernia^L|{when}+0000",
            "RGS|2", "AIL|1||SURG^OR1")


class Recorder:
    def __init__(self, programs, folder, manager):
        self.programs, self.home, self.manager = programs, folder / "home", manager
        self.bin = folder / "bin"
        self.bin.mkdir(parents=True)
        for name in ("kirokud", "kiroku-decoder"):
            shutil.copy(programs / name, self.bin / name)
        subprocess.run([programs / "kiroku", "init", "--demo", "--home", self.home], check=True, capture_output=True)
        self.port = ports.reserved_port()
        with open(self.home / "kiroku.toml", "a") as file:
            file.write(ROOM.format(port=self.port, socket=folder / "s"))
        self.log = folder / "log"
        self.process = None

    def start(self):
        with open(self.log, "ab") as log:
            self.process = self.manager.start([self.bin / "kirokud", "--home", self.home], log)
        eventually(lambda: self.status()["rooms"][0]["procedure"][0]["well"], "messages are waited for", self.manager.look)

    def kiroku(self, *words):
        done = subprocess.run([self.programs / "kiroku", *words, "--home", self.home], capture_output=True, text=True)
        require(done.returncode == 0, (words, done))
        return done.stdout

    def status(self):
        return json.loads(self.kiroku("status", "--json"))

    def way(self):
        return self.status()["rooms"][0]["procedure"][0]["state"]

    def upgrade(self):
        shutil.copy(self.bin / "kirokud", self.bin / "new")
        os.rename(self.bin / "new", self.bin / "kirokud")

    def subject(self):
        case = json.loads(self.kiroku("case", "start", "--json"))["case"]
        self.kiroku("case", "stop")
        sealed = self.home / "archive" / case / "subject.json.age"
        opened = subprocess.run([self.programs / "kiroku", "unseal", "-i", self.home / "identity.txt", sealed], capture_output=True, check=True)
        return json.loads(opened.stdout)

    def end(self):
        if self.process and self.process.poll() is None:
            self.process.terminate()
            require(self.manager.wait(self.process) == 0, "kirokud does not end well")
        self.manager.look()


def is_kept_over_starts(programs, folder):
    manager = Manager(folder, has_store=True)
    recorder = Recorder(programs, folder / "with", manager)
    recorder.start()
    require("messages before 2" in recorder.way(), recorder.way())
    since = recorder.way().split("messages before ")[1]
    deliver(recorder.port, *adt("A10", "A1", "RIGHT^ANNA"))

    # An upgrade while the room rests.
    recorder.upgrade()
    require(manager.wait(recorder.process) == 0, "it ends for the newer one")
    require(ENDS_FOR_A_NEWER in recorder.log.read_text(), "it says why")
    require(len(manager.kept) == 2, f"{list(manager.kept)} are kept")
    recorder.start()
    require("1 taken" in recorder.way() and recorder.way().endswith(since), recorder.way())
    deliver(recorder.port, *siu("S12", "B7", "B2", "WRONG^BERTA", 6))
    found = recorder.subject()
    require(found["patient"]["family"] == "RIGHT", found)

    # A crash.
    recorder.process.send_signal(signal.SIGKILL)
    recorder.process.wait()
    recorder.start()
    require("2 taken" in recorder.way(), recorder.way())
    require(recorder.subject()["patient"]["family"] == "RIGHT", "the crash forgot who is on the table")
    recorder.end()

    # Whatever is damaged is begun anew, and that is told.
    for descriptor in manager.kept.values():
        os.pwrite(descriptor, b"damaged", 60)
    recorder.start()
    require("0 taken" in recorder.way() and "messages before 2" in recorder.way(), recorder.way())
    recorder.end()
    for secret in ("ANNA", "BERTA"):
        for file in [recorder.log, *(one for one in recorder.home.rglob("*") if one.is_file())]:
            require(secret.encode() not in file.read_bytes(), f"{secret} stands in {file}")


def waits_where_nothing_keeps_it(programs, folder):
    recorder = Recorder(programs, folder / "without", Manager(folder, has_store=False))
    recorder.start()
    deliver(recorder.port, *adt("A10", "A1", "RIGHT^ANNA"))
    recorder.upgrade()
    eventually(lambda: any("takes over once no HL7 message" in one for one in recorder.status()["remarks"]), "it says that it waits", recorder.manager.look)
    require(not recorder.status()["problems"], "that it waits is no problem")
    require(recorder.process.poll() is None, "it ended, and forgot who is on the table")
    require(recorder.subject()["patient"]["family"] == "RIGHT", "it forgot who is on the table")
    deliver(recorder.port, *adt("A03", "A1", "RIGHT^ANNA"))
    require(recorder.manager.wait(recorder.process) == 0, "it ends once the room is empty")
    require(ENDS_FOR_A_NEWER in recorder.log.read_text(), "it says why")


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        is_kept_over_starts(programs, pathlib.Path(folder))
        waits_where_nothing_keeps_it(programs, pathlib.Path(folder))
    print("who is on the table outlives a start of the recorder")


if __name__ == "__main__":
    main()
