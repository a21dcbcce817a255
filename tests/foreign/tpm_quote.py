"""Quotes of the measured boot by a TPM 2.0 (TCG TPM 2.0 Library, part 2: TPMT_PUBLIC, TPMS_ATTEST), read, and made by a key that is in no TPM."""
import base64
import dataclasses
import hashlib
import re
import struct
import subprocess

import note

_SHA256, _NULL, _ECDSA, _ECC, _P256 = 0x000B, 0x0010, 0x0018, 0x0023, 0x0003
_FIXED_TPM, _FIXED_PARENT, _ORIGIN, _USER, _NO_DA, _RESTRICTED, _DECRYPT, _SIGN = 1 << 1, 1 << 4, 1 << 5, 1 << 6, 1 << 10, 1 << 16, 1 << 17, 1 << 18
_NEEDED = _FIXED_TPM | _FIXED_PARENT | _ORIGIN | _RESTRICTED | _SIGN
_OWNER = 0x40000001
_GENERATED, _ATTEST_QUOTE = 0xFF544347, 0x8018
MOST_PCRS = 24


class Malformed(ValueError):
    """What is no attestation key or no quote, and why."""


class _Cursor:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, count):
        if self.at + count > len(self.data):
            raise Malformed("cut short")
        self.at += count
        return self.data[self.at - count:self.at]

    def number(self, count):
        return int.from_bytes(self.take(count), "big")

    def sized(self, most):
        size = self.number(2)
        if size > most:
            raise Malformed("bytes that are too many")
        return self.take(size)

    def end(self):
        if self.at != len(self.data):
            raise Malformed("something follows")


def _name(content):
    return struct.pack(">H", _SHA256) + hashlib.sha256(content).digest()


def _qualified_name(area):
    return _name(struct.pack(">I", _OWNER) + _name(area))


@dataclasses.dataclass(frozen=True)
class AttestationKey:
    public: bytes           # SubjectPublicKeyInfo
    qualified_name: bytes


def parse_key(area):
    cursor = _Cursor(area)
    kind, name, attributes = cursor.number(2), cursor.number(2), cursor.number(4)
    cursor.sized(64)
    symmetric, scheme, scheme_hash, curve, derivation = (cursor.number(2) for _ in range(5))
    x, y = cursor.sized(32), cursor.sized(32)
    cursor.end()
    if (kind, name, symmetric, scheme, scheme_hash, curve, derivation) != (_ECC, _SHA256, _NULL, _ECDSA, _SHA256, _P256, _NULL):
        raise Malformed("no key on P-256 that signs by ECDSA with SHA-256")
    if attributes & _NEEDED != _NEEDED or attributes & _DECRYPT or len(x) != 32 or len(y) != 32 or not note.on_p256(x + y):
        raise Malformed("no restricted signing key that its TPM made and keeps")
    return AttestationKey(note.P256_PUBLIC + x + y, _qualified_name(area))


@dataclasses.dataclass(frozen=True)
class Attested:
    signer: bytes
    qualifying_data: bytes
    clock_ms: int
    resets: int
    restarts: int
    safe: bool
    pcrs: tuple
    digest: bytes


def parse_attest(data):
    cursor = _Cursor(data)
    if (cursor.number(4), cursor.number(2)) != (_GENERATED, _ATTEST_QUOTE):
        raise Malformed("no TPMS_ATTEST of a quote")
    signer, qualifying = cursor.sized(66), cursor.sized(66)
    clock, resets, restarts, safe = cursor.number(8), cursor.number(4), cursor.number(4), cursor.number(1)
    cursor.number(8)  # the firmware's version
    if safe > 1 or (cursor.number(4), cursor.number(2), cursor.number(1)) != (1, _SHA256, MOST_PCRS // 8):
        raise Malformed("not of 24 registers of the SHA-256 bank alone")
    selected = int.from_bytes(cursor.take(3), "little")
    digest = cursor.sized(32)
    cursor.end()
    if len(digest) != 32:
        raise Malformed("no SHA-256 digest of registers")
    return Attested(signer, qualifying, clock, resets, restarts, bool(safe), tuple(i for i in range(MOST_PCRS) if selected >> i & 1), digest)


def parse_pcrs(texts):
    """The values by register."""
    values = {}
    for text in texts:
        index, _, value = text.partition(":")
        if values and int(index) <= max(values):
            raise Malformed("registers out of their order")
        values[int(index)] = bytes.fromhex(value)
    return values


def digest_of(values):
    return hashlib.sha256(b"".join(values[index] for index in sorted(values))).digest()


def qualifying_data(device, entry, root, boot_id):
    """Where in which log a quote stands, and of which boot it is."""
    return hashlib.sha256(f"kiroku/boot-quote\n{device}\n{entry}\n{root.hex()}\n{boot_id}\n".encode()).digest()


def went_on(before, now):
    """How far a count went on modulo 2^32; negative where it went back."""
    return (now - before + (1 << 31)) % (1 << 32) - (1 << 31)


# What judges the log's entries


@dataclasses.dataclass
class _Held:
    entry: int
    boot_id: str
    said: Attested
    pcrs: dict


class Boots:
    """The boots of a log, and what its TPM says of them. `alone`: else the log is read for a case, and only what was forged is told."""

    def __init__(self, report, alone):
        self.report, self.alone = report, alone
        self.device = self.boot_id = self.text = self.key = self.last = None
        self.holding = self.silent = self.further = self.since_held = 0   # the last: boots in the log since the last quote that holds
        self.unmeasured = self.without_reset = 0
        self.had_key = False

    def take(self, number, entry, root_before):
        kind = entry["type"]
        if kind == "boot":
            self._change_device(entry["device"], entry["device"] != self.device)
            self.boot_id = entry["boot_id"]
            self.since_held += 1
            if "quote" in entry:
                self._judge(number, entry, root_before)
            elif "no_quote" in entry:
                self.silent += 1
            elif self.key:
                self._of_log("boot-quote-missing", number)
            elif self.had_key:
                self.silent += 1
        elif kind == "device-key-changed":
            self._change_device(entry["device"], True)
        elif kind == "device-attestation-added":
            self._take_key(number, entry, root_before)

    def finish(self):
        for code, count in (("boot-quotes-hold", self.holding), ("boot-not-quoted", self.silent), ("boots-not-entered", self.further),
                            ("boot-not-measured", self.unmeasured), ("boot-without-reset", self.without_reset)):
            if count:
                self._of_log(code, count)

    def _change_device(self, device, is_other):
        self.device = device
        if is_other:
            self.text = self.key = self.last = None

    def _of_log(self, code, where):
        if self.alone:
            self.report(code, f"line {where} of the log")

    def _take_key(self, number, entry, root_before):
        try:
            key = parse_key(note.from_base64(entry["attestation"]))
        except (Malformed, note.Malformed) as e:
            return self.report("device-invalid", str(e))
        if self.key and self.text != entry["attestation"]:
            return self.report("device-attestation-differs", f"line {number}")
        self.text, self.key, self.had_key = entry["attestation"], key, True
        self._judge(number, entry, root_before)

    def _judge(self, number, entry, root_before):
        where = f"line {number} of the log"
        try:
            attest, signature = note.from_base64(entry["quote"]), note.from_base64(entry["quote_signature"])
            pcrs, said = parse_pcrs(entry["pcrs"]), parse_attest(attest)
        except (Malformed, note.Malformed) as e:
            return self.report("boot-quote-malformed", f"{where}: {e}")
        if not self.key or said.signer != self.key.qualified_name or not note.holds_ecdsa(self.key.public, attest, signature):
            return self.report("boot-quote-signature-invalid", where)
        holds = True
        if said.pcrs != tuple(sorted(pcrs)) or said.digest != digest_of(pcrs):
            holds = False
            self.report("boot-pcrs-differ", where)
        if root_before is not None and said.qualifying_data != qualifying_data(self.device, number, root_before, self.boot_id):
            holds = False
            self.report("boot-quote-of-elsewhere", where)
        if holds:
            self._compare(_Held(number, self.boot_id, said, pcrs))

    def _compare(self, now):
        if self.last:
            before, said = self.last.said, now.said
            resets, restarts = went_on(before.resets, said.resets), went_on(before.restarts, said.restarts)
            same_power = resets == 0 and restarts == 0
            if resets < 0 or (resets == 0 and restarts < 0) or ((said.safe or same_power) and said.clock_ms < before.clock_ms):
                return self.report("boot-clock-went-back", f"line {now.entry} of the log")
            self.further += max(0, resets - self.since_held)
            self.without_reset += same_power and now.boot_id != self.last.boot_id
            if now.pcrs != self.last.pcrs:
                self._of_log("measured-boot-changed", now.entry)
        self.unmeasured += any(not any(now.pcrs.get(index, b"")) for index in range(8))
        self.holding += 1
        self.last, self.since_held = now, 0


# What says so without a TPM: a forger, or a test


@dataclasses.dataclass
class Forger:
    """An attestation key whose 32 bytes somebody has; it signs whatever it is to say."""
    seed: bytes = bytes([5] * 32)
    attributes: int = _NEEDED | _USER | _NO_DA
    clock_ms: int = 1000
    resets: int = (1 << 32) - 1   # the TPM adds a number of its own
    restarts: int = 7
    safe: int = 1
    pcrs: dict = dataclasses.field(default_factory=lambda: {index: bytes([index + 1] * 32) for index in (*range(10), 14)})

    @property
    def area(self):
        done = subprocess.run(["openssl", "pkey", "-inform", "DER", "-pubout", "-outform", "DER"], input=note.P256_PRIVATE + self.seed, capture_output=True, check=True)
        x, y = done.stdout[-64:-32], done.stdout[-32:]
        head = struct.pack(">HHIHHHHHH", _ECC, _SHA256, self.attributes, 0, _NULL, _ECDSA, _SHA256, _P256, _NULL)
        return head + b"\0\x20" + x + b"\0\x20" + y

    @property
    def stated(self):
        return base64.b64encode(self.area).decode()

    def boot(self, resets=1, restarts=7, **pcrs):
        """The machine starts anew, and may measure something else: `pcr4=b"..."`."""
        self.resets, self.restarts, self.clock_ms = (self.resets + resets) % (1 << 32), restarts, self.clock_ms + 5000
        self.pcrs = {**self.pcrs, **{int(name.removeprefix("pcr")): hashlib.sha256(value).digest() for name, value in pcrs.items()}}

    def attest(self, qualifying):
        selected = sum(1 << index for index in self.pcrs)
        signer = _qualified_name(self.area)
        return (struct.pack(">IH", _GENERATED, _ATTEST_QUOTE) + struct.pack(">H", len(signer)) + signer + struct.pack(">H", len(qualifying)) + qualifying
                + struct.pack(">QIIBQ", self.clock_ms, self.resets, self.restarts, self.safe, 1) + struct.pack(">IHB", 1, _SHA256, 3)
                + selected.to_bytes(3, "little") + b"\0\x20" + digest_of(self.pcrs))

    def quote(self, qualifying):
        """The fields of an entry."""
        attest = self.attest(qualifying)
        return {"quote": base64.b64encode(attest).decode(), "quote_signature": base64.b64encode(self.sign(attest)).decode(),
                "pcrs": [f"{index}:{value.hex()}" for index, value in sorted(self.pcrs.items())]}

    def sign(self, attest):
        return note.Signer("", b"", hardware_seed=self.seed).sign_by_hardware(attest)
