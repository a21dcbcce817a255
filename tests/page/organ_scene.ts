// An organ as an endoscope sees it, drawn here by itself: its place is known in every picture, and nothing of the page's or the recorder's own geometry is in
// it. The shape is that of tests/support/endoscope_scene.h; pictures become a film without compression (YUV4MPEG2).

export type Vector = readonly [number, number, number];
const plus = (a: Vector, b: Vector, share = 1): Vector => [a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]];
const dot = (a: Vector, b: Vector) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: Vector, b: Vector): Vector => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a: Vector): Vector => plus([0, 0, 0], a, 1 / Math.hypot(...a));

export const kWide = 480;
export const kHigh = 360;
export const kField_deg = 60;
const kFocal = kHigh / 2 / Math.tan((kField_deg * Math.PI) / 360);

interface Body {
  /** Metres, patient coordinates. */
  nodes: Vector[];
  tetrahedra: [number, number, number, number][];
}

/** Like a liver: 16 cm wide, thick on its right, its left lobe thin, its lower border slanted and notched. */
export function liver(cells: Vector): Body {
  const [across, deep, high] = cells;
  const nodes: Vector[] = [];
  for (let k = 0; k <= high; ++k) {
    for (let j = 0; j <= deep; ++j) {
      for (let i = 0; i <= across; ++i) {
        let at: Vector = [(2 * i) / across - 1, (2 * j) / deep - 1, (2 * k) / high - 1];
        const shell = Math.max(...at.map(Math.abs));
        if (shell > 0) at = plus([0, 0, 0], at, 1 - 0.5 * shell + (0.6 * shell * shell) / Math.hypot(...at));
        const x = at[0];
        let [, y, z] = at;
        y = y * (1 - 0.4 * x) + 0.3 * x * x;
        z = z * (1 - 0.3 * x) + 0.3 * x;
        if (z < 0.3) z += 0.35 * Math.exp(-(((x - 0.25) / 0.18) ** 2)) * (0.3 - z);
        nodes.push([0.08 * x, 0.028 * y, 0.05 * z]);
      }
    }
  }
  const kOrders = [
    [0, 1, 2],
    [1, 2, 0],
    [2, 0, 1],
    [0, 2, 1],
    [2, 1, 0],
    [1, 0, 2],
  ] as const;
  const steps = [1, across + 1, (across + 1) * (deep + 1)] as const;
  const tetrahedra: Body['tetrahedra'] = [];
  for (let k = 0; k < high; ++k) {
    for (let j = 0; j < deep; ++j) {
      for (let i = 0; i < across; ++i) {
        kOrders.forEach(([first, second, third], order) => {
          const a = i * steps[0] + j * steps[1] + k * steps[2];
          const b = a + steps[first];
          const c = b + steps[second];
          const d = c + steps[third];
          tetrahedra.push(order < 3 ? [a, b, c, d] : [a, b, d, c]);
        });
      }
    }
  }
  return { nodes, tetrahedra };
}

/** For `kiroku plan`, in millimetres. */
export function meshText({ nodes, tetrahedra }: Body): string {
  return [
    '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes',
    nodes.length,
    ...nodes.map((node, at) => [at + 1, ...node.map((one) => 1000 * one)].join(' ')),
    '$EndNodes\n$Elements',
    tetrahedra.length,
    ...tetrahedra.map((corners, at) => [at + 1, 4, 2, 0, 0, ...corners.map((one) => one + 1)].join(' ')),
    '$EndElements\n',
  ].join('\n');
}

/** Faces of one tetrahedron alone. */
function surfaceOf({ tetrahedra }: Body): [number, number, number][] {
  const seen = new Map<string, [number, number, number] | undefined>();
  for (const [a, b, c, d] of tetrahedra) {
    for (const face of [
      [a, c, b],
      [a, b, d],
      [b, c, d],
      [a, d, c],
    ] as [number, number, number][]) {
      const key = [...face].sort((one, other) => one - other).join();
      seen.set(key, seen.has(key) ? undefined : face);
    }
  }
  return [...seen.values()].filter((face) => face !== undefined);
}

export interface SceneCamera {
  eye: Vector;
  right: Vector;
  up: Vector;
  back: Vector;
}

/** Looks at the patient's middle from so many degrees aside and above, at that distance. */
export function cameraAt(aside_deg: number, above_deg: number, distance_m: number): SceneCamera {
  const [a, e] = [(aside_deg * Math.PI) / 180, (above_deg * Math.PI) / 180];
  const back: Vector = [Math.sin(a) * Math.cos(e), -Math.cos(a) * Math.cos(e), Math.sin(e)];
  const right = unit(cross([0, 0, 1], back));
  return { eye: plus([0.005, 0.002, 0], back, distance_m), right, up: cross(back, right), back };
}

/** In the camera's own axes, metres. */
export const inView = ({ eye, right, up, back }: SceneCamera, node: Vector): Vector => {
  const from = plus(node, eye, -1);
  return [dot(from, right), dot(from, up), dot(from, back)];
};

const spots = ([x, y, z]: Vector, size: number) => {
  const p = x / size;
  const q = y / size;
  const r = z / size;
  return (
    (Math.sin(5.1 * p + 1.7 * Math.sin(2.3 * r + 0.4)) * Math.cos(4.3 * r + 1.9 * Math.sin(1.7 * q)) + Math.sin(3.7 * q + 2.1 * Math.sin(2.9 * p) + 1.3 * r)) /
    2
  );
};

/** Where a node at rest is when the border of the left lobe is drawn down and towards the viewer by so much. What lies above 2 cm is held. */
export function pulled(node: Vector, pull_m: number): Vector {
  const from = Math.hypot(...plus(node, [0.045, 0, -0.02], -1));
  const free = Math.max(0, Math.min(1, (0.02 - node[2]) / 0.03));
  return plus(node, [0.2, -0.6, -0.77], pull_m * Math.exp(-((from / 0.045) ** 2)) * free * free * (3 - 2 * free));
}

export class OrganScene {
  private readonly body = liver([24, 8, 18]);
  private readonly faces = surfaceOf(this.body);

  /** Rows from the top: the depth and the light of the organ's surface, and the place at rest of the tissue that is seen, three numbers each. Of a picture
   * after a picture: no vector is made for a pixel. */
  private seen(camera: SceneCamera, pull_m: number) {
    const nodes = this.body.nodes.map((node) => inView(camera, pulled(node, pull_m)));
    const pixels = nodes.map(([x, y, z]) => [kWide / 2 + (kFocal * x) / -z, kHigh / 2 - (kFocal * y) / -z] as const);
    const depth = new Float64Array(kWide * kHigh).fill(Infinity);
    const light = new Float64Array(kWide * kHigh);
    const rest = new Float64Array(3 * kWide * kHigh);
    for (const face of this.faces) {
      const [[ax, ay], [bx, by], [cx, cy]] = face.map((node) => pixels[node]) as [[number, number], [number, number], [number, number]];
      const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
      if (area === 0) continue;
      const [p, q, r] = face.map((node) => nodes[node]) as [Vector, Vector, Vector];
      const [u, v, w] = face.map((node) => this.body.nodes[node]) as [Vector, Vector, Vector];
      const facing = Math.abs(unit(cross(plus(q, p, -1), plus(r, p, -1)))[2]);
      const left = Math.max(0, Math.floor(Math.min(ax, bx, cx)));
      const right = Math.min(kWide - 1, Math.ceil(Math.max(ax, bx, cx)));
      const bottom = Math.min(kHigh - 1, Math.ceil(Math.max(ay, by, cy)));
      for (let y = Math.max(0, Math.floor(Math.min(ay, by, cy))); y <= bottom; ++y) {
        for (let x = left; x <= right; ++x) {
          const px = x + 0.5;
          const py = y + 0.5;
          const of_b = ((px - ax) * (cy - ay) - (cx - ax) * (py - ay)) / area;
          const of_c = ((bx - ax) * (py - ay) - (px - ax) * (by - ay)) / area;
          const of_a = 1 - of_b - of_c;
          if (of_a < 0 || of_b < 0 || of_c < 0) continue;
          const far = -1 / (of_a / p[2] + of_b / q[2] + of_c / r[2]);
          const at = y * kWide + x;
          if (far >= (depth[at] as number)) continue;
          depth[at] = far;
          light[at] = facing;
          const s = far * (-of_a / p[2]);
          const t = far * (-of_b / q[2]);
          const o = far * (-of_c / r[2]);
          rest[3 * at] = s * u[0] + t * v[0] + o * w[0];
          rest[3 * at + 1] = s * u[1] + t * v[1] + o * w[1];
          rest[3 * at + 2] = s * u[2] + t * v[2] + o * w[2];
        }
      }
    }
    return { depth, light, rest };
  }

  mask(camera: SceneCamera, pull_m = 0): Uint8Array {
    return Uint8Array.from(this.seen(camera, pull_m).depth, (far) => (Number.isFinite(far) ? 1 : 0));
  }

  /** Root of the mean squared way between where two cameras have the organ, millimetres. */
  way_mm(a: SceneCamera, b: SceneCamera): number {
    const { nodes } = this.body;
    const sum = nodes.reduce((all, node) => all + Math.hypot(...plus(inView(a, node), inView(b, node), -1)) ** 2, 0);
    return 1000 * Math.sqrt(sum / nodes.length);
  }

  /** Before fat and muscle, lit from the lens; `smoke`: nothing else is seen. Red, green, blue. */
  picture(camera: SceneCamera, smoke: boolean, seed: number, pull_m = 0): Float64Array {
    const rgb = new Float64Array(3 * kWide * kHigh);
    const { depth, light, rest } = this.seen(camera, pull_m);
    let state = seed;
    const noise = () => {
      state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
      return 8 * (state / 2 ** 32 - 0.5);
    };
    for (let y = 0; y < kHigh; ++y) {
      for (let x = 0; x < kWide; ++x) {
        const at = y * kWide + x;
        const isOrgan = (depth[at] as number) < Infinity;
        if (smoke) {
          rgb.set([186, 188, 190], 3 * at);
        } else if (isOrgan) {
          const place: Vector = [rest[3 * at] as number, rest[3 * at + 1] as number, rest[3 * at + 2] as number];
          const bright = (0.55 + 0.45 * (light[at] as number)) * (1 + 0.16 * spots(place, 0.03) + 0.14 * spots(place, 0.014));
          rgb[3 * at] = 158 * bright;
          rgb[3 * at + 1] = 64 * bright;
          rgb[3 * at + 2] = 54 * bright;
        } else {
          const [s, t] = [(x + 0.5 - kWide / 2) / kFocal, (kHigh / 2 - y - 0.5) / kFocal];
          const ray = plus(plus(plus([0, 0, 0], camera.right, s), camera.up, t), camera.back, -1);
          // The wall lies 6 cm behind.
          const far = Math.min(1, (0.06 - camera.eye[1]) / ray[1]);
          const place = plus(camera.eye, ray, far);
          const fat = 0.5 + 0.5 * Math.tanh(3 * spots(place, 0.09));
          const bright = (0.75 + 0.15 * spots(place, 0.02)) * Math.max(0.3, Math.min(1.2, 0.24 / far));
          rgb[3 * at] = bright * (178 + 44 * fat);
          rgb[3 * at + 1] = bright * (104 + 80 * fat);
          rgb[3 * at + 2] = bright * (98 + 22 * fat);
        }
        for (let c = 0; c < 3; ++c) rgb[3 * at + c] = (rgb[3 * at + c] as number) + noise();
      }
    }
    return rgb;
  }
}

/** BT.601, narrow range, as a recorder takes what says nothing else. */
export function film(pictures: readonly Float64Array[], rate: number): Buffer {
  const light = (one: number | undefined) => Math.max(0, Math.min(255, one as number));
  const frames = pictures.map((rgb) => {
    const count = kWide * kHigh;
    const bytes = Buffer.alloc(3 * count);
    for (let at = 0; at < count; ++at) {
      const r = light(rgb[3 * at]);
      const g = light(rgb[3 * at + 1]);
      const b = light(rgb[3 * at + 2]);
      const luma = 0.299 * r + 0.587 * g + 0.114 * b;
      bytes[at] = Math.round(16 + (219 * luma) / 255);
      bytes[count + at] = Math.round(128 + (224 * (b - luma)) / (1.772 * 255));
      bytes[2 * count + at] = Math.round(128 + (224 * (r - luma)) / (1.402 * 255));
    }
    return Buffer.concat([Buffer.from('FRAME\n'), bytes]);
  });
  return Buffer.concat([Buffer.from(`YUV4MPEG2 W${kWide} H${kHigh} F${rate}:1 Ip A1:1 C444\n`), ...frames]);
}
