// Which finger each pointer moves. What a browser says of mouse, pen, touch and keys becomes the trainer's pointers. Pure but for its own state.
import type { Pointer } from '@/training/training_api';

export const kMostPush_m = 0.08;
const kStep = 0.005;
const kPushStep_m = 0.002;
const kPushOfWheel_m = 0.00005;
/** From no pressure of a pen to all of it. */
const kPushOfPen_m = 0.03;
/** Where keys take hold of the organ: below its border. */
export const kBelowBorder = { x: 0.5, y: 0.66 };

export interface BrowserPointer {
  id: number;
  kind: 'mouse' | 'pen' | 'touch';
  x: number;
  y: number;
  pressure: number;
}

/** A pointer of the browser by its number, the keys, or a stick of a gamepad. */
type Holder = number | 'keys' | 'pad-left' | 'pad-right';

const limited = (value: number, most: number) => Math.min(most, Math.max(-most, value));
const near = (value: number) => Math.min(1.5, Math.max(-0.5, value));

export class Pointers {
  private readonly down = new Map<Holder, Pointer>();
  private byKeys: Pointer;

  constructor(private readonly fingers: number) {
    this.byKeys = { finger: this.hand, ...kBelowBorder, push_m: 0 };
  }

  get pointers(): Pointer[] {
    return [...this.down.values()];
  }
  get keysAreDown(): boolean {
    return this.down.has('keys');
  }

  /** A mouse moves all fingers, a touch point the first that is free; false where none is. */
  press(pointer: BrowserPointer): boolean {
    const finger = pointer.kind === 'touch' ? this.freeFinger() : this.down.size === 0 ? this.hand : undefined;
    if (finger === undefined) return false;
    this.down.set(pointer.id, { finger, x: near(pointer.x), y: near(pointer.y), push_m: this.pushOf(pointer) });
    return true;
  }
  move(pointer: BrowserPointer): boolean {
    const held = this.down.get(pointer.id);
    if (!held) return false;
    held.x = near(pointer.x);
    held.y = near(pointer.y);
    if (pointer.kind === 'pen') held.push_m = this.pushOf(pointer);
    return true;
  }
  release(id: number): boolean {
    return this.down.delete(id);
  }
  releaseAll(): void {
    this.down.clear();
  }
  /** Puts or moves a pointer of its own; false where another one has its finger, or fingers it would take. */
  hold(id: Holder, pointer: Pointer): boolean {
    if (!this.mayHave(id, pointer.finger)) return false;
    this.down.set(id, { ...pointer, push_m: limited(pointer.push_m, kMostPush_m) });
    return true;
  }
  holds(id: Holder): boolean {
    return this.down.has(id);
  }
  letGo(id: Holder): boolean {
    return this.down.delete(id);
  }
  /** Deeper where the wheel turns away from the person. */
  wheel(delta: number): boolean {
    for (const held of this.down.values()) held.push_m = limited(held.push_m - delta * kPushOfWheel_m, kMostPush_m);
    return this.down.size > 0;
  }

  /** Whether the key does something here. */
  key(key: string, large: boolean): boolean {
    const by = large ? 4 * kStep : kStep;
    const keys = this.byKeys;
    const digit = /^[0-5]$/.exec(key) ? Number(key) : undefined;
    if (digit !== undefined && digit <= this.fingers) {
      this.take(digit === 0 ? this.hand : digit);
      return true;
    }
    switch (key) {
      case ' ':
        if (this.down.delete('keys')) this.byKeys = { ...keys, push_m: 0 };
        else if (this.down.size === 0) this.down.set('keys', keys);
        return true;
      case 'ArrowLeft':
        keys.x = near(keys.x - by);
        return true;
      case 'ArrowRight':
        keys.x = near(keys.x + by);
        return true;
      case 'ArrowUp':
        keys.y = near(keys.y - by);
        return true;
      case 'ArrowDown':
        keys.y = near(keys.y + by);
        return true;
      case 'PageUp':
        keys.push_m = limited(keys.push_m + kPushStep_m, kMostPush_m);
        return true;
      case 'PageDown':
        keys.push_m = limited(keys.push_m - kPushStep_m, kMostPush_m);
        return true;
      default:
        return false;
    }
  }
  get keysAt(): Readonly<Pointer> {
    return this.byKeys;
  }

  /** One finger is a finger; several that move together are the hand. */
  private get hand(): number {
    return this.fingers === 1 ? 1 : 0;
  }
  private take(finger: number): void {
    if (!this.mayHave('keys', finger)) return;
    const held = this.down.delete('keys');
    this.byKeys = { ...this.byKeys, finger };
    if (held) this.down.set('keys', this.byKeys);
  }
  /** No finger has two pointers, and where the whole hand has one, none of its fingers has. */
  private mayHave(id: Holder, finger: number): boolean {
    return [...this.down].every(([other, held]) => other === id || (finger !== 0 && held.finger !== 0 && held.finger !== finger));
  }
  private freeFinger(): number | undefined {
    const taken = new Set(this.pointers.map((one) => one.finger));
    if (taken.has(0)) return undefined;
    for (let finger = 1; finger <= this.fingers; ++finger) if (!taken.has(finger)) return finger;
    return undefined;
  }
  private pushOf(pointer: BrowserPointer): number {
    return pointer.kind === 'pen' ? pointer.pressure * kPushOfPen_m : 0;
  }
}
