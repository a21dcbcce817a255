#!/usr/bin/env python3
"""Whether each test of tests/nightly/long_tests.txt, and the one that stays in its place, still exists.

Usage: tests/lint/long_tests.py. Exit status: 0 if so, 1 with a line for each that does not.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
LIST = ROOT / "tests/nightly/long_tests.txt"


def main():
    known = set()
    for source in (ROOT / "tests").rglob("*_test.cpp"):
        known.update(".".join(found) for found in re.findall(r"^TEST(?:_F|_P)?\((\w+),\s+(\w+)\)", source.read_text(), re.MULTILINE))
    broken = []
    for number, line in enumerate(LIST.read_text().splitlines(), 1):
        if line.startswith("#"):
            continue
        names = line.split()
        if len(names) != 2:
            broken.append(f"{LIST.relative_to(ROOT)}:{number}: a line names a test and the one that stays: '{line}'")
        broken += [f"{LIST.relative_to(ROOT)}:{number}: there is no test {name}" for name in names if name not in known]
    print("\n".join(broken) or "tests that are nightly alone: each has one that stays")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
