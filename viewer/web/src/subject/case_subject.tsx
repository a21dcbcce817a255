// Whom a case is about, in its header; and in the list of cases.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { ApiError, cases as api } from '@/api/client';
import type { CaseSummary, Subject } from '@/api/types';
import { formatTime } from '@/base/time';
import { t } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import { attempt } from '@/shell/state';
import { patientText, procedureText, staffText } from '@/subject/subject_text';

function Texts({ subject }: { subject: Subject }) {
  const patient = patientText(subject);
  const procedure = procedureText(subject);
  const staff = staffText(subject);
  return (
    <>
      <strong class="subject-patient">{patient === '' ? t('subject.noName') : patient}</strong>
      {procedure !== '' && <span class="subject-procedure">{procedure}</span>}
      {staff !== '' && <span class="subject-staff muted">{staff}</span>}
    </>
  );
}

/** Of an unlocked case: what stood at the end, and what was said before if it was another. */
export function CaseSubject({ id }: { id: string }) {
  const known = useSignal<{ state: 'none' | 'shown' | 'not-yours'; subjects: Subject[] } | { problem: string } | undefined>(undefined);
  useEffect(() => {
    known.value = undefined;
    void attempt(async () => {
      try {
        known.value = await api.subject(id);
      } catch (error) {
        // A file that was changed is no reason to show nothing of the case.
        if (!(error instanceof ApiError) || error.status !== 422) throw error;
        known.value = { problem: error.message };
      }
    });
  }, [id]);
  const now = known.value;
  if (!now) return null;
  if ('problem' in now) {
    return (
      <p class="subject subject-problem">
        <Icon name="alarm" />
        <span>{now.problem}</span>
      </p>
    );
  }
  const last = now.subjects.at(-1);
  if (!last) return <p class="subject muted">{t(now.state === 'not-yours' ? 'subject.notYours' : 'subject.none')}</p>;
  return (
    <div class="subject">
      <Texts subject={last} />
      {now.subjects.length > 1 && (
        <details class="subject-earlier">
          <summary>{t('subject.earlier', { n: now.subjects.length - 1 })}</summary>
          <ul>
            {now.subjects.slice(0, -1).map((one) => (
              <li key={one.time_ns ?? -1}>
                <span class="muted">{one.time_ns === undefined ? t('subject.atBeginning') : formatTime(one.time_ns)}</span> <Texts subject={one} />
              </li>
            ))}
          </ul>
        </details>
      )}
    </div>
  );
}

export function ListedSubject({ one }: { one: CaseSummary }) {
  if (one.subject) {
    return (
      <span class="subject case-subject">
        <Texts subject={one.subject} />
      </span>
    );
  }
  const state = one.subject_state;
  if (state !== 'not-yours' && state !== 'problem' && state !== 'not-read') return null;
  return <span class="case-subject muted">{t(state === 'not-yours' ? 'subject.notYours' : state === 'problem' ? 'subject.problem' : 'subject.notRead')}</span>;
}
