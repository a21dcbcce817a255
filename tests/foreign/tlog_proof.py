"""C2SP tlog-proofs of a case's end in an appliance log."""
import base64
import re

import note

MOST_BYTES, MOST_HASHES, LONGEST_LINE = 2 << 20, 63, 1 << 20
_HEADER = "c2sp.org/tlog-proof@v1"


def _hashes(data):
    if not data or len(data) % 32 or len(data) > MOST_HASHES * 32:
        raise note.Malformed("the extra data is no line with a consistency proof")
    return [data[i:i + 32] for i in range(0, len(data), 32)]


def make(line, consistency, index, path, signed):
    """`consistency`: of an excerpt, hashes from its tree to the case's."""
    extra = line + (b"\n" + b"".join(consistency) if consistency else b"")
    head = [_HEADER, "extra " + base64.b64encode(extra).decode(), f"index {index}", *(base64.b64encode(h).decode() for h in path), ""]
    return "\n".join(head).encode() + b"\n" + signed


def parse(data):
    """The entry's line, the consistency proof, the entry's number, the audit path and the checkpoint; raises note.Malformed."""
    if len(data) > MOST_BYTES:
        raise note.Malformed("larger than 2 MiB")
    head, empty, signed = data.partition(b"\n\n")
    try:
        lines = head.decode("ascii").split("\n")
    except UnicodeDecodeError as e:
        raise note.Malformed("no ASCII before the checkpoint") from e
    if not empty or lines[0] != _HEADER or len(lines) < 3 or not lines[1].startswith("extra "):
        raise note.Malformed("no tlog-proof with extra data")
    extra = note.from_base64(lines[1].removeprefix("extra "))
    index = re.fullmatch("index (0|[1-9][0-9]{0,19})", lines[2])
    path = [note.from_base64(line) for line in lines[3:]]
    if not index or len(path) > MOST_HASHES or any(len(h) != 32 for h in path):
        raise note.Malformed("no index, or no audit path")
    line, more, hashes = extra.partition(b"\n")
    if len(line) > LONGEST_LINE:
        raise note.Malformed("the line is longer than 1 MiB")
    return line, _hashes(hashes) if more else [], int(index[1]), path, note.parse_checkpoint(signed)
