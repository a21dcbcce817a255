// How far behind the newest picture a live video runs: as little as it does without stopping. Pure but for its own state; seconds, because that is what media
// elements speak.

/** Two pictures of 25 a second, and what their arrivals differ by on a quiet network. */
const kLeast = 0.1;
const kMost = 0.5;
/** Beyond its distance by this much a video is moved at once. */
const kJump = 0.3;
/** Within this the distance is let be: a picture comes at once or not at all. */
const kSlack = 0.05;
const kHurry = 1.1;
const kLinger = 0.95;
/** So long without a stop, and less distance is tried. */
const kCalmSeconds = 10;

export type Move = { kind: 'seek'; to: number } | { kind: 'rate'; rate: number };

export class LivePace {
  private distance = kLeast;
  private calmSince = 0;

  /** The video stood, since nothing was there to show. */
  stalled(now: number): void {
    this.distance = Math.min(kMost, this.distance * 1.5);
    this.calmSince = now;
  }

  /** What a video at `at` shall do, whose newest stretch of pictures is `start` to `end`; `now` is any clock. */
  step(at: number, start: number, end: number, now: number): Move {
    if (now - this.calmSince > kCalmSeconds) {
      this.distance = Math.max(kLeast, this.distance * 0.8);
      this.calmSince = now;
    }
    const behind = end - at;
    if (at < start || behind < -kJump || behind > this.distance + kJump) return { kind: 'seek', to: Math.max(start, end - this.distance) };
    if (behind > this.distance + kSlack) return { kind: 'rate', rate: kHurry };
    if (behind < this.distance - kSlack) return { kind: 'rate', rate: kLinger };
    return { kind: 'rate', rate: 1 };
  }
}
