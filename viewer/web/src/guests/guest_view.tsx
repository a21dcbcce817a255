// What a guest sees: the live pictures of the room they were invited to, and how long they may.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo } from 'preact/hooks';
import { live, session as api } from '@/api/client';
import type { Session } from '@/api/types';
import { RemoteClock } from '@/clock/remote_clock';
import { clockFace, Countdown, passedWarning } from '@/guests/countdown';
import { guestIsOver } from '@/guests/guest_state';
import { t } from '@/i18n/i18n';
import { Lookers } from '@/pointing/lookers';
import { useCompany } from '@/pointing/use_company';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import { announce, attempt, session } from '@/shell/state';
import { useVisible } from '@/shell/visible';
import { LivePane } from '@/views/live_pane';

const kTick_ms = 500;
/** How often it is asked whether the invitation still lasts. */
const kAsk_ms = 2000;

function end(): void {
  guestIsOver.value = true;
  session.value = null;
}

export function GuestView({ guest }: { guest: Session }) {
  const room = guest.invitation?.room ?? '';
  const name = guest.invitation?.guest ?? '';
  const visible = useVisible();
  const company = useCompany(room, visible);
  const streams = useSignal<readonly string[]>([]);
  const clock = useMemo(() => new RemoteClock(), []);
  const countdown = useMemo(() => new Countdown(guest.expires_s, performance.now()), [guest]);
  const left_s = useSignal(countdown.left_s(performance.now()));
  const leaving = useSignal(false);
  useEffect(() => {
    document.title = `${t('guest.room', { room })} · Kiroku`;
  });
  useEffect(() => {
    const timer = setInterval(() => {
      const now_s = countdown.left_s(performance.now());
      const minutes = passedWarning(left_s.value, now_s);
      if (minutes !== undefined) announce(t('guest.soon', { minutes }));
      left_s.value = now_s;
    }, kTick_ms);
    return () => clearInterval(timer);
  }, [countdown]);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    let closed = false;
    const again = async () => {
      try {
        // Refused once the invitation has ended: then the page knows by itself (whenSignedOut).
        const sent_ms = performance.now();
        const said = await live.streams();
        const now_ns = said[0]?.now_ns ?? null;
        if (now_ns !== null) clock.add(now_ns, sent_ms, performance.now());
        streams.value = said.map((one) => one.stream);
      } catch {
        // Not reached: asked again.
      }
      if (!closed) timer = setTimeout(() => void again(), kAsk_ms);
    };
    void again();
    return () => {
      closed = true;
      clearTimeout(timer);
    };
  }, []);
  const soon = left_s.value <= 300;
  return (
    <main id="main" class="main guest" tabIndex={-1}>
      <div class="view-head guest-head">
        <h1>{t('guest.room', { room })}</h1>
        <p class="muted">{t('guest.you', { guest: name })}</p>
        <p class={soon ? 'guest-clock guest-soon' : 'guest-clock'} role="timer">
          <Icon name="clock" />
          <span>{t('guest.endsIn')}</span> <strong class="mono">{clockFace(left_s.value)}</strong>
        </p>
        <button type="button" class="button" onClick={() => (leaving.value = true)}>
          <Icon name="signOut" />
          {t('guest.leave')}
        </button>
      </div>
      <div class="guest-panes">
        {visible &&
          streams.value.map((stream) => (
            <LivePane key={stream} room={room} stream={stream} clock={clock} nothing={t('guest.waits')} company={company} records />
          ))}
      </div>
      <Lookers company={company} />
      {leaving.value && (
        <Dialog title={t('guest.leaveTitle')} onClose={() => (leaving.value = false)}>
          <p>{t('guest.leaveWhat')}</p>
          <div class="dialog-end">
            <button
              type="button"
              class="button button-danger"
              onClick={() =>
                void attempt(async () => {
                  await api.signOut();
                  end();
                })
              }
            >
              {t('guest.leave')}
            </button>
          </div>
        </Dialog>
      )}
    </main>
  );
}
