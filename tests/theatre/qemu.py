"""A whole Debian 12 in QEMU's emulator: its root file system, and a machine that boots from it and does what it is told."""
import contextlib
import hashlib
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import time

HERE = pathlib.Path(__file__).resolve().parent
TOOLS = ("qemu-system-x86_64", "qemu-img", "mmdebstrap", "mke2fs", "dpkg-deb")
BOOT_SECONDS = 400
ROOT_SIZE = "5G"
PEDAL = "usb-kbd,bus=xhci.0,id=pedal"
# Beside what the package of Kiroku depends on: an init, the kernel with vivid and snd-aloop, and what a technician has.
PACKAGES = ("systemd-sysv", "udev", "kmod", "dbus", "sudo", "iproute2", "procps", "v4l-utils", "linux-image-amd64",
            "python3", "alsa-utils", "apt")
# Loaded before the root file system is there.
EARLY_MODULES = "virtio_blk\nvirtio_pci\next4\ncrc32c_generic\n"
AGENT_UNIT = """[Unit]
Description=Does what the test on the host asks for
After=systemd-udevd.service
[Service]
ExecStart=/usr/local/sbin/agent.py
Restart=always
KillMode=process
[Install]
WantedBy=multi-user.target
"""


class TheatreError(Exception):
    """What the theatre itself could not do, or what did not come in time."""


def dependencies_of(package):
    """Names of packages; of alternatives the first."""
    fields = subprocess.run(["dpkg-deb", "-f", package, "Depends"], check=True, capture_output=True, text=True).stdout
    return sorted({re.split(r"[ (|:]", one.strip())[0] for one in fields.split(",") if one.strip()})


def debian_sources():
    """Where apt finds Debian 12, one a line: as here, or KIROKU_DEBIAN_MIRROR."""
    mirror = os.environ.get("KIROKU_DEBIAN_MIRROR")
    if mirror:
        return f"deb {mirror} bookworm main\n"
    known = subprocess.run(["apt-get", "indextargets", "--format", "$(REPO_URI) $(RELEASE)", "Origin: Debian",
                            "Component: main"], check=True, capture_output=True, text=True).stdout
    lines = {f"deb {line} main" for line in known.splitlines() if re.match(r"\S+ bookworm", line)}
    if not lines:
        raise TheatreError("apt here knows no source of Debian 12; name one: KIROKU_DEBIAN_MIRROR=ADDRESS")
    return "\n".join(sorted(lines)) + "\n"


def make_root(folder, package):
    """The root file system as `folder`/root.img, with kernel and initrd beside it. Kept until its packages change."""
    include = sorted({*PACKAGES, *dependencies_of(package)})
    recipe = hashlib.sha256(json.dumps([include, AGENT_UNIT, EARLY_MODULES, (HERE / "agent.py").read_text("utf-8"),
                                        ROOT_SIZE]).encode()).hexdigest()
    made = folder / "recipe"
    if made.exists() and made.read_text() == recipe:
        return
    made.unlink(missing_ok=True)
    tree = folder / "root"
    shutil.rmtree(tree, ignore_errors=True)
    unit = folder / "agent.service"
    unit.write_text(AGENT_UNIT)
    early = folder / "early"
    early.write_text(EARLY_MODULES)
    # Small, and made once: every kernel's hook would pack all modules of all machines.
    initramfs = '$1/etc/initramfs-tools/conf.d'
    hooks = [f"--setup-hook=mkdir -p {initramfs} && echo MODULES=list >{initramfs}/theatre",
             "--setup-hook=mkdir -p $1/usr/share/initramfs-tools/modules.d",
             f"--setup-hook=cp {early} $1/usr/share/initramfs-tools/modules.d/theatre",
             f"--customize-hook=install -D -m 755 {HERE / 'agent.py'} $1/usr/local/sbin/agent.py",
             f"--customize-hook=install -D -m 644 {unit} $1/etc/systemd/system/agent.service",
             "--customize-hook=ln -s ../agent.service $1/etc/systemd/system/multi-user.target.wants/agent.service",
             "--customize-hook=echo theatre >$1/etc/hostname",
             "--customize-hook=printf 'LABEL=root / ext4 defaults 0 1\\nLABEL=kiroku /var/lib/kiroku ext4 nofail 0 2\\n' >$1/etc/fstab",
             "--customize-hook=mkdir -p $1/cargo"]
    subprocess.run(["mmdebstrap", "--mode=root" if os.geteuid() == 0 else "--mode=unshare", "--variant=minbase",
                    f"--include={','.join(include)}", *hooks, "bookworm", str(tree), "-"],
                   input=debian_sources(), text=True, check=True)
    for name, pattern in (("vmlinuz", "vmlinuz-*"), ("initrd", "initrd.img-*")):
        shutil.copy(next((tree / "boot").glob(pattern)), folder / name)
    image = folder / "root.img"
    image.unlink(missing_ok=True)
    subprocess.run(["mke2fs", "-q", "-t", "ext4", "-L", "root", "-d", str(tree), str(image), ROOT_SIZE], check=True)
    shutil.rmtree(tree)
    made.write_text(recipe)


class Qemu:
    """One run of the machine. Every wait has an end; the console, with the journal, is kept in `folder`/console-N.log.

    `clock` is what the machine's own clock says when it begins: "utc" for the right time, or such as 2026-01-01T00:00:00.
    """

    def __init__(self, base, folder, number, disks, clock="utc"):
        self.console = folder / f"console-{number}.log"
        self.number = 0
        # Relative, as paths of sockets must be short, whatever the folder is called.
        agent, monitor = "agent", "monitor"
        for name in (agent, monitor):
            (folder / name).unlink(missing_ok=True)
        command = ["qemu-system-x86_64", "-machine", "q35", "-accel", "tcg,thread=multi,tb-size=512", "-cpu", "max",
                   "-smp", "2", "-m", "1800", "-nodefaults", "-display", "none", "-no-reboot",
                   "-kernel", str(base / "vmlinuz"), "-initrd", str(base / "initrd"), "-append",
                   "root=/dev/vda rw console=ttyS0 loglevel=4 net.ifnames=0 mitigations=off systemd.show_status=no "
                   "systemd.journald.forward_to_console=1 systemd.journald.max_level_console=info",
                   "-serial", f"file:{self.console}", "-monitor", f"unix:{monitor},server=on,wait=off",
                   "-device", "virtio-serial-pci", "-chardev", f"socket,id=agent,path={agent},server=on,wait=off",
                   "-device", "virtserialport,chardev=agent,name=agent", "-device", "virtio-rng-pci",
                   "-rtc", f"base={clock},clock=host", "-device", "qemu-xhci,id=xhci", "-device", PEDAL]
        for order, (disk, form) in enumerate(disks):
            command += ["-drive", f"file={disk},if=none,id=disk{order},format={form},cache=writeback",
                        "-device", f"virtio-blk-pci,drive=disk{order}"]
        with open(folder / f"qemu-{number}.log", "wb") as log:
            self.process = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        began = time.monotonic()
        while not ((folder / agent).exists() and (folder / monitor).exists()):
            if self.process.poll() is not None:
                raise TheatreError("QEMU ended: " + (folder / f"qemu-{number}.log").read_text(errors="replace"))
            if time.monotonic() > began + 60:
                raise TheatreError("QEMU does not begin")
            time.sleep(0.05)
        self.agent, self.monitor = socket.socket(socket.AF_UNIX), socket.socket(socket.AF_UNIX)
        with contextlib.chdir(folder):
            self.agent.connect(agent)
            self.monitor.connect(monitor)
        self.held = b""
        self._answer(BOOT_SECONDS)
        self.boot_seconds = time.monotonic() - began

    def _answer(self, seconds):
        ends = time.monotonic() + seconds
        while b"\n" not in self.held:
            left = ends - time.monotonic()
            if left <= 0:
                raise TheatreError(f"the guest has not answered for {seconds} s; its console: {self.console}")
            self.agent.settimeout(left)
            try:
                got = self.agent.recv(65536)
            except TimeoutError:
                continue
            if not got:
                raise TheatreError(f"the guest is gone; its console: {self.console}")
            self.held += got
        line, self.held = self.held.split(b"\n", 1)
        return json.loads(line)

    def run(self, command, seconds=120):
        """(exit status, output) of a command of the guest's root; the status is None where it was ended after `seconds`."""
        self.number += 1
        self.agent.sendall((json.dumps({"id": self.number, "command": command, "seconds": seconds}) + "\n").encode())
        while True:
            answer = self._answer(seconds + 60)
            if answer["id"] == self.number:
                return answer["status"], answer["out"]

    def press(self, key):
        self._tell(f"sendkey {key}")

    def unplug_pedal(self):
        self._tell("device_del pedal")

    def plug_pedal(self):
        self._tell(f"device_add {PEDAL}")

    def _tell(self, command):
        self.monitor.sendall(f"{command}\n".encode())

    def cut_power(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def switch_off(self, seconds=180):
        """True where the machine went off by itself in time."""
        self.run("systemctl poweroff --no-block", 30)
        try:
            self.process.wait(seconds)
            return True
        except subprocess.TimeoutExpired:
            self.cut_power()
            return False

    def close(self):
        if self.process.poll() is None:
            self.cut_power()

