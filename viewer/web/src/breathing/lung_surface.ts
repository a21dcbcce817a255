// The lung's surface as it is turned and painted: where nodes are seen, what lies under a pointer, which nodes a brush covers. Pure.

/** Of the model at rest. */
export interface Surface {
  /** x, y, z one after the other: left, back, head. */
  nodes_mm: number[];
  /** Three nodes each, anticlockwise from outside. */
  faces: number[];
  /** A figure for each node, as the model has it that was opened. */
  groups: string;
}

/** By their figures in frames and messages, from 1. */
export const kSurfaceGroups = ['free', 'rib_cage', 'diaphragm', 'trachea', 'back'] as const;
export type SurfaceGroup = (typeof kSurfaceGroups)[number];
export const figureOf = (group: SurfaceGroup): string => String(kSurfaceGroups.indexOf(group) + 1);
export const groupAt = (groups: string, node: number): SurfaceGroup => kSurfaceGroups[Number(groups[node]) - 1] ?? 'free';
export const countOf = (groups: string, group: SurfaceGroup): number => groups.split(figureOf(group)).length - 1;
/** Without these nothing moves. */
export const lacking = (groups: string): SurfaceGroup | undefined => (['rib_cage', 'diaphragm'] as const).find((group) => countOf(groups, group) === 0);

/** From where the lung is looked at: about the body, from the front towards the patient's left; and from above. Degrees. */
export interface View {
  about_deg: number;
  up_deg: number;
}
export const kViews = {
  front: { about_deg: 0, up_deg: 0 },
  left: { about_deg: 90, up_deg: 0 },
  behind: { about_deg: 180, up_deg: 0 },
  right: { about_deg: -90, up_deg: 0 },
  feet: { about_deg: 0, up_deg: -90 },
} as const satisfies Record<string, View>;

export function turned({ about_deg, up_deg }: View, about_by: number, up_by: number): View {
  const about = about_deg + about_by;
  return { about_deg: about - 360 * Math.round(about / 360), up_deg: Math.min(90, Math.max(-90, up_deg + up_by)) };
}

/** What a turned lung looks like in a square of that many pixels: all of it, at whatever angle. */
export class SeenLung {
  /** Pixels from the left upper corner, and mm towards the eye. */
  readonly x: Float64Array;
  readonly y: Float64Array;
  readonly depth: Float64Array;
  readonly pixelsPerMm: number;
  /** Faces that are turned to the eye, the farthest first. */
  readonly faces: number[];
  /** How much each of them is turned to it, from 0 to 1. */
  readonly facing: Float64Array;

  constructor(
    readonly surface: Surface,
    view: View,
    readonly side: number,
  ) {
    const { nodes_mm, faces } = surface;
    const count = nodes_mm.length / 3;
    const radians = Math.PI / 180;
    const [about, up] = [view.about_deg * radians, view.up_deg * radians];
    const right = [Math.cos(about), Math.sin(about), 0] as const;
    const eye = [Math.sin(about) * Math.cos(up), -Math.cos(about) * Math.cos(up), Math.sin(up)] as const;
    const above = [-Math.sin(up) * Math.sin(about), Math.sin(up) * Math.cos(about), Math.cos(up)] as const;
    const { middle, radius } = ballAround(nodes_mm);
    this.pixelsPerMm = (0.48 * side) / Math.max(radius, 1e-6);
    this.x = new Float64Array(count);
    this.y = new Float64Array(count);
    this.depth = new Float64Array(count);
    for (let node = 0; node < count; ++node) {
      let [across, high, near] = [0, 0, 0];
      for (let axis = 0; axis < 3; ++axis) {
        const from = (nodes_mm[3 * node + axis] as number) - (middle[axis] as number);
        across += from * (right[axis] as number);
        high += from * (above[axis] as number);
        near += from * (eye[axis] as number);
      }
      this.x[node] = side / 2 + this.pixelsPerMm * across;
      this.y[node] = side / 2 - this.pixelsPerMm * high;
      this.depth[node] = near;
    }
    this.facing = new Float64Array(faces.length / 3);
    const seen: number[] = [];
    for (let face = 0; face < faces.length / 3; ++face) {
      const [a, b, c] = this.corners(face);
      const along = (one: number, other: number) =>
        [
          (this.x[other] as number) - (this.x[one] as number),
          (this.y[one] as number) - (this.y[other] as number),
          ((this.depth[other] as number) - (this.depth[one] as number)) * this.pixelsPerMm,
        ] as const;
      const [p, q] = [along(a, b), along(a, c)];
      const [nx, ny, nz] = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
      const facing = nz / (Math.hypot(nx, ny, nz) || 1);
      this.facing[face] = facing;
      if (facing > 0) seen.push(face);
    }
    const far = new Float64Array(faces.length / 3);
    for (const face of seen) far[face] = this.corners(face).reduce((sum, node) => sum + (this.depth[node] as number), 0);
    this.faces = seen.sort((one, other) => (far[one] as number) - (far[other] as number));
  }

  corners(face: number): [number, number, number] {
    return this.surface.faces.slice(3 * face, 3 * face + 3) as [number, number, number];
  }

  /** The nearest face under a pixel, of its corners the nearest one, and where that is on the surface. */
  under(x: number, y: number): { node: number; place_mm: [number, number, number] } | undefined {
    let found: { node: number; place_mm: [number, number, number] } | undefined;
    let nearest = -Infinity;
    for (const face of this.faces) {
      const nodes = this.corners(face);
      const weights = this.weightsAt(nodes, x, y);
      if (!weights) continue;
      const mean = (of: (node: number) => number) => nodes.reduce((sum, node, i) => sum + (weights[i] as number) * of(node), 0);
      const depth = mean((node) => this.depth[node] as number);
      if (depth <= nearest) continue;
      nearest = depth;
      const most = weights.indexOf(Math.max(...weights));
      const along = (axis: number) => mean((node) => this.surface.nodes_mm[3 * node + axis] as number);
      found = { node: nodes[most] as number, place_mm: [along(0), along(1), along(2)] };
    }
    return found;
  }
  /** Barycentric; nothing where the pixel is beside the face. */
  private weightsAt([a, b, c]: [number, number, number], x: number, y: number): [number, number, number] | undefined {
    const cross = (i: number, j: number) =>
      ((this.x[i] as number) - x) * ((this.y[j] as number) - y) - ((this.x[j] as number) - x) * ((this.y[i] as number) - y);
    const parts: [number, number, number] = [cross(b, c), cross(c, a), cross(a, b)];
    const all = parts[0] + parts[1] + parts[2];
    if (all === 0 || parts.some((part) => part / all < 0)) return undefined;
    return parts.map((part) => part / all) as [number, number, number];
  }
}

/** Around the middle of the box, so that a lung that is turned stays within the square. */
function ballAround(nodes_mm: readonly number[]): { middle: [number, number, number]; radius: number } {
  const least = [Infinity, Infinity, Infinity];
  const most = [-Infinity, -Infinity, -Infinity];
  nodes_mm.forEach((value, i) => {
    least[i % 3] = Math.min(least[i % 3] as number, value);
    most[i % 3] = Math.max(most[i % 3] as number, value);
  });
  const middle = least.map((value, axis) => (value + (most[axis] as number)) / 2) as [number, number, number];
  let radius = 0;
  for (let at = 0; at < nodes_mm.length; at += 3) {
    radius = Math.max(radius, Math.hypot(...middle.map((value, axis) => (nodes_mm[at + axis] as number) - value)));
  }
  return { middle, radius };
}

/** Who lies beside whom. */
export function neighboursOf({ nodes_mm, faces }: Surface): number[][] {
  const beside = Array.from({ length: nodes_mm.length / 3 }, () => new Set<number>());
  for (let at = 0; at < faces.length; ++at) {
    const first = at - (at % 3);
    const [node, next] = [faces[at] as number, faces[first + ((at + 1) % 3)] as number];
    beside[node]?.add(next);
    beside[next]?.add(node);
  }
  return beside.map((one) => [...one]);
}

/** The nodes within the brush that hang together with the one under it: what lies behind, or on another lobe, is not painted. */
export function nodesUnder(
  { nodes_mm }: Surface,
  neighbours: readonly (readonly number[])[],
  from: { node: number; place_mm: readonly [number, number, number] },
  radius_mm: number,
): number[] {
  const within = (node: number) => Math.hypot(...from.place_mm.map((value, axis) => (nodes_mm[3 * node + axis] as number) - value)) <= radius_mm;
  const reached = new Set([from.node]);
  // A set gives what is added meanwhile, too.
  for (const node of reached) for (const next of neighbours[node] ?? []) if (within(next)) reached.add(next);
  return [...reached];
}

/** With these nodes of that group; of none: as they were when the lung was opened. */
export function painted(groups: string, nodes: readonly number[], group: SurfaceGroup | null, opened: string): string {
  const figures = [...groups];
  for (const node of nodes) figures[node] = group === null ? (opened[node] as string) : figureOf(group);
  return figures.join('');
}
