// Planning: which plan, then the plan itself.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { t } from '@/i18n/i18n';
import { type ListedPlan, planning } from '@/planning/planning_api';
import { TableView } from '@/planning/table_view';
import { notify } from '@/shell/state';
import { useAsked, WithoutAnswer } from '@/shell/use_asked';

export function PlanningView() {
  const plans = useAsked<ListedPlan[]>(planning.plans);
  const open = useSignal<{ plan: string; anew: boolean } | undefined>(undefined);
  useEffect(() => {
    document.title = `${t('nav.planning')} · Kiroku`;
  });

  if (open.value) {
    return (
      <TableView
        open={open.value}
        leave={(sentence) => {
          if (sentence) notify(sentence);
          open.value = undefined;
          void plans.ask();
        }}
      />
    );
  }
  const all = plans.answer.value;
  if (!all) return <WithoutAnswer asked={plans} title={t('nav.planning')} />;
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{t('planning.title')}</h1>
      </div>
      <p class="train-what">{t('planning.what')}</p>
      {all.length === 0 && <p class="muted">{t('planning.none')}</p>}
      <ul class="planning-list" aria-label={t('planning.list')}>
        {all.map(({ plan, name, steps, has_volume }) => (
          <li class="card" key={plan}>
            <h2>{name || plan}</h2>
            <p class="muted">
              {plan} · {t('planning.stepsCount', { n: steps })}
              {!has_volume && ` · ${t('planning.noVolume')}`}
            </p>
            {has_volume && (
              <div class="train-do">
                <button
                  type="button"
                  class="button button-main"
                  onClick={() => (open.value = { plan, anew: false })}
                  aria-label={t('planning.openOf', { plan })}
                >
                  {t('planning.open')}
                </button>
                <button type="button" class="button" onClick={() => (open.value = { plan, anew: true })} aria-label={t('planning.anewOf', { plan })}>
                  {t('planning.anew')}
                </button>
              </div>
            )}
          </li>
        ))}
      </ul>
    </main>
  );
}
