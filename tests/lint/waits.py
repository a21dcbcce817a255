#!/usr/bin/env python3
"""Checks that no test of C++ sleeps, but for those that must: time is moved by hand (tests/support/moved_clock.h),
and what another thread or program does is waited for (tests/support/eventually.h).

A test may sleep in a suite whose name holds "RealTime", if its file says why in a comment that begins "Real time:".
CTest runs those alone and gives them the label real-time. What plays a device in tests/support, and tests/bench, may
sleep; a test on the slow disk that is played there is of real time, too. Exit status: 0 nothing was found, 1 something was.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
MAY_SLEEP = ("tests/support/", "tests/bench/")
SLEEP = re.compile(r"\b(sleep_for|sleep_until|usleep|nanosleep)\s*\((?!.*\boverride\b)")
SLOW_DISK = re.compile(r"\bSlowFileSystem\s+\w+[({]")
TEST = re.compile(r"^(?:TYPED_)?TEST(?:_F|_P)?\(\s*(\w+)")


def problems_of(name, text):
    suite, real_time = "", False
    for number, line in enumerate(text.split("\n"), 1):
        if begun := TEST.match(line):
            suite = begun[1]
            real_time = real_time or "RealTime" in suite
        if SLEEP.search(line.split("//")[0]) and not name.startswith(MAY_SLEEP) and "RealTime" not in suite:
            yield (f"{name}:{number}: a test sleeps: move a clock by hand (tests/support/moved_clock.h), wait for what "
                   "happens (tests/support/eventually.h), or call its suite RealTime and say why")
        if SLOW_DISK.search(line) and "RealTime" not in suite:
            yield f"{name}:{number}: a test on a slow disk is of real time: call its suite RealTime and say why"
    if real_time and "// Real time:" not in text:
        yield f"{name}: tests run alone as RealTime, and no comment that begins 'Real time:' says why"


def main():
    files = subprocess.run(["git", "ls-files", "tests/*.cpp", "tests/*.h"], cwd=ROOT, capture_output=True, text=True,
                           check=True).stdout.split()
    found = [problem for name in files for problem in problems_of(name, (ROOT / name).read_text("utf-8"))]
    print("\n".join(found), end="\n" if found else "", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
