// All rooms of all appliances as they report: what needs a person first. What was not heard of lately is never shown as if it were so now.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { FleetRoom, FleetRooms } from '@/api/types';
import { hrefOf } from '@/base/route';
import { formatBytes, formatDuration, kSecond } from '@/base/time';
import { fleet } from '@/fleet/fleet_api';
import { formatMoment, t, word } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import { may } from '@/shell/rights';
import { StateCard } from '@/shell/state_card';
import { announce, attempt, session, textOf } from '@/shell/state';
import { useVisible } from '@/shell/visible';

const kEvery_ms = 2000;

function shippingText(one: FleetRoom): string {
  if (one.has_store === null) return t('fleet.unknown');
  if (!one.has_store) return t('fleet.noStore');
  if (one.shipping === null) return t('fleet.unknown');
  const { holds, problems } = one.shipping;
  if (one.shipping.waiting === 0) return holds > 0 || problems > 0 ? t('fleet.unshipped', { holds, problems }) : t('fleet.shippedAll');
  return t('fleet.waits', {
    n: one.shipping.waiting,
    bytes: formatBytes(one.shipping.waiting_bytes),
    time: formatDuration((one.shipping.waiting_s ?? 0) * kSecond),
  });
}

function clockText(one: FleetRoom): string {
  if (one.recorder === null || one.clock_ahead_ms === null) return t('fleet.unknown');
  const seconds = (Math.abs(one.clock_ahead_ms) / 1000).toFixed(1);
  if (one.concerns.includes('clock-off')) return t(one.clock_ahead_ms > 0 ? 'fleet.ahead' : 'fleet.behind', { seconds });
  return one.recorder.clock.synchronised ? t('appliance.synchronised') : t('appliance.notSynchronised');
}

function authoritiesText(one: FleetRoom): string {
  if (one.recorder === null) return t('fleet.unknown');
  const all = one.recorder.authorities;
  if (all.length === 0) return t('fleet.noneAsked');
  return t('fleet.answering', { n: all.filter(({ failures }) => failures === 0).length, all: all.length });
}

function diskText(one: FleetRoom): string {
  if (one.recorder === null) return t('fleet.unknown');
  if (one.recorder.disk === null) return t('appliance.diskUnknown');
  const { hours_left, free_bytes } = one.recorder.disk;
  return hours_left === null ? formatBytes(free_bytes) : t('appliance.hours', { hours: hours_left });
}

function Fact({ name, value, isBad = false }: { name: string; value: string; isBad?: boolean }) {
  return (
    <span class="case-fact">
      <small>{name}</small>
      <span class={isBad ? 'fleet-concern' : undefined}>{value}</span>
    </span>
  );
}

/** What the room does, or did when it was last heard of. */
function Standing({ one }: { one: FleetRoom }) {
  const { room } = one;
  if (one.heard === null) return <span class="state">{t('fleet.neverHeard')}</span>;
  if (room === null) return <span class="state">{t('fleet.noRoom')}</span>;
  const records = room.state === 'recording';
  if (!one.is_heard) return <span class="state">{records ? t('fleet.wasRecording') : t('fleet.was', { state: word('roomState', room.state) })}</span>;
  return (
    <span class={records ? 'state state-good' : 'state'}>
      {records && <Icon name="record" filled />}
      {records ? t('fleet.recordsNow') : word('roomState', room.state)}
    </span>
  );
}

function Heard({ one }: { one: FleetRoom }) {
  if (one.heard === null) return null;
  return (
    <small class={one.is_heard ? 'muted' : 'fleet-concern'}>{t(one.is_heard ? 'fleet.heardAt' : 'fleet.notHeard', { time: formatMoment(one.heard) })}</small>
  );
}

function Room({ one }: { one: FleetRoom }) {
  const { room } = one;
  const has = (what: FleetRoom['concerns'][number]) => one.concerns.includes(what);
  return (
    <li class={`card fleet-room ${one.urgent ? 'fleet-room-urgent' : ''} ${one.is_heard ? '' : 'fleet-room-unheard'}`}>
      <div class="fleet-room-head">
        <h2>
          {room === null || room.room === one.appliance ? one.appliance : `${one.appliance} · ${room.room}`}
          <small class="muted"> {one.program === null ? '' : one.program}</small>
        </h2>
        <Standing one={one} />
        <Heard one={one} />
      </div>
      {one.concerns.length > 0 && (
        <ul class="fleet-room-concerns">
          {one.concerns.map((each) => (
            <li key={each} class="fleet-concern">
              <Icon name="alarm" />
              {t(`fleetRoom.${each}`)}
              {each === 'silent' && room !== null && `: ${room.silent.map((name) => word('stream', name)).join(', ')}`}
            </li>
          ))}
        </ul>
      )}
      {one.heard !== null && (
        <div class="fleet-room-facts">
          {room !== null && room.recording_since !== null && <Fact name={t('fleet.since')} value={formatMoment(room.recording_since)} />}
          {room !== null && room.case !== '' && (
            <span class="case-fact">
              <small>{t('log.case')}</small>
              {one.has_store && may(session.value?.role, 'read-case') ? (
                <a class="mono" href={hrefOf({ view: 'case', id: `${one.appliance}~${room.case}` })}>
                  {room.case}
                </a>
              ) : (
                <span class="mono">{room.case}</span>
              )}
            </span>
          )}
          {/* What was so when it was heard last says nothing of now. */}
          {one.is_heard && (
            <>
              {room !== null && <Fact name={t('fleet.lostFrames')} value={String(room.lost)} isBad={has('lost')} />}
              <Fact name={t('fleet.disk')} value={diskText(one)} isBad={has('disk-short') || has('disk-unknown')} />
              <Fact name={t('fleet.clock')} value={clockText(one)} isBad={has('clock-off') || has('clock-free')} />
              <Fact name={t('fleet.authorities')} value={authoritiesText(one)} isBad={has('no-authority') || has('not-shared')} />
              <Fact name={t('fleet.notShipped')} value={shippingText(one)} isBad={has('shipping-stuck') || has('shipping-unknown')} />
            </>
          )}
        </div>
      )}
    </li>
  );
}

function EnrolDialog({ onClose, onDone }: { onClose: () => void; onDone: (said: string) => void }) {
  const code = useSignal('');
  return (
    <Dialog title={t('fleet.enrol')} onClose={onClose}>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          void attempt(async () => {
            const { appliance, fingerprint } = await fleet.enrol(code.peek());
            onDone(t('fleet.enrolled', { name: appliance, fingerprint }));
          });
        }}
      >
        <p>{t('fleet.enrolWhat')}</p>
        <label class="field">
          <span>{t('fleet.code')}</span>
          <input class="mono" required maxLength={40} autocomplete="off" value={code.value} onInput={(event) => (code.value = event.currentTarget.value)} />
        </label>
        <div class="dialog-end">
          <button type="submit" class="button button-main">
            {t('fleet.enrol')}
          </button>
        </div>
      </form>
    </Dialog>
  );
}

export function FleetRoomsView() {
  const told = useSignal<FleetRooms | undefined>(undefined);
  const problem = useSignal('');
  const enrolling = useSignal(false);
  const enrolled = useSignal('');
  const visible = useVisible();
  const refresh = async (isWanted = () => true) => {
    try {
      const rooms = await fleet.rooms();
      if (!isWanted()) return;
      told.value = rooms;
      problem.value = '';
    } catch (error) {
      if (!isWanted()) return;
      // What was so before is not known to be so now.
      told.value = undefined;
      problem.value = textOf(error);
    }
  };
  useEffect(() => {
    if (!visible) return;
    let timer: ReturnType<typeof setTimeout>;
    let ended = false;
    const again = async () => {
      // An answer to a page that is hidden by now would be shown as of the time when somebody looks again.
      await refresh(() => !ended);
      if (!ended) timer = setTimeout(() => void again(), kEvery_ms);
    };
    void again();
    return () => {
      ended = true;
      clearTimeout(timer);
      told.value = undefined;
    };
  }, [visible]);
  useEffect(() => {
    document.title = `${t('nav.rooms')} · Kiroku`;
  });
  const all = told.value;
  return (
    <main id="main" class="main narrow" tabIndex={-1} aria-busy={all === undefined && problem.value === ''}>
      <div class="view-head">
        <h1>{t('nav.rooms')}</h1>
        {may(session.value?.role, 'manage-users') && (
          <button type="button" class="button" onClick={() => (enrolling.value = true)}>
            {t('fleet.enrol')}
          </button>
        )}
      </div>
      <p class="muted fleet-what">{t('fleet.roomsWhat')}</p>
      {enrolled.value !== '' && <p class="fleet-what">{enrolled.value}</p>}
      {problem.value !== '' && (
        <StateCard icon="rooms" title={t('fleet.notKnown', { why: problem.value })}>
          <button type="button" class="button" onClick={() => void refresh()}>
            {t('state.again')}
          </button>
        </StateCard>
      )}
      {all?.rooms.length === 0 && <StateCard icon="rooms" title={t('fleet.noRooms')} what={t('fleet.noRoomsWhat')} />}
      {all !== undefined && all.rooms.length > 0 && (
        <ul class="fleet-rooms" aria-label={t('nav.rooms')}>
          {all.rooms.map((one) => (
            <Room key={`${one.appliance} ${one.room?.room ?? ''}`} one={one} />
          ))}
        </ul>
      )}
      {all !== undefined && all.not_enrolled.length > 0 && <p class="muted">{t('fleet.notEnrolled', { names: all.not_enrolled.join(', ') })}</p>}
      {enrolling.value && (
        <EnrolDialog
          onClose={() => (enrolling.value = false)}
          onDone={(said) => {
            enrolling.value = false;
            enrolled.value = said;
            announce(said);
            void refresh();
          }}
        />
      )}
    </main>
  );
}
