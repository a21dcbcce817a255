#!/usr/bin/env python3
"""Checks the documents: links, anchors, names of tests, names of pages in the whole tree, the site's contents, and how
lines are set.

Usage: tests/lint/pages.py [--wrap]
  --wrap   first breaks paragraphs and list items that have a line of more than 120 columns

A table's cell holds a value or a phrase, of 25 words at most; this is asked of docs/tutorials, docs/how-to and
docs/results. Exit status: 0 nothing was found, 1 something was.
"""
import pathlib
import re
import subprocess
import sys
import textwrap

ROOT = pathlib.Path(__file__).resolve().parents[2]
WIDTH, MOST_WORDS = 120, 25
SHORT_CELLS = ("docs/tutorials/", "docs/how-to/", "docs/results/")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s#]*)(?:#([^)\s]*))?\)")
TEST = re.compile(r"\bTEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\)")
# `Suite.Name`, `Suite.*`, `Suite.BeginningOfAName…`, `…EndOfAName`; a suite with parameters has a word before it.
NAMED_TEST = re.compile(r"`(?:\w+/)?(?:([A-Z]\w*)\.)?(…?[A-Z*][\w*]*…?)`")
problems = []


def outside_code(text):
    """Lines with their numbers, those between fences left out."""
    fence = False
    for number, line in enumerate(text.split("\n"), 1):
        if line.lstrip().startswith("```"):
            fence = not fence
        elif not fence:
            yield number, line


def anchors(text):
    """What headings are called in a link, as GitHub and the site have it."""
    found = set()
    for _, line in outside_code(text):
        if heading := re.match(r"#+ (.*)", line):
            title = re.sub(r"[`*]|\]\([^)]*\)|\[", "", heading[1]).strip().lower()
            name = re.sub(r"[^\w\- ]", "", title).replace(" ", "-")
            found.add(name if name not in found else next(f"{name}-{n}" for n in range(1, 99) if f"{name}-{n}" not in found))
    return found


def check_links(page, text):
    for number, line in outside_code(text):
        for target, anchor in LINK.findall(re.sub(r"`[^`]*`", "", line)):
            if re.match(r"[a-z]+:", target):
                continue
            path = (page.parent / target).resolve() if target else page
            where = f"{page.relative_to(ROOT)}:{number}"
            if not path.exists():
                problems.append(f"{where}: there is no {target}")
            elif anchor and path.suffix == ".md" and anchor not in anchors(path.read_text("utf-8")):
                problems.append(f"{where}: {target or page.name} has no heading #{anchor}")


def tests_there(tracked):
    """Names of GoogleTest's cases by their suites."""
    found = {}
    for name in tracked:
        if name.startswith("tests/") and name.endswith(".cpp") and (ROOT / name).exists():
            for suite, case in TEST.findall((ROOT / name).read_text("utf-8")):
                found.setdefault(suite, set()).add(case)
    return found


def check_tests(page, text, suites):
    for number, line in outside_code(text):
        for suite, case in NAMED_TEST.findall(line):
            if not suite and not case.startswith("…"):
                continue
            # A name in another language looks alike, as `Error.prototype` does, but begins with a small letter.
            wanted = re.compile(re.escape(case).replace("…", ".*").replace(r"\*", ".*"))
            cases = suites.get(suite, set()) if suite else set().union(*suites.values())
            if not any(wanted.fullmatch(each) for each in cases):
                problems.append(f"{page.relative_to(ROOT)}:{number}: there is no test {suite}{'.' if suite else ''}{case}")


def check_lines(page, text):
    name = str(page.relative_to(ROOT))
    for number, line in outside_code(text):
        if line.startswith("|"):
            cells = re.split(r"(?<!\\)\|", line)[1:-1]
            if name.startswith(SHORT_CELLS) and any(len(cell.split()) > MOST_WORDS for cell in cells):
                problems.append(f"{name}:{number}: a cell has more than {MOST_WORDS} words; put sentences below the table")
        elif len(line) > WIDTH and " " in line.strip()[2:] and not line.startswith(("![", "<!--")):
            # Code of a line is not broken, so a line that is one piece of code may be longer.
            if max(map(len, re.sub(r"`[^`]*`|\[[^\]]*\]\([^)]*\)", lambda m: m[0].replace(" ", "_"), line).split())) < WIDTH - 20:
                problems.append(f"{name}:{number}: more than {WIDTH} columns; tests/lint/pages.py --wrap breaks it")


def wrapped(text):
    out, block, fence = [], [], False

    def flush():
        if any(len(line) > WIDTH for line in block):
            lead = re.match(r"(\s*(?:[-*] |\d+\. )?)", block[0])[1]
            whole = " ".join(line.strip() for line in block)
            whole = re.sub(r"`[^`]*`|\[[^\]]*\]\([^)]*\)", lambda m: m[0].replace(" ", "\x00"), whole)
            out.extend(textwrap.fill(whole, WIDTH, initial_indent=re.match(r"\s*", block[0])[0], break_long_words=False,
                                     subsequent_indent=" " * len(lead), break_on_hyphens=False).replace("\x00", " ").split("\n"))
        else:
            out.extend(block)
        block.clear()

    for line in text.split("\n"):
        if line.lstrip().startswith("```"):
            flush()
            fence = not fence
            out.append(line)
        elif (fence or not line.strip() or line.startswith(("|", "#", "<!--", "!["))
              or line.startswith("    ") and not block and not re.match(r"\s*[-*] ", line)):
            flush()
            out.append(line)
        else:
            if re.match(r"\s*([-*]|\d+\.) ", line):
                flush()
            block.append(line)
    flush()
    return "\n".join(out)


def main():
    tracked = subprocess.run(["git", "-C", str(ROOT), "ls-files"], check=True, capture_output=True, text=True).stdout.split("\n")
    pages = [ROOT / name for name in tracked if name.endswith(".md") and (ROOT / name).exists()]
    suites = tests_there(tracked)
    for page in pages:
        text = page.read_text("utf-8")
        if "--wrap" in sys.argv[1:] and (new := wrapped(text)) != text:
            page.write_text(new, "utf-8")
            text = new
        check_links(page, text)
        check_lines(page, text)
        check_tests(page, text, suites)

    # Comments, messages and scripts name pages by their path.
    for name in filter(None, tracked):
        try:
            text = (ROOT / name).read_text("utf-8")
        except (UnicodeDecodeError, FileNotFoundError, IsADirectoryError):
            continue
        for named in set(re.findall(r"\bdocs/[a-z/-]+\.(?:md|py|json)\b", text)):
            if not (ROOT / named).exists():
                problems.append(f"{name}: there is no {named}")

    # A translation runs the same commands; the tests follow the English page.
    for page in (ROOT / "docs/tutorials/ja").glob("*.md"):
        here, there = (re.findall(r"^```.*?^```$", one.read_text("utf-8"), re.MULTILINE | re.DOTALL) if one.exists() else None
                       for one in (page, page.parent.parent / page.name))
        if here != there:
            problems.append(f"docs/tutorials/ja/{page.name}: its commands and outputs are not those of the English page")

    site = set(re.findall(r": ([a-z/-]+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.MULTILINE))
    there = {str(page.relative_to(ROOT / "docs")) for page in pages if page.is_relative_to(ROOT / "docs")}
    for name in sorted(there - site):
        problems.append(f"docs/{name}: mkdocs.yml does not list it; the kinds are tutorials, how-to, reference, explanation, results")
    for name in sorted(site - there):
        problems.append(f"mkdocs.yml: there is no docs/{name}")
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
