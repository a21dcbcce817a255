"""JSON as the case format has it (docs/reference/format.md, "Ledger entries" and "Limits"): keys are unique, numbers are
integers below 2^53, texts are UTF-8, and neither levels nor values are without end."""
import json
import re

LARGEST = (1 << 53) - 1


class Malformed(ValueError):
    """What is no JSON of the format, and why."""


def _object(pairs):
    made = dict(pairs)
    if len(made) != len(pairs):
        raise Malformed("a key stands twice")
    if any("\0" in key for key in made):
        raise Malformed("a key holds NUL")
    return made


def _integer(text):
    value = int(text)
    if abs(value) > LARGEST:
        raise Malformed(f"{text} is no integer below 2^53")
    return value


def _refuse(text):
    raise Malformed(f"{text} is no integer")


def _measure(value, level, levels):
    """How many values are in `value`; refuses more than `levels` levels of lists and objects."""
    if isinstance(value, (dict, list)):
        if level == levels:
            raise Malformed(f"more than {levels} levels")
        return 1 + sum(_measure(v, level + 1, levels) for v in (value.values() if isinstance(value, dict) else value))
    if isinstance(value, str) and re.search("[\0\ud800-\udfff]", value):
        raise Malformed("a text holds NUL or half a surrogate pair")
    return 1


def parse(line, levels=4, values=131072, fractions=False):
    """The object that the bytes `line` are. `fractions` allows numbers such as 36.9."""
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError as e:
        raise Malformed(f"byte {e.start} is no UTF-8") from e
    if control := re.search("[\0-\x1f]", text):
        raise Malformed(f"character {control.start()} is a control character")
    try:
        value = json.loads(text, object_pairs_hook=_object, parse_int=_integer, parse_float=float if fractions else _refuse, parse_constant=_refuse)
    except (json.JSONDecodeError, RecursionError) as e:
        raise Malformed(str(e)) from e
    if not isinstance(value, dict):
        raise Malformed("no object")
    if _measure(value, 0, levels) > values:
        raise Malformed(f"more than {values} values")
    return value
