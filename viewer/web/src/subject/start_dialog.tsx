// Whom a case is about and which plan it follows, asked before it begins; the first also while it runs. Nothing of it is needed: a recording is never held up.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { appliance as api } from '@/api/client';
import type { RoomStatus, SaidOfCase, StartChoices } from '@/api/types';
import { typed } from '@/base/form_fields';
import { formatMoment, t, word } from '@/i18n/i18n';
import { wayInOwnWords } from '@/i18n/way_words';
import { type About, aboutNow, recordedCase, type Standing, standingOf } from '@/rooms/about_case';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import { textOf } from '@/shell/state';
import { patientText, procedureText, saidByTyping, staffText } from '@/subject/subject_text';

const kNobody = '';
const kTyped = 'typed';
/** From so many procedures on one can look for one. */
const kManyProcedures = 6;

interface Props {
  room: RoomStatus;
  /** Nobody says what the room does now. */
  unheard: boolean;
  /** Says it of the case that the dialog is about; where that fails it stays open, with all that was typed. */
  onSaid: (about: About, said: SaidOfCase) => Promise<void>;
  onClose: () => void;
}

const kNothing: Omit<StartChoices, 'room'> = { procedures: [], ways: [], plans: [] };

/** That the room has gone on since the dialog was opened, and of which case its words are now, which a person says; or that nobody knows. */
function Changed({ room, about, standing, onChanged }: { room: RoomStatus; about: About; standing: Standing; onChanged: (now: About) => void }) {
  if (standing === 'stands') return null;
  const belongs = standing === 'wait' || standing === 'unheard' ? '' : recordedCase(room) === '' ? t('start.toAnother') : t('start.toCase', { id: room.case });
  return (
    <div class="changed" role="alert">
      <p class="problem">
        <Icon name="alarm" /> {t(`start.${standing}`, { room: room.room, id: room.case, earlier: about.case })}
      </p>
      {belongs !== '' && (
        <button type="button" class="button" onClick={() => onChanged(aboutNow(room))}>
          {belongs}
        </button>
      )}
    </div>
  );
}

export function StartDialog({ room: status, unheard, onSaid, onClose }: Props) {
  const { room } = status;
  const about = useSignal(aboutNow(status));
  const starts = about.value.begins;
  const saying = useSignal(false);
  const choices = useSignal<Omit<StartChoices, 'room'> | undefined>(undefined);
  const problem = useSignal('');
  const chosen = useSignal(kNobody);
  const looksFor = useSignal('');
  const filled = useSignal(false);
  useEffect(() => {
    const ask = async () => {
      try {
        choices.value = await api.choices(room);
      } catch (error) {
        problem.value = textOf(error);
        choices.value = kNothing;
      }
    };
    void ask();
  }, [room]);

  const { procedures, ways, plans } = choices.value ?? kNothing;
  const hasList = procedures.length > 0;
  const types = !hasList || chosen.value === kTyped;
  const isSaid = types ? filled.value : chosen.value !== kNobody;
  const standing = standingOf(about.value, status, unheard);
  const stands = standing === 'stands';
  const words = looksFor.value.toLowerCase().split(/\s+/);
  const shown = procedures.filter(({ key, subject }) => {
    const text = `${patientText(subject)} ${procedureText(subject)} ${staffText(subject)}`.toLowerCase();
    return key === chosen.value || words.every((one) => text.includes(one));
  });

  const saidIn = (form: HTMLFormElement): SaidOfCase => {
    const fields = new FormData(form);
    const field = (name: string) => typed(fields, name);
    const subject = types
      ? saidByTyping({
          patient: field('patient'),
          patient_id: field('patient_id'),
          birth_date: field('birth_date'),
          procedure: field('procedure'),
          surgeon: field('surgeon'),
        })
      : undefined;
    const plan = field('plan');
    return {
      ...(subject ? { subject } : {}),
      ...(!types && chosen.value !== kNobody ? { procedure: chosen.value } : {}),
      ...(plan === '' ? {} : { plan }),
    };
  };
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    const said = saidIn(event.currentTarget as HTMLFormElement);
    if (saying.value || !stands || (!starts && !said.subject && !said.procedure)) return;
    saying.value = true;
    problem.value = '';
    const say = async () => {
      try {
        await onSaid(about.value, said);
        onClose();
      } catch (error) {
        problem.value = textOf(error);
        saying.value = false;
      }
    };
    void say();
  };
  const look = (event: Event) => (filled.value = saidIn(event.currentTarget as HTMLFormElement).subject !== undefined);
  const choice = (value: string, content: preact.ComponentChildren) => (
    <label class="start-choice" key={value}>
      <input type="radio" name="who" value={value} checked={chosen.value === value} onChange={() => (chosen.value = value)} />
      <span>{content}</span>
    </label>
  );
  return (
    <Dialog title={t(starts ? 'start.title' : 'start.lateTitle', { room })} onClose={onClose}>
      <form class="start-form" onSubmit={submit} onInput={look} autocomplete="off">
        {hasList && (
          <fieldset class="start-who">
            <legend>{t('start.who')}</legend>
            {procedures.length >= kManyProcedures && (
              <label class="field">
                <span>{t('start.find')}</span>
                <input type="search" value={looksFor.value} onInput={(event) => (looksFor.value = event.currentTarget.value)} />
              </label>
            )}
            <div class="start-choices">
              {starts && choice(kNobody, t('start.nobody'))}
              {shown.map(({ key, subject }) =>
                choice(
                  key,
                  <>
                    <strong>{patientText(subject) || t('subject.noName')}</strong>
                    <span>{procedureText(subject)}</span>
                    <small class="muted">{[subject.planned ?? '', staffText(subject)].filter((one) => one !== '').join(' · ')}</small>
                  </>,
                ),
              )}
              {choice(kTyped, t('start.typed'))}
            </div>
          </fieldset>
        )}
        {types && (
          <div class="start-fields">
            <label class="field">
              <span>{t('start.patient')}</span>
              <input name="patient" maxLength={200} spellcheck={false} />
            </label>
            <label class="field">
              <span>{t('start.patientId')}</span>
              <input name="patient_id" maxLength={64} spellcheck={false} autocapitalize="none" />
            </label>
            <label class="field">
              <span>{t('start.birthDate')}</span>
              <input name="birth_date" type="date" />
            </label>
            <label class="field">
              <span>{t('start.procedure')}</span>
              <input name="procedure" maxLength={200} />
            </label>
            <label class="field">
              <span>{t('start.surgeon')}</span>
              <input name="surgeon" maxLength={200} spellcheck={false} />
            </label>
          </div>
        )}
        {starts && plans.length > 0 && (
          <label class="field">
            <span>{t('start.plan')}</span>
            <select name="plan">
              <option value="">{t('start.noPlan')}</option>
              {plans.map((plan) => (
                <option key={plan.seal} value={plan.seal}>
                  {t('start.planOf', { name: plan.name, time: formatMoment(plan.sealed) })}
                </option>
              ))}
            </select>
          </label>
        )}
        {starts && choices.value && plans.length === 0 && <p class="muted">{t('start.noPlans')}</p>}
        {ways
          .filter((way) => !way.well)
          .map((way) => (
            <p key={way.name} class="problem">
              <Icon name="alarm" /> {t('start.wayBad', { name: word('way', way.name), state: wayInOwnWords(way.state) })}
            </p>
          ))}
        {problem.value !== '' && (
          <p class="problem" role="alert">
            <Icon name="alarm" /> {problem.value}
          </p>
        )}
        {!saying.value && <Changed room={status} about={about.value} standing={standing} onChanged={(now) => (about.value = now)} />}
        {(stands || saying.value) && (
          <p class="start-stated" aria-live="polite">
            {isSaid ? t('start.sealed') : !starts ? t('start.saySomething') : ways.length > 0 ? t('start.emptyLooks') : t('start.empty')}
          </p>
        )}
        <div class="dialog-end">
          <button
            type="submit"
            class={starts ? 'button button-record' : 'button button-main'}
            autofocus={starts}
            disabled={saying.value || !stands || (!starts && !isSaid)}
          >
            {starts && <Icon name="record" filled />}
            {t(!starts ? 'start.say' : isSaid ? 'start.doWith' : 'start.doWithout')}
          </button>
        </div>
      </form>
    </Dialog>
  );
}
