// A gamepad as two pointers: each stick moves one over the picture, the trigger on its side presses. Pure but for its own state.
import type { Pointer } from '@/training/training_api';
import { kBelowBorder, type Pointers } from '@/training/pointers';

/** What a browser's Gamepad says of itself; of the standard layout. */
export interface Pad {
  axes: readonly number[];
  buttons: readonly { readonly pressed: boolean; readonly value: number }[];
}

/** Sticks rest there, not at 0. */
export const kDeadZone = 0.15;
/** A trigger pressed less is not pressed. */
export const kPressed = 0.1;
/** At a stick's end, in pictures a second. */
const kSpeed = 0.4;
/** From a trigger that is just pressed to one that is pressed whole. */
const kPushOfTrigger_m = 0.03;
/** A page that was not shown for longer did not move anything meanwhile. */
const kLongestStep_s = 0.1;

const kLeftBumper = 4;
const kRightBumper = 5;
const kLeftTrigger = 6;
const kRightTrigger = 7;

const number = (value: number | undefined) => (value !== undefined && Number.isFinite(value) ? Math.min(1, Math.max(-1, value)) : 0);
const near = (value: number) => Math.min(1.5, Math.max(-0.5, value));

/** Nothing within the dead zone, whichever way the stick points; from its border on evenly up to the end. */
export function beyondDeadZone(x: number | undefined, y: number | undefined): { x: number; y: number } {
  const [to_x, to_y] = [number(x), number(y)];
  const length = Math.hypot(to_x, to_y);
  if (length <= kDeadZone) return { x: 0, y: 0 };
  const share = Math.min(1, (length - kDeadZone) / (1 - kDeadZone)) / length;
  return { x: to_x * share, y: to_y * share };
}

interface Side {
  id: 'pad-left' | 'pad-right';
  axis: number;
  trigger: number;
  bumper: number;
  pointer: Pointer;
  bumped: boolean;
}

export class GamepadHand {
  private readonly sides: Side[];

  /** The left stick has the whole hand at first, the right one its last finger; bumpers choose others. */
  constructor(
    private readonly pointers: Pointers,
    private readonly fingers: number,
  ) {
    const side = (id: Side['id'], axis: number, trigger: number, bumper: number, finger: number, x: number): Side => ({
      id,
      axis,
      trigger,
      bumper,
      pointer: { finger, x, y: kBelowBorder.y, push_m: 0 },
      bumped: false,
    });
    this.sides = [side('pad-left', 0, kLeftTrigger, kLeftBumper, fingers === 1 ? 1 : 0, 0.5), side('pad-right', 2, kRightTrigger, kRightBumper, fingers, 0.6)];
  }

  /** What the sticks point at, pressed or not. */
  get marks(): { x: number; y: number; finger: number; down: boolean }[] {
    return this.sides.map(({ id, pointer }) => ({ x: pointer.x, y: pointer.y, finger: pointer.finger, down: this.pointers.holds(id) }));
  }

  /** `seconds` after the step before; whether pointers that are down changed. */
  step(pad: Pad, seconds: number): boolean {
    let changed = false;
    for (const side of this.sides) changed = this.stepOf(side, pad, Math.min(seconds, kLongestStep_s)) || changed;
    return changed;
  }
  /** The gamepad is gone: its fingers come back. */
  release(): boolean {
    return this.sides.map(({ id }) => this.pointers.letGo(id)).some((was) => was);
  }

  private stepOf(side: Side, pad: Pad, seconds: number): boolean {
    const before = side.pointer;
    const bumped = pad.buttons[side.bumper]?.pressed ?? false;
    const finger = bumped && !side.bumped ? this.next(before.finger) : before.finger;
    side.bumped = bumped;
    const stick = beyondDeadZone(pad.axes[side.axis], pad.axes[side.axis + 1]);
    const value = number(pad.buttons[side.trigger]?.value);
    const down = value > kPressed;
    const push_m = down ? ((value - kPressed) / (1 - kPressed)) * kPushOfTrigger_m : 0;
    side.pointer = { finger, x: near(before.x + stick.x * kSpeed * seconds), y: near(before.y + stick.y * kSpeed * seconds), push_m };
    const now = side.pointer;
    if (!down) return this.pointers.letGo(side.id);
    const held = this.pointers.holds(side.id);
    if (held && finger === before.finger && now.x === before.x && now.y === before.y && now.push_m === before.push_m) return false;
    // What another pointer has already stays with it.
    return this.pointers.hold(side.id, now) || (held && this.pointers.letGo(side.id));
  }
  private next(finger: number): number {
    return finger >= this.fingers ? (this.fingers === 1 ? 1 : 0) : finger + 1;
  }
}

/** The first gamepad that is there. */
export const firstPad = (pads: readonly (Gamepad | null)[]): Gamepad | undefined => pads.find((pad): pad is Gamepad => pad !== null && pad.connected);
