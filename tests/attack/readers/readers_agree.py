#!/usr/bin/env python3
"""One case, told by every reader: what a lawyer could read as two answers to one question fails.

Usage: readers_agree.py PROGRAMS [--page STAGE] [--all] [--only NAME]
  PROGRAMS  the folder of kiroku and the programs it becomes, and of kiroku-verify, such as build/release/apps
  --page    where the viewer's page was built, with its npm packages, such as build/release/viewer/page/page
  --all     every folder of tests/foreign/forgeries.py; otherwise the first of each finding code and some others
  --only    that folder alone, and prints what each reader says of it

Readers: kiroku-verify in words and as JSON, the report in English, Japanese and as PDF, the certificate, the page's chain of
proof (viewer/web/src/verification/chain.ts), and for some the scripts with stock tools.

Exit status: 0 all agree, 1 some do not, each named.
"""
import argparse
import concurrent.futures
import dataclasses
import html
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(ROOT / "tests/foreign"))

import age  # noqa: E402
import forgeries  # noqa: E402
import note  # noqa: E402
import stamp  # noqa: E402

LONGEST_WAIT_S = 60   # it only ends a test that fails
AS_ONE_WHO_MAY_NOT_READ_ALL = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"] if os.geteuid() == 0 else []

# Of each verdict: exit status, words of kiroku-verify, words of the report in English and Japanese, tone.
VERDICTS = {
    "intact": (0, "INTACT:", "INTACT", "改変なし", "good"),
    "intact-with-gaps": (0, "INTACT, WITH STATED GAPS:", "INTACT, WITH STATED GAPS", "改変なし（欠落の記載あり）", "good"),
    "intact-excerpt": (4, "INTACT EXCERPT:", "INTACT EXCERPT", "抜粋として改変なし", "good"),
    "unproven": (3, "UNPROVEN:", "COULD NOT BE PROVED", "証明できない", "caution"),
    "incomplete": (3, "INCOMPLETE:", "NOT FINISHED", "未完了", "caution"),
    "tampered": (1, "TAMPERED:", "DOES NOT HOLD (TAMPERED)", "成立しない（改変あり）", "bad"),
}
ANSWERS = {"Yes": "はい", "Yes, with stated gaps": "はい（記載された欠落あり）", "In part": "一部のみ", "Only from inside": "内部のみ",
           "Could not be checked": "確認できない", "Not finished": "未完了", "Not checked": "未検査", "No": "いいえ"}
GOOD, IN_PART = {"Yes", "Yes, with stated gaps"}, {"In part", "Only from inside"}
LINKS = ("segments", "ledger", "checkpoints", "tokens", "authority")
# What limits the worth of the times, by finding: what kiroku-verify, report and receipt in English, in Japanese, and the certificate's limits say.
TIME_REMARKS = {
    "stamped-after-close": ("when it was recorded, and for how long, rests", "When it was recorded, and for how long, rests", "いつ、どれだけの時間記録されたかは、記録装置のみに",
                            "That an outside clock confirms any of the times above: the time stamps"),
    "first-stamped-late": ("by the case clock it began", "By the case clock recording began", "症例時計によれば、記録は最初の", "That an outside clock confirms when recording began"),
    "segments-entered-late": ("by the case clock some of it ended", "By the case clock some of it ended", "タイムスタンプの後に記入された記録の一部は",
                              "That an outside clock confirms when all of it was recorded"),
    "end-stamped-late": ("that it ended when it says rests", "That recording ended when it says rests", "そこで終わったことは記録装置のみに",
                         "That recording ended when the record says"),
    "clock-differs": ("the recorder's clock was wrong", "By the time stamps the recorder's clock was wrong", "タイムスタンプによれば記録装置の時計は",
                      "That the times above by the recorder's clock are right"),
    "close-utc-differs": ("from opening to closing the recorder's clock", "How long it lasted, the case clock alone says", "長さを示すのは症例時計のみです",
                          "That the record lasted from the opening to the closing"),
}
# Folders of which each reader must say what its time is not worth, and those whose sentence says no such thing.
BY_TIME = {"sound", "stamped_after_the_end_alone", "wall_clock_wrong", "ended_a_year_later", "end_stamped_later", "film_of_before_the_first_token",
           "old_film_behind_the_first_token", "old_film_in_the_midst",
           "excerpt_of_a_case_that_was_stamped_after_its_end_alone", "excerpt_of_film_of_before_the_first_token"}
# A shell takes a second and more for each.
REMARKS_OF_SCRIPTS = {"stamped-after-close": "when it was recorded, and for how long, rests", "first-stamped-late": "that it began no earlier rests",
                      "end-stamped-late": "that recording ended there rests", "segments-entered-late": "that it is no older rests"}
BY_SCRIPTS = {"old_film_behind_the_first_token", "excerpt_of_old_film_in_the_midst", "stamped_after_the_end_alone", "film_of_before_the_first_token", "excerpt_of_a_case_that_was_stamped_after_its_end_alone",
              "excerpt_of_film_of_before_the_first_token", "sound", "sound_excerpt", "changed_line", "note_of_a_stranger", "other_device", "no_token", "being_recorded", "bit_flipped", "excerpt_without_its_segment"}


class Page:
    """The page's chain of proof, as the browser computes it."""

    def __init__(self, stage, scratch):
        module = scratch / "chain.mjs"
        subprocess.run([stage / "node_modules/.bin/esbuild", ROOT / "viewer/web/src/verification/chain.ts", "--format=esm", f"--outfile={module}", "--log-level=error"],
                       check=True)
        self.script = (f"import {{ chainOf, wordsOfTime }} from '{module}'; import {{ readFileSync }} from 'node:fs';"
                       "const all = JSON.parse(readFileSync(0, 'utf8'));"
                       "console.log(JSON.stringify(all.map((one) => [chainOf(one).map((link) => [link.name, link.state]), wordsOfTime(one)])));")

    def chains(self, reports):
        done = subprocess.run(["node", "--input-type=module", "-e", self.script], input=json.dumps(reports), capture_output=True, text=True, check=True)
        return [(dict(chain), words) for chain, words in json.loads(done.stdout)]


@dataclasses.dataclass
class Told:
    """What each reader says of one folder."""
    name: str
    report: dict
    status: int
    words: str
    words_status: int
    documents: dict        # by language: (word, tone, answers, links)
    pdf: str | None
    certified: bool
    scripts: tuple | None  # exit status, and all that they say
    papers: dict           # texts by name, of those that were made: en, ja, receipt-en, receipt-ja, certificate
    chain: dict | None = None
    page_time: list | None = None   # keys of the page's sentences on the time


def plain(fragment):
    return html.unescape(re.sub(r"<[^>]*>", "", re.sub(r'<span aria-hidden="true">[^<]*</span>\s*', "", fragment))).strip()


def read_document(text):
    """Word and tone of the verdict, the answers in their order, and the links of the chain with their answers."""
    statement = re.search(r'<div class="statement (\w+)"><p class="word">(.*?)</p>', text, re.S)
    tables = re.findall(r"<table>(.*?)</table>", text, re.S)
    answers = next(rows for rows in ([plain(cell) for cell in re.findall(r"<tr><th[^>]*>.*?</th><td[^>]*><b>(.*?)</b></td><td", table, re.S)]
                                     for table in tables) if len(rows) == 8)
    chain = re.search(r'<ol class="chain">(.*?)</ol>', text, re.S)
    links = [plain(link) for link in re.findall(r'<div class="link[^"]*"><b>.*?</b>(.*?)</div>', chain[1], re.S)]
    return plain(statement[2]), statement[1], answers, links


class Readers:
    def __init__(self, programs, scratch):
        self.programs, self.scratch = programs, scratch
        # Certificates begin now, and tokens are made for moments after that.
        self.world = forgeries.World(note.Signer("or3", bytes(range(32))), note.Signer("witness", bytes([3] * 32)), stamp.Authority(scratch / "outside", "outside"),
                                     stamp.Authority(scratch / "second", "second"), stamp.Authority(scratch / "own", "own"), age.Identity(bytes([1] * 32)),
                                     (int(time.time()) + 3600) * forgeries.SECOND)

    def ask(self, given, *words):
        under = AS_ONE_WHO_MAY_NOT_READ_ALL if given.unprivileged else []
        return subprocess.run([*under, self.programs / "kiroku", *map(str, words)], capture_output=True, text=True, timeout=LONGEST_WAIT_S,
                              env={**os.environ, "KIROKU_HOME": str(self.scratch / "none"), "SOURCE_DATE_EPOCH": "1800000000"})

    @staticmethod
    def options(given, folder):
        options = []
        for option, texts in (("--device", given.devices), ("--trust", given.roots), ("--own-authority", given.own)):
            for i, text in enumerate(texts):
                path = folder / f"given{option}{i}"
                path.write_text((text.identity or f"{text}\n") if option == "--device" else text)
                options += [option, path]
        if given.identity:
            (folder / "identity.txt").write_text(given.identity + "\n")
            options += ["--identity", folder / "identity.txt"]
        options += ["--log", given.log] if given.log else []
        for path in given.against:
            options += ["--against", path]
        return options + (["--proof", given.proof] if given.proof else [])

    def by_scripts(self, given, folder):
        page = (ROOT / "docs/how-to/verify-with-stock-tools.md").read_text("utf-8")
        kind = " excerpt" if (given.path / "excerpt.json").exists() else ""
        (folder / "verify.sh").write_text(re.search(rf"^```bash{kind}\n(.*?)^```$", page, re.M | re.S)[1], "utf-8")
        (folder / "roots.pem").write_text("".join(given.roots))
        (folder / "device").write_text("".join(f"{key}\n" for key in given.devices))
        done = subprocess.run(["bash", folder / "verify.sh", given.path, folder / "roots.pem", folder / "device"], capture_output=True, text=True,
                              timeout=10 * LONGEST_WAIT_S)
        return done.returncode, done.stdout

    def told(self, name, make):
        """Nothing of a folder that the report refuses, as of a log."""
        folder = self.scratch / "made" / name
        folder.mkdir(parents=True)
        try:
            given = make(dataclasses.replace(self.world, folder=folder))
            if given.as_log:
                return None
            out = folder / "told"
            out.mkdir(mode=0o777)
            out.chmod(0o777)
            options = [given.path, *self.options(given, folder), "--threads", "1"]
            as_json, in_words = self.ask(given, "verify", "--json", *options), self.ask(given, "verify", *options)
            if as_json.returncode == 2:
                raise AssertionError(f"{name}: {as_json.stderr}")
            documents = {}
            for language in ("en", "ja"):
                made = self.ask(given, "report", *options, "--language", language, "--by", "Dr. Sato", "-o", out / f"{language}.html")
                if made.returncode != 0:
                    raise AssertionError(f"{name}: no report: {made.stderr}")
                documents[language] = read_document((out / f"{language}.html").read_text("utf-8"))
            self.ask(given, "report", *options, "--by", "Dr. Sato", "-o", out / "en.pdf")
            pdf = subprocess.run(["pdftotext", "-raw", out / "en.pdf", "-"], capture_output=True, text=True, check=True).stdout if shutil.which("pdftotext") else None
            certified = self.ask(given, "report", "--certificate", *options, "-o", out / "certificate.html").returncode == 0
            if name in BY_TIME:
                for language in ("en", "ja"):
                    self.ask(given, "report", "--receipt", *options, "--language", language, "-o", out / f"receipt-{language}.html")
            scripts = self.by_scripts(given, folder) if name in BY_SCRIPTS else None
            return Told(name, json.loads(as_json.stdout), as_json.returncode, in_words.stdout, in_words.returncode, documents, pdf, certified, scripts,
                        {path.stem: plain(path.read_text("utf-8")) for path in out.glob("*.html")})
        finally:
            shutil.rmtree(folder)


def words_in_order(text, words):
    """Those of the words that follow each other in the text, from its beginning on."""
    text, at = re.sub(r"\s+", " ", text), 0
    for word in words:
        at = text.find(word, at)
        if at < 0:
            return
        yield word
        at += len(word)


def contradictions(told):
    """Each as a sentence."""
    verdict, found = told.report["verdict"], told.report["findings"]
    status, words, english, japanese, tone = VERDICTS[verdict]
    word, its_tone, answers, links = told.documents["en"]
    if (told.status, told.words_status) != (status, status):
        yield f"{verdict}: the exit statuses are {told.status} and {told.words_status}"
    if not told.words.splitlines()[1].startswith(words):
        yield f"{verdict}: kiroku-verify says {told.words.splitlines()[1]!r}"
    listed = re.findall(r"^  (?:tampered|incomplete|unproven|gap|note) ([a-z-]+)", told.words, re.M)
    if sorted(listed) != sorted(each["code"] for each in found):
        yield f"JSON and words list other findings: {listed}"
    for language, wanted in (("en", english), ("ja", japanese)):
        if told.documents[language][:2] != (wanted, tone):
            yield f"{verdict}: the report ({language}) says {told.documents[language][:2]}"
    if [ANSWERS[each] for each in answers] != told.documents["ja"][2] or [ANSWERS[each] for each in links] != told.documents["ja"][3]:
        yield f"the Japanese report answers otherwise: {answers} {told.documents['ja'][2]}"
    if told.pdf is not None and [english, *answers] != [each for each in words_in_order(told.pdf, [english, *answers])]:
        yield "the PDF says otherwise than the page of the report"
    if told.report["time"] == "external" and any(each["code"] == "ledger-changed" for each in found):
        yield "outside time of entries that were changed since"
    # Whoever recorded nothing has no recording without a break; it may have been begun just now.
    recorded = any(stream["segments"] for stream in told.report["streams"] if stream["kind"] != "events")
    if ("No" in (answers if recorded else answers[:2] + answers[3:])) != (verdict == "tampered"):
        yield f"{verdict}: the report answers {answers}"
    if verdict in ("unproven", "incomplete") and not set(answers) & {"Could not be checked", "Not finished"}:
        yield f"{verdict}: every question of the report is answered: {answers}"
    if tone == "good" and "Not finished" in answers:
        yield f"{verdict}: the report answers {answers}"
    if told.certified != (tone == "good"):
        yield f"{verdict}: a certificate was {'' if told.certified else 'not '}made"
    if told.scripts is not None and told.scripts[0] in (0, 4) and verdict != ("intact-excerpt" if told.scripts[0] == 4 else "intact"):
        yield f"{verdict}: the scripts with stock tools leave with {told.scripts[0]}"
    yield from contradictions_of_time(told)
    yield from contradictions_of_page(told, answers, links)


def contradictions_of_time(told):
    """What the time is not worth is said by every reader, or by none."""
    codes, tampered = {each["code"] for each in told.report["findings"]}, told.report["verdict"] == "tampered"
    for code, (words, english, japanese, certificate) in TIME_REMARKS.items():
        # A report of a changed case tells no time.
        expected = [("words", told.words, words)] + ([] if tampered else [(name, told.papers.get(name), japanese if name.endswith("ja") else english)
                                                                          for name in ("en", "ja", "receipt-en", "receipt-ja", "certificate")])
        expected += [("certificate's limits", told.papers.get("certificate"), certificate)]
        if told.scripts is not None and told.scripts[0] in (0, 4) and code in REMARKS_OF_SCRIPTS:
            expected += [("scripts", told.scripts[1], REMARKS_OF_SCRIPTS[code])]
        if told.page_time is not None:
            expected += [("page", " ".join(told.page_time), f"timeRemark.{code}")]
        for reader, text, sentence in expected:
            # A receipt of what is not whole says that, and no time.
            if text is None or (reader.startswith("receipt") and told.documents["en"][1] != "good"):
                continue
            sentence = "\n" + 13 * " " + sentence if reader == "words" else sentence
            if (sentence in text) != (code in codes):
                yield f"of {code} the {reader} says {'nothing' if code in codes else 'what nobody found'}"
    for name in ("receipt-en", "certificate"):
        if "the brackets below" in told.papers.get(name, ""):
            yield f"the {name} speaks of brackets, and has none"


def contradictions_of_page(told, answers, links):
    if told.chain is None:
        return
    states = [told.chain[name] for name in LINKS]
    if ("broken" in states) != (told.report["verdict"] == "tampered"):
        yield f"the page's chain is {told.chain}, and the report answers {answers}"
    for name, state, answer in zip(LINKS, states, links):
        good = state in ("holds", "partly")
        # The report's first link asks for every file; the page puts a token's or a checkpoint's to its own.
        of_segments = any(re.match("segments/|$", each["file"] or "") for each in told.report["findings"] if each["severity"] not in ("note", "gap"))
        if name == "segments" and answer == "No" and "broken" in states and not of_segments:
            continue
        # That a time-stamp is there and holds is one thing, whose clock it is another, which the last link says.
        partly = answer in IN_PART and name == "tokens"
        if good and answer not in GOOD and not partly:
            yield f"of {name} the page says {state!r}, and the report {answer!r}"
        # What only the page puts to this link breaks it there alone: then the report says No elsewhere.
        if state == "broken" and answer in GOOD and "No" not in answers:
            yield f"of {name} the page says {state!r}, and the report {answer!r}"


def chosen(every):
    """A third of those by which each finding is met once, and some more: two minutes of a processor for all of these are too many for each change."""
    if every:
        return forgeries.ALL
    seen, some = set(), []
    for at, (name, codes, make) in enumerate(forgeries.ALL):
        if name in BY_SCRIPTS or not codes or not set(codes) <= seen or at % 16 == 0:
            some.append((name, codes, make))
        seen |= set(codes)
    some = some[::3]
    return some + [one for one in forgeries.ALL if one[0] in BY_TIME and one not in some]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--page", type=pathlib.Path)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--only")
    given = parser.parse_args()
    left_out = [] if shutil.which("pdftotext") else ["pdftotext is not installed: PDF is left out"]
    with tempfile.TemporaryDirectory() as name:
        scratch = pathlib.Path(name)
        scratch.chmod(0o755)
        readers = Readers(given.programs.resolve(), scratch)
        folders = [one for one in forgeries.ALL if one[0] == given.only] if given.only else chosen(given.all)
        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            all_told = [one for one in pool.map(lambda one: readers.told(one[0], one[2]), folders) if one is not None]
        page = given.page and (given.page / "node_modules/.bin/esbuild").exists() and shutil.which("node")
        if page:
            for told, chain in zip(all_told, Page(given.page.resolve(), scratch).chains([one.report for one in all_told])):
                told.chain, told.page_time = chain
        else:
            left_out.append("the page is not built: its chain of proof is left out")
    if given.only:
        for told in all_told:
            print(told.words, *told.documents["en"], told.chain, told.page_time, told.certified, told.scripts, sep="\n")
    wrong = [f"{told.name}: {each}" for told in all_told for each in contradictions(told)]
    print("\n".join(wrong))
    print(*left_out, sep="\n")
    print(f"{len(all_told)} folders, {'six' if page else 'five'} readers: {len(wrong)} contradictions")
    lacks = bool(left_out) and bool(os.environ.get("KIROKU_PAGE_REQUIRED"))
    return 1 if wrong or lacks or not all_told else 0


if __name__ == "__main__":
    sys.exit(main())
