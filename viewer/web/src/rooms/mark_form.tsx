// Marks a moment of the case that is recorded. What was written before that case began goes into it only when the person says so.
import type { Signal } from '@preact/signals';
import { t } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import { attempt } from '@/shell/state';

export interface Note {
  text: string;
  /** The case that was recorded when it was begun; '': none was. */
  about: string;
}
export const kNoNote: Note = { text: '', about: '' };

interface Props {
  room: string;
  /** The case that is recorded; '': none is. */
  recorded: string;
  /** Nobody says what the room does now: what is written waits. */
  unheard: boolean;
  /** Kept by the room's card, so that it outlives the case. */
  note: Signal<Note>;
  mark: (id: string, text: string) => Promise<void>;
}

export function MarkForm({ room, recorded, unheard, note, mark }: Props) {
  const { text, about } = note.value;
  const written = text.trim();
  const isOfOther = !unheard && written !== '' && recorded !== '' && about !== recorded;
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    if (unheard || recorded === '') return;
    if (isOfOther) {
      note.value = { text, about: recorded };
      return;
    }
    const kept = note.value;
    note.value = kNoNote;
    void attempt(async () => {
      try {
        await mark(recorded, written || t('rooms.defaultMark'));
      } catch (error) {
        if (note.value.text === '') note.value = kept;
        throw error;
      }
    });
  };
  return (
    <form class="mark-form" onSubmit={submit}>
      <label class="only-heard" for={`mark-${room}`}>
        {t('rooms.markText')}
      </label>
      <input
        id={`mark-${room}`}
        placeholder={t('rooms.markText')}
        value={text}
        maxLength={500}
        onInput={(event) => (note.value = { text: event.currentTarget.value, about: written === '' ? recorded : about })}
      />
      {isOfOther && (
        <p class="problem" role="alert">
          <Icon name="alarm" /> {t('rooms.markOfOther', { id: recorded })}
        </p>
      )}
      <button type="submit" class="button button-main" disabled={unheard || recorded === ''}>
        <Icon name="mark" />
        {t(isOfOther ? 'rooms.markBelongs' : 'rooms.mark')}
      </button>
    </form>
  );
}
