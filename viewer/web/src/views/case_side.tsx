// Beside the pictures: vital signs, the plan, and moments.
import type { Signal } from '@preact/signals';
import type { Alarm, VitalNotice } from '@/api/types';
import type { PlanModel } from '@/compare/plan_model';
import { PlanPanel } from '@/compare/plan_panel';
import { t } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import type { CaseModel } from '@/views/case_model';
import { MomentsPanel } from '@/views/moments_panel';
import { VitalsPanel } from '@/vitals/vitals_panel';
import type { VitalsStore } from '@/vitals/vitals_store';

export type Tab = 'vitals' | 'moments' | 'plan';

interface Props {
  model: CaseModel;
  playback: Playback;
  tab: Signal<Tab>;
  /** Those that there are. */
  tabs: readonly Tab[];
  store: VitalsStore | undefined;
  plan: PlanModel | undefined;
  pause: (at_ns: number) => void;
  alarms: readonly Alarm[];
  notices: readonly VitalNotice[];
}

export function CaseSide({ model, playback, tab, tabs, store, plan, pause, alarms, notices }: Props) {
  const hasTabs = tabs.length > 1;
  return (
    <aside class="side" aria-label={t('case.side')}>
      {hasTabs && (
        <div class="tabs" role="tablist" aria-label={t('case.side')}>
          {tabs.map((one) => (
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
          <PlanPanel plan={plan} model={model} playback={playback} pause={pause} />
        ) : (
          <MomentsPanel model={model} playback={playback} alarms={alarms} notices={notices} sealed={!model.timeline.marks} />
        )}
      </div>
    </aside>
  );
}
