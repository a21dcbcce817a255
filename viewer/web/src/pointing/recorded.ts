// Where people pointed while a case was recorded: all of it in short for the time line, and the points themselves a minute at a time as the clock comes near.
import { signal } from '@preact/signals';
import { get } from '@/api/client';
import type { RecordedPoint, Stroke } from '@/api/types';
import { kMinute, kSecond } from '@/base/time';
import { type Seen, seenAt } from '@/pointing/pointers';

const kTile_ns = kMinute;
/** An arrow is seen so long after its point; what is a little ahead is fetched before it is due. */
const kReach_ns = 2 * kSecond;

export class RecordedPointing {
  readonly strokes = signal<readonly Stroke[]>([]);
  /** Counts the tiles that came. */
  readonly version = signal(0);
  private readonly tiles = new Map<number, readonly RecordedPoint[] | 'asked'>();
  private readonly path: string;

  constructor(
    id: string,
    private readonly onProblem: (error: Error) => void,
  ) {
    this.path = `cases/${encodeURIComponent(id)}/pointing`;
    void this.tell(async () => {
      this.strokes.value = (await get<{ strokes: Stroke[] }>(this.path)).strokes;
    });
  }

  /** Arrows over the pictures of `stream` where the clock stands. */
  seen(stream: string, at_ns: number): Seen[] {
    const points = [at_ns - kReach_ns, at_ns, at_ns + kReach_ns].map((time_ns) => Math.floor(time_ns / kTile_ns));
    const near = [...new Set(points)].flatMap((tile) => this.tile(tile));
    return seenAt(near, stream, (one) => (at_ns - one.time_ns) / 1e6);
  }

  private tile(tile: number): readonly RecordedPoint[] {
    const known = this.tiles.get(tile);
    if (known === 'asked') return [];
    if (known) return known;
    const [from_ns, to_ns] = [tile * kTile_ns, (tile + 1) * kTile_ns];
    if (!this.strokes.value.some((one) => one.start_ns < to_ns && one.end_ns >= from_ns)) return [];
    this.tiles.set(tile, 'asked');
    void this.tell(async () => {
      const { points } = await get<{ points: RecordedPoint[] }>(`${this.path}/points?from_ns=${from_ns}&to_ns=${to_ns}`);
      this.tiles.set(tile, points);
      this.version.value++;
    });
    return [];
  }

  private async tell(action: () => Promise<void>): Promise<void> {
    try {
      await action();
    } catch (error) {
      this.onProblem(error instanceof Error ? error : new Error(String(error)));
    }
  }
}
