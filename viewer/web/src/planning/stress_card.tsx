// Whether stress is shown, by which scale, and what the organ came to.
import { t } from '@/i18n/i18n';
import type { PlanMoment } from '@/planning/planning_api';
import type { TableController } from '@/planning/table_controller';

const kLeastScale_pa = 10;
const kMostScale_pa = 10_000_000;

export function StressCard({ table, now }: { table: TableController; now: PlanMoment | undefined }) {
  return (
    <div class="card planning-stress">
      <label class="train-check">
        <input type="checkbox" checked={table.stress.value} onChange={(event) => table.showStress(event.currentTarget.checked)} />
        <span>
          {t('planning.stress')} <kbd>S</kbd>
        </span>
      </label>
      <label class="field">
        <span>{t('planning.stressMost')}</span>
        <input
          type="number"
          min={kLeastScale_pa}
          max={kMostScale_pa}
          step="any"
          value={table.largest_pa.value}
          onChange={(event) => {
            const pa = Number(event.currentTarget.value);
            if (pa >= kLeastScale_pa && pa <= kMostScale_pa) table.showStress(table.stress.value, pa);
          }}
        />
      </label>
      <dl class="attempt-facts">
        <div>
          <dt>{t('planning.largestStress')}</dt>
          <dd class="mono">{(now?.largest_von_mises_pa ?? 0).toFixed(0)} Pa</dd>
        </div>
        <div>
          <dt>{t('planning.largestMove')}</dt>
          <dd class="mono">{(1000 * (now?.largest_displacement_m ?? 0)).toFixed(1)} mm</dd>
        </div>
        <div>
          <dt>{t('planning.time')}</dt>
          <dd class="mono">{(now?.time_s ?? 0).toFixed(1)} s</dd>
        </div>
      </dl>
    </div>
  );
}
