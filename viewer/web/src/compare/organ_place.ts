// Where the plan's organ is in the recorded pictures, by the comparison's document: placed with a standard error, lost for a reason, or not looked for. It
// moves evenly between two placed pictures that follow each other; nothing else is guessed. Pure; as viewer/compare/organ_alignment.cpp, which has the last word.
import type { OrganAlignment } from '@/api/types';
import { lastAtOrBefore, type Span } from '@/base/spans';

/** Between two moments that are further apart nobody looked (kAlignedMostNs). */
export const kMostApart_ns = 300_000_000;
/** A picture's own time, as a browser tells it, may fall that much beside it. */
export const kSame_ns = 1_000_000;
/** Lost before, and not searched for: that takes a second. */
const kNotLooked = 'not-looked';

type Moment = OrganAlignment['moments'][number];
/** In metres, patient coordinates; axes right, up and back, one after the other. */
export interface OrganCamera {
  eye: readonly number[];
  axes: readonly number[];
}
export type OrganPlace = { is: 'placed'; camera: OrganCamera; error_mm: number } | { is: 'lost'; why: string };
type Placed = Moment & Required<Pick<Moment, 'eye_m' | 'view_axes' | 'standard_error_mm'>>;

const isPlaced = (moment: Moment): moment is Placed =>
  moment.lost === undefined && moment.eye_m !== undefined && moment.view_axes !== undefined && moment.standard_error_mm !== undefined;
const placeOf = (moment: Moment): OrganPlace =>
  isPlaced(moment)
    ? { is: 'placed', camera: { eye: moment.eye_m, axes: moment.view_axes }, error_mm: moment.standard_error_mm }
    : { is: 'lost', why: moment.lost ?? 'unknown' };

type Quaternion = readonly [number, number, number, number];

/** Of the rotation whose rows the axes are; w, x, y, z (Shepperd, "Quaternion from Rotation Matrix", 1978). */
function quaternionOf(axes: readonly number[]): Quaternion {
  const m = (row: number, column: number) => axes[3 * row + column] as number;
  const trace = m(0, 0) + m(1, 1) + m(2, 2);
  const largest = [trace, m(0, 0), m(1, 1), m(2, 2)].reduce((best, one, at, all) => (one > (all[best] as number) ? at : best), 0);
  if (largest === 0) {
    const w = Math.sqrt(1 + trace) / 2;
    return [w, (m(2, 1) - m(1, 2)) / (4 * w), (m(0, 2) - m(2, 0)) / (4 * w), (m(1, 0) - m(0, 1)) / (4 * w)];
  }
  const i = largest - 1;
  const j = (i + 1) % 3;
  const k = (i + 2) % 3;
  const of_i = Math.sqrt(Math.max(0, 1 + m(i, i) - m(j, j) - m(k, k))) / 2;
  const vector = [0, 0, 0];
  vector[i] = of_i;
  vector[j] = (m(j, i) + m(i, j)) / (4 * of_i);
  vector[k] = (m(k, i) + m(i, k)) / (4 * of_i);
  return [(m(k, j) - m(j, k)) / (4 * of_i), vector[0] as number, vector[1] as number, vector[2] as number];
}

function axesOf([w, x, y, z]: Quaternion): number[] {
  return [
    1 - 2 * (y * y + z * z),
    2 * (x * y - w * z),
    2 * (x * z + w * y),
    2 * (x * y + w * z),
    1 - 2 * (x * x + z * z),
    2 * (y * z - w * x),
    2 * (x * z - w * y),
    2 * (y * z + w * x),
    1 - 2 * (x * x + y * y),
  ];
}

/** Evenly from one to the other, the shorter way round. */
export function mixedCamera(a: OrganCamera, b: OrganCamera, share: number): OrganCamera {
  const [p, q] = [quaternionOf(a.axes), quaternionOf(b.axes)];
  const dot = p.reduce((sum, one, at) => sum + one * (q[at] as number), 0);
  const angle = Math.acos(Math.min(1, Math.abs(dot)));
  const sine = Math.sin(angle);
  const [of_p, of_q] = sine > 1e-6 ? [Math.sin((1 - share) * angle) / sine, Math.sin(share * angle) / sine] : [1 - share, share];
  const sign = dot < 0 ? -1 : 1;
  const mixed = p.map((one, at) => of_p * one + sign * of_q * (q[at] as number));
  const length = Math.hypot(...mixed);
  return {
    eye: a.eye.map((one, at) => one + share * ((b.eye[at] as number) - one)),
    axes: axesOf(mixed.map((one) => one / length) as unknown as Quaternion),
  };
}

function between(a: Placed, b: Placed, share: number): OrganPlace {
  const camera = mixedCamera({ eye: a.eye_m, axes: a.view_axes }, { eye: b.eye_m, axes: b.view_axes }, share);
  return { is: 'placed', camera, error_mm: Math.max(a.standard_error_mm, b.standard_error_mm) };
}

/** The size of the recorded pictures at a moment; nothing where a document does not say it. */
export function pictureSizeAt(alignment: OrganAlignment, time_ns: number): { width: number; height: number } | undefined {
  const sizes = alignment.picture_sizes ?? [];
  return sizes[
    Math.max(
      0,
      lastAtOrBefore(sizes, time_ns + kSame_ns, (one) => one.from_ns),
    )
  ];
}

/** In the picture of that time; nothing where nobody looked. */
export function organAt(alignment: OrganAlignment, time_ns: number): OrganPlace | undefined {
  const { moments } = alignment;
  const at = lastAtOrBefore(moments, time_ns + kSame_ns, (one) => one.time_ns);
  const before = moments[at];
  if (!before) return undefined;
  if (Math.abs(before.time_ns - time_ns) <= kSame_ns) return placeOf(before);
  const after = moments[at + 1];
  if (!after || after.time_ns - before.time_ns > kMostApart_ns) return undefined;
  if (pictureSizeAt(alignment, before.time_ns) !== pictureSizeAt(alignment, after.time_ns)) return undefined;
  if (!isPlaced(before)) return placeOf(before);
  if (!isPlaced(after)) return placeOf(after);
  return between(before, after, (time_ns - before.time_ns) / (after.time_ns - before.time_ns));
}

/** Placed, or lost for that reason. */
export interface OrganStretch extends Span {
  lost: string | undefined;
}

/** As organAt() would say it of each moment; in order, without what nobody looked at. */
export function organStretches(alignment: OrganAlignment): OrganStretch[] {
  const { moments } = alignment;
  const out: OrganStretch[] = [];
  const add = (start_ns: number, end_ns: number, lost: string | undefined) => {
    const last = out.at(-1);
    if (last?.end_ns === start_ns && last.lost === lost) last.end_ns = end_ns;
    else out.push({ start_ns, end_ns, lost });
  };
  const whyOf = (moment: Moment) => {
    const place = placeOf(moment);
    return place.is === 'lost' ? place.why : undefined;
  };
  moments.forEach((moment, at) => {
    const after = moments[at + 1];
    if (!after || after.time_ns - moment.time_ns > kMostApart_ns) {
      // The picture itself, which is seen for a moment.
      add(moment.time_ns, moment.time_ns + kSame_ns, whyOf(moment));
      return;
    }
    add(moment.time_ns, after.time_ns, whyOf(moment) ?? whyOf(after));
  });
  return out;
}

/** Placed, where there is no reason; else lost from one end to the other, for these reasons, the longest first. */
export interface OrganEpisode extends Span {
  whys: readonly string[];
}

/** Lost stretches that follow each other as one. That a picture was not searched, as a search takes long, is only a reason where there is no other. */
function organEpisodes(stretches: readonly OrganStretch[]): OrganEpisode[] {
  const out: (Span & { times: Map<string, number> })[] = [];
  for (const { start_ns, end_ns, lost } of stretches) {
    const last = out.at(-1);
    const goesOn = last?.end_ns === start_ns && last.times.size > 0 === (lost !== undefined);
    const episode = goesOn && last ? last : { start_ns, end_ns, times: new Map<string, number>() };
    if (episode !== last) out.push(episode);
    episode.end_ns = end_ns;
    if (lost !== undefined) episode.times.set(lost, (episode.times.get(lost) ?? 0) + end_ns - start_ns);
  }
  return out.map(({ start_ns, end_ns, times }) => {
    const whys = [...times].sort((a, b) => b[1] - a[1]).map(([why]) => why);
    const told = whys.filter((why) => why !== kNotLooked);
    return { start_ns, end_ns, whys: told.length > 0 ? told : whys };
  });
}

export interface OrganSummary {
  episodes: readonly OrganEpisode[];
  /** Pictures. */
  looked: number;
  placed: number;
  /** Half of the placed ones have no larger standard error, and none has a larger one than that; nothing where none is placed. */
  half_mm: number | undefined;
  most_mm: number | undefined;
  lost: readonly OrganEpisode[];
  lost_ns: number;
}

export function organSummary(alignment: OrganAlignment): OrganSummary {
  const errors = alignment.moments
    .filter(isPlaced)
    .map((one) => one.standard_error_mm)
    .sort((a, b) => a - b);
  const episodes = organEpisodes(organStretches(alignment));
  const lost = episodes.filter((one) => one.whys.length > 0);
  return {
    episodes,
    looked: alignment.moments.length,
    placed: errors.length,
    half_mm: errors[Math.max(0, Math.ceil(errors.length / 2) - 1)],
    most_mm: errors.at(-1),
    lost,
    lost_ns: lost.reduce((sum, one) => sum + one.end_ns - one.start_ns, 0),
  };
}
