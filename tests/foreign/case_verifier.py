"""Judges a case or an excerpt from its files alone, without keys, by docs/reference/format.md."""
import base64
import binascii
import functools
import hashlib
import os
import pathlib
import re
import subprocess

import merkle
import note
import schema
import stamp
import store_statements
import strict_json
from age_form import form_of, header_length, is_header
from clock_rules import SECOND, ClockRules, Timed, first_zero_ns
from log_verifier import LogRead
from stamp import nanoseconds
from verifier import (LARGEST_CERTIFICATES, LARGEST_LINE, LARGEST_NOTE, Folder, Heads, Judgement, Ledger, Unread, has_hole, newer, number_of, outside_notes, parse_entry, read_lines, read_small,
                      sha256_of, size_of_note, token_of_path)

MOST_IN_SEAMS, LONGEST_BLINDNESS, MOST_FOUND = 100_000_000, 5 * SECOND, 64
SEAM, LATE_BEGIN, EARLY_END, FUTURE, GAP_BEYOND_END = 1_000_000, 2 * SECOND, 10 * SECOND, 2 * SECOND, 2 * SECOND
LONGEST_SEGMENT, LONGEST_SILENCE, WALL_CLOCK, FIRST_STAMP_LATE = 11 * SECOND, 60 * SECOND, 60 * SECOND, 120 * SECOND
LARGEST_SEALED, LARGEST_TOKEN = 1 << 30, 1 << 20
LATEST_STAMP = 1_100_000_000     # a picture of a burst may be stamped so much later than it came
UNITS = {"video/mp2t": 90_000, "video/x-matroska": 1_000, "application/jsonl": SECOND}    # of time stamps, in a second
EXTENSIONS = {"video/mp2t": "ts", "video/x-matroska": "mkv", "application/jsonl": "jsonl"}
CONTAINERS = {"mpeg2": "ts", "uncompressed": "mkv", "lossless": "mkv"}
FORMS = ([("video", "video/mp2t", "mpeg2")] + [("video", "video/x-matroska", profile) for profile in ("uncompressed", "lossless")]
         + [(kind, "application/jsonl", "jsonl") for kind in ("vitals", "events")])
AFTERMATH = ("token", "token-missed", "erased")
CARRIES_ON = re.compile(r"operator; carries on case ([0-9]{8}T[0-9]{6}Z-[0-9a-f]{8}), ([1-9][0-9]*) entries, root ([0-9a-f]{64})")
ANNOUNCES = re.compile(r"recovered; to be carried on as case ([0-9]{8}T[0-9]{6}Z-[0-9a-f]{8})")


class Stream:
    """The segments of one stream: in order, without overlap, without holes that no gap accounts for."""

    def __init__(self, info, whole_case, from_open, report):
        self.info, self.whole_case, self.from_open, self.report = info, whole_case, from_open, report
        self.next_index = 0 if from_open else None
        self.interrupted, self.recovered, self.cut = not from_open, False, None
        self.first, self.end, self.begin = None, None, 0
        self.segments = self.frames = self.dropped = self.bytes = 0
        self.holes, self.gaps, self.fillings, self.with_pictures, self.erased = [], [], [], [], []
        self.taken, self.empty = [], []    # (start, end, whether it holds no picture); such ones in a row
        self.told_empty, self.found = False, 0
        self.containers, self.told_times = {}, set()
        self.silence = None
        self.longest_silence = self.latest_gap = 0
        self.entered = set()
        self.of_pictures = self.info["media"] != "application/jsonl"     # by what its files hold: a name is the writer's
        self.of_marks = self.info["kind"] == "events" and not self.of_pictures

    @property
    def extensions(self):
        own = EXTENSIONS[self.info["media"]]
        return [own] + [e for e in ("ts", "mkv") if e != own] if self.info["kind"] == "video" else [own]

    def path(self, index, extension, complete=True):
        return f"segments/{self.info['name']}/{index:08d}.{extension}.age" + ("" if complete else ".part")

    def index_of(self, path):
        """Of the path of a finished segment of this stream."""
        found = re.fullmatch(rf"segments/{re.escape(self.info['name'])}/([0-9]+)\.({'|'.join(self.extensions)})\.age", path)
        return number_of(found[1]) if found else None

    def is_erased(self, index):
        return any(first <= index <= last for first, last in self.erased)

    def take(self, segment):
        """False where the file has another name than it must have, or was entered before."""
        info, report, index = self.info, self.report, segment["index"]
        counted = "time_base" in segment
        profile = segment.get("profile")
        if profile is not None and info["kind"] != "video":
            named = False
        else:
            may_be = ([CONTAINERS[profile]] if profile else [EXTENSIONS[info["media"]]] if counted else self.extensions)
            named = segment["file"] in [self.path(index, e, segment["complete"]) for e in may_be]
        if not named:
            report("segment-name-differs", segment["file"])
        if self.next_index is not None and index != self.next_index:
            report("segment-out-of-order", segment["file"])
        self.first = index if self.first is None else self.first
        self.next_index = index + 1
        begin, end = segment["start_ns"], segment["end_ns"]
        if self.end is not None:
            if begin < self.end - SEAM:
                report("segment-overlap", segment["file"])
            elif begin > self.end + SEAM:
                self.holes.append((self.end, begin))
        self.end = max(self.end or 0, end)
        if counted and named:
            self._check_times(segment)
        if self.cut:
            report("segment-cut-unexplained", self.cut)
            self.cut = None
        if not segment["complete"]:
            report("segment-incomplete", segment["file"])
            if not self.interrupted and counted:
                self.cut = segment["file"]
        self.interrupted = False
        if not counted:
            report("segment-uncounted" if self.recovered else "segment-uncounted-unexplained" if self.from_open else "excerpt-range-short", segment["file"])
        if self.segments == 0:
            self.begin = begin
        frames = segment.get("frames", segment.get("samples", 0))
        self.segments += 1
        self.frames += frames
        self.dropped += segment.get("dropped", 0)
        self.bytes += segment["bytes"]
        self.found += not counted
        empty = self.of_pictures and counted and frames == 0
        if empty and self.taken and self.taken[-1][2]:
            self.empty[-1][1] = max(self.empty[-1][1], end)
        elif empty:
            self.empty.append([begin, end])
        self.taken.append((begin, end, empty))
        self._fill(segment, frames, counted, end - begin)
        if not named or (segment["complete"], index) in self.entered:
            return False
        self.entered.add((segment["complete"], index))
        return True

    def _check_times(self, segment):
        """Whether the time stamps that are stated run as the times do."""
        def tell(code, place):
            if code not in self.told_times:
                self.told_times.add(code)
                self.report(code, place)
        media = next(m for m, e in EXTENSIONS.items() if e == self._extension_of(segment))
        a_second = UNITS[media]
        first, start = segment["first_pts"], (segment["start_ns"] * a_second + SECOND // 2) // SECOND
        if segment["time_base"] != f"1/{a_second}" or not self.of_pictures and first != segment["start_ns"]:
            tell("segment-times-differ", segment["file"])
            return
        if not self.of_pictures:
            return
        of, spread, latest = self.containers.get(media), LATEST_STAMP * a_second // SECOND, start + LATEST_STAMP * a_second // SECOND
        if of and not self.interrupted and first - of["first"] < -spread:
            tell("segment-times-differ", segment["file"])
        if of:
            latest = max(latest, of["latest"] + of["pictures"])
        offset = first - start
        lowest, floor = min(of["lowest"] if of else offset, offset), max(of["floor"] if of else offset + start - latest, offset + start - latest)
        if floor > lowest + 2:
            tell("segment-times-late", self.info["name"])
        self.containers[media] = {"first": first, "start": start, "latest": latest, "lowest": lowest, "floor": floor,
                                  "pictures": min(segment.get("frames", segment.get("samples", 0)), 1 << 32)}

    def _extension_of(self, segment):
        """By its file's name, if it is one of those that the stream may have."""
        if self.info["kind"] == "video":
            for extension in ("ts", "mkv"):
                if segment["file"].endswith((f".{extension}.age", f".{extension}.age.part")):
                    return extension
        return EXTENSIONS[self.info["media"]]

    def _fill(self, segment, frames, counted, duration):
        if self.of_pictures and segment["complete"] and counted and duration > 0:
            self.fillings.append((frames + segment["dropped"], duration, segment["start_ns"]))
            if frames > 0 and duration > SEAM:
                self.with_pictures.append((segment["start_ns"], segment["end_ns"]))
        if (not counted or not self.of_marks and self.info["timing"] == "arrival") and duration > LONGEST_SEGMENT:
            self.report("segment-too-long", segment["file"])
        if not self.of_pictures and not self.of_marks:
            if frames > 0 or not counted:
                self.silence = None
            else:
                self.silence = segment["start_ns"] if self.silence is None else self.silence
                self.longest_silence = max(self.longest_silence, segment["end_ns"] - self.silence)

    def take_gap(self, gap):
        self.latest_gap = max(self.latest_gap, gap["end_ns"])
        if gap.get("of") == "sound":
            self.report("sound-gap", gap["stream"])
            return
        self.report("gap", gap["stream"])
        self.interrupt()
        self.gaps.append((gap["start_ns"], gap["end_ns"]))

    def take_erased(self, erased):
        self.erased.append((erased["first_index"], erased["last_index"]))
        entered = (self.next_index or 0) if self.whole_case else erased["last_index"] + 1
        if erased["last_index"] >= entered:
            self.report("erased-never-recorded", erased["stream"])
        if erased["first_index"] < entered:
            self.report("segments-erased", erased["stream"])

    def interrupt(self):
        self.cut, self.interrupted = None, True

    def totals(self):
        return {"segments": self.segments, "frames": self.frames, "dropped": self.dropped, "bytes": self.bytes}

    def joined(self):
        joined = []
        for start, stop in sorted(self.gaps):
            if joined and start <= joined[-1][1] + SEAM:
                joined[-1][1] = max(joined[-1][1], stop)
            else:
                joined.append([start, stop])
        return joined

    def uncovered(self, begin, end):
        """What of a hole lies behind the joined gap in which it begins; None where that is no more than a seam."""
        before = [gap for gap in self.joined() if gap[0] <= begin + SEAM]
        begin = max([begin] + [gap[1] for gap in before[-1:]])
        return (begin, end) if end - begin > SEAM else None

    def in_gaps(self, begin, end):
        """How much of a time gaps take, as they are stated."""
        total, until = 0, begin
        for start, stop in sorted(self.gaps):
            total += max(0, min(stop, end) - max(start, until))
            until = max(until, min(stop, end))
        return total

    def _check_empty(self):
        most = SEAM if self.frames == 0 and not self.found else LONGEST_BLINDNESS
        self.told_empty = any(end - begin - self.in_gaps(begin, end) > most for begin, end in self.empty)
        if self.told_empty:
            self.report("segments-empty", self.info["name"])

    def _check_seams(self, lines_begin):
        lacking, until = 0, None
        for begin, end in sorted([taken[:2] for taken in self.taken] + self.gaps, key=lambda span: span[0]):
            if until is not None and 0 < begin - until <= SEAM and (lines_begin is None or begin > lines_begin + SEAM):
                lacking += begin - until
            if lacking > MOST_IN_SEAMS:
                self.report("segment-hole", self.info["name"])
                return
            lacking = max(0, lacking - max(0, end - max(until or 0, begin)) // 1000)
            until = max(until or 0, end)

    def _check_stated_pictures(self, begin, end):
        here = [taken for taken in self.taken if taken[0] < end and max(taken[1], taken[0] + 1) > begin]
        if self.told_empty or not here or not all(empty for _, _, empty in here):
            return
        length = min(end - begin, sum(max(0, min(stop, end) - max(start, begin)) for start, stop, _ in here))
        if length - self.in_gaps(begin, end) > SEAM:
            self.report("segments-empty", self.info["name"])

    def finish(self, recorded, lines_begin):
        if self.found > MOST_FOUND and self.info["timing"] == "arrival" and not self.of_marks:
            self.report("segments-found-many", self.info["name"])
        self._check_empty()
        self._check_seams(lines_begin)
        if recorded and self.whole_case and not self.of_marks:
            self._check_ends(*recorded)
        if recorded and self.latest_gap - max(recorded[1], self.end or 0) > GAP_BEYOND_END:
            self.report("gap-beyond-end", self.info["name"])
        self._check_fillings()
        if any(gap[0] <= begin and end <= gap[1] for gap in self.joined() for begin, end in self.with_pictures):
            self.report("segment-within-gap", self.info["name"])
        for begin, end in self.holes:
            left = self.uncovered(begin, end)
            if left and lines_begin is not None and left[1] <= lines_begin + SEAM:
                self.report("excerpt-range-short", self.info["name"])
            elif left:
                self.report("segment-hole", self.info["name"])
        if self.dropped > 0:
            self.report("frames-dropped", self.info["name"])

    def _check_ends(self, begin, end):
        name = self.info["name"]
        if self.segments == 0 and not self.gaps:
            self.report("stream-empty", name)
            return
        if self.info["timing"] != "arrival":
            if self.segments and (self.begin - begin > LATE_BEGIN or end - self.end > EARLY_END):
                self.report("stream-shorter", name)
            return
        late = self.uncovered(begin, self.begin) if self.segments else None
        if late and late[1] - late[0] > LATE_BEGIN:
            self.report("stream-begins-late", name)
        early = self.uncovered(begin if self.end is None else self.end, end)
        if early and early[1] - early[0] > EARLY_END:
            self.report("stream-ends-early", name)

    def _check_fillings(self):
        name = self.info["name"]
        counted = bool(self.fillings) if self.of_pictures else not self.of_marks and self.segments > 0
        if counted and self.frames == 0:
            self.report("segments-sparse", name)
            return
        if self.longest_silence > LONGEST_SILENCE:
            self.report("monitor-silent", name)
        if self.fillings:
            rates = sorted(frames * SECOND / duration for frames, duration, _ in self.fillings)
            usual = max(rates[len(rates) // 2], 1.0)
            lacking, until = 0, None
            for frames, duration, start in self.fillings:
                few = frames * SECOND / duration <= 0.75 * usual
                lacking = (lacking if until is not None and start - until <= SEAM else 0) + usual * duration / SECOND - frames if few else 0
                until = start + duration if few else None
                if few and lacking > usual:
                    self.report("segments-sparse", name)
                    return
            frames, seconds = self.frames + self.dropped, sum(duration for _, duration, _ in self.fillings) / SECOND
            if frames < 0.75 * seconds and seconds - frames > 1:
                self.report("segments-sparse", name)

    def shows_all_of(self, begin, end, lines_begin, closed, total):
        if total == 0:
            return True
        written_before = self.info["timing"] == "arrival" and lines_begin <= begin
        begins = self.from_open or written_before or self.first == 0 or (self.first is not None and self.begin <= begin)
        return begins and (closed or (self.first is not None and self.end >= end))

    def check_stated_time(self, begin, end, recorded_from, closed_ns):
        """Of an excerpt: what a case must have in all of its time, in the time that it states."""
        name, gaps = self.info["name"], self.joined()
        begin, end = max(begin, recorded_from), end if closed_ns is None else min(end, closed_ns)
        if self.of_marks or end - begin <= SEAM:
            return
        if self.of_pictures:
            self._check_stated_pictures(begin, end)
        from_first = self.from_open or self.first == 0

        def lacks(left, tolerance):
            return left and left[1] - left[0] > tolerance and min(left[1], end) - max(left[0], begin) > SEAM

        if self.segments == 0 and not gaps and self.from_open:
            self.report("stream-empty", name)
            return
        if self.info["timing"] != "arrival":
            late = self.segments and from_first and self.begin - recorded_from > LATE_BEGIN and begin < self.begin
            if late or self.segments and closed_ns is not None and closed_ns - self.end > EARLY_END and end > self.end:
                self.report("stream-shorter", name)
            return
        if self.segments == 0 and not self.from_open and (not gaps or gaps[0][0] > begin + SEAM):
            self.report("excerpt-range-short", name)
            return
        if self.segments:
            if lacks(self.uncovered(recorded_from if from_first else begin, self.begin), LATE_BEGIN if from_first else 0):
                self.report("stream-begins-late" if self.from_open else "excerpt-range-short", name)
        if closed_ns is not None:
            last = self.end if self.segments else recorded_from if self.from_open else gaps[0][0]
            if lacks(self.uncovered(last, closed_ns), EARLY_END):
                self.report("stream-ends-early", name)


class Entries:
    """The rules that a case's lines obey, taken one after the other; of an excerpt, those lines that it has."""

    def __init__(self, folder, whole_case, wanted=lambda segment: True, from_open=True):
        self.folder, self.whole_case, self.wanted, self.from_open, self.report = folder, whole_case, wanted, from_open, folder.report
        self.claims = 0   # lines up to the last one that is about no token
        self.opening = self.device = self.close = self.close_entry = None
        self.stepped_ns = 0
        self.streams, self.named, self.authorities, self.checked = {}, set(), set(), []
        self.recovered = self.unsynchronised = self.slew = False
        self.last_mono, self.last_utc, self.step_stated = 0, None, False
        self.mono_at, self.entered_tokens, self.tokens, self.aftermath = {}, set(), 0, set()
        self.untrusted, self.valid_checkpoints, self.outside, self.no_trust = [], set(), [], False
        self.largest_checkpoint, self.missed_after_close, self.restating, self.token_hashes = 0, False, set(), {}
        self.clocks, self.first_comparisons = ClockRules(self.report), {}
        self.last_checked = self.oldest = None     # of the segments that were chosen until now: the last line, the earliest beginning
        self.oldest_timed, self.last_token = None, None
        self.entered_behind = []   # of all but those of marks: (end, line of the token before)
        self.found_behind = {}     # of found ones that were recorded as they came, by that line: the last (end, line)

    @property
    def origin(self):
        return f"kiroku/{self.device.name}/{self.opening['case']}"

    def take(self, number, entry):
        if entry is None:
            if number == 0:
                self.report("open-missing", "line 0")
            return
        kind = entry["type"]
        self._common(number, entry, kind)
        getattr(self, "_" + kind.replace("-", "_"))(number, entry)

    def _common(self, number, entry, kind):
        if entry["seq"] != number:
            self.report("entry-out-of-sequence", f"line {number}")
        if number == 0 and kind != "open":
            self.report("open-missing", "line 0")
        if number != 0 and kind == "open":
            self.report("open-repeated", f"line {number}")
        if entry["mono_ns"] < self.last_mono:
            self.report("clock-went-back", f"line {number}")
        self.last_mono = max(self.last_mono, entry["mono_ns"])
        if kind not in ("token", "token-missed"):
            self.claims = number + 1
        if self.last_utc is not None and entry["utc"] < self.last_utc and not self.step_stated and kind != "clock":
            self.report("utc-went-back", f"line {number}")
        self.last_utc, self.step_stated = entry["utc"], False
        if self.recovered and (kind in ("mark", "clock") or kind == "segment" and "time_base" in entry):
            self.report("entry-after-recovered", f"line {number}")
        if self.close is not None and kind not in AFTERMATH:
            self.report("entry-after-close", f"line {number}")

    def _stream(self, name, number):
        if name not in self.streams and self.opening:
            self.report("stream-unknown", f"line {number}: {name}")
        return self.streams.get(name)

    def _open(self, number, entry):
        if number != 0:
            return
        self.opening = entry
        for info in entry["streams"]:
            if (info["kind"], info["media"], info["profile"]) not in FORMS:
                self.report("stream-form-unknown", info["name"])
            if not any(re.fullmatch("age1[a-z0-9]+", recipient) for recipient in info["recipients"]):
                self.report("stream-for-nobody", info["name"])
        self.streams = {info["name"]: Stream(info, self.whole_case, self.from_open, self.report) for info in entry["streams"]}
        try:
            self.device = note.parse_key(entry["device"])
            self.folder.judge_device(self.device)
            known, log_size = self.folder.known_device(self.device), entry["appliance_log"]["size"]
            self.folder.alone_until = 1 << 62 if known.since and log_size <= known.since else 0
            self.folder.hardware_alone_until = 1 << 62 if known.hardware_since and log_size <= known.hardware_since else 0
        except note.Malformed as e:
            self.report("device-invalid", str(e))
        if "subject" in entry:
            self.named.add("subject.json.age")
            if self.whole_case:
                self.checked.append((entry["subject"], None, None))

    def _segment(self, number, entry):
        stream = self._stream(entry["stream"], number)
        if stream is None or not stream.take(entry):
            return
        self.named.add(entry["file"])
        if stream.info["timing"] == "arrival" and entry["end_ns"] - self.last_mono > FUTURE:
            self.report("segment-in-future", entry["file"])
        if self.wanted(entry):
            self.last_checked = number
            self.oldest = min(entry["start_ns"], entry["start_ns"] if self.oldest is None else self.oldest)
            if not stream.of_marks:
                self.oldest_timed = min(entry["start_ns"], entry["start_ns"] if self.oldest_timed is None else self.oldest_timed)
                if self.last_token:
                    its = (max(entry["end_ns"], self.recorded_from), self.last_token)
                    self.entered_behind.append(its)
                    if "time_base" not in entry and stream.info["timing"] == "arrival" and its[0] > self.found_behind.get(self.last_token, (-1,))[0]:
                        self.found_behind[self.last_token] = (its[0], number)
            self.checked.append((entry, stream, entry["index"]))

    def _gap(self, number, entry):
        if stream := self._stream(entry["stream"], number):
            stream.take_gap(entry)

    def _clock(self, number, entry):
        if "rate_ppb" in entry:
            self.clocks.take_rate(entry["rate_ppb"], entry["mono_ns"])
            self.slew = self.slew or abs(entry["rate_ppb"]) > 200_000
        if entry["step_ns"] != 0:
            self.step_stated = True
            self.stepped_ns += entry["step_ns"]
            self.clocks.take_step(entry["step_ns"], entry["mono_ns"])
            self.report("clock-stepped", f"line {number}")
        if not entry["synchronised"] and not self.unsynchronised:
            self.unsynchronised = True
            self.report("clock-not-synchronised", f"line {number}")

    def _mark(self, number, entry):
        pass

    def _recovered(self, number, entry):
        self.recovered = True
        self.clocks.take_recovered()
        for stream in self.streams.values():
            stream.recovered = True
            stream.interrupt()
        self.report("recovered", f"line {number}")

    def _close(self, number, entry):
        if self.close is not None:
            return
        self.close, self.close_entry = number, entry
        if self.opening and self.whole_case and not self.recovered:
            elapsed_ns = stamp.nanoseconds(entry["utc"]) - stamp.nanoseconds(self.opening["utc"])
            if abs(elapsed_ns - (entry["mono_ns"] - self.opening["mono_ns"]) - self.stepped_ns) > 60_000_000_000:
                self.report("close-utc-differs", f"line {number}")
        self.clocks.closed_ns = entry["mono_ns"]
        for name, stream in self.streams.items():
            stream.interrupt()
            stated, shown = entry["totals"].get(name), stream.totals()
            if not self.from_open:
                shown["segments"] = max(shown["segments"], stream.next_index or 0)
            if stated is None or any(stated[key] != shown[key] if self.from_open else stated[key] < shown[key] for key in shown):
                self.report("totals-differ", name)
        for name in entry["totals"]:
            self._stream(name, number)

    def _erased(self, number, entry):
        if self.close is None:
            self.report("erased-before-close", f"line {number}")
            return
        stream = self._stream(entry["stream"], number)
        if self.whole_case and max(self.folder.note_sizes, default=0) <= number:
            self.aftermath.add(number)
        elif stream:
            stream.take_erased(entry)

    def _token_missed(self, number, entry):
        self.authorities.add(entry["authority"])
        if self.close is not None and max(self.folder.note_sizes, default=0) <= number:
            self.aftermath.add(number)
        self.missed_after_close = self.missed_after_close or (self.close is not None and entry["checkpoint"] > self.close)
        self.report("token-missed", f"line {number}")

    def _token(self, number, entry):
        self.named.add(entry["file"])
        self.authorities.add(entry["authority"])
        self.tokens += 1
        self.last_token = number
        self.token_hashes[number] = entry["sha256"]
        size, authority, file = entry["checkpoint"], entry["authority"], entry["file"]
        if file not in (f"tokens/{size:08d}.{authority}.tsr", f"tokens/{size:08d}.{authority}.ers"):
            self.report("token-name-differs", file)
            return
        if (size, authority) in self.entered_tokens:
            self.report("token-repeated", file)
            return
        self.entered_tokens.add((size, authority))
        if size > number:
            self.report("token-covers-later", file)
            return
        self.largest_checkpoint = max(self.largest_checkpoint, size)
        kind, root, read = self._judge_token(number, entry)
        exchange = "asked_ns" in entry
        over_end = self.close is not None and size > self.close
        if exchange and (entry["asked_ns"] < self.mono_at.get(size, 0) or entry["mono_ns"] < entry["answered_ns"]):
            self.report("token-exchange-impossible", f"line {number}")
        valid = kind in ("outside", "self-issued")
        gen = nanoseconds(entry["gen_time"])
        whole = gen % SECOND == 0
        timed = Timed(number, size, gen, entry["accuracy_ns"], SECOND if whole else 0, root if valid else "", authority, kind == "outside",
                      bool(read and read.ordered), entry["mono_ns"], entry["asked_ns"] if exchange else self.mono_at.get(size),
                      entry["answered_ns"] if exchange else entry["mono_ns"], over_end, over_end and not exchange, self.clocks.recoveries)
        self.clocks.take(timed)
        if valid:
            self.valid_checkpoints.add(size)
            if kind == "outside" and size > 0:
                self.outside.append((number, size, root, self.oldest, entry["mono_ns"], gen))
            if timed.earliest_ns is not None and not timed.stands and not self.recovered and kind == "outside" and authority not in self.first_comparisons:
                round_trip = timed.latest_ns - timed.earliest_ns
                half = (round_trip + 1) // 2 + entry["accuracy_ns"] + (SECOND if whole else 0)
                self.first_comparisons[authority] = (gen, timed.earliest_ns + round_trip // 2, half)

    def _judge_token(self, number, entry):
        response = self.folder.read(entry["file"], LARGEST_TOKEN)
        if response is None:
            return None, "", None
        if hashlib.sha256(response).hexdigest() != entry["sha256"]:
            self.report("file-hash-differs", entry["file"])
            return None, "", None
        if entry["checkpoint"] not in self.folder.note_sizes:
            self.report("checkpoint-missing" if self.folder.all_listed else "file-unreadable", entry["file"])
            return None, "", None
        name = f"checkpoints/{entry['checkpoint']:08d}.note"
        data = self.folder.read(name, LARGEST_NOTE)
        if data is None or (self.folder.path / name).stat().st_size > LARGEST_NOTE:
            return None, "", None
        try:
            response, imprint_of = stamp.stamped(entry["file"], response)
            read = stamp.parse(response, shared=entry["file"].endswith(".ers"))
        except (stamp.Malformed, ValueError, IndexError, KeyError):
            self.report("token-refused", entry["file"])
            return None, "", None
        same = (nanoseconds(entry["gen_time"]) == read.gen_ns // 1000 * 1000 and entry["accuracy_ns"] == read.accuracy_ns and entry["serial"] == read.serial)
        if not same:
            self.report("token-entry-differs", f"line {number}")
        if read.imprint != imprint_of(hashlib.sha256(data).digest()):
            self.report("token-imprint-differs", entry["file"])
            return None, "", read
        kind, root, why = stamp.judge(response, self.folder.trust.roots, self.folder.trust.own_roots)
        if same and kind != "refused" and self.close is not None:
            self.restating.add(number)
        if kind == "refused":
            self.report("token-refused", f"{entry['file']}: {why}")
        elif kind == "no trust":
            self.no_trust = True
        elif kind == "untrusted":
            self.untrusted.append((entry["checkpoint"], entry["file"]))
        return kind, root, read

    def only(self, first, end, kinds):
        """Whether the entries from `first` on are those of tokens that restate what is there, or are of `kinds`."""
        return all(i in self.restating or i in kinds for i in range(first, end))

    def finish(self, lines_begin=None):
        recorded = None
        if self.close is not None and self.opening:
            recorded = (self.recorded_from, self.close_entry["mono_ns"])
        for stream in self.streams.values():
            stream.finish(recorded, lines_begin)
        if recorded and self.whole_case:
            self.judge_pre_roll(self.opening.get("begins_ns", 0))
            if all(stream.of_marks for stream in self.streams.values()):
                self.report("no-stream", "open")
        if self.slew:
            self.report("clock-slewed", "a rate beyond 200 ppm")
        were_set = self.clocks.finish(self.from_open)
        if self.tokens == 0:
            self.report("no-token", "there is no token")
        elif self.no_trust:
            self.report("no-trusted-authority", "no root was given")
        for size, file in self.untrusted:
            self.report("second-token-untrusted" if size in self.valid_checkpoints else "token-untrusted", file)
        if self.whole_case and self.tokens and self.close is not None and self.largest_checkpoint <= self.close and not self.missed_after_close:
            self.report("end-not-stamped", f"close in line {self.close}")
        for gen, middle, half in self.first_comparisons.values():
            if self.opening and abs(gen - first_zero_ns(self.opening) - middle) - half > WALL_CLOCK:
                self.report("clock-differs", "by more than a minute")
        outside = [(number, size, oldest, mono_ns, gen) for number, size, root, oldest, mono_ns, gen in self.outside if root not in were_set]
        if self.whole_case:
            alone_after = self.close is not None and outside and min(size for _, size, *_ in outside) > self.close
        else:
            alone_after = self.last_checked is not None and outside and outside[0][0] > self.last_checked
        if alone_after:
            self.report("stamped-after-close", f"behind line {self.close if self.whole_case else self.last_checked}")
        elif outside:
            oldest = [at for at in (outside[0][2], self.oldest_timed) if at is not None]
            if oldest and outside[0][3] - min(oldest) > FIRST_STAMP_LATE:
                self.report("first-stamped-late", f"line {outside[0][0]}")
        for end_ns, token in self.entered_behind:
            entered = [mono_ns for number, _, _, mono_ns, _ in outside if number <= token]
            if entered and entered[-1] - end_ns > FIRST_STAMP_LATE:
                self.report("segments-entered-late", f"behind line {token}")
                break
        for token, (end_ns, its_line) in self.found_behind.items():
            before, after = [each for each in outside if each[0] <= token][-1:], [each for each in outside if each[0] > token and each[1] > its_line][:1]
            if before and after:
                passed_us = max(0, after[0][4] - before[0][4]) // 1000
                if (end_ns - before[0][3]) // 1000 > passed_us + passed_us // 8 + FIRST_STAMP_LATE // 1000:
                    self.report("segment-in-future", f"behind line {token}")
                    break

    @property
    def recorded_from(self):
        return self.opening["mono_ns"] if self.opening and "begins_ns" in self.opening else 0

    def judge_pre_roll(self, begin):
        """Whether something is there of the time before `open`, from `begin` on."""
        if not self.opening or "begins_ns" not in self.opening or begin >= self.opening["mono_ns"]:
            return
        firsts = [at for s in self.streams.values() if not s.of_marks for at in [s.begin] * bool(s.segments) + [gap[0] for gap in s.gaps]]
        if firsts and min(firsts) - self.opening["begins_ns"] > LATE_BEGIN and min(firsts) > begin:
            self.report("stream-begins-late" if self.from_open else "excerpt-range-short", "the case")

    def check_files(self, rekeyed=lambda file: False):
        inodes = set()
        for expected, stream, index in self.checked:
            name = expected["file"]
            path = self.folder.path / name
            if self.folder.leads_elsewhere(name):
                self.report("file-not-regular", name)
                continue
            if not path.exists() and not path.is_symlink():
                if stream is None or not stream.is_erased(index):
                    self.report("file-missing", name)
                continue
            if path.is_symlink() or not path.is_file():
                self.report("file-not-regular", name)
                continue
            try:
                self._check_file(path, name, expected, rekeyed(name), inodes, stream)
            except OSError as e:
                self.report("file-unreadable", f"{name}: {e}")

    def _check_file(self, path, name, expected, is_rekeyed, inodes, stream):
        status = path.stat()
        size, before = status.st_size, b""
        skip = 0
        if is_rekeyed:
            before = (path.parent / (path.name + ".header")).read_bytes()
            skip = header_length(path)
            if skip is None or not is_header(before):
                self.report("file-hash-differs", name)
                return
            size += len(before) - skip
        if size != expected["bytes"]:
            self.report("file-size-differs", name)
            return
        if status.st_size > LARGEST_SEALED:
            self.report("file-too-large", name)
            return
        if status.st_nlink > 1:
            if (status.st_dev, status.st_ino) in inodes:
                self.report("file-not-regular", name)
                return
            inodes.add((status.st_dev, status.st_ino))
        found_cut_off = stream is not None and not expected["complete"] and "time_base" not in expected
        if not found_cut_off and has_hole(path, status):
            self.report("file-has-hole", name)
            return
        if before:
            data = path.read_bytes()
            digest = hashlib.sha256(before + data[skip:]).hexdigest()
        else:
            digest = sha256_of(path)
        if digest != expected["sha256"]:
            self.report("file-hash-differs", name)
            return
        form = form_of(path, status.st_size)
        if stream is None:
            if form != "holding":
                self.report("subject-not-sealed", name)
        elif form not in forms_of(expected, stream):
            self.report("segment-not-sealed", name)
        if is_rekeyed:
            self.report("rekeyed-not-opened", name)

    def check_device_file(self):
        if not self.opening:
            return
        path = self.folder.path / "device.pub"
        if path.is_symlink() or path.exists() and not path.is_file():
            self.report("file-not-regular", "device.pub")
        elif not path.exists() or path.stat().st_size != len(self.opening["device"].encode()) + 1 or path.read_bytes() != (self.opening["device"] + "\n").encode():
            self.report("device-file-differs", "device.pub")

    def judge_authority(self, file):
        """Of a file below authorities/."""
        if file.kind != "regular" or file.size > LARGEST_CERTIFICATES:
            return "unnamed"
        found = re.fullmatch(r"authorities/([a-z0-9][a-z0-9-]{0,31})\.pem(\.part)?", file.path)
        if not found:
            return "unnamed"
        if found[2]:
            return "part"
        certificates = is_certificates(read_small(self.folder.path / file.path, LARGEST_CERTIFICATES))
        if found[1] not in self.authorities:
            if not certificates:
                return "unnamed"
            self.report("authority-not-named", file.path)
        elif not certificates:
            self.report("authority-file-malformed", file.path)
        return "named"

    def is_folder(self, path):
        return path in ("checkpoints", "tokens", "segments", "authorities") or path.removeprefix("segments/") in self.streams


def forms_of(segment, stream):
    """Those that the file of a segment may have, by its entry."""
    counted, count = "time_base" in segment, segment.get("frames", segment.get("samples", 0))
    if segment["complete"]:
        return ("holding",) if count > 0 or not counted and stream.of_pictures else ("holding", "empty")
    return ("holding", "empty", "begun") if count > 0 else ("holding", "empty", "begun", "none")


@functools.lru_cache(maxsize=None)
def is_certificates(data):
    """Whether a text is PEM blocks of certificates and revocation lists that `openssl` reads, and nothing else."""
    blocks = re.findall(rb"-----BEGIN (CERTIFICATE|X509 CRL)-----\n((?:[^\n]+\n)*?)-----END (?:CERTIFICATE|X509 CRL)-----\n", data)
    if not blocks or b"".join(b"-----BEGIN %b-----\n%b-----END %b-----\n" % (kind, body, kind) for kind, body in blocks) != data:
        return False
    for kind, body in blocks:
        try:
            der = base64.b64decode(body.replace(b"\n", b""), validate=True)
        except binascii.Error:
            return False
        program = "x509" if kind == b"CERTIFICATE" else "crl"
        if subprocess.run(["openssl", program, "-inform", "DER", "-noout"], input=der, capture_output=True).returncode != 0:
            return False
    return True


MOST_WHILE_OPENING = 64  # entries that a log may get between the state that `open` has and the case's line


class AgainstLog:
    """A case beside what the appliance log says of it."""

    def __init__(self, log, entries, report):
        self.log, self.entries, self.report, self.silent, self.another = log, entries, report, False, None
        self.case = log.cases.get(entries.opening["case"]) if log and entries.opening else None
        self.known = self.case if self.case and self.case.opened is not None else None
        for name, number in log.held_and_erased if log else ():
            if not entries.opening or name == entries.opening["case"]:
                report("erased-while-held", f"line {number} of the log")
        if log:
            log.consents.report_of(entries.opening["case"] if entries.opening else None, report)
        if log and not log.ledger.readable:
            self.log = self.known = None
            return
        if log and entries.opening:
            device, another = entries.opening["device"], log.opened_by_another
            anothers = None
            if another and another.accuses:
                self.another = anothers = another  # of a trusted device: settle() compares the first lines
            elif not self.known and not (another.device if another else log.now.text):
                anothers = "log-silent"
            elif not self.known and not log.was_case_devices:
                anothers = "log-of-another-device"
            if isinstance(anothers, str):
                report(anothers, device)
            if anothers:
                self.log = self.known = None  # it speaks neither for the case nor against it
                return
            if log.told_by_another is not None:
                report("log-of-another-device", f"line {log.told_by_another}")
            if self.known and self.known.erased:
                report("log-case-erased", entries.opening["case"])
            stated = entries.opening["appliance_log"]
            self.head, self.signed = stated["size"] if stated else None, log.accusing
            if self.head is not None and log.root_at(stated["size"]) != stated["root"]:
                self.silent = self.signed < self.head or not log.beside_a_case()[1]
                if not self.silent:
                    report("log-head-differs", f"at {stated['size']} entries")

    def knows_beyond(self, size):
        return bool(self.known and any(root.size > size for root in self.known.roots))

    def _add(self, code, root_entry, speaks, text):
        """What an entry of the log contradicts that nobody signed in time: it may accuse no case that speaks for itself."""
        if root_entry in self.log.doubted and speaks:
            self.report("log-entry-doubted", f"{code}: {text}")
        else:
            self.report(code, text)

    def vouched(self, ledger):
        """The most lines whose root the case's own device states in its log under a signature by its ML-DSA key, and by its hardware."""
        if not self.known:
            return 0, 0
        try:
            device = self.log.folder.known_device(note.parse_key(self.entries.opening["device"]))
        except note.Malformed:
            return 0, 0
        by_ml_dsa, by_hardware = self.log.covered_by.get(str(device), (0, 0))

        def most(covered):
            signed = [r for r in self.known.roots if r.entry < covered and ledger.first < r.size <= len(ledger)]
            return max((r.size for r in signed if (ledger.root(r.size) or b"").hex() == r.root), default=0)
        return most(by_ml_dsa), most(min(by_hardware, self.log.from_before_hardware(device)))

    def settle(self, first_line, ledger, covered, whole):
        if self.another:
            differs = first_line is not None and hashlib.sha256(first_line).hexdigest() != self.another.opening_line
            self.report("log-opening-differs" if differs else "log-of-another-device", f"line {self.another.entry}")
        if not self.log or not self.entries.opening:
            return
        if self.known is None:
            if whole and len(ledger) == 1 and covered == 0:
                self.report("log-case-not-entered", self.entries.opening["case"])
            elif self.head is not None and self.log.beside_a_case()[1] and self.signed > self.head + MOST_WHILE_OPENING:
                self.report("log-case-unknown", self.entries.opening["case"])
            else:
                self.silent = True
        if self.silent:
            self.report("log-silent", f"{self.signed} lines are signed")
        if self.known is None:
            return
        if first_line is not None and hashlib.sha256(first_line).hexdigest() != self.known.opening_line:
            self._add("log-opening-differs", self.known.opened, covered >= 1, "open")
        said = set()
        for root in self.known.roots:
            doubted = root.entry in self.log.doubted
            here = ledger.shows(root.size)
            ours = ledger.root(root.size) if here else None  # none where an excerpt's own proof is none
            if here and doubted not in said and (ours is None or ours.hex() != root.root):
                said.add(doubted)
                self._add("log-checkpoint-differs", root.entry, covered >= root.size, f"at {root.size} entries")
        if whole:
            self._end(len(ledger), covered)

    def _end(self, entries, covered):
        close = self.entries.close
        its_end = close is not None and covered > close
        roots = sorted(self.known.roots, key=lambda r: r.size)
        signed = [r for r in roots if r.entry not in self.log.doubted]
        most = signed[-1] if signed and signed[-1].size > entries else roots[-1] if roots else None
        if most and most.size > entries:
            self._add("log-knows-more", most.entry, its_end, f"{most.size} entries")
            return
        if isinstance(self.entries, Newer):
            return
        if not self.known.closed and close is not None:
            self.report("log-case-open", self.entries.opening["case"])
        if self.known.closed:
            last = [sha for number, sha in sorted(self.entries.token_hashes.items()) if number < self.known.closed.size]
            if (last[-1] if last else None) != self.known.final_token:
                self._add("log-end-differs", self.known.closed.entry, covered >= self.known.closed.size, "final token")


def verify_case(path, trust):
    path = pathlib.Path(path)
    if (path / "excerpt.json").exists() and not (path / "ledger.jsonl").exists():
        return verify_excerpt(path, trust)
    folder = Folder(path, trust)
    data = folder.read("ledger.jsonl")
    if data is None:
        folder.judge_outside(outside_notes(trust, False) if trust.log else trust.against, [], None, True)
        return Judgement(folder.findings)
    newest = max(folder.note_sizes, default=0)
    if of_newer := _newer_case(folder, data, trust):
        return of_newer
    ledger = Ledger(data, "case-ledger", 4, folder.report, 0, newest)
    entries = Entries(folder, True)
    first = ledger.entries[0] if ledger.entries else None
    log = LogRead(trust.log, trust, opening=first if first and first["type"] == "open" else None) if trust.log else None
    if log:
        folder.findings += log.beside_a_case()[0]
    for number, entry in enumerate(ledger.entries):
        entries.take(number, entry)
        size = number + 1
        if size in folder.note_sizes:
            entries.mono_at[size] = entries.last_mono
            folder.judge_note(size, ledger.root(size), entries.device, entries.origin if entries.device else None, size <= ledger.known)
    if not ledger.readable:
        return Judgement(folder.findings)
    for size in folder.note_sizes:
        if size > len(ledger):
            folder.judge_note(size, None, entries.device, entries.origin if entries.device else None)
    comparison = AgainstLog(log, entries, folder.report)
    _judge_end(folder, ledger, entries, comparison, newest)
    entries.finish()
    if ledger.lines:
        comparison.settle(ledger.lines[0], ledger, folder.covered, True)
    entries.check_files()
    folder.judge_names(lambda file: _judge_name(folder, entries, file))
    for file in folder.listing:
        stream = entries.streams.get(file.path.split("/")[1]) if file.path.startswith("segments/") and file.path.count("/") == 2 else None
        index = stream.index_of(file.path.removesuffix(".part")) if stream else None
        if file.kind == "regular" and index is not None and file.path in entries.named and stream.is_erased(index):
            folder.report("erased-file-present", file.path)
    if entries.opening:
        called = path.resolve().name
        if called != entries.opening["case"]:
            is_of_another = re.fullmatch(r"[0-9]{8}T[0-9]{6}Z-[0-9a-f]{8}", called)
            folder.report("folder-of-another-case" if is_of_another else "folder-name-differs", called)
        _judge_carrying_on(folder, path.resolve(), entries)
    entries.check_device_file()
    shown = [(entries.origin, entries.device)] if entries.device and entries.opening else []
    folder.judge_outside(outside_notes(trust, False) if trust.log else trust.against, shown, ledger, True)
    vouched = folder.judge_proof(entries.opening["case"] if entries.opening else None, ledger, entries.device)
    folder.judge_keys(entries.device, entries.claims, tuple(map(max, vouched, comparison.vouched(ledger))))
    if entries.opening and entries.device and ledger.known == 1 << 62:
        store_statements.judge(folder, entries.opening, entries.device, ledger)
    return Judgement(folder.findings)


class Newer:
    """Of a case of a later version what is read all the same: whose it is, by a note, and over which state of the log it says that it was opened."""

    def __init__(self, case, device, document, end=None):
        log = document.get("appliance_log")
        readable = isinstance(log, dict) and type(log.get("size")) is int and log["size"] >= 0 and re.fullmatch("[0-9a-f]{64}", str(log.get("root")))
        self.opening = {"case": case, "device": str(device) if device else "", "appliance_log": log if readable else None}
        self.device, self.close, self.token_hashes = device, end, {}


def _head(folder, size, named):
    """The note of this size, the case that it is of and its device: a trusted one that signed it for a case of its own. Where none is named, anybody."""
    try:
        checkpoint = note.parse_checkpoint(_read_small(folder.path / "checkpoints" / f"{size:08}.note"))
    except (note.Malformed, OSError):
        return None
    for key in folder.trust.devices or ([named] if named else ()):
        device = folder.known_device(key)
        found = re.fullmatch(rf"kiroku/{re.escape(device.name)}/([0-9]{{8}}T[0-9]{{6}}Z-[0-9a-f]{{8}})", checkpoint.origin)
        ours = [s for s in checkpoint.signatures if s[0] == device.name]
        signed = len(ours) == 1 and ours[0][1] == device.id and note.holds(device.public, checkpoint.text, ours[0][2])
        others = (device.ml_dsa and device.by_ml_dsa(checkpoint) is False) or (device.hardware and device.by_hardware(checkpoint) is False)
        if found and signed and not others:
            return checkpoint, found[1], device
    if folder.trust.devices:
        return None
    found = re.fullmatch("kiroku/[^/]+/([0-9]{8}T[0-9]{6}Z-[0-9a-f]{8})", checkpoint.origin)
    return checkpoint, found[1] if found else "", None


def _named_by(document):
    try:
        return note.parse_key(document["device"]) if isinstance(document.get("device"), str) else None
    except note.Malformed:
        return None


def _newer_case(folder, data, trust):
    """The judgement where the first line names a later version, and the smallest checkpoint is of these lines: nobody changed it into another."""
    lines, sizes = Unread(data), folder.note_sizes
    document = newer(lines.lines[0], "case") if lines.lines else None
    if document is None or not sizes or sizes[0] > len(lines):
        return None
    head = _head(folder, sizes[0], _named_by(document))
    if not head or head[0].size != sizes[0] or head[0].root != lines.root(sizes[0]):
        return None
    checkpoint, case, device = head
    folder.report("format-newer", "ledger.jsonl")
    called = folder.path.resolve().name
    if case and re.fullmatch(r"[0-9]{8}T[0-9]{6}Z-[0-9a-f]{8}", called) and called != case:
        folder.report("folder-of-another-case", called)
    # Its own notes: only that lines are not those that were signed, or lack.
    own = Folder(folder.path, trust)
    own.alone_until = own.hardware_alone_until = 1 << 62
    if device:
        for size in sizes:
            if size <= len(lines) or lines.readable:
                own.judge_note(size, lines.root(size) if size <= len(lines) else None, device, checkpoint.origin)
    folder.findings += [each for each in own.findings if each[0] in ("ledger-changed", "ledger-cut")]
    return _compare_newer(folder, trust, Newer(case, device, document, len(lines) - 1), checkpoint.origin if device else None, lines, lines.lines[0], own.covered, True)


def _newer_excerpt(folder, document, trust):
    """Likewise of an excerpt: by its proof the first line is that of the tree to which its lines lead."""
    opening, size = _read_small(folder.path / "ledger-open.jsonl"), document["size"]
    line = opening.split(b"\n")[0]
    first = newer(line, "case") if b"\n" in opening and len(line) <= LARGEST_LINE else None
    head = _head(folder, size, _named_by(first)) if first is not None and size in folder.note_sizes else None
    if not head or merkle.root_by_inclusion(merkle.leaf(line), 0, size, [bytes.fromhex(h) for h in document["open_proof"]]) != head[0].root:
        return None
    return _compare_newer_excerpt(folder, trust, first, line)


def _compare_newer_excerpt(folder, trust, document, first_line):
    """Its notes alone tell of its case, where devices are known."""
    heads = [(size, _head(folder, size, None)) for size in folder.note_sizes] if trust.devices else []
    heads = [(size, head) for size, head in heads if head and head[0].size == size]
    origin, case, device = (heads[-1][1][0].origin, *heads[-1][1][1:]) if heads else (None, "", None)
    roots = {size: head[0].root for size, head in heads if (head[0].origin, head[2]) == (origin, device)}
    folder.report("format-newer", "the excerpt")
    return _compare_newer(folder, trust, Newer(case, device, document), origin, Heads(roots), first_line if heads else None, max(roots, default=0), False)


def _compare_newer(folder, trust, entries, origin, lines, first_line, covered, whole):
    """With what else was given; `whole`: of a case."""
    ends = whole and lines.readable
    if trust.log and not entries.opening["case"]:
        folder.judge_outside(outside_notes(trust, True), [], None, False)
        folder.report("log-silent", "nobody knows which case it is")
    elif trust.log:
        log = LogRead(trust.log, trust, opening=entries.opening)
        folder.findings += log.beside_a_case()[0]
        AgainstLog(log, entries, folder.report).settle(first_line, lines, covered, ends)
    folder.judge_outside(outside_notes(trust, False) if trust.log else trust.against, [(origin, entries.device)] if origin else [], lines, ends)
    folder.judge_proof(entries.opening["case"], lines, entries.device, None if whole else len(lines))
    return Judgement(folder.findings, not whole)


def _judge_end(folder, ledger, entries, comparison, newest):
    count, close, covered = len(ledger), entries.close, folder.covered
    if ledger.torn:
        damaged = newest > count or (close is not None and ledger.torn.too_long)
        folder.report("ledger-end-damaged" if damaged else "ledger-torn", f"line {count}")
    if count == 0:
        folder.report("open-missing", "no whole line")
    if close is None:
        folder.report("not-closed", "there is no close")
    elif not folder.all_listed or folder.unread > covered:
        pass   # what could not be read is said, and whether it covers the end nobody knows
    elif covered <= close:
        folder.report("close-not-covered", f"line {close}")
    elif covered < count:
        known = comparison.knows_beyond(covered)
        if not known and entries.only(covered, count, ()):
            folder.report("token-not-covered", f"from line {covered}")
        elif not known and entries.only(covered, count, entries.aftermath):
            folder.report("end-not-covered", f"from line {covered}")
        else:
            folder.report("ledger-not-covered", f"from line {covered}")


def _judge_name(folder, entries, file):
    path = file.path
    if path in ("ledger.jsonl", "device.pub") or path in entries.named or (file.kind != "folder" and size_of_note(path)):
        return "named"
    if file.kind == "folder":
        return "named" if entries.is_folder(path) else "unnamed"
    if path.startswith("authorities/"):
        return entries.judge_authority(file)
    part, whole = path.endswith(".part"), path.removesuffix(".part")
    stream = entries.streams.get(path.split("/")[1]) if path.startswith("segments/") and path.count("/") == 2 else None
    index = stream.index_of(whole) if stream else None
    if entries.close is None and index is not None and not part and _follows(folder, stream, index):
        return "segment"
    if stream and index is not None and index >= (stream.next_index or 0) and stream.gaps and max(g[1] for g in stream.gaps) >= (stream.end or 0):
        return "part" if part else "segment"
    token = token_of_path(whole)
    if entries.close is None or entries.recovered:
        if part and file.kind == "regular" and (size_of_note(whole) or token or index is not None):
            return "part"
        if token and not part:
            return "token"
    if entries.close is None:
        return "unnamed"
    if part:
        return "part" if token or size_of_note(whole) else "unnamed"
    if token and file.kind == "regular":
        try:
            response, imprint_of = stamp.stamped(path, _read_small(folder.path / path))
            data = _read_small(folder.path / f"checkpoints/{token[0]:08d}.note")
            return "token" if stamp.parse(response).imprint == imprint_of(hashlib.sha256(data).digest()) else "unnamed"
        except (stamp.Malformed, ValueError, IndexError, KeyError, OSError):
            return "unnamed"
    return "unnamed"


def _follows(folder, stream, index):
    """Whether a finished segment follows the stream's last entered one without a hole."""
    regular = {f.path for f in folder.listing if f.kind == "regular"}
    first = stream.next_index or 0
    return index >= first and all(any(stream.path(i, e) in regular for e in stream.extensions) for i in range(first, index))


def _judge_carrying_on(folder, path, entries):
    opening = entries.opening
    events = next((s for s in opening["streams"] if s["name"] == "events" and s["kind"] == "events"), None)
    carried = CARRIES_ON.fullmatch(events["source"]) if events else None
    later = ANNOUNCES.fullmatch(entries.close_entry["reason"]) if entries.close_entry else None

    def other(case):
        """Lines and entries of the case that lies beside this one, up to a line that is too long."""
        try:
            lines = read_lines(path.parent / case / "ledger.jsonl").split(b"\n")[:-1]
        except OSError:
            return None
        lines = lines[:next((i for i, line in enumerate(lines) if len(line) > LARGEST_LINE), len(lines))]
        found = []
        for line in lines:
            try:
                found.append(parse_entry(line, "case-ledger", 4))
            except (strict_json.Malformed, schema.Unfit):
                found.append(None)
        return lines, found

    def root_of(lines, size):
        return merkle.root([merkle.leaf(line) for line in lines[:size]]).hex() if len(lines) >= size else None

    def is_signed(case, lines, least):
        """Whether this case's device signed what lies there as that case, by its smallest note of at least so many lines."""
        if entries.device is None:
            return False
        notes = path.parent / case / "checkpoints"
        sizes = sorted(size for size in (size_of_note(f"checkpoints/{name}") for name in (os.listdir(notes) if notes.is_dir() else ())) if size and size >= least)
        if not sizes or len(lines) < sizes[0]:
            return False
        try:
            checkpoint = note.parse_checkpoint(_read_small(notes / f"{sizes[0]:08d}.note"))
        except note.Malformed:
            return False
        device = folder.known_device(entries.device)
        theirs = [s for s in checkpoint.signatures if s[:2] == (device.name, device.id)]
        holds = bool(theirs) and note.holds(device.public, checkpoint.text, theirs[0][2])
        holds = holds and not (device.ml_dsa and not device.by_ml_dsa(checkpoint)) and not (device.hardware and device.by_hardware(checkpoint) is False)
        stated = (checkpoint.origin, checkpoint.size, checkpoint.root.hex())
        return holds and stated == (f"kiroku/{device.name}/{case}", sizes[0], root_of(lines, sizes[0]))

    def begins(found, case):
        return bool(found and found[0] and found[0]["type"] == "open" and found[0]["case"] == case and found[0]["device"] == opening["device"])

    def says(holds, by_device):
        folder.report("carrying-on-holds" if holds else "carrying-on-broken" if by_device else "carried-on-not-compared", "the case beside it")

    if carried:
        case, size, root = carried[1], int(carried[2]), carried[3]
        beside = other(case)
        if beside is None:
            folder.report("carried-on-not-here", case)
        else:
            lines, found = beside
            closes = [e for e in found[:size] if e and e["type"] == "close"]
            announced = ANNOUNCES.fullmatch(closes[-1]["reason"]) if closes else None
            same = root_of(lines, size) == root
            # The very lines that this one names speak for themselves.
            says(same and announced is not None and announced[1] == opening["case"] and begins(found, case), same or len(lines) >= size and is_signed(case, lines, size))
    if later:
        beside = other(later[1])
        if beside is None:
            folder.report("carried-on-not-here", later[1])
        else:
            lines, found = beside
            source = next((s["source"] for s in found[0]["streams"] if s["name"] == "events"), "") if begins(found, later[1]) else ""
            named = CARRIES_ON.fullmatch(source)
            own = read_lines(path / "ledger.jsonl").split(b"\n")[:-1]
            holds = named is not None and named[1] == opening["case"] and root_of(own, int(named[2])) == named[3]
            by_device = is_signed(later[1], lines, 1)
            says(holds and by_device, by_device)


class PartOfLedger(Ledger):
    """Lines of an excerpt, with the subtrees over what lies before them."""

    def __init__(self, data, report, first, left):
        super().__init__(data, "case-ledger", 4, report, first, 1 << 62)
        sizes = [1 << bit for bit in range(first.bit_length() - 1, -1, -1) if first >> bit & 1]
        self.left = [bytes.fromhex(h) for h in left] if len(left) == len(sizes) else None

    def root(self, size):
        if self.left is None or size <= self.first:
            return None
        if size not in self._roots:
            self._roots[size] = merkle.root_behind(self.left, self.first, self.leaves[:size - self.first])
        return self._roots[size]


def verify_excerpt(path, trust):
    folder = Folder(path, trust)
    text = folder.read("excerpt.json", 4194304)
    if text is None:
        return Judgement(folder.findings, True)
    try:
        if not text.endswith(b"\n"):
            raise strict_json.Malformed("too long, or without a line feed at its end")
        document = strict_json.parse(text[:-1])
        schema.check(document, schema.load("excerpt"))
        if document["to_ns"] <= document["from_ns"] or document["size"] <= document["first_entry"]:
            raise strict_json.Malformed("a range is empty")
    except (strict_json.Malformed, schema.Unfit) as e:
        if text.endswith(b"\n") and newer(text[:-1], "excerpt"):
            return _compare_newer_excerpt(folder, trust, {}, None)
        return Judgement([("excerpt-malformed", str(e))], True)
    if of_newer := _newer_excerpt(folder, document, trust):
        return of_newer
    first, size, begin, end = document["first_entry"], document["size"], document["from_ns"], document["to_ns"]
    report, selected, present = folder.report, set(), {f.path for f in folder.listing}

    def wanted(segment):
        meets = segment["start_ns"] < end and begin < max(segment["end_ns"], segment["start_ns"] + 1)
        if segment["stream"] in document["streams"] and meets:
            selected.add(segment["file"])
            return True
        return False

    entries = Entries(folder, False, wanted, first <= 1)
    opening, part = folder.read("ledger-open.jsonl"), folder.read("ledger-part.jsonl")
    lines = None
    if opening is not None and part is not None:
        lines = _walk_excerpt(folder, entries, document, opening, part, trust)
        if lines is not None:
            _judge_reach(folder, entries, document, selected, lines)
    shown = [(entries.origin, entries.device)] if entries.device and entries.opening else []
    folder.judge_outside(outside_notes(trust, False) if trust.log else trust.against, shown, lines, False)
    vouched = folder.judge_proof(entries.opening["case"] if entries.opening else None, lines, entries.device, size)
    by_log = lines.comparison.vouched(lines) if lines is not None and lines.comparison else (0, 0)
    folder.judge_keys(entries.device, size, tuple(map(max, vouched, by_log)))
    entries.check_files(lambda file: file + ".header" in present)

    def judge(file):
        if file.path in ("excerpt.json", "ledger-open.jsonl", "ledger-part.jsonl", "device.pub"):
            return "named"
        if file.path == "subject.json.age":
            return "unnamed"
        segment = file.path.startswith("segments/")
        if (file.path in entries.named and not segment) or file.path in selected or (file.kind != "folder" and size_of_note(file.path)):
            return "named"
        if file.path.endswith(".header"):
            its = file.path.removesuffix(".header")
            return "named" if its in selected and its in present else "unnamed"
        if file.path.startswith("authorities/"):
            return entries.judge_authority(file)
        return "named" if file.kind == "folder" and entries.is_folder(file.path) else "unnamed"

    # Without the lines nothing says what is named.
    if not any(code == "file-unreadable" and text.startswith(("ledger-open.jsonl: ", "ledger-part.jsonl: ")) for code, text in folder.findings):
        folder.judge_names(judge)
    entries.check_device_file()
    return Judgement(folder.findings, True)


def _walk_excerpt(folder, entries, document, opening, part, trust):
    report, first, size = folder.report, document["first_entry"], document["size"]
    open_lines = opening.split(b"\n")
    if len(open_lines) < 2:
        report("excerpt-malformed", "ledger-open.jsonl holds no whole line")
        return None
    if len(open_lines) != 2 or open_lines[1]:
        report("excerpt-malformed", "ledger-open.jsonl holds more than one line")
    open_line = open_lines[0]
    signed_root = None
    if size in folder.note_sizes:
        try:
            signed_root = note.parse_checkpoint(folder.read(f"checkpoints/{size:08d}.note", LARGEST_NOTE) or b"").root
        except note.Malformed:
            pass
    if first > 0:
        entries.take(0, Ledger(open_line + b"\n", "case-ledger", 4, report, 0, 1 << 62).entries[0])
        if signed_root and merkle.root_by_inclusion(merkle.leaf(open_line), 0, size, [bytes.fromhex(h) for h in document["open_proof"]]) != signed_root:
            report("excerpt-proof-invalid", "open")
    lines = PartOfLedger(part, report, first, document["left"])
    if first > 0:
        proofs = {}
        for each in document["earlier"]:
            proofs.setdefault(each["size"], [bytes.fromhex(h) for h in each["proof"]])
        for earlier in [s for s in folder.note_sizes if s <= first]:
            before = len(folder.findings)
            root = _root_stated(folder, earlier)
            folder.judge_note(earlier, root, entries.device, entries.origin if entries.device else None)
            if len(folder.findings) == before or folder.findings[-1][0] in ("checkpoint-cosigned", "checkpoint-of-other-origin"):
                if not (earlier in proofs and signed_root and root and merkle.consistent(earlier, root, size, signed_root, proofs[earlier])):
                    report("excerpt-proof-invalid", f"checkpoint {earlier}")
    lines_begin, log, comparison = None, None, None
    for number, entry in enumerate(lines.entries, first):
        if number == 0 and lines.lines[0] != open_line:
            report("excerpt-malformed", "ledger-open.jsonl is not the first line")
        entries.take(number, entry)
        if lines_begin is None:
            lines_begin = entries.last_mono
            if trust.log and entries.opening:
                log = LogRead(trust.log, trust, opening=entries.opening)
                folder.findings += log.beside_a_case()[0]
            comparison = AgainstLog(log, entries, report)
        if number + 1 in folder.note_sizes:
            entries.mono_at[number + 1] = entries.last_mono
            folder.judge_note(number + 1, lines.root(number + 1) or b"", entries.device, entries.origin if entries.device else None)
    if lines.torn:
        report("excerpt-malformed", "the last line is not whole")
    if len(lines) != size:
        report("excerpt-malformed", "the lines do not end where excerpt.json says")
    if size not in folder.note_sizes and folder.all_listed:
        report("checkpoint-missing", "nothing covers the lines")
    if signed_root and lines.left is not None and len(lines) == size and lines.root(size) != signed_root:
        report("excerpt-proof-invalid", "the root of the lines")
    for beyond in [s for s in folder.note_sizes if s > len(lines)]:
        folder.judge_note(beyond, None, entries.device, entries.origin if entries.device else None)
    entries.finish(lines_begin if first > 1 else None)
    if comparison:
        comparison.settle(open_line, lines, folder.covered, False)
    lines.begin_ns, lines.comparison = lines_begin or 0, comparison
    return lines


def _root_stated(folder, size):
    try:
        return note.parse_checkpoint(_read_small(folder.path / f"checkpoints/{size:08d}.note")).root
    except (note.Malformed, OSError):
        return b""


def _read_small(path):
    """Of a file of which nothing is said if it cannot be read: a sparse one may be larger than any memory."""
    try:
        return read_small(path, LARGEST_NOTE) if path.is_file() else b""
    except OSError:
        return b""


def _judge_reach(folder, entries, document, selected, lines):
    report, begin, end = folder.report, document["from_ns"], document["to_ns"]
    last = max([entries.last_mono] + [s.end for s in entries.streams.values() if s.end is not None])
    if entries.opening and (begin < entries.opening.get("begins_ns", 0) or begin >= last):
        report("excerpt-outside-case", f"from {begin} ns")

    def erased(file):
        stream = entries.streams.get(file.split("/")[1])
        index = stream.index_of(file.removesuffix(".part")) if stream else None
        return index is not None and stream.is_erased(index)

    if all(erased(file) for file in selected):
        report("excerpt-empty", "no segment")
    totals = entries.close_entry["totals"] if entries.close_entry else {}
    closed_ns = entries.close_entry["mono_ns"] if entries.close_entry else None
    for name in document["streams"]:
        if name not in entries.streams:
            report("excerpt-malformed", f"{name} is no stream of the case")
        elif not entries.streams[name].shows_all_of(begin, end, lines.begin_ns, closed_ns is not None, totals.get(name, {}).get("segments")):
            report("excerpt-range-short", name)
        else:
            entries.streams[name].check_stated_time(begin, end, entries.recorded_from, closed_ns)
    entries.judge_pre_roll(begin)
    if entries.opening and document["case"] != entries.opening["case"]:
        report("excerpt-malformed", "it names another case")
    if entries.tokens and entries.largest_checkpoint <= (entries.last_checked or 0):
        report("excerpt-no-later-token", f"line {entries.last_checked}")
