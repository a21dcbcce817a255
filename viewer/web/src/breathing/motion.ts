// How a lung's two moved groups move, as the server takes it, and what sliders make of it. Pure.

export type Vector = [number, number, number];

export interface GroupMotion {
  amplitude_mm: number;
  phase_s: number;
  /** Null: each node along its outward normal. */
  direction: Vector | null;
  baseline_mm: number;
  drift_mm_per_min: number;
}
export interface Motion {
  rib_cage: GroupMotion;
  diaphragm: GroupMotion;
  /** Null: the waveform was measured, or is told breath by breath. */
  cycle_s: number | null;
  /** A figure for each node of the surface (lung_surface.ts); null: as the model has them that was opened. */
  groups: string | null;
}

export const kGroups = ['rib_cage', 'diaphragm'] as const;
export type Group = (typeof kGroups)[number];
export const kNumbers = ['amplitude_mm', 'phase_s', 'baseline_mm', 'drift_mm_per_min'] as const;
export type NumberOfGroup = (typeof kNumbers)[number];

export interface Range {
  least: number;
  most: number;
  step: number;
}
const kUsual: Record<NumberOfGroup, Range> = {
  amplitude_mm: { least: -10, most: 30, step: 0.1 },
  phase_s: { least: -4, most: 4, step: 0.01 },
  baseline_mm: { least: -15, most: 15, step: 0.1 },
  drift_mm_per_min: { least: -20, most: 20, step: 0.1 },
};
const kCycle: Range = { least: 1, most: 10, step: 0.01 };

/** A slider's, widened where the model has more already. */
const holding = (range: Range, value: number): Range => ({ ...range, least: Math.min(range.least, value), most: Math.max(range.most, value) });
export const rangeOf = (name: NumberOfGroup, value: number): Range => holding(kUsual[name], value);
export const rangeOfCycle = (value: number): Range => holding(kCycle, value);

/** Up from the plane across the body, towards the head; and about the body, from the patient's left to the back. Degrees. */
export interface Angles {
  up_deg: number;
  about_deg: number;
}
const kDegrees = 180 / Math.PI;

/** At the poles, where any would do, `about_deg` is what it was. */
export function anglesOf([x, y, z]: Vector, about_deg = 0): Angles {
  const across = Math.hypot(x, y);
  return { up_deg: Math.atan2(z, across) * kDegrees, about_deg: across > 1e-9 ? Math.atan2(y, x) * kDegrees : about_deg };
}
export function directionOf({ up_deg, about_deg }: Angles): Vector {
  const across = Math.abs(up_deg) === 90 ? 0 : Math.cos(up_deg / kDegrees);
  return [across * Math.cos(about_deg / kDegrees), across * Math.sin(about_deg / kDegrees), Math.sin(up_deg / kDegrees)];
}
/** Where a direction begins that has none yet: the ribs go forwards, the diaphragm to the feet. */
export const kFirstDirection: Record<Group, Vector> = { rib_cage: [0, -1, 0], diaphragm: [0, 0, -1] };

export function withNumber(motion: Motion, group: Group, name: NumberOfGroup, value: number): Motion {
  return { ...motion, [group]: { ...motion[group], [name]: value } };
}
export function withDirection(motion: Motion, group: Group, direction: Vector | null): Motion {
  return { ...motion, [group]: { ...motion[group], direction } };
}
export const sameMotion = (one: Motion, other: Motion): boolean => JSON.stringify(one) === JSON.stringify(other);
