// Keeping several videos on one case clock. Pure functions; seconds, because that is what media elements speak.

/** Beyond this a video is moved there at once instead of hurrying. */
export const kHardSeekSeconds = 0.5;
/** Within this a video is left alone: a third of a frame at 60 frames a second. */
export const kDeadBandSeconds = 0.005;
/** How fast an offset is worked off: a tenth of a second of offset changes the rate by a fifth. */
const kGain = 2;
const kLargestChange = 0.25;

export type Correction = { kind: 'seek' } | { kind: 'rate'; rate: number };

/**
 * What a video that is `offset` seconds ahead of the case clock (behind: negative) shall do while the clock runs at `rate`. `correcting`: it was being
 * corrected already; then it is brought to the middle of the dead band, so that it does not dither at its edge.
 */
export function correction(offset: number, rate: number, correcting: boolean): Correction {
  if (Math.abs(offset) > kHardSeekSeconds) return { kind: 'seek' };
  if (Math.abs(offset) <= (correcting ? kDeadBandSeconds / 4 : kDeadBandSeconds)) return { kind: 'rate', rate };
  const change = Math.max(-kLargestChange, Math.min(kLargestChange, -offset * kGain));
  return { kind: 'rate', rate: rate * (1 + change) };
}

export const kSpeeds: readonly number[] = [0.1, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 2, 4, 8];

/** The speed next to `rate`, one up (+1) or down (-1); stays at the ends. */
export function nextSpeed(rate: number, step: 1 | -1): number {
  if (step > 0) return kSpeeds.find((speed) => speed > rate + 1e-9) ?? rate;
  return kSpeeds.findLast((speed) => speed < rate - 1e-9) ?? rate;
}
