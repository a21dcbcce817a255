#!/usr/bin/env python3
"""The first process of User-mode Linux, which tests/theatre/power_cuts.py boots: does one job and switches itself off.

The host's own files are the root file system (hostfs), so that programs run here as they were built. The job stands
in the JSON file that the kernel's command line names (THEATRE_JOB); what came of it is written beside it.
"""
import ctypes
import json
import os
import pathlib
import subprocess
import traceback

LIBC = ctypes.CDLL(None, use_errno=True)
LIBC.mount.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_ulong, ctypes.c_char_p]
FINIT_MODULE = 313  # x86-64
POWER_OFF = 0x4321FEDC
MODULES = ("dm-mod", "dm-log-writes")


def must(done, what):
    if done != 0:
        raise OSError(ctypes.get_errno(), f"{what}: {os.strerror(ctypes.get_errno())}")


def mount(device, where, file_system):
    must(LIBC.mount(device.encode(), str(where).encode(), file_system.encode(), 0, None), f"mount {device}")


def unmount(where):
    must(LIBC.umount2(str(where).encode(), 0), f"unmount {where}")


def run(command, **how):
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, **how)


def need(command, **how):
    done = run(command, **how)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.returncode} {done.stdout[-500:]} {done.stderr[-500:]}")
    return done.stdout


def load_modules(folder):
    found = {path.name: path for path in pathlib.Path(folder).rglob("*.ko*")}
    for name in MODULES:
        opened = os.open(found[f"{name}.ko"], os.O_RDONLY)
        must(LIBC.syscall(FINIT_MODULE, opened, b"", 0), f"load {name}")
        os.close(opened)


def prepare(job):
    """A home on the new file system, durable before anything is logged."""
    mount("/dev/ubda", job["mount"], job["file_system"])
    try:
        need([job["kiroku"], "init", "--demo", "--home", job["mount"] + "/home"])
    finally:
        unmount(job["mount"])
    return {}


def record(job):
    """Records with every write to the disk logged on the second one, and with it where each flush lies."""
    load_modules(job["modules"])
    sectors = pathlib.Path("/sys/block/ubda/size").read_text().strip()
    table = f"0 {sectors} log-writes /dev/ubda /dev/ubdb"
    need(["dmsetup", "create", "logged", "--noudevrules", "--noudevsync", "--table", table])
    mount("/dev/dm-0", job["mount"], job["file_system"])
    said = [need([job["kiroku"], *command, "--home", job["mount"] + "/home"]) for command in job["commands"]]
    need(["dmsetup", "message", "logged", "0", "mark", "end"])
    unmount(job["mount"])
    need(["dmsetup", "remove", "--noudevrules", "--noudevsync", "logged"])
    return {"said": said}


def judge_one(job, device):
    """What the start after a power cut makes of it, and what a verifier says then."""
    mount(device, job["mount"], job["file_system"])  # the kernel's own recovery of the file system
    try:
        home = job["mount"] + "/home"
        recovered = run([job["kiroku"], "recover", "--json", "--home", home])
        out = {"recover": recovered.returncode, "said": (recovered.stdout + recovered.stderr)[-2000:], "cases": []}
        for case in sorted(pathlib.Path(home, "archive").glob("2*")):
            for key in ([], ["--identity", home + "/identity.txt"]):
                verified = run([job["kiroku"], "verify", "--json", "--home", home, *key, str(case)])
                try:
                    report = json.loads(verified.stdout)
                    found = [f"{one['code']} {one['file']}: {one['text']}" for one in report["findings"]]
                    out["cases"].append({"case": case.name, "verdict": report["verdict"], "findings": found})
                except (ValueError, KeyError):
                    said = (verified.stdout + verified.stderr)[-500:]
                    out["cases"].append({"case": case.name, "verdict": "none", "findings": [said]})
        log = run([job["kiroku"], "log", "--verify", "--home", home])
        out["log"] = log.returncode
        if log.returncode != 0:
            out["said"] += log.stdout + log.stderr
        return out
    finally:
        unmount(job["mount"])


def judge(job):
    results = []
    for device in job["devices"]:
        try:
            results.append(judge_one(job, device))
        except Exception:  # whatever it is, the host tells it with the cut
            results.append({"broken": traceback.format_exc()})
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
        out = {"prepare": prepare, "record": record, "judge": judge}[job["do"]](job)
    except Exception:  # told by the host
        out = {"broken": traceback.format_exc()}
    job_file.with_suffix(".out").write_text(json.dumps(out))


if __name__ == "__main__":
    try:
        main()
    finally:
        os.sync()
        LIBC.reboot(POWER_OFF)
