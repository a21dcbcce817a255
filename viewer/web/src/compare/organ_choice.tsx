// Beside a comparison's start: whether the plan's organ shall be found in the recorded pictures by itself, where, and what that costs.
import { formatDuration, formatTime } from '@/base/time';
import type { MatchingModel } from '@/compare/matching_model';
import {
  kDeformedTimesAsLong,
  kGreatestField_deg,
  kLeastField_deg,
  kOrganAsked,
  kOrganViews,
  kTimesAsLong,
  type OrganAsked,
  type OrganView,
} from '@/compare/organ_asked';
import { t } from '@/i18n/i18n';
import type { CaseModel } from '@/views/case_model';

export function OrganChoice({ matching, model }: { matching: MatchingModel; model: CaseModel }) {
  const asked = matching.organ.value;
  const stretch = matching.organStretch.value;
  const lacks = matching.organLacks.value;
  const say = (more: Partial<OrganAsked>) => (matching.organ.value = { ...(matching.organ.peek() ?? kOrganAsked), ...more });
  const time = (at_ns: number) => formatTime(at_ns - model.whole.start_ns);
  const [least, most] = asked?.deformed ? kDeformedTimesAsLong : kTimesAsLong;
  const length_ns = stretch ? stretch.end_ns - stretch.start_ns : 0;
  return (
    <fieldset class="matching-part organ-choice">
      <label class="organ-switch">
        <input
          type="checkbox"
          checked={asked !== undefined}
          onChange={(event) => (matching.organ.value = event.currentTarget.checked ? kOrganAsked : undefined)}
        />
        <span>{t('organ.ask')}</span>
      </label>
      <p class="muted plan-note">{t('organ.askWhat')}</p>
      {asked && (
        <>
          <label class="plan-choice">
            <span>{t('organ.field')}</span>
            <input
              type="number"
              min={kLeastField_deg}
              max={kGreatestField_deg}
              step="any"
              required
              value={asked.field_deg ?? ''}
              onInput={(event) => say({ field_deg: event.currentTarget.value === '' ? null : Number(event.currentTarget.value) })}
            />
          </label>
          <label class="plan-choice">
            <span>{t('organ.view')}</span>
            <select value={asked.view} onChange={(event) => say({ view: event.currentTarget.value as OrganView })}>
              {kOrganViews.map((one) => (
                <option key={one} value={one}>
                  {t(`organ.view.${one}`)}
                </option>
              ))}
            </select>
          </label>
          <label class="plan-choice">
            <span>{t('organ.where')}</span>
            <select value={asked.where} onChange={(event) => say({ where: event.currentTarget.value as OrganAsked['where'] })}>
              <option value="steps">{t('organ.where.steps')}</option>
              <option value="selection">{t('organ.where.selection')}</option>
            </select>
          </label>
          <label class="organ-switch">
            <input type="checkbox" checked={asked.deformed} onChange={(event) => say({ deformed: event.currentTarget.checked })} />
            <span>{t('organ.deform')}</span>
          </label>
          <p class="muted plan-note">{t('organ.deformWhat')}</p>
          {stretch && lacks !== 'long' && lacks !== 'longDeformed' && (
            <p class="plan-note">
              {t('organ.takes', {
                from: time(stretch.start_ns),
                to: time(stretch.end_ns),
                least: formatDuration(least * length_ns),
                most: formatDuration(most * length_ns),
              })}
            </p>
          )}
          {lacks && <p class="plan-note organ-lacks">{t(`organ.lacks.${lacks}`)}</p>}
        </>
      )}
    </fieldset>
  );
}
