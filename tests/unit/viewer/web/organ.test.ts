import { describe, expect, it } from 'vitest';
import type { ComparedStep, OrganAlignment } from '@/api/types';
import { kOrganAsked, organBody, organLacks, stretchOf } from '@/compare/organ_asked';
import { colouredFaces, displaced, viridis } from '@/compare/organ_colours';
import { departureAt, stepDepartures } from '@/compare/organ_departure';
import { type OrganLens, shownAt } from '@/compare/organ_lens';
import { coverFaces, facing, outlineMesh, seenNodes } from '@/compare/organ_outline';
import { organAt, organStretches, organSummary } from '@/compare/organ_place';
import { organShapeAt, rigidCounts, whyRigid } from '@/compare/organ_shape';
import { departureLine } from '@/compare/organ_summary';
import { departureText } from '@/compare/organ_over';
import { language } from '@/i18n/i18n';

type Moment = OrganAlignment['moments'][number];
const kTenth = 100_000_000;
const kSecond = 1e9;
/** Axes turned about the patient's z by so many degrees. */
const turned = (deg: number): NonNullable<Moment['view_axes']> => {
  const [c, s] = [Math.cos((deg * Math.PI) / 180), Math.sin((deg * Math.PI) / 180)];
  return [c, s, 0, 0, 0, 1, s, -c, 0];
};
const placed = (at: number, x = 0, deg = 0, error = 1): Moment => ({
  time_ns: at * kTenth,
  eye_m: [x, -0.2, 0],
  view_axes: turned(deg),
  standard_error_mm: error,
});
const lost = (at: number, why = 'hidden'): Moment => ({ time_ns: at * kTenth, lost: why });
const alignment = (moments: Moment[], sizes: OrganAlignment['picture_sizes'] = [{ from_ns: 0, width: 640, height: 480 }]): OrganAlignment => ({
  start_ns: 0,
  end_ns: 10 * kSecond,
  field_deg: 60,
  picture_sizes: sizes,
  moments,
});

describe('Where the organ is in the pictures', () => {
  it('is told of each picture that was looked at, by the millisecond', () => {
    const one = alignment([placed(0), placed(1, 0.01)]);
    expect(organAt(one, 0)).toEqual({ is: 'placed', camera: { eye: [0, -0.2, 0], axes: turned(0) }, error_mm: 1 });
    expect(organAt(one, kTenth - 400_000)).toEqual(organAt(one, kTenth));
    expect(organAt(one, kTenth + 400_000)).toEqual(organAt(one, kTenth));
  });

  it('goes evenly between two that are placed, with the larger error, the shorter way round', () => {
    for (const [from, to] of [
      [0, 20],
      [170, 190],
      [-175, -195],
      [80, 100],
    ] as const) {
      const one = alignment([placed(0, 0, from, 1), placed(1, 0.04, to, 2)]);
      const place = organAt(one, kTenth / 4);
      if (place?.is !== 'placed') throw new Error('it is placed');
      expect(place.error_mm).toBe(2);
      expect(place.camera.eye[0]).toBeCloseTo(0.01, 12);
      turned(from + (to - from) / 4).forEach((value, at) => expect(place.camera.axes[at]).toBeCloseTo(value, 9));
    }
  });

  it('is never guessed: beside a lost picture, beyond the ends, over a gap, and where pictures change their size', () => {
    const one = alignment([placed(0), lost(1), placed(2), placed(3), placed(7)]);
    expect(organAt(one, 0.5 * kTenth)).toEqual({ is: 'lost', why: 'hidden' });
    expect(organAt(one, 1.5 * kTenth)).toEqual({ is: 'lost', why: 'hidden' });
    expect(organAt(one, 2.5 * kTenth)?.is).toBe('placed');
    expect(organAt(one, 5 * kTenth)).toBeUndefined();
    expect(organAt(one, -5_000_000)).toBeUndefined();
    expect(organAt(one, 7.1 * kTenth)).toBeUndefined();
    expect(organAt(alignment([]), 0)).toBeUndefined();
    const sizes = [
      { from_ns: 0, width: 640, height: 480 },
      { from_ns: kTenth, width: 320, height: 480 },
    ];
    expect(organAt(alignment([placed(0), placed(1)], sizes), 0.5 * kTenth)).toBeUndefined();
    expect(organAt(alignment([placed(0), placed(1)], sizes), kTenth)?.is).toBe('placed');
    // Half of a place is none.
    expect(organAt(alignment([{ time_ns: 0, eye_m: [0, 0, 0] }]), 0)).toEqual({ is: 'lost', why: 'unknown' });
  });

  it('makes stretches that say of each moment what organAt() says', () => {
    const one = alignment([placed(0), placed(1), lost(2, 'hidden'), lost(3, 'not-looked'), placed(4), placed(5), placed(9)]);
    const stretches = organStretches(one);
    expect(stretches.map(({ start_ns, end_ns, lost: why }) => [start_ns / kTenth, Math.round(end_ns / kTenth), why])).toEqual([
      [0, 1, undefined],
      [1, 3, 'hidden'],
      [3, 4, 'not-looked'],
      [4, 5, undefined],
      [9, 9, undefined],
    ]);
    for (let at_ns = kTenth / 20; at_ns < 10 * kTenth; at_ns += kTenth / 10) {
      const place = organAt(one, at_ns);
      const stretch = stretches.find(({ start_ns, end_ns }) => start_ns <= at_ns && at_ns < end_ns);
      // The picture of 0.5 s and that of 0.9 s last as long as their time is told exactly.
      expect(stretch === undefined ? undefined : (stretch.lost ?? 'placed')).toBe(place?.is === 'lost' ? place.why : place?.is);
    }
  });

  it('is summed up: how many, how well, where not', () => {
    const summary = organSummary(alignment([placed(0, 0, 0, 3), placed(1, 0, 0, 1), placed(2, 0, 0, 2), lost(3), lost(4), placed(5, 0, 0, 1.5)]));
    expect(summary).toMatchObject({ looked: 6, placed: 4, half_mm: 1.5, most_mm: 3, lost_ns: 3 * kTenth });
    expect(summary.lost.map(({ start_ns, end_ns }) => [start_ns / kTenth, end_ns / kTenth])).toEqual([[2, 5]]);
    expect(organSummary(alignment([lost(0)]))).toMatchObject({ looked: 1, placed: 0, half_mm: undefined, most_mm: undefined });
  });

  it('has losses from one end to the other, with their reasons, the longest first', () => {
    const lostAndFound = alignment([
      placed(0),
      lost(1, 'hidden'),
      lost(2, 'not-looked'),
      lost(3, 'not-looked'),
      lost(4, 'not-looked'),
      lost(5, 'no-organ'),
      lost(6, 'no-organ'),
      lost(7, 'no-organ'),
      placed(8),
      placed(9),
      lost(10, 'not-looked'),
      placed(11),
      lost(30, 'mirrored'),
    ]);
    const { episodes, lost: losses } = organSummary(lostAndFound);
    expect(episodes.map(({ start_ns, end_ns, whys }) => [start_ns / kTenth, Math.round(end_ns / kTenth), whys])).toEqual([
      [0, 8, ['no-organ', 'hidden']],
      [8, 9, []],
      [9, 11, ['not-looked']],
      [11, 11, []],
      [30, 30, ['mirrored']],
    ]);
    expect(losses.length).toBe(3);
  });
});

describe('The outline of an organ', () => {
  /** A tetrahedron 20 mm wide, anticlockwise from outside. */
  const surface = { moved_mm: 0, nodes_mm: [0, 0, 0, 20, 0, 0, 0, 20, 0, 0, 0, 20], faces: [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3] };
  const mesh = outlineMesh(surface);
  if (!mesh) throw new Error('a tetrahedron has a surface');

  it('is seen as a pinhole sees it, the lesser side covering the field', () => {
    // From 0.2 m before the patient: x to the right, z up.
    const seen = seenNodes(mesh, { eye: [0, -0.2, 0], axes: turned(0) }, 60, 640, 480);
    const focal = 240 / Math.tan(Math.PI / 6);
    expect([...seen.slice(0, 2)]).toEqual([320, 240]);
    expect(seen[2]).toBeCloseTo(320 + (focal * 0.02) / 0.2, 9);
    expect(seen[3]).toBeCloseTo(240, 9);
    expect(seen[7]).toBeCloseTo(240 - (focal * 0.02) / 0.2, 9);
    // As upright as wide.
    expect(seenNodes(mesh, { eye: [0, -0.2, 0], axes: turned(0) }, 60, 480, 640)[2]).toBeCloseTo(240 + (focal * 0.02) / 0.2, 9);
  });

  /** As of tests/unit/sim/align/lens_test.cpp, which holds the same places against OpenCV. */
  const lens: OrganLens = {
    model: 'brown',
    width: 640,
    height: 480,
    focal_px: [430, 436],
    middle_px: [331.5, 226],
    coefficients: [-0.28, 0.09, 0.0011, -0.0016, -0.012],
    reach: 1.1,
  };

  it('is seen where a lens shows it in the recorded picture', () => {
    const close = (pixel: readonly [number, number], x: number, y: number) => {
      // Pixels count from the corner here, from the middle of the first one in a calibration.
      expect(pixel[0]).toBeCloseTo(x + 0.5, 8);
      expect(pixel[1]).toBeCloseTo(y + 0.5, 8);
    };
    close(shownAt(lens, 0.5, -0.3, 640, 480), 527.44763568, 106.8116803584);
    close(shownAt(lens, -0.7, 0.45, 640, 480), 75.62357003118748, 392.8087942022625);
    const fisheye: OrganLens = { ...lens, model: 'fisheye', coefficients: [-0.021, 0.006, -0.004, 0.0007, 0] };
    close(shownAt(fisheye, 0.5, -0.3, 640, 480), 525.0826826249761, 108.22969819838663);
    close(shownAt(fisheye, 0, 0, 640, 480), 331.5, 226);
    // In a pane of another size.
    expect(shownAt(lens, 0.5, -0.3, 320, 240)[0]).toBeCloseTo((527.44763568 + 0.5) / 2, 8);
    // A polynomial folds back: what is far aside is not drawn within the picture.
    let before = 0;
    for (let x = 1.2; x < 30; x *= 1.3) {
      const [at] = shownAt(lens, x, 0.1, 640, 480);
      expect(at).toBeGreaterThan(Math.max(640, before));
      before = at;
    }
  });

  it('is seen through the lens, and without one as before', () => {
    const camera = { eye: [0, -0.05, 0], axes: turned(0) };
    const bent = seenNodes(mesh, camera, 60, 640, 480, lens);
    // The second node is 20 mm to the right at 50 mm, the fourth as much above.
    const [right, above] = [shownAt(lens, 0.4, 0, 640, 480), shownAt(lens, 0, -0.4, 640, 480)];
    [...bent.slice(2, 4)].forEach((pixel, axis) => expect(pixel).toBeCloseTo(right[axis] as number, 8));
    [...bent.slice(6, 8)].forEach((pixel, axis) => expect(pixel).toBeCloseTo(above[axis] as number, 8));
    expect([...seenNodes(mesh, { eye: [0, 0.05, 0], axes: turned(0) }, 60, 640, 480, lens)].slice(0, 2)).toEqual([NaN, NaN]);
  });

  it('has faces that are seen from outside, and edges between two of them', () => {
    const camera = { eye: [0.005, -0.2, 0.005], axes: turned(0) };
    const seen = seenNodes(mesh, camera, 60, 640, 480);
    // The face that lies in y = 0 alone.
    expect([...facing(mesh, seen)]).toEqual([0, 1, 0, 0]);
    expect(mesh.edges.length).toBe(4 * 6);
  });

  it('is around what its faces cover, row by row', () => {
    const rows = (corners: number[], turned: number[], scale = 1) => {
      const mask = new Uint32Array(8 * 4).fill(7);
      coverFaces({ ...mesh, faces: Uint32Array.from([0, 1, 2, 0, 2, 3]) }, Float64Array.from(corners), Uint8Array.from(turned), scale, 8, 4, mask);
      return [0, 1, 2, 3].map((row) => [...mask.slice(8 * row, 8 * row + 8)].map((one) => (one === 0 ? '.' : '#')).join(''));
    };
    const square = [1, 1, 1, 3, 5, 3, 5, 1];
    expect(rows(square, [1, 1])).toEqual(['........', '.####...', '.####...', '........']);
    expect(rows(square, [0, 0])).toEqual(['........', '........', '........', '........']);
    expect(rows(square, [1, 0])).toEqual(['........', '.#......', '.###....', '........']);
    expect(rows([2, 2, 2, 6, 6, 6, 6, 2], [1, 1], 0.5)).toEqual(['........', '.##.....', '.##.....', '........']);
    // Beyond the picture's borders nothing is written.
    expect(rows([-9, -9, -9, 99, 99, 99, 99, -9], [1, 1])).toEqual(Array<string>(4).fill('########'));
    expect(rows([9, 9, 9, 12, 12, 12, 12, 9], [1, 1])).toEqual(Array<string>(4).fill('........'));
  });

  it('has nothing of what is beside or behind the eye', () => {
    const seen = seenNodes(mesh, { eye: [0, 0.01, 0], axes: turned(0) }, 60, 640, 480);
    expect(Number.isNaN(seen[0])).toBe(true);
    expect(Number.isNaN(seen[4])).toBe(false);
    expect([...facing(mesh, seen)]).toEqual([0, 0, 0, 0]);
  });

  it('is none where a document has none, or one that is none', () => {
    expect(outlineMesh(undefined)).toBeUndefined();
    expect(outlineMesh({ ...surface, faces: [] })).toBeUndefined();
    expect(outlineMesh({ ...surface, faces: [0, 1] })).toBeUndefined();
    expect(outlineMesh({ ...surface, faces: [0, 1, 4] })).toBeUndefined();
    expect(outlineMesh({ ...surface, nodes_mm: [0, 0] })).toBeUndefined();
  });
});

describe('Asking for the organ to be found', () => {
  const step = (start_s: number, end_s: number): ComparedStep => ({
    step: 1,
    name: 'hold',
    planned: { start_s: 0, duration_s: 1 },
    done: { start_ns: start_s * kSecond, end_ns: end_s * kSecond, order: 1, pauses: [], pause_before_ns: null },
  });
  const room = { start_ns: 0, end_ns: 20 * kSecond };

  it('is for the matched steps, a second around them, within the case', () => {
    const asked = { ...kOrganAsked, field_deg: 60 };
    expect(stretchOf(asked, [step(5, 7), step(2, 4)], undefined, room)).toEqual({ start_ns: kSecond, end_ns: 8 * kSecond });
    expect(stretchOf(asked, [step(0.5, 19.5)], undefined, room)).toEqual(room);
    expect(stretchOf(asked, [{ ...step(0, 1), done: null }], undefined, room)).toBeUndefined();
  });

  it('or for what is selected on the time line', () => {
    const asked = { ...kOrganAsked, where: 'selection' as const };
    expect(stretchOf(asked, [step(5, 7)], { start_ns: 3.2, end_ns: 25 * kSecond }, room)).toEqual({ start_ns: 3, end_ns: 20 * kSecond });
    expect(stretchOf(asked, [step(5, 7)], undefined, room)).toBeUndefined();
    expect(stretchOf(asked, [step(5, 7)], { start_ns: 30 * kSecond, end_ns: 31 * kSecond }, room)).toBeUndefined();
  });

  it('says what is missing', () => {
    const stretch = { start_ns: 0, end_ns: 3600 * kSecond };
    expect(organLacks(undefined, undefined, true)).toBeUndefined();
    expect(organLacks(kOrganAsked, stretch, false)).toBe('field');
    for (const field_deg of [9.9, 120.1, NaN]) expect(organLacks({ ...kOrganAsked, field_deg }, stretch, false)).toBe('field');
    expect(organLacks({ ...kOrganAsked, field_deg: 60 }, stretch, true)).toBe('points');
    expect(organLacks({ ...kOrganAsked, field_deg: 60 }, undefined, false)).toBe('stretch');
    expect(organLacks({ ...kOrganAsked, field_deg: 60 }, { ...stretch, end_ns: stretch.end_ns + 1 }, false)).toBe('long');
    expect(organLacks({ ...kOrganAsked, field_deg: 60 }, stretch, false)).toBeUndefined();
  });

  it('is sent as the server takes it, and not at all where nobody asked', () => {
    expect(organBody(undefined, { start_ns: 1, end_ns: 2 })).toBeUndefined();
    expect(organBody({ ...kOrganAsked, field_deg: 55, view: 'left' }, { start_ns: 1, end_ns: 2 })).toEqual({
      field_deg: 55,
      view: 'left',
      from_ns: 1,
      to_ns: 2,
    });
  });
});

describe('The shape of the organ in the pictures', () => {
  const kCentimetre = 10;
  /** A tetrahedron about the origin, whose last node goes up. */
  const shaped = (moments: Moment[]): OrganAlignment => ({
    ...alignment(moments),
    surface: { moved_mm: 0, nodes_mm: [-20, 0, -20, 20, 0, -20, 0, 20, 0, 0, 0, 20], faces: [0, 1, 3, 1, 2, 3, 2, 0, 3, 1, 0, 2] },
    deformed: {
      pictures: 2,
      largest_mm: 20,
      scale_mm: 20,
      fields: [
        [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1],
        [0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0],
      ],
    },
  });
  const pulled = (at: number, weights_mm: number[], more: Partial<NonNullable<Moment['deformed']>> = {}): Moment => ({
    ...placed(at),
    deformed: { since_ns: 0, standard_error_mm: 2, largest_mm: kCentimetre, eye_m: [0, -0.2, 0], view_axes: turned(0), weights_mm, ...more },
  });
  const rigid = (at: number, why: string): Moment => ({ ...placed(at), rigid: why });

  it('is the sum of the document’s fields, with its stated error', () => {
    const shape = organShapeAt(shaped([pulled(0, [10, 5])]), 0);
    expect([...(shape?.displacement ?? [])].slice(9)).toEqual([0.005, 0, 0.01]);
    expect([...(shape?.displacement ?? [])].slice(0, 9).every((one) => one === 0)).toBe(true);
    expect(shape?.error_mm).toBe(2);
    // Zeros at the end are left out.
    expect([...(organShapeAt(shaped([pulled(0, [10])]), 0)?.displacement ?? [])].slice(9)).toEqual([0, 0, 0.01]);
  });

  it('goes evenly between two pictures that count from the same one, and is nowhere guessed', () => {
    const one = shaped([
      pulled(0, [10]),
      pulled(1, [20], { standard_error_mm: 3 }),
      rigid(2, 'endoscope-moved'),
      pulled(3, [10], { since_ns: 5 }),
      pulled(4, [10]),
    ]);
    const between = organShapeAt(one, kTenth / 2);
    expect(between?.displacement[11]).toBeCloseTo(0.015, 12);
    expect(between?.error_mm).toBe(3);
    expect(organShapeAt(one, 1.5 * kTenth)).toBeUndefined();
    expect(organShapeAt(one, 3.5 * kTenth)).toBeUndefined();
    expect(whyRigid(one, 2 * kTenth)).toBe('endoscope-moved');
    expect(whyRigid(one, 1.5 * kTenth)).toBe('endoscope-moved');
    expect(whyRigid(one, 0)).toBeUndefined();
    expect(whyRigid(alignment([placed(0)]), 0)).toBeUndefined();
  });

  it('is not drawn from a document that contradicts itself', () => {
    const one = shaped([pulled(0, [1, 2, 3])]);
    expect(organShapeAt(one, 0)).toBeUndefined();
    expect(organShapeAt({ ...one, deformed: { pictures: 1, largest_mm: 1, scale_mm: 5, fields: [[1], [2], [3]] } }, 0)).toBeUndefined();
    const whole = shaped([pulled(0, [10])]);
    if (!whole.deformed) throw new Error('it is deformed');
    expect(organShapeAt(whole, 0)).toBeDefined();
    expect(organShapeAt({ ...whole, deformed: { ...whole.deformed, scale_mm: 0 } }, 0)).toBeUndefined();
  });

  it('says of each node whether its displacement is told', () => {
    expect([...(organShapeAt(shaped([pulled(0, [10], { told: 'a' })]), 0)?.told ?? [])]).toEqual([1, 0, 1, 0]);
    expect([...(organShapeAt(shaped([pulled(0, [10])]), 0)?.told ?? [])]).toEqual([1, 1, 1, 1]);
  });

  it('counts why pictures stayed rigid, the most frequent reason first', () => {
    const one = shaped([rigid(0, 'at-rest'), rigid(1, 'endoscope-moved'), rigid(2, 'endoscope-moved'), pulled(3, [1])]);
    expect(rigidCounts(one)).toEqual([
      { why: 'endoscope-moved', pictures: 2 },
      { why: 'at-rest', pictures: 1 },
    ]);
  });

  it('has the colours of its displacement, grey where that is not told', () => {
    expect(viridis(-1)).toEqual([68, 1, 84]);
    expect(viridis(0.5)).toEqual([33, 144, 141]);
    expect(viridis(2)).toEqual([253, 231, 37]);
    const lightness = Array.from({ length: 33 }, (_, at) => viridis(at / 32)).map(([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b);
    lightness.slice(1).forEach((one, at) => expect(one).toBeGreaterThan(lightness[at] as number));
    const one = shaped([pulled(0, [12], { told: 'd' })]);
    const shape = organShapeAt(one, 0);
    const rest = outlineMesh(one.surface);
    if (!shape || !rest) throw new Error('it is deformed');
    const mesh = displaced(rest, shape);
    expect(mesh.nodes[11]).toBeCloseTo(0.032, 12);
    const faces = colouredFaces(mesh, shape, seenNodes(mesh, shape.camera, 60, 640, 480), 20);
    expect(faces.find(({ face }) => face === 0)?.share).toBeCloseTo(12 / 3 / 20, 12);
    // The third node is not told; it belongs to all faces but the first.
    for (const { face, share } of faces) expect(share === undefined).toBe(face !== 0);
  });
});

describe('A departure from the plan', () => {
  const step = (number: number, name: string, start: number, end: number): ComparedStep => ({
    step: number,
    name,
    planned: { start_s: 0, duration_s: 1 },
    done: { start_ns: start * kTenth, end_ns: end * kTenth, order: number, pauses: [], pause_before_ns: null },
  });
  const compared = (at: number, more: Partial<NonNullable<Moment['departure']>> = {}): Moment => ({
    ...placed(at),
    rigid: 'within-error',
    departure: { step: 1, plan_s: 0.1, beyond: 0, standard_error_mm: 1.5, ...more },
  });
  const far = { beyond: 0.2, largest_mm: 14.2, largest_error_mm: 2.1, nodes: 'H4' };
  const document: OrganAlignment = {
    ...alignment([
      compared(0),
      compared(1),
      compared(2, { ...far, step: 2 }),
      { ...placed(3), rigid: 'unfitted' },
      { ...placed(4), rigid: 'unfitted' },
      { ...placed(5), rigid: 'endoscope-moved' },
      { ...placed(6), no_departure: 'no-plan-moment' },
    ]),
    surface: { moved_mm: 0, nodes_mm: [-20, 0, -20, 20, 0, -20, 0, 20, 0, 0, 0, 20], faces: [0, 1, 3, 1, 2, 3, 2, 0, 3, 1, 0, 2] },
    deformed: { pictures: 0, largest_mm: 0, scale_mm: 5, fields: [] },
    departure: {
      compared: 3,
      departed: 1,
      scale_mm: 20,
      errors: 2,
      steps: [
        { step: 1, pictures: 2, compared: 2, departed: 0 },
        { step: 2, pictures: 1, compared: 1, departed: 1, largest_mm: 14.2, largest_error_mm: 2.1, at_ns: 2 * kTenth },
        { step: 3, pictures: 3, compared: 0, departed: 0 },
      ],
    },
  };
  const steps = [step(1, 'Grasp', 0, 2), step(2, 'Lift', 2, 3), step(3, 'Hold', 3, 6), step(4, 'Inspect', 30, 40), { ...step(5, 'Leave', 0, 1), done: null }];

  it('is read of each node, in sevenths of the scale', () => {
    // H is 7: the first node 0, the second the last seventh; 4 is 56: the third the last one, the fourth 0.
    const one = departureAt(document, 2 * kTenth);
    if (typeof one !== 'object') throw new Error('it was compared');
    expect([...one.shares]).toEqual([0, 6.5 / 7, 6.5 / 7, 0]);
    expect(one).toMatchObject({ departed: true, largest_mm: 14.2, largest_error_mm: 2.1 });
    expect(departureAt(document, kTenth)).toMatchObject({ departed: false, error_mm: 1.5 });
    // Of the last picture that was looked at, for as long as organAt() says anything.
    expect(departureAt(document, 2.5 * kTenth)).toEqual(one);
    expect(departureAt(document, 4 * kTenth)).toBeUndefined();
    expect(departureAt(document, 6 * kTenth)).toBe('no-plan-moment');
    expect(departureAt(document, 20 * kTenth)).toBeUndefined();
    expect(departureAt({ ...document, departure: null }, 2 * kTenth)).toBeUndefined();
    // A few nodes beyond their error are chance.
    expect(departureAt({ ...document, moments: [compared(0, { ...far, beyond: 0.04 })] }, 0)).toMatchObject({ departed: false });
  });

  it('is never a deformed shape’s on an organ that is shown at rest', () => {
    const since = (at: number, since_ns: number): Moment => ({
      ...compared(at, far),
      deformed: { since_ns, standard_error_mm: 2, largest_mm: 10, eye_m: [0, -0.2, 0], view_axes: turned(0), weights_mm: [10] },
    });
    const fields = { pictures: 2, largest_mm: 20, scale_mm: 20, fields: [[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]] };
    const told = (moments: Moment[], time_ns: number) => departureAt({ ...document, moments, deformed: fields }, time_ns);
    const deformed = since(0, 0);
    expect(told([deformed, compared(1)], 0)).toMatchObject({ departed: true });
    expect(told([deformed, compared(1)], kTenth / 2)).toMatchObject({ departed: false, error_mm: 1.5 });
    expect(told([deformed, { ...placed(1), rigid: 'unfitted', no_departure: 'rigid' }], kTenth / 2)).toBe('rigid');
    // The organ is at rest in both, or deformed from the one to the other.
    expect(told([compared(0), since(1, 0)], kTenth / 2)).toMatchObject({ departed: false });
    expect(told([deformed, since(1, 0)], kTenth / 2)).toMatchObject({ departed: true });
    // Two shapes that nothing connects.
    expect(told([deformed, since(1, kTenth)], kTenth / 2)).toBeUndefined();
    // A lost organ is not drawn; what was said last stays.
    expect(told([deformed, lost(1)], kTenth / 2)).toMatchObject({ departed: true });
  });

  it('is coloured where it is beyond its error, and grey elsewhere', () => {
    const mesh = outlineMesh(document.surface);
    const found = organAt(document, 0);
    if (!mesh || found?.is !== 'placed') throw new Error('it is placed');
    const shape = { camera: found.camera, displacement: new Float64Array(12), told: new Uint8Array(4).fill(1), error_mm: 1, largest_mm: 0 };
    const seen = seenNodes(mesh, found.camera, 60, 640, 480);
    const shares = (departures: number[]) => colouredFaces(mesh, shape, seen, 1, Float64Array.from(departures)).map((one) => one.share);
    expect(shares([0.5, 0.5, 0.5, 0.5]).every((one) => Math.abs((one ?? NaN) - 0.5) < 1e-12)).toBe(true);
    expect(shares([0, 0, 0, 0]).every((one) => one === undefined)).toBe(true);
    expect(shares([0.5, 0.5, 0.5, 0])).toContain(undefined);
  });

  it('is summed up step by step: where, by how much, and where nothing can be said', () => {
    language.value = 'en';
    const told = stepDepartures(document, steps);
    expect(told.map(({ step: number, is, why }) => [number, is, why])).toEqual([
      [1, 'planned', undefined],
      [2, 'departed', undefined],
      [3, 'unknown', 'rigid.unfitted'],
      [4, 'unknown', 'departure.not-looked'],
    ]);
    expect(told.map(departureLine)).toEqual([
      '1. Grasp: as planned, within two standard errors, in 2 pictures.',
      '2. Lift: departed from the plan by up to 14 mm (standard error 2.1 mm), in 1 of 1 pictures.',
      '3. Hold: nothing can be said (no deformation explains the picture).',
      '4. Inspect: nothing can be said (no picture was looked at).',
    ]);
    expect(told[1]?.at_ns).toBe(2 * kTenth);
    expect(stepDepartures(alignment([placed(0)]), steps)).toEqual([]);
    language.value = 'ja';
    expect(told.map(departureLine)[1]).toBe('2. Lift：計画から最大 14 mm ずれています（標準誤差 2.1 mm）。1 枚中 1 枚。');
    language.value = 'en';
    expect(departureText('no-plan-moment')).toBe('Not compared with the plan: no moment of the plan');
  });
});
