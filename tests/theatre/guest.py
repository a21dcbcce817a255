#!/usr/bin/env python3
"""The first process of User-mode Linux, which tests/theatre/machine.py boots: does one job and switches itself off.

The host's own files are the root file system (hostfs), so that programs run here as they were built. The job stands
in the JSON file that the kernel's command line names (THEATRE_JOB); what came of it is written beside it.
"""
import ctypes
import hashlib
import json
import os
import pathlib
import subprocess
import time
import traceback

LIBC = ctypes.CDLL(None, use_errno=True)
LIBC.mount.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_ulong, ctypes.c_char_p]
FINIT_MODULE = 313  # x86-64
POWER_OFF = 0x4321FEDC
MOST_SECONDS = 300  # of one command


def must(done, what):
    if done != 0:
        raise OSError(ctypes.get_errno(), f"{what}: {os.strerror(ctypes.get_errno())}")


def mount(device, where, file_system):
    must(LIBC.mount(device.encode(), str(where).encode(), file_system.encode(), 0, None), f"mount {device}")


def unmount(where):
    must(LIBC.umount2(str(where).encode(), 0), f"unmount {where}")


def run(command, **how):
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=MOST_SECONDS, **how)


def need(command, **how):
    done = run(command, **how)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.returncode} {done.stdout[-500:]} {done.stderr[-500:]}")
    return done.stdout


def load_modules(folder, names):
    found = {path.name: path for path in pathlib.Path(folder).rglob("*.ko*")}
    for name in names:
        opened = os.open(found[f"{name}.ko"], os.O_RDONLY)
        must(LIBC.syscall(FINIT_MODULE, opened, b"", 0), f"load {name}")
        os.close(opened)


def device_mapper(*command):
    # No udev is here to wait for.
    need(["dmsetup", *command, "--noudevrules", "--noudevsync"])


def sectors():
    return pathlib.Path("/sys/block/ubda/size").read_text().strip()


class Witness:
    """Reads a recorder's ledgers while it records, and notes what it claims to be on the disk.

    An entry is written after what it names was flushed, and a token is asked for after the lines that it is over were
    (docs/reference/format.md, "Order of durability"). So whatever a visible entry names must outlast a power cut from
    now on, whether the entry itself does or not.
    """

    def __init__(self, home):
        self.archive = pathlib.Path(home, "archive")
        self.known = {}  # of each case: how many bytes of its ledger were read
        self.claims = []

    def look(self):
        for ledger in sorted(self.archive.glob("2*/ledger.jsonl")):
            held = ledger.read_bytes()
            begin, end = self.known.get(ledger.parent.name, 0), held.rfind(b"\n") + 1
            for line in held[begin:end].splitlines():
                self._note(ledger.parent.name, json.loads(line), held)
            self.known[ledger.parent.name] = max(begin, end)
        return len(self.claims)

    def _note(self, case, entry, ledger):
        if entry["type"] in ("segment", "token"):
            self.claims.append({"case": case, "file": entry["file"], "sha256": entry["sha256"]})
        if entry["type"] == "token":
            lines = ledger.splitlines(keepends=True)[:entry["checkpoint"]]
            digest = hashlib.sha256(b"".join(lines)).hexdigest()
            self.claims.append({"case": case, "lines": entry["checkpoint"], "sha256": digest})


def prepare(job):
    """A home on the new file system, durable before anything is logged."""
    mount("/dev/ubda", job["mount"], job["file_system"])
    try:
        need([job["kiroku"], "init", "--demo", "--home", job["mount"] + "/home"])
    finally:
        unmount(job["mount"])
    return {}


def begin_recorder(job, command, said):
    environment = {**os.environ, **({"LD_PRELOAD": job["preload"]} if job.get("preload") else {})}
    return subprocess.Popen([job["kiroku"], *command, "--home", job["mount"] + "/home"], stdin=subprocess.DEVNULL,
                            stdout=said, stderr=subprocess.STDOUT, env=environment)


def record(job):
    """Records with every write to the disk logged on the second one, and with it where each flush and claim lies."""
    load_modules(job["modules"], ("dm-mod", "dm-log-writes"))
    device_mapper("create", "logged", "--table", f"0 {sectors()} log-writes /dev/ubda /dev/ubdb")
    mount("/dev/dm-0", job["mount"], job["file_system"])
    witness = Witness(job["mount"] + "/home")
    for command in job["commands"]:
        with open(job["said"], "w+", encoding="utf-8") as said:
            recorder = begin_recorder(job, command, said)
            ends, marked = time.monotonic() + MOST_SECONDS, len(witness.claims)
            while recorder.poll() is None:
                if time.monotonic() > ends:
                    recorder.kill()
                if witness.look() > marked:
                    marked = len(witness.claims)
                    need(["dmsetup", "message", "logged", "0", "mark", f"claimed-{marked}"])
                time.sleep(0.1)
            if recorder.returncode != 0:
                said.seek(0)
                raise RuntimeError(f"{' '.join(command)}: {recorder.returncode} {said.read()[-1000:]}")
    need(["dmsetup", "message", "logged", "0", "mark", "end"])
    unmount(job["mount"])
    device_mapper("remove", "logged")
    return {"claims": witness.claims}


def turn(table):
    """The disk behaves otherwise from now on, without a file system's being told of it."""
    device_mapper("load", "faulty", "--table", table)
    device_mapper("suspend", "--noflush", "--nolockfs", "faulty")
    device_mapper("resume", "faulty")


def wait_until(holds, what):
    ends = time.monotonic() + MOST_SECONDS
    while not holds():
        if time.monotonic() > ends:
            raise RuntimeError(f"{what}: not within {MOST_SECONDS} s")
        time.sleep(0.1)


def ask(job, *command):
    return run([job["kiroku"], *command, "--home", job["mount"] + "/home"])


def begin_service(job, said):
    """kirokud with a case that runs."""
    home = pathlib.Path(job["mount"], "home")
    with open(home / "kiroku.toml", "a", encoding="utf-8") as configuration:
        configuration.write(job["room"])
    service = subprocess.Popen([str(pathlib.Path(job["kiroku"]).with_name("kirokud")), "--home", str(home)],
                               stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT,
                               env={**os.environ, **({"LD_PRELOAD": job["preload"]} if job.get("preload") else {})})
    wait_until(lambda: ask(job, "status").returncode == 0, "kirokud answers")
    begun = ask(job, "case", "start")
    if begun.returncode != 0:
        raise RuntimeError(f"case start: {begun.returncode} {begun.stderr}")
    return service


def end_service(job, service, out):
    """What a person sees and does after the fault: status, the case's end; then the service's."""
    out["told"] = ask(job, "status").stdout
    stopped = ask(job, "case", "stop")
    out["told"] += f"case stop: {stopped.returncode} {stopped.stdout}{stopped.stderr}"
    service.terminate()
    service.wait(MOST_SECONDS)


def fail(job):
    """Records on a disk that fails meanwhile, for some seconds or for good (dm-flakey)."""
    load_modules(job["modules"], ("dm-mod", "dm-flakey"))
    good = f"0 {sectors()} linear /dev/ubda 0"
    # Never up, always down: what "down" means, the features say.
    bad = f"0 {sectors()} flakey /dev/ubda 0 0 1 {job['features']}"
    device_mapper("create", "faulty", "--table", good)
    mount("/dev/dm-0", job["mount"], job["file_system"])
    witness = Witness(job["mount"] + "/home")
    out = {"ended": True, "told": ""}
    with open(job["said"], "w+", encoding="utf-8") as said:
        recorder = begin_service(job, said) if job["room"] else begin_recorder(job, job["command"], said)
        wait_until(lambda: recorder.poll() is not None or witness.look() >= job["after_claims"], "the recorder's first claims")
        out["claims"] = list(witness.claims)
        out["failed_while_recording"] = recorder.poll() is None
        turn(bad)
        try:
            if job["seconds"] or job["room"]:
                time.sleep(job["seconds"] or 4)
            if job["seconds"]:
                turn(good)
            if job["room"]:
                end_service(job, recorder, out)
            else:
                recorder.wait(MOST_SECONDS)
        except subprocess.TimeoutExpired:
            out["ended"] = False
            recorder.kill()
            recorder.wait()
        said.seek(0)
        out["said"], out["status"] = said.read()[-3000:], recorder.returncode
    try:
        unmount(job["mount"])  # what still waits in memory meets the disk as it is
    except OSError as refused:
        out["unmount"] = str(refused)
    turn(good)
    return out


def copy_out(job):
    """The kernel recovers each file system; what it then holds goes to the host, which judges it."""
    results = []
    for device, target in zip(job["devices"], job["targets"]):
        try:
            mount(device, job["mount"], job["file_system"])
            try:
                need(["cp", "-a", job["mount"] + "/home", target])
                # Whether it takes anything new: the recorder's next start writes.
                written = pathlib.Path(job["mount"], "home/archive/.theatre")
                with open(written, "wb") as file:
                    file.write(b"new")
                    os.fsync(file.fileno())
                written.unlink()
            finally:
                unmount(job["mount"])
            results.append({})
        except Exception:  # whatever it is, the host tells it with the cut
            results.append({"broken": traceback.format_exc(limit=1)})
    return {"results": results}


def main():
    os.environ["PATH"] = "/usr/sbin:/usr/bin:/sbin:/bin"
    for file_system, where in (("proc", "/proc"), ("sysfs", "/sys"), ("tmpfs", "/run"), ("tmpfs", "/dev/shm")):
        os.makedirs(where, exist_ok=True)
        mount(file_system, where, file_system)
    job_file = pathlib.Path(os.environ["THEATRE_JOB"])
    try:
        job = json.loads(job_file.read_text())
        os.environ["HOME"] = job["mount"]
        out = {"prepare": prepare, "record": record, "fail": fail, "copy_out": copy_out}[job["do"]](job)
    except Exception:  # told by the host
        out = {"broken": traceback.format_exc()}
    job_file.with_suffix(".out").write_text(json.dumps(out))


if __name__ == "__main__":
    try:
        main()
    finally:
        os.sync()
        LIBC.reboot(POWER_OFF)
