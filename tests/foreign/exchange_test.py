#!/usr/bin/env python3
"""Cases go both ways between the programs and the writer and verifier of this folder; forged ones are judged alike.

Usage: exchange_test.py PROGRAMS [unittest's arguments]
  PROGRAMS   the folder of kiroku, kirokud and kiroku-verify
"""
import concurrent.futures
import csv
import dataclasses
import json
import os
import pathlib
import random
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

import age
import case_verifier
import case_writer as w
import cosignature
import forgeries
import log_verifier
import mutations
import note
import schema
import stamp
import strict_json
import verifier
from case_writer import MS, SECOND

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))
import ports  # noqa: E402

PROGRAMS = None
# Root may read every file, unless it gives that right away.
AS_ONE_WHO_MAY_NOT_READ_ALL = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"] if os.geteuid() == 0 else []
LONGEST_WAIT_S = 60   # it only ends a test that fails


def codes_of(report):
    return {finding["code"] for finding in report["findings"]}


class Exchange(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.scratch, True)
        # Certificates begin now, and tokens are made for moments after that.
        cls.world = forgeries.World(note.Signer("or3", bytes(range(32))), note.Signer("witness", bytes([3] * 32)), stamp.Authority(cls.scratch / "outside", "outside"),
                                    stamp.Authority(cls.scratch / "second", "second"), stamp.Authority(cls.scratch / "own", "own"), age.Identity(bytes([1] * 32)),
                                    (int(time.time()) + 3600) * SECOND)

    def ask(self, program, *arguments, under=(), home="none"):
        return subprocess.run([*under, PROGRAMS / program, *map(str, arguments)], capture_output=True, text=True, timeout=LONGEST_WAIT_S,
                              env={**os.environ, "KIROKU_HOME": str(self.scratch / home)})

    def given_as_options(self, given, folder):
        """What both verifiers understand."""
        options = []
        for option, texts in (("--device", given.devices), ("--trust", given.roots), ("--own-authority", given.own)):
            for i, text in enumerate(texts):
                path = folder / f"given{option}{i}"
                path.write_text((text.identity or f"{text}\n") if option == "--device" else text)
                options += [option, path]
        options += ["--log", given.log] if given.log else []
        for path in given.against:
            options += ["--against", path]
        options += ["--proof", given.proof] if given.proof else []
        return options + (["--as-log"] if given.as_log else [])

    def of_ours(self, given, folder):
        options = self.given_as_options(given, folder)
        program = ["kiroku-verify"]
        if given.identity:
            (folder / "identity.txt").write_text(given.identity + "\n")
            program, options = ["kiroku", "verify"], options + ["--identity", folder / "identity.txt"]
        under = AS_ONE_WHO_MAY_NOT_READ_ALL if given.unprivileged else []
        done = self.ask(*program, "--json", "--threads", "1", *options, given.path, under=under)
        self.assertIn(done.returncode, (0, 1, 3, 4), done.stderr)
        report = json.loads(done.stdout)
        return report["verdict"], codes_of(report)

    def of_the_other(self, given, folder):
        if given.unprivileged:
            done = subprocess.run([*AS_ONE_WHO_MAY_NOT_READ_ALL, sys.executable, "-B", HERE / "verify.py", *map(str, self.given_as_options(given, folder)), given.path],
                                  capture_output=True, text=True, check=True)
            answer = json.loads(done.stdout)
            return answer["verdict"], set(answer["codes"])
        trust = verifier.Trust(tuple(given.devices), "".join(given.roots), "".join(given.own), given.log, tuple(given.against), given.proof)
        judgement = (log_verifier.verify_log if given.as_log else case_verifier.verify_case)(given.path, trust)
        return judgement.verdict, judgement.codes

    def forge(self, name, make):
        folder = self.scratch / "forged" / name
        folder.mkdir(parents=True)
        given = make(dataclasses.replace(self.world, folder=folder))
        answers = self.of_ours(given, folder), None if given.identity else self.of_the_other(given, folder)
        self.assertFalse(answers[0][1] & set(given.never), name)
        shutil.rmtree(folder)
        return answers

    def said_by_the_scripts(self, given, folder):
        """What the page's script that fits says."""
        page = (HERE.parents[1] / "docs/how-to/verify-with-stock-tools.md").read_text("utf-8")
        kind = " excerpt" if (given.path / "excerpt.json").exists() else ""
        (folder / "verify.sh").write_text(re.search(rf"^```bash{kind}\n(.*?)^```$", page, re.M | re.S)[1], "utf-8")
        (folder / "roots.pem").write_text("".join(given.roots))
        (folder / "device").write_text("".join(f"{key}\n" for key in given.devices))
        return subprocess.run(["bash", folder / "verify.sh", given.path, folder / "roots.pem", folder / "device"], capture_output=True, text=True, timeout=10 * LONGEST_WAIT_S)

    def of_the_scripts(self, given, folder):
        """Exit status and last line."""
        done = self.said_by_the_scripts(given, folder)
        return done.returncode, (done.stdout.splitlines() or [done.stderr])[-1]

    def test_the_scripts_with_stock_tools_take_shared_tokens_and_refuse_forged_ones(self):
        refused = {"path_of_another_leaf": "its hash tree is of something else", "leaf_deeper_in_the_path": "its hash tree is of something else",
                   "path_to_another_root": "does not hold for", "path_that_ends_too_soon": "does not hold for", "path_left_out": "does not hold for",
                   "token_over_another_root": "does not hold for", "several_time_stamps": "no token that others share", "several_chains": "no token that others share",
                   "a_record_that_names_another_hash": "no token that others share", "a_record_with_more_in_it": "no token that others share",
                   "a_response_called_shared": "no token that others share", "own_and_shared_over_one_checkpoint": "one a second time",
                   "path_too_long": "no token that others share", "hashes_too_short": "no token that others share"}
        taken = {"shared_with_others": 0, "alone_in_its_round": 0, "shared_by_a_longest_path": 0, "excerpt_with_a_shared_token": 4}
        # Each costs a second or more of a shell's processor; the nightly run asks for all.
        usual = {"shared_with_others", "excerpt_with_a_shared_token", "path_of_another_leaf", "token_over_another_root", "several_time_stamps", "path_too_long"}
        self.ask_the_scripts(usual, refused | dict.fromkeys(taken, "INTACT"), dict.fromkeys(refused, 1) | taken)

    def test_the_scripts_with_stock_tools_miss_nothing_that_an_excerpt_lacks(self):
        lacking = {"excerpt_of_a_camera_that_is_not_there": "endoscope has nothing from 12 to 28 s", "excerpt_of_a_camera_that_fell_silent": "from 5 to 30.04 s",
                   "excerpt_of_a_second_of_a_long_silence": "from 5 to 30.04 s", "excerpt_from_within_a_hole": "from 11 to 15 s",
                   "excerpt_from_within_a_hole_in_front_of_a_gap": "from 11 to 15 s", "excerpt_from_behind_a_gap_that_ends_too_soon": "from 15 to 30.04 s",
                   "excerpt_of_a_camera_that_begins_late": "from 0 to 10 s", "excerpt_that_does_not_show_why_a_camera_begins_late": "from 0 to 10 s",
                   "excerpt_of_a_monitor_that_never_was_there": "vitals has nothing from 6 to 14 s",
                   "excerpt_that_does_not_show_why_a_monitor_was_not_there": "vitals has nothing from 11 to 14 s",
                   "excerpt_of_time_said_to_be_recorded_ahead": "nothing is there before 3600 s",
                   "excerpt_of_time_said_to_be_recorded_ahead_without_its_beginning": "nothing is there before 3600 s",
                   "excerpt_with_a_gap_beyond_the_end": "a gap of vitals is stated until 36000 s"}
        forged = {"excerpt_of_all_lines_with_other_totals": "states other totals", "excerpt_from_open_on_without_a_first_segment": "is not the next segment"}
        whole = ("excerpt_from_within_a_gap", "excerpt_from_behind_a_gap", "excerpt_of_a_gap_until_the_end", "excerpt_of_a_camera_that_begins_behind_a_gap",
                 "excerpt_of_the_last_seconds", "excerpt_of_a_file", "excerpt_from_the_middle")
        usual = {"excerpt_of_a_camera_that_fell_silent", "excerpt_from_within_a_hole", "excerpt_from_within_a_gap"}
        self.ask_the_scripts(usual, lacking | forged | dict.fromkeys(whole, "INTACT EXCERPT"), dict.fromkeys(lacking, 2) | dict.fromkeys(forged, 1) | dict.fromkeys(whole, 4))

    def test_the_scripts_with_stock_tools_ask_what_was_found_and_what_is_sealed(self):
        doubted = {"old_film_that_is_said_to_be_found": "written before its segment could end", "old_film_that_is_said_to_be_found_in_one_piece": "of more than 11 s",
                   "old_film_that_is_said_to_be_found_an_hour_later": "longer than the time between the outside tokens around it",
                   "sealed_for_nobody": "names nobody", "sealed_for_everybody": "names nobody", "excerpt_of_what_is_sealed_for_nobody": "names nobody",
                   "excerpt_of_what_was_erased": "was erased"}
        unsealed = dict.fromkeys(("empty_files_in_place_of_films", "texts_in_place_of_films", "headers_in_place_of_films", "headers_and_nonces_in_place_of_films",
                                  "sealed_nothings_in_place_of_films", "films_behind_headers_that_are_none", "films_whose_last_chunk_is_too_short",
                                  "excerpt_of_empty_files_in_place_of_films"), "is no sealed file with anything in it")
        forged = {"profile_that_is_none_of_its_media": "of a form that nobody knows", "camera_that_is_called_marks": "of a form that nobody knows",
                  "excerpt_of_a_profile_that_is_none_of_its_media": "of a form that nobody knows", "excerpt_whose_totals_are_those_of_its_lines": "less than the lines show",
                  "excerpt_whose_totals_have_fewer_frames_than_its_lines": "less than the lines show", "excerpt_whose_totals_leave_a_stream_out": "less than the lines show"}
        whole = {"power_cut": "INTACT WITH GAPS", "film_that_was_found_a_day_later": "INTACT WITH GAPS",
                 "token_of_before_the_crash_that_is_entered_behind_what_was_found": "INTACT WITH GAPS", "old_film_that_is_said_to_be_found_behind_a_later_token": "INTACT WITH GAPS",
                 "films_that_end_with_a_whole_chunk": "INTACT"}
        parts = {"excerpt_of_the_second_half": "INTACT EXCERPT", "excerpt_that_goes_on_behind_the_end": "from 6000000000 to 20190000000 ns"}
        usual = {"old_film_that_is_said_to_be_found", "old_film_that_is_said_to_be_found_an_hour_later", "sealed_for_nobody", "empty_files_in_place_of_films",
                 "excerpt_of_a_profile_that_is_none_of_its_media", "excerpt_whose_totals_are_those_of_its_lines", "excerpt_of_what_was_erased", "film_that_was_found_a_day_later",
                 "excerpt_that_goes_on_behind_the_end"}
        self.ask_the_scripts(usual, doubted | unsealed | forged | whole | parts,
                             dict.fromkeys(doubted | unsealed, 2) | dict.fromkeys(forged, 1) | dict.fromkeys(whole, 0) | dict.fromkeys(parts, 4))

    def test_the_scripts_with_stock_tools_find_film_that_is_not_there(self):
        blind = dict.fromkeys(("a_minute_of_sealed_nothings_of_a_second", "more_than_five_seconds_of_sealed_nothings", "a_minute_of_sealed_nothings_with_gaps_of_no_length",
                               "a_camera_that_holds_nothing", "empty_parts_without_a_frame", "excerpt_of_a_minute_without_film", "excerpt_of_two_seconds_without_film"), "holds no picture")
        unsealed = dict.fromkeys(("a_minute_of_empty_files_of_a_second", "empty_files_that_are_said_to_be_found", "texts_that_are_said_to_be_found",
                                  "sealed_nothings_that_are_said_to_be_found_of_a_camera", "empty_parts_with_as_many_frames_as_there_should_be",
                                  "headers_alone_with_as_many_frames_as_there_should_be", "empty_subject", "subject_in_the_clear", "subject_that_is_a_sealed_nothing"),
                                 "is no sealed file with anything in it")
        many = {"more_parts_than_a_recorder_that_dies_leaves": "found 65 segments of endoscope"}
        forged = dict.fromkeys(("seams_that_add_up", "gaps_of_no_length_that_are_joined_over_a_hole"), "has seams until")
        whole = {"a_minute_of_sealed_nothings_in_a_gap": "INTACT WITH GAPS", "sealed_nothings_that_were_found_of_a_monitor": "INTACT WITH GAPS",
                 "parts_that_a_power_cut_left_empty": "INTACT WITH GAPS", "parts_of_which_a_power_cut_left_a_block_and_zeros": "INTACT WITH GAPS",
                 "parts_of_which_some_was_written": "INTACT WITH GAPS",
                 **dict.fromkeys(("five_seconds_of_sealed_nothings", "three_seconds_of_one_picture_each", "seams_that_are_few", "subject_that_is_sealed"), "INTACT")}
        parts = {"excerpt_of_seconds_without_film_between_others": "INTACT EXCERPT"}
        usual = {"more_than_five_seconds_of_sealed_nothings", "excerpt_of_two_seconds_without_film", "empty_files_that_are_said_to_be_found", "subject_in_the_clear",
                 "seams_that_add_up", "parts_that_a_power_cut_left_empty", "five_seconds_of_sealed_nothings"}
        self.ask_the_scripts(usual, blind | unsealed | many | forged | whole | parts,
                             dict.fromkeys(blind | unsealed | many, 2) | dict.fromkeys(forged, 1) | dict.fromkeys(whole, 0) | dict.fromkeys(parts, 4))

    def test_the_scripts_with_stock_tools_take_an_embedded_authority_for_the_recorder_s_own(self):
        folder = self.scratch / "embedded"
        by_name = stamp.Authority(folder / "by-name", "embedded", root_name="Kiroku embedded time-stamping CA")
        by_policy = stamp.Authority(folder / "by-policy", "embedded", policy="2.25.197830237812365870224498532130945381713")
        for authority, own in ((self.world.outside, False), (by_name, True), (by_policy, True)):
            with self.subTest(authority.folder.name):
                at = folder / f"of {authority.folder.name}"
                at.mkdir()
                world = dataclasses.replace(self.world, folder=at, outside=authority)
                for given in (world.write(world.sound()), forgeries.sound_excerpt(world)):
                    report = json.loads(self.ask("kiroku-verify", "--json", *self.given_as_options(given, at), given.path).stdout)
                    self.assertEqual(report["time"], "self-issued" if own else "external")
                    said = self.said_by_the_scripts(given, at)
                    self.assertRegex(said.stdout.splitlines()[-1], "^INTACT")
                    self.assertEqual(said.stdout.count("self-issued, so the recorder says that they existed") > 0, own, said.stdout)
                    self.assertEqual(said.stdout.count(": they existed") > 0, not own, said.stdout)

    def test_the_scripts_with_stock_tools_know_no_later_version(self):
        later = dict.fromkeys(("case_of_a_later_version", "excerpt_of_a_later_version", "excerpt_of_a_case_of_a_later_version"), "names a later version of the format")
        self.ask_the_scripts(set(later), later, dict.fromkeys(later, 2))

    def ask_the_scripts(self, usual, lines, statuses):
        """Of each forgery by name: what the last line holds, and the exit status; of the `usual` ones alone but in the nightly run."""
        for name, _, make in forgeries.ALL:
            if name not in lines or (name not in usual and "KIROKU_EVERY_FORGERY" not in os.environ):
                continue
            with self.subTest(name):
                folder = self.scratch / "scripts" / name
                folder.mkdir(parents=True)
                status, line = self.of_the_scripts(make(dataclasses.replace(self.world, folder=folder)), folder)
                self.assertEqual(status, statuses[name], line)
                self.assertIn(lines[name], line)

    def test_every_finding_is_reached_and_both_verifiers_agree(self):
        keyed = set(re.findall(r"^\| `([a-z-]+)` \|", (HERE / "README.md").read_text("utf-8"), re.M))
        reached, judged = set(), set()
        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            made = [(name, codes, pool.submit(self.forge, name, make)) for name, codes, make in forgeries.ALL]
            for name, codes, future in made:
                ours, other = future.result()
                with self.subTest(name):
                    self.assertLessEqual(set(codes), ours[1])
                    if other is not None:
                        self.assertEqual(other, ours)
                        judged |= other[1]
                    if not codes:
                        self.assertIn(ours[0], ("intact", "intact-excerpt"))
                reached |= ours[1]
        self.assertEqual(reached, set(verifier.severities()))
        self.assertEqual(reached - judged, keyed, "README.md lists the codes that only our program judges")
        print(f"{len(made)} folders reach all {len(reached)} codes; both verifiers agree on each of the {len(judged)} that need no key", file=sys.stderr)

    def test_witnesses_count_over_the_end_alone_that_is_led_to(self):
        folder = self.scratch / "witnessed"
        folder.mkdir()
        world = dataclasses.replace(self.world, folder=folder, sealed=dict(self.world.sealed))
        witness, now = note.Signer("notary.example/w1", bytes([4] * 32)), int(time.time()) - 60
        (folder / "witnesses.txt").write_text(f"witness w1 {cosignature.key_of(witness)}\nquorum w1\n")
        genuine = world.sound().write(folder / "genuine")
        log, signed = forgeries.log_of_the_end(world, genuine)
        (folder / "log.note").write_bytes(cosignature.cosigned(signed, witness, now))
        world.sealed["endoscope 1"] = age.seal(b"another film\n", [world.reader.public])
        rewritten = world.sound().write(folder / "rewritten")
        self.assertEqual((rewritten.lines[0], len(rewritten.lines)), (genuine.lines[0], len(genuine.lines)))
        sizes = sorted(genuine.notes)

        def excerpt(written, size):
            name = f"{written.folder.parent.name} {size}"
            return w.write_excerpt(written, folder / name, 6 * SECOND, 9 * SECOND, ["endoscope"], 2, size)

        def told(given, *options):
            """Exit status, whether a quorum is met, over what, and how much the log states or a proof proves."""
            done = self.ask("kiroku-verify", "--json", "--witnesses", folder / "witnesses.txt", *self.given_as_options(given, folder), *options, given.path)
            report = json.loads(done.stdout)
            return done.returncode, report["witnesses"]["quorum"], report["witnesses"]["holds"], (report["log"] or {}).get("entries"), report["proved_entries"]

        beside = {"log": log, "against": [folder / "log.note"]}
        self.assertEqual(told(world.given(genuine.folder, **beside)), (0, True, "end", len(genuine.lines), 0))
        to_the_end, part, other = excerpt(genuine, sizes[-1]), excerpt(genuine, sizes[-2]), excerpt(rewritten, sizes[-2])
        self.assertEqual(told(world.given(to_the_end, **beside)), (4, True, "end", sizes[-1], 0))
        # Of what nothing leads to, the log may say what it likes.
        for each in (part, other):
            self.assertEqual(told(world.given(each, **beside)), (3, False, "nothing", 0, 0))
            self.assertEqual(told(world.given(each, **beside), "--excerpt"), (3, False, "nothing", 0, 0))
        done = self.ask("kiroku-verify", "--witnesses", folder / "witnesses.txt", *self.given_as_options(world.given(other, **beside), folder), other)
        self.assertIn("nobody witnessed the others", done.stdout)
        # A proof leads there, of the genuine one.
        proved = forgeries.by_proof(world, world.given(part, log=log), part=(sizes[-2], genuine.lines))
        self.assertEqual(told(proved), (3, False, "end", None, sizes[-2]))
        self.assertEqual(told(dataclasses.replace(proved, **beside)), (4, True, "end", 0, sizes[-2]))
        forged = forgeries.by_proof(world, world.given(other, log=forgeries.log_of_the_end(dataclasses.replace(world, folder=folder / "other"), rewritten)[0]),
                                    part=(sizes[-2], rewritten.lines))
        self.assertEqual(told(dataclasses.replace(forged, **beside)), (3, False, "end", 0, sizes[-2]))
        # Nor is a policy for the log of another machine of this name one for this log.
        namesake = forgeries.NAMESAKE.key
        for key, answer in ((world.device.key, (0, True, "end")), (namesake, (3, False, "nothing"))):
            (folder / "witnesses.txt").write_text(f"log {key}\nwitness w1 {cosignature.key_of(witness)}\nquorum w1\n")
            self.assertEqual(told(world.given(genuine.folder, **beside, devices=[world.device.key, namesake]))[:3], answer)
        (folder / "witnesses.txt").write_text(f"witness w1 {cosignature.key_of(witness)}\nquorum w1\n")
        # Another device that the verifier trusts for its own cases vouches for none of this one.
        stranger = forgeries.ANOTHER_DEVICE
        theirs, signed = forgeries.log_of_the_end(dataclasses.replace(world, folder=folder / "theirs"), rewritten, stranger)
        (folder / "theirs.note").write_bytes(cosignature.cosigned(signed, witness, now))
        trusted = world.given(rewritten.folder, log=theirs, devices=[world.device.key, stranger.key])

        def cosign(parts):
            parts["signed"] = cosignature.cosigned(parts["signed"], witness, now)
        by_theirs = forgeries.by_proof(dataclasses.replace(world, device=stranger), trusted, cosign)
        self.assertEqual(told(by_theirs), (3, False, "nothing", None, 0))
        self.assertEqual(told(dataclasses.replace(trusted, against=[folder / "theirs.note"]))[1:3], (False, "nothing"))

    def test_our_program_reads_the_other_writers_case(self):
        folder = self.scratch / "written"
        folder.mkdir()
        case, lines = self.case_of_lines()
        written = case.write(folder)
        given = self.world.given(written.folder)
        self.assertEqual(self.of_the_other(given, folder), ("intact", set()))
        self.assertEqual(self.of_ours(given, folder), ("intact", set()))
        (folder / "identity.txt").write_text(f"{self.world.reader}\n")
        options = self.given_as_options(given, folder)
        report = json.loads(self.ask("kiroku", "verify", "--json", "-i", folder / "identity.txt", *options, written.folder).stdout)
        self.assertEqual((report["verdict"], report["findings"], report["time"]), ("intact", [], "external"))
        self.assertEqual((report["contents"]["opened"], report["contents"]["decoded"]), (3, 3))

        def export(stream, name):
            done = self.ask("kiroku", "export", written.folder, "-i", folder / "identity.txt", "--stream", stream, "-o", folder / name)
            self.assertEqual(done.returncode, 0, done.stderr)
            return (folder / name).read_text("utf-8")

        self.assertEqual(export("vitals", "vitals.jsonl"), "".join(lines["vitals"]))
        self.assertEqual(export("pointing", "pointing.jsonl"), "".join(lines["pointing"]))
        table = list(csv.DictReader(export("vitals", "vitals.csv").splitlines()))
        self.assertIn("97.5", str(table))
        for line in lines["vitals"]:
            schema.check(strict_json.parse(line.rstrip("\n").encode(), fractions=True), schema.load("vital-lines"))

        # age's own program reads what was sealed here.
        if shutil.which("age"):
            sealed = written.folder / "segments/vitals/00000000.jsonl.age"
            done = subprocess.run(["age", "-d", "-i", folder / "identity.txt", sealed], capture_output=True, check=True)
            self.assertEqual(done.stdout.decode(), "".join(lines["vitals"]))

    def test_both_verifiers_refuse_the_same_lines(self):
        chance = random.Random(3)
        for entries, name, levels, options in ((mutations.CASE, "case-ledger", 4, []), (mutations.LOG, "appliance-log", 2, ["--as-log"])):
            lines = [mutations.changed(entries, chance) for _ in range(900)]  # a report keeps a thousand findings of one code
            folder = self.scratch / name
            folder.mkdir()
            (folder / "ledger.jsonl").write_bytes(b"".join(line + b"\n" for line in lines))
            report = json.loads(self.ask("kiroku-verify", "--json", *options, folder).stdout)
            refused = {finding["entry"] for finding in report["findings"] if finding["code"] == "entry-malformed"}
            self.assertTrue(100 < len(refused) < 800, len(refused))
            for number, line in enumerate(lines):
                with self.subTest(line):
                    try:
                        verifier.parse_entry(line, name, levels)
                        taken = True
                    except (strict_json.Malformed, schema.Unfit):
                        taken = False
                    self.assertEqual(taken, number not in refused)

    def test_the_worked_example_is_a_case(self):
        maker = HERE.parents[1] / "docs/reference/make_example.py"
        subprocess.run([maker, "--check"], check=True)
        made = subprocess.run([maker, "--write", self.scratch / "example"], check=True, capture_output=True, text=True)
        path = pathlib.Path(made.stdout.strip())
        given = self.world.given(path, devices=[note.parse_key((path / "device.pub").read_text().strip())])
        self.assertEqual(self.of_ours(given, self.scratch / "example"), ("unproven", {"no-token"}))
        self.assertEqual(self.of_the_other(given, self.scratch / "example"), ("unproven", {"no-token"}))

    def case_of_lines(self):
        """A case of a second and a half: lines of every kind, their keys in any order, with blanks; tokens asked of `openssl ts` now."""
        world, shuffled = self.world, random.Random(5)
        to = [world.reader.recipient]
        utc_ns = time.time_ns() // 1000 * 1000
        case_id = stamp.text_of(utc_ns)[:19].replace("-", "").replace(":", "") + "Z-0f0e1611"
        case = w.Case(case_id, world.device, utc_ns, [w.stream(name, kind, "application/jsonl", to) for name, kind in (("vitals", "vitals"), ("events", "events"), ("pointing", "events"))])

        def line(**members):
            pairs = list(members.items())
            shuffled.shuffle(pairs)
            return re.sub(r"^{", "{ ", json.dumps(dict(pairs), separators=(" , ", " : "))) + "\n"

        utc = stamp.text_of(utc_ns)
        vitals = [line(time_ns=0, code="MDC_PULS_OXIM_SAT_O2", mdc=150456, value=97.5, unit="%", source="a", quality="good"),
                  line(time_ns=1, code="KIROKU_X", value=None, unit="", source="", quality="missing", device_time=utc),
                  line(time_ns=2, code="MDC_ECG_ELEC_POTL", rate_hz=500, values=[0.5, None, -2e-3], unit="mV", source="a", quality="questionable"),
                  line(time_ns=3, kind="text", code="MDC_MODE", text="Alert", source="a"),
                  line(time_ns=4, kind="alarm", code="MDC_EVT_HI", text="high", about="MDC_PULS_RATE", phase="start", state="active", priority="PH", source="a"),
                  line(time_ns=5, kind="message", answer="AA", text="MSH|\r", source="a"), line(time_ns=6, kind="message", answer="", base64="/w==", source="a"),
                  line(time_ns=7, kind="device-clock", zero=utc, spread_ns=-3, messages=2, source="a"),
                  line(time_ns=8, kind="notice", notice="segment-unknown", text="ZZZ", source="a")]
        event, commitment = w.event_line(bytes([7] * 32), {"text": "clip placed", "kind": "mark", "utc": utc, "time_ns": 9})
        pointing = [line(time_ns=10, by="Dr. Sato", role="guest", stream="vitals", x=0.25, y=1, picture_ns=3)]
        case.add("clock", MS, synchronised=True, offset_ns=0, error_ns=1000, step_ns=0)
        case.checkpoint()
        case.token(world.outside, 500 * MS)
        case.add("mark", 600 * MS, commitment=commitment)
        for stream, text, count in (("vitals", "".join(vitals), len(vitals)), ("events", event.decode(), 1), ("pointing", pointing[0], 1)):
            case.segment(stream, 0, 0, 1400 * MS, age.seal(text.encode(), [world.reader.public]), count, mono_ns=1450 * MS)
        case.close(1500 * MS)
        case.checkpoint()
        case.token(world.outside, 1600 * MS)
        case.checkpoint()
        return case, {"vitals": vitals, "events": [event.decode()], "pointing": pointing}

    def test_the_other_verifier_reads_our_case(self):
        self.assertEqual(self.ask("kiroku", "init", "--demo", "--ml-dsa", home="home").returncode, 0)
        home = self.scratch / "home"
        port = ports.reserved_port()
        config = home / "kiroku.toml"
        config.write_text(config.read_text() + f"""
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=64x48&rate=10"
[[room.stream]]
name = "vitals"
kind = "vitals"
source = "mllp://127.0.0.1:{port}"
[daemon]
socket = "{self.scratch}/s"
""")
        (self.scratch / "subject.json").write_text('{"patient":{"id":"7"},"procedure":{"description":"cholecystectomy"},"staff":[]}')
        with subprocess.Popen([PROGRAMS / "kirokud"], stderr=subprocess.STDOUT, stdout=subprocess.PIPE, env={**os.environ, "KIROKU_HOME": str(home)}) as daemon:
            try:
                self.await_text(daemon, b"recording for 1 room")
                case = json.loads(self.ask("kiroku", "case", "start", "--subject", self.scratch / "subject.json", "--json", home="home").stdout)["case"]
                self.deliver(port)
                self.assertEqual(self.ask("kiroku", "case", "mark", "clip placed", home="home").returncode, 0)
                changed = self.ask("kiroku", "case", "profile", "lossless", "--camera", "endoscope", "--why", "resection begins", home="home")
                self.assertEqual(changed.returncode, 0, changed.stderr)
                self.await_entry(home / "archive" / case / "ledger.jsonl", lambda entry: entry.get("profile") == "lossless")
                self.assertEqual(self.ask("kiroku", "case", "stop", home="home").returncode, 0)
            finally:
                daemon.send_signal(signal.SIGTERM)
                daemon.stdout.read()
        self.assertEqual(daemon.returncode, 0)
        archive, folder = home / "archive", self.scratch / "judged"
        folder.mkdir()
        given = forgeries.Given(archive / case, [note.parse_device((home / "device.identity").read_text())], [], [(home / "own-authority.pem").read_text()], archive / "log")
        # Notes, and gaps of a machine that is too busy, are of this machine: of its clock, of its load.
        verdict, noted = self.of_ours(given, folder)
        self.assertIn(verdict, ("intact", "intact-with-gaps"))
        self.assertEqual(self.of_the_other(given, folder), (verdict, noted))
        log = dataclasses.replace(given, path=archive / "log", log=None, as_log=True)
        self.assertEqual(self.of_the_other(log, folder), self.of_ours(log, folder))
        changed = shutil.copytree(archive / case, self.scratch / "changed" / case)
        with open(min((changed / "segments/endoscope").iterdir()), "r+b") as film:
            film.seek(300)
            byte = film.read(1)[0]
            film.seek(300)
            film.write(bytes([byte ^ 1]))
        changed = dataclasses.replace(given, path=changed)
        self.assertEqual(self.of_the_other(changed, folder), self.of_ours(changed, folder))
        self.assertEqual(self.of_the_other(changed, folder), ("tampered", noted | {"file-hash-differs"}))

        done = self.ask("kiroku", "excerpt", case, "--from", "0", "--to", "1", "--stream", "endoscope", "-o", self.scratch / "excerpt", home="home")
        self.assertEqual(done.returncode, 0, done.stderr)
        excerpt = dataclasses.replace(given, path=self.scratch / "excerpt")
        self.assertEqual(self.of_the_other(excerpt, folder), self.of_ours(excerpt, folder))
        self.assertEqual(self.of_the_other(excerpt, folder)[0], "intact-excerpt")
        self.check_schemas(archive, case)

    def check_schemas(self, archive, case):
        """All that the programs wrote is of the schemas, and every kind of line that they should have written is there."""
        seen = set()

        def fits(line, name, **options):
            value = strict_json.parse(line, **options)
            schema.check(value, schema.load(name))
            seen.add(f"{name}:{value.get('type', value.get('kind', ''))}")
            return value

        for line in (archive / case / "ledger.jsonl").read_bytes().splitlines():
            fits(line, "case-ledger")
        for line in (archive / "log/ledger.jsonl").read_bytes().splitlines():
            fits(line, "appliance-log", levels=2)
        fits((self.scratch / "excerpt/excerpt.json").read_bytes().rstrip(b"\n"), "excerpt")
        identity = self.identity_of(self.scratch / "home/identity.txt")
        for path in sorted((archive / case / "segments").glob("*/*.jsonl.age")):
            for line in age.unseal(path.read_bytes(), identity).splitlines():
                if path.parent.name == "vitals":
                    fits(line, "vital-lines", fractions=True)
                else:
                    fits(fits(line, "event-lines")["event"].encode(), "events")
        fits(age.unseal((archive / case / "subject.json.age").read_bytes(), identity), "subject")
        for kind in ("open", "clock", "segment", "token", "mark", "close"):
            self.assertIn(f"case-ledger:{kind}", seen)
        for kind in ("boot", "case-opened", "case-closed", "shutdown"):
            self.assertIn(f"appliance-log:{kind}", seen)
        for kind in ("", "text", "alarm", "message", "device-clock", "notice"):
            self.assertIn(f"vital-lines:{kind}", seen)
        self.assertLessEqual({"events:mark", "events:profile", "subject:", "excerpt:"}, seen)

    @staticmethod
    def identity_of(path):
        text = re.search(r"AGE-SECRET-KEY-1([A-Z0-9]+)", path.read_text())[1].lower()
        bits = 0
        for character in text[:-6]:
            bits = bits << 5 | "qpzry9x8gf2tvdw0s3jn54khce6mua7l".index(character)
        return age.Identity((bits >> 5 * len(text[:-6]) - 256).to_bytes(32, "big"))

    def await_text(self, process, wanted):
        seen, until = b"", time.monotonic() + LONGEST_WAIT_S
        while wanted not in seen:
            self.assertTrue(select.select([process.stdout], [], [], until - time.monotonic())[0], seen.decode(errors="replace"))
            more = os.read(process.stdout.fileno(), 65536)
            self.assertTrue(more, seen.decode(errors="replace"))
            seen += more

    def await_entry(self, ledger, holds):
        """Until the ledger has such a line; the recorder is asked for its state in between, which takes it a moment."""
        until = time.monotonic() + LONGEST_WAIT_S
        while not any(holds(json.loads(line)) for line in ledger.read_bytes().splitlines(True) if line.endswith(b"\n")):
            self.assertLess(time.monotonic(), until)
            self.ask("kiroku", "status", "--json", home="home")

    def deliver(self, port):
        """Messages of a monitor over MLLP, each acknowledged."""
        oxygen = "OBX|1|NM|150456^MDC_PULS_OXIM_SAT_O2^MDC|1.3.1.150456|97.5|262688^MDC_DIM_PERCENT^MDC\r"
        now = time.strftime("%Y%m%d%H%M%S+0000", time.gmtime())  # of another time they would be a queue's
        messages = ["MSH|^~\\&|MON||||" + now + "||ORU^R01|1|P|2.6\r" + oxygen + "OBX|2|ST|2267^COMEN_ACVPU^99COMEN||Alert\rZZZ|1\r",
                    "MSH|^~\\&|MON||||" + now + "||ORU^R40|2|P|2.6\rOBX|1|CWE|196616^MDC_EVT_ALARM^MDC|1.1.0.0.1|196670^MDC_EVT_HI^MDC\r",
                    "MSH|^~\\&|MON||||" + now + "||ORU^R01|3|P|2.6||||||8859/1\rNTE|1||M\xfcller\r" + oxygen]
        with socket.create_connection(("127.0.0.1", port), timeout=LONGEST_WAIT_S) as monitor:
            for message in messages:
                monitor.sendall(b"\x0b" + message.encode("latin-1") + b"\x1c\r")
                answer = b""
                while not answer.endswith(b"\x1c\r"):
                    more = monitor.recv(4096)
                    self.assertTrue(more, answer)
                    answer += more
                self.assertIn(b"MSA|AA", answer)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    PROGRAMS = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
