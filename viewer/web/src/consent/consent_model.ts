// To what a case's patient consented, as the page goes by it. Pure, but for the purpose that is remembered.
import { signal } from '@preact/signals';
import type { CaseConsents } from '@/api/types';

/** What the person last exported for, until the page is left; '' for none. */
export const lastPurpose = signal('');

/** Why nothing may be exported for a purpose; the server goes by the same rules. */
export type Obstacle =
  | { why: 'demanded' }
  | { why: 'not-given'; purpose: string }
  | { why: 'withdrawn'; purpose: string; since: string; signed: boolean }
  | { why: 'not-checked'; problem: string };

/** `purpose`: '' where none is named. Undefined where nothing is in the way. */
export function obstacleTo(consents: CaseConsents, purpose: string): Obstacle | undefined {
  if (purpose === '') return consents.demand_purpose ? { why: 'demanded' } : undefined;
  if (consents.state === 'could-not-check') return { why: 'not-checked', problem: consents.problem ?? '' };
  const state = consents.purposes.find((one) => one.purpose === purpose);
  if (!state) return { why: 'not-given', purpose };
  return state.stands ? undefined : { why: 'withdrawn', purpose, since: state.since, signed: state.signed };
}

/** The remembered purpose where the site has it, else none. */
export const purposeAmong = (consents: CaseConsents, remembered: string): string => (consents.site_purposes.includes(remembered) ? remembered : '');
