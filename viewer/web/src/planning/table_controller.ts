// What a person does on the picture becomes deeds: pointers, wheel and keys by the tool that is chosen. Draws nothing.
import { signal } from '@preact/signals';
import { Median } from '@/base/median';
import { CutHandles, type HandleName, type ShownCut, type ShownHandle } from '@/planning/cut_handles';
import { kFirstView, OrbitDrag, type View, viewByKey, zoomedByWheel } from '@/planning/orbit';
import { DrawnLine, type Pen, type Place, PlanPointers } from '@/planning/plan_pointers';
import { type Deed, PlanConnection, type PlanListener } from '@/planning/planning_api';

export const kTools = ['orbit', 'grasp', 'pinch', 'clip', 'cut', 'press'] as const;
export type Tool = (typeof kTools)[number];
export const kKeyOfTool: Record<Tool, string> = { orbit: 'o', grasp: 'g', pinch: 'j', clip: 'l', cut: 'c', press: 'p' };

export interface OnPicture extends Place {
  id: number;
  /** performance.now() of the browser's event. */
  at_ms: number;
  pan: boolean;
  pen?: Pen;
}

/** Cuts on the picture, the chosen handle, and where it is held. */
export interface Handles {
  cuts: readonly ShownCut[];
  chosen?: HandleName | undefined;
  held?: ShownHandle | undefined;
}

/** Latency is told of so many of the newest pictures. */
const kMeasured = 60;
const kRateOver_ms = 2000;
/** What jaws are apart after one press of a key or button, of what they were. */
const kCloser = 0.9;

export class TableController {
  readonly tool = signal<Tool>('orbit');
  readonly view = signal<View>(kFirstView);
  readonly line = signal<readonly Place[]>([]);
  readonly cursor = signal<Place | undefined>(undefined);
  readonly depth_m = signal(0.01);
  readonly cutDepth_m = signal(0.02);
  readonly handles = signal<Handles>({ cuts: [] });
  readonly stress = signal(false);
  readonly largest_pa = signal(5000);
  /** The newest deed that no picture shows yet was sent then. */
  readonly waitsSince_ms = signal<number | undefined>(undefined);

  private readonly connection: PlanConnection;
  private readonly orbit = new OrbitDrag();
  private readonly pointers = new PlanPointers();
  private readonly drawn = new DrawnLine();
  private readonly cutHandles = new CutHandles();
  private drawing: number | undefined;
  /** The slider has another depth than the last cut that was asked for. */
  private sliding = false;
  private readonly sent = new Map<number, number>();
  private readonly latency = new Median(kMeasured);
  private shown_ms: number[] = [];
  /** Those at the organ. */
  private jaws: { name: string; clips: boolean }[] = [];

  constructor(open: { plan: string; anew: boolean }, listener: PlanListener) {
    this.connection = new PlanConnection(open, {
      ...listener,
      moment: (moment, picture) => {
        listener.moment(moment, picture);
        this.jaws = moment.tools.filter((tool) => tool.jaws && !tool.jaws.left).map((tool) => ({ name: tool.name, clips: tool.kind === 'clip' }));
        this.cutHandles.show(moment.cuts, moment.input);
        this.showHandles();
        this.shown(moment.input);
      },
    });
  }
  leave(): void {
    this.connection.leave();
  }

  get latency_ms(): number | undefined {
    return this.latency.value;
  }
  get picturesPerSecond(): number {
    return (1000 * this.shown_ms.length) / kRateOver_ms;
  }
  private shown(input: number): void {
    const now_ms = performance.now();
    this.shown_ms = [...this.shown_ms.filter((at) => now_ms - at < kRateOver_ms), now_ms];
    const at_ms = this.sent.get(input);
    if (at_ms !== undefined) this.latency.add(now_ms - at_ms);
    for (const number of this.sent.keys()) if (number <= input) this.sent.delete(number);
    this.waitsSince_ms.value = [...this.sent.values()][0];
  }

  /** The deed's number; 0 where it could not be sent. */
  send(deed: Deed, at_ms = performance.now()): number {
    const number = this.connection.send(deed);
    if (number === 0) return 0;
    this.sent.set(number, at_ms);
    this.waitsSince_ms.value ??= at_ms;
    return number;
  }
  private sendPointers(at_ms: number): void {
    const tool = this.tool.value;
    this.send({ use: tool === 'press' || tool === 'pinch' || tool === 'clip' ? tool : 'grasp', pointers: this.pointers.pointers }, at_ms);
  }
  private look(view: View | undefined, at_ms: number): void {
    if (!view) return;
    this.view.value = view;
    this.send({ view }, at_ms);
  }
  lookFrom(view: View): void {
    this.look(view, performance.now());
  }

  choose(tool: Tool): void {
    this.letGo();
    this.chooseHandle(undefined);
    this.tool.value = tool;
    this.pointers.depth_m = tool === 'press' ? this.depth_m.value : 0;
    this.pointers.pensPush = tool === 'press';
  }
  /** All pointers go up. The handle that is chosen stays so, as its button may have the focus. */
  letGo(): void {
    this.orbit.releaseAll();
    this.forgetLine();
    this.putHandleBack();
    if (this.pointers.releaseAll()) this.sendPointers(performance.now());
  }
  setDepth(depth_m: number): void {
    this.depth_m.value = depth_m;
    if (this.tool.value !== 'press') return;
    this.pointers.depth_m = depth_m;
    if (this.pointers.isDown) this.sendPointers(performance.now());
  }
  showStress(shown: boolean, largest_pa = this.largest_pa.value): void {
    this.stress.value = shown;
    this.largest_pa.value = largest_pa;
    this.send({ stress: shown ? { largest_pa } : null });
  }

  /** Jaws closer together, or further apart. */
  close(tool: string, opens: boolean, at_ms = performance.now()): void {
    this.send({ close: { tool, share: opens ? 1 / kCloser : kCloser } }, at_ms);
  }

  press(at: OnPicture): boolean {
    switch (this.tool.value) {
      case 'orbit':
        return this.orbit.press(at.id, at.x, at.y);
      case 'cut':
        if (this.drawing !== undefined || this.cutHandles.isDragged) return false;
        this.chooseHandle(undefined);
        this.drawing = at.id;
        this.drawn.begin(at.x, at.y);
        this.line.value = this.drawn.places;
        return true;
      default:
        if (!this.pointers.press(at.id, at.x, at.y, at.pen)) return false;
        this.sendPointers(at.at_ms);
        return true;
    }
  }
  move(at: OnPicture): void {
    switch (this.tool.value) {
      case 'orbit':
        this.look(this.orbit.move(this.view.value, at.id, at.x, at.y, at.pan), at.at_ms);
        break;
      case 'cut':
        if (this.cutHandles.move(at.id, at.x, at.y)) this.showHandles();
        if (this.drawing === at.id && this.drawn.add(at.x, at.y)) this.line.value = this.drawn.places;
        break;
      default:
        if (this.pointers.move(at.id, at.x, at.y, at.pen)) this.sendPointers(at.at_ms);
    }
  }
  release(at: OnPicture): void {
    if (this.tool.value === 'orbit') this.orbit.release(at.id);
    else if (this.tool.value !== 'cut') {
      if (this.pointers.release(at.id)) this.sendPointers(at.at_ms);
    } else if (this.cutHandles.release(at.id)) {
      this.cutAnew(at.at_ms);
    } else if (this.drawing === at.id) {
      this.drawing = undefined;
      this.cutLine(at.at_ms);
    }
  }

  /** The browser took the pointer away, for a gesture of its own or a palm: nothing is cut by it. Tools let go as on release. */
  cancel(id: number, at_ms: number): void {
    if (this.tool.value === 'orbit') this.orbit.release(id);
    else if (this.tool.value !== 'cut') {
      if (this.pointers.release(id)) this.sendPointers(at_ms);
    } else if (this.cutHandles.cancel(id)) {
      this.showHandles();
    } else if (this.drawing === id) {
      this.forgetLine();
    }
  }
  private forgetLine(): void {
    this.drawing = undefined;
    this.drawn.take();
    this.line.value = [];
  }

  /** A pointer takes a handle, to drag it over the organ. */
  pressHandle(at: OnPicture, name: HandleName): boolean {
    if (this.drawing !== undefined) return false;
    this.finishDepth();
    const taken = this.cutHandles.press(at.id, at.x, at.y, name);
    this.showHandles();
    return taken;
  }
  /** While one is dragged, focus that moves chooses no other. */
  chooseHandle(name: HandleName | undefined): void {
    if (name && this.cutHandles.isDragged) return;
    this.finishDepth();
    this.cutHandles.choose(name);
    this.showHandles();
  }
  /** Of the chosen handle, by the slider: the cut is made anew with it by finishDepth(), or once another handle or a line is begun. */
  setHandleDepth(depth_m: number): void {
    this.sliding = true;
    this.cutHandles.setDepth(depth_m);
    this.showHandles();
  }
  finishDepth(): void {
    if (!this.sliding) return;
    this.sliding = false;
    this.cutAnew(performance.now());
  }
  putHandleBack(): void {
    this.sliding = false;
    this.cutHandles.putBack();
    this.showHandles();
  }
  /** Enter and space make the cut anew, Escape puts the handle back. */
  keyOfHandle(key: string, shift: boolean, at_ms: number): boolean {
    if (key === 'Enter' || key === ' ') this.cutAnew(at_ms);
    else if (key === 'Escape') this.putHandleBack();
    else if (!this.cutHandles.key(key, shift)) return false;
    this.showHandles();
    return true;
  }
  private showHandles(): void {
    const { asHeld, chosen, held } = this.cutHandles;
    this.handles.value = { cuts: asHeld, chosen, held };
  }
  private cutAnew(at_ms: number): void {
    const handle = this.cutHandles.deed;
    if (handle) this.cutHandles.wasSent(this.send({ handle }, at_ms));
    else if (!this.cutHandles.wasSentAlready) this.cutHandles.putBack();
    this.showHandles();
  }
  private cutLine(at_ms: number): void {
    const line = this.drawn.take();
    this.line.value = [];
    if (line) this.send({ cut: { line, depth_m: this.cutDepth_m.value } }, at_ms);
  }
  wheel(delta: number, turns: boolean, at_ms: number): void {
    if (this.tool.value === 'orbit' || this.tool.value === 'cut') this.look(zoomedByWheel(this.view.value, delta), at_ms);
    else if (this.pointers.wheel(delta, turns)) this.sendPointers(at_ms);
  }

  /** Keys on the picture; whether the key does something there. */
  key(key: string, shift: boolean, at_ms: number): boolean {
    if (this.tool.value === 'orbit') {
      const view = viewByKey(this.view.value, key, shift);
      this.look(view, at_ms);
      return view !== undefined;
    }
    if (this.tool.value === 'cut') return this.keyOfLine(key, shift, at_ms);
    if ((this.tool.value === 'pinch' || this.tool.value === 'clip') && (key === '-' || key === '+')) {
      const clips = this.tool.value === 'clip';
      for (const tool of this.jaws) if (tool.clips === clips) this.close(tool.name, key === '+', at_ms);
      return true;
    }
    if (this.tool.value === 'clip' && key === 'Enter') {
      this.letGo();
      for (const tool of this.jaws) if (tool.clips) this.send({ release: { tool: tool.name } }, at_ms);
      return true;
    }
    if (!this.pointers.key(key, shift)) return false;
    this.cursor.value = this.pointers.keysAt;
    this.sendPointers(at_ms);
    return true;
  }
  get keysAreDown(): boolean {
    return this.pointers.keysAreDown;
  }
  /** Space sets a place of the line, Enter cuts along it, Escape forgets it. */
  private keyOfLine(key: string, shift: boolean, at_ms: number): boolean {
    if (key === 'Enter') {
      this.cutLine(at_ms);
    } else if (key === 'Escape') {
      this.letGo();
      this.chooseHandle(undefined);
    } else if (key === ' ') {
      const { x, y } = this.pointers.keysAt;
      this.drawn.add(x, y);
      this.line.value = this.drawn.places;
    } else if (!key.startsWith('Arrow') || !this.pointers.key(key, shift)) {
      return false;
    }
    this.cursor.value = this.pointers.keysAt;
    return true;
  }
}
