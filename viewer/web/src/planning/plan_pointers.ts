// Which pointers are down on the picture while one grasps or presses: mouse, pen, touch points, and one that keys move. Pure but for its own state.

export interface Place {
  x: number;
  y: number;
}
/** As the server takes it. */
export interface PlanPointer extends Place {
  id: number;
  push_m: number;
  turn_deg: number;
  /** How far the end of the tool towards the eye leans to the right and downwards. */
  lean_x_deg: number;
  lean_y_deg: number;
}

export const kMostPointers = 5;
const kMostPush_m = 0.2;
const kPushOfWheel_m = 0.00005;
const kPushStep_m = 0.002;
/** Of a pen that presses as hard as it can. */
const kPushOfPen_m = 0.02;
const kTurnOfWheel_deg = 0.05;
const kTurnStep_deg = 5;
const kMostTurn_deg = 36_000;
const kStillOfPen_deg = 5;
const kStep = 0.01;
const kMiddle: Place = { x: 0.5, y: 0.5 };

const near = (value: number) => Math.min(1.5, Math.max(-0.5, value));
const turnable = (turn_deg: number) => Math.min(kMostTurn_deg, Math.max(-kMostTurn_deg, turn_deg));
/** From one twist of a pen, 0 to 359 degrees, to another, the shorter way. */
const twisted = (from_deg: number, to_deg: number) => ((to_deg - from_deg + 540) % 360) - 180;
/** How far a pen is tilted from where it came down. It is never held quite still: what is little counts nothing. */
const leant = (from_deg: number, to_deg: number) => {
  const by_deg = to_deg - from_deg;
  return Math.sign(by_deg) * Math.max(0, Math.abs(by_deg) - kStillOfPen_deg);
};
const limited = (push_m: number) => Math.min(kMostPush_m, Math.max(-kMostPush_m, push_m));

/** What a pen tells beside its place: its twist from 0 to 359 degrees, how hard it presses, from 0 to 1, and how far it is tilted to the right and towards the person. */
export interface Pen {
  twist_deg: number;
  pressure: number;
  tilt_x_deg: number;
  tilt_y_deg: number;
}
const kNoPen: Pen = { twist_deg: 0, pressure: 0, tilt_x_deg: 0, tilt_y_deg: 0 };

interface Down extends Place {
  id: number;
  extra_m: number;
  turn_deg: number;
  pen: Pen;
  cameDown: Pen;
}

/** `depth_m`: how deep each pointer pushes from the beginning; `pensPush`: a pen pushes as hard as it presses, too. */
export class PlanPointers {
  depth_m = 0;
  pensPush = false;
  keysAt: Place = kMiddle;
  private readonly down = new Map<number | 'keys', Down>();
  private last = 0;

  get pointers(): PlanPointer[] {
    return [...this.down.values()].map(({ id, x, y, extra_m, turn_deg, pen, cameDown }) => ({
      id,
      x,
      y,
      push_m: limited(this.depth_m + extra_m + (this.pensPush ? pen.pressure * kPushOfPen_m : 0)),
      turn_deg,
      lean_x_deg: leant(cameDown.tilt_x_deg, pen.tilt_x_deg),
      lean_y_deg: leant(cameDown.tilt_y_deg, pen.tilt_y_deg),
    }));
  }
  get keysAreDown(): boolean {
    return this.down.has('keys');
  }
  get isDown(): boolean {
    return this.down.size > 0;
  }

  /** False where five are down already. */
  press(id: number | 'keys', x: number, y: number, pen = kNoPen): boolean {
    if (this.down.size === kMostPointers || this.down.has(id)) return false;
    this.down.set(id, { id: ++this.last, x: near(x), y: near(y), extra_m: 0, turn_deg: 0, pen, cameDown: pen });
    return true;
  }
  move(id: number, x: number, y: number, pen = kNoPen): boolean {
    const held = this.down.get(id);
    if (!held) return false;
    held.x = near(x);
    held.y = near(y);
    held.turn_deg = turnable(held.turn_deg + twisted(held.pen.twist_deg, pen.twist_deg));
    held.pen = pen;
    return true;
  }
  release(id: number): boolean {
    return this.down.delete(id);
  }
  releaseAll(): boolean {
    const any = this.isDown;
    this.down.clear();
    return any;
  }
  /** Deeper where the wheel turns away from the person; clockwise where it turns towards them and `turns`. */
  wheel(delta: number, turns: boolean): boolean {
    return turns ? this.turn(delta * kTurnOfWheel_deg) : this.push(-delta * kPushOfWheel_m);
  }

  /** Whether the key does something here: arrows move, space comes down and goes up, Page Up and Page Down push, comma and full stop turn. */
  key(key: string, further: boolean): boolean {
    const by = further ? 4 * kStep : kStep;
    switch (key) {
      case ' ':
        if (!this.down.delete('keys')) this.press('keys', this.keysAt.x, this.keysAt.y);
        return true;
      case 'ArrowLeft':
        return this.moveKeys(-by, 0);
      case 'ArrowRight':
        return this.moveKeys(by, 0);
      case 'ArrowUp':
        return this.moveKeys(0, -by);
      case 'ArrowDown':
        return this.moveKeys(0, by);
      case 'PageUp':
        this.push(kPushStep_m);
        return true;
      case 'PageDown':
        this.push(-kPushStep_m);
        return true;
      case ',':
        this.turn(-kTurnStep_deg);
        return true;
      case '.':
        this.turn(kTurnStep_deg);
        return true;
      default:
        return false;
    }
  }

  private moveKeys(dx: number, dy: number): boolean {
    this.keysAt = { x: near(this.keysAt.x + dx), y: near(this.keysAt.y + dy) };
    const held = this.down.get('keys');
    if (held) Object.assign(held, this.keysAt);
    return true;
  }
  private turn(by_deg: number): boolean {
    for (const held of this.down.values()) held.turn_deg = turnable(held.turn_deg + by_deg);
    return this.isDown;
  }
  private push(by_m: number): boolean {
    for (const held of this.down.values()) held.extra_m = limited(held.extra_m + by_m);
    return this.isDown;
  }
}

/** A line that is drawn over the organ: no two places nearer than a two hundredth of the picture. */
export class DrawnLine {
  places: Place[] = [];

  begin(x: number, y: number): void {
    this.places = [{ x: near(x), y: near(y) }];
  }
  /** Whether the place is in the line now. */
  add(x: number, y: number): boolean {
    const last = this.places[this.places.length - 1];
    const place = { x: near(x), y: near(y) };
    if (last && Math.hypot(place.x - last.x, place.y - last.y) < 0.005) return false;
    if (this.places.length === 1000) return false;
    this.places = [...this.places, place];
    return true;
  }
  /** The line, which is empty then; undefined where it goes nowhere. */
  take(): Place[] | undefined {
    const line = this.places;
    this.places = [];
    return line.length < 2 ? undefined : line;
  }
}
