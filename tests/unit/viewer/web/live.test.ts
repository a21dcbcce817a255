import { describe, expect, it } from 'vitest';
import { RemoteClock } from '@/clock/remote_clock';
import { LivePace } from '@/media/live_pace';

/** A live video fed with 25 pictures a second: where it ends up behind the newest, how often it jumped and stood. */
function watched(pace: LivePace, seconds: number, late: (picture: number) => number) {
  const step = 0.005;
  let at = 0;
  let rate = 1;
  let end = 0;
  let jumps = 0;
  let stops = 0;
  let standing = true;
  let next = 0;
  for (let now = 0; now < seconds; now += step) {
    while (next / 25 + late(next) <= now) {
      end = (next + 1) / 25;
      ++next;
      const move = pace.step(at, 0, end, now);
      if (move.kind === 'seek') {
        at = move.to;
        ++jumps;
      } else {
        rate = move.rate;
      }
    }
    const before = at;
    at = Math.min(end, at + rate * step);
    const stands = at === before || at === end;
    if (stands && !standing && now > 0.2) {
      ++stops;
      pace.stalled(now);
    }
    standing = stands;
  }
  return { behind: end - at, jumps, stops };
}

describe('The pace of a live video', () => {
  it('stays within a fifth of a second where pictures come in time', () => {
    const seen = watched(new LivePace(), 60, () => 0.02);
    expect(seen.behind).toBeLessThan(0.2);
    expect(seen.stops).toBeLessThan(3);
    expect(seen.jumps).toBeLessThan(2);
  });

  it('keeps more distance where pictures come in clumps, and stops no more', () => {
    const clumps = (picture: number) => 0.3 - (picture % 8) / 25;
    const pace = new LivePace();
    watched(pace, 60, clumps);
    const later = watched(pace, 30, clumps);
    expect(later.stops).toBeLessThan(6);
    expect(later.behind).toBeLessThan(1);
  });

  it('jumps to the newest after it stood aside, and over what is missing', () => {
    const pace = new LivePace();
    expect(pace.step(0, 10, 12, 0)).toEqual({ kind: 'seek', to: 11.9 });
    expect(pace.step(2, 0, 9, 0)).toEqual({ kind: 'seek', to: 8.9 });
    expect(pace.step(9, 0, 3, 0)).toEqual({ kind: 'seek', to: 2.9 });
  });
});

describe('A remote clock', () => {
  it('is known best by the answer that took least', () => {
    const clock = new RemoteClock();
    expect(clock.at(0)).toBeUndefined();
    clock.add(5_000e6, 1000, 1200); // 100 ms wrong at most; right: 4000 ms ahead, minus what the way there took longer
    clock.add(6_002e6, 2000, 2004);
    clock.add(7_090e6, 3000, 3180);
    expect(clock.at(4000)).toBeCloseTo(8_000e6, -3);
  });

  it('is learned anew where another case begins', () => {
    const clock = new RemoteClock();
    clock.add(600_000e6, 1000, 1002);
    clock.add(20e6, 2000, 2030);
    expect(clock.at(2015)).toBeCloseTo(20e6, -3);
  });
});
