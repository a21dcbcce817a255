// A clock elsewhere, by what it said and how long asking took (RFC 5905, section 8, from one side).

const kKept = 30;

export class RemoteClock {
  private readonly samples: { offset_ms: number; trip_ms: number }[] = [];

  /** It said `said_ns`, in an answer to what was asked at `sent_ms` and came at `received_ms` of this machine's clock. */
  add(said_ns: number, sent_ms: number, received_ms: number): void {
    const offset_ms = said_ns / 1e6 - (sent_ms + received_ms) / 2;
    // Another case has begun: what was learned belongs to the old one.
    const known = this.best();
    if (known && Math.abs(known.offset_ms - offset_ms) > known.trip_ms + (received_ms - sent_ms) + 50) this.samples.length = 0;
    this.samples.push({ offset_ms, trip_ms: received_ms - sent_ms });
    if (this.samples.length > kKept) this.samples.shift();
  }

  /** What it shows when this machine's clock shows `now_ms`; nothing before it was asked. Wrong by half of the shortest answer's time at most. */
  at(now_ms: number): number | undefined {
    const known = this.best();
    return known ? (now_ms + known.offset_ms) * 1e6 : undefined;
  }

  private best(): { offset_ms: number; trip_ms: number } | undefined {
    return this.samples.reduce<{ offset_ms: number; trip_ms: number } | undefined>(
      (least, one) => (least === undefined || one.trip_ms <= least.trip_ms ? one : least),
      undefined,
    );
  }
}
