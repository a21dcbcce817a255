// Where the plan is at a moment of the case: the comparison's time map, straight between what was matched. Pure; as viewer/compare/time_map.cpp.
import type { ComparisonDocument, ComparedStep } from '@/api/types';
import { lastAtOrBefore } from '@/base/spans';

interface Knot {
  plan_s: number;
  case_ns: number;
}

interface Piece {
  step: number;
  knots: readonly Knot[];
}

export interface PlanMoment {
  /** The plan's step, from 1. */
  step: number;
  plan_s: number;
  /** Seconds of the plan in a second of the case; 0 where the plan stands. */
  speed: number;
}

export interface PlanMap {
  /** In order of case time. */
  pieces: readonly Piece[];
}

export function planMap(document: ComparisonDocument): PlanMap | undefined {
  const pieces = (document.time_map?.pieces ?? [])
    .map(({ step, knots }) => ({ step, knots: knots.map(([plan_s, case_ns]) => ({ plan_s, case_ns })) }))
    .filter((one) => one.knots.length >= 2);
  return pieces.length > 0 ? { pieces } : undefined;
}

/** Before the first step the plan stands at its beginning, between two steps and after the last at the end of the one before. */
export function planAt(map: PlanMap, case_ns: number): PlanMoment {
  const first = map.pieces[0] as Piece;
  const piece = map.pieces[lastAtOrBefore(map.pieces, case_ns, (one) => (one.knots[0] as Knot).case_ns)];
  if (!piece) return { step: first.step, plan_s: (first.knots[0] as Knot).plan_s, speed: 0 };
  const at = lastAtOrBefore(piece.knots, case_ns, (one) => one.case_ns);
  const from = piece.knots[at] as Knot;
  const to = piece.knots[at + 1];
  if (!to) return { step: piece.step, plan_s: from.plan_s, speed: 0 };
  const speed = ((to.plan_s - from.plan_s) * 1e9) / (to.case_ns - from.case_ns);
  return { step: piece.step, plan_s: from.plan_s + ((case_ns - from.case_ns) / 1e9) * speed, speed };
}

/** The step that is done at a moment, of those that were found. */
export function stepAt(steps: readonly ComparedStep[], case_ns: number): ComparedStep | undefined {
  return steps.find(({ done }) => done && done.start_ns <= case_ns && case_ns < done.end_ns);
}

/** Steps that were found, as they were done. */
export function inOrderDone(steps: readonly ComparedStep[]): (ComparedStep & { done: NonNullable<ComparedStep['done']> })[] {
  return steps.flatMap((one) => (one.done ? [{ ...one, done: one.done }] : [])).sort((a, b) => a.done.start_ns - b.done.start_ns);
}
