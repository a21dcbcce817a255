import { describe, expect, it } from 'vitest';
import { CaseClock } from '@/clock/case_clock';
import { correction, kDeadBandSeconds, kHardSeekSeconds, kSpeeds, nextSpeed } from '@/clock/sync';

/** A video that obeys, and is `offset` ahead of the clock: the offset after `seconds`, and how often it had to jump. */
function followed(offset: number, rate: number, seconds: number, drift = 0) {
  const step = 1 / 60;
  let jumps = 0;
  let correcting = false;
  let fastest = 0;
  for (let at = 0; at < seconds; at += step) {
    const what = correction(offset, rate, correcting);
    if (what.kind === 'seek') {
      offset = 0;
      ++jumps;
      continue;
    }
    correcting = what.rate !== rate;
    fastest = Math.max(fastest, what.rate / rate);
    offset += (what.rate * (1 + drift) - rate) * step;
  }
  return { offset, jumps, fastest };
}

describe('A video beside the case clock', () => {
  it.each([0.02, -0.02, 0.2, -0.2, 0.49, -0.49])('that is %f s off comes to it without a jump', (offset) => {
    const end = followed(offset, 1, 4);
    expect(Math.abs(end.offset)).toBeLessThanOrEqual(kDeadBandSeconds);
    expect(end.jumps).toBe(0);
    expect(end.fastest).toBeLessThanOrEqual(1.25);
  });

  it('is moved at once beyond half a second', () => {
    expect(correction(kHardSeekSeconds + 0.001, 1, false)).toEqual({ kind: 'seek' });
    expect(correction(-kHardSeekSeconds - 0.001, 1, false)).toEqual({ kind: 'seek' });
    expect(followed(3, 1, 1)).toMatchObject({ jumps: 1, offset: 0 });
  });

  it('is left alone while it is right', () => {
    expect(correction(kDeadBandSeconds * 0.9, 2, false)).toEqual({ kind: 'rate', rate: 2 });
  });

  it('that runs 0.5 % fast stays within a hundredth of a second', () => {
    expect(Math.abs(followed(0, 1, 60, 0.005).offset)).toBeLessThan(0.01);
  });

  it('is corrected at any speed', () => {
    for (const rate of kSpeeds) expect(Math.abs(followed(0.1, rate, 20 / rate).offset)).toBeLessThanOrEqual(kDeadBandSeconds);
  });
});

describe('Speeds', () => {
  it('go one up and one down, and stop at the ends', () => {
    expect(nextSpeed(1, 1)).toBe(1.25);
    expect(nextSpeed(1, -1)).toBe(0.75);
    expect(nextSpeed(8, 1)).toBe(8);
    expect(nextSpeed(0.1, -1)).toBe(0.1);
  });
});

describe('The case clock', () => {
  it('stands until it runs, and stops at the end of the case', () => {
    const clock = new CaseClock(5e9, 10e9);
    expect(clock.at(1000)).toBe(5e9);
    clock.run(1000);
    expect(clock.at(2500)).toBe(6.5e9);
    clock.setRate(2, 2500);
    expect(clock.at(3500)).toBe(8.5e9);
    clock.stand(3500);
    expect(clock.at(9000)).toBe(8.5e9);
    clock.run(9000);
    expect(clock.at(60_000)).toBe(10e9);
  });

  it('goes where it is set and no further than the case', () => {
    const clock = new CaseClock(5e9, 10e9);
    clock.run(0);
    clock.set(7e9, 100);
    expect(clock.at(1100)).toBe(8e9);
    clock.set(-3, 1100);
    expect(clock.at(1100)).toBe(5e9);
    clock.set(99e9, 1100);
    expect(clock.at(1100)).toBe(10e9);
  });
});
