#!/usr/bin/env python3
"""The page that lays each of the five papers beside Kiroku: docs/papers.md, from entries.json of this folder.

Usage: docs/papers/make_page.py [--check]
  without an option   writes the tables anew between the page's marks
  --check             writes nothing; says what of the page or of an entry does not hold

The page asks for a paper's tables by a mark, and for the table of all verdicts by another:

  <!-- paper: P1 -->        ...  <!-- end of paper -->
  <!-- paper: verdicts -->  ...  <!-- end of paper -->

entries.json is a list of papers: {"key", "title", "sections"}; a section is {"section", "entries"}, in the paper's
own order. An entry is one thing that the paper says:

  place      where: "Table 1, liver"; "2.1, Eq. 1"
  says       what, in words
  value      the number, where it is one, with its "unit"
  direction  what is better: "more", "less", or "same" (Kiroku is to have the same); with "value" alone
  ours       figures of Kiroku's: ids such as "sim-contact#reaction_1" of docs/results/sim-contact.json; the values of
             several are added up. Or {"file", "pattern"}: the number that stands there in the source, in the first
             group of the pattern, times "times" (1 if absent)
  has        what Kiroku has, in words
  command    how to see it, where "ours" has no command of its own
  test       which tests prove it, as in docs/results/*.json
  picture    a picture of docs/
  verdict    better, equal, worse, not comparable, not done yet. Computed where "value" and "ours" are numbers: only
             "not comparable" may stand there
  why        in 25 words at most; for "not done yet": what is missing, while "has" and "command" are what it takes here

Numbers of Kiroku's are never typed: neither "has" nor "why" has one. Exit status: 0 the page holds, 1 it does not.
"""
import json
import pathlib
import re
import sys

FOLDER = pathlib.Path(__file__).resolve().parent
ROOT = FOLDER.parents[1]
RESULTS = ROOT / "docs/results"
sys.path.insert(0, str(RESULTS))
sys.dont_write_bytecode = True
import make_tables  # noqa: E402

PAGE = ROOT / "docs/papers.md"
VERDICTS = ("better", "equal", "worse", "not comparable", "not done yet")
AS_GOOD_AS = 0.02  # what is nearer is equal
MARKED = re.compile(r"(<!-- paper: ([A-Za-z0-9]+) -->\n).*?(<!-- end of paper -->)", re.DOTALL)
KEYS = {"place", "says", "value", "unit", "direction", "ours", "has", "command", "test", "picture", "verdict", "why"}
problems = make_tables.problems
where = ""


def wrong(sentence):
    problems.append(f"docs/papers/entries.json: {where}: {sentence}")


def run_of(name):
    path = RESULTS / f"{name}.json"
    if not path.exists():
        wrong(f"there is no docs/results/{name}.json")
        return {"figures": [], "command": ""}
    return json.loads(path.read_text("utf-8"))


def figures_of(entry):
    """The figures that an entry names, each with its run."""
    ours = entry.get("ours", [])
    if isinstance(ours, dict):
        return []
    found = []
    for name in [ours] if isinstance(ours, str) else ours:
        run, _, figure_id = name.partition("#")
        whole = run_of(run)
        fitting = [figure for figure in whole["figures"] if figure["id"] == figure_id]
        if not fitting:
            wrong(f"docs/results/{run}.json has no figure '{figure_id}'")
        found += [(whole, figure) for figure in fitting]
    return found


def from_source(ours):
    """A setting, as the source has it."""
    path = ROOT / ours["file"]
    match = re.search(ours["pattern"], path.read_text("utf-8")) if path.exists() else None
    if not match:
        wrong(f"{ours['file']} has nothing that fits '{ours['pattern']}'")
        return None
    value = float(f"{float(match[1].replace(',', '')) * ours.get('times', 1):.12g}")
    return int(value) if value.is_integer() else value


def value_of(entry, figures):
    """Kiroku's number, or None where there is none."""
    if isinstance(entry.get("ours"), dict):
        return from_source(entry["ours"])
    values = [figure["value"] for _, figure in figures]
    if not values or not all(isinstance(value, (int, float)) for value in values):
        return None
    if len({figure["unit"] for _, figure in figures}) > 1:
        wrong("figures of different units cannot be added up")
    return values[0] if len(values) == 1 else float(f"{sum(values):.6g}")


def verdict_of(entry, figures, ours):
    said = entry.get("verdict")
    if said and said not in VERDICTS:
        wrong(f"'{said}' is no verdict; they are {', '.join(VERDICTS)}")
    if "value" not in entry or ours is None:
        if "direction" in entry and said != "not done yet":
            wrong("a direction is for a number with a number beside it")
        if not said:
            wrong("no verdict: nothing can be computed from words")
        return said
    if said == "not comparable":
        return said
    if said:
        wrong("the verdict is computed from both numbers; leave it out")
    units = {figure["unit"] for _, figure in figures}
    if units and units != {entry.get("unit", "")}:
        wrong(f"the paper's unit is '{entry.get('unit', '')}', Kiroku's '{', '.join(units)}'")
    direction = entry.get("direction")
    if direction not in ("more", "less", "same"):
        wrong("which direction is better? more, less or same")
        return None
    if abs(ours - entry["value"]) <= AS_GOOD_AS * abs(entry["value"]):
        return "equal"
    if direction == "same":
        return "worse"
    return "better" if (ours > entry["value"]) == (direction == "more") else "worse"


def commands_of(entry, figures):
    found = []
    for run, figure in figures:
        test = figure.get("test", "")
        found.append(make_tables.command_of(run, test))
    if "command" in entry:
        found.append(f"`{entry['command']}`")
        make_tables.check_command(entry["command"], where)
    if "test" in entry:
        make_tables.check_test(entry["test"], where)
        found.append(entry["test"])
    return list(dict.fromkeys(found))


def cells(entry):
    global where
    where = f"'{entry.get('place', '')}', {entry.get('says', '')}"
    if unknown := entry.keys() - KEYS:
        wrong(f"no entry has {', '.join(sorted(unknown))}")
    figures = figures_of(entry)
    ours = value_of(entry, figures)
    verdict = verdict_of(entry, figures, ours)
    says = entry["says"]
    if "value" in entry:
        says += f": {make_tables.with_unit(entry['value'], entry.get('unit', ''))}"
    has = [entry["has"]] if "has" in entry else []
    if isinstance(entry.get("ours"), dict):
        has.append(make_tables.with_unit(ours, entry.get("unit", "")))
    elif ours is not None:
        has.append(make_tables.with_unit(ours, figures[0][1]["unit"]))
    else:
        has += [make_tables.with_unit(figure["value"], figure["unit"]) for _, figure in figures if figure["value"] is not None]
    if "picture" in entry:
        if not (ROOT / "docs" / entry["picture"]).exists():
            wrong(f"there is no docs/{entry['picture']}")
        has.append(f"[picture]({entry['picture']})")
    commands = commands_of(entry, figures)
    if isinstance(entry.get("ours"), dict):
        commands.append(f"`{entry['ours']['file']}`")
    for key in ("has", "why"):
        # P4, Eq. 6 and MPEG-2 are names.
        if re.search(r"(?<![\w.,-])\d", re.sub(r"`[^`]*`|\b(?:Eq\.|Table|Figure|RFC) \d+\w*", "", entry.get(key, ""))):
            wrong(f"'{key}' has a number: take it from docs/results by its id")
    if (verdict in ("worse", "not comparable", "not done yet") or entry.get("verdict") == "better") and not entry.get("why"):
        wrong(f"'{verdict}' needs its why")
    if not (has and commands):
        wrong("what Kiroku has, and the command or the test that shows it, are missing")
    return [entry["place"], says, "; ".join(has), verdict or "", entry.get("why", ""), "; ".join(commands)]


def tables_of(paper):
    out = ""
    for section in paper["sections"]:
        rows = [cells(entry) for entry in section["entries"]]
        header = ["where", "the paper", "Kiroku", "verdict", "why, or what is missing", "how to see it"]
        out += f"### {paper['key']}, {section['section']}\n" + make_tables.table(header, rows) + "\n"
    return out


def verdicts_of(papers):
    rows, totals = [], [0] * len(VERDICTS)
    for paper in papers:
        got = [cells(entry)[3] for section in paper["sections"] for entry in section["entries"]]
        counts = [got.count(verdict) for verdict in VERDICTS]
        totals = [total + count for total, count in zip(totals, counts)]
        anchor = re.sub(r"[^\w\- ]", "", f"{paper['key']}: {paper['title']}".lower()).replace(" ", "-")
        rows.append([f"[{paper['key']}](#{anchor})"] + [str(count) for count in counts] + [str(len(got))])
    rows.append(["all"] + [str(total) for total in totals] + [str(sum(totals))])
    return make_tables.table(["paper", *VERDICTS, "entries"], rows)


def main():
    papers = json.loads((FOLDER / "entries.json").read_text("utf-8"))
    by_key = {paper["key"]: paper for paper in papers}
    text = PAGE.read_text("utf-8")
    shown = set()

    def fill(match):
        shown.add(match[2])
        if match[2] == "verdicts":
            return match[1] + verdicts_of(papers) + match[3]
        if match[2] not in by_key:
            problems.append(f"docs/papers.md: entries.json has no paper '{match[2]}'")
            return match[0]
        return match[1] + tables_of(by_key[match[2]]) + match[3]

    new = MARKED.sub(fill, text)
    for key in sorted(by_key.keys() - shown):
        problems.append(f"docs/papers.md: no mark shows {key}")
    for paper in papers:
        if f"\n## {paper['key']}: {paper['title']}\n" not in new:
            problems.append(f"docs/papers.md: there is no heading '## {paper['key']}: {paper['title']}'")
    if "--check" in sys.argv[1:]:
        if new != text:
            problems.append("docs/papers.md: a table is not what entries.json and docs/results say; run docs/papers/make_page.py")
    elif new != text:
        PAGE.write_text(new, "utf-8")
    for problem in dict.fromkeys(problems):
        print(problem, file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
