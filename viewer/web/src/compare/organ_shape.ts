// The shape of the plan's organ where it was deformed to fit the recorded pictures, by the comparison's document. Pure; as
// viewer/compare/organ_deformation.cpp, which has the last word.
import type { OrganAlignment } from '@/api/types';
import { lastAtOrBefore } from '@/base/spans';
import { kMostApart_ns, kSame_ns, mixedCamera, type OrganCamera } from '@/compare/organ_place';

type Moment = OrganAlignment['moments'][number];
type Deformed = NonNullable<Moment['deformed']>;

export interface OrganShape {
  camera: OrganCamera;
  /** x, y, z of each node of the drawn surface, metres. */
  displacement: Float64Array;
  /** Of each node: 1 where its displacement is told. */
  told: Uint8Array;
  error_mm: number;
  largest_mm: number;
}

/** The first node is the most significant bit of the first digit; without a text all are told. */
function toldNodes(text: string | undefined, count: number): Uint8Array {
  const told = new Uint8Array(count).fill(1);
  if (text === undefined) return told;
  for (let node = 0; node < count; ++node) told[node] = (Number.parseInt(text[node >> 2] ?? '0', 16) >> (3 - (node & 3))) & 1;
  return told;
}

function shapeOf(alignment: OrganAlignment, moment: Deformed): OrganShape | undefined {
  const fields = alignment.deformed?.fields ?? [];
  const count = alignment.surface?.nodes_mm.length ?? 0;
  // Without a scale no colour can be drawn.
  if (!((alignment.deformed?.scale_mm ?? 0) > 0)) return undefined;
  if (count === 0 || moment.weights_mm.length > fields.length || fields.some((one) => one.length !== count)) return undefined;
  const displacement = new Float64Array(count);
  moment.weights_mm.forEach((weight, at) => {
    const field = fields[at] as number[];
    for (let i = 0; i < count; ++i) (displacement[i] as number) += (weight * (field[i] as number)) / 1000;
  });
  return {
    camera: { eye: moment.eye_m, axes: moment.view_axes },
    displacement,
    told: toldNodes(moment.told, count / 3),
    error_mm: moment.standard_error_mm,
    largest_mm: moment.largest_mm,
  };
}

/** In the picture of that time; evenly between two in which it was deformed since the same picture. Nothing elsewhere, and where the document contradicts
 * itself: there the rigid organ is drawn, or none. */
export function organShapeAt(alignment: OrganAlignment, time_ns: number): OrganShape | undefined {
  const { moments } = alignment;
  const at = lastAtOrBefore(moments, time_ns + kSame_ns, (one) => one.time_ns);
  const before = moments[at];
  if (!before?.deformed) return undefined;
  const shape = shapeOf(alignment, before.deformed);
  if (!shape || Math.abs(before.time_ns - time_ns) <= kSame_ns) return shape;
  const after = moments[at + 1];
  if (!after?.deformed || after.time_ns - before.time_ns > kMostApart_ns || after.deformed.since_ns !== before.deformed.since_ns) return undefined;
  const next = shapeOf(alignment, after.deformed);
  if (!next) return undefined;
  const share = (time_ns - before.time_ns) / (after.time_ns - before.time_ns);
  return {
    camera: mixedCamera(shape.camera, next.camera, share),
    displacement: shape.displacement.map((one, i) => one + share * ((next.displacement[i] as number) - one)),
    told: shape.told.map((one, i) => one & (next.told[i] as number)),
    error_mm: Math.max(shape.error_mm, next.error_mm),
    largest_mm: Math.max(shape.largest_mm, next.largest_mm),
  };
}

/** Why it is rigid in the picture of that time; nothing where it is deformed, or that was not asked for. */
export function whyRigid(alignment: OrganAlignment, time_ns: number): string | undefined {
  if (!alignment.deformed || organShapeAt(alignment, time_ns)) return undefined;
  const { moments } = alignment;
  const at = lastAtOrBefore(moments, time_ns + kSame_ns, (one) => one.time_ns);
  return moments[at]?.rigid ?? moments[at + 1]?.rigid;
}

export interface RigidCount {
  why: string;
  pictures: number;
}
/** Reasons for which pictures kept the rigid organ, the most frequent first. */
export function rigidCounts(alignment: OrganAlignment): RigidCount[] {
  const counts = new Map<string, number>();
  for (const { rigid } of alignment.moments) if (rigid !== undefined) counts.set(rigid, (counts.get(rigid) ?? 0) + 1);
  return [...counts].map(([why, pictures]) => ({ why, pictures })).sort((a, b) => b.pictures - a.pictures);
}
