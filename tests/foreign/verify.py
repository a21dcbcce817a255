#!/usr/bin/env python3
"""Judges a case, an excerpt or an appliance log by docs/reference/format.md, and prints verdict and codes as one JSON object.

Usage: verify.py FOLDER [--device FILE]... [--trust PEM]... [--own-authority PEM]... [--log DIR] [--against NOTE]... [--proof FILE] [--as-log]
"""
import argparse
import json
import pathlib
import sys

import case_verifier
import log_verifier
import note
from verifier import Trust


def main():
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=pathlib.Path)
    asked.add_argument("--device", type=pathlib.Path, action="append", default=[])
    asked.add_argument("--trust", type=pathlib.Path, action="append", default=[])
    asked.add_argument("--own-authority", type=pathlib.Path, action="append", default=[])
    asked.add_argument("--against", type=pathlib.Path, action="append", default=[])
    asked.add_argument("--log", type=pathlib.Path)
    asked.add_argument("--proof", type=pathlib.Path)
    asked.add_argument("--as-log", action="store_true")
    asked = asked.parse_args()
    trust = Trust(tuple(note.parse_device(path.read_text()) for path in asked.device), "".join(path.read_text() for path in asked.trust),
                  "".join(path.read_text() for path in asked.own_authority), asked.log, tuple(asked.against), asked.proof)
    judgement = (log_verifier.verify_log if asked.as_log else case_verifier.verify_case)(asked.folder, trust)
    print(json.dumps({"verdict": judgement.verdict, "codes": sorted(judgement.codes), "findings": judgement.findings}))


if __name__ == "__main__":
    sys.exit(main())
