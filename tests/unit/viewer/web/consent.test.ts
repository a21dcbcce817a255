// What stands in the way of an export for a purpose.
import { describe, expect, it } from 'vitest';
import type { CaseConsents } from '@/api/types';
import { obstacleTo, purposeAmong } from '@/consent/consent_model';
import { obstacleInWords } from '@/consent/purpose_choice';

const kSince = '2026-08-01T09:00:00.000000Z';
const stated = (more: Partial<CaseConsents> = {}): CaseConsents => ({
  site_purposes: ['teaching', 'research', 'publication'],
  demand_purpose: true,
  state: 'checked',
  problem: null,
  purposes: [
    { purpose: 'research', stands: true, since: kSince, entry: 7, signed: true },
    { purpose: 'teaching', stands: false, since: kSince, entry: 9, signed: true },
  ],
  ...more,
});

describe('An export', () => {
  it('needs a purpose where the site demands one', () => {
    expect(obstacleTo(stated(), '')).toEqual({ why: 'demanded' });
    expect(obstacleTo(stated({ demand_purpose: false }), '')).toBeUndefined();
  });
  it('for a purpose needs a consent to it, demanded or not', () => {
    for (const demand_purpose of [true, false]) {
      expect(obstacleTo(stated({ demand_purpose }), 'research')).toBeUndefined();
      expect(obstacleTo(stated({ demand_purpose }), 'publication')).toEqual({ why: 'not-given', purpose: 'publication' });
      expect(obstacleTo(stated({ demand_purpose }), 'teaching')).toEqual({ why: 'withdrawn', purpose: 'teaching', since: kSince, signed: true });
    }
  });
  it('is not said to be withdrawn by the patient where nobody signed that', () => {
    const purposes = [{ purpose: 'teaching', stands: false, since: kSince, entry: 9, signed: false }];
    const obstacle = obstacleTo(stated({ purposes }), 'teaching');
    expect(obstacle && obstacleInWords(obstacle)).toContain('nobody signed that entry in time');
  });
  it('for a purpose is not made where nobody can tell', () => {
    const untold = stated({ state: 'could-not-check', problem: 'nobody can tell', purposes: [], demand_purpose: false });
    expect(obstacleTo(untold, 'research')).toEqual({ why: 'not-checked', problem: 'nobody can tell' });
    expect(obstacleTo(untold, '')).toBeUndefined();
  });
  it('is for the purpose of the last one, as long as the site has that', () => {
    expect(purposeAmong(stated(), 'research')).toBe('research');
    expect(purposeAmong(stated(), 'billing')).toBe('');
  });
});
