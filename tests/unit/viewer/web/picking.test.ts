// What is asked of the plan's program while points are picked: one question at a time, and none that nobody needs any more.
import { signal } from '@preact/signals';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { cases } from '@/api/client';
import type { MatchingModel } from '@/compare/matching_model';
import { PickingModel, type RecordedFrame } from '@/compare/picking_model';
import type { PlanMap } from '@/compare/plan_map';
import { clicked, kNoPicks, type Picks } from '@/compare/picks';
import type { Playback } from '@/media/playback';
import { kFirstView } from '@/planning/orbit';

interface Question {
  what: 'picture' | 'point' | 'judge';
  said: Record<string, unknown>;
  answer: (answer: object) => Promise<void>;
  fail: (sentence: string) => Promise<void>;
}

/** Every question that reached the server, and how many of them had no answer yet at a time. */
let asked: Question[] = [];
let open = 0;
let mostOpen = 0;

/** Longer than anything here waits. */
const settled = () => vi.advanceTimersByTimeAsync(5_000);
/** Less than the model waits before it asks again. */
const soon = () => vi.advanceTimersByTimeAsync(0);

function question<T>(what: Question['what'], said: unknown): Promise<T> {
  mostOpen = Math.max(mostOpen, ++open);
  return new Promise<T>((resolve, reject) => {
    const done = async (how: () => void) => {
      --open;
      how();
      await soon();
    };
    asked.push({
      what,
      said: said as Record<string, unknown>,
      answer: (answer) => done(() => resolve(answer as T)),
      fail: (sentence) => done(() => reject(new Error(sentence))),
    });
  });
}

const pixelsOf = (n: number, more = 0): Picks => ({
  ...kNoPicks,
  at: { time_ns: 1e9, plan_s: 1 },
  field_deg: 60,
  pairs: Array.from({ length: n }, (_, i) => ({ organ: [i, 0, 0] as const, pixel: [i + more, 0] as const })),
});
const kMap: PlanMap = {
  pieces: [
    {
      step: 1,
      knots: [
        { plan_s: 0, case_ns: 0 },
        { plan_s: 10, case_ns: 10e9 },
      ],
    },
  ],
};
const kFrame = { time_ns: 1e9, width: 640, height: 480, picture: {} } as unknown as RecordedFrame;
const kPicture = { jpeg: '', camera: {} };

function scene() {
  const picks = signal<Picks>(kNoPicks);
  const told: string[] = [];
  const matching = { plan: signal<unknown>({ tools: ['forceps'], stream: 'endoscope' }), map: signal(kMap), picks, pick: (now: Picks) => (picks.value = now) };
  const playback = { playing: signal(true), position_ns: signal(0), pause: () => {}, seek: () => {} };
  const model = new PickingModel('c', matching as unknown as MatchingModel, playback as unknown as Playback, (error) => told.push(error.message));
  model.frame.value = kFrame;
  model.work.value = 'points';
  return { model, matching, picks, told };
}
const last = () => asked.at(-1) as Question;
const whats = () => asked.map((one) => one.what);
const judgings = () => asked.filter((one) => one.what === 'judge');
/** Answers pictures until something else is asked, or nothing. */
async function picturesDrawn(): Promise<void> {
  await settled();
  while (last().what === 'picture' && open > 0) {
    await last().answer(kPicture);
    await settled();
  }
}
/** The question of how well the points register a camera. */
async function judging(): Promise<Question> {
  await picturesDrawn();
  expect([last().what, open]).toEqual(['judge', 1]);
  return last();
}

beforeEach(() => {
  vi.useFakeTimers();
  [asked, open, mostOpen] = [[], 0, 0];
  vi.spyOn(cases, 'planPicture').mockImplementation((_, view) => question('picture', view));
  vi.spyOn(cases, 'organPoint').mockImplementation((_, view) => question('point', view));
  vi.spyOn(cases, 'judgePoints').mockImplementation((_, points) => question('judge', points));
});
afterEach(() => {
  vi.useRealTimers();
  vi.restoreAllMocks();
});

describe('Questions to the plan’s program', () => {
  it('are never two at once', async () => {
    const { model, picks } = scene();
    await settled();
    expect(whats()).toEqual(['picture']);
    await last().answer(kPicture);
    const point = model.pickOrgan({ x: 0.5, y: 0.5 });
    model.turn({ ...kFirstView }, true);
    picks.value = pixelsOf(4);
    await settled();
    expect(whats()).toEqual(['picture', 'point']);
    await last().answer({ organ: null });
    expect(await point).toBe(false);
    while (open > 0) {
      const one = last();
      await one.answer(one.what === 'judge' ? { standard_error_px: 1 } : kPicture);
      await settled();
    }
    expect(new Set(whats())).toEqual(new Set(['picture', 'point', 'judge']));
    expect(mostOpen).toBe(1);
    model.close();
  });

  it('are not asked once it is closed, nor while nothing is picked', async () => {
    const { model, picks } = scene();
    await settled();
    const point = model.pickOrgan({ x: 0.5, y: 0.5 });
    picks.value = pixelsOf(4);
    await settled();
    expect(whats()).toEqual(['picture']);
    model.close();
    await last().answer(kPicture);
    await settled();
    expect(await point).toBe(false);
    expect(whats()).toEqual(['picture']);

    const other = scene();
    await settled();
    await last().answer(kPicture);
    other.model.turn({ ...kFirstView }, false);
    const late = other.model.pickOrgan({ x: 0.5, y: 0.5 });
    await settled();
    expect(whats()).toEqual(['picture', 'picture', 'picture']);
    other.model.work.value = 'steps';
    await last().answer(kPicture);
    await settled();
    expect(await late).toBe(false);
    expect(whats()).toEqual(['picture', 'picture', 'picture']);
    // Back at it, the picture is drawn.
    other.model.work.value = 'points';
    await settled();
    expect(whats()).toEqual(['picture', 'picture', 'picture', 'picture']);
    other.model.close();
  });

  it('are of what is wanted when their turn comes', async () => {
    const { model, picks } = scene();
    await settled();
    picks.value = pixelsOf(4);
    const first = await judging();
    const before = asked.length;
    // While that is judged the organ is turned twice, and points are moved twice.
    model.turn({ ...kFirstView, turn_deg: 10 } as never, false);
    picks.value = pixelsOf(4, 1);
    await settled();
    model.turn({ ...kFirstView, turn_deg: 20 } as never, false);
    picks.value = pixelsOf(4, 2);
    await settled();
    await first.answer({ standard_error_px: 1 });
    expect(model.judged.value).toBeUndefined();
    while (open > 0) {
      await last().answer(last().what === 'judge' ? { standard_error_px: 2 } : kPicture);
      await settled();
    }
    expect(
      asked
        .slice(before)
        .filter((one) => one.what === 'picture')
        .map((one) => one.said['turn_deg']),
    ).toEqual([20]);
    expect(
      asked
        .slice(before)
        .filter((one) => one.what === 'judge')
        .map((one) => (one.said['points'] as { pixel: number[] }[])[0]?.pixel),
    ).toEqual([[2, 0]]);
    expect(model.judged.value).toEqual({ standard_error_px: 2 });
    model.close();
  });

  it('that failed and were replaced are not told of, and what is being prepared is not said for ever', async () => {
    const { model, picks, told } = scene();
    picks.value = pixelsOf(4);
    await (await judging()).answer({ doing: 'reading', done: 0 });
    expect(model.preparing.value).toBeDefined();
    picks.value = clicked(kNoPicks, 'forceps', { at_ns: 1e9, pixel: [1, 1] });
    await picturesDrawn();
    expect(model.preparing.value).toBeUndefined();
    expect([judgings().length, open]).toEqual([1, 0]);
    picks.value = pixelsOf(4);
    const replaced = await judging();
    picks.value = kNoPicks;
    await replaced.fail('too few points');
    expect(told).toEqual([]);
    model.close();
  });
});
