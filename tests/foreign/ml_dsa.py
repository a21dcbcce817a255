"""Verification of ML-DSA-44 signatures (FIPS 204, pure, without a context)."""
import functools
import hashlib

Q, DEGREE, DROPPED_BITS = 8380417, 256, 13
ROWS, COLUMNS, WEIGHT, GAMMA1, GAMMA2, MOST_HINTS = 4, 4, 39, 1 << 17, (Q - 1) // 88, 80
BETA = WEIGHT * 2
KEY_BYTES, SIGNATURE_BYTES = 1312, 2420
_ZETAS = [pow(1753, int(f"{i:08b}"[::-1], 2), Q) for i in range(256)]


def _shake256(size, *parts):
    return hashlib.shake_256(b"".join(parts)).digest(size)


def _unpack(data, bits):
    whole = int.from_bytes(data, "little")
    return [whole >> i * bits & (1 << bits) - 1 for i in range(DEGREE)]


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


def _challenge(seed):
    """SampleInBall."""
    stream = _shake256(4096, seed)
    signs, numbers = int.from_bytes(stream[:8], "little"), iter(stream[8:])
    c = [0] * DEGREE
    for i in range(DEGREE - WEIGHT, DEGREE):
        j = next(n for n in numbers if n <= i)
        c[i], c[j] = c[j], -1 if signs & 1 else 1
        signs >>= 1
    return c


def _hints(data):
    """HintBitUnpack: the places of each row; None for any other form than the one that is written."""
    rows, read = [], 0
    for end in data[MOST_HINTS:]:
        row = list(data[read:end])
        if not read <= end <= MOST_HINTS or row != sorted(set(row)):
            return None
        rows.append(set(row))
        read = end
    return None if any(data[read:MOST_HINTS]) else rows


def _high_bits(hint, r):
    """UseHint."""
    low = r % (2 * GAMMA2)
    if low > GAMMA2:
        low -= 2 * GAMMA2
    high, low = (0, low - 1) if r - low == Q - 1 else ((r - low) // (2 * GAMMA2), low)
    return (high + (1 if low > 0 else -1)) % 44 if hint else high


@functools.lru_cache(maxsize=64)
def verify(key, message, signature):
    """Whether it is the key's signature of the message."""
    if len(key) != KEY_BYTES or len(signature) != SIGNATURE_BYTES:
        return False
    seed, z_bytes, hints = signature[:32], signature[32:-84], _hints(signature[-84:])
    z = [[GAMMA1 - x for x in _unpack(z_bytes[576 * i:576 * (i + 1)], 18)] for i in range(COLUMNS)]
    if hints is None or any(abs(x) >= GAMMA1 - BETA for polynomial in z for x in polynomial):
        return False
    z, c = [_transformed(polynomial) for polynomial in z], _transformed(_challenge(seed))
    commitment = 0
    for row in range(ROWS):
        high = _transformed([x << DROPPED_BITS for x in _unpack(key[32 + 320 * row:352 + 320 * row], 10)])
        matrix = [_uniform(key[:32], column, row) for column in range(COLUMNS)]
        w = _transformed_back([sum(a[i] * p[i] for a, p in zip(matrix, z)) - c[i] * high[i] for i in range(DEGREE)])
        for i, r in enumerate(w):
            commitment |= _high_bits(i in hints[row], r) << 6 * (DEGREE * row + i)
    representative = _shake256(64, _shake256(64, key), b"\x00\x00", message)
    return _shake256(32, representative, commitment.to_bytes(6 * DEGREE * ROWS // 8, "little")) == seed
