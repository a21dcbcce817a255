#!/usr/bin/env python3
"""Power cuts on real file systems: records on ext4, xfs and btrfs, and cuts the power at random moments.

User-mode Linux boots Debian's kernel as a process, without root and without a virtual machine. Kiroku records there
on a disk of which every write and every flush is logged (dm-log-writes). A power cut at a moment leaves what was
flushed before it, and of the writes since then each block of 4 KiB by chance, as a disk with a cache of its own may.
Such a disk is then mounted by the kernel, which recovers the file system; `kiroku recover` brings the case to its
end; `kiroku verify` must say `intact` or `intact-with-gaps`, with an identity and without, and the appliance log must
hold.

Usage: tests/theatre/power_cuts.py [--cuts N] [--file-systems LIST] [--seed N] [--keep]
  --cuts N             of each file system (20)
  --file-systems LIST  of ext4,xfs,btrfs (all three)
  --seed N             for the moments and what is lost; printed, another each time without it
  --keep               leaves the disks of cuts that do not hold, and says where

KIROKU is the program (build/release/apps/kiroku), KIROKU_UML the kernel (linux.uml of Debian's user-mode-linux).
Exit status: 0 all hold, 1 some do not, 77 a tool is not installed.
"""
import argparse
import collections
import json
import os
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
DISK_BYTES = 400 << 20  # mkfs.xfs asks for 300 MiB
LOG_BYTES = 4 << 30     # sparse
BLOCK = 4096
CUTS_A_BOOT = 6
BOOT_SECONDS = 900
MAKE = {
    "ext4": ["mkfs.ext4", "-q", "-F"],
    "xfs": ["mkfs.xfs", "-q", "-f"],
    "btrfs": ["mkfs.btrfs", "-q", "-f"],
}
VIDEO = "synthetic:endoscope?size=320x240&rate=15"
RECORDINGS = [["record", "--endoscope", VIDEO, "--vitals", "synthetic:patient", "--duration", seconds]
              for seconds in ("5s", "12s")]
GOOD = {"intact", "intact-with-gaps"}
# Of dm-log-writes (Linux, Documentation/admin-guide/device-mapper/log-writes.rst).
MAGIC, FLUSH, FUA, DISCARD, MARK = 0x6A736677736872, 1, 2, 4, 8

Write = collections.namedtuple("Write", "sector bytes flags offset")


class Machine:
    """User-mode Linux with one job at a time."""

    def __init__(self, work, kernel):
        self.work, self.kernel, self.boots = work, kernel, 0
        (work / "mount").mkdir()

    def do(self, what, disks, **job):
        self.boots += 1
        file = self.work / f"job-{self.boots}.json"
        job = {"do": what, "mount": str(self.work / "mount"), "kiroku": str(KIROKU), **job}
        file.write_text(json.dumps(job))
        command = [self.kernel, "mem=1G", "root=/dev/root", "rootfstype=hostfs", "rw", "quiet", f"init={HERE / 'guest.py'}",
                   f"THEATRE_JOB={file}", "con=null", "con0=null,fd:1"]
        command += [f"ubd{number}={disk}" for number, disk in enumerate(disks)]
        booted = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                                timeout=BOOT_SECONDS, env={**os.environ, "TMPDIR": str(self.work)})
        out = file.with_suffix(".out")
        if not out.exists():
            raise RuntimeError(f"the machine did not finish '{what}':\n{booted.stdout[-3000:]}{booted.stderr[-1000:]}")
        result = json.loads(out.read_text())
        if "broken" in result:
            raise RuntimeError(f"'{what}' did not work in the machine:\n{result['broken']}\n{booted.stdout[-3000:]}")
        return result


def read_log(file):
    """What was written, in the order in which it was done; up to the mark at the end."""
    with open(file, "rb") as log:
        magic, _, entries, sector = struct.unpack("<QQQI", log.read(28))
        if magic != MAGIC:
            raise RuntimeError(f"{file} is no log of dm-log-writes")
        writes, at = [], sector
        for _ in range(entries):
            log.seek(at)
            first, count, flags, length = struct.unpack("<QQQQ", log.read(32))
            at += sector
            if flags & MARK:
                if log.read(length).startswith(b"end"):
                    return writes
                continue
            held = 0 if flags & DISCARD else count * sector
            writes.append(Write(first * sector, held, flags, at))
            at += held
    raise RuntimeError(f"{file} has no end: the disk for the log is too small, or recording did not finish")


def cut(base, log, writes, stop, chance, disk):
    """The disk after a cut behind write number `stop`; how many blocks were at risk, and how many were lost."""
    subprocess.run(["cp", "--sparse=always", base, disk], check=True)
    flushed = max((i for i in range(stop + 1) if writes[i].flags & FLUSH), default=0)
    at_risk = lost = 0
    with open(disk, "r+b") as image, open(log, "rb") as source:
        for number, write in enumerate(writes[:stop + 1]):
            if write.bytes == 0:
                continue
            source.seek(write.offset)
            held = source.read(write.bytes)
            safe = number < flushed or write.flags & FUA
            for begin in range(0, len(held), BLOCK):
                if not safe:
                    at_risk += 1
                    if chance.random() < 0.5:
                        lost += 1
                        continue
                image.seek(write.sector + begin)
                image.write(held[begin:begin + BLOCK])
    return at_risk, lost


def problems_of(result):
    if "broken" in result:
        return [result["broken"]]
    problems = []
    if result["recover"] != 0:
        problems.append(f"recover: {result['recover']} {result['said']}")
    for case in result["cases"]:
        if case["verdict"] not in GOOD:
            problems.append(f"{case['case']} is {case['verdict']}: " + "; ".join(case["findings"]))
    if result["log"] != 0:
        problems.append(f"log --verify: {result['log']} {result['said']}")
    return problems


def try_file_system(name, machine, chance, cuts, keep):
    began = time.monotonic()
    disk, log, base = (machine.work / f"{name}-{part}.img" for part in ("disk", "log", "base"))
    for file, size in ((disk, DISK_BYTES), (log, LOG_BYTES)):
        with open(file, "wb") as made:
            made.truncate(size)
    subprocess.run([*MAKE[name], str(disk)], check=True, stdout=subprocess.DEVNULL)
    machine.do("prepare", [disk], file_system=name)
    subprocess.run(["cp", "--sparse=always", disk, base], check=True)
    machine.do("record", [disk, log], file_system=name, commands=RECORDINGS, modules=str(MODULES))
    writes = read_log(log)
    flushes = sum(1 for one in writes if one.flags & FLUSH)
    print(f"{name}: {len(writes)} writes, {sum(one.bytes for one in writes) / 1e6:.1f} MB, {flushes} flushes logged", flush=True)
    if flushes < 10:
        raise RuntimeError(f"{name}: hardly any flush was logged, so that no cut would say anything")
    stops = sorted(chance.sample(range(len(writes)), min(cuts, len(writes))))
    tally, bad, lost_blocks = collections.Counter(), 0, 0
    for first in range(0, len(stops), CUTS_A_BOOT):
        some = stops[first:first + CUTS_A_BOOT]
        disks = [machine.work / f"cut-{number}.img" for number in range(len(some))]
        losses = [cut(base, log, writes, stop, chance, image) for stop, image in zip(some, disks)]
        devices = [f"/dev/ubd{chr(ord('a') + number)}" for number in range(len(some))]
        before = [machine.work / f"before-{number}.img" for number in range(len(some))]
        if keep:
            for image, copy in zip(disks, before):
                subprocess.run(["cp", "--sparse=always", image, copy], check=True)
        results = machine.do("judge", disks, file_system=name, devices=devices)["results"]
        for number, (stop, (at_risk, lost), result) in enumerate(zip(some, losses, results)):
            lost_blocks += lost
            found = problems_of(result)
            for case in result.get("cases", []):
                tally[case["verdict"]] += 1
            if found:
                bad += 1
                print(f"{name}, cut behind write {stop}, {lost} of {at_risk} blocks lost:", flush=True)
                for problem in found:
                    print(f"  {problem}", flush=True)
                if keep:
                    kept = pathlib.Path(tempfile.gettempdir()) / f"theatre-{name}-{stop}.img"
                    shutil.move(before[number], kept)
                    print(f"  the disk as it was: {kept}", flush=True)
        for file in [*disks, *before]:
            file.unlink(missing_ok=True)
    for file in (disk, log, base):
        file.unlink()
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in sorted(tally.items()))
    print(f"{name}: {len(stops)} cuts, {lost_blocks} blocks lost, {bad} do not hold; verdicts: {verdicts}; "
          f"{time.monotonic() - began:.0f} s", flush=True)
    return bad


def main():
    if any(one in ("-h", "--help") for one in sys.argv[1:]):
        print(__doc__)
        return 0
    parser = argparse.ArgumentParser()
    parser.add_argument("--cuts", type=int, default=20)
    parser.add_argument("--file-systems", default=",".join(MAKE))
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1 << 31))
    parser.add_argument("--keep", action="store_true")
    asked = parser.parse_args()
    wanted = asked.file_systems.split(",")
    for name in wanted:
        if name not in MAKE:
            sys.exit(f"there is no file system '{name}' here; there are {', '.join(MAKE)}")
    os.environ["PATH"] += ":/usr/sbin:/sbin"
    for tool in [os.environ.get("KIROKU_UML", "linux.uml"), "dmsetup", *(MAKE[name][0] for name in wanted)]:
        if shutil.which(tool) is None:
            print(f"{tool} is not installed (packages user-mode-linux, dmsetup, e2fsprogs, xfsprogs, btrfs-progs)")
            return 77
    if not os.access(KIROKU, os.X_OK):
        sys.exit(f"no program at {KIROKU}: build it, or set KIROKU")
    print(f"seed {asked.seed}", flush=True)
    chance = random.Random(asked.seed)
    bad = 0
    with tempfile.TemporaryDirectory(prefix="kiroku-theatre.") as work:
        machine = Machine(pathlib.Path(work), KERNEL)
        for name in wanted:
            bad += try_file_system(name, machine, chance, asked.cuts, asked.keep)
    return 1 if bad else 0


KIROKU = pathlib.Path(os.environ.get("KIROKU", ROOT / "build/release/apps/kiroku")).resolve()
KERNEL = os.environ.get("KIROKU_UML", "linux.uml")
# Beside the kernel, as its package lays them out.
MODULES = pathlib.Path(shutil.which(KERNEL) or KERNEL).resolve().parents[1] / "lib/uml/modules"

if __name__ == "__main__":
    sys.exit(main())
