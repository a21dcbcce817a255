// What a case may be used for, in its header. The log names nobody in the clear, and neither does this.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { cases as api } from '@/api/client';
import type { CaseConsents as Stated } from '@/api/types';
import { formatMoment, t, word } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import { attempt } from '@/shell/state';

const named = (purposes: Stated['purposes']): string => purposes.map((one) => word('purpose', one.purpose)).join(', ');

export function CaseConsents({ id }: { id: string }) {
  const known = useSignal<Stated | undefined>(undefined);
  useEffect(() => {
    known.value = undefined;
    void attempt(async () => (known.value = await api.consents(id)));
  }, [id]);
  const now = known.value;
  if (!now) return null;
  if (now.state === 'could-not-check') {
    return (
      <details class="consents consents-problem">
        <summary>
          <Icon name="alarm" />
          <span>{t('consent.notChecked')}</span>
        </summary>
        <p>{now.problem}</p>
      </details>
    );
  }
  // A site that asks for no consents is told of none.
  if (now.purposes.length === 0) return now.demand_purpose ? <p class="consents muted">{t('consent.none')}</p> : null;
  const standing = now.purposes.filter((one) => one.stands);
  const withdrawn = now.purposes.filter((one) => !one.stands && one.signed);
  const doubted = now.purposes.filter((one) => !one.stands && !one.signed);
  return (
    <details class="consents">
      <summary>
        {standing.length > 0 && <span>{t('consent.stands', { purposes: named(standing) })}</span>}
        {withdrawn.length > 0 && <span class="consents-withdrawn">{t('consent.withdrawn', { purposes: named(withdrawn) })}</span>}
        {doubted.length > 0 && <span class="consents-withdrawn">{t('consent.unsigned', { purposes: named(doubted) })}</span>}
      </summary>
      <ul>
        {now.purposes.map((one) => (
          <li key={one.purpose}>
            {t(one.stands ? 'consent.since' : one.signed ? 'consent.withdrawnOn' : 'consent.withdrawnUnsigned', {
              purpose: word('purpose', one.purpose),
              moment: formatMoment(one.since),
            })}
          </li>
        ))}
      </ul>
    </details>
  );
}
