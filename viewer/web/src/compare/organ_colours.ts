// The organ's surface as colours of how far it was displaced, drawn in the order of depth. Pure but for the canvas that it draws on.
import type { OrganLens } from '@/compare/organ_lens';
import { facing, type OutlineMesh, seenNodes } from '@/compare/organ_outline';
import type { OrganShape } from '@/compare/organ_shape';

/** Viridis of S. van der Walt and N. Smith (CC0) at eighths, evenly between them: its lightness only grows, and colour-blind people can read it. */
const kViridis = [
  [68, 1, 84],
  [71, 44, 122],
  [59, 81, 139],
  [44, 113, 142],
  [33, 144, 141],
  [39, 173, 129],
  [92, 200, 99],
  [170, 220, 50],
  [253, 231, 37],
] as const;

/** `share` from 0 to 1; beyond, its ends. */
export function viridis(share: number): [number, number, number] {
  const at = Math.min(Math.max(share, 0), 1) * (kViridis.length - 1);
  const from = Math.min(Math.floor(at), kViridis.length - 2);
  const [a, b] = [kViridis[from] as readonly number[], kViridis[from + 1] as readonly number[]];
  const mixed = (channel: number) => Math.round((a[channel] as number) + (at - from) * ((b[channel] as number) - (a[channel] as number)));
  return [mixed(0), mixed(1), mixed(2)];
}

/** The mesh with its nodes where the shape has them. */
export function displaced(mesh: OutlineMesh, { displacement }: OrganShape): OutlineMesh {
  return { ...mesh, nodes: mesh.nodes.map((one, i) => one + (displacement[i] ?? 0)) };
}

export interface ColouredFace {
  face: number;
  /** Of its nodes' mean displacement, or departure from the plan; nothing where one of them is not told, or does not depart. */
  share: number | undefined;
}
/** Those that face the camera, the farthest first. With departures (shares of the scale) these are what is coloured. */
export function colouredFaces(mesh: OutlineMesh, shape: OrganShape, seen: Float64Array, scale_mm: number, departures?: Float64Array): ColouredFace[] {
  const turned = facing(mesh, seen);
  const { eye, axes } = shape.camera;
  const depth = new Float64Array(turned.length);
  const faces: ColouredFace[] = [];
  for (let face = 0; face < turned.length; ++face) {
    if (turned[face] === 0) continue;
    let [size, told, far, departs] = [0, 1, 0, 1];
    for (let corner = 0; corner < 3; ++corner) {
      const node = mesh.faces[3 * face + corner] as number;
      told &= shape.told[node] ?? 0;
      far += (departures?.[node] ?? 0) / 3;
      departs &= (departures?.[node] ?? 0) > 0 ? 1 : 0;
      size += Math.hypot(...[0, 1, 2].map((axis) => shape.displacement[3 * node + axis] ?? 0)) / 3;
      for (let axis = 0; axis < 3; ++axis) {
        (depth[face] as number) -= (axes[6 + axis] as number) * ((mesh.nodes[3 * node + axis] as number) - (eye[axis] as number));
      }
    }
    if (departures) faces.push({ face, share: departs === 1 ? far : undefined });
    else faces.push({ face, share: told === 1 ? (1000 * size) / scale_mm : undefined });
  }
  return faces.sort((a, b) => (depth[b.face] as number) - (depth[a.face] as number));
}

const kUntold = '#969696';
const kOpacity = 0.55;

/** Half through, so that the recorded tissue stays to be seen. The context's picture lies at its origin. */
export function drawColours(
  context: CanvasRenderingContext2D,
  mesh: OutlineMesh,
  shape: OrganShape,
  field_deg: number,
  width: number,
  height: number,
  scale_mm: number,
  lens?: OrganLens,
  departures?: Float64Array,
): void {
  const seen = seenNodes(mesh, shape.camera, field_deg, width, height, lens);
  // On a sheet of its own: faces that overlap would be darker, and seams between them lighter.
  const sheet = new OffscreenCanvas(Math.max(1, Math.round(width)), Math.max(1, Math.round(height)));
  const onto = sheet.getContext('2d');
  if (!onto) return;
  for (const { face, share } of colouredFaces(mesh, shape, seen, scale_mm, departures)) {
    onto.beginPath();
    for (let corner = 0; corner < 3; ++corner) {
      const node = mesh.faces[3 * face + corner] as number;
      onto.lineTo(seen[2 * node] as number, seen[2 * node + 1] as number);
    }
    onto.closePath();
    const colour = share === undefined ? kUntold : `rgb(${viridis(share).join(' ')})`;
    onto.fillStyle = colour;
    onto.strokeStyle = colour;
    onto.fill();
    onto.stroke();
  }
  context.globalAlpha = kOpacity;
  context.drawImage(sheet, 0, 0, width, height);
  context.globalAlpha = 1;
}
