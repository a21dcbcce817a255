import { describe, expect, it } from 'vitest';
import type { FleetCase } from '@/api/types';
import { hrefOf, parseRoute } from '@/base/route';
import { type CasesPage, FoundCases } from '@/fleet/found_cases';
import { type FleetQuestion, isSearch, kAnything, queryOf, searchOf, shownCase } from '@/fleet/question';

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

describe('A search by patient or procedure', () => {
  it('is what names one of them', () => {
    expect(isSearch({ ...kAnything, appliance: 'or-2' })).toBe(false);
    expect(isSearch({ ...kAnything, patient: '12345' })).toBe(true);
    expect(isSearch({ ...kAnything, procedure: 'K653' })).toBe(true);
  });
  it('is told in a body, and never in an address', () => {
    const asked = { ...kAnything, patient: '12345', appliance: 'or-2', verdict: 'none', attention: true } as const;
    expect(searchOf(asked, 50, 'x')).toEqual({ patient: '12345', appliance: 'or-2', unverified: true, attention: true, limit: 50, after: 'x' });
    expect(searchOf({ ...kAnything, procedure: 'K653', verdict: 'intact' }, 50)).toEqual({
      procedure: 'K653',
      verdict: 'intact',
      unverified: false,
      attention: false,
      limit: 50,
    });
    expect(queryOf(asked, 50).toString()).not.toContain('12345');
  });
});

describe('The list of cases', () => {
  const page = (next: string | null, ...ids: string[]): CasesPage => ({ cases: ids.map((id) => ({ id }) as FleetCase), next });
  /** Each question is answered when the test says so. */
  const catalogue = () => {
    const waiting: { after: string | undefined; answer: (page: CasesPage) => void; fail: (error: Error) => void }[] = [];
    const cases = new FoundCases((_question, after) => new Promise<CasesPage>((answer, fail) => waiting.push({ after, answer, fail })));
    const ids = () => cases.list.peek()?.map(({ id }) => id);
    return { cases, ids, waiting };
  };
  const kTampered: FleetQuestion = { ...kAnything, verdict: 'tampered' };

  it('never stands under another question than its own', async () => {
    const { cases, ids, waiting } = catalogue();
    const all = cases.find(kAnything);
    waiting[0]?.answer(page('b', 'a', 'b'));
    expect(await all).toBe(true);
    const more = cases.more();
    expect(waiting[1]?.after).toBe('b');
    const tampered = cases.find(kTampered);
    expect([ids(), cases.next.peek()]).toEqual([undefined, null]);
    waiting[1]?.answer(page(null, 'c')); // of the question before
    await more;
    waiting[2]?.fail(new Error('the catalogue does not answer'));
    expect(await tampered).toBe(false);
    expect([ids(), cases.next.peek(), cases.problem.peek()]).toEqual([undefined, null, 'the catalogue does not answer']);
    const again = cases.find(kTampered);
    expect(cases.problem.peek()).toBe(undefined);
    waiting[3]?.answer(page(null, 'd'));
    await again;
    expect([ids(), cases.problem.peek()]).toEqual([['d'], undefined]);
  });
  it('is asked again when the server is back, unless it is a search, which stands in the log', async () => {
    const { cases, ids, waiting } = catalogue();
    expect(await cases.again()).toBe(false);
    const all = cases.find(kAnything);
    waiting[0]?.fail(new Error('the server does not answer'));
    await all;
    const again = cases.again();
    waiting[1]?.answer(page(null, 'a'));
    expect([await again, ids()]).toEqual([true, ['a']]);
    const search = cases.find({ ...kAnything, patient: '12345' });
    waiting[2]?.answer(page(null, 'b'));
    await search;
    expect([await cases.again(), waiting.length, ids()]).toEqual([false, 3, ['b']]);
  });
  it('says how many cases a search could not find', async () => {
    const { cases, waiting } = catalogue();
    const search = cases.find({ ...kAnything, patient: '12345' });
    waiting[0]?.answer({ ...page(null, 'a'), looked_at: 5, without_note: 2, not_by_this_key: 1 });
    await search;
    expect(cases.lookedAt.peek()).toEqual({ looked_at: 5, without_note: 2, not_by_this_key: 1 });
    const all = cases.find(kAnything);
    expect(cases.lookedAt.peek()).toBe(undefined);
    waiting[1]?.answer(page(null, 'a'));
    await all;
    expect(cases.lookedAt.peek()).toBe(undefined);
  });
  it('has each page once, however often it is asked for', async () => {
    const { cases, ids, waiting } = catalogue();
    const all = cases.find(kAnything);
    waiting[0]?.answer(page('b', 'a', 'b'));
    await all;
    const both = [cases.more(), cases.more()];
    waiting[1]?.answer(page('d', 'c', 'd'));
    waiting[2]?.answer(page('d', 'c', 'd'));
    await Promise.all(both);
    expect(ids()).toEqual(['a', 'b', 'c', 'd']);
  });
  it('stays while the same is asked again in vain', async () => {
    const { cases, ids, waiting } = catalogue();
    const all = cases.find(kAnything);
    waiting[0]?.answer(page(null, 'a'));
    await all;
    const again = cases.find(kAnything);
    waiting[1]?.fail(new Error('the catalogue does not answer'));
    expect(await again).toBe(false);
    expect([ids(), cases.problem.peek()]).toEqual([['a'], undefined]);
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
