#!/usr/bin/env python3
"""What systemd makes of the units: a disk that comes late, or a home that is missing, keeps nothing away without a word. No service is started.

Usage: tests/system/units_test.py SOURCE-FOLDER

Exit status: 0 everything holds, 1 something does not, 77 systemd is not installed.
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time

SYSTEMD = "/lib/systemd/systemd"
NOBODY = 65534
DISKS = ("var-lib-kiroku.mount", "var-lib-kiroku-archive.mount")
# What runs all the time, and what a timer calls: that one comes again by itself.
GO_ON = ("kirokud", "kiroku-ship", "kiroku-report", "kiroku-planning", "kiroku-training")
COME_AGAIN = ("kiroku-evidence", "kiroku-retention", "kiroku-witness")
OF_THE_FLEET = ("kiroku-fleet-serve", "kiroku-fleet-index", "kiroku-fleet-verify", "kiroku-fleet-renew")


def require(condition, sentence):
    if not condition:
        sys.exit(f"FAILED: {sentence}")


def loaded(folder, name):
    """The unit as systemd understands it: {field: [value, ...]}, and what it says of files."""
    as_nobody = {"user": NOBODY, "group": NOBODY, "extra_groups": []} if os.getuid() == 0 else {}
    done = subprocess.run([SYSTEMD, "--test", "--system", f"--unit={name}.service"], capture_output=True, text=True, timeout=120, **as_nobody,
                          env={**os.environ, "SYSTEMD_UNIT_PATH": f"{folder}:", "SYSTEMD_LOG_LEVEL": "info", "SYSTEMD_LOG_TARGET": "console"})
    text = done.stdout + done.stderr
    # The same unit stands among the jobs, too.
    part = re.search(rf"^\s*-> Unit {re.escape(name)}\.service:\n(.*?)(?=^\s*-> )", text, re.M | re.S)
    require(part, f"systemd does not load {name}: {text[-2000:]}")
    fields = {}
    for line in part[1].splitlines():
        field, _, value = line.strip().partition(": ")
        fields.setdefault(field, []).append(value.split(" (origin")[0])
    complaints = [line for line in text.splitlines() if f"{name}.service:" in line and re.search(r"Unknown|ignoring|Failed to parse", line)]
    return fields, complaints


def of_units(folder):
    units = {name: loaded(folder, name) for name in (*GO_ON, *COME_AGAIN, *OF_THE_FLEET, "kiroku-awake")}
    for name, (fields, complaints) in units.items():
        require(fields["Unit Load State"] == ["loaded"] and not complaints, f"{name}: {complaints}")
    for name in GO_ON:
        fields = units[name][0]
        for disk in DISKS:
            require(disk in fields["Wants"] and disk in fields["After"], f"{name} does not wait for {disk}")
            # A start that fails for what it requires is never tried again.
            require(disk not in fields["Requires"], f"{name} requires {disk}")
        require(not [field for field in fields if field.startswith(("Condition", "Assert"))], f"{name} has a condition")
        require(fields["Restart"][0] in ("always", "on-failure"), f"{name} is not started again")
    for name in COME_AGAIN:
        require(set(DISKS) <= set(units[name][0]["Requires"]), f"{name} goes to work without its disks")
    for name in OF_THE_FLEET:
        require(not [field for field in units[name][0] if field.startswith(("Condition", "Assert"))], f"{name} has a condition")
    # Its condition is looked at when the recorder has started, and so has its home.
    require("kirokud.service" in units["kiroku-awake"][0]["After"], "kiroku-awake asks for a home before kirokud has one")
    require("kiroku-awake.service" in units["kirokud"][0]["Wants"], "nothing keeps the machine awake")


def of_a_home(source, folder):
    script, file = source / "deploy/systemd/await-home", folder / "device.pub"
    began = time.monotonic()
    done = subprocess.run([script, file, "1"], capture_output=True, text=True, timeout=60)
    require(done.returncode == 1 and time.monotonic() - began >= 1, f"without a home: {done}")
    require(done.stderr.startswith(f"<3>there is no {file}: is the disk") and done.stderr.count("\n") == 1, f"without a home it says {done.stderr}")
    threading.Timer(0.5, file.touch).start()
    done = subprocess.run([script, file, "60"], capture_output=True, text=True, timeout=60)
    require(done.returncode == 0, f"a home that comes: {done}")
    done = subprocess.run([script, file], capture_output=True, text=True, timeout=60)
    require(done.returncode == 0 and not done.stderr, f"a home that is there: {done}")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    source = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        of_a_home(source, folder)
        if not os.access(SYSTEMD, os.X_OK):
            print("SKIPPED: systemd is not installed")
            sys.exit(77)
        units = folder / "units"
        units.mkdir()
        for unit in (source / "deploy/systemd").glob("*.service"):
            shutil.copy(unit, units)
        for disk, where in zip(DISKS, ("/var/lib/kiroku", "/var/lib/kiroku/archive")):
            (units / disk).write_text(f"[Mount]\nWhat=/dev/disk/by-label/{disk}\nWhere={where}\n", encoding="utf-8")
        for each in (folder, units):
            each.chmod(0o755)
        of_units(units)


if __name__ == "__main__":
    main()
