// Where the endoscope's lens shows in the recorded picture what a camera without distortion sees. Pure; as sim/render/lens.cpp, which has the last word.
import type { OrganAlignment } from '@/api/types';

export type OrganLens = NonNullable<OrganAlignment['lens']>;

/** Of a place at distance 1 before the camera, x to the right, y down: pixels from the left upper corner of a picture of that size. */
export function shownAt(lens: OrganLens, x: number, y: number, width: number, height: number): [number, number] {
  const radius = Math.hypot(x, y);
  // Beyond what the picture shows evenly outwards: the polynomial would fold back there.
  const beyond = Math.max(1, radius / lens.reach);
  const [u, v] = distorted(lens, x / beyond, y / beyond);
  const pixel = (axis: 0 | 1, place: number) => beyond * place * lens.focal_px[axis] + lens.middle_px[axis] + 0.5;
  return [(pixel(0, u) / lens.width) * width, (pixel(1, v) / lens.height) * height];
}

function distorted({ model, coefficients }: OrganLens, x: number, y: number): [number, number] {
  const [a, b, c, d, e] = coefficients;
  const square = x * x + y * y;
  if (model === 'fisheye') {
    const radius = Math.sqrt(square);
    const angle = Math.atan(radius);
    const turned = angle * angle;
    const scale = radius > 0 ? (angle / radius) * (1 + turned * (a + turned * (b + turned * (c + turned * d)))) : 1;
    return [scale * x, scale * y];
  }
  const scale = 1 + square * (a + square * (b + square * e));
  return [scale * x + 2 * c * x * y + d * (square + 2 * x * x), scale * y + c * (square + 2 * y * y) + 2 * d * x * y];
}
