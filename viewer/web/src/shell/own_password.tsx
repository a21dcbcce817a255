// The way to a new password of one's own, for everybody who has signed in with one.
import { useSignal } from '@preact/signals';
import { t } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import { PasswordForm } from '@/views/password_view';

export function OwnPassword() {
  const open = useSignal(false);
  return (
    <>
      <button
        type="button"
        class="button button-quiet button-square"
        aria-label={t('password.change')}
        title={t('password.change')}
        onClick={() => (open.value = true)}
      >
        <Icon name="key" />
      </button>
      {open.value && (
        <Dialog title={t('password.change')} onClose={() => (open.value = false)}>
          <PasswordForm known={undefined} onDone={() => (open.value = false)} />
        </Dialog>
      )}
    </>
  );
}
