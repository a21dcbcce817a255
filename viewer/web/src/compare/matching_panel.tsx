// Matching the plan's steps to moments by hand: each step with when it began and ended, the time map that follows from it, and keeping it as a comparison.
import { useComputed } from '@preact/signals';
import { formatTime, kSecond } from '@/base/time';
import type { MatchingModel } from '@/compare/matching_model';
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
    <svg class="map-picture" viewBox={`0 0 ${kWide} ${kHigh}`} preserveAspectRatio="none" role="img" aria-label={t('match.map', { n: map?.pieces.length ?? 0, all: plan.steps.length })}>
      {plan.steps.map((one) => (
        <line key={one.step} class="map-step" x1="0" x2={kWide} y1={y(one.start_s)} y2={y(one.start_s)} />
      ))}
      {(map?.pieces ?? []).map((piece) => (
        <polyline key={piece.step} class="map-piece" points={piece.knots.map((knot) => `${x(knot.case_ns).toFixed(1)},${y(knot.plan_s).toFixed(1)}`).join(' ')} />
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
    'making the plan\'s film': 'match.doing.film',
  };
  const key = known[text];
  return key ? t(key) : t('match.doing.beginning');
}

export function MatchingPanel({ matching, model, playback }: { matching: MatchingModel; model: CaseModel; playback: Playback }) {
  const plan = matching.plan.value;
  const steps = matching.steps.value;
  const making = matching.making.value;
  const chosen = matching.chosen.value;
  const matched = useComputed(() => matching.steps.value.filter((one) => one.done).length).value;
  if (!plan) return null;
  const now = () => playback.position_ns.peek();
  const time = (at_ns: number) => formatTime(at_ns - model.whole.start_ns, 3);
  const busy = making !== undefined;
  return (
    <section class="plan-panel matching" aria-label={t('match.title')}>
      <h2>{t('match.title')}</h2>
      <p class="muted plan-made">{t('match.what')}</p>
      <MapPicture matching={matching} playback={playback} />
      <div class="matching-tools">
        <button type="button" class="button" disabled={!matching.canUndo.value || busy} aria-keyshortcuts="Control+Z" onClick={() => matching.undo()}>
          {t('match.undo')}
        </button>
        <button type="button" class="button" disabled={!matching.canRedo.value || busy} aria-keyshortcuts="Control+Shift+Z" onClick={() => matching.redo()}>
          {t('match.redo')}
        </button>
        <span class="muted">{t('match.matched', { n: matched, all: steps.length })}</span>
      </div>
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
              <button type="button" class="button" disabled={busy || !step.done} aria-label={t('match.endsHere', { name: step.name })} onClick={() => matching.end(step.step, now())}>
                {t('match.ends')}
              </button>
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
      {making ? (
        <div class="matching-making" role="status">
          <progress {...(making.state === 'running' && making.share !== null ? { value: making.share } : {})} max="1" aria-label={t('match.making')} />
          <span>{making.state === 'running' ? doing(making.doing) : t('match.making')}</span>
          <button type="button" class="button" onClick={() => void matching.stop()}>
            {t('match.stop')}
          </button>
        </div>
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
          <button type="submit" class="button button-main" disabled={matched === 0}>
            {t('match.keep')}
          </button>
          <button type="button" class="button" onClick={() => matching.leave()}>
            {t('match.leave')}
          </button>
        </form>
      )}
      <p class="muted plan-note">{t('match.keepWhat')}</p>
    </section>
  );
}
