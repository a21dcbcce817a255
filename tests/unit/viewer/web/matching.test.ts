import { describe, expect, it } from 'vitest';
import {
  beginning,
  begun,
  byHand,
  changed,
  compared,
  type Draft,
  ended,
  freeName,
  mapOfSteps,
  notDone,
  ofFound,
  paused,
  redone,
  undone,
  unpaused,
} from '@/compare/matching';
import { planAt } from '@/compare/plan_map';

const room = { start_ns: 0, end_ns: 60e9 };
const planned = [
  { step: 1, name: 'reach', start_s: 0, duration_s: 2 },
  { step: 2, name: 'grasp', start_s: 2, duration_s: 1 },
  { step: 3, name: 'lift', start_s: 3, duration_s: 4 },
];
const nothing: Draft = new Map();
const doneOf = (draft: Draft) => compared(planned, draft, room).map(({ done }) => done && [done.start_ns, done.end_ns, done.order]);

describe('Matching by hand', () => {
  it('takes a step until the next one begins, the last until the recording ends', () => {
    const draft = begun(begun(nothing, 1, 10e9, room), 2, 20e9, room);
    expect(doneOf(draft)).toEqual([[10e9, 20e9, 1], [20e9, 60e9, 2], null]);
    expect(byHand(draft)).toEqual({
      steps: [
        { step: 1, start: 10e9 },
        { step: 2, start: 20e9 },
      ],
    });
  });

  it('lets steps be done in another order than planned', () => {
    const draft = begun(begun(nothing, 1, 30e9, room), 3, 5e9, room);
    expect(doneOf(draft)).toEqual([[30e9, 60e9, 2], null, [5e9, 30e9, 1]]);
    expect(byHand(draft).steps.map((one) => one.step)).toEqual([3, 1]);
  });

  it('forgets an end that the next step has overtaken, and pauses outside of their step', () => {
    const found = ofFound([{ step: 1, start_ns: 10e9, end_ns: 20e9, pauses: [{ start_ns: 12e9, end_ns: 14e9 }] }], room);
    expect(byHand(found).steps[0]).toEqual({ step: 1, start: 10e9, end: 20e9, pauses: [[12e9, 14e9]] });
    expect(doneOf(begun(found, 2, 15e9, room))).toEqual([[10e9, 15e9, 1], [15e9, 60e9, 2], null]);
    const later = begun(found, 1, 13e9, room);
    expect(byHand(later).steps[0]).toEqual({ step: 1, start: 13e9, end: 20e9 });
    expect(byHand(begun(found, 1, 25e9, room)).steps[0]).toEqual({ step: 1, start: 25e9 });
  });

  it('ends a step only after it began, and leaves out what was not done', () => {
    const draft = begun(nothing, 2, 10e9, room);
    expect(ended(draft, 2, 9e9, room)).toBe(draft);
    expect(ended(draft, 1, 30e9, room)).toBe(draft);
    expect(doneOf(ended(draft, 2, 12e9, room))[1]).toEqual([10e9, 12e9, 1]);
    expect(notDone(draft, 2, room).size).toBe(0);
  });

  it('adds pauses within a step, joins those that overlap, and takes them out again', () => {
    const draft = ended(begun(begun(nothing, 1, 10e9, room), 3, 30e9, room), 1, 25e9, room);
    const one = paused(draft, 1, { start_ns: 12e9, end_ns: 14e9 }, room);
    const two = paused(one, 1, { start_ns: 20e9, end_ns: 21e9 }, room);
    expect(byHand(two).steps[0]).toEqual({
      step: 1,
      start: 10e9,
      end: 25e9,
      pauses: [
        [12e9, 14e9],
        [20e9, 21e9],
      ],
    });
    expect(byHand(paused(two, 1, { start_ns: 13e9, end_ns: 20.5e9 }, room)).steps[0]).toEqual({ step: 1, start: 10e9, end: 25e9, pauses: [[12e9, 21e9]] });
    expect(byHand(unpaused(two, 1, 0)).steps[0]).toEqual({ step: 1, start: 10e9, end: 25e9, pauses: [[20e9, 21e9]] });
    // The last step lasts until the recording ends; nothing is interrupted that was not being done.
    expect(paused(draft, 3, { start_ns: 58e9, end_ns: 60e9 }, room).get(3)?.pauses).toEqual([{ start_ns: 58e9, end_ns: 60e9 }]);
    expect(paused(draft, 1, { start_ns: 24e9, end_ns: 26e9 }, room)).toBe(draft);
    expect(paused(draft, 2, { start_ns: 12e9, end_ns: 14e9 }, room)).toBe(draft);
    expect(paused(draft, 1, { start_ns: 12e9, end_ns: 12e9 }, room)).toBe(draft);
    // The plan stands meanwhile.
    const map = mapOfSteps(compared(planned, one, room));
    expect(map && planAt(map, 13e9)).toMatchObject({ step: 1, speed: 0 });
  });

  it('stays within the recording, on whole nanoseconds', () => {
    expect(begun(nothing, 1, -5, room).get(1)?.start_ns).toBe(0);
    expect(begun(nothing, 1, 99e9, room).get(1)?.start_ns).toBe(60e9);
    expect(begun(nothing, 1, 1.4, room).get(1)?.start_ns).toBe(1);
  });

  it('shows the time map that follows: even but for pauses, none of a step that took no time', () => {
    const draft = ofFound(
      [
        { step: 3, start_ns: 30e9, end_ns: 40e9, pauses: [{ start_ns: 32e9, end_ns: 38e9 }] },
        { step: 1, start_ns: 10e9, end_ns: 14e9, pauses: [] },
        { step: 2, start_ns: 60e9, end_ns: null, pauses: [] },
      ],
      room,
    );
    const map = mapOfSteps(compared(planned, draft, room));
    expect(map?.pieces).toEqual([
      {
        step: 1,
        knots: [
          { plan_s: 0, case_ns: 10e9 },
          { plan_s: 2, case_ns: 14e9 },
        ],
      },
      {
        step: 3,
        knots: [
          { plan_s: 3, case_ns: 30e9 },
          { plan_s: 5, case_ns: 32e9 },
          { plan_s: 5, case_ns: 38e9 },
          { plan_s: 7, case_ns: 40e9 },
        ],
      },
    ]);
    expect(map && planAt(map, 35e9)).toEqual({ step: 3, plan_s: 5, speed: 0 });
    expect(mapOfSteps(compared(planned, nothing, room))).toBeUndefined();
  });
});

describe('What was done', () => {
  it('goes back and forth until something else is done', () => {
    const three = changed(changed(beginning(1), 2), 3);
    expect(undone(three).now).toBe(2);
    expect(undone(undone(undone(three))).now).toBe(1);
    expect(redone(redone(undone(undone(three)))).now).toBe(3);
    const other = changed(undone(three), 4);
    expect(other.future).toEqual([]);
    expect(undone(other).now).toBe(2);
  });

  it('is kept under a name that nobody has', () => {
    expect(freeName([])).toBe('by-hand');
    expect(freeName(['by-hand', 'by-hand-2', 'plan'])).toBe('by-hand-3');
  });
});
