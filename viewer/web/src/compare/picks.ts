// Points of the organ picked on the plan's and the recording's pictures, and clicks on tools: what was picked so far, and what `kiroku compare --by-hand`
// takes of it (docs/explanation/comparison.md). Pure. Pixels count from the centre of the left upper one.
import type { PickingCamera } from '@/api/types';

export type Pixel = readonly [number, number];
/** Patient coordinates in the plan's unit. */
export type OrganPoint = readonly [number, number, number];

/** The same place in both pictures; of the newest ones a side may still be missing. */
export interface Pair {
  organ: OrganPoint | null;
  pixel: Pixel | null;
}

export interface ToolClick {
  /** Of the picture that was clicked on. */
  at_ns: number;
  pixel: Pixel;
}

export interface Picks {
  /** The recorded picture that the pairs are of, and where the plan was then; nothing while there are no pairs. */
  at: { time_ns: number; plan_s: number } | null;
  pairs: readonly Pair[];
  /** Of the picture's lesser side; nothing: to be estimated. */
  field_deg: number | null;
  /** By the tool's name, in order of time. */
  clicks: ReadonlyMap<string, readonly ToolClick[]>;
}

export const kNoPicks: Picks = { at: null, pairs: [], field_deg: null, clicks: new Map() };

type Side = keyof Pair;

/** A place on one side: of the pair `chosen` where it lacks that side, else of the first pair that does, else of a new one. Which it became is told. */
export function picked<S extends Side>(
  picks: Picks,
  side: S,
  place: NonNullable<Pair[S]>,
  at: NonNullable<Picks['at']>,
  chosen: number | undefined,
): { picks: Picks; pair: number } {
  const wanted = chosen !== undefined && picks.pairs[chosen]?.[side] === null ? chosen : picks.pairs.findIndex((one) => one[side] === null);
  const pair = wanted >= 0 ? wanted : picks.pairs.length;
  const before = picks.pairs[pair] ?? { organ: null, pixel: null };
  const pairs = [...picks.pairs];
  pairs[pair] = { ...before, [side]: place };
  return { picks: { ...picks, at: picks.at ?? at, pairs }, pair };
}

export function moved<S extends Side>(picks: Picks, side: S, pair: number, place: NonNullable<Pair[S]>): Picks {
  return { ...picks, pairs: picks.pairs.map((one, at) => (at === pair ? { ...one, [side]: place } : one)) };
}

export function withoutPair(picks: Picks, pair: number): Picks {
  const pairs = picks.pairs.filter((_, at) => at !== pair);
  return { ...picks, pairs, at: pairs.length > 0 ? picks.at : null };
}

/** A tool has one place in a picture: another click there moves it. */
export function clicked(picks: Picks, tool: string, click: ToolClick): Picks {
  const others = (picks.clicks.get(tool) ?? []).filter((one) => one.at_ns !== click.at_ns);
  return {
    ...picks,
    clicks: new Map(picks.clicks).set(
      tool,
      [...others, click].sort((a, b) => a.at_ns - b.at_ns),
    ),
  };
}

export function withoutClick(picks: Picks, tool: string, at_ns: number): Picks {
  const clicks = new Map(picks.clicks);
  const left = (clicks.get(tool) ?? []).filter((one) => one.at_ns !== at_ns);
  if (left.length > 0) clicks.set(tool, left);
  else clicks.delete(tool);
  return { ...picks, clicks };
}

export type CompletePair = { organ: OrganPoint; pixel: Pixel };
export const completePairs = (picks: Picks): CompletePair[] => picks.pairs.flatMap(({ organ, pixel }) => (organ && pixel ? [{ organ, pixel }] : []));

/** How many a camera takes (viewer/compare/registration.h): two more where its field has to be estimated. */
export const leastPairs = (picks: Picks): number => (picks.field_deg === null ? 6 : 4);

/** What keeps a comparison from being made of it; nothing where nothing does. */
export function lacks(picks: Picks): 'pairs' | 'registration' | undefined {
  if (picks.pairs.length > 0 && completePairs(picks).length < leastPairs(picks)) return 'pairs';
  return picks.clicks.size > 0 && picks.pairs.length === 0 ? 'registration' : undefined;
}

/** As `kiroku compare --by-hand` takes it; pairs that lack a side are left out. */
export const byHandPicks = (picks: Picks) => ({
  ...(picks.at && picks.pairs.length > 0
    ? { registration: { at: picks.at.time_ns, ...(picks.field_deg === null ? {} : { field_deg: picks.field_deg }), points: completePairs(picks) } }
    : {}),
  ...(picks.clicks.size > 0
    ? { tools: Object.fromEntries([...picks.clicks].map(([tool, clicks]) => [tool, clicks.map(({ at_ns, pixel }) => ({ at: at_ns, pixel }))])) }
    : {}),
});

/** Places of a picture are told as parts of its width and height. */
export interface Place {
  x: number;
  y: number;
}
export interface PictureSize {
  width: number;
  height: number;
}
export const pixelAt = ({ x, y }: Place, { width, height }: PictureSize): Pixel => [x * width - 0.5, y * height - 0.5];
export const placeOf = ([column, row]: Pixel, { width, height }: PictureSize): Place => ({ x: (column + 0.5) / width, y: (row + 0.5) / height });

/** Where a camera sees a point; nothing for what is not before it. */
export function seenBy(camera: PickingCamera, point: OrganPoint): Place | undefined {
  const from = point.map((value, axis) => value - (camera.eye[axis] as number));
  const along = (axis: number) => from.reduce((sum, value, at) => sum + value * (camera.view_axes[3 * axis + at] as number), 0);
  const depth = -along(2);
  if (depth <= 0) return undefined;
  const right = (along(0) / depth - camera.centre[0]) / camera.half_extent[0];
  const up = (along(1) / depth - camera.centre[1]) / camera.half_extent[1];
  return { x: (1 + right) / 2, y: (1 - up) / 2 };
}
