#!/usr/bin/env python3
"""Writes docs/reference/commands.md from what the programs print for --help.

Usage: docs/reference/make_commands.py [--check] FOLDER
  FOLDER   where the programs are: build/release/apps
  --check  writes nothing; says whether the page is current

Exit status: 0 written or current, 1 not current, 2 a program could not be run.
"""
import pathlib
import re
import subprocess
import sys

PAGE = pathlib.Path(__file__).resolve().parent / "commands.md"
HEAD = """# Commands

This page is what each program and command prints for `--help`. It is generated from the built programs:

```sh
docs/reference/make_commands.py build/release/apps
```

Every command of `kiroku` has `--help`. Those that print results have `--json` for other programs.
"""


def commands_below(folder, words):
    """The page of a command, then those of its subcommands."""
    answer = subprocess.run([str(folder / words[0]), *words[1:], "--help"], capture_output=True, text=True)
    if answer.returncode != 0:
        print(f"{' '.join(words)} --help failed with exit status {answer.returncode}: {answer.stderr.strip()}", file=sys.stderr)
        sys.exit(2)
    name = " ".join(words)
    yield f"\n{'#' * min(len(words) + 1, 4)} {name}\n```text\n{answer.stdout.rstrip()}\n```\n"
    listed = re.search(r"^Commands:\n((?:  .*\n)+)", answer.stdout, re.MULTILINE)
    for command in re.findall(r"^  ([a-z][a-z-]*)", listed[1], re.MULTILINE) if listed else []:
        yield from commands_below(folder, words + [command])


def main():
    arguments = [one for one in sys.argv[1:] if one != "--check"]
    if len(arguments) != 1:
        sys.exit(__doc__)
    folder = pathlib.Path(arguments[0])
    page = HEAD + "".join("".join(commands_below(folder, [program])) for program in ("kiroku", "kirokud", "kiroku-fleet", "kiroku-verify"))
    if "--check" in sys.argv[1:]:
        if PAGE.read_text("utf-8") != page:
            print(f"docs/reference/commands.md is not what --help prints: run docs/reference/make_commands.py {folder}", file=sys.stderr)
            return 1
        return 0
    PAGE.write_text(page, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
