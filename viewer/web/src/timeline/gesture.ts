// What pointers on the time line ask for. A mouse or a pen scrubs at once; a finger scrubs once it has moved sideways, so that a swipe up or down scrolls the
// page; two fingers zoom and move the window. Pure but for its own state; positions are pixels from the left of the plot.

/** A finger that moved no further was put down, not dragged. */
const kFingerSlack = 8;
const kMouseSlack = 2;

export interface TimelinePointer {
  id: number;
  kind: string;
  x: number;
  /** Shift is held. */
  selects: boolean;
}

export type Deed =
  /** Put down, or tapped: a mark nearby may be meant. */
  | { do: 'point'; x: number }
  | { do: 'scrub'; x: number }
  | { do: 'select'; from: number; to: number }
  /** Where two fingers were, and where they are. */
  | { do: 'pinch'; from: readonly [number, number]; to: readonly [number, number] };

type Mode = 'none' | 'waits' | 'scrubs' | 'selects' | 'pinches' | 'over';

export class Gesture {
  private readonly down = new Map<number, number>();
  private mode: Mode = 'none';
  private from = 0;
  private moved = false;

  /** `atOnce`: a finger scrubs as a mouse does, where nothing beside it is scrolled and nothing is zoomed. */
  constructor(private readonly atOnce: boolean) {}

  get isHeld(): boolean {
    return this.down.size > 0;
  }

  press({ id, kind, x, selects }: TimelinePointer): Deed | undefined {
    this.down.set(id, x);
    if (this.down.size > 1) {
      this.mode = this.atOnce || this.down.size > 2 ? 'over' : 'pinches';
      return undefined;
    }
    this.from = x;
    this.moved = false;
    if (kind === 'touch' && !this.atOnce) {
      this.mode = 'waits';
      return undefined;
    }
    this.mode = selects ? 'selects' : 'scrubs';
    return selects ? undefined : { do: 'point', x };
  }

  move(id: number, x: number): Deed | undefined {
    if (!this.down.has(id)) return undefined;
    const before = [...this.down.values()];
    this.down.set(id, x);
    switch (this.mode) {
      case 'waits':
        if (Math.abs(x - this.from) <= kFingerSlack) return undefined;
        this.mode = 'scrubs';
        this.moved = true;
        return { do: 'scrub', x };
      case 'scrubs':
        if (!this.moved && Math.abs(x - this.from) <= kMouseSlack) return undefined;
        this.moved = true;
        return { do: 'scrub', x };
      case 'selects':
        return x === this.from ? undefined : { do: 'select', from: Math.min(x, this.from), to: Math.max(x, this.from) };
      case 'pinches': {
        const after = [...this.down.values()];
        return { do: 'pinch', from: before as [number, number], to: after as [number, number] };
      }
      default:
        return undefined;
    }
  }

  release(id: number): Deed | undefined {
    const tapped = this.down.delete(id) && this.mode === 'waits';
    this.settle();
    return tapped ? { do: 'point', x: this.from } : undefined;
  }

  /** The browser took the pointer, as for scrolling: nothing was asked for. */
  cancel(id: number): void {
    this.down.delete(id);
    this.settle();
  }

  /** After two fingers the one that stays asks for nothing. */
  private settle(): void {
    this.mode = this.down.size === 0 ? 'none' : 'over';
  }
}
