import { useSignal } from '@preact/signals';
import { ApiError, session as api } from '@/api/client';
import { typed } from '@/base/form_fields';
import { t } from '@/i18n/i18n';
import { oneTimePassword, session, sessionEnded, textOf } from '@/shell/state';

export function SignInView() {
  const problem = useSignal('');
  const busy = useSignal(false);
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    const fields = new FormData(event.currentTarget as HTMLFormElement);
    busy.value = true;
    problem.value = '';
    try {
      const password = typed(fields, 'password');
      const signedIn = await api.signIn(typed(fields, 'user'), password);
      oneTimePassword.value = signedIn.must_change_password ? password : undefined;
      session.value = await api.get();
      sessionEnded.value = false;
    } catch (error) {
      problem.value = error instanceof ApiError && error.status === 401 ? t('signIn.refused') : textOf(error);
    } finally {
      busy.value = false;
    }
  };
  return (
    <main id="main" class="main sign-in" tabIndex={-1}>
      <form class="card sign-in-card" onSubmit={(event) => void submit(event)}>
        <h1>{t('signIn.title')}</h1>
        {sessionEnded.value ? <p class="session-ended">{t('session.ended')}</p> : <p class="muted">{t('signIn.what')}</p>}
        <label class="field">
          <span>{t('signIn.user')}</span>
          <input name="user" autocomplete="username" autocapitalize="none" spellcheck={false} required autofocus />
        </label>
        <label class="field">
          <span>{t('signIn.password')}</span>
          <input name="password" type="password" autocomplete="current-password" required />
        </label>
        <p class="problem" role="alert">
          {problem.value}
        </p>
        <button type="submit" class="button button-main" disabled={busy.value}>
          {t('signIn.do')}
        </button>
      </form>
    </main>
  );
}
