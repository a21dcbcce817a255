// What a person does at the workbench becomes deeds, and what comes back becomes signals. Draws nothing.
import { signal } from '@preact/signals';
import { Median } from '@/base/median';
import { History } from '@/breathing/history';
import {
  type Fitted,
  type Fitting,
  type Look,
  LungConnection,
  type LungDeed,
  type LungMoment,
  type ModelSeal,
  type OpenedLung,
  type Path,
  type Similarity,
} from '@/breathing/breathing_api';
import { KeptMotion } from '@/breathing/kept_motion';
import type { Surface } from '@/breathing/lung_surface';
import { type Motion, sameMotion } from '@/breathing/motion';
import { later, stepped, type TimeLine } from '@/breathing/time_line';

const kMeasured = 60;
const kRateOver_ms = 2000;

export interface LungEvents {
  opened: (opened: OpenedLung) => void;
  picture: (picture: ImageBitmap) => void;
  told: (sentence: string) => void;
  fitted: (fitted: Fitted) => void;
  saved: (file: string, seal: ModelSeal | null) => void;
  lost: (sentence: string) => void;
}

export class LungController {
  readonly opened = signal<OpenedLung | undefined>(undefined);
  readonly motion = signal<Motion | undefined>(undefined);
  /** What is painted on; null where it has too many nodes for that. */
  readonly surface = signal<Surface | null | undefined>(undefined);
  readonly steps = signal({ undo: false, redo: false, saved: true });
  readonly path = signal<Path | undefined>(undefined);
  readonly similarity = signal<Similarity | undefined>(undefined);
  readonly moment = signal<LungMoment | undefined>(undefined);
  readonly time_s = signal(0);
  readonly playing = signal(false);
  readonly look = signal<Look>({ mode: 'beside', part: 0.5, outlined: true });
  /** What the fit does that is computed, if one is. */
  readonly fitting = signal<Fitting | undefined>(undefined);
  /** What the last one found. */
  readonly fit = signal<Fitted | undefined>(undefined);
  readonly rate = signal({ latency_ms: undefined as number | undefined, perSecond: 0 });

  private readonly connection: LungConnection;
  private history: History<Motion> | undefined;
  private readonly kept = new KeptMotion();
  private readonly sent = new Map<number, number>();
  private readonly latency = new Median(kMeasured);
  private shown_ms: number[] = [];
  private frame = 0;
  /** Of the message that sent a motion last. */
  private motionInput = 0;

  constructor(events: LungEvents) {
    this.connection = new LungConnection({
      opened: (opened) => {
        this.history = new History(opened.motion, sameMotion);
        this.kept.open(opened.motion);
        this.opened.value = opened;
        this.motion.value = opened.motion;
        this.send({ look: this.look.value });
        events.opened(opened);
      },
      path: (path) => {
        if (this.path.value === undefined) this.time_s.value = path.times_s[0] ?? 0;
        this.path.value = path;
      },
      similarity: (similarity) => (this.similarity.value = similarity),
      moment: (moment, picture) => {
        events.picture(picture);
        this.shown(moment);
      },
      fitting: (fitting) => {
        if (this.fitting.peek()) this.fitting.value = fitting;
      },
      fitted: (fitted) => {
        this.fitting.value = undefined;
        this.fit.value = fitted;
        // One step of its own.
        this.settle();
        if (fitted.motion) this.change(fitted.motion, 'fit');
        this.settle();
        events.fitted(fitted);
      },
      fitEnded: (sentence) => {
        this.fitting.value = undefined;
        events.told(sentence);
      },
      told: events.told,
      surface: (surface) => (this.surface.value = surface),
      refused: ({ input, why, motion }) => {
        events.told(why);
        // A later one will be answered itself.
        if (!this.history || input < this.motionInput) return;
        this.history.settle();
        this.history.change(motion, 'refused');
        this.history.settle();
        this.motion.value = this.history.now;
        this.tellSteps();
      },
      saved: ({ input, file, seal }) => {
        this.kept.save(input);
        this.tellSteps();
        events.saved(file, seal);
      },
      lost: (sentence) => {
        this.pause();
        events.lost(sentence);
      },
    });
  }
  leave(): void {
    this.pause();
    this.connection.leave();
  }

  get line(): TimeLine {
    return this.path.value ?? { times_s: [], duration_s: 0 };
  }

  private shown(moment: LungMoment): void {
    const now_ms = performance.now();
    this.shown_ms = [...this.shown_ms.filter((at) => now_ms - at < kRateOver_ms), now_ms];
    const at_ms = this.sent.get(moment.input);
    if (at_ms !== undefined) this.latency.add(now_ms - at_ms);
    for (const number of this.sent.keys()) if (number <= moment.input) this.sent.delete(number);
    this.moment.value = moment;
    this.rate.value = { latency_ms: this.latency.value, perSecond: (1000 * this.shown_ms.length) / kRateOver_ms };
  }
  /** The message's number; 0 while nothing can be sent. */
  private send(deed: LungDeed): number {
    const number = this.connection.send(deed);
    if (number > 0 && !('save' in deed) && !('fit' in deed) && !('cancel' in deed)) this.sent.set(number, performance.now());
    return number;
  }

  /** By a control that has this name; one step until it is let go. */
  change(next: Motion, control: string): void {
    if (!this.history) return;
    this.history.change(next, control);
    this.tellMotion();
  }
  settle(): void {
    this.history?.settle();
  }
  undo(): void {
    if (this.history?.undo()) this.tellMotion();
  }
  redo(): void {
    if (this.history?.redo()) this.tellMotion();
  }
  private tellMotion(): void {
    if (!this.history) return;
    this.motion.value = this.history.now;
    this.tellSteps();
    this.motionInput = this.send({ motion: this.history.now });
  }
  private tellSteps(): void {
    const { history } = this;
    if (history) this.steps.value = { undo: history.canUndo, redo: history.canRedo, saved: this.kept.has(history.now) };
  }
  save(file: string, seal: boolean): void {
    if (!this.history) return;
    const motion = this.history.now;
    this.kept.send(this.send({ save: { file, motion, seal } }), motion);
  }

  /** From where the sliders stand. */
  fitAll(direction: boolean): void {
    if (!this.history || this.fitting.peek()) return;
    this.fitting.value = { doing: '', done: 0, all: 1 };
    this.send({ fit: { motion: this.history.now, direction } });
  }
  cancelFit(): void {
    this.send({ cancel: true });
  }

  lookAs(look: Partial<Look>): void {
    this.look.value = { ...this.look.value, ...look };
    this.send({ look: this.look.value });
  }

  goTo(time_s: number): void {
    this.time_s.value = time_s;
    this.send({ moment: { time_s } });
  }
  step(by: number): void {
    this.pause();
    this.goTo(stepped(this.line, this.time_s.value, by));
  }
  toggle(): void {
    if (this.playing.value) this.pause();
    else this.play();
  }
  pause(): void {
    this.playing.value = false;
    cancelAnimationFrame(this.frame);
  }
  /** In real time; moments are left out where pictures do not come so fast. */
  private play(): void {
    this.playing.value = true;
    let last_ms = performance.now();
    const tick = (now_ms: number) => {
      this.frame = requestAnimationFrame(tick);
      // The picture before has not come yet: the next goes to where it is by then.
      if (this.sent.size > 0) return;
      this.goTo(later(this.line, this.time_s.value, Math.max(0, now_ms - last_ms) / 1000));
      last_ms = now_ms;
    };
    this.frame = requestAnimationFrame(tick);
  }
}
