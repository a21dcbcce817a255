"""What anybody sees of an age file without a key, by docs/reference/format.md, "What a sealed file looks like"."""
import re

CHUNK, TAG, NONCE = 65536, 16, 16
HEADER = rb"age-encryption\.org/v1\n-> [^\n]*\n(?:(?!--- )[^\n]*\n)*--- [A-Za-z0-9+/]{43}\n"


def header_length(path):
    """Bytes of an age header: up to the end of the line that begins with `--- `."""
    with open(path, "rb") as file:
        found = re.match(HEADER, file.read(65536))
    return found.end() if found else None


def is_header(data):
    return len(data) <= 65536 and bool(re.fullmatch(HEADER, data))


def form_of(path, size):
    """How much a file has of the form of an age file, as anybody sees without a key."""
    header = header_length(path)
    if header is None or size <= header + NONCE:
        return "none"
    payload = size - header - NONCE
    last = payload % (CHUNK + TAG)
    return "holding" if last == 0 or last > TAG else "empty" if payload == TAG else "begun"
