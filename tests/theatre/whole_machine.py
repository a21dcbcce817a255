#!/usr/bin/env python3
"""A recorder as a hospital has it, from the package to the verified case, in an emulated machine.

QEMU's emulator (no KVM) boots Debian 12 with systemd. The project's own package is installed there as its message and
docs/how-to/operations.md say; a virtual camera (vivid), a USB keyboard as footswitch and a disk of its own for
recordings are there. Then everything is tried in turn: doctor, the service, the footswitch, a camera that falls silent,
errs and is unplugged, a time-stamping authority behind a bad network, a wall clock that is set, an upgrade while a case
is recorded, the end of the service with a camera that does not answer, power cuts, one of them with an empty battery,
and the end of the machine. Cases are verified inside, and outside by kiroku-verify from what lies on the disk.

Usage: tests/theatre/whole_machine.py [--package DEB] [--keep]
  --package DEB   the package (default: made from build/release by cpack; its programs must be built)
  --keep          leaves the machine's disks, and says where

The root file system is kept in build/nightly/theatre, with the console of each boot. KIROKU_DEBIAN_MIRROR names where
Debian's packages come from. Exit status: 0 all held, 1 something did not, 77 a tool is not installed.
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

import qemu

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/release"
WORK = ROOT / "build/nightly/theatre"
HOME = "/var/lib/kiroku"
METRICS = "python3 -c 'import urllib.request as u; print(u.urlopen(\"http://127.0.0.1:9464/metrics\").read().decode())'"
PASSPHRASE = "theatre of war and peace"
ROOM = """
[[room]]
name = "or-1"
resume = true

[[room.footswitch]]
device = "name:QEMU QEMU USB Keyboard"
key = 68
press = "start-stop"

[[room.stream]]
name = "endoscope"
kind = "video"
source = "/dev/video0?size=320x180"
purpose = "patient record"

[[room.stream]]
name = "vitals"
kind = "vitals"
source = "synthetic:patient"

[daemon]
listen = "127.0.0.1:9464"
"""
AUTHORITY = """
[[authority]]
name = "site"
url = "http://127.0.0.1:3161"
connect_timeout = "2s"
total_timeout = "4s"
"""


class Failed(Exception):
    """Something of Kiroku's did not hold."""


def must(held, sentence):
    if not held:
        raise Failed(sentence)


class Theatre:
    """The machine, and what the steps share."""

    def __init__(self, folder, disks):
        self.folder, self.disks, self.boots, self.guest = folder, disks, 0, None
        self.cases = {}  # verdict that each must have, by name of the case

    def boot(self, clock="utc"):
        self.boots += 1
        self.guest = qemu.Qemu(WORK, self.folder, self.boots, self.disks, clock)

    def need(self, command, seconds=120):
        status, out = self.guest.run(command, seconds)
        how = f"not done after {seconds} s" if status is None else f"exit status {status}"
        must(status == 0, f"`{command}`: {how}: {out[-2500:]}")
        return out

    def until(self, what, seconds, holds):
        """Waits for what `holds` gives; the first that is true, None or False being not."""
        ends = time.monotonic() + seconds
        while True:
            found = holds()
            if found:
                return found
            if time.monotonic() > ends:
                raise Failed(f"{what}: not within {seconds} s; {self.journal()}")
            time.sleep(0.5)

    def journal(self):
        return "journal: " + self.guest.run("journalctl -u kirokud -b --no-pager -o cat | tail -25", 60)[1]

    def room(self):
        status, out = self.guest.run(f"kiroku status --home {HOME} --json", 30)
        try:
            return json.loads(out)["rooms"][0] if status == 0 else {}
        except (ValueError, LookupError):
            return {}

    def stream(self):
        return next((one for one in self.room().get("streams", []) if one["name"] == "endoscope"), {})

    def footswitch(self):
        return (self.room().get("footswitches") or [{}])[0]

    def frames_rise(self, seconds=60):
        before = self.stream().get("frames", 0)
        self.until("pictures come", seconds, lambda: self.stream().get("frames", 0) > before)

    def recording(self, seconds=60):
        room = self.until("a case begins", seconds, lambda: (lambda room: room if room.get("state") == "recording" else None)(self.room()))
        return room["case"]

    def idle(self, seconds=90):
        self.until("the case ends", seconds, lambda: self.room().get("state") == "idle")

    def camera(self, control, value=1):
        self.need(f"v4l2-ctl -d /dev/video0 -c {control}={value}", 30)

    def rest(self):
        """After a step that did not hold, so that the next ones say something of their own."""
        self.guest.run("tc qdisc del dev lo root; v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=0; systemctl start kirokud", 150)
        self.guest.run(f"kiroku case stop --home {HOME}", 150)

    def entries(self, case):
        return [json.loads(line) for line in self.need(f"cat {HOME}/archive/{case}/ledger.jsonl").splitlines()]

    def verdict(self, case, *good):
        """Verifies inside, everything decrypted and decoded."""
        status, out = self.guest.run(f"KIROKU_PASSPHRASE='{PASSPHRASE}' kiroku verify --home {HOME} --identity /media/stick-a/surgeon.txt "
                                     f"--json {HOME}/archive/{case}", 300)
        try:
            report = json.loads(out)
        except ValueError:
            raise Failed(f"verify of {case}: {status} {out[-2000:]}") from None
        must(report["verdict"] in good, f"{case} is {report['verdict']}: {json.dumps(report['findings'])[:3000]}")
        self.cases[case] = good


def install(theatre):
    """The package; what it says; what it brought."""
    theatre.need("mkdir -p /cargo && mount -o ro /dev/vdc /cargo")
    theatre.need(f"mountpoint {HOME}")
    said = theatre.need("DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends /cargo/kiroku.deb", 400)
    for line in ("kiroku init --home", "kirokud --check", "systemctl start kirokud"):
        must(line in said, f"the package's message does not tell of '{line}': {said[-1500:]}")
    for file in ("bin/kiroku", "bin/kirokud", "bin/kiroku-verify", "libexec/kiroku/await-home", "libexec/kiroku/kiroku-decoder", "libexec/kiroku/kiroku-full",
                 "libexec/kiroku/kiroku-media", "libexec/kiroku/kiroku-sim", "share/kiroku/web/index.html", "share/doc/kiroku/README.md"):
        theatre.need(f"test -s /usr/{file}")
    theatre.need("systemctl is-enabled kirokud kiroku-retention.timer kiroku-evidence.timer kiroku-witness.timer")
    must(theatre.guest.run("systemctl is-failed kirokud")[0] != 0, "without a home the service counts as failed")
    # Somebody who starts it all the same, or starts the machine anew, is told, and it goes on asking.
    theatre.need("systemctl start --no-block kirokud")
    theatre.until("it says that there is no home", 60, lambda: f"there is no {HOME}/device.pub" in theatre.guest.run("journalctl -q -u kirokud -p err")[1])
    must(theatre.need("systemctl show -p ActiveState --value kirokud").strip() == "activating", "without a home it gives up")
    theatre.need("systemctl stop kirokud", 60)


def initialise(theatre):
    """A home on the recordings' disk, with lost+found in it, by the commands of the message."""
    theatre.need("for s in a b; do install -d -o kiroku -m 700 /media/stick-$s; done")
    theatre.need(f"sudo -u kiroku env KIROKU_PASSPHRASE='{PASSPHRASE}' kiroku init --home {HOME} --new-identity /media/stick-a/surgeon.txt "
                 "--new-identity /media/stick-b/archive.txt", 200)
    theatre.need(f"cat >>{HOME}/kiroku.toml <<'END'\n{ROOM}\nEND")
    theatre.need(f"sed -i 's/^bit_rate = .*/bit_rate = \"1M\"/; s/^stamp_every = .*/stamp_every = \"10s\"/' {HOME}/kiroku.toml")
    # An authority that is not the recorder's own, so that a network lies before it.
    theatre.need("kiroku init --demo --home /srv/authority && systemd-run --unit authority kiroku tsa serve --home /srv/authority")
    theatre.need(f"cat >>{HOME}/kiroku.toml <<'END'\n{AUTHORITY}\nEND\ncat /srv/authority/own-authority.pem >>{HOME}/own-authority.pem")
    theatre.need("sudo -u kiroku kirokud --check")
    theatre.need("modprobe vivid n_devs=1 && udevadm settle && test -e /dev/video0")


def doctor(theatre):
    """As documented; then with the service's groups, where every source must be good."""
    out = theatre.guest.run(f"sudo -u kiroku kiroku doctor --home {HOME}", 120)[1]
    must("look at cable" not in out, f"where only the group lacks, doctor speaks of cables: {out}")
    for group in ("video", "input"):
        must(group in out, f"doctor does not name the group '{group}': {out}")
    status, out = theatre.guest.run("systemd-run --quiet --wait --pipe -p User=kiroku -p 'SupplementaryGroups=video input' "
                                    f"kiroku doctor --home {HOME}", 120)
    must("source or-1/endoscope: 320x180" in out, f"doctor ({status}) does not find the camera: {out}")
    must("footswitch" in out and "WARNING  footswitch" not in out and "BAD" not in out, f"doctor ({status}): {out}")


def service(theatre):
    """systemd starts it, and holds it."""
    theatre.need("systemctl start kirokud", 120)
    theatre.until("the service answers", 60, lambda: theatre.room().get("state") == "idle")
    must(theatre.footswitch()["well"], f"the footswitch is not well: {theatre.footswitch()}")


def page(theatre):
    """The viewer serves the page that the package brought."""
    theatre.need(f"systemd-run --quiet --unit viewer -p User=kiroku kiroku view --home {HOME} --listen 127.0.0.1:8443")
    fetch = ("python3 -c 'import re, ssl, urllib.request as u; c = ssl._create_unverified_context(); a = \"https://127.0.0.1:8443/\"; "
             "p = u.urlopen(a, context=c).read().decode(); print(len(u.urlopen(a + re.search(r\"assets/[^ ]*?[.]js\", p)[0], context=c).read()))'")
    theatre.until("the viewer gives its page", 60, lambda: theatre.guest.run(fetch, 30)[0] == 0)
    theatre.need("systemctl stop viewer", 60)


def footswitch_and_camera(theatre):
    """A foot begins a case; the camera falls silent, errs, is unplugged; so is the footswitch; a foot ends it."""
    theatre.guest.press("f10")
    case = theatre.recording()
    theatre.frames_rise()
    theatre.camera("percentage_of_dropped_buffers", 100)
    theatre.until("silence is noticed", 60, lambda: theatre.stream() and not theatre.stream()["live"])
    metrics = theatre.need(METRICS)
    must('kiroku_stream_live{room="or-1",stream="endoscope"} 0' in metrics, "the metrics do not tell of the silence")
    theatre.camera("percentage_of_dropped_buffers", 0)
    theatre.frames_rise()
    for fault in ("inject_vidioc_qbuf_error", "inject_fatal_streaming_error", "disconnect"):
        theatre.camera(fault)
        theatre.frames_rise()
    theatre.guest.unplug_pedal()
    theatre.until("the footswitch is missed", 30, lambda: not theatre.footswitch().get("well", True))
    theatre.guest.plug_pedal()
    theatre.until("the footswitch is found again", 20, lambda: theatre.footswitch().get("well"))
    theatre.guest.press("f10")
    theatre.idle()
    theatre.verdict(case, "intact-with-gaps")
    gaps = [entry for entry in theatre.entries(case) if entry["type"] == "gap" and entry["stream"] == "endoscope"]
    must(len(gaps) >= 2, f"silence and unplugging are {len(gaps)} gaps")


def bad_network_and_clock(theatre):
    """The authority is away, then comes back, while the wall clock is set ahead and back."""
    theatre.need("tc qdisc add dev lo root netem delay 100ms && modprobe sch_netem; tc qdisc show dev lo")
    theatre.need(f"kiroku case start --home {HOME}", 60)
    case = theatre.recording()
    kinds = lambda kind: [entry for entry in theatre.entries(case) if entry["type"] == kind]
    theatre.until("a token over a slow network", 60, lambda: any(entry["authority"] == "site" for entry in kinds("token")))
    theatre.need("tc qdisc change dev lo root netem loss 100%")
    theatre.until("a missed token is stated", 90, lambda: any(entry["authority"] == "site" for entry in kinds("token-missed")))
    theatre.need("tc qdisc change dev lo root netem delay 20ms 10ms loss 5%")
    for step in ("+1 hour", "-1 hour"):
        before = len(kinds("clock"))
        theatre.need(f"date -s '{step}'")
        theatre.until(f"the clock's step of {step} is stated", 60,
                      lambda: any(abs(abs(entry.get("step_ns", 0)) - 3.6e12) < 60e9 for entry in kinds("clock")[before:]))
    theatre.frames_rise()
    tokens = len(kinds("token"))
    theatre.until("tokens come again", 180, lambda: any(entry["authority"] == "site" for entry in kinds("token")[tokens:]))
    theatre.need(f"kiroku case stop --home {HOME}", 120)
    theatre.idle()
    theatre.need("tc qdisc del dev lo root")
    theatre.verdict(case, "intact", "intact-with-gaps")


def upgrade(theatre):
    """An upgrade cuts no case; the new version comes after it."""
    theatre.need(f"kiroku case start --home {HOME}", 60)
    case = theatre.recording()
    before = theatre.need("systemctl show -p MainPID --value kirokud")
    theatre.need("DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends /cargo/kiroku-newer.deb", 400)
    theatre.frames_rise()
    must(theatre.need("systemctl show -p MainPID --value kirokud") == before, "the upgrade restarted a recorder that was recording")
    must(theatre.room().get("case") == case, "the upgrade cut the case")
    # A camera that is opened anew takes the decoder that now lies on the disk.
    theatre.camera("inject_fatal_streaming_error")
    theatre.frames_rise()
    theatre.need(f"kiroku case stop --home {HOME}", 120)
    theatre.until("the new version runs", 90, lambda: theatre.need("systemctl show -p MainPID --value kirokud") not in (before, "0\n")
                  and theatre.room().get("state") == "idle")
    theatre.verdict(case, "intact", "intact-with-gaps")


def stop_with_a_silent_camera(theatre):
    """`systemctl stop` comes to its end though the camera's driver gives nothing."""
    theatre.need(f"kiroku case start --home {HOME}", 60)
    case = theatre.recording()
    theatre.frames_rise()
    theatre.camera("percentage_of_dropped_buffers", 100)
    theatre.until("silence is noticed", 60, lambda: theatre.stream() and not theatre.stream()["live"])
    theatre.need("systemctl stop kirokud", 90)
    must(theatre.need("systemctl show -p Result --value kirokud").strip() == "success", "systemd had to kill the service")
    theatre.camera("percentage_of_dropped_buffers", 0)
    theatre.verdict(case, "intact-with-gaps")
    theatre.need("systemctl start kirokud", 120)
    theatre.until("the service answers", 60, lambda: theatre.room().get("state") == "idle")


def power_cut(theatre):
    """The power is cut while a case is recorded; after the boot the service closes it and carries it on."""
    theatre.need("echo vivid >/etc/modules-load.d/theatre.conf; sync")
    theatre.need(f"kiroku case start --home {HOME}", 60)
    case = theatre.recording()
    theatre.until("some seconds are recorded", 60, lambda: theatre.stream().get("segments", 0) >= 3)
    theatre.guest.cut_power()
    theatre.boot()
    theatre.until("the service answers after the power cut", 120, lambda: theatre.room().get("state"))
    following = theatre.recording(120)
    must(following != case, "the case that was cut off goes on under its own name")
    must(theatre.room().get("carries_on") == case, f"the new case does not say what it carries on; {theatre.journal()}")
    theatre.frames_rise()
    theatre.guest.press("f10")
    theatre.idle()
    for one in (case, following):
        theatre.verdict(one, "intact-with-gaps", "intact")


def empty_battery(theatre):
    """The power is cut, and the machine's clock comes back a year behind: nobody knows how long ago the cut was."""
    theatre.need(f"kiroku case start --home {HOME}", 60)
    case = theatre.recording()
    theatre.until("some seconds are recorded", 60, lambda: theatre.stream().get("segments", 0) >= 3)
    theatre.guest.cut_power()
    theatre.boot(time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(time.time() - 365 * 86400)))
    theatre.until("the service answers with a wrong clock", 120, lambda: theatre.room().get("state") == "idle")
    must('kiroku_room_not_resumed{room="or-1"} 1' in theatre.need(METRICS), "the metrics do not tell that the case is not carried on")
    # The technician sets the clock; from then on all is as before.
    theatre.need(f"date -u -s @{time.time():.0f}")
    theatre.need("systemctl restart kirokud", 120)
    theatre.until("the service answers with the right clock", 120, lambda: theatre.room().get("state") == "idle")
    theatre.need(f"kiroku case start --home {HOME}", 60)
    following = theatre.recording()
    theatre.frames_rise()
    theatre.need(f"kiroku case stop --home {HOME}", 120)
    theatre.idle()
    theatre.verdict(following, "intact", "intact-with-gaps")
    theatre.verdict(case, "intact-with-gaps")


def switch_off(theatre):
    """The machine is switched off while a case is recorded: the case is closed."""
    theatre.need(f"kiroku case start --home {HOME}", 60)
    case = theatre.recording()
    theatre.frames_rise()
    must(theatre.guest.switch_off(), "the machine does not switch itself off within three minutes")
    theatre.cases[case] = ("intact", "intact-with-gaps")


def judged_outside(home, case):
    """Verdict, and all that was said, of a case by keys and roots alone."""
    verified = subprocess.run([BUILD / "apps/kiroku-verify", "--json", "--device", home / "device.pub", "--own-authority",
                               home / "own-authority.pem", home / "archive" / case], capture_output=True, text=True, check=False)
    try:
        return json.loads(verified.stdout)["verdict"], verified.stdout
    except ValueError:
        return "none", verified.stdout + verified.stderr


def outside(theatre):
    """What lies on the disk, judged on another machine."""
    disk, _ = theatre.disks[1]
    checked = subprocess.run(["e2fsck", "-fy", disk], capture_output=True, text=True, check=False)
    must(checked.returncode in (0, 1), f"the recordings' disk: {checked.stdout[-1000:]}")
    found = theatre.folder / "outside"
    found.mkdir()
    subprocess.run(["debugfs", "-R", f"rdump / {found}", disk], capture_output=True, check=True)
    cases = sorted(folder.name for folder in (found / "archive").glob("2*"))
    must(set(theatre.cases) <= set(cases), f"cases are missing: {set(theatre.cases) - set(cases)}")
    for case in cases:
        good = theatre.cases.get(case, ("intact", "intact-with-gaps"))
        verdict, said = judged_outside(found, case)
        must(verdict in good, f"{case} is {verdict} outside: {said[:3000]}")
    # So that this can fail: one bit of a picture.
    segment = max((found / "archive" / cases[-1] / "segments/endoscope").iterdir())
    with open(segment, "r+b") as file:
        file.seek(segment.stat().st_size // 2)
        byte = file.read(1)[0]
        file.seek(-1, os.SEEK_CUR)
        file.write(bytes([byte ^ 1]))
    must(judged_outside(found, cases[-1])[0] == "tampered", "a changed bit in a picture goes unnoticed outside")


STEPS = (install, initialise, doctor, service, page, footswitch_and_camera, bad_network_and_clock, upgrade,
         stop_with_a_silent_camera, power_cut, empty_battery, switch_off, outside)
NEEDED = (install, initialise, doctor, service)  # where one of them does not hold, nothing can be said of the others


def make_package(folder):
    subprocess.run(["cpack", "-G", "DEB", "--config", BUILD / "CPackConfig.cmake", "-B", folder / "pkg"], check=True,
                   stdout=subprocess.DEVNULL)
    return next((folder / "pkg").glob("*.deb"))


def newer(package, folder):
    """The same programs as a package of a newer version."""
    tree = folder / "newer"
    subprocess.run(["dpkg-deb", "-R", package, tree], check=True)
    control = tree / "DEBIAN/control"
    control.write_text(re.sub(r"^Version: .*$", "Version: 99.0", control.read_text(), flags=re.MULTILINE))
    subprocess.run(["dpkg-deb", "--root-owner-group", "-Zgzip", "-b", tree, folder / "cargo/kiroku-newer.deb"], check=True,
                   stdout=subprocess.DEVNULL)
    shutil.rmtree(tree)


def main():
    if any(one in ("-h", "--help") for one in sys.argv[1:]):
        print(__doc__)
        return 0
    parser = argparse.ArgumentParser(usage=__doc__.split("Usage: ")[1].split("\n")[0])
    parser.add_argument("--package", type=pathlib.Path)
    parser.add_argument("--keep", action="store_true")
    asked = parser.parse_args()
    os.environ["PATH"] += ":/usr/sbin:/sbin"
    for tool in (*qemu.TOOLS, "e2fsck", "debugfs", "cpack"):
        if shutil.which(tool) is None:
            print(f"{tool} is not installed (deploy/dependencies, group nightly)")
            return 77
    if not os.access(BUILD / "apps/kirokud", os.X_OK):
        sys.exit(f"no programs in {BUILD}/apps: run deploy/test, or cmake --preset release && cmake --build --preset release, first")
    WORK.mkdir(parents=True, exist_ok=True)
    folder = pathlib.Path(tempfile.mkdtemp(prefix="run-", dir=WORK))
    failed = []
    try:
        package = asked.package or make_package(folder)
        began = time.monotonic()
        qemu.make_root(WORK, package)
        print(f"the root file system: {time.monotonic() - began:.0f} s", flush=True)
        (folder / "cargo").mkdir()
        shutil.copy(package, folder / "cargo/kiroku.deb")
        newer(package, folder)
        for label, size, source in (("cargo", "1G", ["-d", folder / "cargo"]), ("kiroku", "1G", [])):
            subprocess.run(["mke2fs", "-q", "-t", "ext4", "-L", label, *source, folder / f"{label}.img", size], check=True,
                           stdout=subprocess.DEVNULL)
        subprocess.run(["qemu-img", "create", "-q", "-f", "qcow2", "-b", WORK / "root.img", "-F", "raw", folder / "root.qcow2"], check=True)
        theatre = Theatre(folder, [(folder / "root.qcow2", "qcow2"), (folder / "kiroku.img", "raw"), (folder / "cargo.img", "raw")])
        try:
            theatre.boot()
            print(f"boot: {theatre.guest.boot_seconds:.0f} s", flush=True)
            for step in STEPS:
                began = time.monotonic()
                try:
                    step(theatre)
                    print(f"{step.__name__}: held, {time.monotonic() - began:.0f} s", flush=True)
                except Failed as why:
                    failed.append(step.__name__)
                    print(f"{step.__name__}: DOES NOT HOLD, {time.monotonic() - began:.0f} s: {why}", flush=True)
                    if step in NEEDED:
                        break
                    if theatre.guest.process.poll() is None:
                        theatre.rest()
        except qemu.TheatreError as why:
            failed.append("the theatre itself")
            print(f"the theatre itself failed: {why}", flush=True)
        finally:
            if theatre.guest:
                theatre.guest.close()
    finally:
        for console in folder.glob("console-*.log"):
            shutil.copy(console, WORK)
        if asked.keep:
            print(f"the disks: {folder}")
        else:
            shutil.rmtree(folder)
    print(f"{len(STEPS)} steps, {len(failed)} do not hold{': ' + ', '.join(failed) if failed else ''}; consoles: {WORK}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
