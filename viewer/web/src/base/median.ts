/** The middle of the newest times. */
export class Median {
  private readonly times: number[] = [];
  constructor(private readonly most = 200) {}
  add(time: number): void {
    this.times.push(time);
    if (this.times.length > this.most) this.times.shift();
  }
  get value(): number | undefined {
    const sorted = [...this.times].sort((a, b) => a - b);
    return sorted[sorted.length >> 1];
  }
}
