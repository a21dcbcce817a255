#!/usr/bin/env python3
"""The tutorials, followed as they stand: every command of a page runs in order, and what the page shows is printed.

Usage: tutorials_test.py SOURCE_FOLDER PROGRAMS_FOLDER PAGE...
  PAGE   pages of docs/tutorials that are followed one after the other in one folder: first-case first-plan

Numbers, dates, names of cases and hashes differ from run to run; the words around them must not. What a person does in
a second terminal or in a browser is done here by the few lines of `instead`.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

SOURCE, PROGRAMS = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])

instead = {
    "deploy/demo": ":",  # the programs are built
    "export PATH=$PWD/build/release/apps:$PATH": ":",
    "kiroku view": "timeout -s INT 3 kiroku view || true",  # a person presses Ctrl-C
    # In the first terminal, until a person ends it; what the page shows is what it says at first.
    "kiroku respire serve chest/ct.nrrd chest/lung.json --case $FLUOROSCOPY":
        "kiroku respire serve chest/ct.nrrd chest/lung.json --case $FLUOROSCOPY >served 2>&1 & server=$!; "
        "until grep -q 'Ctrl-C ends it' served || ! kill -0 $server; do sleep 0.1; done; kill $server; wait $server; cat served",
    # In the browser the model is fitted before it is saved and sealed; tests/page/fluoroscopy.test.ts does that.
    "kiroku plan verify chest/fitted.seal.json":
        "cp chest/lung.json chest/fitted.json; kiroku plan seal chest/fitted.json; kiroku plan verify chest/fitted.seal.json",
    "kirokud": "kirokud & daemon=$!; until kiroku status >/dev/null 2>&1; do sleep 0.1; done",  # in the second terminal
    "kill -9 $(pidof kirokud)": "kill -9 $daemon",  # others may run beside this test
}
OF_THIS_MACHINE = re.compile("clock")  # whether it is synchronised


def blocks(page, kind):
    return re.findall(rf"^```{kind}\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)


def plain(text):
    """What is the same in each run."""
    text = re.sub(r"\d{8}T\d{6}Z-[0-9a-f]{8}", "CASE", text)
    return re.sub(r"\d+", "#", re.sub(r"[ \t]+", " ", text))


def follow(name, folder):
    page = (SOURCE / f"docs/tutorials/{name}.md").read_text("utf-8")
    lines = "\n".join(blocks(page, "sh")).split("\n")
    # A verdict that is not "intact" is what the page wants to show, so statuses are not looked at.
    script = "exec 2>&1\ndaemon=\n" + "\n".join(instead.get(line, line) for line in lines)
    script += "\nif [[ $daemon ]]; then kill -INT $daemon; wait $daemon; fi\n"
    environment = dict(os.environ, PATH=f"{PROGRAMS}:{os.environ['PATH']}", KIROKU_PASSPHRASE="correct horse battery",
                       KIROKU_HOME=str(folder / "build/tutorial/home"))
    begin = folder if name == "first-case" else folder / "build/tutorial"
    begin.mkdir(parents=True, exist_ok=True)
    if name != "first-case":
        script = "CASE=$(basename \"$(ls -d $KIROKU_HOME/archive/2* 2>/dev/null | head -1)\" 2>/dev/null)\n" + script
    output = subprocess.run(["bash", "-c", script], cwd=begin, env=environment, stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True).stdout
    printed = plain(output)
    missing = [line for block in blocks(page, "text") for line in block.splitlines()
               if line.strip() not in ("", "...") and plain(line.strip()) not in printed and not OF_THIS_MACHINE.search(line)]
    if missing:
        print(output)
        print(f"FAILED: {name}.md shows what was not printed:", *missing, sep="\n  ")
    return not missing


def main():
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        for name in ("docs", "deploy"):
            (folder / name).symlink_to(SOURCE / name)
        good = all([follow(name, folder) for name in sys.argv[3:]])
    if not good:
        return 1
    print("PASSED: the pages' commands print what the pages show")
    return 0


if __name__ == "__main__":
    sys.exit(main())
