// Where the recording departs from the plan: where a picture shows the organ's surface, against where the plan has it at that moment, by the comparison's
// document. Pure; as viewer/compare/departure.cpp, which has the last word.
import type { ComparedStep, OrganAlignment } from '@/api/types';
import { lastAtOrBefore } from '@/base/spans';
import { kMostApart_ns, kSame_ns, organAt } from '@/compare/organ_place';
import { organShapeAt } from '@/compare/organ_shape';
import { inOrderDone } from '@/compare/plan_map';

const kAlphabet = 'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/';
const kLevels = 7;
/** A few nodes are beyond their error by chance (DeformedTrack::kLeastBeyond). */
const kLeastBeyond = 0.05;

export interface OrganDeparture {
  /** Of each node of the drawn surface: 0 where it does not depart beyond its error, or that is not known; else a share of the scale. */
  shares: Float64Array;
  departed: boolean;
  /** Of the node that is farthest off, and of all. */
  largest_mm: number;
  largest_error_mm: number;
  error_mm: number;
}

function sharesOf(text: string | undefined, count: number): Float64Array {
  const shares = new Float64Array(count);
  if (text === undefined) return shares;
  for (let node = 0; node < count; ++node) {
    const digit = Math.max(0, kAlphabet.indexOf(text[node >> 1] ?? 'A'));
    const level = node % 2 === 0 ? digit >> 3 : digit & 7;
    // The middle of the seventh that it lies in.
    shares[node] = level === 0 ? 0 : (level - 0.5) / kLevels;
  }
  return shares;
}

/** In the picture of that time, or the last one before it that was looked at: a departure, why a shape that is known was not compared, or nothing. Where the
 * organ was deformed in that one and is shown at rest since, it is the next one's, if it was at rest there. */
export function departureAt(alignment: OrganAlignment, time_ns: number): OrganDeparture | string | undefined {
  if (!alignment.departure) return undefined;
  const at = lastAtOrBefore(alignment.moments, time_ns + kSame_ns, (one) => one.time_ns);
  const before = alignment.moments[at];
  if (!before || time_ns - before.time_ns > kMostApart_ns) return undefined;
  const isBetween = Math.abs(before.time_ns - time_ns) > kSame_ns;
  const isAtRest = isBetween && before.deformed && organAt(alignment, time_ns)?.is === 'placed' && !organShapeAt(alignment, time_ns);
  const moment = isAtRest ? alignment.moments[at + 1] : before;
  if (!moment || (isAtRest && moment.deformed)) return undefined;
  const { departure } = moment;
  if (!departure) return moment.no_departure;
  return {
    shares: sharesOf(departure.nodes, (alignment.surface?.nodes_mm.length ?? 0) / 3),
    departed: departure.beyond >= kLeastBeyond,
    largest_mm: departure.largest_mm ?? 0,
    largest_error_mm: departure.largest_error_mm ?? departure.standard_error_mm,
    error_mm: departure.standard_error_mm,
  };
}

export interface StepDeparture {
  step: number;
  name: string;
  is: 'departed' | 'planned' | 'unknown';
  /** Pictures in which it departed, and that were compared. */
  pictures: number;
  compared: number;
  largest_mm: number;
  error_mm: number;
  /** The picture in which it departed most. */
  at_ns: number | undefined;
  /** Of a step of which nothing can be said: for what most of its pictures say nothing, as a key of the page's words: rigid.unfitted. */
  why: string | undefined;
}

function whyUnknown(alignment: OrganAlignment, done: NonNullable<ComparedStep['done']>): string {
  const counts = new Map<string, number>();
  for (const { time_ns, lost, rigid, no_departure } of alignment.moments) {
    if (time_ns < done.start_ns || time_ns >= done.end_ns) continue;
    const why =
      no_departure !== undefined ? `departure.${no_departure}` : rigid !== undefined ? `rigid.${rigid}` : lost !== undefined ? `why.${lost}` : undefined;
    if (why !== undefined) counts.set(why, (counts.get(why) ?? 0) + 1);
  }
  return [...counts].sort((a, b) => b[1] - a[1])[0]?.[0] ?? 'departure.not-looked';
}

/** For each planned step that was found: where the recording departed from the plan, by how much, and where nothing can be said. */
export function stepDepartures(alignment: OrganAlignment, steps: readonly ComparedStep[]): StepDeparture[] {
  const { departure } = alignment;
  if (!departure) return [];
  return inOrderDone(steps).map(({ step, name, done }) => {
    const told = departure.steps.find((one) => one.step === step);
    const compared = told?.compared ?? 0;
    const departed = told?.departed ?? 0;
    return {
      step,
      name,
      is: compared === 0 ? 'unknown' : departed > 0 ? 'departed' : 'planned',
      pictures: departed,
      compared,
      largest_mm: told?.largest_mm ?? 0,
      error_mm: told?.largest_error_mm ?? 0,
      at_ns: told?.at_ns,
      why: compared === 0 ? whyUnknown(alignment, done) : undefined,
    };
  });
}
