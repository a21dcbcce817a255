// Matching the plan's steps to moments by hand: each step with when it began and ended, the time map that follows from it, and keeping it as a comparison.
import { useComputed } from '@preact/signals';
import { formatTime, kSecond } from '@/base/time';
import type { MatchingModel } from '@/compare/matching_model';
import { OrganChoice } from '@/compare/organ_choice';
import type { PickingModel } from '@/compare/picking_model';
import { PointsPart, ToolsPart, WorkChoice, XrayPart } from '@/compare/picking_panel';
import { type MessageKey, t } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { Icon } from '@/shell/icon';
import type { CaseModel } from '@/views/case_model';

const kWide = 300;
const kHigh = 96;

/** Case time from left to right, plan time from below. */
function MapPicture({ matching, playback }: { matching: MatchingModel; playback: Playback }) {
  const plan = matching.plan.value;
  const map = matching.map.value;
  if (!plan) return null;
  const plan_s = plan.steps.reduce((most, one) => Math.max(most, one.start_s + one.duration_s), 1e-9);
  const x = (case_ns: number) => ((case_ns - plan.begins_ns) / (plan.end_ns - plan.begins_ns)) * kWide;
  const y = (at_s: number) => kHigh - (at_s / plan_s) * kHigh;
  return (
    <svg
      class="map-picture"
      viewBox={`0 0 ${kWide} ${kHigh}`}
      preserveAspectRatio="none"
      role="img"
      aria-label={t('match.map', { n: map?.pieces.length ?? 0, all: plan.steps.length })}
    >
      {plan.steps.map((one) => (
        <line key={one.step} class="map-step" x1="0" x2={kWide} y1={y(one.start_s)} y2={y(one.start_s)} />
      ))}
      {(map?.pieces ?? []).map((piece) => (
        <polyline
          key={piece.step}
          class="map-piece"
          points={piece.knots.map((knot) => `${x(knot.case_ns).toFixed(1)},${y(knot.plan_s).toFixed(1)}`).join(' ')}
        />
      ))}
      <line class="map-now" x1={x(playback.position_ns.value)} x2={x(playback.position_ns.value)} y1="0" y2={kHigh} />
    </svg>
  );
}

/** What the program that compares says it does, in the page's language. */
function doing(text: string): string {
  const known: Record<string, MessageKey> = {
    'reading marks and vital signs': 'match.doing.reading',
    'following picked points': 'match.doing.following',
    'carrying out the plan': 'match.doing.simulating',
    'reading the CT': 'match.doing.ct',
    'looking for the organ in the pictures': 'organ.doing',
    "making the plan's film": 'match.doing.film',
    'comparing with the fluoroscopy': 'match.doing.fluoroscopy',
    "making the film of the plan's radiographs": 'match.doing.radiographs',
  };
  const key = known[text];
  return key ? t(key) : t('match.doing.beginning');
}

/** How far the comparison is that is being made; whoever asked for it may stop it. */
export function Making({ matching }: { matching: MatchingModel }) {
  const making = matching.making.value;
  if (!making) return null;
  const share = making.state === 'running' ? making.share : null;
  return (
    <div class="matching-making" role="status">
      <progress {...(share !== null ? { value: share } : {})} max="1" aria-label={t('match.making')} />
      <span>
        {making.state === 'running' ? doing(making.doing) : t('match.making')}
        {share !== null && <span aria-hidden="true"> · {Math.floor(100 * share)} %</span>}
      </span>
      <button type="button" class="button" onClick={() => void matching.stop()}>
        {t('match.stop')}
      </button>
    </div>
  );
}

interface Props {
  matching: MatchingModel;
  picking: PickingModel;
  model: CaseModel;
  playback: Playback;
  /** A pause begins, or ends, at a moment. */
  pause: (at_ns: number) => void;
}

/** When each step was done. */
function StepsPart({ matching, model, playback, pause }: Omit<Props, 'picking'>) {
  const steps = matching.steps.value;
  const chosen = matching.chosen.value;
  const busy = matching.making.value !== undefined;
  const pauses = matching.pausesSince_ns.value !== undefined;
  const now = () => playback.position_ns.peek();
  const time = (at_ns: number) => formatTime(at_ns - model.whole.start_ns, 3);
  return (
    <>
      <p class="muted plan-made">{t('match.what')}</p>
      <MapPicture matching={matching} playback={playback} />
      {(matching.plan.value?.ambiguous_marks ?? []).map((mark) => (
        <p key={`${mark.time_ns} ${mark.text}`} class="muted">
          {t('match.ambiguous', { time: time(mark.time_ns), text: mark.text })}
        </p>
      ))}
      <ol class="matching-steps">
        {steps.map((step) => (
          <li key={step.step} class={step.step === chosen ? 'matching-chosen' : ''} aria-current={step.step === chosen ? 'step' : undefined}>
            <button
              type="button"
              class="link matching-name"
              onClick={() => {
                matching.choose(step.step);
                if (step.done) playback.seek(step.done.start_ns);
              }}
            >
              {step.step}. {step.name}
            </button>
            <span class={step.done ? 'mono' : 'muted'}>
              {step.done ? `${time(step.done.start_ns)} – ${time(step.done.end_ns)}` : t('match.notDone')}
              <small class="muted">
                {t('plan.planned', { time: `${step.planned.duration_s.toFixed(1)} s` })}
                {step.done && ` · ${((step.done.end_ns - step.done.start_ns) / kSecond).toFixed(1)} s`}
              </small>
            </span>
            {step.done && step.done.pauses.length > 0 && (
              <ul class="matching-pauses">
                {step.done.pauses.map((one, at) => (
                  <li key={one.start_ns}>
                    <span class="mono">{t('match.pause', { from: time(one.start_ns), to: time(one.end_ns) })}</span>
                    <button
                      type="button"
                      class="button button-quiet button-square"
                      disabled={busy}
                      aria-label={t('match.removePause', { time: time(one.start_ns) })}
                      onClick={() => matching.unpause(step.step, at)}
                    >
                      <Icon name="cross" />
                    </button>
                  </li>
                ))}
              </ul>
            )}
            <span class="matching-does">
              <button
                type="button"
                class="button"
                disabled={busy}
                aria-label={t('match.beginsHere', { name: step.name })}
                onClick={() => {
                  matching.choose(step.step);
                  matching.begin(now());
                }}
              >
                {t('match.begins')}
              </button>
              <button
                type="button"
                class="button"
                disabled={busy || !step.done}
                aria-label={t('match.endsHere', { name: step.name })}
                onClick={() => matching.end(step.step, now())}
              >
                {t('match.ends')}
              </button>
              {step.done && step.done.end_ns > step.done.start_ns && (
                <button
                  type="button"
                  class="button"
                  disabled={busy}
                  aria-keyshortcuts="B"
                  aria-label={`${t(pauses ? 'match.resumes' : 'match.pauses')}: ${step.name}`}
                  onClick={() => pause(now())}
                >
                  {t(pauses ? 'match.resumes' : 'match.pauses')}
                </button>
              )}
              <button
                type="button"
                class="button button-quiet button-square"
                disabled={busy || !step.done}
                aria-label={t('match.remove', { name: step.name })}
                title={t('match.notDone')}
                onClick={() => matching.remove(step.step)}
              >
                <Icon name="cross" />
              </button>
            </span>
          </li>
        ))}
      </ol>
    </>
  );
}

export function MatchingPanel({ matching, picking, model, playback, pause }: Props) {
  const plan = matching.plan.value;
  const steps = matching.steps.value;
  const making = matching.making.value;
  const matched = useComputed(() => matching.steps.value.filter((one) => one.done).length).value;
  const lacks = matching.lacks.value;
  const work = picking.work.value;
  if (!plan) return null;
  const busy = making !== undefined;
  return (
    <section class="plan-panel matching" aria-label={t('match.title')}>
      <h2>{t('match.title')}</h2>
      <WorkChoice picking={picking} model={model} />
      <div class="matching-tools">
        <button type="button" class="button" disabled={!matching.canUndo.value || busy} aria-keyshortcuts="Control+Z" onClick={() => matching.undo()}>
          {t('match.undo')}
        </button>
        <button type="button" class="button" disabled={!matching.canRedo.value || busy} aria-keyshortcuts="Control+Shift+Z" onClick={() => matching.redo()}>
          {t('match.redo')}
        </button>
        <span class="muted">{t('match.matched', { n: matched, all: steps.length })}</span>
      </div>
      {work === 'steps' && <StepsPart matching={matching} model={model} playback={playback} pause={pause} />}
      <fieldset class="matching-part" disabled={busy}>
        {work === 'points' && <PointsPart matching={matching} picking={picking} model={model} playback={playback} />}
        {work === 'tools' && <ToolsPart matching={matching} picking={picking} model={model} playback={playback} />}
        {work === 'xray' && <XrayPart matching={matching} model={model} playback={playback} />}
      </fieldset>
      <fieldset class="matching-part" disabled={busy}>
        <OrganChoice matching={matching} model={model} />
      </fieldset>
      {making ? (
        <Making matching={matching} />
      ) : (
        <form
          class="matching-keep"
          onSubmit={(event) => {
            event.preventDefault();
            void matching.keep();
          }}
        >
          <label>
            <span>{t('match.name')}</span>
            <input
              value={matching.name.value}
              pattern="[a-z0-9][a-z0-9\-]{0,31}"
              maxLength={32}
              required
              title={t('match.nameWhat')}
              onInput={(event) => (matching.name.value = event.currentTarget.value)}
            />
          </label>
          <button type="submit" class="button button-main" disabled={matched === 0 || lacks !== undefined || matching.organLacks.value !== undefined}>
            {t('match.keep')}
          </button>
          <button type="button" class="button" onClick={() => matching.leave()}>
            {t('match.leave')}
          </button>
        </form>
      )}
      {lacks && <p class="plan-note">{t(`pick.lacks.${lacks}`)}</p>}
      <p class="muted plan-note">{t('match.keepWhat')}</p>
    </section>
  );
}
