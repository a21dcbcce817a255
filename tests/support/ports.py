"""TCP ports for servers that must be told theirs before they start: as tests/support/reserved_port.h, whose locks are the same ones.

Put this folder on sys.path, and import ports.
"""
import fcntl
import os
import pathlib
import random
import socket
import tempfile

_HELD = []   # until this process ends


def reserved_port():
    """A port of 127.0.0.1 where nobody listens, and which no other test gets until this process ends. It lies below those that the system gives to
    connections, so that none of them takes it in between."""
    folder = pathlib.Path(tempfile.gettempdir()) / "kiroku-test-ports"
    folder.mkdir(exist_ok=True)
    try:
        folder.chmod(0o777)
    except PermissionError:
        pass   # another user's folder is as good
    for _ in range(1000):
        port = random.randint(20000, 32000)
        try:
            lock = os.open(folder / str(port), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except PermissionError:
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with socket.socket() as probe:
                probe.bind(("127.0.0.1", port))
        except OSError:
            os.close(lock)
            continue
        _HELD.append(lock)
        return port
    raise OSError("no port is free for a test")
