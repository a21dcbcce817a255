import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { users as api } from '@/api/client';
import type { Role, User } from '@/api/types';
import { typed } from '@/base/form_fields';
import { t } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { attempt, notify, session } from '@/shell/state';

const kRoles: readonly Role[] = ['operator', 'surgeon', 'auditor', 'administrator'];

export function UsersView() {
  const list = useSignal<User[]>([]);
  const removing = useSignal<string | undefined>(undefined);
  const load = () =>
    attempt(async () => {
      list.value = await api.list();
    });
  useEffect(() => {
    void load();
  }, []);
  useEffect(() => {
    document.title = `${t('nav.users')} · Kiroku`;
  });

  const add = async (event: SubmitEvent) => {
    event.preventDefault();
    const form = event.currentTarget as HTMLFormElement;
    const fields = new FormData(form);
    const name = typed(fields, 'user');
    await attempt(async () => {
      await api.add(name, typed(fields, 'password'), fields.get('role') as Role);
      form.reset();
      notify(t('users.added', { name }), 'done');
      await load();
    });
  };

  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{t('nav.users')}</h1>
      </div>
      <div class="card table-card">
        <table class="table">
          <thead>
            <tr>
              <th scope="col">{t('signIn.user')}</th>
              <th scope="col">{t('users.role')}</th>
              <th scope="col">{t('users.may')}</th>
              <th scope="col">
                <span class="only-heard">{t('users.actions')}</span>
              </th>
            </tr>
          </thead>
          <tbody>
            {list.value.map((one) => (
              <tr key={one.user}>
                <th scope="row">
                  {one.user}
                  {one.locked && <span class="tag tag-warn">{t('users.locked')}</span>}
                </th>
                <td>{t(`role.${one.role}`)}</td>
                <td class="muted">{t(`may.${one.role}`)}</td>
                <td class="table-end">
                  {one.user !== session.value?.user && (
                    <button type="button" class="button" onClick={() => (removing.value = one.user)}>
                      {t('users.remove')}
                      <span class="only-heard"> {one.user}</span>
                    </button>
                  )}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <form class="card form-row" onSubmit={(event) => void add(event)} aria-label={t('users.add')}>
        <h2>{t('users.add')}</h2>
        <label class="field">
          <span>{t('signIn.user')}</span>
          <input name="user" required autocomplete="off" autocapitalize="none" spellcheck={false} />
        </label>
        <label class="field">
          <span>{t('signIn.password')}</span>
          <input name="password" type="password" required autocomplete="new-password" />
        </label>
        <label class="field">
          <span>{t('users.role')}</span>
          <select name="role">
            {kRoles.map((role) => (
              <option key={role} value={role}>
                {t(`role.${role}`)}
              </option>
            ))}
          </select>
        </label>
        <button type="submit" class="button button-main">
          {t('users.addDo')}
        </button>
      </form>
      {removing.value !== undefined && (
        <Dialog title={t('users.removeTitle', { name: removing.value })} onClose={() => (removing.value = undefined)}>
          <p>{t('users.removeWhat')}</p>
          <div class="dialog-end">
            <button
              type="button"
              class="button button-danger"
              onClick={() => {
                const name = removing.value as string;
                removing.value = undefined;
                void attempt(async () => {
                  await api.remove(name);
                  await load();
                });
              }}
            >
              {t('users.remove')}
            </button>
          </div>
        </Dialog>
      )}
    </main>
  );
}
