// Where pictures would be while they are sealed: a place for the identity that opens them. It goes to the server, stays in its memory for this session,
// and is forgotten there on signing out.
import { useSignal } from '@preact/signals';
import { session as api } from '@/api/client';
import { typed } from '@/base/form_fields';
import { readIdentityFile } from '@/base/identity_file';
import { t } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import { announce, session, textOf } from '@/shell/state';

/** In a case, where its pictures would be; else in a dialogue of the list, which has the title. */
export function UnlockPanel({ inList = false }: { inList?: boolean }) {
  const problem = useSignal('');
  const busy = useSignal(false);
  const fileName = useSignal('');
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    const form = event.currentTarget as HTMLFormElement;
    const fields = new FormData(form);
    const file = fields.get('file');
    busy.value = true;
    problem.value = '';
    try {
      const identity = file instanceof File && file.size > 0 ? await readIdentityFile(file) : typed(fields, 'identity').trim();
      if (identity === '') throw new Error(t('unlock.nothing'));
      await api.unlock(identity, typed(fields, 'passphrase'));
      form.reset();
      session.value = await api.get();
      announce(t('unlock.done'));
    } catch (error) {
      problem.value = textOf(error);
    } finally {
      busy.value = false;
    }
  };
  return (
    <form class={inList ? 'unlock' : 'unlock card'} onSubmit={(event) => void submit(event)} aria-label={t(inList ? 'cases.unlock' : 'unlock.title')}>
      {!inList && (
        <>
          <Icon name="lock" />
          <h2>{t('unlock.title')}</h2>
        </>
      )}
      <p class="muted">{t(inList ? 'cases.unlockWhat' : 'unlock.what')}</p>
      <label class="file-field">
        <span class="button">{t('unlock.file')}</span>
        <input
          type="file"
          name="file"
          onChange={(event) => {
            fileName.value = event.currentTarget.files?.[0]?.name ?? '';
          }}
        />
        <span class="muted">{fileName.value || t('unlock.noFile')}</span>
      </label>
      <label class="field">
        <span>{t('unlock.text')}</span>
        <textarea name="identity" rows={2} spellcheck={false} autocomplete="off" placeholder="AGE-SECRET-KEY-1…" />
      </label>
      <label class="field">
        <span>{t('unlock.passphrase')}</span>
        <input name="passphrase" type="password" autocomplete="off" />
      </label>
      <p class="problem" role="alert">
        {problem.value}
      </p>
      <button type="submit" class="button button-main" disabled={busy.value}>
        <Icon name="unlocked" />
        {t('unlock.do')}
      </button>
    </form>
  );
}
