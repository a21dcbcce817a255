import { describe, expect, it } from 'vitest';
import { following, kShortestWindow_ns, neighbours, panned, ticks, toPixel, toTime, zoomed } from '@/timeline/scale';

const whole = { start_ns: 100e9, end_ns: 36_100e9 };

describe('The window of the time line', () => {
  it('keeps the time under the pointer where it is', () => {
    let window = whole;
    const about = 5_000e9;
    for (let i = 0; i < 12; ++i) {
      const before = toPixel(about, window, 1000);
      window = zoomed(window, whole, 0.6, about);
      expect(toPixel(about, window, 1000)).toBeCloseTo(before, 3);
    }
  });

  it('never leaves the case, gets wider than it, or too narrow to see', () => {
    expect(zoomed(whole, whole, 50, 200e9)).toEqual(whole);
    let window = whole;
    for (let i = 0; i < 100; ++i) window = zoomed(window, whole, 0.5, whole.start_ns);
    expect(window).toEqual({ start_ns: whole.start_ns, end_ns: whole.start_ns + kShortestWindow_ns });
    expect(panned(window, whole, -5e9)).toEqual(window);
    expect(panned(window, whole, 99_999e9).end_ns).toBe(whole.end_ns);
  });

  it('shows a case shorter than half a second whole', () => {
    const short = { start_ns: 0, end_ns: 0.2e9 };
    expect(zoomed(short, short, 0.5, 0.1e9)).toEqual(short);
  });

  it('turns over when the clock leaves it, and not before', () => {
    const window = { start_ns: 200e9, end_ns: 300e9 };
    expect(following(window, whole, 250e9)).toBe(window);
    expect(following(window, whole, 301e9)).toEqual({ start_ns: 291e9, end_ns: 391e9 });
    expect(following(window, whole, whole.end_ns)).toBeDefined();
    expect(following(window, whole, whole.end_ns).end_ns).toBe(whole.end_ns);
  });

  it('finds the time of a pixel and the pixel of a time', () => {
    for (const time of [100e9, 5_432.1e9, 36_100e9]) expect(toTime(toPixel(time, whole, 1234), whole, 1234)).toBe(time);
  });
});

describe('The ruler', () => {
  it('counts from where the case begins, in round steps', () => {
    const { times, step_ns } = ticks({ start_ns: 103e9, end_ns: 163e9 }, 100e9, 600, 90);
    expect(step_ns).toBe(10e9);
    expect(times).toEqual([110e9, 120e9, 130e9, 140e9, 150e9, 160e9]);
  });
  it('has room for every number', () => {
    for (let length = 0.6e9; length < 36_000e9; length *= 1.7) {
      const window = { start_ns: 100e9, end_ns: 100e9 + length };
      const { step_ns, times } = ticks(window, 100e9, 1200, 92);
      expect((step_ns / length) * 1200).toBeGreaterThanOrEqual(92);
      expect(times.length).toBeLessThanOrEqual(14);
    }
  });
});

describe('Jumping between marks', () => {
  const marks = [10e9, 20e9, 30e9];
  it('goes to the next, and past the one that was just reached', () => {
    expect(neighbours(marks, 0)).toEqual({ previous: undefined, next: 10e9 });
    expect(neighbours(marks, 10e9)).toEqual({ previous: undefined, next: 20e9 });
    expect(neighbours(marks, 20.3e9)).toEqual({ previous: 10e9, next: 30e9 });
    expect(neighbours(marks, 21e9)).toEqual({ previous: 20e9, next: 30e9 });
    expect(neighbours(marks, 99e9)).toEqual({ previous: 30e9, next: undefined });
  });
});
