"""Whether the authorities' clocks and the case clock agree (docs/reference/format.md, "Clocks" and "Checkpoints and tokens")."""
import bisect
import dataclasses

from stamp import nanoseconds

SECOND = 1_000_000_000
SLACK = 2 * SECOND
DRIFT = 2000                     # one part in so many: 0.05 %
SLEW_PPB, FASTEST_PPB = 200_000, 100_500_000


@dataclasses.dataclass
class Timed:
    """A token in the ledger, with when it was made by the case clock."""
    entry: int
    checkpoint: int
    gen_ns: int
    accuracy_ns: int
    latest_extra_ns: int          # what gen_ns may lack where whole seconds and no accuracy are stated
    root: str                     # of whose authority, "" where no path was found
    authority: str
    outside: bool
    ordered: bool
    written_ns: int
    earliest_ns: int | None
    latest_ns: int
    over_end: bool
    stands: bool                  # over the end, and nobody says when by the case clock
    recoveries: int

    @property
    def earliest(self):
        return self.gen_ns - self.accuracy_ns

    @property
    def latest(self):
        return self.gen_ns + (self.accuracy_ns or self.latest_extra_ns)


class Slews:
    """By how much stated slews may have moved the case clock up to a moment, either way."""

    def __init__(self):
        self.stretches, self.stated = [[0, 0, 0]], 0     # from, moved before, rate

    def add(self, rate_ppb, mono_ns):
        rate = min(abs(rate_ppb), FASTEST_PPB)
        slew = rate if rate > SLEW_PPB else 0
        self.stretches[-1][2] = max(self.stated, slew)
        begins = slew > 0 and self.stated == 0
        self.stated = slew
        self._begin(mono_ns, FASTEST_PPB if begins else slew)

    def cut_off(self, mono_ns):
        self.stated = 0
        self._begin(mono_ns, 0)

    def _begin(self, from_ns, rate):
        later = max(self.stretches[-1][0], from_ns)
        self.stretches.append([later, self.until(later), rate])

    def until(self, mono_ns):
        moment = max(mono_ns, 0)
        begins, moved, rate = self.stretches[bisect.bisect_right([s[0] for s in self.stretches], moment) - 1]
        return moved + (moment - begins) * rate // 10**9


def cut(value, by):
    """Divides and leaves the fraction out, towards zero."""
    return value // by if value >= 0 else -(-value // by)


def us(ns):
    return cut(ns, 1000)


class Pace:
    """Tokens that go on with the case clock: of all of them the three that leave the least to the next one."""

    def __init__(self, slews):
        self.slews, self.last, self.ahead, self.behind = slews, None, None, None

    def add(self, token):
        drift = us(token.earliest_ns // DRIFT + self.slews.until(token.earliest_ns))
        gen, accuracy = us(token.gen_ns), us(token.accuracy_ns)
        ahead = gen - accuracy - us(token.latest_ns) + drift
        behind = us(token.earliest_ns) - gen - accuracy + drift
        self.last = token
        if self.ahead is None or ahead > self.ahead[0]:
            self.ahead = (ahead, token)
        if self.behind is None or behind > self.behind[0]:
            self.behind = (behind, token)

    def strictest(self):
        return [] if self.last is None else [self.last, self.ahead[1], self.behind[1]]

    def compare(self, before, now):
        """By how much the authority's time between two tokens differs beyond what is tolerated, in us: (excess, too fast, is it ahead)."""
        longest, shortest = now.latest_ns - before.earliest_ns, now.earliest_ns - before.latest_ns
        elapsed = us(now.gen_ns) - us(before.gen_ns)
        slewed = self.slews.until(now.latest_ns) - self.slews.until(before.earliest_ns)
        tolerance = us(SLACK + before.accuracy_ns + now.accuracy_ns + cut(longest, DRIFT) + slewed)
        too_slow, too_fast = us(shortest) - tolerance - elapsed, elapsed - us(longest) - tolerance
        return max(too_slow, 0 if now.stands else too_fast), too_fast, elapsed > us(longest)

    def differs(self, now):
        """The first of the three from which `now` differs."""
        return next((before for before in self.strictest() if self.compare(before, now)[0] > 0), None)


class Run:
    """Tokens of one authority, one after the other, whose clock goes on as the case clock does."""

    def __init__(self, slews):
        self.slews, self.tokens = slews, []

    @property
    def span(self):
        return self.tokens[0].written_ns, self.tokens[-1].written_ns

    def at_most(self, begin, end, ahead):
        """By how much the authority's clock may at most have gone on more than the case clock, or less, in us; None where no tokens enclose that time."""
        before = [t for i, t in enumerate(self.tokens) if max(x.written_ns for x in self.tokens[:i + 1]) <= begin]
        after = [t for i, t in enumerate(self.tokens) if min(x.written_ns for x in self.tokens[i:]) >= end]
        if not before or not after:
            return None

        def least(t):
            allowed = us(t.earliest_ns // DRIFT + self.slews.until(t.earliest_ns))
            return (us(t.gen_ns) - us(t.latest_ns) if ahead else us(t.earliest_ns) - us(t.gen_ns)) - us(t.accuracy_ns) + allowed

        def most(t):
            allowed = us(t.latest_ns // DRIFT + self.slews.until(t.latest_ns))
            return (us(t.gen_ns) - us(t.earliest_ns) if ahead else us(t.latest_ns) - us(t.gen_ns)) + us(t.accuracy_ns) + allowed
        return min(map(most, after)) - max(map(least, before))


class ClockRules:
    def __init__(self, report):
        self.report, self.tokens, self.slews, self.steps, self.recoveries = report, [], Slews(), [], 0
        self.seen, self.closed_ns, self.first_rate_ns = [], None, None

    def take_rate(self, rate_ppb, mono_ns):
        self.slews.add(rate_ppb, mono_ns)
        self.first_rate_ns = mono_ns if self.first_rate_ns is None else self.first_rate_ns
        self.seen.append(mono_ns)

    def take_step(self, step_ns, mono_ns):
        self.steps.append((mono_ns, step_ns))

    def take_recovered(self):
        self.recoveries += 1
        if self.seen:
            self.slews.cut_off(max(self.seen))

    def take(self, token):
        self.tokens.append(token)
        self.seen.append(token.written_ns)

    def finish(self, from_open=True):
        """Says what the clocks contradict; gives back the roots of authorities whose clock was set."""
        paces, agreeing, contradictions, disagreements, order = {}, {}, [], [], {}
        recoveries = 0
        for now in self.tokens:
            if now.recoveries != recoveries:
                recoveries, paces = now.recoveries, {}
            found = None
            if now.earliest_ns is not None:
                name = now.root or now.authority
                pace = paces.setdefault(name, Pace(self.slews))
                found = pace.differs(now)
                if found is not None:
                    excess, _, ahead = pace.compare(found, now)
                    one = (now.root, found.written_ns, now.written_ns, ahead, excess)
                    (contradictions if now.outside else disagreements).append(one)
                if not now.stands:
                    goes_on = pace.last is not None and found is None
                    if not goes_on:
                        pace = paces[name] = Pace(self.slews)
                    pace.add(now)
                    if now.outside:
                        runs = agreeing.setdefault(now.root, [])
                        if not goes_on:
                            runs.append(Run(self.slews))
                        runs[-1].tokens.append(now)
            if now.outside:
                before = [t for t in order.get(now.root, []) if t.entry < now.checkpoint]
                slack = 0 if now.ordered else SLACK
                if found is None and before and max(t.earliest for t in before) - now.latest > slack:
                    self.report("token-order", f"entry {now.entry}")
                order.setdefault(now.root, []).append(now)
        were_set = self._contradictions(contradictions, agreeing, from_open)
        for _, begin, end, _, excess in disagreements:
            if excess * 1000 > self._stepped(begin, end):
                self.report("clock-disagreement", f"{begin} to {end} ns")
        if self.seen and self.slews.until(max(self.seen)) - self.slews.until(self.seen[0]) >= SECOND:
            self.report("clock-slews-allowed-for", "1 s or more")
        self._late_end(were_set)
        return were_set

    def _late_end(self, left_out):
        """The first token over the end, as if it had been made at close: the rest of what the ledger states of it is the device key's word."""
        pace, recoveries, late = Pace(self.slews), 0, None
        for now in self.tokens:
            if self.closed_ns is None or not now.outside or now.checkpoint == 0 or now.earliest_ns is None or now.root in left_out:
                continue
            if now.recoveries != recoveries:
                recoveries, pace = now.recoveries, Pace(self.slews)
            if not now.over_end:
                pace.add(now)
            elif pace.last is not None:
                at_close = dataclasses.replace(now, earliest_ns=self.closed_ns, latest_ns=self.closed_ns)
                by = max(pace.compare(before, at_close)[1] for before in pace.strictest())
                late = by if late is None else min(late, by)
        if late is not None and late > 0:
            self.report("end-stamped-late", f"by {late} us")

    def _stepped(self, begin, end):
        return sum(abs(step) for mono, step in self.steps if begin - SLACK <= mono <= end + SLACK)

    def _contradictions(self, contradictions, agreeing, from_open):
        were_set, contradicting = set(), {one[0] for one in contradictions}

        def confirms(root, runs, begin, end, ahead, excess):
            """Whether another authority's clock went on as the case's did, and cannot have gone on as the one that differs."""
            earlier = [run for run in sorted(runs, key=lambda run: run.span) if run.span[0] <= begin]
            at_most = earlier[-1].at_most(begin, end, ahead) if earlier and root not in contradicting else None
            return at_most is not None and at_most < excess

        for one in contradictions:
            root, begin, end, ahead, excess = one
            shared = any(o[0] != root and o[3] == ahead and o[1] < end and begin < o[2] for o in contradictions)
            unseen = max(0, min(end if self.first_rate_ns is None else self.first_rate_ns, end) - begin)
            slewed = not from_open and excess <= unseen / 1000 * (FASTEST_PPB / 10**9)
            if shared:
                stated = excess * 1000 <= self._stepped(begin, end)
                self.report("authority-clock-differs" if stated or slewed else "clock-contradicted", f"{begin} to {end} ns")
            elif any(confirms(r, runs, begin, end, ahead, excess) for r, runs in agreeing.items()):
                self.report("authority-clock-set", f"{begin} to {end} ns")
                were_set.add(root)
            else:
                self.report("authority-clock-differs", f"{begin} to {end} ns")
        if all(one[0] in were_set for one in contradictions):
            self._compare_authorities(were_set)
        return were_set

    def _compare_authorities(self, left_out):
        order, pace, recoveries = [], Pace(self.slews), 0
        for now in self.tokens:
            if not now.outside or now.checkpoint == 0 or now.root in left_out:
                continue
            covered = [t for t in order if t.entry < now.checkpoint]
            before = max(covered, key=lambda t: t.earliest) if covered else None
            breach = before is not None and before.root != now.root and before.earliest - now.latest > SLACK
            if breach:
                self.report("authorities-disagree", f"entry {now.entry}")
            order.append(now)
            if now.earliest_ns is None:
                continue
            if now.recoveries != recoveries:
                recoveries, pace = now.recoveries, Pace(self.slews)
            found = pace.differs(now)
            if found is not None and found.root != now.root and not breach:
                self.report("authorities-disagree", f"entry {now.entry}")
            if not now.stands:
                if found is not None:
                    pace = Pace(self.slews)
                pace.add(now)


def first_zero_ns(opening):
    """UTC at which the case clock was zero."""
    return nanoseconds(opening["utc"]) - opening["mono_ns"]
