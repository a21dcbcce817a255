// The outline of an organ as a camera sees it: the border of everything that its surface covers in the picture. Pure but for the canvas that it draws on.
import type { OrganAlignment } from '@/api/types';
import type { OrganCamera } from '@/compare/organ_place';

type Surface = NonNullable<OrganAlignment['surface']>;

export interface OutlineMesh {
  /** x, y, z one after the other, metres. */
  nodes: Float64Array;
  /** Three nodes each, anticlockwise from outside. */
  faces: Uint32Array;
  /** Two nodes each, with the faces beside it; a border's second face is its first. */
  edges: Uint32Array;
}

/** Nothing where the document has no surface, or one that is none. */
export function outlineMesh(surface: Surface | undefined): OutlineMesh | undefined {
  if (!surface || surface.nodes_mm.length % 3 !== 0 || surface.faces.length % 3 !== 0 || surface.faces.length === 0) return undefined;
  const count = surface.nodes_mm.length / 3;
  if (surface.faces.some((node) => node < 0 || node >= count)) return undefined;
  const nodes = Float64Array.from(surface.nodes_mm, (one) => one / 1000);
  const faces = Uint32Array.from(surface.faces);
  const first = new Map<number, number>();
  const edges: number[] = [];
  for (let face = 0; face < faces.length / 3; ++face) {
    for (let side = 0; side < 3; ++side) {
      const a = faces[3 * face + side] as number;
      const b = faces[3 * face + ((side + 1) % 3)] as number;
      const key = Math.min(a, b) * count + Math.max(a, b);
      const beside = first.get(key);
      if (beside === undefined) {
        first.set(key, face);
      } else {
        edges.push(a, b, beside, face);
        first.delete(key);
      }
    }
  }
  // Edges of a single face are always part of the border.
  for (const [key, face] of first) edges.push(Math.floor(key / count), key % count, face, face);
  return { nodes, faces, edges: Uint32Array.from(edges) };
}

/** Where nodes are in a picture whose lesser side covers `field_deg`: x and y one after the other, in pixels from the left upper corner; NaN for what is
 * beside or behind the eye. */
export function seenNodes({ nodes }: OutlineMesh, { eye, axes }: OrganCamera, field_deg: number, width: number, height: number): Float64Array {
  const kNearest_m = 0.001;
  const focal = Math.min(width, height) / 2 / Math.tan((field_deg * Math.PI) / 360);
  const seen = new Float64Array((nodes.length / 3) * 2);
  const along = (row: number, x: number, y: number, z: number) =>
    (axes[3 * row] as number) * x + (axes[3 * row + 1] as number) * y + (axes[3 * row + 2] as number) * z;
  for (let node = 0; node < nodes.length / 3; ++node) {
    const x = (nodes[3 * node] as number) - (eye[0] as number);
    const y = (nodes[3 * node + 1] as number) - (eye[1] as number);
    const z = (nodes[3 * node + 2] as number) - (eye[2] as number);
    const depth = -along(2, x, y, z);
    const before = depth >= kNearest_m;
    seen[2 * node] = before ? width / 2 + (focal * along(0, x, y, z)) / depth : NaN;
    seen[2 * node + 1] = before ? height / 2 - (focal * along(1, x, y, z)) / depth : NaN;
  }
  return seen;
}

/** Which faces turn their outside to the camera; those with a node that is not seen do not. */
export function facing({ faces }: OutlineMesh, seen: Float64Array): Uint8Array {
  const turned = new Uint8Array(faces.length / 3);
  for (let face = 0; face < turned.length; ++face) {
    const [a, b, c] = [faces[3 * face] as number, faces[3 * face + 1] as number, faces[3 * face + 2] as number];
    const of = (node: number, axis: number) => seen[2 * node + axis] as number;
    const area = (of(b, 0) - of(a, 0)) * (of(c, 1) - of(a, 1)) - (of(c, 0) - of(a, 0)) * (of(b, 1) - of(a, 1));
    // Anticlockwise is negative where y goes down.
    turned[face] = area < 0 ? 1 : 0;
  }
  return turned;
}

export interface OutlineLook {
  line: string;
  /** Around the line, so that it is seen on light and dark. */
  halo: string;
  /** Of the line, pixels. */
  wide: number;
}

/** Clears the canvas's picture and draws the outline: beside the organ's border, outside of it, so that the border itself stays to be seen. */
export function drawOutline(
  context: CanvasRenderingContext2D,
  mesh: OutlineMesh,
  camera: OrganCamera,
  field_deg: number,
  width: number,
  height: number,
  look: OutlineLook,
): void {
  const seen = seenNodes(mesh, camera, field_deg, width, height);
  const turned = facing(mesh, seen);
  const at = (node: number) => [seen[2 * node] as number, seen[2 * node + 1] as number] as const;
  const { edges, faces } = mesh;
  context.beginPath();
  for (let edge = 0; edge < edges.length; edge += 4) {
    const [one, other] = [edges[edge + 2] as number, edges[edge + 3] as number];
    if (one === other ? turned[one] === 0 : turned[one] === turned[other]) continue;
    const [ax, ay] = at(edges[edge] as number);
    const [bx, by] = at(edges[edge + 1] as number);
    if (Number.isNaN(ax + bx)) continue;
    context.moveTo(ax, ay);
    context.lineTo(bx, by);
  }
  context.lineCap = 'round';
  context.strokeStyle = look.halo;
  context.lineWidth = 2 * look.wide + 2;
  context.stroke();
  context.strokeStyle = look.line;
  context.lineWidth = 2 * look.wide;
  context.stroke();
  // What lies within all that the organ covers goes: folds of it, and the inner half of the line.
  context.beginPath();
  for (let face = 0; face < turned.length; ++face) {
    if (!turned[face]) continue;
    context.moveTo(...at(faces[3 * face] as number));
    context.lineTo(...at(faces[3 * face + 1] as number));
    context.lineTo(...at(faces[3 * face + 2] as number));
    context.closePath();
  }
  context.globalCompositeOperation = 'destination-out';
  context.fillStyle = '#000';
  context.fill('nonzero');
  context.globalCompositeOperation = 'source-over';
}
