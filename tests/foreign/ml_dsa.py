"""ML-DSA-44 and ML-DSA-65 (FIPS 204, pure, without a context): verification, and keys of a seed that sign deterministically."""
import dataclasses
import functools
import hashlib

Q, DEGREE, DROPPED_BITS = 8380417, 256, 13
_ZETAS = [pow(1753, int(f"{i:08b}"[::-1], 2), Q) for i in range(256)]


@dataclasses.dataclass(frozen=True)
class Set:
    """A parameter set, in the order of table 1."""
    weight: int
    gamma1_bits: int
    gamma2: int
    rows: int
    columns: int
    eta: int
    most_hints: int
    challenge_bytes: int

    @property
    def gamma1(self):
        return 1 << self.gamma1_bits

    @property
    def beta(self):
        return self.weight * self.eta

    @property
    def key_bytes(self):
        return 32 + 320 * self.rows

    @property
    def z_bytes(self):
        return 32 * (self.gamma1_bits + 1)

    @property
    def signature_bytes(self):
        return self.challenge_bytes + self.z_bytes * self.columns + self.most_hints + self.rows

    @property
    def high_values(self):
        return (Q - 1) // (2 * self.gamma2)

    @property
    def high_bits(self):
        return (self.high_values - 1).bit_length()


ML_DSA_44 = Set(39, 17, (Q - 1) // 88, 4, 4, 2, 80, 32)
ML_DSA_65 = Set(49, 19, (Q - 1) // 32, 6, 5, 4, 55, 48)


def _shake256(size, *parts):
    return hashlib.shake_256(b"".join(parts)).digest(size)


def _unpack(data, bits):
    whole = int.from_bytes(data, "little")
    return [whole >> i * bits & (1 << bits) - 1 for i in range(DEGREE)]


def _packed(numbers, bits):
    whole = 0
    for i, number in enumerate(numbers):
        whole |= number << i * bits
    return whole.to_bytes(len(numbers) * bits // 8, "little")


def _transformed(w):
    w, zeta, length = list(w), 0, 128
    while length:
        for start in range(0, DEGREE, 2 * length):
            zeta += 1
            for i in range(start, start + length):
                product = _ZETAS[zeta] * w[i + length] % Q
                w[i], w[i + length] = (w[i] + product) % Q, (w[i] - product) % Q
        length //= 2
    return w


def _transformed_back(w):
    w, zeta, length = list(w), 256, 1
    while length < DEGREE:
        for start in range(0, DEGREE, 2 * length):
            zeta -= 1
            for i in range(start, start + length):
                w[i], w[i + length] = (w[i] + w[i + length]) % Q, _ZETAS[zeta] * (w[i + length] - w[i]) % Q
        length *= 2
    return [x * 8347681 % Q for x in w]


def _uniform(seed, column, row):
    """RejNTTPoly; the stream's first 256 numbers below q."""
    for blocks in range(5, 100):
        stream = hashlib.shake_128(seed + bytes([column, row])).digest(168 * blocks)
        found = [x for x in (int.from_bytes(stream[i:i + 3], "little") & 0x7fffff for i in range(0, len(stream), 3)) if x < Q]
        if len(found) >= DEGREE:
            return found[:DEGREE]
    raise AssertionError("no stream is so long")


@functools.lru_cache(maxsize=8)
def _matrix(kind, seed):
    """ExpandA."""
    return [[_uniform(seed, column, row) for column in range(kind.columns)] for row in range(kind.rows)]


def _challenge(kind, seed):
    """SampleInBall."""
    stream = _shake256(4096, seed)
    signs, numbers = int.from_bytes(stream[:8], "little"), iter(stream[8:])
    c = [0] * DEGREE
    for i in range(DEGREE - kind.weight, DEGREE):
        j = next(n for n in numbers if n <= i)
        c[i], c[j] = c[j], -1 if signs & 1 else 1
        signs >>= 1
    return c


def _hints(kind, data):
    """HintBitUnpack: the places of each row; None for any other form than the one that is written."""
    rows, read = [], 0
    for end in data[kind.most_hints:]:
        row = list(data[read:end])
        if not read <= end <= kind.most_hints or row != sorted(set(row)):
            return None
        rows.append(set(row))
        read = end
    return None if any(data[read:kind.most_hints]) else rows


def _centred(r, modulus):
    low = r % modulus
    return low - modulus if low > modulus // 2 else low


def _decomposed(kind, r):
    """Decompose: high and low part."""
    r %= Q
    low = _centred(r, 2 * kind.gamma2)
    return (0, low - 1) if r - low == Q - 1 else ((r - low) // (2 * kind.gamma2), low)


def _high_bits(kind, hint, r):
    """UseHint."""
    high, low = _decomposed(kind, r)
    return (high + (1 if low > 0 else -1)) % kind.high_values if hint else high


def _representative(key, message):
    return _shake256(64, _shake256(64, key), b"\x00\x00", message)


@functools.lru_cache(maxsize=256)
def verify(kind, key, message, signature):
    """Whether it is the key's signature of the message."""
    if len(key) != kind.key_bytes or len(signature) != kind.signature_bytes:
        return False
    end = len(signature) - kind.most_hints - kind.rows
    seed, z_bytes, hints = signature[:kind.challenge_bytes], signature[kind.challenge_bytes:end], _hints(kind, signature[end:])
    z = [[kind.gamma1 - x for x in _unpack(z_bytes[kind.z_bytes * i:kind.z_bytes * (i + 1)], kind.gamma1_bits + 1)] for i in range(kind.columns)]
    if hints is None or any(abs(x) >= kind.gamma1 - kind.beta for polynomial in z for x in polynomial):
        return False
    z, c = [_transformed(polynomial) for polynomial in z], _transformed(_challenge(kind, seed))
    commitment = b""
    for row, matrix in enumerate(_matrix(kind, key[:32])):
        high = _transformed([x << DROPPED_BITS for x in _unpack(key[32 + 320 * row:352 + 320 * row], 10)])
        w = _transformed_back([sum(a[i] * p[i] for a, p in zip(matrix, z)) - c[i] * high[i] for i in range(DEGREE)])
        commitment += _packed([_high_bits(kind, i in hints[row], r) for i, r in enumerate(w)], kind.high_bits)
    return _shake256(kind.challenge_bytes, _representative(key, message), commitment) == seed


def _bounded(kind, seed, number):
    """RejBoundedPoly."""
    found = []
    for byte in _shake256(1024, seed, number.to_bytes(2, "little")):
        for half in (byte & 15, byte >> 4):
            if kind.eta == 2 and half < 15:
                found.append(2 - half % 5)
            elif kind.eta == 4 and half < 9:
                found.append(4 - half)
    return found[:DEGREE]


class PrivateKey:
    """Of a seed of 32 bytes."""

    def __init__(self, kind, seed):
        self.kind = kind
        expanded = _shake256(128, seed, bytes([kind.rows, kind.columns]))
        self.matrix, self.secret = _matrix(kind, expanded[:32]), expanded[96:]
        s1 = [_bounded(kind, expanded[32:96], i) for i in range(kind.columns)]
        s2 = [_bounded(kind, expanded[32:96], kind.columns + i) for i in range(kind.rows)]
        self.s1, self.s2 = [_transformed(p) for p in s1], [_transformed(p) for p in s2]
        t = [[(x + y) % Q for x, y in zip(w, p)] for w, p in zip(self._times_matrix(self.s1), s2)]
        low = [[_centred(x, 1 << DROPPED_BITS) for x in p] for p in t]
        self.t0 = [_transformed(p) for p in low]
        self.public = expanded[:32] + b"".join(_packed([(x - y) >> DROPPED_BITS for x, y in zip(p, q)], 10) for p, q in zip(t, low))

    def _times_matrix(self, vector):
        return [_transformed_back([sum(a[i] * p[i] for a, p in zip(row, vector)) for i in range(DEGREE)]) for row in self.matrix]

    @functools.lru_cache(maxsize=256)
    def sign(self, message):
        kind, representative = self.kind, _representative(self.public, message)
        seed = _shake256(64, self.secret, bytes(32), representative)
        for attempt in range(0, 1 << 16, kind.columns):
            masks = [_shake256(kind.z_bytes, seed, (attempt + i).to_bytes(2, "little")) for i in range(kind.columns)]
            y = [[kind.gamma1 - x for x in _unpack(mask, kind.gamma1_bits + 1)] for mask in masks]
            w = self._times_matrix([_transformed(p) for p in y])
            commitment = b"".join(_packed([_decomposed(kind, x)[0] for x in p], kind.high_bits) for p in w)
            tilde = _shake256(kind.challenge_bytes, representative, commitment)
            c = _transformed(_challenge(kind, tilde))

            def times_c(vector):
                return [[_centred(x, Q) for x in _transformed_back([a * b for a, b in zip(c, p)])] for p in vector]

            z = [[a + b for a, b in zip(p, q)] for p, q in zip(y, times_c(self.s1))]
            rest = [[(a - b) % Q for a, b in zip(p, q)] for p, q in zip(w, times_c(self.s2))]
            if any(abs(x) >= kind.gamma1 - kind.beta for p in z for x in p) or any(abs(_decomposed(kind, x)[1]) >= kind.gamma2 - kind.beta for p in rest for x in p):
                continue
            low = times_c(self.t0)
            hints = [[i for i in range(DEGREE) if _decomposed(kind, p[i] + q[i])[0] != _decomposed(kind, p[i])[0]] for p, q in zip(rest, low)]
            if any(abs(x) >= kind.gamma2 for p in low for x in p) or sum(map(len, hints)) > kind.most_hints:
                continue
            places = bytes(i for row in hints for i in row)
            ends = bytes(sum(map(len, hints[:row + 1])) for row in range(kind.rows))
            return tilde + b"".join(_packed([kind.gamma1 - x for x in p], kind.gamma1_bits + 1) for p in z) + places.ljust(kind.most_hints, b"\x00") + ends
        raise AssertionError("a signature needs a few attempts")
