// Steps of a plan matched to moments of a case by hand: what was said so far, and what a comparison would make of it. Pure; as
// viewer/compare/step_matching.cpp and viewer/compare/time_map.cpp, which have the last word.
import type { ComparedStep, FoundStep, PlannedStep } from '@/api/types';
import { merged, type Span } from '@/base/spans';
import type { PlanMap } from '@/compare/plan_map';

/** When a step was done. */
export interface Said {
  start_ns: number;
  /** Nothing: until the next step begins, the last until the recording ends. */
  end_ns: number | null;
  pauses: readonly Span[];
}

/** By the step's number; a step that is not in it was not done. */
export type Draft = ReadonlyMap<number, Said>;

const inOrder = (draft: Draft): [number, Said][] => [...draft].sort(([a, one], [b, other]) => one.start_ns - other.start_ns || a - b);

/** One step is done after the other: an end that lies behind the next beginning is none; a pause lies within its step. */
function mended(draft: Draft, room: Span): Draft {
  const steps = inOrder(draft);
  return new Map(
    steps.map(([step, said], at) => {
      const next = steps[at + 1]?.[1].start_ns ?? room.end_ns;
      const end_ns = said.end_ns !== null && said.end_ns > said.start_ns && said.end_ns <= next ? said.end_ns : null;
      const pauses = said.pauses.filter((pause) => pause.start_ns >= said.start_ns && pause.end_ns <= (end_ns ?? next));
      return [step, { start_ns: said.start_ns, end_ns, pauses }];
    }),
  );
}

const within = (time_ns: number, room: Span) => Math.round(Math.max(room.start_ns, Math.min(room.end_ns, time_ns)));

export const ofFound = (found: readonly FoundStep[], room: Span): Draft =>
  mended(new Map(found.map(({ step, start_ns, end_ns, pauses }) => [step, { start_ns, end_ns, pauses }])), room);

export const begun = (draft: Draft, step: number, at_ns: number, room: Span): Draft => {
  const before = draft.get(step);
  return mended(new Map(draft).set(step, { start_ns: within(at_ns, room), end_ns: before?.end_ns ?? null, pauses: before?.pauses ?? [] }), room);
};

/** Nothing changes for a step that has not begun before then. */
export const ended = (draft: Draft, step: number, at_ns: number, room: Span): Draft => {
  const before = draft.get(step);
  if (!before || at_ns <= before.start_ns) return draft;
  return mended(new Map(draft).set(step, { ...before, end_ns: within(at_ns, room) }), room);
};

export const notDone = (draft: Draft, step: number, room: Span): Draft => {
  const left = new Map(draft);
  left.delete(step);
  return mended(left, room);
};

/** An interruption of a step; nothing changes where it does not lie within it. Those that overlap become one. */
export function paused(draft: Draft, step: number, pause: Span, room: Span): Draft {
  const before = draft.get(step);
  if (!before) return draft;
  const span = { start_ns: within(pause.start_ns, room), end_ns: within(pause.end_ns, room) };
  const next = mended(new Map(draft).set(step, { ...before, pauses: merged([...before.pauses, span], 0) }), room);
  const isIn = next.get(step)?.pauses.some((one) => one.start_ns <= span.start_ns && span.end_ns <= one.end_ns);
  return isIn && span.end_ns > span.start_ns ? next : draft;
}

export function unpaused(draft: Draft, step: number, pause: number): Draft {
  const before = draft.get(step);
  return before ? new Map(draft).set(step, { ...before, pauses: before.pauses.filter((_, at) => at !== pause) }) : draft;
}

/** The steps as a comparison would list them. */
export function compared(planned: readonly PlannedStep[], draft: Draft, room: Span): ComparedStep[] {
  const done = new Map<number, NonNullable<ComparedStep['done']>>();
  const steps = inOrder(draft);
  steps.forEach(([step, said], at) => {
    const end_ns = said.end_ns ?? Math.max(said.start_ns, steps[at + 1]?.[1].start_ns ?? room.end_ns);
    const before = steps[at - 1]?.[1];
    const pause_before_ns = before && before.end_ns !== null ? said.start_ns - before.end_ns : null;
    done.set(step, { start_ns: said.start_ns, end_ns, order: at + 1, pauses: [...said.pauses], pause_before_ns });
  });
  return planned.map(({ step, name, start_s, duration_s }) => ({ step, name, planned: { start_s, duration_s }, done: done.get(step) ?? null }));
}

/** The time map of such steps: both clocks run evenly but for the pauses, in which the plan stands. */
export function mapOfSteps(steps: readonly ComparedStep[]): PlanMap | undefined {
  const pieces = steps.flatMap(({ step, planned, done }) => {
    if (!done || done.end_ns <= done.start_ns) return [];
    const active_ns = done.pauses.reduce((left, pause) => left - (pause.end_ns - pause.start_ns), done.end_ns - done.start_ns);
    const end_s = planned.start_s + planned.duration_s;
    const knots = [{ plan_s: planned.start_s, case_ns: done.start_ns }];
    let done_ns = 0;
    let from_ns = done.start_ns;
    for (const pause of done.pauses) {
      done_ns += pause.start_ns - from_ns;
      const plan_s = planned.start_s + (active_ns > 0 ? done_ns / active_ns : 0) * planned.duration_s;
      if (pause.start_ns > (knots.at(-1)?.case_ns ?? 0)) knots.push({ plan_s, case_ns: pause.start_ns });
      knots.push({ plan_s, case_ns: pause.end_ns });
      from_ns = pause.end_ns;
    }
    const last = knots.at(-1);
    if (last && done.end_ns > last.case_ns) knots.push({ plan_s: end_s, case_ns: done.end_ns });
    else if (last) last.plan_s = end_s;
    return [{ step, knots }];
  });
  pieces.sort((a, b) => (a.knots[0]?.case_ns ?? 0) - (b.knots[0]?.case_ns ?? 0));
  return pieces.length > 0 ? { pieces } : undefined;
}

/** As `kiroku compare --by-hand` takes it (docs/explanation/comparison.md); times in nanoseconds of the case clock. */
export const byHand = (draft: Draft) => ({
  steps: inOrder(draft).map(([step, { start_ns, end_ns, pauses }]) => ({
    step,
    start: start_ns,
    ...(end_ns === null ? {} : { end: end_ns }),
    ...(pauses.length === 0 ? {} : { pauses: pauses.map((pause) => [pause.start_ns, pause.end_ns]) }),
  })),
});

/** A value with its way back and forth. */
export interface History<T> {
  past: readonly T[];
  now: T;
  future: readonly T[];
}

export const beginning = <T>(now: T): History<T> => ({ past: [], now, future: [] });
export const changed = <T>({ past, now }: History<T>, next: T): History<T> => ({ past: [...past, now], now: next, future: [] });
export function undone<T>(history: History<T>): History<T> {
  const { past, now, future } = history;
  return past.length === 0 ? history : { past: past.slice(0, -1), now: past.at(-1) as T, future: [now, ...future] };
}
export function redone<T>(history: History<T>): History<T> {
  const { past, now, future } = history;
  return future.length === 0 ? history : { past: [...past, now], now: future[0] as T, future: future.slice(1) };
}

/** "by-hand", or with the least number that nobody has. */
export function freeName(taken: readonly string[]): string {
  let name = 'by-hand';
  for (let number = 2; taken.includes(name); ++number) name = `by-hand-${number}`;
  return name;
}
