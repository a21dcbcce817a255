import { describe, expect, it } from 'vitest';
import type { ComparedStep, ComparisonDocument } from '@/api/types';
import { inOrderDone, planAt, planMap, stepAt } from '@/compare/plan_map';

const step = (number: number, start_s?: number, end_s?: number): ComparedStep => ({
  step: number,
  name: `step ${number}`,
  planned: { start_s: number - 1, duration_s: 1 },
  done: start_s === undefined || end_s === undefined ? null : { start_ns: start_s * 1e9, end_ns: end_s * 1e9, order: 1, pauses: [], pause_before_ns: null },
});

const document = (pieces: { step: number; knots: [number, number][] }[] | null, steps: ComparedStep[] = []): ComparisonDocument => ({
  case: { stream: 'endoscope' },
  plan: { seal: '' },
  in_planned_order: true,
  steps,
  time_map: pieces && { monotone: true, pieces },
  registration: null,
  fluoroscopy: null,
  tools: [],
});

/** Step 1 half as fast with a pause of a second in it; step 3 is done before step 2. */
const map = planMap(
  document([
    {
      step: 1,
      knots: [
        [0, 10e9],
        [1, 12e9],
        [1, 13e9],
        [2, 15e9],
      ],
    },
    {
      step: 3,
      knots: [
        [5, 20e9],
        [6, 20.5e9],
      ],
    },
    {
      step: 2,
      knots: [
        [2, 30e9],
        [5, 33e9],
      ],
    },
  ]),
);

describe('The time map', () => {
  if (!map) throw new Error('there is one');

  it('is straight between two matched moments, on both clocks', () => {
    expect(planAt(map, 11e9)).toEqual({ step: 1, plan_s: 0.5, speed: 0.5 });
    expect(planAt(map, 14e9)).toEqual({ step: 1, plan_s: 1.5, speed: 0.5 });
    expect(planAt(map, 20.25e9)).toEqual({ step: 3, plan_s: 5.5, speed: 2 });
    expect(planAt(map, 31e9)).toEqual({ step: 2, plan_s: 3, speed: 1 });
  });

  it('stands in a pause, between steps, before the first and after the last', () => {
    expect(planAt(map, 12.5e9)).toEqual({ step: 1, plan_s: 1, speed: 0 });
    expect(planAt(map, 0)).toEqual({ step: 1, plan_s: 0, speed: 0 });
    expect(planAt(map, 17e9)).toEqual({ step: 1, plan_s: 2, speed: 0 });
    expect(planAt(map, 99e9)).toEqual({ step: 2, plan_s: 5, speed: 0 });
  });

  it('never goes back within a step', () => {
    let before = -1;
    for (let at = 9e9; at <= 19e9; at += 0.05e9) {
      const { plan_s } = planAt(map, at);
      expect(plan_s).toBeGreaterThanOrEqual(before);
      before = plan_s;
    }
  });

  it('is none where no step was found, and knows nothing of steps that took no time', () => {
    expect(planMap(document(null))).toBeUndefined();
    expect(planMap(document([]))).toBeUndefined();
    expect(planMap(document([{ step: 1, knots: [[0, 1e9]] }]))).toBeUndefined();
  });
});

describe('Steps', () => {
  const steps = [step(1, 5, 6), step(2), step(3, 1, 4)];
  it('are found at a moment by when they were done', () => {
    expect(stepAt(steps, 2e9)?.step).toBe(3);
    expect(stepAt(steps, 4e9)).toBeUndefined();
    expect(stepAt(steps, 5e9)?.step).toBe(1);
  });
  it('come in the order they were done', () => {
    expect(inOrderDone(steps).map((one) => one.step)).toEqual([3, 1]);
  });
});
