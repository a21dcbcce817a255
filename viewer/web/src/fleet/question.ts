// What is asked of all appliances' cases, and how one of them is named. Pure.
import type { Verdict } from '@/api/types';

/** Empty fields ask for anything. */
export interface FleetQuestion {
  appliance: string;
  verdict: Verdict | 'none' | '';
  attention: boolean;
  /** Local days, as a date field has them: 2026-08-05. */
  from: string;
  to: string;
  /** A patient's number and a procedure's code, as somebody typed them. */
  patient: string;
  procedure: string;
}

export const kAnything: FleetQuestion = { appliance: '', verdict: '', attention: false, from: '', to: '', patient: '', procedure: '' };

/** Whether the server must look into search notes, which is entered in its log. */
export const isSearch = ({ patient, procedure }: FleetQuestion): boolean => patient !== '' || procedure !== '';

/** The moment at which a local day begins; `later`: so many days after. */
function beginOf(day: string, later: number): string | undefined {
  const [year, month, date] = day.split('-').map(Number);
  if (!year || !month || !date) return undefined;
  return new Date(year, month - 1, date + later).toISOString();
}

/** As the address has it. `after`: what the page before ended with. */
export function queryOf(question: FleetQuestion, limit: number, after?: string): URLSearchParams {
  const query = new URLSearchParams({ limit: String(limit) });
  if (question.appliance !== '') query.set('appliance', question.appliance);
  if (question.verdict === 'none') query.set('unverified', 'true');
  else if (question.verdict !== '') query.set('verdict', question.verdict);
  if (question.attention) query.set('attention', 'true');
  const from = beginOf(question.from, 0);
  const before = beginOf(question.to, 1);
  if (from !== undefined) query.set('from', from);
  if (before !== undefined) query.set('before', before);
  if (after !== undefined) query.set('after', after);
  return query;
}

/** The same as the body of a search: whom it is about stands in no address. */
export function searchOf(question: FleetQuestion, limit: number, after?: string): object {
  const { patient, procedure } = question;
  const asked = Object.fromEntries(queryOf(question, limit, after));
  const flags = { unverified: asked['unverified'] === 'true', attention: question.attention };
  return { ...asked, ...flags, limit, ...(patient !== '' && { patient }), ...(procedure !== '' && { procedure }) };
}

/** "or-1 · 20260805T091502Z-3f9c21ab" of a case that the address names with its appliance. */
export const shownCase = (id: string): string => id.replace('~', ' · ');
