// Who is invited to a room: making an invitation, seeing who watches, ending it.
import { type Signal, useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import type { Invitation } from '@/api/types';
import { typed } from '@/base/form_fields';
import { invitations as api, linkOf } from '@/guests/guest_api';
import { language, t, word } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import { may } from '@/shell/rights';
import { announce, attempt, session } from '@/shell/state';

const kEvery_ms = 2000;
/** Of those that have ended, so many are still told of. */
const kMostEnded = 2;
const kMinutes = [15, 30, 60, 120, 240] as const;
const kUsualMinutes = 60;

/** The invitations of all rooms, while `asks`. */
export function useInvitations(asks: boolean): { list: Signal<readonly Invitation[]>; refresh: () => Promise<unknown> } {
  const list = useSignal<readonly Invitation[]>([]);
  const refresh = () =>
    attempt(async () => {
      list.value = await api.list();
    });
  useEffect(() => {
    if (!asks) return;
    let timer: ReturnType<typeof setTimeout>;
    let closed = false;
    const again = async () => {
      await refresh();
      if (!closed) timer = setTimeout(() => void again(), kEvery_ms);
    };
    void again();
    return () => {
      closed = true;
      clearTimeout(timer);
    };
  }, [asks]);
  return { list, refresh };
}

const lengthOf = (minutes: number): string =>
  minutes < 60 ? t('guests.minutes', { n: minutes }) : minutes === 60 ? t('guests.hour') : t('guests.hours', { n: minutes / 60 });
const timeOf = (utc: string): string => new Date(utc).toLocaleTimeString(language.value === 'ja' ? 'ja-JP' : 'en-GB', { hour: '2-digit', minute: '2-digit' });

interface InviteProps {
  room: string;
  /** The case that is recorded; '': none is. */
  recorded: string;
  /** Nobody says what the room does now. */
  unheard: boolean;
  onMade: () => void;
  onClose: () => void;
}

function InviteDialog({ room, recorded, unheard, onMade, onClose }: InviteProps) {
  const about = useSignal(recorded);
  const made = useSignal<(Invitation & { token: string }) | undefined>(undefined);
  const link = useRef<HTMLInputElement>(null);
  const stands = !unheard && about.value === recorded;
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    const fields = new FormData(event.currentTarget as HTMLFormElement);
    if (!stands) return;
    void attempt(async () => {
      made.value = await api.make(typed(fields, 'guest').trim(), room, about.value, Number(fields.get('minutes')));
      onMade();
    });
  };
  const copy = () =>
    attempt(async () => {
      link.current?.select();
      await navigator.clipboard.writeText(link.current?.value ?? '');
      announce(t('guests.copied'));
    });
  const invitation = made.value;
  return (
    <Dialog title={t('guests.inviteTitle', { room })} onClose={onClose}>
      {invitation === undefined ? (
        <form class="invite-form" onSubmit={submit}>
          <p class="muted">{t('guests.inviteWhat')}</p>
          <label class="field">
            <span>{t('guests.name')}</span>
            <input name="guest" required maxLength={60} autocomplete="off" spellcheck={false} autofocus />
          </label>
          <label class="field">
            <span>{t('guests.lasts')}</span>
            <select name="minutes">
              {kMinutes.map((minutes) => (
                <option key={minutes} value={minutes} selected={minutes === kUsualMinutes}>
                  {lengthOf(minutes)}
                </option>
              ))}
            </select>
          </label>
          {unheard && (
            <p class="problem" role="alert">
              <Icon name="alarm" /> {t('rooms.unheard')}
            </p>
          )}
          {!unheard && !stands && (
            <div class="changed" role="alert">
              <p class="problem">
                <Icon name="alarm" /> {recorded === '' ? t('guests.over', { id: about.value }) : t('guests.next', { id: recorded })}
              </p>
              <button type="button" class="button" onClick={() => (about.value = recorded)}>
                {recorded === '' ? t('guests.toTheFirst') : t('guests.toNext', { id: recorded })}
              </button>
            </div>
          )}
          <div class="dialog-end">
            <button type="submit" class="button button-main" disabled={!stands}>
              {t('guests.do')}
            </button>
          </div>
        </form>
      ) : (
        <div class="invite-form">
          <label class="field">
            <span>{t('guests.link')}</span>
            <input ref={link} readOnly value={linkOf(invitation.token)} onFocus={(event) => event.currentTarget.select()} />
          </label>
          <p>{t('guests.linkWhat', { time: timeOf(invitation.ends), guest: invitation.guest })}</p>
          <div class="dialog-end">
            <button type="button" class="button button-main" onClick={() => void copy()}>
              <Icon name="document" />
              {t('guests.copy')}
            </button>
          </div>
        </div>
      )}
    </Dialog>
  );
}

function Guest({ one, refresh }: { one: Invitation; refresh: () => Promise<unknown> }) {
  const hasEnded = one.state === 'ended';
  const end = () =>
    attempt(async () => {
      await api.end(one.id);
      announce(t('guests.ended', { name: one.guest }));
      await refresh();
    });
  return (
    <li class={hasEnded ? 'guest-line muted' : 'guest-line'} data-state={one.state}>
      <span class="guest-name">
        <strong>{one.guest}</strong>
        <small class="muted">{t('guests.by', { name: one.made_by })}</small>
      </span>
      {hasEnded ? (
        <span>{word('guestEnd', one.end ?? '')}</span>
      ) : (
        <>
          <span class={one.watches ? 'state state-good' : 'state'}>
            <Icon name={one.watches ? 'check' : 'dash'} />
            {t(one.watches ? 'guests.watches' : one.state === 'open' ? 'guests.open' : 'guests.away')}
          </span>
          <span class="muted">{t('guests.left', { minutes: Math.ceil(one.left_s / 60) })}</span>
          <button type="button" class="button" aria-label={t('guests.endOf', { name: one.guest })} onClick={() => void end()}>
            {t('guests.end')}
          </button>
        </>
      )}
    </li>
  );
}

interface RoomGuestsProps {
  room: string;
  /** The case that is recorded; '': none is. */
  recorded: string;
  /** Nobody says what the room does now: nobody is invited to it, but whoever was can still be sent away. */
  unheard: boolean;
  list: readonly Invitation[];
  refresh: () => Promise<unknown>;
}

export function RoomGuests({ room, recorded, unheard, list, refresh }: RoomGuestsProps) {
  const inviting = useSignal(false);
  const own = list.filter((one) => one.room === room);
  const shown = [...own.filter((one) => one.state !== 'ended'), ...own.filter((one) => one.state === 'ended').slice(0, kMostEnded)];
  return (
    <section class="guests" aria-labelledby={`guests-${room}`}>
      <header class="guests-head">
        <h3 id={`guests-${room}`}>{t('guests.title')}</h3>
        {may(session.value?.role, 'invite') && (
          <button type="button" class="button" disabled={unheard} onClick={() => (inviting.value = true)}>
            <Icon name="users" />
            {t('guests.invite')}
          </button>
        )}
      </header>
      {shown.length === 0 ? (
        <p class="muted">{t('guests.none')}</p>
      ) : (
        <ul class="guest-list">
          {shown.map((one) => (
            <Guest key={one.id} one={one} refresh={refresh} />
          ))}
        </ul>
      )}
      {inviting.value && (
        <InviteDialog room={room} recorded={recorded} unheard={unheard} onMade={() => void refresh()} onClose={() => (inviting.value = false)} />
      )}
    </section>
  );
}
