// Who points where, and for how long it is seen. Pure.

export interface Pointer {
  by: string;
  role: string;
  stream: string;
  x: number;
  y: number;
}

/** An arrow stands for a second after its last point, then fades. */
export const kStands_ms = 1000;
export const kFades_ms = 500;
export const kSeen_ms = kStands_ms + kFades_ms;

export const opacityAt = (age_ms: number): number => Math.max(0, Math.min(1, (kSeen_ms - age_ms) / kFades_ms));

const kColors = 6;
/** The same colour for the same person everywhere: 0 to 5. */
export function colorOf(pointer: { by: string; role: string }): number {
  let sum = 0;
  for (const character of `${pointer.role} ${pointer.by}`) sum = (sum * 31 + (character.codePointAt(0) ?? 0)) % 997;
  return sum % kColors;
}

export const keyOf = ({ by, role, stream }: Pointer): string => `${role}\n${by}\n${stream}`;

export interface Seen extends Pointer {
  opacity: number;
}

/** The newest point of each person on `stream` that is still seen at `now`, `ageOf` telling how long ago each was, in milliseconds. */
export function seenAt<T extends Pointer>(points: Iterable<T>, stream: string, ageOf: (point: T) => number): Seen[] {
  const newest = new Map<string, Seen>();
  for (const point of points) {
    if (point.stream !== stream) continue;
    const age_ms = ageOf(point);
    if (age_ms < 0 || age_ms >= kSeen_ms) continue;
    newest.set(keyOf(point), { by: point.by, role: point.role, stream, x: point.x, y: point.y, opacity: opacityAt(age_ms) });
  }
  return [...newest.values()];
}
