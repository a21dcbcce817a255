// What the catalogue knows of each appliance: what it has in the store, and what of that needs a person.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { FleetAppliance } from '@/api/types';
import { hrefOf } from '@/base/route';
import { formatBytes } from '@/base/time';
import { fleet } from '@/fleet/fleet_api';
import { formatMoment, t } from '@/i18n/i18n';
import { returns } from '@/shell/connection';
import { Icon } from '@/shell/icon';
import { StateCard } from '@/shell/state_card';
import { attempt } from '@/shell/state';

/** What needs a person, gravest first. */
const kConcerns = ['not_intact', 'missing', 'unreadable', 'incomplete', 'unproven', 'not_checked'] as const;

function Concerns({ one }: { one: FleetAppliance }) {
  const told = kConcerns.filter((what) => one[what] > 0);
  if (told.length === 0) {
    return (
      <span class="fleet-well">
        <Icon name="check" />
        {t('fleet.nothing')}
      </span>
    );
  }
  return (
    <span class="fleet-concern">
      <Icon name="alarm" />
      {told.map((what) => t(`fleetConcern.${what}`, { n: one[what] })).join(', ')}
    </span>
  );
}

export function AppliancesView() {
  const all = useSignal<readonly FleetAppliance[] | undefined>(undefined);
  useEffect(() => {
    document.title = `${t('nav.appliances')} · Kiroku`;
  });
  useEffect(() => {
    void attempt(async () => {
      all.value = await fleet.appliances();
    });
  }, [returns.value]);
  return (
    <main id="main" class="main narrow" tabIndex={-1} aria-busy={all.value === undefined}>
      <div class="view-head">
        <h1>{t('nav.appliances')}</h1>
      </div>
      <p class="muted fleet-what">{t('fleet.appliancesWhat')}</p>
      {all.value?.length === 0 && <StateCard icon="rooms" title={t('fleet.noAppliance')} what={t('fleet.noneWhat')} />}
      {all.value !== undefined && all.value.length > 0 && (
        <section class="card table-card">
          <div class="log-scroll" tabIndex={0} role="region" aria-label={t('nav.appliances')}>
            <table class="table">
              <thead>
                <tr>
                  <th scope="col">{t('fleet.appliance')}</th>
                  <th scope="col">{t('fleet.needs')}</th>
                  <th scope="col" class="number">
                    {t('nav.cases')}
                  </th>
                  <th scope="col" class="number">
                    {t('fleet.open')}
                  </th>
                  <th scope="col" class="number">
                    {t('fleet.unverified')}
                  </th>
                  <th scope="col" class="number">
                    {t('cases.size')}
                  </th>
                  <th scope="col">{t('fleet.newest')}</th>
                  <th scope="col">{t('fleet.seen')}</th>
                </tr>
              </thead>
              <tbody>
                {all.value.map((one) => (
                  <tr key={one.name}>
                    <th scope="row">
                      <a href={hrefOf({ view: 'cases', appliance: one.name })}>{one.name}</a>
                    </th>
                    <td>
                      <Concerns one={one} />
                    </td>
                    <td class="number">{one.cases}</td>
                    <td class="number">{one.open}</td>
                    <td class="number">{one.unverified}</td>
                    <td class="number">{formatBytes(one.bytes)}</td>
                    <td>{formatMoment(one.newest)}</td>
                    <td>{formatMoment(one.seen)}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          </div>
        </section>
      )}
    </main>
  );
}
