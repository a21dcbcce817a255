#!/usr/bin/env python3
"""Tables of figures in docs/results/*.md, generated from the figures in docs/results/*.json.

Usage: docs/results/make_tables.py [--check]
  without an option   writes the tables anew between their marks
  --check             writes nothing; says which table and which JSON disagree, and which JSON no page shows

A page asks for tables by a mark, and this program writes what stands between the marks:

  <!-- figures: unseal verify -->     the runs docs/results/unseal.json and verify.json, in this order
  <!-- end of figures -->

One JSON file is what one command measured:

  title, command    what was measured, and how to measure it again
  machine           a key of machines.json
  load              what else ran: words, or the load average; "unknown" where nobody noted it
  date, commit      when and of which commit it was measured; null where nobody noted it
  stated            {"commit", "date"}: since when a page states these figures; they are no younger
  minutes           how long the command takes (may be absent)
  note              sentences below the table (may be absent)
  layout            "grid": a row for each `what`, a column for each `measure` (may be absent: a row for each figure)
  figures           a list of {"id", "what", "value", "unit"} and, where there are any,
      goal          {"at_most"}, {"at_least"}, {"equals"}: a number of the same unit; {"text"}: words
      peer          {"name", "value", "unit"}: what somebody else's program, or the paper, needs for the same
      stages        of ci.json: the stages of .ci/run whose minutes these are (record.py --stages)
      measure       which of several values of one `what` this is
      test          the test that fails when the goal is missed: names of tests between backticks, "…" or * for what
                    is left out. They are looked for in the sources
      note          sentences below the table

A value that misses its goal is shown in bold with "(missed)". In the runs of validation-*.json every figure is a
test's. Exit status: 0 all agree, 1 something does not.
"""
import fnmatch
import functools
import json
import pathlib
import re
import shlex
import sys
import textwrap

FOLDER = pathlib.Path(__file__).resolve().parent
ROOT = FOLDER.parents[1]
MOST_WORDS = 25  # of a cell
WIDTH = 120  # columns of prose
MARKED = re.compile(r"(<!-- figures: ([a-z0-9 -]+?) -->\n).*?(<!-- end of figures -->)", re.DOTALL)
GROUPS = ("case", "tsa", "user", "sim", "plan", "train")  # commands of kiroku that have commands
problems = []


def number(value):
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    if isinstance(value, int) or float(value).is_integer() and abs(value) >= 1000:
        return f"{int(value):,}" if abs(value) >= 1000 else str(int(value))
    return repr(value)


def with_unit(value, unit):
    return f"{number(value)} {unit}".strip()


def met(figure):
    """Whether the figure meets its goal; None where that is no question of numbers."""
    goal, value = figure.get("goal", {}), figure["value"]
    if not isinstance(value, (int, float)):
        return None
    if "at_most" in goal:
        return value <= goal["at_most"]
    if "at_least" in goal:
        return value >= goal["at_least"]
    if "equals" in goal:
        return value == goal["equals"]
    return None


def measured(figure, named=False):
    text = with_unit(figure["value"], figure["unit"])
    if met(figure) is False:
        text = f"**{text} (missed)**"
    return f"{figure['measure']} {text}" if named and "measure" in figure else text


def goal_text(figure):
    goal = figure.get("goal")
    if goal is None:
        return ""
    for key, sign in (("at_most", "≤"), ("at_least", "≥"), ("equals", "=")):
        if key in goal:
            return f"{sign} {with_unit(goal[key], '' if figure['unit'].startswith('of ') else figure['unit'])}"
    return goal["text"]


def row(cells):
    for cell in cells:
        if len(cell.split()) > MOST_WORDS:
            problems.append(f"a cell has more than {MOST_WORDS} words: {cell}")
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"


def table(header, rows):
    return row(header) + "|" + "---|" * len(header) + "\n" + "".join(row(cells) for cells in rows)


def grid(figures):
    measures = list(dict.fromkeys(figure["measure"] for figure in figures))
    header = ["what"]
    for measure in measures:
        goals = list(dict.fromkeys(goal_text(figure) for figure in figures if figure["measure"] == measure))
        header.append(f"{measure} ({goals[0]})" if goals[0] else measure)
    rows = []
    for what in dict.fromkeys(figure["what"] for figure in figures):
        cells = {figure["measure"]: measured(figure) for figure in figures if figure["what"] == what}
        rows.append([what] + [cells.get(measure, "") for measure in measures])
    return table(header, rows)


def merged(figures):
    """Figures of one `what` under one test are one row."""
    groups = []
    for figure in figures:
        if groups and "test" in figure and groups[-1][0]["what"] == figure["what"] and groups[-1][0].get("test") == figure["test"]:
            groups[-1].append(figure)
        else:
            groups.append([figure])
    return groups


def plain(figures):
    columns = [("measured", lambda group: "; ".join(measured(figure, True) for figure in group))]
    if any("goal" in figure for figure in figures):
        columns.append(("goal", lambda group: "; ".join(dict.fromkeys(filter(None, map(goal_text, group))))))
    if any("peer" in figure for figure in figures):
        columns.append(("peer", lambda group: "".join(
            f"{f['peer']['name']}: {with_unit(f['peer']['value'], f['peer']['unit'])}" for f in group if "peer" in f)))
    if any("test" in figure for figure in figures):
        columns.append(("test", lambda group: group[0]["test"]))
    return table(["what"] + [name for name, _ in columns],
                 [[group[0]["what"]] + [cell(group) for _, cell in columns] for group in merged(figures)])


@functools.lru_cache(None)
def tests():
    """All tests in GoogleTest, as Suite.Name."""
    found = set()
    for file in sorted((ROOT / "tests").rglob("*_test.cpp")):
        found.update(f"{suite}.{name}" for suite, name in
                     re.findall(r"^TEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\)", file.read_text("utf-8"), re.MULTILINE))
    return found


@functools.lru_cache(None)
def programs():
    """Tests and benches as programs."""
    lists = "".join(file.read_text("utf-8") for file in sorted((ROOT / "tests").rglob("CMakeLists.txt")))
    return set(re.findall(r"\b(\w+_(?:test|bench))\b", lists))


def is_test(pattern):
    return bool(fnmatch.filter(tests(), pattern.replace("…", "*")))


def check_test(text, where):
    """Whether the tests and programs that a `test` names are there."""
    named = re.findall(r"`([^`]*)`", text)
    if not named:
        problems.append(f"{where}: '{text}' names no test")
    for name in named:
        if name.endswith(("_test", "_bench")):
            if name.rsplit("/", 1)[-1] not in programs():
                problems.append(f"{where}: there is no program {name}")
        elif name.startswith("ctest "):
            check_command(name, where)
        elif not is_test(name):
            problems.append(f"{where}: no test is called {name}")


@functools.lru_cache(None)
def subcommands():
    return set(re.findall(r"^#+ (kiroku\S*(?: \S+)*)$", (ROOT / "docs/reference/commands.md").read_text("utf-8"), re.MULTILINE))


def check_command(command, where):
    """Whether what a command begins with is there: a script, a program of the build, a command of kiroku's."""
    tokens = shlex.shlex(command, posix=True, punctuation_chars=";&|")
    tokens.whitespace_split = True
    parts = [[]]
    for token in tokens:
        if set(token) <= set(";&|") or token == "do":
            parts.append([])
        elif parts[-1] or token != "time" and not re.match(r"[A-Z_]+=", token):
            parts[-1].append(token)
    for words in filter(None, parts):
        first, name = words[0], words[0].rsplit("/", 1)[-1]
        if first.startswith("kiroku"):
            if not any(" ".join(words[:count]) in subcommands() for count in ((2, 3) if words[1:2] and words[1] in GROUPS else (1, 2))):
                problems.append(f"{where}: docs/reference/commands.md has no command '{' '.join(words[:3])}'")
        elif first.startswith("build/"):
            if name not in programs():
                problems.append(f"{where}: no test and no bench is called {name}")
            for wanted in [word.split("=", 1)[1] for word in words if word.startswith("--gtest_filter=")]:
                if wanted != "TEST" and not all(map(is_test, re.sub(r"(^|:)\w+/", r"\1*", wanted).split(":"))):
                    problems.append(f"{where}: no test is called {wanted}")
        elif first not in ("for", "done", "ctest", "cmake") and not (ROOT / first).exists():
            problems.append(f"{where}: there is no {first}")


def when(run):
    if run["date"]:
        return f"{run['date']}, commit {run['commit'] or 'not recorded'}"
    return f"not recorded; stated since {run['stated']['date']} ({run['stated']['commit']})"


def filled(text, **options):
    # Code in a line of prose is not broken.
    whole = re.sub(r"`[^`]*`|\[[^\]]*\]\([^)]*\)", lambda code: code[0].replace(" ", "\x00"), text)
    return textwrap.fill(whole, WIDTH, break_long_words=False, break_on_hyphens=False, **options).replace("\x00", " ")


def command_of(run, test=""):
    """A run's command, for one test where it has one for each."""
    if run["command"].startswith("no bench"):
        return run["command"]
    named = re.findall(r"`([^`]*)`", test)
    one = ":".join(name.replace("…", "*") for name in named if not name.endswith("_test"))
    return f"`{run['command'].replace('gtest_filter=TEST', f'gtest_filter={one}') if one else run['command']}`"


def shown(name, machines):
    run = json.loads((FOLDER / f"{name}.json").read_text("utf-8"))
    where = f"docs/results/{name}.json"
    check_command(run["command"], where)
    for figure in run["figures"]:
        if "test" in figure:
            check_test(figure["test"], f"{where}: {figure['id']}")
        elif name.startswith("validation-") and "gtest_filter=TEST" in run["command"]:
            problems.append(f"{where}: {figure['id']} names no test; a figure without one belongs to a run with its command")
    if run["machine"] not in machines:
        problems.append(f"{name}.json: machines.json has no machine '{run['machine']}'")
    out = f"**{run['title']}**\n\n" + (grid if run.get("layout") == "grid" else plain)(run["figures"]) + "\n"
    notes = [f"- *{figure['what']}*: {figure['note']}" for figure in run["figures"] if "note" in figure]
    if notes:
        out += "".join(filled(note, subsequent_indent="  ") + "\n" for note in notes) + "\n"
    if "note" in run:
        out += filled(run["note"]) + "\n\n"
    command = command_of(run)
    minutes = f" ({run['minutes']} min)" if "minutes" in run else ""
    out += filled(f"Command: {command}{minutes}. Machine: {run['machine']}. Load: {run['load']}. Measured: {when(run)}.") + "\n"
    return out


def main():
    check = "--check" in sys.argv[1:]
    machines = json.loads((FOLDER / "machines.json").read_text("utf-8"))
    used = {"machines"}
    for page in sorted(FOLDER.glob("*.md")):
        text = page.read_text("utf-8")

        def fill(match):
            names = match[2].split()
            used.update(names)
            if names == ["machines"]:
                return match[1] + table(["machine", "what it is"], [[f"`{k}`", v] for k, v in machines.items()]) + match[3]
            return match[1] + "\n".join(shown(name, machines) for name in names) + match[3]

        new = MARKED.sub(fill, text)
        if new == text:
            continue
        if check:
            problems.append(f"docs/results/{page.name}: a table is not what its JSON says; run docs/results/make_tables.py")
        else:
            page.write_text(new, "utf-8")
    for file in sorted(FOLDER.glob("*.json")):
        if file.stem not in used:
            problems.append(f"docs/results/{file.name}: no page shows these figures; name it in a mark")
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
