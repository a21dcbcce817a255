"""age v1 files for X25519 recipients (C2SP age): sealed here, opened here. RFC 7748, RFC 8439 and RFC 5869 in plain Python.

For small files of tests: nothing here is fast, and nothing hides the time that a secret takes.
"""
import base64
import dataclasses
import hmac
import os
import struct

CHUNK = 65536
_P = 2**255 - 19
_ALPHABET = "qpzry9x8gf2tvdw0s3jn54khce6mua7l"


def x25519(scalar, point):
    """RFC 7748, section 5."""
    k = int.from_bytes(scalar, "little") & ~7 & (1 << 255) - 1 | 1 << 254
    u = int.from_bytes(point, "little") & (1 << 255) - 1
    x2, z2, x3, z3, swap = 1, 0, u, 1, 0
    for bit in range(254, -1, -1):
        now = k >> bit & 1
        if swap ^ now:
            x2, x3, z2, z3 = x3, x2, z3, z2
        swap = now
        a, b, c, d = x2 + z2, x2 - z2, x3 + z3, x3 - z3
        aa, bb, da, cb = a * a % _P, b * b % _P, d * a % _P, c * b % _P
        e = aa - bb
        x3, z3 = (da + cb) ** 2 % _P, u * (da - cb) ** 2 % _P
        x2, z2 = aa * bb % _P, e * (aa + 121665 * e) % _P
    if swap:
        x2, z2 = x3, z3
    return (x2 * pow(z2, _P - 2, _P) % _P).to_bytes(32, "little")


BASE_POINT = (9).to_bytes(32, "little")


def _block(key, counter, nonce):
    """RFC 8439, section 2.3."""
    state = [0x61707865, 0x3320646e, 0x79622d32, 0x6b206574, *struct.unpack("<8I", key), counter, *struct.unpack("<3I", nonce)]
    x = state[:]
    quarters = ((0, 4, 8, 12), (1, 5, 9, 13), (2, 6, 10, 14), (3, 7, 11, 15), (0, 5, 10, 15), (1, 6, 11, 12), (2, 7, 8, 13), (3, 4, 9, 14))
    for _ in range(10):
        for a, b, c, d in quarters:
            for i, j, m, turn in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
                x[i] = x[i] + x[j] & 0xffffffff
                mixed = x[m] ^ x[i]
                x[m] = (mixed << turn | mixed >> 32 - turn) & 0xffffffff
    return struct.pack("<16I", *(s + t & 0xffffffff for s, t in zip(state, x)))


def _cipher(key, nonce, data):
    return b"".join(bytes(p ^ q for p, q in zip(data[at:at + 64], _block(key, 1 + at // 64, nonce))) for at in range(0, len(data), 64))


def _tag(key, nonce, sealed):
    """RFC 8439, sections 2.5 and 2.8, without additional data."""
    once = _block(key, 0, nonce)
    r = int.from_bytes(once[:16], "little") & 0x0ffffffc0ffffffc0ffffffc0fffffff
    authenticated = sealed + bytes(-len(sealed) % 16) + struct.pack("<QQ", 0, len(sealed))
    total = 0
    for at in range(0, len(authenticated), 16):
        total = (total + int.from_bytes(authenticated[at:at + 16] + b"\1", "little")) * r % (2**130 - 5)
    return (total + int.from_bytes(once[16:32], "little") & (1 << 128) - 1).to_bytes(16, "little")


def seal_piece(key, nonce, plain):
    sealed = _cipher(key, nonce, plain)
    return sealed + _tag(key, nonce, sealed)


def open_piece(key, nonce, data):
    if len(data) < 16 or not hmac.compare_digest(_tag(key, nonce, data[:-16]), data[-16:]):
        raise ValueError("a piece does not authenticate")
    return _cipher(key, nonce, data[:-16])


def hkdf(secret, salt, info):
    """RFC 5869 with SHA-256, 32 bytes."""
    return hmac.digest(hmac.digest(salt or bytes(32), secret, "sha256"), info + b"\1", "sha256")


def _checksum(prefix, data):
    value = 1
    for each in [ord(c) >> 5 for c in prefix] + [0] + [ord(c) & 31 for c in prefix] + data:
        top = value >> 25
        value = (value & 0x1ffffff) << 5 ^ each
        for bit, constant in enumerate((0x3b6a57b2, 0x26508e6d, 0x1ea119fa, 0x3d4233dd, 0x2a1462b3)):
            value ^= constant if top >> bit & 1 else 0
    return value


def bech32(prefix, data):
    """BIP 173."""
    bits = int.from_bytes(data, "big") << (-len(data) * 8 % 5)
    count = (len(data) * 8 + 4) // 5
    words = [bits >> 5 * (count - 1 - i) & 31 for i in range(count)]
    check = _checksum(prefix, words + [0] * 6) ^ 1
    return f"{prefix}1" + "".join(_ALPHABET[w] for w in words + [check >> 5 * (5 - i) & 31 for i in range(6)])


@dataclasses.dataclass(frozen=True)
class Identity:
    """An X25519 identity."""
    secret: bytes

    @property
    def public(self):
        return x25519(self.secret, BASE_POINT)

    @property
    def recipient(self):
        return bech32("age", self.public)

    def __str__(self):
        return bech32("age-secret-key-", self.secret).upper()


def _b64(data):
    return base64.b64encode(data).decode().rstrip("=")


def header(file_key, publics, ephemerals):
    """The header that gives the file key to the recipients."""
    text = "age-encryption.org/v1\n"
    for public, ephemeral in zip(publics, ephemerals):
        share = x25519(ephemeral, BASE_POINT)
        wrapping = hkdf(x25519(ephemeral, public), share + public, b"age-encryption.org/v1/X25519")
        text += f"-> X25519 {_b64(share)}\n{_b64(seal_piece(wrapping, bytes(12), file_key))}\n"
    text += "---"
    return f"{text} {_b64(hmac.digest(hkdf(file_key, b'', b'header'), text.encode(), 'sha256'))}\n".encode()


def seal(plain, publics, random=os.urandom):
    """An age file. `random(n)` gives n bytes: of the file key, of each recipient's ephemeral secret, of the nonce."""
    file_key = random(16)
    top = header(file_key, publics, [random(32) for _ in publics])
    nonce = random(16)
    key = hkdf(file_key, nonce, b"payload")
    pieces = [plain[at:at + CHUNK] for at in range(0, len(plain), CHUNK)] or [b""]
    last = len(pieces) - 1
    return top + nonce + b"".join(seal_piece(key, i.to_bytes(11, "big") + bytes([i == last]), piece) for i, piece in enumerate(pieces))


def unseal(data, identity):
    """The plaintext of an age file, all of it; ValueError where it is not the identity's, or was changed."""
    end = data.index(b"\n", data.index(b"\n---") + 1) + 1
    lines = data[:end].decode().split("\n")
    file_key = None
    for at, line in enumerate(lines):
        if line.startswith("-> X25519 "):
            share = base64.b64decode(line.split(" ")[2] + "=")
            wrapping = hkdf(x25519(identity.secret, share), share + identity.public, b"age-encryption.org/v1/X25519")
            try:
                file_key = open_piece(wrapping, bytes(12), base64.b64decode(lines[at + 1] + "=="))
            except ValueError:
                continue
    if file_key is None:
        raise ValueError("sealed for somebody else")
    text, mac = data[:end - 1].rsplit(b" ", 1)
    if _b64(hmac.digest(hkdf(file_key, b"", b"header"), text, "sha256")).encode() != mac:
        raise ValueError("the header was changed")
    key, payload, plain, i = hkdf(file_key, data[end:end + 16], b"payload"), data[end + 16:], b"", 0
    while True:
        piece, payload = payload[:CHUNK + 16], payload[CHUNK + 16:]
        plain += open_piece(key, i.to_bytes(11, "big") + bytes([not payload]), piece)
        if not payload:
            return plain
        i += 1
