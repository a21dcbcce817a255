// The fit to all radiographs: begun and cancelled, and what it came to.
import { useSignal } from '@preact/signals';
import type { Fitted } from '@/breathing/breathing_api';
import type { LungController } from '@/breathing/lung_controller';
import { kGroups, kNumbers, type Motion, sameMotion } from '@/breathing/motion';
import { kDigits, kUnits } from '@/breathing/motion_sliders';
import { t } from '@/i18n/i18n';
import { inOwnWords } from '@/i18n/server_words';
import { Icon } from '@/shell/icon';

function Found({ fitted, motion }: { fitted: Fitted; motion: Motion }) {
  const { errors, motion: found, similarity, tumour } = fitted;
  if (!errors || !found) return <p role="alert">{t('breathing.fit.refused', { why: fitted.refusal ?? '' })}</p>;
  return (
    <>
      <table class="lung-found">
        <caption>
          {t('breathing.fit.found', { took: fitted.took_s.toFixed(1) })}
          {!sameMotion(found, motion) && ` ${t('breathing.fit.moved')}`}
        </caption>
        <thead>
          <tr>
            <td />
            {kGroups.map((group) => (
              <th key={group} scope="col">
                {t(`breathing.${group}`)}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {kNumbers.map((number) => (
            <tr key={number}>
              <th scope="row">
                {t(`breathing.${number}`)} <small class="muted">{kUnits[number]}</small>
              </th>
              {kGroups.map((group) => (
                <td key={group} class="mono">
                  {found[group][number].toFixed(kDigits[number])} ± {errors[group][number].toFixed(kDigits[number] + 1)}
                </td>
              ))}
            </tr>
          ))}
          <tr>
            <th scope="row">{t('breathing.fit.explained')}</th>
            {kGroups.map((group) => (
              <td key={group} class="mono">
                {(100 * errors[group].explained).toFixed(0)} %
              </td>
            ))}
          </tr>
        </tbody>
      </table>
      {found.cycle_s !== null && errors.cycle_s !== null && (
        <p>
          {t('breathing.cycle')}:{' '}
          <span class="mono">
            {found.cycle_s.toFixed(3)} ± {errors.cycle_s.toFixed(4)} s
          </span>
        </p>
      )}
      <p>{t('breathing.fit.similarity', { before: similarity.before.toFixed(3), after: similarity.after.toFixed(3) })}</p>
      <p>{t('breathing.fit.seen', { n: tumour.filter((one) => one !== null).length, all: tumour.length })}</p>
      {fitted.findings.map((finding) => (
        <p key={finding} class="muted">
          {finding}
        </p>
      ))}
    </>
  );
}

export function FitCard({ lung, motion, canFit }: { lung: LungController; motion: Motion; canFit: boolean }) {
  const direction = useSignal(false);
  const fitting = lung.fitting.value;
  const fitted = lung.fit.value;
  return (
    <section class="card lung-group" aria-label={t('breathing.fit.title')}>
      <div class="lung-fit">
        <button type="button" class="button" disabled={!canFit || fitting !== undefined} onClick={() => lung.fitAll(direction.value)}>
          <Icon name="fit" />
          {t('breathing.fit')}
        </button>
        <label class="train-check">
          <input type="checkbox" checked={direction.value} onChange={(event) => (direction.value = event.currentTarget.checked)} />
          <span>{t('breathing.fit.direction')}</span>
        </label>
      </div>
      {!canFit && <p class="muted">{t('breathing.fit.few')}</p>}
      {fitting && (
        <div class="lung-fit" role="status">
          <progress max={fitting.all} value={fitting.done} aria-label={t('breathing.fit.title')} />
          <button type="button" class="button" onClick={() => lung.cancelFit()}>
            {t('breathing.fit.cancel')}
          </button>
          <span class="muted">{fitting.doing && inOwnWords(fitting.doing, 409)}</span>
        </div>
      )}
      {fitted && !fitting && <Found fitted={fitted} motion={motion} />}
    </section>
  );
}
