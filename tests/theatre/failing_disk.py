#!/usr/bin/env python3
"""A disk that fails while Kiroku records on ext4, xfs and btrfs: nothing may be lost silently.

User-mode Linux boots Debian's kernel as a process. `kiroku record`, or `kirokud` with a room, records there on a disk
(dm-flakey) that after some seconds answers writes, or all requests, with EIO: for two seconds, or for good. The file system may end itself, become
read-only, or go on. Then the disk is well again and the machine starts anew. It holds if

- the recorder ended by itself (`kirokud`: when it was told to), and said that something failed, or the case states a gap,
- `kiroku recover` brings the case to its end, and `kiroku verify` says `intact` or `intact-with-gaps`,
- everything that the ledger had claimed to be on the disk before the fault is there byte for byte,
- segments and stated gaps together cover each stream from its beginning to the case's end.

Usage: tests/theatre/failing_disk.py [--times N] [--file-systems LIST] [--keep] [--without-flushes]
  --times N            each fault on each file system so often (1)
  --file-systems LIST  of ext4,xfs,btrfs (all three)
  --keep               leaves the homes that do not hold, and says where
  --without-flushes    the recorder forgets to flush (without_flushes.c). Loss is expected: so this test can fail

KIROKU is the program (build/release/apps/kiroku), KIROKU_UML the kernel (linux.uml of Debian's user-mode-linux).
Exit status: 0 all hold (where loss is expected: it was found), 1 otherwise, 77 a tool is not installed.
"""
import argparse
import itertools
import json
import pathlib
import shutil
import sys
import tempfile

import machine

RECORDING = ["record", "--endoscope", machine.VIDEO, "--vitals", "synthetic:patient", "--duration", "10s"]
# What dm-flakey does while the disk is "down" (Linux, Documentation/admin-guide/device-mapper/dm-flakey.rst), for how long.
FAULTS = {
    "writes fail for 2 s": ("1 error_writes", 2),
    "writes fail for good": ("1 error_writes", 0),
    "everything fails for 2 s": ("", 2),
    "everything fails for good": ("", 0),
}
ROOM = f"""
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
kind = "video"
source = "{machine.VIDEO}"
[[room.stream]]
name = "vitals"
kind = "vitals"
source = "synthetic:patient"
"""
RECORDERS = {"kiroku record": "", "kirokud": ROOM}
AFTER_CLAIMS = 6
SECOND = 1_000_000_000


def uncovered(case):
    """Of each stream of pictures or vital signs: seconds that are neither in a segment nor in a stated gap."""
    entries = [json.loads(line) for line in (case / "ledger.jsonl").read_text("utf-8").splitlines()]
    streams = [stream["name"] for stream in entries[0]["streams"] if stream["kind"] in ("video", "vitals")]
    spans = {name: sorted((entry["start_ns"], entry["end_ns"]) for entry in entries
                          if entry["type"] in ("segment", "gap") and entry["stream"] == name) for name in streams}
    last = max((end for some in spans.values() for _, end in some), default=0)
    holes = {}
    for name, some in spans.items():
        until = SECOND  # the first picture may come within a second
        hole = 0
        for begin, end in some:
            hole += max(0, begin - until)
            until = max(until, end)
        holes[name] = (hole + max(0, last - SECOND - until)) / SECOND
    return {name: hole for name, hole in holes.items() if hole > 0.001}


def told(entries, out):
    return out["status"] != 0 or any(entry["type"] == "gap" for entry in entries)


def try_fault(guest, name, fault, room, preload):
    """Problems, and a line of what came of it."""
    features, seconds = FAULTS[fault]
    disk = guest.new_disk("disk.img", name)
    out = guest.do("fail", [disk], file_system=name, command=RECORDING, after_claims=AFTER_CLAIMS, features=features,
                   seconds=seconds, room=room, preload=str(preload or ""))
    [(home, broken)] = guest.homes([disk], name)
    disk.unlink()
    if broken:
        return [f"the file system cannot be read: {broken}"], "", home
    problems = [f"{kind}: {text}" for kind, text in machine.judge(home, out["claims"])[1]]
    if not out["ended"]:
        problems.append("the recorder did not end by itself")
    if not out["failed_while_recording"]:
        problems.append("the recording was over before the disk failed, so that this says nothing")
    cases = sorted((home / "archive").glob("2*"))
    if len(cases) != 1:
        problems.append(f"{len(cases)} cases are there, not one")
    verdicts = []
    for case in cases:
        verdicts.append(machine.verdict_of(home, case, "--identity", home / "identity.txt")[0])
        entries = [json.loads(line) for line in (case / "ledger.jsonl").read_text("utf-8").splitlines()]
        if not entries:
            problems.append("the case's ledger is empty")
            continue
        if not told(entries, out):
            problems.append("the disk failed, and neither the recorder nor its case says so")
        for stream, hole in uncovered(case).items():
            problems.append(f"{stream}: {hole:.1f} s are neither recorded nor stated as a gap")
    how = f"exit status {out['status']}, then {' '.join(verdicts) or 'no case'}"
    if problems:
        problems.append(f"the recorder said: {out['told'].strip()[-600:]} {out['said'].strip()[-600:]}")
    return problems, how, home


def main():
    if any(one in ("-h", "--help") for one in sys.argv[1:]):
        print(__doc__)
        return 0
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0])
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--file-systems", default=",".join(machine.MAKE))
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--without-flushes", action="store_true")
    asked = parser.parse_args()
    wanted = machine.wanted_file_systems(asked)
    bad = tried = 0
    with tempfile.TemporaryDirectory(prefix="kiroku-theatre.") as work:
        guest = machine.Machine(pathlib.Path(work))
        preload = machine.without_flushes(guest.work) if asked.without_flushes else None
        for name in wanted:
            for fault, (recorder, room) in itertools.product(list(FAULTS) * asked.times, RECORDERS.items()):
                problems, how, home = try_fault(guest, name, fault, room, preload)
                tried += 1
                print(f"{name}, {recorder}, {fault}: {'DOES NOT HOLD' if problems else 'held'}; {how}", flush=True)
                for problem in problems:
                    print(f"  {problem}", flush=True)
                if problems:
                    bad += 1
                    if asked.keep:
                        kept = tempfile.mkdtemp(prefix=f"theatre-{name}-")
                        shutil.copytree(home, kept, dirs_exist_ok=True)
                        print(f"  the home as it is: {kept}", flush=True)
    print(f"{tried} faults, {bad} do not hold")
    if asked.without_flushes and not bad:
        print("loss was expected, and none was found: this test sees too little")
    return 1 if bool(bad) != asked.without_flushes else 0


if __name__ == "__main__":
    sys.exit(main())
