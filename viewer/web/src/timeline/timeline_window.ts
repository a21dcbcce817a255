// The stretch of a case that the time line shows: one window, which the overview frames and the lanes draw. Owned by the case view.
import { signal } from '@preact/signals';
import type { Span } from '@/base/spans';
import { following, panned, pinched, zoomed } from '@/timeline/scale';

export const kZoomStep = 1.6;

export class TimelineWindow {
  readonly shown;
  /** While a hand holds it the window does not turn over by itself. */
  isHeld = false;

  constructor(readonly whole: Span) {
    this.shown = signal<Span>(whole);
  }

  /** `factor` < 1 looks closer; `about_ns` stays where it is, or the nearest time that is shown. */
  zoom(factor: number, about_ns: number): void {
    const now = this.shown.peek();
    this.shown.value = zoomed(now, this.whole, factor, Math.max(now.start_ns, Math.min(now.end_ns, about_ns)));
  }

  /** By a share of the width. */
  pan(share: number): void {
    const now = this.shown.peek();
    this.shown.value = panned(now, this.whole, share * (now.end_ns - now.start_ns));
  }

  pinch(from: readonly [number, number], to: readonly [number, number], width: number): void {
    this.shown.value = pinched(this.shown.peek(), this.whole, from, to, width);
  }

  showAll(): void {
    this.shown.value = this.whole;
  }

  follow(at_ns: number): void {
    const turned = following(this.shown.peek(), this.whole, at_ns);
    if (turned !== this.shown.peek()) this.shown.value = turned;
  }
}
