// What keys and buttons of the case view do, and what a screen reader hears of it.
import type { Signal } from '@preact/signals';
import type { ComparedStep } from '@/api/types';
import type { Span } from '@/base/spans';
import { formatTime, kMinute, kSecond } from '@/base/time';
import { nextSpeed } from '@/clock/sync';
import { inOrderDone, stepAt } from '@/compare/plan_map';
import { type PlanModel, viewsOf } from '@/compare/plan_model';
import { t } from '@/i18n/i18n';
import { toggleSound } from '@/media/pane_sound';
import type { Playback } from '@/media/playback';
import { announce, notify } from '@/shell/state';
import { neighbours } from '@/timeline/scale';
import type { ArchivedFrames } from '@/views/archived_frames';
import type { CaseModel } from '@/views/case_model';
import type { Action } from '@/views/keyboard';

export type OpenDialog = 'help' | 'goTo' | 'export' | undefined;

/** What the actions work on. */
export interface CaseDesk {
  model: CaseModel;
  playback: Playback;
  frames: ArchivedFrames;
  plan: PlanModel | undefined;
  /** Of the comparison that is shown, or of the steps that are matched by hand. */
  steps: readonly ComparedStep[];
  unlocked: boolean;
  /** Number of the pane that is large. */
  large: Signal<number>;
  selection: Signal<Span | undefined>;
  dialog: Signal<OpenDialog>;
  fullScreen: () => void;
}

export class CaseActions {
  constructor(private readonly desk: CaseDesk) {}

  readonly act = (action: Action): void => {
    const { playback, model, frames, unlocked, large, selection, dialog } = this.desk;
    switch (action) {
      case 'toggle':
        playback.toggle();
        announce(playback.playing.peek() ? t('transport.playing') : t('transport.pausedAt', { time: this.time(playback.position_ns.peek()) }));
        return;
      case 'frameBack':
        return this.picking ? this.pickIn(-1) : unlocked ? void frames.show(large.peek(), -1) : undefined;
      case 'frameForward':
        return this.picking ? this.pickIn(1) : unlocked ? void frames.show(large.peek(), 1) : undefined;
      case 'original':
        return unlocked ? frames.toggle(large.peek()) : undefined;
      case 'back5':
        return this.seekBy(-5 * kSecond);
      case 'forward5':
        return this.seekBy(5 * kSecond);
      case 'back1':
        return this.seekBy(-kSecond);
      case 'forward1':
        return this.seekBy(kSecond);
      case 'back60':
        return this.seekBy(-kMinute);
      case 'forward60':
        return this.seekBy(kMinute);
      case 'begin':
        return playback.seek(model.whole.start_ns);
      case 'end':
        return playback.seek(model.whole.end_ns);
      case 'slower':
        return this.setSpeed(-1);
      case 'faster':
        return this.setSpeed(1);
      case 'previousMark':
        return this.seekMark('previous');
      case 'nextMark':
        return this.seekMark('next');
      case 'previousStep':
        return this.seekStep('previous');
      case 'nextStep':
        return this.seekStep('next');
      case 'planView':
        return this.nextPlanView();
      case 'soundOrMatch':
        return this.matching ? this.match(action) : this.switchSound();
      case 'matchEnd':
      case 'matchPause':
      case 'matchRemove':
      case 'undo':
      case 'redo':
        return this.match(action);
      case 'selectFrom':
        return this.select('from');
      case 'selectTo':
        return this.select('to');
      case 'clearSelection':
        selection.value = undefined;
        return;
      case 'fullScreen':
        return this.desk.fullScreen();
      case 'help':
      case 'goTo':
        dialog.value = action;
    }
  };

  /** Begins or ends a pause within a step, while steps are matched by hand. */
  readonly pauseHere = (at_ns: number): void => {
    const { matching } = this;
    if (!matching) return;
    const isBegin = matching.pausesSince_ns.peek() === undefined;
    const time = this.time(at_ns, 3);
    if (!matching.pause(at_ns)) notify(t('match.noPause'));
    else if (isBegin) announce(t('match.pauseFrom', { time }));
    else announce(t('match.paused', { name: stepAt(this.desk.steps, at_ns - 1)?.name ?? '', time }));
  };

  private get matching() {
    const { plan } = this.desk;
    return plan?.matching.plan.peek() ? plan.matching : undefined;
  }
  private get picking() {
    const { plan } = this.desk;
    return plan?.picking.isOpen.peek() ? plan.picking : undefined;
  }

  private time(at_ns: number, digits = 0): string {
    return formatTime(at_ns - this.desk.model.whole.start_ns, digits);
  }

  private seekBy(by_ns: number): void {
    const { playback } = this.desk;
    playback.seek(playback.position_ns.peek() + by_ns);
    announce(this.time(playback.position_ns.peek()));
  }

  private seekMark(to: 'previous' | 'next'): void {
    const { model, playback } = this.desk;
    const time_ns = neighbours(
      model.marks.map((one) => one.time_ns),
      playback.position_ns.peek(),
    )[to];
    const mark = model.marks.find((one) => one.time_ns === time_ns);
    if (!mark) {
      announce(t('transport.noMark'));
      return;
    }
    playback.seek(mark.time_ns);
    announce(`${mark.text}, ${this.time(mark.time_ns)}`);
  }

  private seekStep(to: 'previous' | 'next'): void {
    const { playback, steps } = this.desk;
    if (this.matching) {
      this.chooseStep(this.matching.chosen.peek() + (to === 'next' ? 1 : -1));
      return;
    }
    const done = inOrderDone(steps);
    const time_ns = neighbours(
      done.map((one) => one.done.start_ns),
      playback.position_ns.peek(),
    )[to];
    const step = done.find((one) => one.done.start_ns === time_ns);
    if (!step) {
      announce(t('plan.noFurther'));
      return;
    }
    playback.seek(step.done.start_ns);
    announce(`${step.step}. ${step.name}, ${this.time(step.done.start_ns)}`);
  }

  /** While steps are matched by hand: also of one that was not done. */
  private chooseStep(number: number): void {
    this.matching?.choose(number);
    const step = this.desk.steps.find((one) => one.step === this.matching?.chosen.peek());
    if (!step) return;
    if (step.done) this.desk.playback.seek(step.done.start_ns);
    announce(`${step.step}. ${step.name}, ${step.done ? this.time(step.done.start_ns) : t('match.notDone')}`);
  }

  private match(action: Action): void {
    const { matching } = this;
    const { playback, steps } = this.desk;
    if (!matching || matching.making.peek()) return;
    const at_ns = playback.position_ns.peek();
    const chosen = steps.find((one) => one.step === matching.chosen.peek());
    if (action === 'soundOrMatch' && chosen) {
      matching.begin(at_ns);
      announce(t('match.begun', { name: chosen.name, time: this.time(at_ns, 3) }));
    } else if (action === 'matchEnd') {
      const running = stepAt(steps, at_ns - 1);
      if (running) matching.end(running.step, at_ns);
    } else if (action === 'matchPause') {
      this.pauseHere(at_ns);
    } else if (action === 'matchRemove' && this.picking) {
      this.picking.removeChosen();
    } else if (action === 'matchRemove' && chosen) {
      matching.remove(chosen.step);
      announce(`${chosen.step}. ${chosen.name}, ${t('match.notDone')}`);
    } else if (action === 'undo') {
      matching.undo();
    } else if (action === 'redo') {
      matching.redo();
    }
  }

  private pickIn(step: -1 | 1): void {
    if (!this.picking?.step(step)) announce(t('pick.stays'));
  }

  private switchSound(): void {
    announce(t(`sound.${toggleSound(this.desk.playback.panes.map((pane) => pane.sound))}`));
  }

  private nextPlanView(): void {
    const { plan } = this.desk;
    const compared = plan?.shown.peek();
    if (!plan || !compared?.player) return;
    const views = viewsOf(compared.film);
    plan.view.value = views[(views.indexOf(plan.view.peek()) + 1) % views.length] ?? 'beside';
    announce(`${t('plan.view')}: ${t(`plan.${plan.view.peek()}`)}`);
  }

  private setSpeed(step: 1 | -1): void {
    const { playback } = this.desk;
    playback.setRate(nextSpeed(playback.rate.peek(), step));
    announce(`${t('transport.speed')} ${playback.rate.peek()}×`);
  }

  private select(end: 'from' | 'to'): void {
    const { model, playback, selection } = this.desk;
    const { whole } = model;
    const at_ns = playback.position_ns.peek();
    const now = selection.peek() ?? whole;
    const next =
      end === 'from'
        ? { start_ns: at_ns, end_ns: now.end_ns > at_ns ? now.end_ns : whole.end_ns }
        : { start_ns: now.start_ns < at_ns ? now.start_ns : whole.start_ns, end_ns: at_ns };
    if (next.end_ns > next.start_ns) selection.value = next;
  }
}
