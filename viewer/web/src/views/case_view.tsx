// A case: its videos, vital signs and time line on one clock.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { cases as api } from '@/api/client';
import type { ComparedStep, Verdict } from '@/api/types';
import { hrefOf, route } from '@/base/route';
import type { Span } from '@/base/spans';
import { formatDuration, formatTime, kMinute, kSecond } from '@/base/time';
import { nextSpeed } from '@/clock/sync';
import { inOrderDone, stepAt } from '@/compare/plan_map';
import { PickingStage } from '@/compare/picking_stage';
import { PlanModel, streamOf, viewsOf } from '@/compare/plan_model';
import { PlanPanel } from '@/compare/plan_panel';
import { PlanOver, PlanPane } from '@/compare/plan_pane';
import { formatMoment, type MessageKey, t, word } from '@/i18n/i18n';
import { toggleSound } from '@/media/pane_sound';
import { Playback } from '@/media/playback';
import { RecordedPointing, type Stroke } from '@/pointing/recorded';
import { RecordedPointers } from '@/pointing/recorded_pointers';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import { may } from '@/shell/rights';
import { announce, attempt, notify, session } from '@/shell/state';
import { VerdictChip } from '@/shell/verdict';
import { neighbours } from '@/timeline/scale';
import { Timeline } from '@/timeline/timeline';
import { type CaseModel, caseModel } from '@/views/case_model';
import { ExportDialog } from '@/views/export_dialog';
import { type Action, actionOf, kHelp } from '@/views/keyboard';
import { MomentsPanel } from '@/views/moments_panel';
import { type ArchivedFrame, Pane } from '@/views/pane';
import { GoToDialog, Transport } from '@/views/transport';
import { UnlockPanel } from '@/views/unlock_panel';
import { VitalsPanel } from '@/vitals/vitals_panel';
import { VitalsStore } from '@/vitals/vitals_store';

export function CaseView({ id }: { id: string }) {
  const model = useSignal<CaseModel | undefined>(undefined);
  const verdict = useSignal<Verdict | null>(null);
  const unlocked = session.value?.unlocked ?? false;
  useEffect(() => {
    document.title = `${id} · Kiroku`;
  }, [id]);
  useEffect(() => {
    void attempt(async () => {
      const [info, timeline] = await Promise.all([api.get(id), api.timeline(id)]);
      model.value = caseModel(info, timeline);
    });
    void attempt(async () => {
      verdict.value = (await api.list(id, 1, undefined)).find((one) => one.id === id)?.verdict ?? null;
    });
  }, [id, unlocked]);
  if (!model.value) return <main id="main" class="main" aria-busy="true" tabIndex={-1} />;
  return <Loaded key={String(unlocked)} model={model.value} verdict={verdict.value} unlocked={unlocked} />;
}

const kNoStrokes: readonly Stroke[] = [];

type Tab = 'vitals' | 'moments' | 'plan';
const kTabs: readonly Tab[] = ['vitals', 'plan', 'moments'];
const kNoSteps: readonly ComparedStep[] = [];
type Open = 'help' | 'goTo' | 'export' | undefined;

function Loaded({ model, verdict, unlocked }: { model: CaseModel; verdict: Verdict | null; unlocked: boolean }) {
  const id = model.info.id;
  const role = session.value?.role;
  const mayWatch = may(role, 'watch');
  const mayExport = may(role, 'read-case');
  const asked_ns = route.value.view === 'case' ? route.value.at_ns : undefined;

  const playback = useMemo(
    () =>
      new Playback(
        id,
        model.whole.start_ns,
        model.whole.end_ns,
        unlocked ? model.videos.map(({ name }) => ({ stream: name, recorded: model.recorded.get(name) ?? [] })) : [],
      ),
    [model, unlocked],
  );
  const hasVitals = model.info.streams.some((one) => one.kind === 'vitals');
  const store = useMemo(
    () => (unlocked && hasVitals ? new VitalsStore(id, model.whole, (error) => notify(error.message)) : undefined),
    [model, unlocked],
  );
  const plan = useMemo(
    () => (unlocked && may(role, 'compare') ? new PlanModel(id, playback, (error) => notify(error.message)) : undefined),
    [playback, unlocked],
  );
  const pointing = useMemo(
    () => (unlocked && (model.recorded.get('pointing') ?? []).length > 0 ? new RecordedPointing(id, (error) => notify(error.message)) : undefined),
    [model, unlocked],
  );
  const compared = plan?.shown.value;
  const planView = compared?.player ? plan?.view.value : undefined;
  const matching = plan?.matching.plan.value ? plan.matching : undefined;
  const picking = plan?.picking.isOpen.value ? plan.picking : undefined;
  const steps = matching ? matching.steps.value : (compared?.document.steps ?? kNoSteps);
  const hasPlan = plan !== undefined && (model.info.plan !== null || plan.list.value.length > 0 || plan.unreadable.value.length > 0);
  useEffect(
    () => () => {
      plan?.close();
      playback.close();
      store?.close();
    },
    [playback, store, plan],
  );
  useEffect(() => {
    if (asked_ns !== undefined) playback.seek(asked_ns);
  }, [playback, asked_ns]);

  const large = useSignal(0);
  const tab = useSignal<Tab>(unlocked && hasVitals ? 'vitals' : 'moments');
  const dialog = useSignal<Open>(undefined);
  const selection = useSignal<Span | undefined>(undefined);
  const originals = useSignal<ReadonlyMap<string, ArchivedFrame>>(new Map());
  const frameRequest = useRef<AbortController | undefined>(undefined);
  const whole = useRef<HTMLElement>(null);

  const problem = playback.problem.value;
  useEffect(() => {
    if (problem !== undefined) notify(problem);
  }, [problem]);

  // A frame of the archive stays until the clock goes on or elsewhere.
  const shownAt_ns = useRef<number | undefined>(undefined);
  useEffect(
    () =>
      playback.position_ns.subscribe((at_ns) => {
        if (shownAt_ns.current !== undefined && at_ns !== shownAt_ns.current) {
          shownAt_ns.current = undefined;
          originals.value = new Map();
        }
      }),
    [playback],
  );

  /** Shows archived frames in every pane: of the large one the one at, before or after now, of the others what they showed then. */
  const showOriginals = (step: -1 | 0 | 1) =>
    attempt(async () => {
      playback.pause();
      frameRequest.current?.abort();
      const request = new AbortController();
      frameRequest.current = request;
      const at_ns = playback.position_ns.peek();
      const leader = playback.panes[large.value];
      if (!leader) return;
      const frameOf = async (stream: string, time_ns: number, direction: -1 | 0 | 1): Promise<ArchivedFrame> => {
        const { time_ns: its_ns, picture } = await api.frame(id, stream, time_ns, direction, request.signal);
        return { time_ns: its_ns, picture: await createImageBitmap(picture) };
      };
      const stands = originals.peek().get(leader.stream);
      const first = await frameOf(leader.stream, stands?.time_ns ?? at_ns, step);
      if (request.signal.aborted) return;
      shownAt_ns.current = undefined;
      playback.seek(first.time_ns);
      const frames = new Map([[leader.stream, first]]);
      for (const pane of playback.panes) {
        if (pane !== leader && pane.isRecorded(first.time_ns)) frames.set(pane.stream, await frameOf(pane.stream, first.time_ns, 0));
      }
      if (request.signal.aborted) return;
      shownAt_ns.current = playback.position_ns.peek();
      originals.value = frames;
      announce(t('pane.original', { time: formatTime(first.time_ns - model.whole.start_ns, 3) }));
    });
  const toggleOriginals = () => {
    if (originals.value.size > 0) {
      shownAt_ns.current = undefined;
      originals.value = new Map();
    } else {
      void showOriginals(0);
    }
  };

  const seekBy = (by_ns: number) => {
    playback.seek(playback.position_ns.peek() + by_ns);
    announce(formatTime(playback.position_ns.peek() - model.whole.start_ns));
  };
  const seekMark = (to: 'previous' | 'next') => {
    const time_ns = neighbours(model.marks.map((one) => one.time_ns), playback.position_ns.peek())[to];
    const mark = model.marks.find((one) => one.time_ns === time_ns);
    if (!mark) {
      announce(t('transport.noMark'));
      return;
    }
    playback.seek(mark.time_ns);
    announce(`${mark.text}, ${formatTime(mark.time_ns - model.whole.start_ns)}`);
  };
  const seekStep = (to: 'previous' | 'next') => {
    if (matching) {
      chooseStep(matching.chosen.peek() + (to === 'next' ? 1 : -1));
      return;
    }
    const done = inOrderDone(steps);
    const time_ns = neighbours(done.map((one) => one.done.start_ns), playback.position_ns.peek())[to];
    const step = done.find((one) => one.done.start_ns === time_ns);
    if (!step) {
      announce(t('plan.noFurther'));
      return;
    }
    playback.seek(step.done.start_ns);
    announce(`${step.step}. ${step.name}, ${formatTime(step.done.start_ns - model.whole.start_ns)}`);
  };
  /** While steps are matched by hand: also of one that was not done. */
  const chooseStep = (number: number) => {
    matching?.choose(number);
    const step = steps.find((one) => one.step === matching?.chosen.peek());
    if (!step) return;
    if (step.done) playback.seek(step.done.start_ns);
    announce(`${step.step}. ${step.name}, ${step.done ? formatTime(step.done.start_ns - model.whole.start_ns) : t('match.notDone')}`);
  };
  const pauseHere = (at_ns: number) => {
    if (!matching) return;
    const isBegin = matching.pausesSince_ns.peek() === undefined;
    const time = formatTime(at_ns - model.whole.start_ns, 3);
    if (!matching.pause(at_ns)) notify(t('match.noPause'));
    else if (isBegin) announce(t('match.pauseFrom', { time }));
    else announce(t('match.paused', { name: stepAt(steps, at_ns - 1)?.name ?? '', time }));
  };
  const match = (action: Action) => {
    if (!matching || matching.making.peek()) return;
    const at_ns = playback.position_ns.peek();
    const chosen = steps.find((one) => one.step === matching.chosen.peek());
    if (action === 'soundOrMatch' && chosen) {
      matching.begin(at_ns);
      announce(t('match.begun', { name: chosen.name, time: formatTime(at_ns - model.whole.start_ns, 3) }));
    } else if (action === 'matchEnd') {
      const running = stepAt(steps, at_ns - 1);
      if (running) matching.end(running.step, at_ns);
    } else if (action === 'matchPause') {
      pauseHere(at_ns);
    } else if (action === 'matchRemove' && plan?.picking.isOpen.peek()) {
      plan.picking.removeChosen();
    } else if (action === 'matchRemove' && chosen) {
      matching.remove(chosen.step);
      announce(`${chosen.step}. ${chosen.name}, ${t('match.notDone')}`);
    } else if (action === 'undo') {
      matching.undo();
    } else if (action === 'redo') {
      matching.redo();
    }
  };
  const pickIn = (step: -1 | 1) => {
    if (!picking?.step(step)) announce(t('pick.stays'));
  };
  const switchSound = () => {
    announce(t(`sound.${toggleSound(playback.panes.map((pane) => pane.sound))}`));
  };
  const nextPlanView = () => {
    if (!plan || !compared?.player) return;
    const views = viewsOf(compared.film);
    plan.view.value = views[(views.indexOf(plan.view.peek()) + 1) % views.length] ?? 'beside';
    announce(`${t('plan.view')}: ${t(`plan.${plan.view.peek()}`)}`);
  };
  const setSpeed = (step: 1 | -1) => {
    playback.setRate(nextSpeed(playback.rate.peek(), step));
    announce(`${t('transport.speed')} ${playback.rate.peek()}×`);
  };
  const select = (end: 'from' | 'to') => {
    const at_ns = playback.position_ns.peek();
    const now = selection.value ?? model.whole;
    const next = end === 'from' ? { start_ns: at_ns, end_ns: now.end_ns > at_ns ? now.end_ns : model.whole.end_ns } : { start_ns: now.start_ns < at_ns ? now.start_ns : model.whole.start_ns, end_ns: at_ns };
    if (next.end_ns > next.start_ns) selection.value = next;
  };
  const act = (action: Action): void => {
    switch (action) {
      case 'toggle':
        playback.toggle();
        announce(playback.playing.peek() ? t('transport.playing') : t('transport.pausedAt', { time: formatTime(playback.position_ns.peek() - model.whole.start_ns) }));
        return;
      case 'frameBack': return picking ? pickIn(-1) : unlocked ? void showOriginals(-1) : undefined;
      case 'frameForward': return picking ? pickIn(1) : unlocked ? void showOriginals(1) : undefined;
      case 'original': return unlocked ? toggleOriginals() : undefined;
      case 'back5': return seekBy(-5 * kSecond);
      case 'forward5': return seekBy(5 * kSecond);
      case 'back1': return seekBy(-kSecond);
      case 'forward1': return seekBy(kSecond);
      case 'back60': return seekBy(-kMinute);
      case 'forward60': return seekBy(kMinute);
      case 'begin': return playback.seek(model.whole.start_ns);
      case 'end': return playback.seek(model.whole.end_ns);
      case 'slower': return setSpeed(-1);
      case 'faster': return setSpeed(1);
      case 'previousMark': return seekMark('previous');
      case 'nextMark': return seekMark('next');
      case 'previousStep': return seekStep('previous');
      case 'nextStep': return seekStep('next');
      case 'planView': return nextPlanView();
      case 'soundOrMatch':
        return matching ? match(action) : switchSound();
      case 'matchEnd':
      case 'matchPause':
      case 'matchRemove':
      case 'undo':
      case 'redo':
        return match(action);
      case 'selectFrom': return select('from');
      case 'selectTo': return select('to');
      case 'clearSelection':
        selection.value = undefined;
        return;
      case 'fullScreen':
        void (document.fullscreenElement ? document.exitFullscreen() : whole.current?.requestFullscreen());
        return;
      case 'help':
      case 'goTo':
        dialog.value = action;
    }
  };
  const actNow = useRef(act);
  actNow.current = act;
  useEffect(() => {
    const pressed = (event: KeyboardEvent) => {
      const target = event.target as HTMLElement;
      if (document.querySelector('dialog[open]') || target.closest('input:not([type=checkbox]), textarea, select')) return;
      if (event.key === ' ' && target.closest('button, a, summary, [role=button]')) return;
      const action = actionOf(event);
      if (!action) return;
      event.preventDefault();
      actNow.current(action);
    };
    addEventListener('keydown', pressed);
    return () => removeEventListener('keydown', pressed);
  }, []);

  const chosen = selection.value;
  const hasTabs = store !== undefined || hasPlan;
  const alarms = store ? store.over(model.whole, 400).alarms : [];
  return (
    <main id="main" class="main case" tabIndex={-1} ref={whole}>
      <div class="case-head">
        <div>
          <p class="crumbs">
            <a href={hrefOf({ view: 'cases' })}>{t('nav.cases')}</a>
            <span aria-hidden="true">/</span>
            <span class="mono">{id}</span>
          </p>
          <h1>{formatMoment(model.info.opened)}</h1>
        </div>
        {model.info.state === 'open' && (
          <span class="verdict verdict-recording">
            <Icon name="record" filled />
            {t('cases.recording')}
          </span>
        )}
        <a class="case-verdict" href={hrefOf({ view: 'verification', id })} title={t('verify.title')}>
          <VerdictChip verdict={verdict} />
        </a>
        {mayExport && (
          <button type="button" class="button" onClick={() => (dialog.value = 'export')}>
            <Icon name="export" />
            {t('export.open')}
          </button>
        )}
      </div>

      <div class="stage">
        {picking && matching && <PickingStage picking={picking} matching={matching} begins_ns={model.whole.start_ns} />}
        <div hidden={picking !== undefined} class={planView === 'beside' ? `panes panes-with-plan${playback.panes.length > 1 ? '' : ' panes-single'}` : `panes panes-${Math.min(4, Math.max(1, playback.panes.length))}`}>
          {unlocked ? (
            playback.panes.map((player, at) => (
              <Pane
                key={player.stream}
                model={model}
                player={player}
                playback={playback}
                large={at === large.value}
                original={originals.value.get(player.stream)}
                onEnlarge={at === large.value ? undefined : () => (large.value = at)}
                onOriginal={toggleOriginals}
              >
                {plan && compared && planView !== undefined && planView !== 'beside' && planView !== 'none' && player.stream === streamOf(compared) && (
                  <PlanOver plan={plan} shown={compared} />
                )}
                {pointing && <RecordedPointers pointing={pointing} player={player} playback={playback} />}
              </Pane>
            ))
          ) : mayWatch ? (
            <UnlockPanel />
          ) : (
            <div class="empty card">
              <Icon name="lock" />
              <p>{t('case.notYours')}</p>
            </div>
          )}
          {compared && planView === 'beside' && <PlanPane shown={compared} playback={playback} />}
        </div>
        <aside class="side" aria-label={t('case.side')}>
          {hasTabs && (
            <div class="tabs" role="tablist" aria-label={t('case.side')}>
              {kTabs.filter((one) => (one === 'vitals' ? hasVitals : one === 'plan' ? hasPlan : true)).map((one) => (
                <button
                  key={one}
                  type="button"
                  role="tab"
                  id={`tab-${one}`}
                  aria-selected={tab.value === one}
                  aria-controls="side-panel"
                  class="tab"
                  onClick={() => (tab.value = one)}
                >
                  {t(`tab.${one}`)}
                </button>
              ))}
            </div>
          )}
          <div class="side-panel" id="side-panel" role={hasTabs ? 'tabpanel' : undefined} aria-labelledby={hasTabs ? `tab-${tab.value}` : undefined} tabIndex={0}>
            {store && tab.value === 'vitals' ? (
              <VitalsPanel store={store} playback={playback} />
            ) : plan && tab.value === 'plan' ? (
              <PlanPanel plan={plan} model={model} playback={playback} pause={pauseHere} />
            ) : (
              <MomentsPanel model={model} playback={playback} alarms={alarms} sealed={!model.timeline.marks} />
            )}
          </div>
        </aside>
      </div>

      {chosen && (
        <div class="selection-bar" role="region" aria-label={t('selection.label')}>
          <span>{t('selection.label')}</span>
          <span class="mono">
            {formatTime(chosen.start_ns - model.whole.start_ns, 3)} – {formatTime(chosen.end_ns - model.whole.start_ns, 3)}
          </span>
          <span class="muted">{formatDuration(chosen.end_ns - chosen.start_ns)}</span>
          {mayExport && (
            <button type="button" class="button" onClick={() => (dialog.value = 'export')}>
              <Icon name="export" />
              {t('export.open')}
            </button>
          )}
          <button type="button" class="button button-quiet" onClick={() => (selection.value = undefined)}>
            {t('selection.clear')}
          </button>
        </div>
      )}
      <Transport model={model} playback={playback} withPictures={unlocked} act={act} />
      <Timeline model={model} playback={playback} store={store} selection={chosen} onSelect={(span) => (selection.value = span)} withPictures={unlocked} steps={steps} strokes={pointing?.strokes.value ?? kNoStrokes} matching={matching} />

      {dialog.value === 'help' && (
        <Dialog title={t('help.title')} onClose={() => (dialog.value = undefined)}>
          <dl class="keys">
            {kHelp.map(({ keys, does }) => (
              <div key={does}>
                <dt>
                  {keys.map((key) => (
                    <kbd key={key}>{key}</kbd>
                  ))}
                </dt>
                <dd>{t(does as MessageKey)}</dd>
              </div>
            ))}
          </dl>
          <p class="muted">{t('help.mouse')}</p>
          <p class="muted">{t('help.streams', { names: model.lanes.map((one) => word('stream', one.name)).join(', ') })}</p>
        </Dialog>
      )}
      {dialog.value === 'goTo' && <GoToDialog model={model} playback={playback} onClose={() => (dialog.value = undefined)} />}
      {dialog.value === 'export' && <ExportDialog model={model} span={chosen ?? model.whole} unlocked={unlocked} onClose={() => (dialog.value = undefined)} />}
    </main>
  );
}
