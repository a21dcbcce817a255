// Planning, a breathing lung or training by the viewer's own address; where it cannot be had: why, and how to get it. Once it is open it stays: whether its program has gone is
// found out when something is asked of it.
import type { ComponentChildren } from 'preact';
import { useEffect } from 'preact/hooks';
import { hrefOf } from '@/base/route';
import { t, word } from '@/i18n/i18n';
import { session } from '@/shell/state';
import { StateCard } from '@/shell/state_card';
import { lookForWorkplaces, type WorkplaceName, workplaces } from '@/shell/workplaces';

const kLookEvery_ms = 4_000;

export function WorkplaceView({ place, children }: { place: Exclude<WorkplaceName, 'cases'>; children: ComponentChildren }) {
  const state = workplaces.value[place];
  useEffect(() => {
    if (state === 'open') return;
    void lookForWorkplaces();
    const timer = setInterval(() => void lookForWorkplaces(), kLookEvery_ms);
    return () => clearInterval(timer);
  }, [state]);
  useEffect(() => {
    if (state !== 'open') document.title = `${t(`nav.${place}`)} · Kiroku`;
  });
  if (state === 'open') return <>{children}</>;
  if (state === undefined) return <main id="main" class="main narrow" tabIndex={-1} aria-busy="true" />;
  const name = t(`nav.${place}`);
  const role = word('role', session.value?.role ?? '');
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{name}</h1>
      </div>
      <StateCard
        icon={state === 'no-right' ? 'lock' : 'alarm'}
        title={t(`place.${state}`, { place: name, role })}
        what={t(state === 'no-right' ? `place.no-right.${place}` : state === 'not-running' ? `place.not-running.${place}` : 'place.not-installed.what')}
      >
        {state !== 'no-right' && (
          <button type="button" class="button button-main" onClick={() => void lookForWorkplaces()}>
            {t('state.again')}
          </button>
        )}
        <a class="button" href={hrefOf({ view: 'cases' })}>
          {t('state.allCases')}
        </a>
      </StateCard>
    </main>
  );
}
