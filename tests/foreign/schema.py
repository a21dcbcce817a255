"""A small validator of JSON Schema (draft 2020-12): the keywords that docs/reference/schema/ uses, and no others.

A schema with a keyword that is not known here is refused, so no rule of a schema is ever passed over silently.
"""
import json
import pathlib
import re

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "docs/reference/schema"
_TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
_SILENT = {"$schema", "$id", "$defs", "title", "description", "$comment"}


class Unfit(ValueError):
    """Where and why a value does not fit a schema."""


def load(name):
    """The schema docs/reference/schema/NAME.json."""
    return json.loads((FOLDER / f"{name}.json").read_text("utf-8"))


def _is(value, kind):
    if kind == "integer":
        return isinstance(value, int) and not isinstance(value, bool)
    if kind == "number":
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    return isinstance(value, _TYPES[kind])


def _one_of(value, schemas, root, where):
    """The schema whose `type` or `kind` is the value's is the one to say what is wrong."""
    reasons = []
    for each in schemas:
        each = _follow(each, root)
        try:
            check(value, each, root, where)
            return
        except Unfit as e:
            named = any(isinstance(value, dict) and each.get("properties", {}).get(key, {}).get("const", each) == value.get(key) for key in ("type", "kind"))
            reasons.append((not named, str(e)))
    raise Unfit(min(reasons)[1])


def _follow(schema, root):
    while "$ref" in schema:
        found = root
        for part in schema["$ref"].removeprefix("#/").split("/"):
            found = found[part]
        schema = found
    return schema


def check(value, schema, root=None, where="$"):
    """Raises Unfit where `value` does not fit `schema`."""
    root = schema if root is None else root
    schema = _follow(schema, root)

    def must(holds, why):
        if not holds:
            raise Unfit(f"{where}: {why}")

    for word, said in schema.items():
        if word in _SILENT or word in ("required", "additionalProperties"):
            continue
        if word == "type":
            kinds = said if isinstance(said, list) else [said]
            must(any(_is(value, kind) for kind in kinds), f"is no {' or '.join(kinds)}")
        elif word == "const":
            must(value == said and type(value) is type(said), f"is not {said!r}")
        elif word == "enum":
            must(value in said, f"is none of {', '.join(map(str, said))}")
        elif word in ("oneOf", "anyOf"):
            _one_of(value, said, root, where)
        elif word == "allOf":
            for each in said:
                check(value, each, root, where)
        elif word == "not":
            try:
                check(value, said, root, where)
            except Unfit:
                continue
            raise Unfit(f"{where}: is what it must not be")
        elif word == "pattern":
            must(not isinstance(value, str) or re.search(re.sub(r"\$$", r"\\Z", said), value), f"does not match {said}")
        elif word in ("minimum", "maximum"):
            must(not _is(value, "number") or (value >= said if word == "minimum" else value <= said), f"is beyond {word} {said}")
        elif word == "exclusiveMinimum":
            must(not _is(value, "number") or value > said, f"is not above {said}")
        elif word in ("minLength", "maxLength"):
            must(not isinstance(value, str) or (len(value) >= said if word == "minLength" else len(value) <= said), f"is beyond {word} {said}")
        elif word in ("minItems", "maxItems"):
            must(not isinstance(value, list) or (len(value) >= said if word == "minItems" else len(value) <= said), f"is beyond {word} {said}")
        elif word == "uniqueItems":
            must(not said or not isinstance(value, list) or len({json.dumps(v, sort_keys=True) for v in value}) == len(value), "has one item twice")
        elif word == "items":
            for i, item in enumerate(value if isinstance(value, list) else []):
                check(item, said, root, f"{where}[{i}]")
        elif word == "properties":
            for key in value if isinstance(value, dict) else ():
                if key in said:
                    check(value[key], said[key], root, f"{where}.{key}")
        else:
            raise NotImplementedError(f"the schema has {word}, which this validator does not know")
    if isinstance(value, dict):
        for key in schema.get("required", ()):
            must(key in value, f"lacks {key}")
        more = schema.get("additionalProperties", True)
        for key in value.keys() - schema.get("properties", {}).keys():
            must(more is not False, f"has {key}")
            if isinstance(more, dict):
                check(value[key], more, root, f"{where}.{key}")
