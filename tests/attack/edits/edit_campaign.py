#!/usr/bin/env python3
"""Edits recorded cases, excerpts, a renewed case with its evidence record, a log with legal holds, the proof of a case's
end and a cosigned note in every way of a grammar, one and two at a time, and asks whether kiroku-verify, or kiroku of
holds and of two logs, ever says more of them than is true.

Usage: edit_campaign.py PROGRAMS [--seconds N] [--seed N] [--all] [--only TEXT] [--plan TEXT] [--scripts] [--report N] [--other N]
  PROGRAMS      the folder of kiroku and kiroku-verify
  --seconds N   how long (30, or without end with --all)
  --seed N      which edits, in which order; without it another one each time, which is printed
  --all         every single edit first; then pairs until the seconds are over
  --only TEXT   single edits alone, of bases or with names that hold this text: "proof:", "log:", "sealed segment"
  --plan TEXT   this one alone, as a failure prints it
  --scripts     asks the scripts with stock tools, too, which takes a second each
  --report N    reads the answers of the report, and opens segments with an identity, for one edit in N (10), and of a
                log asks which holds stand and whether it is one history with the recorded one; 0: of none
  --other N     asks the other verifier about one edit in N (1), which takes most of the time; 0: about none

Nothing is believed that the verifier says: oracle.py knows from the edit what may be said. tests/foreign judges the same
folder, and must come to the same verdict and codes. Exit status: 0 nothing was found, 1 something was.
"""
import argparse
import collections
import dataclasses
import json
import multiprocessing
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "foreign")]
sys.dont_write_bytecode = True

import bases  # noqa: E402
import beside  # noqa: E402
import case_verifier  # noqa: E402
import grammar  # noqa: E402
import log_verifier  # noqa: E402
import note  # noqa: E402
import oracle  # noqa: E402
import stamp  # noqa: E402
import tree as t  # noqa: E402
import verifier  # noqa: E402

LONGEST_WAIT_S = 120   # it only ends a run that hangs, which is a finding
DEFAULT_SECONDS = 30
EMBEDDED_POLICY = "2.25.197830237812365870224498532130945381713"


@dataclasses.dataclass(frozen=True)
class Plan:
    base: int
    edits: tuple          # numbers of that base's edits
    tokens: str           # what becomes of tokens where lines are signed again
    count_again: bool
    with_log: bool
    against: bool


class Late(Exception):
    """A run that did not end."""


class OwnAuthority(stamp.Authority):
    """The recorder's own, whose keys lie in its home: whoever has the machine states any time with it."""

    def __init__(self, home, folder):
        self.folder, self.name, self.policy = folder, "embedded", EMBEDDED_POLICY
        folder.mkdir()
        for source, to in (("tsa.key", "signer.key"), ("tsa.pem", "signer.pem"), ("ca.pem", "root.pem")):
            shutil.copy(home / "authority" / source, folder / to)


class Campaign:
    """The bases, the edits of each, and what judges them."""

    def __init__(self, programs, scratch, scripts=False, other=1, report=10):
        self.programs, self.scratch, self.other, self.report = pathlib.Path(programs).resolve(), scratch, other, report
        stranger = stamp.Authority(scratch / "stranger", "outside")  # before: its certificates must be valid while a case is recorded
        recorded, outside = bases.record(self.programs, scratch)
        signer = recorded[0].signer
        utc_ns = (int(time.time()) + 3600) * grammar.SECOND
        outsider = note.Signer("outsider", bytes([9] * 32))
        self.bases = recorded + bases.written(scratch, outside, signer, utc_ns)
        elsewhere = scratch / "elsewhere"
        elsewhere.mkdir()
        foreign = bases.written(scratch / "foreign", outside, note.Signer("or4", bytes([4] * 32)), utc_ns + 7200 * grammar.SECOND)
        own = OwnAuthority(scratch / "home", scratch / "own")
        written = next(base for base in self.bases if base.name == "written")
        self.hands = [grammar.Hands([other.tree for other in (written if base is not written else self.bases[0], foreign[0])], outside,
                                    own if base.own else None, stranger, outsider, elsewhere) for base in self.bases]
        self.edits = [self._edits_of(base) for base in self.bases]
        self.kinds = [self._kinds_of(edits) for edits in self.edits]
        self.script = self._cut_out_script() if scripts else None

    @staticmethod
    def _kinds_of(edits):
        """By how they edit, and what: what has few edits is tried as often as what has thousands."""
        kinds = collections.defaultdict(list)
        for number, edit in enumerate(edits):
            kinds[edit.of_entries, edit.name.split(" ")[0] in ("record", "sealed")].append(number)
        return kinds

    def _edits_of(self, base):
        if base.form == "proof":
            return list(beside.of_proof(base.tree[beside.PROOF]))
        if base.form == "note":
            older = next(each for each in self.bases if each.form == "log").notes
            return list(beside.of_cosigned(base.tree, bases.WITNESSES, older[min(older)], bases.TIME_S))
        edits = list(grammar.of_files(base.tree)) + list(grammar.of_notes(base.tree, base))
        edits += list(grammar.of_lines(base.tree, "ledger-part.jsonl" if base.form == "excerpt" else "ledger.jsonl"))
        if base.form == "excerpt":
            edits += list(grammar.of_excerpt(base.tree))
        record = f"../evidence/{base.folder_name}.ers"
        if record in base.tree:
            edits += list(beside.of_record(base.tree[record], record))
        if base.name == "recorded":
            edits += list(beside.of_sealed(grammar.steps_of(base)))
        return edits + list(grammar.of_entries(base.whole or base))

    def _cut_out_script(self):
        page = (HERE.parents[2] / "docs/how-to/verify-with-stock-tools.md").read_text("utf-8")
        scripts = {}
        for form, fence in (("case", "\n```bash\n"), ("excerpt", "\n```bash excerpt\n")):
            scripts[form] = self.scratch / f"verify-{form}.sh"
            scripts[form].write_text(page.split(fence)[1].split("\n```\n")[0] + "\n")
        return scripts

    def singles(self, chance):
        plans = [self.plan(chance, base, (edit,)) for base, edits in enumerate(self.edits) for edit in range(len(edits))]
        chance.shuffle(plans)
        return plans

    def plan(self, chance, base, edits):
        return Plan(base, edits, chance.choice(grammar.TOKENS), chance.random() < 0.7, self.bases[base].log is not None and chance.random() < 0.3, chance.random() < 0.2)

    def some(self, chance):
        """Any edit or two of any base; each kind of base and each way of editing is as likely as another."""
        while True:
            base = chance.randrange(len(self.bases))
            numbers = []
            for _ in range(chance.choice((1, 2))):
                kinds = self.kinds[base]
                numbers.append(chance.choice(kinds[chance.choice(sorted(kinds))]))
            yield self.plan(chance, base, tuple(numbers))

    def words(self, plan):
        edits = " + ".join(self.edits[plan.base][number].name for number in plan.edits)
        signed = f"; signed again, tokens {plan.tokens}{', counted again' if plan.count_again else ''}" if self.is_signed(plan) else ""
        return f"{self.bases[plan.base].name}: {edits}{signed}{'; with the log' if plan.with_log else ''}{'; against a kept note' if plan.against else ''}"

    def plan_in(self, words):
        """What words() gave."""
        name, _, rest = words.partition(": ")
        edits, *more = rest.split("; ")
        base = [each.name for each in self.bases].index(name)
        names = [edit.name for edit in self.edits[base]]
        signed = next((each for each in more if each.startswith("signed again")), "signed again, tokens kept")
        return Plan(base, tuple(names.index(edit) for edit in edits.split(" + ")), signed.split("tokens ")[1].split(",")[0], signed.endswith("counted again"),
                    "with the log" in more, "against a kept note" in more)

    def is_signed(self, plan):
        return any(self.edits[plan.base][number].of_entries for number in plan.edits)

    def edited(self, plan, scratch):
        """The folder of a plan; raises Unfit where an edit has nothing to change."""
        base, hands = self.bases[plan.base], self.hands[plan.base]
        edits = [self.edits[plan.base][number] for number in plan.edits]
        result = oracle.Edited(base, base.tree.copy(), None, plan.tokens, plan.with_log, plan.against)
        if self.is_signed(plan):
            whole = base.whole or base
            steps, files = grammar.steps_of(whole), whole.tree.copy()
            try:
                for edit in edits:
                    if edit.of_entries:
                        edit.apply(steps, files, hands)
                signed = grammar.sign(whole, steps, files, hands, plan.tokens, plan.count_again)
            except (KeyError, IndexError, TypeError, ValueError, AttributeError) as e:
                raise grammar.Unfit(str(e)) from e
            result.signed_lines = signed.lines
            result.tree = grammar.excerpt_of(signed, base, scratch) if base.whole else signed.tree
        for edit in edits:
            if not edit.of_entries:
                try:
                    edit.apply(result.tree, hands)
                except (KeyError, IndexError, TypeError, ValueError) as e:
                    raise grammar.Unfit(str(e)) from e
        for path in list(result.tree):  # nothing lies below what is no folder
            if any(result.tree.get(str(parent), t.FOLDER) is not t.FOLDER for parent in pathlib.PurePosixPath(path).parents):
                raise grammar.Unfit("below a file")
        # Signed again, a log without an entry lacks its last checkpoint: a second name of that is no file.
        if any(isinstance(node, t.Second) and not isinstance(result.tree.get(node), bytes) for node in result.tree.values()):
            raise grammar.Unfit("a second name of nothing")
        return result

    def options(self, plan, scratch):
        base = self.bases[plan.base]
        options = []
        for option, texts in (("--device", [str(key) + "\n" for key in base.devices]), ("--trust", base.roots), ("--own-authority", base.own)):
            for number, text in enumerate(texts):
                path = scratch / f"given{option}{number}"
                path.write_text(text)
                options += [option, str(path)]
        options += ["--log", str(base.log)] if plan.with_log else []
        options += ["--as-log"] if base.form == "log" else []
        if plan.against:
            kept = scratch / "kept.note"
            whole = base.whole or base
            kept.write_bytes(whole.notes[max(whole.notes)])
            options += ["--against", str(kept)]
        return options

    def ask_ours(self, options, folder, scratch):
        with open(scratch / "out", "wb+") as out, open(scratch / "err", "wb+") as err:
            program = subprocess.Popen([self.programs / "kiroku-verify", "--json", "--threads", "1", *options, folder], stdout=out, stderr=err, stdin=subprocess.DEVNULL)
            try:
                _, status, usage = os.wait4(program.pid, 0)
            except Late:
                program.kill()
                program.wait()
                raise
            program.returncode = os.waitstatus_to_exitcode(status)
            out.seek(0)
            err.seek(0)
            text = out.read()
            if program.returncode == 2 and re.search(r" is no (case|appliance log)[:;]| (has|is) no ledger|cannot be (read|opened)", err.read().decode(errors="replace")):
                return None
            err.seek(0)
            if program.returncode not in (0, 1, 3, 4):
                raise RuntimeError(f"kiroku-verify ended with {program.returncode}: {err.read().decode(errors='replace')}")
        return oracle.Said(json.loads(text), program.returncode, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)

    def ask_inspected(self, options, folder):
        """The verdict after every segment was opened and decoded."""
        done = subprocess.run([self.programs / "kiroku", "verify", "--json", "--threads", "1", *options, "--identity", self.scratch / "home/identity.txt", folder],
                              capture_output=True, text=True, stdin=subprocess.DEVNULL, env={**os.environ, "KIROKU_HOME": str(self.scratch / "no-home")})
        if done.returncode == 2:
            raise RuntimeError(f"kiroku verify ended with 2: {done.stderr}")
        return json.loads(done.stdout)["verdict"]

    def ask_of_log(self, edited, folder, scratch):
        """What is said of legal holds by a log that was edited, and of it beside the recorded one."""
        home = scratch / "home-of-log"
        if not home.exists():
            shutil.copytree(self.scratch / "home", home, ignore=shutil.ignore_patterns("archive"))
            (home / "archive").symlink_to(scratch / "archive")
        case = next(base for base in self.bases if base.name == "recorded")
        t.write(t.Tree({"ledger.jsonl": case.tree["ledger.jsonl"]}), folder.parent / case.folder_name)
        found = list(beside.objections_to_holds(edited, beside.ask_holds(self.programs / "kiroku", home)))
        compared = beside.ask_compare(self.programs / "kiroku", folder, edited.base.at, home / "device.pub", home)
        return found + list(beside.objections_to_comparison(edited, compared))

    def judge_beside(self, plan, scratch):
        """An edit of what lies beside a case or a log that stayed as it was recorded."""
        base, edited = self.bases[plan.base], self.edited(plan, scratch)
        if edited.tree == base.tree:
            return None, None
        folder = scratch / "beside"
        t.remove(folder)
        t.write(edited.tree, folder)
        options = self.options(dataclasses.replace(plan, with_log=False, against=False), scratch)
        if base.form == "proof":
            said = self.ask_ours(options + ["--proof", folder / beside.PROOF], base.at, scratch)
            return list(beside.objections_to_proof(base.tree[beside.PROOF], edited.tree[beside.PROOF], said)), said
        said = self.ask_ours(options + ["--as-log", "--against", folder / beside.NOTE, "--witnesses", folder / beside.POLICY], base.at, scratch)
        return list(beside.objections_to_witnesses(base.tree[beside.NOTE], edited.tree[beside.NOTE], said.report)), said

    def ask_other(self, plan, folder, scratch):
        base = self.bases[plan.base]
        trust = verifier.Trust(tuple(base.devices), "".join(base.roots), "".join(base.own), base.log if plan.with_log else None,
                               (scratch / "kept.note",) if plan.against else ())
        return (log_verifier.verify_log if base.form == "log" else case_verifier.verify_case)(folder, trust)

    def ask_report(self, options, folder, scratch):
        """Its questions that are answered with Yes."""
        page = scratch / "report.html"
        done = subprocess.run([self.programs / "kiroku", "report", "--force", "--threads", "1", "-o", page, *options, folder], capture_output=True, text=True,
                              stdin=subprocess.DEVNULL, env={**os.environ, "KIROKU_HOME": str(self.scratch / "home")})
        if done.returncode == 2 and "cannot report on" in done.stderr:
            return []
        if done.returncode != 0:
            raise RuntimeError(f"kiroku report ended with {done.returncode}: {done.stderr}")
        rows = re.findall(r"<th[^>]*>([^<]*\?)</th><td[^>]*>(.*?)</td>", page.read_text("utf-8"), re.S)
        if not rows:
            raise RuntimeError("the report asks nothing")
        return [question for question, answer in rows if re.search(r"\bYes\b(?!,)", answer)]

    def ask_script(self, edited, folder, scratch):
        """What the scripts with stock tools say: the verdict's words."""
        is_excerpt = "excerpt.json" in edited.tree
        own = scratch / "given--own-authority0"
        done = subprocess.run(["bash", str(self.script["excerpt" if is_excerpt else "case"]), str(folder), str(scratch / "given--trust0"), str(scratch / "given--device0")],
                              capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=LONGEST_WAIT_S, errors="replace",
                              env={**os.environ, **({"OWN_ROOTS": str(own)} if own.exists() else {})})
        return done.stdout.strip().split("\n")[-1].split(":")[0], done.returncode

    def judge(self, plan, scratch):
        """Sentences about what was found; None where the plan changes nothing."""
        if self.bases[plan.base].form in ("proof", "note"):
            return self.judge_beside(plan, scratch)
        edited = self.edited(plan, scratch)
        base = self.bases[plan.base]
        folder = scratch / "archive" / base.folder_name
        t.remove(scratch / "archive")
        t.write(edited.tree, folder)
        options = self.options(plan, scratch)
        said = self.ask_ours(options, folder, scratch)
        if said is None:  # no verdict at all
            held = [name for name in ("ledger.jsonl", "excerpt.json") if isinstance(base.tree.get(name), bytes)]
            return [] if all(edited.tree.get(name) != base.tree[name] for name in held) else ["it finds no case where there is one"], said
        found = oracle.objections(edited, said)
        if plan.edits and edited.signed_lines is None and edited.tree == base.tree:
            return None, said
        # The other verifier judges no evidence records, and reads a ledger whole.
        is_asked = self.other > 0 and hash(plan) % self.other == 0
        if is_asked and base.name != "renewed" and not any(isinstance(node, t.Hole) and node > 1 << 30 for path, node in edited.tree.items() if "ledger" in path):
            other = self.ask_other(plan, folder, scratch)
            if (other.verdict, other.codes) != (said.verdict, said.codes):
                found.append(f"the verifiers disagree: ours {said.verdict}, the other {other.verdict}; ours alone {sorted(said.codes - other.codes)}, "
                             f"the other alone {sorted(other.codes - said.codes)}")
        if self.report > 0 and hash(plan) % self.report == 0 and base.form != "log":
            found += oracle.objections_to_answers(edited, said, self.ask_report(options, folder, scratch))
        if self.report > 0 and hash(plan) % self.report == 0 and base.form == "log":
            found += self.ask_of_log(edited, folder, scratch)
        sealed = [self.edits[plan.base][number].name for number in plan.edits if self.edits[plan.base][number].name.startswith("sealed ")]
        if self.report > 0 and sealed and hash(plan) % min(self.report, 3) == 0:
            found += beside.objections_to_inspection(self.ask_inspected(options, folder), sealed)
        if self.script and base.form != "log" and not plan.with_log and not plan.against:
            words, status = self.ask_script(edited, folder, scratch)
            if words.startswith("INTACT"):
                verdict = {"INTACT": "intact", "INTACT WITH GAPS": "intact-with-gaps", "INTACT EXCERPT": "intact-excerpt"}[words]
                if edited.signed_lines is None and said.verdict == "tampered":
                    found.append(f"the script says {words}, the program {said.verdict} ({sorted(said.codes)})")
                if status != oracle.EXIT_OF[verdict]:
                    found.append(f"the script says {words} and ends with {status}")
        return found, said


CAMPAIGN = None


def _alarm(*_):
    raise Late


def work(plan):
    """In a process of its own, which was made with CAMPAIGN."""
    scratch = CAMPAIGN.scratch / f"worker-{os.getpid()}"
    scratch.mkdir(exist_ok=True)
    signal.signal(signal.SIGALRM, _alarm)
    signal.alarm(LONGEST_WAIT_S)
    try:
        found, said = CAMPAIGN.judge(plan, scratch)
        return plan, found, said.verdict if said else "no verdict"
    except grammar.Unfit:
        return plan, None, "unfit"
    except Late:
        return plan, [f"did not end in {LONGEST_WAIT_S} s"], "none"
    except Exception:  # pylint: disable=broad-except  # whatever breaks is told with its plan
        return plan, [traceback.format_exc(limit=6)], "none"
    finally:
        signal.alarm(0)


def blind_verifier_is_found_out(campaign, chance):
    """That the oracle can object: a verifier that says of each edit what it says of the base must be found out by each
    edit that takes a film away or writes into one."""
    scratch = campaign.scratch / "blind"
    scratch.mkdir()
    missed = []
    for number, base in enumerate(campaign.bases):
        if base.form not in ("case", "excerpt"):
            continue
        folder = scratch / base.folder_name
        t.remove(folder)
        t.write(base.tree, folder)
        sound = campaign.ask_ours(campaign.options(Plan(number, (), "kept", False, False, False), scratch), folder, scratch)
        for edit in [each for each in campaign.edits[number] if not each.of_entries and " segments/" in each.name and each.name.endswith(".age")]:
            edited = oracle.Edited(base, base.tree.copy())
            try:
                edit.apply(edited.tree, campaign.hands[number])
            except grammar.Unfit:
                continue
            changed = any(edited.tree.get(path) != base.tree[path] for path in base.tree if path.startswith("segments/"))
            if changed and not oracle.objections(edited, sound):
                missed.append(f"{base.name}: {edit.name}")
    return missed


def main():
    global CAMPAIGN
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("programs")
    asked.add_argument("--seconds", type=float)
    asked.add_argument("--seed", type=int, default=int.from_bytes(os.urandom(4), "big"))
    asked.add_argument("--all", action="store_true")
    asked.add_argument("--only")
    asked.add_argument("--plan")
    asked.add_argument("--scripts", action="store_true")
    asked.add_argument("--report", type=int, default=10)
    asked.add_argument("--other", type=int, default=1)
    asked = asked.parse_args()
    print(f"seed {asked.seed}", flush=True)
    seconds = asked.seconds if asked.seconds is not None else (1e9 if asked.all else DEFAULT_SECONDS)
    chance = random.Random(asked.seed)
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="kiroku-edits-"))
    try:
        CAMPAIGN = Campaign(asked.programs, scratch, asked.scripts, asked.other, asked.report)
        missed = blind_verifier_is_found_out(CAMPAIGN, chance)
        if missed:
            print("FAILED: the oracle takes a film that is not the recorded one for it:", *missed[:20], sep="\n  ")
            return 1
        return run(CAMPAIGN, chance, asked, seconds)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def plans_of(campaign, chance, asked):
    if asked.only:
        yield from (plan for plan in campaign.singles(chance) if asked.only in campaign.words(plan))
        return
    if asked.all:
        yield from campaign.singles(chance)
    yield from campaign.some(chance)


def run(campaign, chance, asked, seconds):
    plans = [campaign.plan_in(asked.plan)] if asked.plan else plans_of(campaign, chance, asked)
    ends, counts, failures = time.monotonic() + seconds, collections.Counter(), 0
    singles = sum(map(len, campaign.edits)) if asked.all else None
    with multiprocessing.get_context("fork").Pool(os.cpu_count()) as pool:
        given = threading.Semaphore(4 * os.cpu_count())  # the pool would take all plans ahead
        most = 1 if asked.plan else singles if asked.seconds is None else None
        for plan, found, verdict in pool.imap_unordered(work, bounded(plans, ends, most, given)):
            given.release()
            counts[verdict if found is not None else "unchanged"] += 1
            if found:
                failures += 1
                print(f"FOUND: {campaign.words(plan)}\n  said {verdict}", *found, sep="\n  ", flush=True)
            if asked.plan:
                print(verdict)
    print(f"{sum(counts.values())} plans of {sum(map(len, campaign.edits))} single edits: " + ", ".join(f"{n} {v}" for v, n in sorted(counts.items())))
    if failures:
        print(f"FAILED: {failures} plans; again with --seed {asked.seed}")
    return 1 if failures else 0


def bounded(plans, ends, most, given):
    """Until the time is over, as fast as answers come."""
    for number, plan in enumerate(plans):
        given.acquire()  # pylint: disable=consider-using-with  # run() releases it
        if time.monotonic() > ends or number == most:
            return
        yield plan


if __name__ == "__main__":
    sys.exit(main())
