import { describe, expect, it } from 'vitest';
import { fluoroscopyBody, readGeometry } from '@/compare/fluoroscopy';
import {
  byHandPicks,
  clicked,
  completePairs,
  kNoPicks,
  lacks,
  leastPairs,
  moved,
  picked,
  type Picks,
  pixelAt,
  placeOf,
  seenBy,
  withoutClick,
  withoutPair,
} from '@/compare/picks';

const at = { time_ns: 5e9, plan_s: 1.5 };
const pair = (picks: Picks, n: number): Picks => picked(picked(picks, 'organ', [n, 0, 0], at, undefined).picks, 'pixel', [n, 1], at, undefined).picks;

describe('Points picked on two pictures', () => {
  it('become pairs, from whichever side they are picked', () => {
    const first = picked(kNoPicks, 'pixel', [10, 20], at, undefined);
    expect(first).toEqual({ pair: 0, picks: { ...kNoPicks, at, pairs: [{ organ: null, pixel: [10, 20] }] } });
    const second = picked(first.picks, 'organ', [1, 2, 3], { time_ns: 9e9, plan_s: 9 }, 0);
    expect(second.pair).toBe(0);
    expect(second.picks.at).toEqual(at);
    expect(completePairs(second.picks)).toEqual([{ organ: [1, 2, 3], pixel: [10, 20] }]);
    // The next one is another pair, also while the first is chosen.
    expect(picked(second.picks, 'organ', [4, 5, 6], at, 0).pair).toBe(1);
  });

  it('go to the chosen pair where that lacks the side, else to the first that does', () => {
    const three = picked(
      picked(picked(kNoPicks, 'pixel', [1, 1], at, undefined).picks, 'pixel', [2, 2], at, undefined).picks,
      'pixel',
      [3, 3],
      at,
      undefined,
    ).picks;
    expect(three.pairs.length).toBe(3);
    expect(picked(three, 'organ', [0, 0, 0], at, 1).pair).toBe(1);
    expect(picked(three, 'organ', [0, 0, 0], at, undefined).pair).toBe(0);
  });

  it('are moved and removed; the last one takes the picture that they are of with it', () => {
    const two = pair(pair(kNoPicks, 1), 2);
    expect(moved(two, 'pixel', 1, [7, 8]).pairs[1]).toEqual({ organ: [2, 0, 0], pixel: [7, 8] });
    const one = withoutPair(two, 0);
    expect(one.pairs).toEqual([{ organ: [2, 0, 0], pixel: [2, 1] }]);
    expect(one.at).toEqual(at);
    expect(withoutPair(one, 0)).toEqual(kNoPicks);
  });

  it('are enough for a camera: four where its field is known, else six', () => {
    let picks: Picks = kNoPicks;
    expect(lacks(picks)).toBeUndefined();
    for (let n = 1; n <= 4; ++n) picks = pair(picks, n);
    expect([leastPairs(picks), lacks(picks)]).toEqual([6, 'pairs']);
    expect(lacks({ ...picks, field_deg: 60 })).toBeUndefined();
    expect(lacks(pair(pair(picks, 5), 6))).toBeUndefined();
  });
});

describe('Clicks on tools', () => {
  it('are one a picture, in order of time', () => {
    let picks = clicked(kNoPicks, 'forceps', { at_ns: 4e9, pixel: [1, 1] });
    picks = clicked(picks, 'forceps', { at_ns: 2e9, pixel: [2, 2] });
    picks = clicked(picks, 'forceps', { at_ns: 4e9, pixel: [3, 3] });
    picks = clicked(picks, 'scissors', { at_ns: 4e9, pixel: [9, 9] });
    expect(picks.clicks.get('forceps')).toEqual([
      { at_ns: 2e9, pixel: [2, 2] },
      { at_ns: 4e9, pixel: [3, 3] },
    ]);
    const without = withoutClick(withoutClick(picks, 'forceps', 4e9), 'scissors', 4e9);
    expect([...without.clicks.keys()]).toEqual(['forceps']);
    expect(withoutClick(without, 'hook', 1)).toEqual(without);
  });

  it('lack a camera where no points are picked', () => {
    const picks = clicked(kNoPicks, 'forceps', { at_ns: 4e9, pixel: [1, 1] });
    expect(lacks(picks)).toBe('registration');
    let registered = picks;
    for (let n = 1; n <= 6; ++n) registered = pair(registered, n);
    expect(lacks(registered)).toBeUndefined();
  });
});

describe('What was picked', () => {
  it('is said as kiroku compare takes it', () => {
    expect(byHandPicks(kNoPicks)).toEqual({});
    const half = picked(clicked(pair(kNoPicks, 1), 'forceps', { at_ns: 4e9, pixel: [3, 4] }), 'pixel', [9, 9], at, undefined).picks;
    expect(byHandPicks({ ...half, field_deg: 42 })).toEqual({
      registration: { at: 5e9, field_deg: 42, points: [{ organ: [1, 0, 0], pixel: [1, 1] }] },
      tools: { forceps: [{ at: 4e9, pixel: [3, 4] }] },
    });
  });

  it('counts pixels from the centre of the left upper one', () => {
    const size = { width: 320, height: 200 };
    expect(pixelAt({ x: 0, y: 0 }, size)).toEqual([-0.5, -0.5]);
    expect(pixelAt({ x: 1.5 / 320, y: 2.5 / 200 }, size)).toEqual([1, 2]);
    expect(placeOf([1, 2], size)).toEqual({ x: 1.5 / 320, y: 2.5 / 200 });
  });

  it('is seen where the camera sees it', () => {
    // From the front (against y), 100 before the origin; x to the left of the picture's right, z up.
    const camera = {
      eye: [0, -100, 0] as [number, number, number],
      view_axes: [1, 0, 0, 0, 0, 1, 0, -1, 0],
      half_extent: [0.4, 0.3] as [number, number],
      centre: [0, 0] as [number, number],
    };
    expect(seenBy(camera, [0, 0, 0])).toEqual({ x: 0.5, y: 0.5 });
    expect(seenBy(camera, [20, 0, 15])).toEqual({ x: 0.75, y: 0.25 });
    expect(seenBy({ ...camera, centre: [0.2, 0] }, [20, 0, 0])).toEqual({ x: 0.5, y: 0.5 });
    expect(seenBy(camera, [0, -101, 0])).toBeUndefined();
  });
});

describe('A fluoroscopy', () => {
  it('is named with a geometry that is an object', () => {
    expect(readGeometry('{"sad_mm": 1000}')).toEqual({ sad_mm: 1000 });
    for (const text of ['', '[1]', 'null', '3', '{']) expect(readGeometry(text)).toBeUndefined();
    expect(fluoroscopyBody(undefined)).toBeUndefined();
    expect(fluoroscopyBody({ stream: 'fluoroscopy', geometry: { a: 1 }, file: 'a.json', alignAt_ns: null, polarity: 'bone-black' })).toEqual({
      stream: 'fluoroscopy',
      geometry: { a: 1 },
      align_at_ns: null,
      polarity: 'bone-black',
    });
  });
});
