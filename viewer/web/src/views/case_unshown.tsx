// Why a case cannot be shown, and the ways on.
import { ApiError } from '@/api/client';
import { hrefOf } from '@/base/route';
import { t } from '@/i18n/i18n';
import { may } from '@/shell/rights';
import { session, textOf } from '@/shell/state';
import { StateCard } from '@/shell/state_card';

export function CaseUnshown({ id, error }: { id: string; error: unknown }) {
  const isMissing = error instanceof ApiError && error.status === 404;
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <StateCard
        icon={isMissing ? 'search' : 'alarm'}
        title={t(isMissing ? 'case.missing' : 'case.damaged')}
        why={textOf(error)}
        what={t(isMissing ? 'case.missingWhat' : 'case.damagedWhat')}
      >
        {!isMissing && may(session.value?.role, 'verify') && (
          <a class="button button-main" href={hrefOf({ view: 'verification', id })}>
            {t('case.verify')}
          </a>
        )}
        <a class="button" href={hrefOf({ view: 'cases' })}>
          {t('state.allCases')}
        </a>
      </StateCard>
    </main>
  );
}
