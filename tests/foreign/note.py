"""C2SP signed notes and tlog-checkpoints with Ed25519 and ECDSA, which OpenSSL signs and verifies, and ML-DSA-65 beside them."""
import base64
import ctypes
import dataclasses
import functools
import hashlib
import re
import subprocess
import tempfile

import ml_dsa

# OpenSSL's library signs and verifies by Ed25519 itself: to start its program for each of two thousand signatures takes 8 ms each.
_CRYPTO = ctypes.CDLL("libcrypto.so.3")
_ED25519 = 1087  # EVP_PKEY_ED25519
for _name in ("EVP_PKEY_new_raw_public_key", "EVP_PKEY_new_raw_private_key", "EVP_MD_CTX_new"):
    getattr(_CRYPTO, _name).restype = ctypes.c_void_p
MOST_BYTES, MOST_SIGNATURES = 131072, 100
ML_DSA_TYPE = b"\xffkiroku/ml-dsa-65"
P256_PUBLIC = bytes.fromhex("3059301306072a8648ce3d020106082a8648ce3d03010703420004")                     # SubjectPublicKeyInfo before both coordinates
P256_PRIVATE = bytes.fromhex("3041020100301306072a8648ce3d020106082a8648ce3d030107042730250201010420")  # PKCS #8 before the 32 bytes


class Malformed(ValueError):
    """What is no signed note, no checkpoint or no verifier key, and why."""


def from_base64(text):
    try:
        data = base64.b64decode(text, validate=True)
    except ValueError as e:
        raise Malformed(f"{text!r} is no base64") from e
    if base64.b64encode(data).decode() != text:
        raise Malformed(f"{text!r} is no canonical base64")
    return data


@dataclasses.dataclass(frozen=True)
class Key:
    """A verifier key: `name+hash+base64(0x01 || public key)`."""
    name: str
    public: bytes
    ml_dsa: bytes | None = dataclasses.field(default=None, compare=False)    # the ML-DSA-65 key that signs beside
    since: int = dataclasses.field(default=0, compare=False)                 # entries that the log had before it did
    hardware: bytes | None = dataclasses.field(default=None, compare=False)  # the key in hardware that signs beside, as DER
    hardware_since: int = dataclasses.field(default=0, compare=False)
    log_root_before_hardware: bytes | None = dataclasses.field(default=None, compare=False)  # of that many entries
    identity: str | None = dataclasses.field(default=None, compare=False)    # the file that says so

    @property
    def id(self):
        return hashlib.sha256(self.name.encode() + b"\n\x01" + self.public).digest()[:4]

    @property
    def ml_dsa_name(self):
        return f"{self.name}/ml-dsa-65"

    @property
    def ml_dsa_id(self):
        return hashlib.sha256(self.ml_dsa_name.encode() + b"\n" + ML_DSA_TYPE + self.ml_dsa).digest()[:4]

    @property
    def ml_dsa_text(self):
        return f"{self.ml_dsa_name}+{self.ml_dsa_id.hex()}+{base64.b64encode(ML_DSA_TYPE + self.ml_dsa).decode()}"

    @property
    def hardware_name(self):
        return f"{self.name}/ecdsa-p256"

    @property
    def hardware_id(self):
        return hashlib.sha256(self.hardware).digest()[:4]

    @property
    def hardware_text(self):
        return f"{self.hardware_name}+{self.hardware_id.hex()}+{base64.b64encode(bytes([2]) + self.hardware).decode()}"

    def by_hardware(self, checkpoint):
        """As by_ml_dsa, of the key in hardware."""
        theirs = [s for s in checkpoint.signatures if s[0] == self.hardware_name]
        if not theirs:
            return None
        return all(key == self.hardware_id and holds_ecdsa(self.hardware, checkpoint.text, signature) for _, key, signature in theirs)

    def by_all(self, checkpoint):
        """Whether every key beside Ed25519 signed it; None where a line is not there, False where one does not hold."""
        answers = [self.by_ml_dsa(checkpoint)] if self.ml_dsa else []
        answers += [self.by_hardware(checkpoint)] if self.hardware else []
        return False if False in answers else None if None in answers else True

    def by_ml_dsa(self, checkpoint):
        """Whether the ML-DSA key signed it: None where there is no such line, False where it does not hold."""
        theirs = [s for s in checkpoint.signatures if s[0] == self.ml_dsa_name]
        if not theirs:
            return None
        return all(key == self.ml_dsa_id and ml_dsa.verify(ml_dsa.ML_DSA_65, self.ml_dsa, checkpoint.text, signature) for _, key, signature in theirs)

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


def parse_ml_dsa_key(text):
    """The device's name and the public key."""
    name, key_id, data = (text.split("+", 2) + ["", ""])[:3]
    data, device = from_base64(data), name.removesuffix("/ml-dsa-65")
    if device == name or not device or len(data) != len(ML_DSA_TYPE) + ml_dsa.ML_DSA_65.key_bytes or not data.startswith(ML_DSA_TYPE):
        raise Malformed("no ML-DSA-65 key of a device")
    key = Key(device, b"", data[len(ML_DSA_TYPE):])
    if key_id != key.ml_dsa_id.hex():
        raise Malformed("the key's hash is another")
    return key.name, key.ml_dsa


def parse_hardware_key(text):
    """The device's name and the public key."""
    name, key_id, data = (text.split("+", 2) + ["", ""])[:3]
    data, device = from_base64(data), name.removesuffix("/ecdsa-p256")
    point = data[1 + len(P256_PUBLIC):]
    if device == name or not device or data[:1] != b"\2" or data[1:1 + len(P256_PUBLIC)] != P256_PUBLIC or len(point) != 64 or not on_p256(point):
        raise Malformed("no key in the hardware of a device")
    key = Key(device, b"", hardware=data[1:])
    if key_id != key.hardware_id.hex():
        raise Malformed("the key's hash is another")
    return key.name, key.hardware


def on_p256(point):
    """Whether two coordinates are a point of the curve (FIPS 186-5, SP 800-186)."""
    prime = 2**256 - 2**224 + 2**192 + 2**96 - 1
    x, y = int.from_bytes(point[:32]), int.from_bytes(point[32:])
    b = 0x5ac635d8aa3a93e7b3ebbd55769886bc651d06b0cc53b0f63bce3c3e27d2604b
    return x < prime and y < prime and (y * y - x * x * x + 3 * x - b) % prime == 0


def parse_device(text):
    """The key in a device's file: a verifier key, or an identity of several keys that all sign it."""
    if not text.startswith("kiroku/"):
        return parse_key(text.strip())
    signed, signatures = parts(text)
    lines = signed.split("\n")
    if len(lines) not in (5, 7) or not all(re.fullmatch("(0|[1-9][0-9]*)( .*)?", line) for line in lines[3::2]):
        raise Malformed("no identity of one or two keys beside Ed25519")
    key, names = dataclasses.replace(parse_key(lines[1]), identity=text), set()
    for beside, since in zip(lines[2:-1:2], lines[3::2]):
        if key.hardware or (key.ml_dsa and beside.startswith(key.ml_dsa_name + "+")):
            raise Malformed("a key twice, or keys in another order")
        since, has_root, root = since.partition(" ")
        root, is_ml_dsa = from_base64(root) if has_root else None, beside.startswith(key.ml_dsa_name + "+")
        if bool(has_root) != (not is_ml_dsa and since != "0") or (has_root and len(root) != 32):
            raise Malformed("a size of the log without its root, or a root that is none")
        if is_ml_dsa:
            name, public = parse_ml_dsa_key(beside)
            key = dataclasses.replace(key, ml_dsa=public, since=int(since))
        else:
            name, public = parse_hardware_key(beside)
            key = dataclasses.replace(key, hardware=public, hardware_since=int(since), log_root_before_hardware=root)
        names.add(name)
    note = Checkpoint(lines[0], 0, b"", signed.encode(), signatures)
    ours = [s for s in signatures if s[:2] == (key.name, key.id)]
    if names != {key.name} or lines[0] != f"kiroku/{key.name}/identity" or not ours or not holds(key.public, note.text, ours[0][2]) or not key.by_all(note):
        raise Malformed("not signed by all keys of one device")
    return key


@dataclasses.dataclass(frozen=True)
class Checkpoint:
    origin: str
    size: int
    root: bytes
    text: bytes         # what is signed
    signatures: tuple   # (name, key's hash, signature)


def parts(note):
    """The text of a signed note, and its signatures."""
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
    return text, tuple(signatures)


def parse_checkpoint(data):
    if len(data) > MOST_BYTES:
        raise Malformed("larger than 131,072 bytes")
    try:
        note = data.decode("utf-8")
    except UnicodeDecodeError as e:
        raise Malformed("no UTF-8") from e
    text, signatures = parts(note)
    lines = text.split("\n")
    if len(lines) != 4 or not lines[0] or not re.fullmatch("0|[1-9][0-9]{0,18}", lines[1]):
        raise Malformed("no checkpoint of three lines")
    root = from_base64(lines[2])
    if len(root) != 32:
        raise Malformed("the root has not 32 bytes")
    return Checkpoint(lines[0], int(lines[1]), root, text.encode(), signatures)


class _Ed25519:
    """A key of OpenSSL's library for a `with`: of the 32 bytes of a public or a private key; None in place of what is none."""

    def __init__(self, public=None, private=None):
        make, data = (_CRYPTO.EVP_PKEY_new_raw_public_key, public) if private is None else (_CRYPTO.EVP_PKEY_new_raw_private_key, private)
        self.key = ctypes.c_void_p(make(_ED25519, None, data, ctypes.c_size_t(len(data))))
        self.context = ctypes.c_void_p(_CRYPTO.EVP_MD_CTX_new())

    def __enter__(self):
        return self if self.key else None

    def __exit__(self, *_):
        _CRYPTO.EVP_MD_CTX_free(self.context)
        _CRYPTO.EVP_PKEY_free(self.key)
        _CRYPTO.ERR_clear_error()

    def verifies(self, text, signature):
        return (_CRYPTO.EVP_DigestVerifyInit(self.context, None, None, None, self.key) == 1
                and _CRYPTO.EVP_DigestVerify(self.context, signature, ctypes.c_size_t(len(signature)), text, ctypes.c_size_t(len(text))) == 1)

    def sign(self, text):
        signature, size = ctypes.create_string_buffer(64), ctypes.c_size_t(64)
        if (_CRYPTO.EVP_DigestSignInit(self.context, None, None, None, self.key) != 1
                or _CRYPTO.EVP_DigestSign(self.context, signature, ctypes.byref(size), text, ctypes.c_size_t(len(text))) != 1):
            raise RuntimeError("OpenSSL does not sign by Ed25519")
        return signature.raw[:size.value]

    @property
    def public(self):
        public, size = ctypes.create_string_buffer(32), ctypes.c_size_t(32)
        if _CRYPTO.EVP_PKEY_get_raw_public_key(self.key, public, ctypes.byref(size)) != 1:
            raise RuntimeError("OpenSSL has no public key of this private one")
        return public.raw


@functools.lru_cache(maxsize=None)
def holds(public, text, signature):
    """Whether an Ed25519 signature over `text` verifies."""
    with _Ed25519(public=public) as key:
        return key is not None and key.verifies(text, signature)


@functools.lru_cache(maxsize=None)
def holds_ecdsa(public, text, signature):
    """Whether an ECDSA signature (DER) over SHA-256 of `text` verifies."""
    with tempfile.TemporaryDirectory() as folder:
        for name, data in (("key", public), ("signature", signature)):
            with open(f"{folder}/{name}", "wb") as out:
                out.write(data)
        done = subprocess.run(["openssl", "dgst", "-sha256", "-keyform", "DER", "-verify", f"{folder}/key", "-signature", f"{folder}/signature"],
                              input=text, capture_output=True)
    return done.returncode == 0


@functools.lru_cache(maxsize=None)
def _private(seed):
    return ml_dsa.PrivateKey(ml_dsa.ML_DSA_65, seed)


@dataclasses.dataclass(frozen=True)
class Signer:
    """A device: its name, the 32 bytes of its Ed25519 private key, the seed of its ML-DSA-65 key and the 32 bytes of the key in its hardware, if any."""
    name: str
    seed: bytes
    ml_dsa_seed: bytes | None = None
    since: int = 0
    hardware_seed: bytes | None = None
    hardware_since: int = 0
    log_root_before_hardware: bytes = bytes(32)

    @functools.cached_property
    def key(self):
        with _Ed25519(private=self.seed) as own:
            key = Key(self.name, own.public)
        if self.ml_dsa_seed is not None:
            key = dataclasses.replace(key, ml_dsa=_private(self.ml_dsa_seed).public, since=self.since)
        if self.hardware_seed is not None:
            done = subprocess.run(["openssl", "pkey", "-inform", "DER", "-pubout", "-outform", "DER"], input=P256_PRIVATE + self.hardware_seed,
                                  capture_output=True, check=True)
            key = dataclasses.replace(key, hardware=done.stdout, hardware_since=self.hardware_since,
                                      log_root_before_hardware=self.log_root_before_hardware if self.hardware_since else None)
        return key

    @property
    def identity(self):
        """The key with its file, as a verifier gets it."""
        text = f"kiroku/{self.name}/identity\n{self.key}\n"
        if self.ml_dsa_seed is not None:
            text += f"{self.key.ml_dsa_text}\n{self.since}\n"
        if self.hardware_seed is not None:
            root = f" {base64.b64encode(self.log_root_before_hardware).decode()}" if self.hardware_since else ""
            text += f"{self.key.hardware_text}\n{self.hardware_since}{root}\n"
        return dataclasses.replace(self.key, identity=f"{text}\n{self.line(text.encode()).decode()}")

    @functools.lru_cache(maxsize=None)  # Ed25519 signs a text in one way
    def sign(self, text):
        with _Ed25519(private=self.seed) as key:
            return key.sign(text)

    def line(self, text):
        line = f"\u2014 {self.name} {base64.b64encode(self.key.id + self.sign(text)).decode()}\n"
        if self.ml_dsa_seed is not None:
            signature = _private(self.ml_dsa_seed).sign(text)
            line += f"\u2014 {self.key.ml_dsa_name} {base64.b64encode(self.key.ml_dsa_id + signature).decode()}\n"
        if self.hardware_seed is not None:
            line += f"\u2014 {self.key.hardware_name} {base64.b64encode(self.key.hardware_id + self.sign_by_hardware(text)).decode()}\n"
        return line.encode()

    @functools.lru_cache(maxsize=None)
    def sign_by_hardware(self, text):
        with tempfile.TemporaryDirectory() as folder:
            with open(f"{folder}/key", "wb") as out:
                out.write(P256_PRIVATE + self.hardware_seed)
            return subprocess.run(["openssl", "dgst", "-sha256", "-keyform", "DER", "-sign", f"{folder}/key"], input=text, capture_output=True, check=True).stdout

    def checkpoint(self, origin, size, root):
        """The bytes of a signed checkpoint."""
        text = f"{origin}\n{size}\n{base64.b64encode(root).decode()}\n".encode()
        return text + b"\n" + self.line(text)
