// What a surgeon reads in a minute of an organ that was found in the pictures by itself: in how many, how well, where not and why, and what the outline leaves out.
import type { ComparedStep, OrganAlignment } from '@/api/types';
import { formatDuration, formatTime, kMinute, kSecond } from '@/base/time';
import { type StepDeparture, stepDepartures } from '@/compare/organ_departure';
import { rigidCounts } from '@/compare/organ_shape';
import type { OrganSummary as Summary } from '@/compare/organ_place';
import type { PlanModel } from '@/compare/plan_model';
import { t, word } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { Icon } from '@/shell/icon';
import type { CaseModel } from '@/views/case_model';

/** Longer lists are folded: the longest stretches say most. */
const kListed = 6;

/** Shorter than a minute to the tenth of a second: most losses are. */
const lasted = (ns: number) => (ns < kMinute ? `${(ns / kSecond).toFixed(1)} s` : formatDuration(ns));

interface Props {
  plan: PlanModel;
  alignment: OrganAlignment;
  summary: Summary;
  steps: readonly ComparedStep[];
  model: CaseModel;
  playback: Playback;
}

/** A step in a line: that it departed, and by how much; that it did not; or that nothing can be said, and why. */
export function departureLine(one: StepDeparture): string {
  const step = `${one.step}. ${one.name}`;
  if (one.is === 'departed')
    return t('organ.stepDeparted', { step, most: one.largest_mm.toFixed(0), mm: one.error_mm.toFixed(1), n: one.pictures, all: one.compared });
  if (one.is === 'planned') return t('organ.stepPlanned', { step, all: one.compared });
  return t('organ.stepUnknown', { step, why: word('organ', one.why ?? 'departure.unknown') });
}

function Departures({
  plan,
  departures,
  time,
  playback,
}: {
  plan: PlanModel;
  departures: StepDeparture[];
  time: (at_ns: number) => string;
  playback: Playback;
}) {
  return (
    <>
      <h4>{t('organ.departures')}</h4>
      <ul class="organ-lost">
        {departures.map((one) => (
          <li key={one.step}>
            {departureLine(one)}{' '}
            {one.at_ns !== undefined && (
              <button type="button" class="link mono" onClick={() => playback.seek(one.at_ns as number)}>
                {time(one.at_ns)}
              </button>
            )}
          </li>
        ))}
      </ul>
      <label class="plan-choice">
        <span>{t('organ.colours')}</span>
        <select value={plan.fromPlan.value ? 'plan' : 'rest'} onChange={(event) => (plan.fromPlan.value = event.currentTarget.value === 'plan')}>
          <option value="rest">{t('organ.colours.rest')}</option>
          <option value="plan">{t('organ.colours.plan')}</option>
        </select>
      </label>
      <p class="muted plan-note">{t('organ.departureNote')}</p>
    </>
  );
}

export function OrganSummary({ plan, alignment, summary, steps, model, playback }: Props) {
  const departures = stepDepartures(alignment, steps);
  const time = (at_ns: number) => formatTime(at_ns - model.whole.start_ns, 1);
  const span = { from: time(alignment.start_ns), to: time(alignment.end_ns) };
  const longest = [...summary.lost].sort((a, b) => b.end_ns - b.start_ns - (a.end_ns - a.start_ns));
  const shown = longest.slice(0, kListed).sort((a, b) => a.start_ns - b.start_ns);
  return (
    <section class="organ-summary" aria-label={t('organ.title')}>
      <h3>{t('organ.title')}</h3>
      <p>
        <Icon name={summary.placed > 0 ? 'check' : 'cross'} />{' '}
        {summary.placed > 0 ? t('organ.found', { n: summary.placed, all: summary.looked, ...span }) : t('organ.foundNone', { all: summary.looked, ...span })}
      </p>
      {summary.half_mm !== undefined && summary.most_mm !== undefined && (
        <p>{t('organ.errors', { half: summary.half_mm.toFixed(1), most: summary.most_mm.toFixed(1) })}</p>
      )}
      {alignment.deformed && (
        <>
          <p>{t('organ.deformedIn', { n: alignment.deformed.pictures, all: summary.looked, most: alignment.deformed.largest_mm.toFixed(0) })}</p>
          <ul class="organ-lost">
            {rigidCounts(alignment).map(({ why, pictures }) => (
              <li key={why}>{t('organ.rigidIn', { n: pictures, why: word('organ.rigid', why) })}</li>
            ))}
          </ul>
        </>
      )}
      {departures.length > 0 && <Departures plan={plan} departures={departures} time={time} playback={playback} />}
      {summary.lost.length > 0 && (
        <>
          <p>{t('organ.lostAll', { n: summary.lost.length, time: lasted(summary.lost_ns) })}</p>
          <ul class="organ-lost">
            {shown.map((one) => (
              <li key={one.start_ns}>
                <button type="button" class="link mono" onClick={() => playback.seek(one.start_ns)}>
                  {time(one.start_ns)} – {time(one.end_ns)}
                </button>{' '}
                {one.whys.map((why) => word('organ.why', why)).join(' · ')}
              </li>
            ))}
          </ul>
          {longest.length > shown.length && <p class="muted plan-note">{t('organ.lostMore', { n: longest.length - shown.length })}</p>}
        </>
      )}
      {summary.placed > 0 &&
        (alignment.surface ? (
          <label class="organ-switch">
            <input type="checkbox" checked={plan.outline.value} onChange={(event) => (plan.outline.value = event.currentTarget.checked)} />
            <span>{t('organ.outline')}</span>
          </label>
        ) : (
          <p class="plan-note">{t('organ.noSurface')}</p>
        ))}
      <p class="muted plan-note">
        {t(alignment.deformed ? 'organ.deformedNote' : 'organ.rigid')}
        {alignment.surface && alignment.surface.moved_mm > 0 && ` ${t('organ.coarse', { mm: alignment.surface.moved_mm.toFixed(1) })}`}
      </p>
    </section>
  );
}
