// The handles of cuts on the picture: which one is chosen, and where it is to come before the cut is made anew. Pure but for its own state.
import type { Place } from '@/planning/plan_pointers';

export interface ShownHandle extends Place {
  depth_m: number;
  /** Behind the organ. */
  hidden: boolean;
}
/** A cut that was drawn: the step of the plan that makes it. */
export interface ShownCut {
  step: number;
  smooth: boolean;
  handles: ShownHandle[];
}
export interface HandleName {
  step: number;
  handle: number;
}
/** As the server takes it. */
export interface HandleDeed extends HandleName, Partial<Place> {
  depth_m?: number;
}

const kStep = 0.01;
const kDepthStep_m = 0.001;
const kLeastDepth_m = 0.001;
const kSameDepth_m = 1e-6;
const kSamePlace = 1e-6;
export const kMostDepth_m = 0.1;
/** A pointer that moves by less has chosen the handle, not moved it. */
const kMoves = 0.004;
const kFineSteps = 12;

const within = (value: number, least: number, most: number) => Math.min(most, Math.max(least, value));
const same = (one: HandleName | undefined, other: HandleName) => one?.step === other.step && one.handle === other.handle;

export class CutHandles {
  chosen: HandleName | undefined;
  private cuts: readonly ShownCut[] = [];
  private at: Place | undefined;
  private depth_m: number | undefined;
  private drag: { id: number; beside: Place; from: Place } | undefined;
  /** The deed that no picture shows yet. */
  private sent = 0;
  /** As `sent`, also once the handle was changed again or put back: until that picture comes the cut is not known. */
  private awaited = 0;

  /** The picture has these, and the deeds up to `input`. */
  show(cuts: readonly ShownCut[], input: number): void {
    this.cuts = cuts;
    // A pointer that has taken the handle again goes on with it.
    if (this.sent !== 0 && input >= this.sent) this.forget();
    if (input >= this.awaited) this.awaited = 0;
    if (this.chosen && !this.shown(this.chosen)) this.choose(undefined);
  }
  private shown(name: HandleName): ShownHandle | undefined {
    return this.cuts.find((cut) => cut.step === name.step)?.handles[name.handle];
  }
  /** All cuts with the chosen handle where it is to come. */
  get asHeld(): ShownCut[] {
    return this.cuts.map((cut) => ({
      ...cut,
      handles: cut.handles.map((handle, i) =>
        same(this.chosen, { step: cut.step, handle: i }) ? { ...handle, ...this.at, depth_m: this.depth_m ?? handle.depth_m } : handle,
      ),
    }));
  }
  /** Of the chosen handle. */
  get held(): ShownHandle | undefined {
    return this.chosen && this.asHeld.find((cut) => cut.step === this.chosen?.step)?.handles[this.chosen.handle];
  }
  get isHeld(): boolean {
    return this.at !== undefined || this.depth_m !== undefined;
  }

  choose(name: HandleName | undefined): void {
    if (name && same(this.chosen, name)) return;
    this.putBack();
    this.chosen = name;
  }
  /** To where the cut has it. */
  putBack(): void {
    this.forget();
    this.drag = undefined;
  }
  private forget(): void {
    this.at = undefined;
    this.depth_m = undefined;
    this.sent = 0;
  }
  get isDragged(): boolean {
    return this.drag !== undefined;
  }

  /** False for one that is not there, or behind the organ, and while another is dragged. */
  press(id: number, x: number, y: number, name: HandleName): boolean {
    if (this.drag) return false;
    this.choose(name);
    const handle = this.held;
    if (!handle || handle.hidden) return false;
    // A finger does not meet its middle, which is not to jump there.
    this.drag = { id, beside: { x: handle.x - x, y: handle.y - y }, from: { x, y } };
    return true;
  }
  move(id: number, x: number, y: number): boolean {
    if (this.drag?.id !== id) return false;
    const { beside, from } = this.drag;
    if (!this.at && Math.hypot(x - from.x, y - from.y) < kMoves) return false;
    this.at = { x: within(x + beside.x, 0, 1), y: within(y + beside.y, 0, 1) };
    this.sent = 0;
    return true;
  }
  /** Whether the pointer had moved it. */
  release(id: number): boolean {
    if (this.drag?.id !== id) return false;
    this.drag = undefined;
    return this.at !== undefined;
  }
  /** The browser took the pointer away: what it did is put back. Whether it had the handle. */
  cancel(id: number): boolean {
    if (this.drag?.id !== id) return false;
    this.putBack();
    return true;
  }
  setDepth(depth_m: number): void {
    const held = this.held;
    if (!held || Math.abs(depth_m - held.depth_m) < kSameDepth_m) return;
    this.depth_m = within(depth_m, kLeastDepth_m, kMostDepth_m);
    this.sent = 0;
  }
  /** Whether the key moves the chosen handle or changes its depth: arrows, Page Up and Page Down; with Shift further. */
  key(key: string, further: boolean): boolean {
    const handle = this.held;
    if (!handle) return false;
    const by = further ? 4 : 1;
    const moves: Record<string, [number, number]> = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by] };
    const move = moves[key];
    if (move) {
      if (handle.hidden) return true;
      this.sent = 0;
      this.at = { x: within(handle.x + kStep * move[0], 0, 1), y: within(handle.y + kStep * move[1], 0, 1) };
    } else if (key === 'PageUp' || key === 'PageDown') {
      this.setDepth(handle.depth_m + (key === 'PageUp' ? by : -by) * kDepthStep_m);
    } else {
      return false;
    }
    return true;
  }
  /** What is to be sent; undefined where the cut has it so, or that was sent already. */
  get deed(): HandleDeed | undefined {
    if (!this.chosen || this.sent !== 0) return undefined;
    const cut = this.awaited === 0 ? this.shown(this.chosen) : undefined;
    const { at, depth_m } = this;
    const moved = at && !(cut && Math.hypot(at.x - cut.x, at.y - cut.y) < kSamePlace);
    const deeper = depth_m !== undefined && !(cut && Math.abs(depth_m - cut.depth_m) < kSameDepth_m);
    if (!moved && !deeper) return undefined;
    return { ...this.chosen, ...(moved ? at : {}), ...(deeper ? { depth_m } : {}) };
  }
  get wasSentAlready(): boolean {
    return this.sent !== 0;
  }
  /** It was sent under that number, 0 for not at all: until a picture has it the handle stays where it was dragged to. */
  wasSent(number: number): void {
    if (number === 0) this.putBack();
    else this.sent = this.awaited = number;
  }
}

/** Places of a curve through others, as the picture shows it between them: a centripetal Catmull-Rom curve, or straight lines. */
export function curveThrough(places: readonly Place[], smooth: boolean): Place[] {
  if (!smooth || places.length < 2) return [...places];
  const mixed = (one: Place, other: Place, part: number): Place => ({ x: one.x + part * (other.x - one.x), y: one.y + part * (other.y - one.y) });
  const at = (i: number): Place => {
    const inside = within(i, 0, places.length - 1);
    const there = places[inside] as Place;
    // Beyond the ends it goes on as it came.
    return i === inside ? there : mixed(places[inside + (i < 0 ? 1 : -1)] as Place, there, 2);
  };
  const curve: Place[] = [];
  for (let i = 0; i + 1 < places.length; ++i) {
    const around = [at(i - 1), at(i), at(i + 1), at(i + 2)] as [Place, Place, Place, Place];
    const knots = [0];
    for (let k = 1; k < 4; ++k) {
      const [one, other] = [around[k - 1] as Place, around[k] as Place];
      knots.push((knots[k - 1] as number) + Math.max(Math.sqrt(Math.hypot(other.x - one.x, other.y - one.y)), 1e-6));
    }
    const [t0, t1, t2, t3] = knots as [number, number, number, number];
    for (let step = 0; step < kFineSteps; ++step) {
      const t = t1 + (step / kFineSteps) * (t2 - t1);
      const a = mixed(around[0], around[1], (t - t0) / (t1 - t0));
      const b = mixed(around[1], around[2], (t - t1) / (t2 - t1));
      const c = mixed(around[2], around[3], (t - t2) / (t3 - t2));
      const ab = mixed(a, b, (t - t0) / (t2 - t0));
      const bc = mixed(b, c, (t - t1) / (t3 - t1));
      curve.push(mixed(ab, bc, (t - t1) / (t2 - t1)));
    }
  }
  return [...curve, places[places.length - 1] as Place];
}
