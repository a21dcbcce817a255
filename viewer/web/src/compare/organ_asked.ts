// What a person says where the plan's organ shall be found in the recorded pictures by itself, and what is still missing. Pure; limits as
// viewer/api/alignment_fields.h, which has the last word.
import type { ComparedStep } from '@/api/types';
import type { Span } from '@/base/spans';
import { kHour, kMinute, kSecond } from '@/base/time';

export const kLeastField_deg = 10;
export const kGreatestField_deg = 120;
export const kLongestStretch_ns = kHour;
export const kLongestDeformed_ns = 10 * kMinute;
/** How many seconds a second of recording took in the records of docs/results, from the kind ones to those in which the organ is lost again and again. */
export const kTimesAsLong = [1, 4] as const;
/** The same where it is deformed to fit as well. */
export const kDeformedTimesAsLong = [3, 6] as const;

export const kOrganViews = ['front', 'back', 'left', 'right', 'head', 'feet'] as const;
export type OrganView = (typeof kOrganViews)[number];

export interface OrganAsked {
  /** Of the pictures' lesser side; nothing: not said yet. */
  field_deg: number | null;
  view: OrganView;
  /** The steps that are matched, a second around them, or what is selected on the time line. */
  where: 'steps' | 'selection';
  /** Whether it is deformed to fit the pictures, too. */
  deformed: boolean;
}
export const kOrganAsked: OrganAsked = { field_deg: null, view: 'front', where: 'steps', deformed: false };

/** Where it is looked for; nothing where no step is done, or nothing is selected. */
export function stretchOf(asked: OrganAsked, steps: readonly ComparedStep[], selection: Span | undefined, room: Span): Span | undefined {
  const done = steps.flatMap((one) => one.done ?? []);
  const wanted =
    asked.where === 'selection'
      ? selection
      : done.length > 0
        ? { start_ns: Math.min(...done.map((one) => one.start_ns)) - kSecond, end_ns: Math.max(...done.map((one) => one.end_ns)) + kSecond }
        : undefined;
  if (!wanted) return undefined;
  const span = { start_ns: Math.round(Math.max(room.start_ns, wanted.start_ns)), end_ns: Math.round(Math.min(room.end_ns, wanted.end_ns)) };
  return span.end_ns > span.start_ns ? span : undefined;
}

/** What keeps it from being looked for; nothing where nothing does. */
export function organLacks(
  asked: OrganAsked | undefined,
  stretch: Span | undefined,
  pickedPoints: boolean,
): 'points' | 'field' | 'stretch' | 'long' | 'longDeformed' | undefined {
  if (!asked) return undefined;
  if (pickedPoints) return 'points';
  const { field_deg } = asked;
  if (field_deg === null || !(field_deg >= kLeastField_deg && field_deg <= kGreatestField_deg)) return 'field';
  if (!stretch) return 'stretch';
  const length_ns = stretch.end_ns - stretch.start_ns;
  if (length_ns > kLongestStretch_ns) return 'long';
  return asked.deformed && length_ns > kLongestDeformed_ns ? 'longDeformed' : undefined;
}

/** As `POST comparisons` takes it. */
export const organBody = (asked: OrganAsked | undefined, stretch: Span | undefined) =>
  asked &&
  stretch && { field_deg: asked.field_deg, view: asked.view, from_ns: stretch.start_ns, to_ns: stretch.end_ns, ...(asked.deformed && { organ: 'deformed' }) };
