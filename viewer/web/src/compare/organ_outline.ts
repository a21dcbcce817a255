// The outline of an organ as a camera sees it: the border of everything that its surface covers in the picture. Pure but for the canvas that it draws on.
import type { OrganAlignment } from '@/api/types';
import { type OrganLens, shownAt } from '@/compare/organ_lens';
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

/** Where nodes are in a picture whose lesser side covers `field_deg`, or which a lens shows: x and y one after the other, in pixels from the left upper
 * corner; NaN for what is beside or behind the eye. */
export function seenNodes(
  { nodes }: OutlineMesh,
  { eye, axes }: OrganCamera,
  field_deg: number,
  width: number,
  height: number,
  lens?: OrganLens,
): Float64Array {
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
    if (lens && before) {
      [seen[2 * node], seen[2 * node + 1]] = shownAt(lens, along(0, x, y, z) / depth, -along(1, x, y, z) / depth, width, height);
      continue;
    }
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

/** Opaque where a face that is turned to the camera lies, a number for each pixel of a mask that is `scale` times as large as the picture: paths of
 * thousands of triangles take a browser half a second. */
export function coverFaces({ faces }: OutlineMesh, seen: Float64Array, turned: Uint8Array, scale: number, wide: number, high: number, mask: Uint32Array): void {
  const kOpaque = 0xff000000;
  mask.fill(0);
  for (let face = 0; face < turned.length; ++face) {
    if (turned[face] === 0) continue;
    const corner = (side: number, axis: number) => scale * (seen[2 * (faces[3 * face + (side % 3)] as number) + axis] as number);
    const top = Math.min(corner(0, 1), corner(1, 1), corner(2, 1));
    const bottom = Math.max(corner(0, 1), corner(1, 1), corner(2, 1));
    // Rows and columns whose middle lies within.
    for (let row = Math.max(0, Math.ceil(top - 0.5)); row <= Math.min(high - 1, Math.floor(bottom - 0.5)); ++row) {
      const y = row + 0.5;
      let left = Infinity;
      let right = -Infinity;
      for (let side = 0; side < 3; ++side) {
        const [y1, y2] = [corner(side, 1), corner(side + 1, 1)];
        if (y < Math.min(y1, y2) || y > Math.max(y1, y2)) continue;
        const [x1, x2] = [corner(side, 0), corner(side + 1, 0)];
        const x = y1 === y2 ? x1 : x1 + ((y - y1) / (y2 - y1)) * (x2 - x1);
        left = Math.min(left, x);
        right = Math.max(right, x);
      }
      const from = Math.max(0, Math.ceil(left - 0.5));
      const to = Math.min(wide - 1, Math.floor(right - 0.5));
      if (from <= to) mask.fill(kOpaque, row * wide + from, row * wide + to + 1);
    }
  }
}

export interface OutlineLook {
  line: string;
  /** Around the line, so that it is seen on light and dark. */
  halo: string;
  /** Of the line, pixels. */
  wide: number;
}

/** The mask has fewer pixels than large panes: what it loses is less than the line is wide. */
const kMostMaskWide = 800;

/** Draws outlines of one mesh, again and again. */
export class OutlineDrawing {
  private readonly mask = document.createElement('canvas');
  private pixels: ImageData | undefined;

  constructor(private readonly mesh: OutlineMesh) {}

  /** Beside the organ's border, outside of it, so that the border itself stays to be seen. The context is empty, and the picture lies at its origin. */
  draw(context: CanvasRenderingContext2D, camera: OrganCamera, field_deg: number, width: number, height: number, look: OutlineLook, lens?: OrganLens): void {
    const seen = seenNodes(this.mesh, camera, field_deg, width, height, lens);
    const turned = facing(this.mesh, seen);
    const { edges } = this.mesh;
    const isWithin = this.cover(seen, turned, width, height);
    context.beginPath();
    for (let edge = 0; edge < edges.length; edge += 4) {
      const [one, other] = [edges[edge + 2] as number, edges[edge + 3] as number];
      if (one === other ? turned[one] === 0 : turned[one] === turned[other]) continue;
      const [a, b] = [2 * (edges[edge] as number), 2 * (edges[edge + 1] as number)];
      const [ax, ay, bx, by] = [seen[a] as number, seen[a + 1] as number, seen[b] as number, seen[b + 1] as number];
      if (Number.isNaN(ax + bx)) continue;
      // A fold before or behind other parts of the organ: it would be drawn to be wiped away.
      if (isWithin(ax, ay) && isWithin(bx, by) && isWithin((ax + bx) / 2, (ay + by) / 2)) continue;
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
    context.globalCompositeOperation = 'destination-out';
    context.drawImage(this.mask, 0, 0, width, height);
    context.globalCompositeOperation = 'source-over';
  }

  /** Makes the mask; tells whether all about a place is covered. */
  private cover(seen: Float64Array, turned: Uint8Array, width: number, height: number): (x: number, y: number) => boolean {
    const scale = Math.min(1, kMostMaskWide / width);
    const [wide, high] = [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))];
    const context = this.mask.getContext('2d') as CanvasRenderingContext2D;
    if (this.pixels?.width !== wide || this.pixels.height !== high) {
      this.mask.width = wide;
      this.mask.height = high;
      this.pixels = context.createImageData(wide, high);
    }
    const mask = new Uint32Array(this.pixels.data.buffer);
    coverFaces(this.mesh, seen, turned, wide / width, wide, high, mask);
    context.putImageData(this.pixels, 0, 0);
    const kAbout = 2;
    return (x, y) => {
      const [column, row] = [Math.floor((x * wide) / width), Math.floor((y * wide) / width)];
      if (column < kAbout || row < kAbout || column >= wide - kAbout || row >= high - kAbout) return false;
      const is = (dx: number, dy: number) => mask[(row + dy) * wide + column + dx] !== 0;
      return is(-kAbout, 0) && is(kAbout, 0) && is(0, -kAbout) && is(0, kAbout) && is(-1, -1) && is(1, -1) && is(-1, 1) && is(1, 1);
    };
  }
}
