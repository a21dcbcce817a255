"""RFC 3161 time stamps: their fields are read from DER here, `openssl` judges signatures and certificates and plays the authority."""
import calendar
import dataclasses
import datetime
import functools
import hashlib
import pathlib
import re
import subprocess
import tempfile
import threading

_SHA256 = bytes.fromhex("608648016503040201")
_TST_INFO = bytes.fromhex("2a864886f70d0109100104")
_EMBEDDED_POLICY = "2.25.197830237812365870224498532130945381713"
_EMBEDDED_NAME = b"Kiroku embedded time-stamping CA"
_NANO = 1_000_000_000


class Malformed(ValueError):
    """What is no time-stamp response with a token, and why."""


def _read(data, at, end):
    """The tag of the value at `at`, and where its contents begin and end."""
    if at + 2 > end:
        raise Malformed("cut off")
    tag, length, at = data[at], data[at + 1], at + 2
    if length & 0x80:
        count = length & 0x7F
        if not 0 < count <= 4 or at + count > end:
            raise Malformed("a length is none")
        length, at = int.from_bytes(data[at:at + count], "big"), at + count
    if at + length > end:
        raise Malformed("cut off")
    return tag, at, at + length


def _children(data, begin, end):
    found = []
    while begin < end:
        tag, inner, after = _read(data, begin, end)
        found.append((tag, inner, after))
        begin = after
    return found


def _only(data, begin, end, tag):
    found = _children(data, begin, end)
    if len(found) != 1 or found[0][0] != tag:
        raise Malformed("another structure than expected")
    return found[0][1:]


def _whole(data, begin, end):
    return int.from_bytes(data[begin:end], "big", signed=True)


def _oid(data):
    numbers, value = [], 0
    for byte in data:
        value = value << 7 | byte & 0x7F
        if not byte & 0x80:
            numbers.append(value)
            value = 0
    first = min(numbers[0] // 40, 2)
    return ".".join(map(str, [first, numbers[0] - 40 * first, *numbers[1:]]))


def _numbers(moment):
    found = re.fullmatch(r"(\d{4})-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)\.(\d{6})Z", moment)
    if not found:
        raise ValueError(f"{moment!r} is no time")
    return [int(number) for number in found.groups()]


def is_day(moment):
    """Whether there is the day of `2026-08-05T09:15:02.000000Z`."""
    year, month, day = _numbers(moment)[:3]
    return 1 <= day <= (calendar.mdays[month] + (month == 2 and calendar.isleap(year)))


def nanoseconds(moment):
    """Since 1970, of `2026-08-05T09:15:02.000000Z`; also of year 0, which Python's own times do not have."""
    year, month, day, hours, minutes, seconds, micros = _numbers(moment)
    days = datetime.date(year + 400, month, day).toordinal() - datetime.date(2370, 1, 1).toordinal()  # a cycle of 400 years later
    return ((days * 24 + hours) * 60 + minutes) * 60 * _NANO + seconds * _NANO + micros * 1000


def text_of(nanos):
    whole = datetime.datetime.fromtimestamp(nanos // _NANO, datetime.timezone.utc)
    return whole.strftime("%Y-%m-%dT%H:%M:%S") + f".{nanos % _NANO // 1000:06d}Z"


@dataclasses.dataclass(frozen=True)
class Stamp:
    token: bytes          # the ContentInfo
    imprint: bytes
    policy: str
    serial: str           # hex, lower case
    gen_ns: int           # since 1970
    accuracy_ns: int
    ordered: bool


def parse(response, shared=False):
    """The Stamp in the bytes of a TimeStampResp. The imprint of a shared token by another hash than SHA-256 is empty: no path leads to it."""
    begin, end = _only(response, 0, len(response), 0x30)
    parts = _children(response, begin, end)
    if len(parts) != 2 or parts[0][0] != 0x30 or parts[1][0] != 0x30:
        raise Malformed("no response with a token")
    status = _children(response, *parts[0][1:])
    if not status or status[0][0] != 0x02 or _whole(response, *status[0][1:]) not in (0, 1):
        raise Malformed("not granted")
    token = response[parts[0][2]:parts[1][2]]
    content = _children(response, *parts[1][1:])
    if len(content) != 2 or content[1][0] != 0xA0:
        raise Malformed("no signed data")
    signed = _children(response, *_only(response, *content[1][1:], 0x30))
    if len(signed) < 4 or signed[2][0] != 0x30:
        raise Malformed("no signed data")
    inner = _children(response, *signed[2][1:])
    if len(inner) != 2 or response[inner[0][1]:inner[0][2]] != _TST_INFO or inner[1][0] != 0xA0:
        raise Malformed("what is signed is no TSTInfo")
    octets = _only(response, *inner[1][1:], 0x04)
    fields = _children(response, *_only(response, *octets, 0x30))
    if len(fields) < 5 or [f[0] for f in fields[:5]] != [0x02, 0x06, 0x30, 0x02, 0x18]:
        raise Malformed("TSTInfo lacks fields")
    algorithm, digest = _children(response, *fields[2][1:])
    algorithm = _children(response, *algorithm[1:])
    by_sha256 = response[algorithm[0][1]:algorithm[0][2]] == _SHA256
    if not by_sha256 and not shared:
        raise Malformed("the imprint is not SHA-256")
    shown = response[fields[4][1]:fields[4][2]].decode("ascii", "replace")
    found = re.fullmatch(r"(\d{14})(?:\.(\d{1,9}))?Z", shown)
    if not found:
        raise Malformed(f"{shown!r} is no time")
    moment = datetime.datetime.strptime(found[1] + "+0000", "%Y%m%d%H%M%S%z")
    accuracy, ordered = 0, False
    for tag, inner_begin, inner_end in fields[5:]:
        if tag == 0x30:
            for unit, at, after in _children(response, inner_begin, inner_end):
                accuracy += _whole(response, at, after) * {0x02: _NANO, 0x80: 1_000_000, 0x81: 1000}[unit]
        elif tag == 0x01:
            ordered = response[inner_begin] != 0
    serial = f"{_whole(response, *fields[3][1:]):x}"
    return Stamp(token, response[digest[1]:digest[2]] if by_sha256 else b"", _oid(response[fields[1][1]:fields[1][2]]), serial,
                 int(moment.timestamp()) * _NANO + int((found[2] or "").ljust(9, "0")), accuracy, ordered)


SHA256_NAMED = b"\x30\x0b\x06\x09" + _SHA256


def shared_token(path, token):
    """The evidence record (RFC 4998) of one time-stamp: `path` has the lists of its hash tree, `token` is a ContentInfo."""
    tree = der(0xA2, b"".join(der(0x30, b"".join(der(0x04, value) for value in values)) for values in path)) if path else b""
    only = der(0x30, b"\xa0" + SHA256_NAMED[1:] + tree + token)
    return der(0x30, _integer(1) + der(0x30, SHA256_NAMED) + der(0x30, der(0x30, only)))


def parse_shared(data):
    """Lists of hashes and token of a file that shared_token() wrote; nothing else will do."""
    fields = _children(data, *_only(data, 0, len(data), 0x30))
    if len(fields) != 3:
        raise Malformed("no evidence record of one time-stamp")
    chain = _only(data, *fields[2][1:], 0x30)
    parts = _children(data, *_only(data, *chain, 0x30))
    if len(parts) not in (2, 3):
        raise Malformed("no time-stamp of an evidence record")
    path = []
    for tag, begin, end in _children(data, *parts[1][1:]) if len(parts) == 3 else []:
        path.append([data[at:after] for _, at, after in _children(data, begin, end)])
    if len(path) > 64 or any(not values or any(len(value) != 32 for value in values) for values in path):
        raise Malformed("its hash tree is none of SHA-256, or longer than 64 lists")
    token = data[parts[-2][2]:parts[-1][2]]
    if shared_token(path, token) != data:
        raise Malformed("it has more than one time-stamp, or another form")
    return path, token


def joined(path):
    """What the root over the lists is the hash of; at least one list has two values, or there are two lists."""
    node, content = None, None
    for values in path:
        values = values + ([node] if node else [])
        content = b"".join(sorted(values)) if len(values) > 1 else content
        node = hashlib.sha256(content).digest() if len(values) > 1 else values[0]
    return content


def _root(path):
    content = joined(path)
    return hashlib.sha256(content).digest() if content else path[0][0]


def stamped(file, response):
    """Of a token's file: a response, and what makes of a note's hash the imprint that the token must have, None where it cannot."""
    if not file.endswith(".ers"):
        return response, lambda digest: digest
    path, token = parse_shared(response)
    return der(0x30, der(0x30, _integer(0)) + token), lambda digest: digest if not path else _root(path) if digest in path[0] else None


def _openssl(*arguments, **given):
    return subprocess.run(["openssl", *arguments], capture_output=True, **given)


def certificates(pem):
    return re.findall(r"-----BEGIN CERTIFICATE-----\n.*?-----END CERTIFICATE-----\n", pem, re.S)


@functools.lru_cache(maxsize=None)
def judge(response, roots, own_roots):
    """What a response is, the root that vouches for it, and why it is no more than that.

    `roots` and `own_roots` are texts of PEM certificates. The first answer is one of `outside`, `self-issued`, `untrusted` (no
    path leads to a root that was given), `no trust` (none was given) and `refused`."""
    try:
        stamp = parse(response)
    except (Malformed, ValueError, IndexError, KeyError) as e:
        return "refused", "", str(e)
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder)
        (path / "token.tsr").write_bytes(response)
        (path / "token.der").write_bytes(stamp.token)
        why = ""
        for own, pem in [(True, each) for each in certificates(own_roots)] + [(False, each) for each in certificates(roots)]:
            (path / "root.pem").write_text(pem)
            done = _openssl("ts", "-verify", "-digest", stamp.imprint.hex(), "-in", str(path / "token.tsr"), "-CAfile", str(path / "root.pem"),
                            "-attime", str(stamp.gen_ns // _NANO), "-partial_chain")
            if done.returncode == 0:
                lowered = own or stamp.policy == _EMBEDDED_POLICY or _EMBEDDED_NAME in response
                return "self-issued" if lowered else "outside", hashlib.sha256(pem.encode()).hexdigest(), ""
            # A root of another time is the verifier's mistake, and speaks against no token.
            alone = _openssl("verify", "-partial_chain", "-attime", str(stamp.gen_ns // _NANO), "-CAfile", str(path / "root.pem"), str(path / "root.pem"))
            why += done.stderr.decode(errors="replace") if alone.returncode == 0 else f"a root of another time than {stamp.gen_ns}\n"
        # Without a path the signature can still be judged, and whether the signer may sign.
        done = _openssl("cms", "-verify", "-inform", "DER", "-in", str(path / "token.der"), "-noverify", "-binary", "-out", str(path / "content"),
                        "-signer", str(path / "signer.pem"))
        if done.returncode != 0:
            return "refused", "", done.stderr.decode(errors="replace")
        # Whatever the roots are, a certificate of another time cannot have signed.
        signer = _openssl("verify", "-partial_chain", "-attime", str(stamp.gen_ns // _NANO), "-CAfile", str(path / "signer.pem"), str(path / "signer.pem"))
        why += signer.stderr.decode(errors="replace")
        if re.search("expired|not yet valid|purpose|signing certificate|key usage", why, re.I):
            return "refused", "", why
        return "untrusted" if why else "no trust", "", why


class Authority:
    """A time-stamping authority for tests: a root and a signer made by `openssl`, kept in `folder`."""

    def __init__(self, folder, name, policy="1.3.6.1.4.1.4146.2.3", accuracy="secs:1", ordering="no", root_name=None, days=3650, digests="sha256"):
        self.folder, self.name, self.policy, self.serial = pathlib.Path(folder), name, policy, threading.Lock()
        self.folder.mkdir(parents=True)
        (self.folder / "authority.cnf").write_text(f"""\
[req]
distinguished_name = dn
prompt = no
[dn]
CN = {name}
[root]
basicConstraints = critical, CA:TRUE
keyUsage = critical, keyCertSign, cRLSign
subjectKeyIdentifier = hash
[signer]
basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = critical, timeStamping
subjectKeyIdentifier = hash
authorityKeyIdentifier = keyid
[tsa]
default_tsa = stamping
[stamping]
serial = {self.folder}/serial
signer_cert = {self.folder}/signer.pem
signer_key = {self.folder}/signer.key
certs = {self.folder}/root.pem
signer_digest = sha256
default_policy = {policy}
digests = {digests}
accuracy = {accuracy}
clock_precision_digits = 6
ordering = {ordering}
tsa_name = no
ess_cert_id_chain = no
ess_cert_id_alg = sha256
""")
        curve = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"]
        config = ["-config", self.path("authority.cnf")]
        self._run("req", "-x509", *curve, "-keyout", self.path("root.key"), "-out", self.path("root.pem"), "-days", str(days), "-subj", f"/CN={root_name or name + ' root'}",
                  *config, "-extensions", "root")
        self._run("req", "-new", *curve, "-keyout", self.path("signer.key"), "-out", self.path("signer.csr"), "-subj", f"/CN={name} signer", *config)
        self._run("x509", "-req", "-in", self.path("signer.csr"), "-CA", self.path("root.pem"), "-CAkey", self.path("root.key"), "-set_serial", "2", "-days", str(days),
                  "-out", self.path("signer.pem"), "-extfile", self.path("authority.cnf"), "-extensions", "signer")

    def path(self, name):
        return str(self.folder / name)

    @property
    def root(self):
        return (self.folder / "root.pem").read_text()

    @property
    def chain(self):
        return (self.folder / "signer.pem").read_text() + self.root

    @staticmethod
    def _run(*arguments, **given):
        done = _openssl(*arguments, **given)
        if done.returncode != 0:
            raise RuntimeError(f"openssl {' '.join(arguments)}: {done.stderr.decode(errors='replace')}")
        return done.stdout

    def ask(self, data):
        """The TimeStampResp that `openssl ts` gives for `data`."""
        return self.answer(self._run("ts", "-query", "-digest", hashlib.sha256(data).hexdigest(), "-sha256", "-cert"))

    def answer(self, query):
        """The TimeStampResp that `openssl ts` gives for a TimeStampReq."""
        with self.serial:  # `openssl ts` counts in a file
            (self.folder / "query.tsq").write_bytes(query)
            self._run("ts", "-reply", "-config", self.path("authority.cnf"), "-queryfile", self.path("query.tsq"), "-out", self.path("reply.tsr"))
            return (self.folder / "reply.tsr").read_bytes()

    @functools.lru_cache(maxsize=None)
    def at(self, data, gen_ns, serial, accuracy_s=1, ordering=False):
        """A response of this authority as if its clock had shown `gen_ns`: TSTInfo is made here, `openssl cms` signs it."""
        moment = datetime.datetime.fromtimestamp(gen_ns // _NANO, datetime.timezone.utc).strftime("%Y%m%d%H%M%S")
        fraction = f".{gen_ns % _NANO // 1000:06d}".rstrip("0").rstrip(".")
        imprint = der(0x30, der(0x30, der(0x06, _SHA256) + der(0x05, b"")) + der(0x04, hashlib.sha256(data).digest()))
        info = der(0x30, _integer(1) + _object_identifier(self.policy) + imprint + _integer(serial) + der(0x18, f"{moment}{fraction}Z".encode())
                    + (der(0x30, _integer(accuracy_s)) if accuracy_s else b"") + (der(0x01, b"\xff") if ordering else b""))
        token = self._run("cms", "-sign", "-binary", "-nodetach", "-cades", "-md", "sha256", "-econtent_type", "1.2.840.113549.1.9.16.1.4", "-outform", "DER",
                          "-signer", self.path("signer.pem"), "-inkey", self.path("signer.key"), "-certfile", self.path("root.pem"), input=info)
        return der(0x30, der(0x30, _integer(0)) + token)


def der(tag, contents):
    size = len(contents)
    if size < 0x80:
        return bytes([tag, size]) + contents
    length = size.to_bytes((size.bit_length() + 7) // 8, "big")
    return bytes([tag, 0x80 | len(length)]) + length + contents


def _integer(value):
    return der(0x02, value.to_bytes(value.bit_length() // 8 + 1, "big"))


def _object_identifier(dotted):
    numbers = [int(n) for n in dotted.split(".")]
    out = b""
    for value in [numbers[0] * 40 + numbers[1], *numbers[2:]]:
        part = bytes([value & 0x7F])
        while value := value >> 7:
            part = bytes([0x80 | value & 0x7F]) + part
        out += part
    return der(0x06, out)
