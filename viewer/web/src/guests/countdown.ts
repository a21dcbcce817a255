// How long an invitation lasts, counted on this machine from what the server said. Pure.

export class Countdown {
  private readonly ends_ms: number;

  /** The server said `left_s` at `now_ms` of this machine's clock. */
  constructor(left_s: number, now_ms: number) {
    this.ends_ms = now_ms + left_s * 1000;
  }

  left_s(now_ms: number): number {
    return Math.max(0, Math.ceil((this.ends_ms - now_ms) / 1000));
  }
}

/** "59:07", or "1:02:03" from an hour on. */
export function clockFace(seconds: number): string {
  const two = (value: number) => String(value).padStart(2, '0');
  const minutes = Math.floor(seconds / 60);
  return minutes < 60 ? `${minutes}:${two(seconds % 60)}` : `${Math.floor(minutes / 60)}:${two(minutes % 60)}:${two(seconds % 60)}`;
}

/** Minutes before the end at which it is said aloud, and whether one was passed between two looks. */
const kSaid_s = [600, 300, 60];
export function passedWarning(before_s: number, now_s: number): number | undefined {
  const passed = kSaid_s.find((at) => before_s > at && now_s <= at);
  return passed === undefined ? undefined : passed / 60;
}
