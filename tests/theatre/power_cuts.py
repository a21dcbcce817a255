#!/usr/bin/env python3
"""Power cuts on real file systems: records on ext4, xfs and btrfs, and cuts the power at random moments.

User-mode Linux boots Debian's kernel as a process, without root and without a virtual machine. Kiroku records there
on a disk of which every write and every flush is logged (dm-log-writes). A power cut at a moment leaves what was
flushed before it, and of the writes since then each block by chance, as a disk with a cache of its own may: blocks of
4,096 bytes for one half of the cuts, of 512 for the other. Such a disk is then mounted by the kernel, which recovers
the file system. `kiroku recover` brings the case to its end; `kiroku verify` must say `intact` or `intact-with-gaps`,
with an identity and without; the appliance log must hold. Everything that the recorder had claimed to be on the disk
before the cut, in its ledger, must be there byte for byte.

Usage: tests/theatre/power_cuts.py [--cuts N] [--file-systems LIST] [--seed N] [--keep] [--lying-disk KIB | --without-flushes]
  --cuts N             of each file system (20)
  --file-systems LIST  of ext4,xfs,btrfs (all three)
  --seed N             for the moments and what is lost; printed, another each time without it
  --keep               leaves the disks of cuts that do not hold, and says where
  --lying-disk KIB     the disk ignores flushes, and has a cache of so many KiB: what is lost then. Loss is expected
  --without-flushes    the recorder forgets to flush (without_flushes.c). Loss is expected

The last two prove that this test can fail. KIROKU is the program (build/release/apps/kiroku), KIROKU_UML the kernel
(linux.uml of Debian's user-mode-linux).
Exit status: 0 all hold (where loss is expected: it was found on each file system), 1 otherwise, 77 a tool is not installed.
"""
import argparse
import collections
import concurrent.futures
import os
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import time

import machine

LOG_BYTES = 4 << 30  # sparse
UNITS = (4096, 512)
CUTS_A_BOOT = 15     # ubd has 16
RECORDINGS = [["record", "--endoscope", machine.VIDEO, "--vitals", "synthetic:patient", "--duration", seconds]
              for seconds in ("4s", "10s")]
# Of dm-log-writes (Linux, Documentation/admin-guide/device-mapper/log-writes.rst).
MAGIC, FLUSH, FUA, DISCARD, MARK = 0x6A736677736872, 1, 2, 4, 8

# Of a mark, `bytes` is 0 and `offset` how many claims were made before it.
Write = collections.namedtuple("Write", "sector bytes flags offset")


def read_log(file):
    """What was written, in the order in which it was done, up to the mark at the end; with the marks of claims."""
    with open(file, "rb") as log:
        magic, _, entries, sector = struct.unpack("<QQQI", log.read(28))
        if magic != MAGIC:
            raise RuntimeError(f"{file} is no log of dm-log-writes")
        writes, at = [], sector
        for _ in range(entries):
            log.seek(at)
            first, count, flags, length = struct.unpack("<QQQQ", log.read(32))
            text = log.read(length) if flags & MARK else b""
            at += sector
            if text.startswith(b"end"):
                return writes
            if text.startswith(b"claimed-"):
                writes.append(Write(0, 0, MARK, int(text[len(b"claimed-"):].rstrip(b"\0"))))
            if flags & MARK:
                continue
            held = 0 if flags & DISCARD else count * sector
            writes.append(Write(first * sector, held, flags, at))
            at += held
    raise RuntimeError(f"{file} has no end: the disk for the log is too small, or recording did not finish")


class Disk:
    """The disk as power cuts leave it, at moments that only go forward."""

    def __init__(self, image, log, writes, cache_bytes):
        self.image, self.log, self.writes, self.cache_bytes = image, log, writes, cache_bytes
        self.written = 0  # that many writes are in the image

    def safe_at(self, stop):
        """How many writes are past all danger when the power is cut behind write number `stop`."""
        if self.cache_bytes is None:
            return max((i for i in range(self.written, stop + 1) if self.writes[i].flags & FLUSH), default=self.written)
        left, first = self.cache_bytes, stop + 1
        while first > self.written and self.writes[first - 1].bytes <= left:
            first -= 1
            left -= self.writes[first].bytes
        return first

    def cut(self, stop, chance, target):
        """Writes the disk after a cut to `target`; returns how many bytes were at risk, and how many were lost."""
        with open(self.log, "rb") as source:
            safe = self.safe_at(stop)
            with open(self.image, "r+b") as image:
                for write in self.writes[self.written:safe]:
                    self._write(image, write, self._held(source, write))
            self.written = safe
            subprocess.run(["cp", "--sparse=always", self.image, target], check=True)
            at_risk = lost = 0
            unit = chance.choice(UNITS)
            with open(target, "r+b") as image:
                for write in self.writes[safe:stop + 1]:
                    held = self._held(source, write)
                    if write.flags & FUA and self.cache_bytes is None:
                        self._write(image, write, held)
                        continue
                    for begin in range(0, len(held), unit):
                        at_risk += unit
                        if chance.random() < 0.5:
                            lost += unit
                            continue
                        image.seek(write.sector + begin)
                        image.write(held[begin:begin + unit])
        return at_risk, lost

    @staticmethod
    def _held(source, write):
        if not write.bytes:
            return b""
        source.seek(write.offset)
        return source.read(write.bytes)

    @staticmethod
    def _write(image, write, held):
        image.seek(write.sector)
        image.write(held)


def try_file_system(name, guest, chance, asked):
    began = time.monotonic()
    base = guest.new_disk(f"{name}-base.img", name)
    disk, log = guest.work / f"{name}-disk.img", guest.work / f"{name}-log.img"
    subprocess.run(["cp", "--sparse=always", base, disk], check=True)
    with open(log, "wb") as made:
        made.truncate(LOG_BYTES)
    preload = str(asked.preload) if asked.preload else ""
    claims = guest.do("record", [disk, log], file_system=name, commands=RECORDINGS, preload=preload)["claims"]
    disk.unlink()
    writes = read_log(log)
    flushes = sum(1 for one in writes if one.flags & FLUSH)
    marks = [(position, one.offset) for position, one in enumerate(writes) if one.flags & MARK]
    print(f"{name}: {len(writes) - len(marks)} writes, {sum(one.bytes for one in writes) / 1e6:.1f} MB, {flushes} flushes logged, "
          f"{len(claims)} claims at {len(marks)} moments", flush=True)
    if (flushes < 10 and not asked.preload) or not marks:
        raise RuntimeError(f"{name}: hardly any flush or claim was logged, so that no cut would say anything")
    left = Disk(base, log, writes, asked.lying_disk * 1024 if asked.lying_disk else None)
    stops = sorted(chance.sample(range(len(writes)), min(asked.cuts, len(writes))))
    tally, kinds, bad, lost_bytes, claimed = collections.Counter(), collections.Counter(), 0, 0, 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as judges:
        for first in range(0, len(stops), CUTS_A_BOOT):
            some = stops[first:first + CUTS_A_BOOT]
            disks = [guest.work / f"cut-{number}.img" for number in range(len(some))]
            before = [guest.work / f"before-{number}.img" for number in range(len(some))]
            losses = [left.cut(stop, chance, image) for stop, image in zip(some, disks)]
            if asked.keep:
                for image, copy in zip(disks, before):
                    subprocess.run(["cp", "--sparse=always", image, copy], check=True)
            homes = guest.homes(disks, name)
            due = [claims[:max((count for position, count in marks if position <= stop), default=0)] for stop in some]
            claimed += sum(map(len, due))
            judged = judges.map(lambda home, due: ([], [("the file system cannot be read", home[1])]) if home[1] else
                                machine.judge(home[0], due), homes, due)
            for number, (stop, (at_risk, lost), (verdicts, problems)) in enumerate(zip(some, losses, judged)):
                lost_bytes += lost
                tally.update(verdicts)
                kinds.update({kind for kind, _ in problems})
                bad += bool(problems)
                if problems and not asked.loss_expected:
                    print(f"{name}, cut behind write {stop}, {lost} of {at_risk} bytes lost:", flush=True)
                    for kind, text in problems:
                        print(f"  {kind}: {text}", flush=True)
                if problems and asked.keep:
                    kept = pathlib.Path(tempfile.gettempdir()) / f"theatre-{name}-{stop}.img"
                    shutil.move(before[number], kept)
                    print(f"  the disk as it was: {kept}", flush=True)
            for file in [*disks, *before]:
                file.unlink(missing_ok=True)
            for home, _ in homes:
                shutil.rmtree(home, ignore_errors=True)
            print(f"{name}: {first + len(some)} of {len(stops)} cuts, {bad} do not hold, {time.monotonic() - began:.0f} s", flush=True)
    for file in (log, base):
        file.unlink()
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in sorted(tally.items()))
    print(f"{name}: {len(stops)} cuts, {lost_bytes / 1e6:.1f} MB lost, {claimed} claims compared, {bad} do not hold; "
          f"verdicts: {verdicts}; {time.monotonic() - began:.0f} s", flush=True)
    for kind, count in sorted(kinds.items()):
        print(f"{name}:   {count} of {len(stops)}: {kind}", flush=True)
    return bad


def main():
    if any(one in ("-h", "--help") for one in sys.argv[1:]):
        print(__doc__)
        return 0
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0])
    parser.add_argument("--cuts", type=int, default=20)
    parser.add_argument("--file-systems", default=",".join(machine.MAKE))
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1 << 31))
    parser.add_argument("--keep", action="store_true")
    faults = parser.add_mutually_exclusive_group()
    faults.add_argument("--lying-disk", type=int, metavar="KIB")
    faults.add_argument("--without-flushes", action="store_true")
    asked = parser.parse_args()
    asked.loss_expected, asked.preload = bool(asked.lying_disk or asked.without_flushes), None
    wanted = machine.wanted_file_systems(asked)
    print(f"seed {asked.seed}", flush=True)
    chance = random.Random(asked.seed)
    with tempfile.TemporaryDirectory(prefix="kiroku-theatre.") as work:
        guest = machine.Machine(pathlib.Path(work))
        if asked.without_flushes:
            asked.preload = machine.without_flushes(guest.work)
        bad = {name: try_file_system(name, guest, chance, asked) for name in wanted}
    if not asked.loss_expected:
        return 1 if any(bad.values()) else 0
    unseen = [name for name in wanted if not bad[name]]
    if unseen:
        print(f"loss was expected, and none was found on {', '.join(unseen)}: this test sees too little, or there were too few cuts")
    return 1 if unseen else 0


if __name__ == "__main__":
    sys.exit(main())
