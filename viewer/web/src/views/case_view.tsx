// A case: its videos, vital signs and time line on one clock.
import { useSignal } from '@preact/signals';
import type { RefObject } from 'preact';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { ApiError, cases as api, kNoAnswer } from '@/api/client';
import type { ComparedStep, Stroke, Timeline, Verdict } from '@/api/types';
import { hrefOf, route } from '@/base/route';
import type { Span } from '@/base/spans';
import { fluoroscopies } from '@/compare/fluoroscopy';
import { CaseConsents } from '@/consent/case_consents';
import { isFleet, rowOf } from '@/fleet/fleet_api';
import { shownCase } from '@/fleet/question';
import { OrganOver } from '@/compare/organ_over';
import type { OrganEpisode } from '@/compare/organ_place';
import { PickingStage } from '@/compare/picking_stage';
import { PlanModel, streamOf } from '@/compare/plan_model';
import { PlanOver, PlanPane } from '@/compare/plan_pane';
import { formatMoment, t, word } from '@/i18n/i18n';
import { Playback } from '@/media/playback';
import { RecordedPointing } from '@/pointing/recorded';
import { RecordedPointers } from '@/pointing/recorded_pointers';
import { Icon } from '@/shell/icon';
import { returns } from '@/shell/connection';
import { may } from '@/shell/rights';
import { attempt, notifyOf, session } from '@/shell/state';
import { VerdictChip } from '@/shell/verdict';
import { Overview } from '@/timeline/overview';
import { CaseSubject } from '@/subject/case_subject';
import { Timeline as TimelineLanes } from '@/timeline/timeline';
import { TimelineWindow } from '@/timeline/timeline_window';
import { ArchivedFrames } from '@/views/archived_frames';
import { CaseActions, type OpenDialog } from '@/views/case_actions';
import { type CaseModel, caseModel } from '@/views/case_model';
import { CaseSide, type Tab } from '@/views/case_side';
import { CaseUnshown } from '@/views/case_unshown';
import { ExportDialog } from '@/views/export_dialog';
import { actionOf } from '@/views/keyboard';
import { KeysDialog } from '@/views/keys_dialog';
import { Pane } from '@/views/pane';
import { SelectionBar } from '@/views/selection_bar';
import { GoToDialog, Transport } from '@/views/transport';
import { UnlockPanel } from '@/views/unlock_panel';
import { useFirstMoment } from '@/views/use_first_moment';
import { VitalsStore } from '@/vitals/vitals_store';

export function CaseView({ id }: { id: string }) {
  const model = useSignal<CaseModel | undefined>(undefined);
  const proofs = useSignal<Timeline | undefined>(undefined);
  const failed = useSignal<unknown>(undefined);
  const verdict = useSignal<Verdict | null>(null);
  const verified = useSignal<string | null>(null);
  const unlocked = session.value?.unlocked ?? false;
  useEffect(() => {
    document.title = `${id} · Kiroku`;
  }, [id]);
  const load = async () => {
    try {
      const [info, timeline] = await Promise.all([api.get(id), api.timeline(id)]);
      failed.value = undefined;
      model.value = caseModel(info, timeline);
      proofs.value = timeline;
    } catch (error) {
      const isOfFrame = error instanceof ApiError && (error.status === kNoAnswer || error.status === 401);
      if (!isOfFrame) failed.value = error;
    }
    void attempt(async () => {
      const row = await rowOf(id);
      verdict.value = row?.verdict ?? null;
      verified.value = row?.verified ?? null;
    });
  };
  useEffect(() => {
    void load();
  }, [id, unlocked]);
  // What proves the times is fetched from a store while the pictures play already.
  const isComing = proofs.value?.proofs_coming ?? false;
  useEffect(() => {
    if (!isComing) return undefined;
    const timer = setInterval(() => void attempt(async () => (proofs.value = await api.timeline(id))), kProofsEvery_ms);
    return () => clearInterval(timer);
  }, [id, isComing]);
  // The first load is above: a second one would put a new case, at its beginning, in the place of the first.
  const returned = returns.value;
  const known = useRef(returned);
  const kept = useRef<number>(null);
  useEffect(() => {
    if (returned !== known.current && !model.peek()) void load();
    known.current = returned;
  }, [returned]);
  if (failed.value !== undefined) return <CaseUnshown id={id} error={failed.value} />;
  if (!model.value) return <main id="main" class="main" aria-busy="true" tabIndex={-1} />;
  return (
    <Loaded
      key={String(unlocked)}
      model={model.value}
      proofs={proofs.value}
      verdict={verdict.value}
      verified={verified.value}
      unlocked={unlocked}
      kept={kept}
    />
  );
}

const kProofsEvery_ms = 1000;

const kNoStrokes: readonly Stroke[] = [];

const kNoSteps: readonly ComparedStep[] = [];
const kNoEpisodes: readonly OrganEpisode[] = [];

function Loaded({
  model,
  proofs,
  verdict,
  verified,
  unlocked,
  kept,
}: {
  model: CaseModel;
  /** The time line as it was asked for last: its time-stamps may come later than the pictures. */
  proofs: Timeline | undefined;
  verdict: Verdict | null;
  verified: string | null;
  unlocked: boolean;
  kept: RefObject<number>;
}) {
  const id = model.info.id;
  const role = session.value?.role;
  const mayWatch = may(role, 'watch');
  const mayFit = may(role, 'plan') && !isFleet();
  const isFluoroscopy = (stream: string) => fluoroscopies(model).some((one) => one.name === stream);
  const mayExport = may(role, 'read-case') && !isFleet();
  const shown = useMemo(() => (proofs ? { ...model, timeline: { ...proofs, segments: model.timeline.segments } } : model), [model, proofs]);
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
  const store = useMemo(() => (unlocked && hasVitals ? new VitalsStore(id, model.whole, notifyOf) : undefined), [model, unlocked]);
  const selection = useSignal<Span | undefined>(undefined);
  const plan = useMemo(
    () => (unlocked && may(role, 'compare') && !isFleet() ? new PlanModel(id, playback, notifyOf, selection, model.info.plan !== null) : undefined),
    [playback, unlocked],
  );
  const pointing = useMemo(
    () => (unlocked && (model.recorded.get('pointing') ?? []).length > 0 ? new RecordedPointing(id, notifyOf) : undefined),
    [model, unlocked],
  );
  const compared = plan?.shown.value;
  const organ = plan?.organ.value;
  const outlined = plan?.outline.value === true ? organ : undefined;
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
  useFirstMoment(id, playback, asked_ns, kept);

  const large = useSignal(0);
  const tab = useSignal<Tab>(unlocked && hasVitals ? 'vitals' : 'moments');
  const dialog = useSignal<OpenDialog>(undefined);
  // The browser tells of a closed dialogue a moment later, when another may be open.
  const closed = (which: OpenDialog) => () => {
    if (dialog.peek() === which) dialog.value = undefined;
  };
  const whole = useRef<HTMLElement>(null);

  const problem = playback.problem.value;
  useEffect(() => {
    if (problem !== undefined) notifyOf(problem);
  }, [problem]);

  const frames = useMemo(() => new ArchivedFrames(id, playback), [playback]);
  useEffect(() => () => frames.close(), [frames]);
  const lines = useMemo(() => new TimelineWindow(model.whole), [model]);
  const fullScreen = () => {
    void (document.fullscreenElement ? document.exitFullscreen() : whole.current?.requestFullscreen());
  };
  const actions = new CaseActions({ model, playback, frames, plan, steps, unlocked, large, selection, dialog, fullScreen });
  const { act } = actions;
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
  const select = (span: Span) => (selection.value = span);
  const tabs: Tab[] = [...(store ? ['vitals' as const] : []), ...(hasPlan ? ['plan' as const] : []), 'moments'];
  const { alarms, notices } = store ? store.over(model.whole, 400) : { alarms: [], notices: [] };
  return (
    <main id="main" class="main case" tabIndex={-1} ref={whole}>
      <div class="case-head">
        <div>
          <p class="crumbs">
            <a href={hrefOf({ view: 'cases' })}>{t('nav.cases')}</a>
            <span aria-hidden="true">/</span>
            <span class="mono">{shownCase(id)}</span>
          </p>
          <h1>{formatMoment(model.info.opened)}</h1>
        </div>
        {unlocked && may(role, 'watch') && <CaseSubject id={id} />}
        {mayExport && <CaseConsents id={id} />}
        {model.info.state === 'open' && (
          <span class="verdict verdict-recording">
            <Icon name="record" filled />
            {t('cases.recording')}
          </span>
        )}
        <a
          class="case-verdict"
          href={hrefOf({ view: 'verification', id })}
          title={verified ? t('verify.when', { moment: formatMoment(verified) }) : t('verify.title')}
        >
          <VerdictChip verdict={verdict} />
        </a>
        {shown.timeline.proofs_coming && (
          <span class="muted" role="status">
            {t('fleet.proofsComing')}
          </span>
        )}
        {mayExport && (
          <button type="button" class="button" onClick={() => (dialog.value = 'export')}>
            <Icon name="export" />
            {t('export.open')}
          </button>
        )}
      </div>

      <div class="stage">
        {picking && matching && <PickingStage picking={picking} matching={matching} begins_ns={model.whole.start_ns} />}
        <div
          hidden={picking !== undefined}
          class={
            planView === 'beside'
              ? `panes panes-with-plan${playback.panes.length > 1 ? '' : ' panes-single'}`
              : `panes panes-${Math.min(4, Math.max(1, playback.panes.length))}`
          }
        >
          {unlocked ? (
            playback.panes.map((player, at) => (
              <Pane
                key={player.stream}
                model={model}
                player={player}
                playback={playback}
                large={at === large.value}
                original={frames.shown.value.get(player.stream)}
                onEnlarge={at === large.value ? undefined : () => (large.value = at)}
                onOriginal={() => act('original')}
                fitHref={mayFit && isFluoroscopy(player.stream) ? hrefOf({ view: 'breathing', recording: { id, stream: player.stream } }) : undefined}
              >
                {plan && compared && planView !== undefined && planView !== 'beside' && planView !== 'none' && player.stream === streamOf(compared) && (
                  <PlanOver plan={plan} shown={compared} />
                )}
                {outlined && player.stream === compared?.document.case.stream && (
                  <OrganOver
                    alignment={outlined.alignment}
                    fromPlan={plan?.fromPlan.value === true && outlined.alignment.departure !== undefined}
                    player={player}
                    playback={playback}
                    original_ns={frames.shown.value.get(player.stream)?.time_ns}
                  />
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
        <CaseSide
          model={shown}
          playback={playback}
          tab={tab}
          tabs={tabs}
          store={store}
          plan={plan}
          pause={actions.pauseHere}
          alarms={alarms}
          notices={notices}
        />
      </div>

      <div class="controls">
        {chosen && (
          <SelectionBar
            chosen={chosen}
            begins_ns={model.whole.start_ns}
            onExport={mayExport ? () => (dialog.value = 'export') : undefined}
            onClear={() => act('clearSelection')}
          />
        )}
        <Transport model={model} playback={playback} withPictures={unlocked} act={act} />
        <Overview model={model} playback={playback} window={lines} selection={chosen} onSelect={select} withPictures={unlocked} />
      </div>
      <TimelineLanes
        model={shown}
        playback={playback}
        window={lines}
        store={store}
        selection={chosen}
        onSelect={select}
        withPictures={unlocked}
        steps={steps}
        organ={organ?.summary.episodes ?? kNoEpisodes}
        strokes={pointing?.strokes.value ?? kNoStrokes}
        matching={matching}
      />

      {dialog.value === 'help' && <KeysDialog streams={model.lanes.map((one) => word('stream', one.name))} onClose={closed('help')} />}
      {dialog.value === 'goTo' && <GoToDialog model={model} playback={playback} onClose={closed('goTo')} />}
      {dialog.value === 'export' && <ExportDialog model={model} span={chosen ?? model.whole} unlocked={unlocked} onClose={closed('export')} />}
    </main>
  );
}
