"""Lines of ledgers and logs with something changed: what one verifier refuses as no entry, the other must refuse."""
import copy
import json

_HASH, _UTC, _CASE = "0" * 64, "2026-08-05T09:15:02.000000Z", {"case": "20260805T091502Z-3f9c21ab"}


def _entry(kind, **fields):
    return {"type": kind, "seq": 1, "utc": _UTC, "mono_ns": 5, **fields}


_QUOTE = {"quote": "q", "quote_signature": "s", "pcrs": [f"0:{_HASH}", f"23:{_HASH}"]}
_FILE = {"file": "f", "bytes": 1, "sha256": _HASH}
_SPAN = {"start_ns": 0, "end_ns": 1}
_STREAM = {"name": "a", "kind": "video", "media": "video/mp2t", "source": "s", "profile": "p", "purpose": "p", "recipients": ["age1"], "timing": "arrival"}

CASE = [
    _entry("open", format="kiroku-case/1", **_CASE, device="d", boot_id="b", streams=[_STREAM], subject={**_FILE, "file": "subject.json.age"}, plan=_HASH,
           begins_ns=3, appliance_log={"size": 0, "root": _HASH}),
    _entry("segment", stream="a", index=0, **_FILE, **_SPAN, first_pts=-3, time_base="1/90000", frames=2, dropped=0, complete=True, profile="mpeg2"),
    _entry("segment", stream="a", index=0, **_FILE, **_SPAN, first_pts=0, time_base="1/1000000000", samples=2, dropped=0, complete=True),
    _entry("segment", stream="a", index=0, **_FILE, **_SPAN, complete=False),
    _entry("gap", stream="a", **_SPAN, cause="paused", of="sound"),
    _entry("clock", synchronised=True, offset_ns=-1, error_ns=0, step_ns=-5, rate_ppb=-9),
    _entry("token", checkpoint=1, authority="a", file="f", sha256=_HASH, gen_time=_UTC, accuracy_ns=0, serial="0f", asked_ns=1, answered_ns=2),
    _entry("token-missed", checkpoint=1, authority="a", cause="c"),
    _entry("mark", commitment=_HASH),
    _entry("recovered", boot_id="b", after="crash", truncated=""),
    _entry("close", reason="r", totals={"a": {"segments": 0, "frames": 0, "dropped": 0, "bytes": 0}}),
    _entry("erased", stream="a", first_index=0, last_index=0, policy="p")]
LOG = [
    _entry("boot", boot_id="b", device="d"), _entry("boot", boot_id="b", device="d", **_QUOTE), _entry("boot", boot_id="b", device="d", no_quote="n"),
    _entry("device-attestation-added", attestation="a", **_QUOTE), _entry("shutdown"), _entry("config-changed", sha256=_HASH), _entry("device-key-changed", device="d"),
    _entry("device-ml-dsa-added", ml_dsa="d"), _entry("device-hardware-added", hardware="d"), _entry("device-hardware-silent", why="w"), _entry("plan-sealed", sha256=_HASH), _entry("case-opened", **_CASE, sha256=_HASH), _entry("case-checkpoint", **_CASE, size=1, root=_HASH),
    _entry("case-closed", **_CASE, size=1, root=_HASH, final_token=_HASH), _entry("replicated", **_CASE, target="t"),
    _entry("erased", **_CASE, stream="s", policy="p"), _entry("access", case="*", what="w", who="w"), _entry("recovered", truncated=1),
    _entry("damage-found", size=1, stated_root=_HASH, root=_HASH),
    _entry("pre-roll-discarded", segments=1, duration_ns=2),
    _entry("case-held", **_CASE, reason="r", who="w"), _entry("case-released", **_CASE, hold=1, reason="r", who="w"),
    _entry("access", **_CASE, what="w", who="w", purpose="teaching"),
    _entry("consent-given", **_CASE, purposes=["teaching", "research"], statement=_HASH, form=_HASH, who="w"),
    _entry("consent-withdrawn", **_CASE, purposes=["teaching"], statement=_HASH, who="w")]

_LARGE = 1 << 53
_VALUES = [
    0, -1, 1, _LARGE - 1, _LARGE, -_LARGE, 1 - _LARGE, True, False, None, 1.0, 1.5, "", "a", "A", "a-b", "-a", "a" * 32, "a" * 33, "é", "\0", "\x7f", [], {}, ["x"], [1],
    _HASH, "F" * 64, _HASH + "0", "2026-08-05T09:15:02Z", "2026-02-30T09:15:02.000000Z", "2026-12-31T23:59:60.000000Z", "2026-08-05T24:00:00.000000Z",
    "0000-01-01T00:00:00.000000Z", "9999-12-31T23:59:59.999999Z", "2024-02-29T00:00:00.000000Z", "2023-02-29T00:00:00.000000Z", "1/1", "01/1", "1/0", "0/1",
    "1/12345678901", "1234567890/1", "1/90000 ", "mpeg2", "lossless", "source", "crash", "kiroku-case/1", "video/mp2t", "audio", "sound", "suspended",
    "subject.json.age", "0x1", "F", f"9:{_HASH}", f"19:{_HASH}", f"24:{_HASH}", f"01:{_HASH}", f"4:{_HASH}0", f"4:{'F' * 64}", [f"4:{_HASH}"] * 25]
_KEYS = ["more", "plan", "of", "profile", "begins_ns", "rate_ppb", "frames", "samples", "stream", "final_token", "asked_ns", "quote", "no_quote"]


def _paths(value, path=()):
    yield path
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield from _paths(value[key], path + (key,))


def changed(entries, random):
    """The bytes of one of the entries with a value replaced, a key removed or added, their order, or one byte changed."""
    entry = copy.deepcopy(random.choice(entries))
    path = random.choice([each for each in _paths(entry) if each])
    within = entry
    for key in path[:-1]:
        within = within[key]
    way = random.random()
    if way < 0.6:
        within[path[-1]] = random.choice(_VALUES)
    elif way < 0.75:
        del within[path[-1]]
    elif way < 0.85 and isinstance(within, dict):
        within[random.choice(_KEYS)] = random.choice(_VALUES)
    elif isinstance(within, dict):
        members = list(within.items())
        random.shuffle(members)
        within.clear()
        within.update(members)
    line = bytearray(json.dumps(entry, ensure_ascii=random.random() < 0.5, separators=random.choice([(",", ":"), (", ", ": ")])).encode())
    if random.random() < 0.15:
        at = random.randrange(len(line))
        line[at] = random.choice([line[at] ^ 1 << random.randrange(8), 0x20, 0x09, 0x0D, 0x22, 0x7F, 0xC3, 0x2D, 0x2E, 0x30])
    return bytes(line).replace(b"\n", b" ").replace(b"\0", b" ")
