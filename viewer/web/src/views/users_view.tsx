import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { users as api } from '@/api/client';
import type { Role, User } from '@/api/types';
import { typed } from '@/base/form_fields';
import { formatMoment, t } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { announce, attempt, notify, session } from '@/shell/state';

const kRoles: readonly Role[] = ['operator', 'surgeon', 'auditor', 'administrator'];

function RoleDialog({ user, onDone, onClose }: { user: User; onDone: () => Promise<unknown>; onClose: () => void }) {
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    const role = new FormData(event.currentTarget as HTMLFormElement).get('role') as Role;
    onClose();
    if (role === user.role) return;
    void attempt(async () => {
      await api.changeRole(user.user, role);
      notify(t('users.roleChanged', { name: user.user, role: t(`role.${role}`) }), 'done');
      await onDone();
    });
  };
  return (
    <Dialog title={t('users.roleTitle', { name: user.user })} onClose={onClose}>
      <form class="start-form" onSubmit={submit}>
        <div class="start-choices">
          {kRoles.map((role) => (
            <label key={role} class="start-choice">
              <input type="radio" name="role" value={role} defaultChecked={role === user.role} />
              <span>
                <strong>{t(`role.${role}`)}</strong>
                <small class="muted">{t(`may.${role}`)}</small>
              </span>
            </label>
          ))}
        </div>
        <p class="start-stated">{t('users.roleWhat')}</p>
        <div class="dialog-end">
          <button type="submit" class="button button-main">
            {t('users.roleDo')}
          </button>
        </div>
      </form>
    </Dialog>
  );
}

/** The one-time password stands here once, and nowhere again. */
function ResetDialog({ user, onDone, onClose }: { user: User; onDone: () => Promise<unknown>; onClose: () => void }) {
  const given = useSignal<{ password: string; until: string } | undefined>(undefined);
  const field = useRef<HTMLInputElement>(null);
  const reset = () =>
    attempt(async () => {
      given.value = await api.resetPassword(user.user);
      await onDone();
    });
  const copy = () =>
    attempt(async () => {
      field.current?.select();
      await navigator.clipboard.writeText(given.value?.password ?? '');
      announce(t('users.resetCopied'));
    });
  return (
    <Dialog title={t('users.resetTitle', { name: user.user })} onClose={onClose}>
      {given.value === undefined ? (
        <>
          <p>{t('users.resetWhat')}</p>
          <div class="dialog-end">
            <button type="button" class="button button-danger" onClick={() => void reset()}>
              {t('users.resetDo')}
            </button>
          </div>
        </>
      ) : (
        <>
          <label class="field">
            <span>{t('users.resetPassword')}</span>
            <input ref={field} class="mono" readOnly value={given.value.password} onFocus={(event) => event.currentTarget.select()} />
          </label>
          <p>{t('users.resetGiven', { name: user.user, until: formatMoment(given.value.until) })}</p>
          <div class="dialog-end">
            <button type="button" class="button button-main" onClick={() => void copy()}>
              {t('users.resetCopy')}
            </button>
          </div>
        </>
      )}
    </Dialog>
  );
}

export function UsersView() {
  const list = useSignal<User[]>([]);
  const removing = useSignal<string | undefined>(undefined);
  const changing = useSignal<User | undefined>(undefined);
  const resetting = useSignal<User | undefined>(undefined);
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
                  {one.one_time_until !== null && <span class="tag tag-warn">{t('users.oneTime')}</span>}
                </th>
                <td>{t(`role.${one.role}`)}</td>
                <td class="muted">{t(`may.${one.role}`)}</td>
                <td class="table-end">
                  <div class="user-actions">
                    {one.user !== session.value?.user && (
                      <>
                        <button type="button" class="button" onClick={() => (changing.value = one)}>
                          {t('users.changeRole')}
                          <span class="only-heard"> {one.user}</span>
                        </button>
                        <button type="button" class="button" onClick={() => (resetting.value = one)}>
                          {t('users.reset')}
                          <span class="only-heard"> {one.user}</span>
                        </button>
                        <button type="button" class="button" onClick={() => (removing.value = one.user)}>
                          {t('users.remove')}
                          <span class="only-heard"> {one.user}</span>
                        </button>
                      </>
                    )}
                  </div>
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
      {changing.value && <RoleDialog user={changing.value} onDone={load} onClose={() => (changing.value = undefined)} />}
      {resetting.value && <ResetDialog user={resetting.value} onDone={load} onClose={() => (resetting.value = undefined)} />}
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
