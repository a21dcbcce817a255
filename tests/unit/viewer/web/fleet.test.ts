import { describe, expect, it } from 'vitest';
import { hrefOf, parseRoute } from '@/base/route';
import { kAnything, queryOf, shownCase } from '@/fleet/question';

describe('What is asked of all appliances', () => {
  it('is anything, unless somebody narrows it', () => {
    expect(Object.fromEntries(queryOf(kAnything, 50))).toEqual({ limit: '50' });
  });
  it('is narrowed by appliance, verdict and what needs a person', () => {
    expect(Object.fromEntries(queryOf({ ...kAnything, appliance: 'or-2', verdict: 'tampered', attention: true }, 10, '2026,or-2,x'))).toEqual({
      limit: '10',
      appliance: 'or-2',
      verdict: 'tampered',
      attention: 'true',
      after: '2026,or-2,x',
    });
    expect(Object.fromEntries(queryOf({ ...kAnything, verdict: 'none' }, 10))).toEqual({ limit: '10', unverified: 'true' });
  });
  it('holds whole days of the place where somebody looks', () => {
    const query = queryOf({ ...kAnything, from: '2026-08-05', to: '2026-08-31' }, 10);
    expect(query.get('from')).toBe(new Date(2026, 7, 5).toISOString());
    expect(query.get('before')).toBe(new Date(2026, 8, 1).toISOString());
    expect(Object.fromEntries(queryOf({ ...kAnything, from: 'soon' }, 10))).toEqual({ limit: '10' });
  });
});

describe('A case with its appliance', () => {
  const id = 'or-1~20260805T091502Z-3f9c21ab';
  it('has an address, and is read back from it', () => {
    expect(parseRoute(hrefOf({ view: 'case', id }))).toEqual({ view: 'case', id });
    expect(parseRoute(hrefOf({ view: 'verification', id }))).toEqual({ view: 'verification', id });
  });
  it('is shown in two parts', () => {
    expect(shownCase(id)).toBe('or-1 · 20260805T091502Z-3f9c21ab');
    expect(shownCase('20260805T091502Z-3f9c21ab')).toBe('20260805T091502Z-3f9c21ab');
  });
  it('is listed for one appliance', () => {
    expect(parseRoute(hrefOf({ view: 'cases', appliance: 'or-1' }))).toEqual({ view: 'cases', appliance: 'or-1' });
    expect(parseRoute(hrefOf({ view: 'appliances' }))).toEqual({ view: 'appliances' });
  });
});
