// Picking while it is done: the archived picture of the recording and the plan's picture of the same moment, how the points that were picked so far
// register a camera, and what is chosen. What was picked is the matching's (matching_model.ts), with its way back.
import { computed, effect, type Signal, signal } from '@preact/signals';
import { cases } from '@/api/client';
import type { JudgedPoints, PickingCamera, PickingView, Preparing } from '@/api/types';
import type { MatchingModel } from '@/compare/matching_model';
import {
  clicked,
  type CompletePair,
  completePairs,
  leastPairs,
  moved,
  type OrganPoint,
  type Pair,
  type Picks,
  picked,
  type PictureSize,
  type Pixel,
  pixelAt,
  type Place,
  withoutClick,
  withoutPair,
} from '@/compare/picks';
import { planAt } from '@/compare/plan_map';
import type { Playback } from '@/media/playback';
import { kFirstView, type View } from '@/planning/orbit';

/** What is being said by hand. */
export const kWorks = ['steps', 'points', 'tools', 'xray'] as const;
export type Work = (typeof kWorks)[number];

const kSettle_ms = 120;
const kAskEvery_ms = 400;
/** As wide is the plan's picture at most; while it is turned, a part of that. */
const kWidest = 720;
const kWhileTurned = 0.5;

export interface RecordedFrame extends PictureSize {
  time_ns: number;
  picture: ImageBitmap;
}

export interface PlanPicture {
  /** Of a JPEG, as a data: address. */
  address: string;
  camera: PickingCamera;
  view: PickingView;
}

const isPreparing = (answer: object): answer is Preparing => 'doing' in answer;
const waited = (ms: number) => new Promise((resolve) => setTimeout(resolve, ms));

export class PickingModel {
  readonly work: Signal<Work> = signal('steps');
  readonly view: Signal<View> = signal(kFirstView);
  readonly frame: Signal<RecordedFrame | undefined> = signal(undefined);
  readonly planPicture: Signal<PlanPicture | undefined> = signal(undefined);
  /** What the server does before there are pictures of the plan. */
  readonly preparing: Signal<Preparing | undefined> = signal(undefined);
  /** Why there is no picture of the plan. */
  readonly planProblem: Signal<string | undefined> = signal(undefined);
  readonly judged: Signal<JudgedPoints | undefined> = signal(undefined);
  readonly chosenPair: Signal<number | undefined> = signal(undefined);
  readonly tool = signal('');
  readonly isOpen = computed(() => this.matching.plan.value !== undefined && (this.work.value === 'points' || this.work.value === 'tools'));
  /** Where the plan is in the picture that points are picked on; nothing while no step is matched. */
  readonly moment = computed(() => {
    const map = this.matching.map.value;
    const at_ns = this.matching.picks.value.at?.time_ns ?? this.frame.value?.time_ns;
    return map && at_ns !== undefined ? planAt(map, at_ns) : undefined;
  });
  /** Whether the steps were matched otherwise since the first point was picked, so that the organ may lie elsewhere now. */
  readonly isOfAnotherMoment = computed(() => {
    const at = this.matching.picks.value.at;
    const moment = this.moment.value;
    return at !== null && moment !== undefined && Math.abs(moment.plan_s - at.plan_s) > 0.01;
  });
  private turning = false;
  private drawing = false;
  private again = false;
  private closed = false;
  private judging = 0;
  private asking: Promise<unknown> = Promise.resolve();
  private frameRequest: AbortController | undefined;
  private readonly unfollow: (() => void)[];

  constructor(
    private readonly caseId: string,
    private readonly matching: MatchingModel,
    private readonly playback: Playback,
    private readonly onProblem: (error: Error) => void,
  ) {
    let timer: ReturnType<typeof setTimeout> | undefined;
    this.unfollow = [
      // The archived picture where the clock stands; once points were picked, that which they are of.
      effect(() => {
        clearTimeout(timer);
        if (!this.isOpen.value || playback.playing.value) return;
        const pinned_ns = this.work.value === 'points' ? this.matching.picks.value.at?.time_ns : undefined;
        const at_ns = pinned_ns ?? playback.position_ns.value;
        if (this.frame.peek()?.time_ns !== at_ns) timer = setTimeout(() => void this.fetchFrame(at_ns, 0), kSettle_ms);
      }),
      effect(() => {
        const isWanted = this.isOpen.value && this.work.value === 'points' && this.moment.value !== undefined && this.frame.value !== undefined;
        void this.view.value;
        if (isWanted) void this.draw();
      }),
      effect(() => {
        const picks = this.matching.picks.value;
        const points = completePairs(picks);
        const frame = this.frame.value;
        // What was said of other points, or of these in another picture, is said of them no more.
        this.judged.value = undefined;
        const mine = ++this.judging;
        if (this.isOpen.value && this.work.value === 'points' && frame && points.length >= leastPairs(picks))
          void this.judge(mine, points, frame, picks.field_deg);
      }),
      effect(() => {
        const plan = this.matching.plan.value;
        this.tool.value = plan?.tools[0] ?? '';
        this.work.value = 'steps';
        this.chosenPair.value = undefined;
      }),
      () => clearTimeout(timer),
    ];
  }

  close(): void {
    this.closed = true;
    this.frameRequest?.abort();
    for (const one of this.unfollow) one();
  }

  /** The recorded picture before or after the one that is seen; false where points were picked, which are all of one picture. */
  step(by: -1 | 1): boolean {
    if (this.work.peek() === 'points' && this.matching.picks.peek().at) return false;
    const frame = this.frame.peek();
    this.playback.pause();
    if (frame) void this.fetchFrame(frame.time_ns, by);
    return true;
  }

  /** Asks anew for the plan's picture that could not be had. */
  retry(): void {
    void this.draw();
  }

  turn(view: View, isHeld: boolean): void {
    this.turning = isHeld;
    this.view.value = view;
  }
  /** The hand lets go: the picture as large as it can be. */
  letGo(): void {
    if (!this.turning) return;
    this.turning = false;
    void this.draw();
  }

  /** A place in the recorded picture; false where none can be picked there now. */
  pickPixel(place: Place): boolean {
    const frame = this.frame.peek();
    if (!frame) return false;
    if (this.work.peek() === 'tools') {
      this.matching.pick(clicked(this.matching.picks.peek(), this.tool.peek(), { at_ns: frame.time_ns, pixel: pixelAt(place, frame) }));
      return true;
    }
    return this.add('pixel', pixelAt(place, frame));
  }
  /** A place in the plan's picture; false beside the organ. */
  async pickOrgan(place: Place): Promise<boolean> {
    const organ = await this.organAt(place);
    return organ !== undefined && this.add('organ', organ);
  }
  movePixel(pair: number, place: Place): void {
    const frame = this.frameOfPoints();
    if (frame) this.matching.pick(moved(this.matching.picks.peek(), 'pixel', pair, pixelAt(place, frame)));
  }
  async moveOrgan(pair: number, place: Place): Promise<boolean> {
    const organ = await this.organAt(place);
    if (organ && this.matching.picks.peek().pairs[pair]) this.matching.pick(moved(this.matching.picks.peek(), 'organ', pair, organ));
    return organ !== undefined;
  }
  removePair(pair: number): void {
    this.matching.pick(withoutPair(this.matching.picks.peek(), pair));
    this.chosenPair.value = undefined;
  }
  removeClick(tool: string, at_ns: number): void {
    this.matching.pick(withoutClick(this.matching.picks.peek(), tool, at_ns));
  }
  /** What the delete key is about: the chosen point, or the click in the picture that is seen. */
  removeChosen(): boolean {
    const { pairs, clicks } = this.matching.picks.peek();
    const pair = this.chosenPair.peek();
    const at_ns = this.frame.peek()?.time_ns;
    if (this.work.peek() === 'points' && pair !== undefined && pairs[pair]) this.removePair(pair);
    else if (this.work.peek() === 'tools' && clicks.get(this.tool.peek())?.some((one) => one.at_ns === at_ns))
      this.removeClick(this.tool.peek(), at_ns as number);
    else return false;
    return true;
  }
  sayField(field_deg: number | null): void {
    this.matching.pick({ ...this.matching.picks.peek(), field_deg });
  }

  /** The picture that is seen, unless another is on its way to which the points belong. */
  private frameOfPoints(): RecordedFrame | undefined {
    const frame = this.frame.peek();
    const at = this.matching.picks.peek().at;
    return at && frame?.time_ns !== at.time_ns ? undefined : frame;
  }

  private add<S extends keyof Pair>(side: S, place: S extends 'pixel' ? Pixel : OrganPoint): boolean {
    const frame = this.frameOfPoints();
    const moment = this.moment.peek();
    if (!frame || !moment) return false;
    const at: NonNullable<Picks['at']> = { time_ns: frame.time_ns, plan_s: moment.plan_s };
    const { picks, pair } = picked(this.matching.picks.peek(), side, place as NonNullable<Pair[S]>, at, this.chosenPair.peek());
    this.chosenPair.value = pair;
    this.matching.pick(picks);
    return true;
  }

  private async fetchFrame(at_ns: number, step: -1 | 0 | 1): Promise<void> {
    const stream = this.matching.plan.peek()?.stream;
    if (stream === undefined) return;
    this.frameRequest?.abort();
    const request = new AbortController();
    this.frameRequest = request;
    try {
      const { time_ns, picture } = await cases.frame(this.caseId, stream, at_ns, step, request.signal);
      const bitmap = await createImageBitmap(picture);
      if (request.signal.aborted) return;
      this.frame.value = { time_ns, picture: bitmap, width: bitmap.width, height: bitmap.height };
      if (step !== 0) this.playback.seek(time_ns);
    } catch (error) {
      if (!request.signal.aborted) this.tell(error);
    }
  }

  private wantedView(share: number): PickingView | undefined {
    const frame = this.frame.peek();
    const moment = this.moment.peek();
    if (!frame || !moment) return undefined;
    // As wide and high as the recording's, so that both can be seen as one.
    const scale = Math.min(1, kWidest / frame.width) * share;
    const side = (pixels: number) => Math.max(64, Math.round(pixels * scale));
    return { step: moment.step, plan_s: moment.plan_s, ...this.view.peek(), width: side(frame.width), height: side(frame.height) };
  }

  private isAsked(): boolean {
    return !this.closed && this.isOpen.peek();
  }

  /**
   * One question at a time: the plan's program answers no two at once, and the appliance lets few wait. `ask` is called when its turn comes, and asks nothing
   * where nobody needs the answer any more.
   */
  private inTurn<T>(ask: () => Promise<T> | undefined): Promise<T | undefined> {
    const answer = this.asking.then(() => (this.isAsked() ? ask() : undefined));
    this.asking = answer.catch(() => undefined);
    return answer;
  }

  /** Asks until the plan is carried out; undefined where nobody needs the answer any more. */
  private async answered<T extends object>(ask: () => Promise<T | Preparing> | undefined): Promise<T | undefined> {
    try {
      for (;;) {
        const answer = await this.inTurn(ask);
        if (answer === undefined || !this.isAsked()) return undefined;
        if (!isPreparing(answer)) return answer;
        this.preparing.value = answer;
        await waited(kAskEvery_ms);
      }
    } finally {
      this.preparing.value = undefined;
    }
  }

  /** One picture at a time, of what is wanted when its turn comes; what changed since is in the next. */
  private async draw(): Promise<void> {
    this.again = true;
    if (this.drawing) return;
    this.drawing = true;
    this.planProblem.value = undefined;
    try {
      while (this.again && this.isAsked()) {
        let view: PickingView | undefined;
        const answer = await this.answered(() => {
          this.again = false;
          view = this.wantedView(this.turning ? kWhileTurned : 1);
          return view && cases.planPicture(this.caseId, view);
        });
        if (answer && view) this.planPicture.value = { address: `data:image/jpeg;base64,${answer.jpeg}`, camera: answer.camera, view };
      }
    } catch (error) {
      if (error instanceof Error) this.planProblem.value = error.message;
    } finally {
      this.drawing = false;
    }
  }

  private async organAt(place: Place): Promise<OrganPoint | undefined> {
    const view = this.planPicture.peek()?.view;
    if (!view) return undefined;
    try {
      return (await this.answered(() => cases.organPoint(this.caseId, view, place.x, place.y)))?.organ ?? undefined;
    } catch (error) {
      this.tell(error);
      return undefined;
    }
  }

  private async judge(mine: number, points: readonly CompletePair[], frame: PictureSize, field_deg: number | null): Promise<void> {
    try {
      await waited(kSettle_ms);
      if (mine !== this.judging) return;
      const said = { width: frame.width, height: frame.height, points, ...(field_deg === null ? {} : { field_deg }) };
      const judged = await this.answered(() => (mine === this.judging ? cases.judgePoints(this.caseId, said) : undefined));
      if (mine === this.judging) this.judged.value = judged;
    } catch (error) {
      if (mine === this.judging) this.tell(error);
    }
  }

  private tell(error: unknown): void {
    if (!this.closed && error instanceof Error) this.onProblem(error);
  }
}
