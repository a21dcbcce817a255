// Choosing a password of one's own: after a one-time password nothing else can be done; and whenever one wishes.
import { useSignal } from '@preact/signals';
import { session as api } from '@/api/client';
import { typed } from '@/base/form_fields';
import { t } from '@/i18n/i18n';
import { notify, oneTimePassword, session, textOf } from '@/shell/state';

const kShortest = 10;

interface Props {
  /** The password of now, where it was typed just now. */
  known: string | undefined;
  onDone: () => void;
}

export function PasswordForm({ known, onDone }: Props) {
  const problem = useSignal('');
  const busy = useSignal(false);
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    const fields = new FormData(event.currentTarget as HTMLFormElement);
    const chosen = typed(fields, 'new');
    if (chosen !== typed(fields, 'again')) {
      problem.value = t('password.differ');
      return;
    }
    busy.value = true;
    problem.value = '';
    try {
      session.value = await api.choosePassword(known ?? typed(fields, 'now'), chosen);
      notify(t('password.done'), 'done');
      onDone();
    } catch (error) {
      problem.value = textOf(error);
    } finally {
      busy.value = false;
    }
  };
  return (
    <form class="password-form" onSubmit={(event) => void submit(event)}>
      {/* For the browser's store of passwords. */}
      <input name="user" autocomplete="username" value={session.value?.user ?? ''} readOnly hidden />
      {known === undefined && (
        <label class="field">
          <span>{t(session.value?.must_change_password ? 'password.oneTime' : 'password.now')}</span>
          <input name="now" type="password" autocomplete="current-password" required autofocus />
        </label>
      )}
      <label class="field">
        <span>{t('password.new', { n: kShortest })}</span>
        <input name="new" type="password" autocomplete="new-password" required minLength={kShortest} autofocus={known !== undefined} />
      </label>
      <label class="field">
        <span>{t('password.again')}</span>
        <input name="again" type="password" autocomplete="new-password" required />
      </label>
      <p class="problem" role="alert">
        {problem.value}
      </p>
      <button type="submit" class="button button-main" disabled={busy.value}>
        {t('password.do')}
      </button>
    </form>
  );
}

/** All there is for whoever came by a one-time password. */
export function PasswordView() {
  return (
    <main id="main" class="main sign-in" tabIndex={-1}>
      <section class="card sign-in-card">
        <h1>{t('password.title')}</h1>
        <p class="muted">{t('password.what')}</p>
        <PasswordForm known={oneTimePassword.value} onDone={() => (oneTimePassword.value = undefined)} />
      </section>
    </main>
  );
}
