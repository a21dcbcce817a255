"""What the scripts of tests/theatre share: User-mode Linux with one job at a time, and the judgement of a home that a disk gave back.

KIROKU is the program (build/release/apps/kiroku), KIROKU_UML the kernel (linux.uml of Debian's user-mode-linux).
"""
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
KIROKU = pathlib.Path(os.environ.get("KIROKU", ROOT / "build/release/apps/kiroku")).resolve()
KERNEL = os.environ.get("KIROKU_UML", "linux.uml")
DISK_BYTES = 400 << 20  # mkfs.xfs asks for 300 MiB
BOOT_SECONDS = 900
JUDGE_SECONDS = 300
MAKE = {
    "ext4": ["mkfs.ext4", "-q", "-F"],
    "xfs": ["mkfs.xfs", "-q", "-f"],
    "btrfs": ["mkfs.btrfs", "-q", "-f"],
}
VIDEO = "synthetic:endoscope?size=320x240&rate=15"
GOOD = {"intact", "intact-with-gaps"}


class Machine:
    """User-mode Linux with one job at a time (guest.py). Files of the host are its root file system."""

    def __init__(self, work):
        self.work, self.boots = work, 0
        (work / "mount").mkdir()

    def do(self, what, disks, **job):
        """What the guest answers; raises where it did not come to an answer."""
        self.boots += 1
        file = self.work / f"job-{self.boots}.json"
        job = {"do": what, "mount": str(self.work / "mount"), "kiroku": str(KIROKU), "said": str(self.work / "said"),
               "modules": str(modules()), **job}
        file.write_text(json.dumps(job))
        command = [KERNEL, "mem=1G", "root=/dev/root", "rootfstype=hostfs", "rw", "quiet", f"init={HERE / 'guest.py'}",
                   f"THEATRE_JOB={file}", "con=null", "con0=null,fd:1"]
        command += [f"ubd{number}={disk}" for number, disk in enumerate(disks)]
        booted = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                                errors="replace", timeout=BOOT_SECONDS,
                                env={**os.environ, "TMPDIR": str(self.work)})
        out = file.with_suffix(".out")
        if not out.exists():
            raise RuntimeError(f"the machine did not finish '{what}':\n{booted.stdout[-3000:]}{booted.stderr[-1000:]}")
        result = json.loads(out.read_text())
        if "broken" in result:
            raise RuntimeError(f"'{what}' did not work in the machine:\n{result['broken']}\n{booted.stdout[-3000:]}")
        return result

    def new_disk(self, name, file_system):
        """A sparse disk with a file system and a home of Kiroku's on it."""
        disk = self.work / name
        with open(disk, "wb") as made:
            made.truncate(DISK_BYTES)
        subprocess.run([*MAKE[file_system], str(disk)], check=True, stdout=subprocess.DEVNULL)
        self.do("prepare", [disk], file_system=file_system)
        return disk

    def homes(self, disks, file_system):
        """The kernel recovers each disk's file system. Of each: its home as a folder of the host, or what failed."""
        targets = [self.work / f"home-{number}" for number in range(len(disks))]
        for target in targets:
            shutil.rmtree(target, ignore_errors=True)
        devices = [f"/dev/ubd{chr(ord('a') + number)}" for number in range(len(disks))]
        results = self.do("copy_out", disks, file_system=file_system, devices=devices,
                          targets=[str(target) for target in targets])["results"]
        return [(target, result.get("broken")) for target, result in zip(targets, results)]


def modules():
    # Beside the kernel, as its package lays them out.
    return pathlib.Path(shutil.which(KERNEL) or KERNEL).resolve().parents[1] / "lib/uml/modules"


def missing_tool(*tools):
    """The first of the tools that is not installed, or None."""
    os.environ["PATH"] += ":/usr/sbin:/sbin"
    return next((tool for tool in (KERNEL, "dmsetup", *tools) if shutil.which(tool) is None), None)


def without_flushes(work):
    """A library that, preloaded, makes a recorder forget to flush."""
    made = work / "without_flushes.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", made, HERE / "without_flushes.c"], check=True)
    return made


def wanted_file_systems(asked):
    """Those of --file-systems. Ends the program where one is not known, or what they need is missing (status 77)."""
    wanted = asked.file_systems.split(",")
    for name in wanted:
        if name not in MAKE:
            sys.exit(f"there is no file system '{name}' here; there are {', '.join(MAKE)}")
    missing = missing_tool(*(MAKE[name][0] for name in wanted), *(["cc"] if asked.without_flushes else []))
    if missing:
        print(f"{missing} is not installed (packages user-mode-linux, dmsetup, e2fsprogs, xfsprogs, btrfs-progs, gcc)")
        sys.exit(77)
    if not os.access(KIROKU, os.X_OK):
        sys.exit(f"no program at {KIROKU}: build it, or set KIROKU")
    return wanted


def kiroku(*command):
    return subprocess.run([str(KIROKU), *map(str, command)], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          check=False, timeout=JUDGE_SECONDS)


def verdict_of(home, case, *options):
    """Verdict, what it rests on, and the whole report."""
    verified = kiroku("verify", "--json", "--home", home, *options, case)
    try:
        report = json.loads(verified.stdout)
        found = [f"{one['code']} {one['file']}: {one['text']}" for one in report["findings"]]
        return report["verdict"], "; ".join(found), report
    except (ValueError, KeyError):
        return "none", (verified.stdout + verified.stderr)[-500:], None


def is_kept(home, claim):
    case = home / "archive" / claim["case"]
    try:
        if "lines" in claim:
            lines = (case / "ledger.jsonl").read_bytes().splitlines(keepends=True)[:claim["lines"]]
            return hashlib.sha256(b"".join(lines)).hexdigest() == claim["sha256"]
        return hashlib.sha256((case / claim["file"]).read_bytes()).hexdigest() == claim["sha256"]
    except OSError:
        return False


def judge(home, claims):
    """What the start after a fault makes of a home, what a verifier says then, and whether what was claimed is there.

    Returns verdicts with the identity, and problems: (kind, text) each.
    """
    problems, verdicts = [], []
    recovered = kiroku("recover", "--json", "--home", home)
    if recovered.returncode != 0:
        problems.append(("recovery is refused", f"{recovered.returncode} {(recovered.stdout + recovered.stderr)[-1000:]}"))
    for case in sorted((home / "archive").glob("2*")):
        for key in ([], ["--identity", home / "identity.txt"]):
            verdict, found, _ = verdict_of(home, case, *key)
            if verdict not in GOOD:
                problems.append((f"a case reads as {verdict}", f"{case.name}, {'with' if key else 'without'} identity: {found}"))
        verdicts.append(verdict)
    log = kiroku("log", "--verify", "--home", home)
    if log.returncode != 0:
        problems.append(("the appliance log does not hold", f"{log.returncode} {(log.stdout + log.stderr)[-1000:]}"))
    lost = [claim for claim in claims if not is_kept(home, claim)]
    if lost:
        what = [f"{claim['lines']} ledger lines" if "lines" in claim else claim["file"] for claim in lost]
        problems.append(("what was claimed is lost", f"{len(lost)} of {len(claims)}: " + ", ".join(what[:5])))
    return verdicts, problems
