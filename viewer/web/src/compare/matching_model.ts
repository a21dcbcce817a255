// Matching by hand while it is done: the plan's steps, what was said of them with its way back, and the making of a comparison of it.
import { batch, computed, type ReadonlySignal, type Signal, signal } from '@preact/signals';
import { ApiError, cases } from '@/api/client';
import type { ComparedStep, ComparisonMaking, Matching } from '@/api/types';
import type { Span } from '@/base/spans';
import {
  begun,
  beginning,
  byHand,
  changed,
  compared,
  type Draft,
  ended,
  freeName,
  type History,
  mapOfSteps,
  notDone,
  ofFound,
  paused,
  redone,
  undone,
  unpaused,
} from '@/compare/matching';
import { type OrganAsked, organBody, organLacks, stretchOf } from '@/compare/organ_asked';
import { byHandPicks, kNoPicks, lacks, type Picks } from '@/compare/picks';
import { type Fluoroscopy, fluoroscopyBody } from '@/compare/fluoroscopy';
import { stepAt } from '@/compare/plan_map';

const kAskEvery_ms = 400;
const kNoSteps: readonly ComparedStep[] = [];

/** All that a person said: one way back for all of it. */
interface Work {
  draft: Draft;
  picks: Picks;
}
const kNoWork: Work = { draft: new Map(), picks: kNoPicks };

export class MatchingModel {
  readonly plan: Signal<Matching | undefined> = signal(undefined);
  readonly opening = signal(false);
  /** The step that keys and buttons are about. */
  readonly chosen = signal(1);
  readonly name = signal('');
  readonly making: Signal<ComparisonMaking | undefined> = signal(undefined);
  /** Since when a pause lasts whose end was not said yet. */
  readonly pausesSince_ns: Signal<number | undefined> = signal(undefined);
  /** What the plan's radiographs shall be compared with; nothing: they are not. */
  readonly fluoroscopy: Signal<Fluoroscopy | undefined> = signal(undefined);
  /** How the plan's organ shall be found in the recorded pictures; nothing: it is not looked for. */
  readonly organ: Signal<OrganAsked | undefined> = signal(undefined);
  private readonly history: Signal<History<Work>> = signal(beginning(kNoWork));
  /** While a flag is held: what would be said if it were let go. */
  private readonly held: Signal<Draft | undefined> = signal(undefined);
  readonly draft = computed(() => this.held.value ?? this.history.value.now.draft);
  readonly picks = computed(() => this.history.value.now.picks);
  readonly lacks = computed(() => lacks(this.picks.value));
  readonly steps = computed(() => (this.plan.value ? compared(this.plan.value.steps, this.draft.value, this.room.value) : kNoSteps));
  readonly organStretch = computed(() => this.organ.value && stretchOf(this.organ.value, this.steps.value, this.selection.value, this.room.value));
  readonly organLacks = computed(() => organLacks(this.organ.value, this.organStretch.value, this.picks.value.pairs.length > 0));
  readonly map = computed(() => mapOfSteps(this.steps.value));
  readonly canUndo = computed(() => this.history.value.past.length > 0);
  readonly canRedo = computed(() => this.history.value.future.length > 0);
  private readonly room = computed<Span>(() => ({ start_ns: this.plan.value?.begins_ns ?? 0, end_ns: this.plan.value?.end_ns ?? 0 }));
  private closed = false;

  constructor(
    private readonly caseId: string,
    private readonly onProblem: (error: Error) => void,
    /** A comparison of this name is there. */
    private readonly onMade: (name: string) => Promise<void>,
    /** On the time line. */
    private readonly selection: ReadonlySignal<Span | undefined>,
  ) {}

  get isOpen(): boolean {
    return this.plan.value !== undefined;
  }

  close(): void {
    this.closed = true;
  }

  async open(taken: readonly string[]): Promise<void> {
    if (this.opening.peek()) return;
    this.opening.value = true;
    try {
      const plan = await cases.matching(this.caseId);
      if (this.closed) return;
      batch(() => {
        this.history.value = beginning({ draft: ofFound(plan.found, { start_ns: plan.begins_ns, end_ns: plan.end_ns }), picks: kNoPicks });
        this.pausesSince_ns.value = undefined;
        this.fluoroscopy.value = undefined;
        this.organ.value = undefined;
        this.chosen.value = plan.steps[0]?.step ?? 1;
        this.name.value = freeName(taken);
        this.plan.value = plan;
      });
    } catch (error) {
      if (!this.closed && error instanceof Error) this.onProblem(error);
    } finally {
      this.opening.value = false;
    }
  }

  leave(): void {
    this.plan.value = undefined;
  }

  /** The chosen step begins at this moment; the next one is chosen. */
  begin(at_ns: number): void {
    const step = this.chosen.peek();
    this.say(begun(this.draft.peek(), step, at_ns, this.room.peek()));
    this.choose(step + 1);
  }
  /** The step that was begun last, at or before this moment, ends there. */
  end(step: number, at_ns: number): void {
    this.say(ended(this.draft.peek(), step, at_ns, this.room.peek()));
  }
  remove(step: number): void {
    this.say(notDone(this.draft.peek(), step, this.room.peek()));
  }
  /** First the beginning of a pause, then its end, in either order; false where they do not lie within one step. */
  pause(at_ns: number): boolean {
    const since_ns = this.pausesSince_ns.peek();
    if (since_ns === undefined) {
      this.pausesSince_ns.value = at_ns;
      return true;
    }
    this.pausesSince_ns.value = undefined;
    const span = { start_ns: Math.min(since_ns, at_ns), end_ns: Math.max(since_ns, at_ns) };
    const step = stepAt(this.steps.peek(), span.start_ns);
    const before = this.draft.peek();
    if (step) this.say(paused(before, step.step, span, this.room.peek()));
    return this.draft.peek() !== before;
  }
  unpause(step: number, pause: number): void {
    this.say(unpaused(this.draft.peek(), step, pause));
  }
  /** The step's flag held at a moment; said once it is dropped. */
  hold(step: number, at_ns: number): void {
    this.held.value = begun(this.history.peek().now.draft, step, at_ns, this.room.peek());
  }
  drop(): void {
    const draft = this.held.peek();
    if (!draft) return;
    batch(() => {
      this.held.value = undefined;
      this.say(draft);
    });
  }
  undo(): void {
    this.history.value = undone(this.history.peek());
  }
  redo(): void {
    this.history.value = redone(this.history.peek());
  }
  choose(step: number): void {
    const all = this.plan.peek()?.steps.length ?? 0;
    this.chosen.value = Math.max(1, Math.min(all, step));
  }

  /** Has the server make a comparison of what was said, and waits for it. */
  async keep(): Promise<void> {
    try {
      this.making.value = await cases.compare(
        this.caseId,
        this.name.peek(),
        { ...byHand(this.draft.peek()), ...byHandPicks(this.picks.peek()) },
        { fluoroscopy: fluoroscopyBody(this.fluoroscopy.peek()), alignment: organBody(this.organ.peek(), this.organStretch.peek()) },
      );
      if (await this.madeWell()) this.leave();
    } catch (error) {
      if (!this.closed && error instanceof Error) this.onProblem(error);
    } finally {
      this.making.value = undefined;
    }
  }

  /** Waits for what is being made of this case already, if anything is: whoever asked for it may have left the page. */
  async resume(): Promise<void> {
    try {
      const making = await cases.making(this.caseId);
      if (this.closed || making.state !== 'running' || this.making.peek()) return;
      this.making.value = making;
    } catch (error) {
      // None was asked for since the server began.
      if (!this.closed && error instanceof Error && !(error instanceof ApiError && error.status === 404)) this.onProblem(error);
      return;
    }
    try {
      await this.madeWell();
    } catch (error) {
      if (!this.closed && error instanceof Error) this.onProblem(error);
    } finally {
      this.making.value = undefined;
    }
  }

  /** Waits for the end of what is made, and shows it; false where nobody waits for it any more. */
  private async madeWell(): Promise<boolean> {
    while (!this.closed && this.making.peek()?.state === 'running') {
      await new Promise((resolve) => setTimeout(resolve, kAskEvery_ms));
      if (!this.closed) this.making.value = await cases.making(this.caseId);
    }
    const made = this.making.peek();
    if (this.closed || !made) return false;
    if (made.state === 'failed') throw new Error(made.problem);
    await this.onMade(made.name);
    return true;
  }
  async stop(): Promise<void> {
    try {
      await cases.stopMaking(this.caseId);
    } catch (error) {
      if (error instanceof Error) this.onProblem(error);
    }
  }

  /** Points and clicks as they are from now on. */
  pick(picks: Picks): void {
    this.note({ ...this.history.peek().now, picks });
  }

  private say(draft: Draft): void {
    if (draft !== this.history.peek().now.draft) this.note({ ...this.history.peek().now, draft });
  }
  private note(work: Work): void {
    this.history.value = changed(this.history.peek(), work);
  }
}
