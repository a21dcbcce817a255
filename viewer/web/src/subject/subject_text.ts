// A case's patient, procedure and staff as lines of text. Pure functions.
import type { SaidOfCase, Subject } from '@/api/types';
import { t, word } from '@/i18n/i18n';

/** "Yamada Tarou (17, born 1980-01-15, M)"; "" where nothing of the patient is known. */
export function patientText(subject: Subject): string {
  const facts = [subject.patient_id ?? '', subject.birth_date ? t('subject.born', { date: subject.birth_date }) : '', subject.sex ?? ''].filter(
    (one) => one !== '',
  );
  const name = subject.patient ?? '';
  if (name === '') return facts.join(', ');
  return facts.length === 0 ? name : `${name} (${facts.join(', ')})`;
}

export const procedureText = (subject: Subject): string => subject.procedure ?? subject.procedure_code ?? '';

/** "Surgeon: Sato Hanako · nurse: Mori". A role that the page does not know stands as it was sent. */
export const staffText = (subject: Subject): string =>
  subject.staff
    .map(({ role, name, id }) => {
      const who = name ?? id ?? '';
      return role ? `${word('staff', role.toLowerCase())}: ${who}` : who;
    })
    .join(' · ');

/** What a person types; every field may stay empty. */
export interface TypedSubject {
  patient: string;
  patient_id: string;
  birth_date: string;
  procedure: string;
  surgeon: string;
}

/** As the subject file has it (docs/reference/format-streams.md); undefined where nothing was typed. */
export function saidByTyping(typed: TypedSubject): SaidOfCase['subject'] {
  const kept = (fields: Record<string, string>) => {
    const entries = Object.entries(fields)
      .map(([key, text]) => [key, text.trim()] as const)
      .filter(([, text]) => text !== '');
    return entries.length === 0 ? undefined : Object.fromEntries(entries);
  };
  const patient = kept({ id: typed.patient_id, name: typed.patient, birth_date: typed.birth_date });
  const procedure = kept({ description: typed.procedure });
  const surgeon = kept({ name: typed.surgeon });
  if (!patient && !procedure && !surgeon) return undefined;
  return {
    ...(patient ? { patient } : {}),
    ...(procedure ? { procedure } : {}),
    ...(surgeon ? { staff: [{ role: 'surgeon', ...surgeon }] } : {}),
  };
}
