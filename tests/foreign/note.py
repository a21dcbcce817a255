"""C2SP signed notes and tlog-checkpoints with Ed25519; `openssl` signs and verifies."""
import base64
import binascii
import dataclasses
import functools
import hashlib
import re
import subprocess
import tempfile

_PUBLIC = bytes.fromhex("302a300506032b6570032100")           # SubjectPublicKeyInfo of Ed25519 before the 32 bytes
_PRIVATE = bytes.fromhex("302e020100300506032b657004220420")  # PKCS #8 of Ed25519 before the 32 bytes
MOST_BYTES, MOST_SIGNATURES = 131072, 100


class Malformed(ValueError):
    """What is no signed note, no checkpoint or no verifier key, and why."""


def from_base64(text):
    try:
        data = base64.b64decode(text, validate=True)
    except binascii.Error as e:
        raise Malformed(f"{text!r} is no base64") from e
    if base64.b64encode(data).decode() != text:
        raise Malformed(f"{text!r} is no canonical base64")
    return data


@dataclasses.dataclass(frozen=True)
class Key:
    """A verifier key: `name+hash+base64(0x01 || public key)`."""
    name: str
    public: bytes

    @property
    def id(self):
        return hashlib.sha256(self.name.encode() + b"\n\x01" + self.public).digest()[:4]

    def __str__(self):
        return f"{self.name}+{self.id.hex()}+{base64.b64encode(bytes([1]) + self.public).decode()}"


def parse_key(text):
    parts = text.split("+", 2)
    if len(parts) != 3 or not parts[0] or re.search(r"[\s+]", parts[0]):
        raise Malformed("no verifier key")
    data = from_base64(parts[2])
    if len(data) != 33 or data[0] != 1:
        raise Malformed("no Ed25519 key")
    key = Key(parts[0], data[1:])
    if parts[1] != key.id.hex():
        raise Malformed("the key's hash is another")
    return key


@dataclasses.dataclass(frozen=True)
class Checkpoint:
    origin: str
    size: int
    root: bytes
    text: bytes         # what is signed
    signatures: tuple   # (name, key's hash, signature)


def parse_checkpoint(data):
    if len(data) > MOST_BYTES:
        raise Malformed("larger than 131,072 bytes")
    try:
        note = data.decode("utf-8")
    except UnicodeDecodeError as e:
        raise Malformed("no UTF-8") from e
    if re.search(r"[\x00-\x09\x0b-\x1f]", note) or "\n\n" not in note or not note.endswith("\n"):
        raise Malformed("no signed note")
    text, signatures = note[:note.rindex("\n\n") + 1], []
    for line in note[len(text) + 1:-1].split("\n"):
        found = re.fullmatch("\u2014 ([^\\s+]+) (\\S+)", line)
        if not found:
            raise Malformed(f"{line!r} is no signature line")
        blob = from_base64(found[2])
        if len(blob) < 5:
            raise Malformed("a signature is too short")
        signatures.append((found[1], blob[:4], blob[4:]))
    if len(signatures) > MOST_SIGNATURES or len({s[:2] for s in signatures}) != len(signatures):
        raise Malformed("more than 100 signatures, or two of one key")
    lines = text.split("\n")
    if len(lines) != 4 or not lines[0] or not re.fullmatch("0|[1-9][0-9]{0,18}", lines[1]):
        raise Malformed("no checkpoint of three lines")
    root = from_base64(lines[2])
    if len(root) != 32:
        raise Malformed("the root has not 32 bytes")
    return Checkpoint(lines[0], int(lines[1]), root, text.encode(), tuple(signatures))


@functools.lru_cache(maxsize=None)
def holds(public, text, signature):
    """Whether an Ed25519 signature over `text` verifies."""
    with tempfile.TemporaryDirectory() as folder:
        for name, data in (("key", _PUBLIC + public), ("text", text), ("signature", signature)):
            with open(f"{folder}/{name}", "wb") as out:
                out.write(data)
        done = subprocess.run(["openssl", "pkeyutl", "-verify", "-pubin", "-inkey", f"{folder}/key", "-keyform", "DER", "-rawin",
                               "-in", f"{folder}/text", "-sigfile", f"{folder}/signature"], capture_output=True)
    return done.returncode == 0


@dataclasses.dataclass(frozen=True)
class Signer:
    """A device: its name and the 32 bytes of its Ed25519 private key."""
    name: str
    seed: bytes

    @functools.cached_property
    def key(self):
        done = subprocess.run(["openssl", "pkey", "-inform", "DER", "-pubout", "-outform", "DER"], input=_PRIVATE + self.seed, capture_output=True, check=True)
        return Key(self.name, done.stdout[-32:])

    @functools.lru_cache(maxsize=None)  # Ed25519 signs a text in one way
    def sign(self, text):
        with tempfile.TemporaryDirectory() as folder:
            for name, data in (("key", _PRIVATE + self.seed), ("text", text)):
                with open(f"{folder}/{name}", "wb") as out:
                    out.write(data)
            return subprocess.run(["openssl", "pkeyutl", "-sign", "-inkey", f"{folder}/key", "-keyform", "DER", "-rawin", "-in", f"{folder}/text"],
                                  capture_output=True, check=True).stdout

    def line(self, text):
        return f"\u2014 {self.name} {base64.b64encode(self.key.id + self.sign(text)).decode()}\n".encode()

    def checkpoint(self, origin, size, root):
        """The bytes of a signed checkpoint."""
        text = f"{origin}\n{size}\n{base64.b64encode(root).decode()}\n".encode()
        return text + b"\n" + self.line(text)
