// The case clock as the page shows it: a position that stands, or runs at a rate. What time it is comes from outside, so that it can be tested.

export class CaseClock {
  private position_ns: number;
  private anchor_ms: number | undefined; // undefined: it stands
  private rate_ = 1;

  constructor(
    readonly begin_ns: number,
    readonly end_ns: number,
  ) {
    this.position_ns = begin_ns;
  }

  get running(): boolean {
    return this.anchor_ms !== undefined;
  }

  get rate(): number {
    return this.rate_;
  }

  /** The position at `now_ms` (performance.now()), never past the case's end. */
  at(now_ms: number): number {
    if (this.anchor_ms === undefined) return this.position_ns;
    return this.clamp(this.position_ns + Math.round((now_ms - this.anchor_ms) * 1e6 * this.rate_));
  }

  run(now_ms: number): void {
    if (!this.running) this.anchor_ms = now_ms;
  }

  stand(now_ms: number): void {
    this.position_ns = this.at(now_ms);
    this.anchor_ms = undefined;
  }

  set(position_ns: number, now_ms: number): void {
    this.position_ns = this.clamp(position_ns);
    if (this.running) this.anchor_ms = now_ms;
  }

  setRate(rate: number, now_ms: number): void {
    this.set(this.at(now_ms), now_ms);
    this.rate_ = rate;
  }

  clamp(position_ns: number): number {
    return Math.max(this.begin_ns, Math.min(this.end_ns, Math.round(position_ns)));
  }
}
