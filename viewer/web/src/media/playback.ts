// All panes of a case on one case clock. While it runs, the clock is that of the first pane with a picture, and the others are brought to it; where no
// pane has one it runs by itself, and while one that should have a picture lacks it, everything waits.
import { effect, signal } from '@preact/signals';
import type { Span } from '@/base/spans';
import { CaseClock } from '@/clock/case_clock';
import { kHardSeekSeconds } from '@/clock/sync';
import { PanePlayer } from '@/media/pane_player';

export interface PaneSource {
  stream: string;
  recorded: readonly Span[];
}

/** What keeps itself at the clock; nothing waits for it. */
export interface Follower {
  /** Called for each picture of the screen. */
  tick(time_ns: number, running: boolean, rate: number): void;
}

export class Playback {
  readonly clock: CaseClock;
  readonly panes: PanePlayer[];
  /** The case clock's position, for everything that shows it; changes with every picture of the screen at most. */
  readonly position_ns = signal(0);
  readonly playing = signal(false);
  readonly waiting = signal(false);
  readonly rate = signal(1);
  readonly problem = signal<Error | undefined>(undefined);
  readonly followers = new Set<Follower>();
  private readonly stopNaming: () => void;
  private frame = 0;
  private pendingSeek_ns: number | undefined;

  constructor(caseId: string, begin_ns: number, end_ns: number, sources: readonly PaneSource[]) {
    this.clock = new CaseClock(begin_ns, end_ns);
    this.position_ns.value = begin_ns;
    this.panes = sources.map(
      ({ stream, recorded }) =>
        new PanePlayer(caseId, stream, recorded, end_ns, (error) => {
          this.problem.value = error;
        }),
    );
    this.stopNaming = effect(() => {
      const master = this.panes.find((pane) => pane.sound.isThere.value);
      for (const pane of this.panes) pane.sound.isMaster.value = pane === master;
    });
    for (const pane of this.panes) pane.seek(begin_ns);
    const step = () => {
      this.tick(performance.now());
      this.frame = requestAnimationFrame(step);
    };
    this.frame = requestAnimationFrame(step);
  }

  close(): void {
    cancelAnimationFrame(this.frame);
    this.stopNaming();
    for (const pane of this.panes) pane.close();
  }

  play(): void {
    if (this.clock.at(performance.now()) >= this.clock.end_ns) this.seek(this.clock.begin_ns);
    this.playing.value = true;
  }

  pause(): void {
    this.playing.value = false;
    this.clock.stand(performance.now());
    this.position_ns.value = this.clock.at(performance.now());
  }

  toggle(): void {
    if (this.playing.value) this.pause();
    else this.play();
  }

  seek(time_ns: number): void {
    const now_ms = performance.now();
    this.clock.stand(now_ms);
    this.clock.set(time_ns, now_ms);
    const position_ns = this.clock.at(now_ms);
    this.position_ns.value = position_ns;
    this.pendingSeek_ns = undefined;
    for (const pane of this.panes) pane.seek(position_ns);
  }

  /** As seek(), for a hand that drags: a pane that is still seeking is let finish first, so that pictures come all the way. */
  scrub(time_ns: number): void {
    if (!this.panes.some((pane) => pane.video.seeking)) {
      this.seek(time_ns);
      return;
    }
    this.pendingSeek_ns = this.clock.clamp(time_ns);
    this.position_ns.value = this.pendingSeek_ns;
  }

  setRate(rate: number): void {
    this.rate.value = rate;
    this.clock.setRate(rate, performance.now());
  }

  private tick(now_ms: number): void {
    if (this.pendingSeek_ns !== undefined && !this.panes.some((pane) => pane.video.seeking)) this.seek(this.pendingSeek_ns);
    let time_ns = this.clock.at(now_ms);
    const ready = this.panes.every((pane) => pane.isReady(time_ns));
    this.waiting.value = !ready;
    if (this.playing.value && ready) {
      this.clock.run(now_ms);
      const leader = this.panes.find((pane) => pane.isRecorded(time_ns));
      const leads_ns = leader?.runningAt();
      if (leads_ns !== undefined && Math.abs(leads_ns - time_ns) < kHardSeekSeconds * 1e9) {
        this.clock.set(leads_ns, now_ms);
        time_ns = this.clock.at(now_ms);
      }
      if (time_ns >= this.clock.end_ns) this.pause();
    } else {
      this.clock.stand(now_ms);
    }
    for (const pane of this.panes) pane.tick(time_ns, this.clock.running, this.rate.value, now_ms);
    for (const one of this.followers) one.tick(time_ns, this.clock.running, this.rate.value);
    if (this.pendingSeek_ns === undefined) this.position_ns.value = time_ns;
  }
}
