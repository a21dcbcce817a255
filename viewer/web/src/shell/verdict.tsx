// A verdict in words, with its sign; colour only repeats what they say.
import type { Verdict } from '@/api/types';
import { formatMoment, t } from '@/i18n/i18n';
import { Icon, type IconName } from '@/shell/icon';

const kSigns: Record<Verdict, IconName> = {
  intact: 'intact',
  'intact-with-gaps': 'gaps',
  'intact-excerpt': 'gaps',
  unproven: 'unproven',
  incomplete: 'incomplete',
  tampered: 'tampered',
};

export const verdictSign = (verdict: Verdict | null): IconName => (verdict ? kSigns[verdict] : 'notVerified');

export function VerdictChip({ verdict }: { verdict: Verdict | null }) {
  return (
    <span class={`verdict verdict-${verdict ?? 'none'}`}>
      <Icon name={verdictSign(verdict)} />
      {verdict ? t(`verdict.${verdict}`) : t('verdict.none')}
    </span>
  );
}

/** When it was found: a verdict says what was there then. */
export function VerdictTime({ verified }: { verified: string | null }) {
  return verified ? <small class="muted">{t('verify.when', { moment: formatMoment(verified) })}</small> : null;
}
