// The breathing workbench's logic: what is undone, directions as angles, moments of a time line.
import { describe, expect, it } from 'vitest';
import { History } from '@/breathing/history';
import { KeptMotion } from '@/breathing/kept_motion';
import { anglesOf, directionOf, type Motion, rangeOf, sameMotion, withDirection, withNumber } from '@/breathing/motion';
import { countOf, groupAt, kViews, lacking, neighboursOf, nodesUnder, painted, SeenLung, type Surface, turned } from '@/breathing/lung_surface';
import { noticesOfSaved } from '@/breathing/saved_notices';
import { distances, later, meanOf, momentAt, stepped } from '@/breathing/time_line';

const kStill = { amplitude_mm: 3, phase_s: 0, direction: null, baseline_mm: 0, drift_mm_per_min: 0 };
const kMotion: Motion = { rib_cage: kStill, diaphragm: { ...kStill, amplitude_mm: 10 }, cycle_s: 3.6, groups: null };

describe('What was changed', () => {
  const same = (one: number, other: number) => one === other;
  it('is undone by steps: a slider that is dragged is one', () => {
    const history = new History<number>(1, same);
    for (const value of [2, 3, 4]) history.change(value, 'amplitude');
    history.change(5, 'phase');
    expect(history.undo()).toBe(true);
    expect(history.now).toBe(4);
    expect(history.undo()).toBe(true);
    expect(history.now).toBe(1);
    expect(history.undo()).toBe(false);
    expect(history.redo()).toBe(true);
    expect(history.now).toBe(4);
    expect([history.canUndo, history.canRedo]).toEqual([true, true]);
  });
  it('is a step of its own once the slider was let go, or after an undo', () => {
    const history = new History<number>(1, same);
    history.change(2, 'amplitude');
    history.settle();
    history.change(3, 'amplitude');
    history.undo();
    expect(history.now).toBe(2);
    history.change(7, 'amplitude');
    expect(history.canRedo).toBe(false);
    history.undo();
    expect(history.now).toBe(2);
  });
  it('is nothing where the value stayed', () => {
    const history = new History(kMotion, sameMotion);
    history.change(withNumber(kMotion, 'rib_cage', 'amplitude_mm', 3), 'x');
    expect(history.canUndo).toBe(false);
    history.change(withDirection(kMotion, 'rib_cage', [0, 0, 1]), 'x');
    expect(history.canUndo).toBe(true);
    expect(history.now.diaphragm).toEqual(kMotion.diaphragm);
  });
});

/** A cube of 20 mm, x left, y back, z head; its corners are numbered by x, then y, then z. */
const kCube: Surface = {
  nodes_mm: [0, 1, 2, 3, 4, 5, 6, 7].flatMap((i) => [20 * (i & 1), 10 * (i & 2), 5 * (i & 4)]),
  faces: [
    [0, 2, 3, 1],
    [4, 5, 7, 6],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 4, 6, 2],
    [1, 3, 7, 5],
  ].flatMap(([a, b, c, d]) => [a, b, c, a, c, d] as number[]),
  groups: '33332222',
};

describe('The surface of a lung', () => {
  it('is seen from where one looks: patients have their left at the right, and their head above', () => {
    const front = new SeenLung(kCube, kViews.front, 200);
    expect(front.faces.map((face) => Math.floor(face / 2))).toEqual([2, 2]);
    expect(front.x[1]).toBeGreaterThan(front.x[0] as number);
    expect(front.y[4]).toBeLessThan(front.y[0] as number);
    const left = new SeenLung(kCube, kViews.left, 200);
    expect(left.faces.map((face) => Math.floor(face / 2))).toEqual([5, 5]);
    expect(left.x[3]).toBeGreaterThan(left.x[1] as number);
    const feet = new SeenLung(kCube, kViews.feet, 200);
    expect(feet.faces.map((face) => Math.floor(face / 2))).toEqual([0, 0]);
    expect(feet.y[0]).toBeLessThan(feet.y[2] as number);
    // All of it stays in the square, however it is turned.
    for (let about = -180; about < 180; about += 15) {
      const seen = new SeenLung(kCube, turned(kViews.front, about, about / 2), 200);
      for (const place of [...seen.x, ...seen.y]) expect(Math.abs(place - 100)).toBeLessThanOrEqual(96.001);
    }
  });
  it('is turned round and round, and never over head or feet', () => {
    expect(turned({ about_deg: 170, up_deg: 80 }, 20, 20)).toEqual({ about_deg: -170, up_deg: 90 });
    expect(turned({ about_deg: -170, up_deg: -80 }, -20, -20)).toEqual({ about_deg: 170, up_deg: -90 });
  });
  it('is met where the pointer is, on the side that is seen', () => {
    const front = new SeenLung(kCube, kViews.front, 200);
    const hit = front.under((front.x[4] as number) + 5, (front.y[4] as number) + 3);
    expect(hit?.node).toBe(4);
    expect(hit?.place_mm[1]).toBeCloseTo(0, 9);
    expect(front.under(1, 1)).toBeUndefined();
    const behind = new SeenLung(kCube, kViews.behind, 200);
    expect(behind.under(100, 100)?.place_mm).toEqual([expect.closeTo(10, 9), expect.closeTo(20, 9), expect.closeTo(10, 9)]);
  });
  it('is painted within the brush as far as it hangs together', () => {
    const neighbours = neighboursOf(kCube);
    expect(neighbours[0]?.slice().sort()).toEqual([1, 2, 3, 4, 5, 6]);
    const from = { node: 0, place_mm: [1, 1, 1] as [number, number, number] };
    expect(nodesUnder(kCube, neighbours, from, 1)).toEqual([0]);
    expect(nodesUnder(kCube, neighbours, from, 20).sort()).toEqual([0, 1, 2, 4]);
    // Another body within the brush is left alone.
    const two: Surface = {
      nodes_mm: [...kCube.nodes_mm, ...kCube.nodes_mm.map((value, i) => value + (i % 3 === 0 ? 21 : 0))],
      faces: [...kCube.faces, ...kCube.faces.map((node) => node + 8)],
      groups: kCube.groups + kCube.groups,
    };
    expect(nodesUnder(two, neighboursOf(two), { node: 1, place_mm: [20, 0, 0] }, 5)).toEqual([1]);
  });
  it('has the groups that were painted, and gets back those it had', () => {
    const once = painted(kCube.groups, [0, 4], 'trachea', kCube.groups);
    expect(once).toBe('43334222');
    expect([countOf(once, 'trachea'), countOf(once, 'diaphragm'), groupAt(once, 4)]).toEqual([2, 3, 'trachea']);
    expect(painted(once, [4], null, kCube.groups)).toBe('43332222');
    expect(painted(once, [0, 1, 2, 3, 4], 'free', kCube.groups)).toBe('11111222');
    expect(lacking(kCube.groups)).toBeUndefined();
    expect(lacking('11111222')).toBe('diaphragm');
    expect(lacking('33331111')).toBe('rib_cage');
    // Groups are a part of a motion: a stroke is undone like a slider.
    const history = new History(kMotion, sameMotion);
    history.change({ ...kMotion, groups: once }, 'groups');
    history.settle();
    history.change({ ...kMotion, groups: painted(once, [1], 'free', kCube.groups) }, 'groups');
    history.undo();
    expect(history.now.groups).toBe(once);
    history.undo();
    expect(history.now.groups).toBeNull();
  });
});

describe('What is saved', () => {
  it('is what was sent, whatever digits the server answers with', () => {
    const kept = new KeptMotion();
    expect(kept.has(kMotion)).toBe(true);
    kept.open(kMotion);
    let input = 0;
    for (let place = -200; place <= 200; ++place) {
      const motion = withNumber(kMotion, 'diaphragm', 'drift_mm_per_min', place / 10);
      kept.send(++input, motion);
      kept.save(input);
      expect(kept.has(motion)).toBe(true);
      expect(kept.has(withNumber(motion, 'diaphragm', 'drift_mm_per_min', place / 10 + 0.1))).toBe(false);
    }
  });
  it('is the one that was sent last, and nothing that was not saved', () => {
    const kept = new KeptMotion();
    kept.open(kMotion);
    const [sealed, later, refused] = [4, 5, 6].map((mm) => withNumber(kMotion, 'rib_cage', 'amplitude_mm', mm)) as [Motion, Motion, Motion];
    kept.send(7, sealed);
    kept.send(8, later);
    kept.send(9, refused);
    expect(kept.has(later)).toBe(false);
    kept.save(8);
    kept.save(7); // its authority took its time
    expect([kept.has(sealed), kept.has(later), kept.has(refused)]).toEqual([false, true, false]);
    kept.send(0, refused); // nothing could be sent
    kept.save(0);
    expect(kept.has(refused)).toBe(false);
  });
});

describe('A model that was sealed', () => {
  const stamp = (authority: string, time: string, problem: string, kind: 'external' | 'self-issued' = 'external') => ({
    authority,
    time,
    kind: time === '' ? ('' as const) : kind,
    problem,
  });
  const told = (...time_stamps: ReturnType<typeof stamp>[]) =>
    noticesOfSaved('lung.json', { file: 'lung.seal.json', sha256: 'ab', time_stamps }).map(({ kind, text }) => [kind, text]);
  it('is told as a success where a time-stamp came', () => {
    expect(noticesOfSaved('lung.json', null).map(({ kind }) => kind)).toEqual(['done']);
    expect(told(stamp('swiss', '2026-11-27T10:00:00Z', ''))).toEqual([
      ['done', 'Saved as lung.json, sealed in lung.seal.json. Time-stamps of outside authorities: 1.'],
    ]);
  });
  it('is told as no success where the recorder’s own authority alone stamped it, whatever its name', () => {
    const own = stamp('national-metrology-institute', '2026-11-27T10:00:00Z', '', 'self-issued');
    expect(told(own)).toEqual([
      ['problem', 'Saved as lung.json, sealed in lung.seal.json. Time-stamps: 1, all self-issued. No outside clock says when it was sealed.'],
    ]);
    expect(told(own, stamp('swiss', '2026-11-27T10:00:00Z', ''))).toEqual([
      ['done', 'Saved as lung.json, sealed in lung.seal.json. Time-stamps of outside authorities: 1. Self-issued: 1.'],
    ]);
  });
  it('is told as a problem, with authority and reason, where one did not', () => {
    expect(told(stamp('swiss', '', 'it does not answer'))).toEqual([
      ['problem', 'Saved as lung.json and sealed in lung.seal.json, without any time-stamp. swiss: it does not answer'],
    ]);
    expect(told()).toEqual([['problem', 'Saved as lung.json and sealed in lung.seal.json, without any time-stamp. No authority was asked.']]);
    expect(told(stamp('swiss', '2026-11-27T10:00:00Z', ''), stamp('dfn', '', 'it refuses'))).toEqual([
      ['done', 'Saved as lung.json, sealed in lung.seal.json. Time-stamps of outside authorities: 1.'],
      ['problem', 'A time-stamp is missing. dfn: it refuses'],
    ]);
  });
});

describe('A direction', () => {
  it('is two angles and back', () => {
    for (const about_deg of [-170, -90, 0, 35, 180]) {
      for (const up_deg of [-60, 0, 45]) {
        const angles = anglesOf(directionOf({ up_deg, about_deg }));
        expect(angles.up_deg).toBeCloseTo(up_deg, 9);
        expect(angles.about_deg).toBeCloseTo(about_deg, 9);
      }
    }
    expect(anglesOf([0, -1, 0])).toEqual({ up_deg: 0, about_deg: -90 });
  });
  it('keeps at the poles what the person turned it to', () => {
    const down = directionOf({ up_deg: -90, about_deg: 40 });
    expect(down).toEqual([0, 0, -1]);
    expect(anglesOf(down, 40)).toEqual({ up_deg: -90, about_deg: 40 });
  });
});

describe('A slider', () => {
  it('reaches as far as the model does', () => {
    expect(rangeOf('amplitude_mm', 12).most).toBe(30);
    expect(rangeOf('amplitude_mm', 45).most).toBe(45);
    expect(rangeOf('phase_s', -7).least).toBe(-7);
  });
});

describe('A tumour that was seen', () => {
  it('is so far from where the motion has it, and nowhere where it was not seen', () => {
    const error_mm: [number, number, number] = [1, 1, 1];
    const seen = [{ mm: [3, 0, 4] as [number, number, number], error_mm }, null, { mm: [1, 1, 1] as [number, number, number], error_mm }];
    const off = distances(seen, [
      [0, 0, 0],
      [9, 9, 9],
      [1, 1, 0],
    ]);
    expect(off).toEqual([5, null, 1]);
    expect(meanOf(off)).toBe(3);
    expect(meanOf([null])).toBe(0);
    expect(distances(seen, [])).toEqual([null, null, null]);
  });
});

describe('A time line', () => {
  const breath = { times_s: [0, 0.9, 1.8, 2.7], duration_s: 3.6 };
  const film = { times_s: [0, 0.5, 1], duration_s: 1 };
  it('shows the last moment by then', () => {
    expect([0, 0.89, 0.9, 3.5].map((one) => momentAt(breath, one))).toEqual([0, 0, 1, 3]);
    expect(momentAt({ times_s: [], duration_s: 0 }, 1)).toBe(0);
  });
  it('goes on from its end at its beginning', () => {
    expect(later(breath, 3.5, 0.2)).toBeCloseTo(0.1);
    expect(later(film, 0.9, 0.2)).toBeCloseTo(0.1);
    expect(later({ times_s: [5], duration_s: 0 }, 5, 1)).toBe(5);
  });
  it('is stepped from moment to moment, round and round', () => {
    expect(stepped(breath, 1, 1)).toBe(1.8);
    expect(stepped(breath, 2.7, 1)).toBe(0);
    expect(stepped(breath, 0, -1)).toBe(2.7);
  });
});
