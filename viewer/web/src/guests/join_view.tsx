// What the link of an invitation opens. It is used only when the guest says so: programs that look into links must not use it up.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { invitations } from '@/guests/guest_api';
import { guestIsOver, invited } from '@/guests/guest_state';
import { t } from '@/i18n/i18n';
import { session, textOf } from '@/shell/state';

export function JoinView({ token }: { token: string }) {
  const problem = useSignal('');
  const busy = useSignal(false);
  useEffect(() => {
    document.title = `${t('guest.invited')} · Kiroku`;
  });
  const join = async () => {
    busy.value = true;
    problem.value = '';
    try {
      session.value = await invitations.join(token);
      invited.value = undefined;
      guestIsOver.value = false;
    } catch (error) {
      problem.value = textOf(error);
    } finally {
      busy.value = false;
    }
  };
  return (
    <main id="main" class="main sign-in" tabIndex={-1}>
      <section class="card sign-in-card" aria-labelledby="invited">
        <h1 id="invited">{t('guest.invited')}</h1>
        <p>{t('guest.joinWhat')}</p>
        <p class="muted">{t('guest.onceWhat')}</p>
        <p class="problem" role="alert">
          {problem.value}
        </p>
        <button type="button" class="button button-main" disabled={busy.value} onClick={() => void join()}>
          {t('guest.join')}
        </button>
      </section>
    </main>
  );
}

export function OverView() {
  useEffect(() => {
    document.title = `${t('guest.over')} · Kiroku`;
  });
  return (
    <main id="main" class="main sign-in" tabIndex={-1}>
      <section class="card sign-in-card" aria-labelledby="over" role="status">
        <h1 id="over">{t('guest.over')}</h1>
        <p>{t('guest.overWhat')}</p>
      </section>
    </main>
  );
}
