#!/usr/bin/env python3
"""Writes docs/reference/configuration.md from deploy/kiroku.toml, the file that `kiroku init` writes.

Usage: docs/reference/make_configuration.py [--check]
  --check  writes nothing; says whether the page is current, and whether the file explains every key that
           apps/configuration reads

Exit status: 0 written or current, 1 not.
"""
import pathlib
import re
import sys
import textwrap

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/reference/configuration.md"
HEAD = """# Configuration

`kiroku.toml` in a recorder's home says how it records. `kiroku init` writes the file with every key, most of them as
comments. This page is generated from it (`deploy/kiroku.toml`) by `docs/reference/make_configuration.py`.

- Unknown keys and wrong values are refused with line and column: `kirokud --check`.
- Options of a command line go before what stands in the file.
- "Set" means that the file as written sets the value. Other values are examples; without the key nothing of it happens,
  or the program's own default holds.
- `kirokud` alone reads `[[room]]` and what is below it. `kiroku record` does not.
"""


def blocks(text):
    """Sections, each with its name, what stands above it, and its keys: (key, value, set, sentences)."""
    sections, section, sentences = [], None, []
    for line in text.splitlines():
        bare = re.sub(r"^((?:# ?)*)", "", line)
        depth = len(line) - len(bare)
        header = re.fullmatch(r"(\[\[?[a-z0-9_.]+\]\]?)", bare)
        key = re.fullmatch(r"([a-z0-9_]+) = (.+)", bare)
        if header:
            section = [header[1], sentences, []]
            sections.append(section)
            sentences = []
        elif key and section:
            section[2].append((key[1], key[2], depth == 0, sentences))
            sentences = []
        elif not bare or bare.startswith("---"):
            sentences = []
        else:
            sentences.append(bare)
    return sections


def page_of(text):
    out, seen = [HEAD], set()
    for name, sentences, keys in blocks(text):
        keys = [key for key in keys if (name, key[0]) not in seen or key[3]]
        if name in seen and not keys:
            continue
        if name not in seen:
            out.append(f"\n## `{name}`\n")
            if sentences:
                out.append(textwrap.fill(" ".join(sentences), 120, break_on_hyphens=False) + "\n")
        seen.add(name)
        for key, value, is_set, told in keys:
            seen.add((name, key))
            out.append(f"\n**`{key}`** ({'set' if is_set else 'for example'} `{value}`)\n")
            if told:
                out.append("\n" + textwrap.fill(" ".join(told), 120, break_on_hyphens=False) + "\n")
    return "".join(out)


def keys_that_are_read():
    found = set()
    for file in (ROOT / "apps/configuration").glob("*.cpp"):
        # A key is the first text of a call: top.text("profile", ...), for_each_table(top, "room", ...).
        found.update(re.findall(r"\b[\w.]+\((?:[\w*.]+, )*\"([a-z][a-z0-9_]+)\"[,)]", file.read_text("utf-8")))
    return found


def main():
    text = (ROOT / "deploy/kiroku.toml").read_text("utf-8")
    page, problems = page_of(text), []
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(page, "utf-8")
    elif PAGE.read_text("utf-8") != page:
        problems.append("docs/reference/configuration.md is not deploy/kiroku.toml: run docs/reference/make_configuration.py")
    explained = {word for name, _, keys in blocks(text) for word in re.findall(r"[a-z0-9_]+", name) + [key[0] for key in keys]}
    for key in sorted(keys_that_are_read() - explained):
        problems.append(f"deploy/kiroku.toml does not explain '{key}', which apps/configuration reads")
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
