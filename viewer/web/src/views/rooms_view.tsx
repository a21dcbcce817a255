// The recorder's rooms: start, stop, mark; whether each stream is well, and the appliance behind them.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { ApiError, appliance as api, live } from '@/api/client';
import type { ApplianceStatus, Invitation, LiveStream, RoomStatus } from '@/api/types';
import { hrefOf } from '@/base/route';
import { formatBytes, formatTime, kSecond } from '@/base/time';
import { RemoteClock } from '@/clock/remote_clock';
import { RoomGuests, useInvitations } from '@/guests/room_guests';
import { formatMoment, formatTimeOfDay, t, word } from '@/i18n/i18n';
import { Lookers } from '@/pointing/lookers';
import { useCompany } from '@/pointing/use_company';
import { alertSound, alertSoundWaits, ring, setAlertSound, wakeAlertSound } from '@/rooms/alert_sound';
import { canEnd, endsOperation, isIdle, recordedCase } from '@/rooms/about_case';
import { kNoNote, MarkForm } from '@/rooms/mark_form';
import { StopDialog } from '@/rooms/stop_dialog';
import { StreamTable } from '@/rooms/stream_table';
import { AlertBell, type Trouble, troublesOf } from '@/rooms/trouble';
import { Icon } from '@/shell/icon';
import { may } from '@/shell/rights';
import { announce, attempt, session, textOf } from '@/shell/state';
import { StateCard } from '@/shell/state_card';
import { StartDialog } from '@/subject/start_dialog';
import { useVisible } from '@/shell/visible';
import { LivePane } from '@/views/live_pane';
import { LiveVitalsPanel } from '@/vitals/live_vitals';

const kEvery_ms = 1000;

/** What stands out while it lasts. How long silence lasts is not said aloud each second. */
function Troubles({ troubles }: { troubles: readonly Trouble[] }) {
  return (
    <div class="troubles" role="alert">
      {troubles.length > 0 && (
        <ul>
          {troubles.map((one) => (
            <li key={`${one.kind} ${one.stream}`} class={`trouble trouble-${one.kind}`}>
              <Icon name="alarm" />
              {one.kind === 'silent' ? (
                <>
                  <strong>{t('trouble.silent', { name: word('stream', one.stream) })}</strong>
                  <span aria-hidden="true">{t('trouble.for', { seconds: Math.round(one.for_ms / 1000) })}</span>
                </>
              ) : (
                <strong>{t('trouble.lost', { name: word('stream', one.stream), n: one.pictures })}</strong>
              )}
            </li>
          ))}
        </ul>
      )}
    </div>
  );
}

function AlertSoundSwitch() {
  const on = alertSound.value;
  return (
    <div class="alert-sound">
      <button type="button" class="button" aria-pressed={on} onClick={() => setAlertSound(!on)}>
        <Icon name={on ? 'sound' : 'soundOff'} />
        {t('trouble.sound')}
      </button>
      {on && alertSoundWaits.value && <span class="state-warn">{t('trouble.soundWaits')}</span>}
    </div>
  );
}

interface RoomProps {
  room: RoomStatus;
  /** Since when nobody says what it does: `room` is what it did then. None of that is shown or acted on; what a person is writing stays. */
  unheardSince: Date | undefined;
  /** Its streams that can be seen; none while the page is hidden. */
  seen: readonly string[];
  /** Whether vital signs are asked for: by whoever looks, where kirokud serves the page. */
  watches: boolean;
  clock: RemoteClock;
  mayControl: boolean;
  refresh: () => Promise<unknown>;
  /** Of all rooms; none where there is nothing to look on at. */
  guests: { list: readonly Invitation[]; refresh: () => Promise<unknown> } | undefined;
}

function RoomCard({ room, unheardSince, seen, watches, clock, mayControl, refresh, guests }: RoomProps) {
  const stopping = useSignal(false);
  const asking = useSignal(false);
  const note = useSignal(kNoNote);
  const unheard = unheardSince !== undefined;
  const recorded = recordedCase(room);
  const recording = !unheard && recorded !== '';
  const idle = isIdle(room);
  const watched = unheard || room.state === 'idle' ? [] : seen;
  const company = useCompany(room.room, watched.length > 0);
  /** What it shows may be older than what the room does: also after a refusal it looks again. */
  const act = async (action: () => Promise<void>, said: string) => {
    try {
      await action();
      announce(said);
    } finally {
      void refresh();
    }
  };
  return (
    <section class={`card room${recording ? ' room-recording' : ''}${watched.length > 0 ? ' room-live' : ''}`} aria-labelledby={`room-${room.room}`}>
      <header class="room-head">
        <h2 id={`room-${room.room}`}>{room.room}</h2>
        <span class={recording ? 'verdict verdict-recording' : 'verdict verdict-none'}>
          {recording && <Icon name="record" filled />}
          {unheardSince ? t('rooms.notKnown', { time: formatTimeOfDay(unheardSince) }) : word('roomState', room.state)}
        </span>
        {!unheard && !idle && <span class="room-time mono">{formatTime(room.elapsed_ns)}</span>}
      </header>
      {!unheard && room.case !== '' && (
        <p>
          {may(session.value?.role, 'read-case') ? (
            <a class="mono" href={hrefOf({ view: 'case', id: room.case })}>
              {room.case}
            </a>
          ) : (
            <span class="mono">{room.case}</span>
          )}
        </p>
      )}
      {recording && room.carries_on !== '' && <p>{t('rooms.carriesOn', { id: room.carries_on })}</p>}
      {!unheard && idle && room.tries_again && (
        <p class="problem">
          <Icon name="alarm" /> {t('rooms.triesAgain')}
        </p>
      )}
      {!unheard && room.problem !== '' && (
        <p class="problem">
          <Icon name="alarm" /> {room.problem}
        </p>
      )}
      {room.streams
        .filter((one) => !unheard && one.unboxed)
        .map((one) => (
          <p key={one.name} class="problem unboxed">
            <Icon name="alarm" /> {t('rooms.unboxed', { name: word('stream', one.name) })}
          </p>
        ))}
      <Troubles troubles={unheard ? [] : troublesOf(room)} />
      <div class="room-body">
        {watched.length > 0 && (
          <div class="live-panes">
            {watched.map((stream) => (
              <LivePane key={stream} room={room.room} stream={stream} clock={clock} company={company} records={recording} about={recorded} />
            ))}
            <Lookers company={company} />
          </div>
        )}
        <div class="room-facts">
          {!unheard && room.state !== 'idle' && watches && room.streams.some((one) => one.kind === 'vitals') && (
            <LiveVitalsPanel room={room.room} clock={clock} />
          )}
          {!unheard && room.streams.length > 0 && (
            <StreamTable
              // A list that was opened in one case is none of the next.
              key={room.case}
              room={room}
              onArchiveAs={
                mayControl && recording
                  ? (stream, profile) =>
                      void attempt(async () => {
                        const { warning } = await api.archiveAs(room.room, recorded, stream, profile);
                        const said = t('rooms.archivesAs', { name: word('stream', stream), profile: word('profile', profile) });
                        announce(warning ?? said);
                        await refresh();
                      })
                  : undefined
              }
            />
          )}
          {!unheard && room.authorities.length > 0 && (
            <ul class="facts">
              <li>
                <span class={room.missed === 0 ? 'state state-good' : 'state state-bad'}>
                  <Icon name={room.missed === 0 ? 'check' : 'alarm'} />
                  {t('rooms.tokens')}
                </span>
                <span class="muted">{t('rooms.tokensOf', { n: room.tokens, missed: room.missed })}</span>
              </li>
              {room.authorities.map((one) => (
                <li key={one.name}>
                  <span class={one.failures === 0 ? 'state state-good' : 'state state-bad'}>
                    <Icon name={one.failures === 0 ? 'check' : 'alarm'} />
                    {t('rooms.authority', { name: one.name })}
                  </span>
                  <span class="muted">{one.failures > 0 ? one.last_error : one.last_token ? formatMoment(one.last_token) : t('rooms.noToken')}</span>
                  {one.not_shared && <span class="muted">{t('rooms.notShared', { why: one.not_shared })}</span>}
                </li>
              ))}
            </ul>
          )}
          {guests && <RoomGuests room={room.room} recorded={recorded} unheard={unheard} list={guests.list} refresh={guests.refresh} />}
          {mayControl && recording && (
            <p class="room-subject">
              <span class={room.subject === 'none' ? 'state state-warn' : 'state state-good'}>
                <Icon name={room.subject === 'none' ? 'alarm' : 'check'} />
                {t(room.subject === 'none' ? 'subject.missing' : 'subject.recorded')}
              </span>
              <button type="button" class="button" onClick={() => (asking.value = true)}>
                {t(room.subject === 'none' ? 'subject.add' : 'subject.correct')}
              </button>
            </p>
          )}
          {mayControl && (
            <div class="room-controls">
              {idle ? (
                <>
                  <button type="button" class="button button-record" disabled={unheard} onClick={() => (asking.value = true)}>
                    <Icon name="record" filled />
                    {t('rooms.start')}
                  </button>
                  {room.tries_again && (
                    <button type="button" class="button" disabled={unheard} onClick={() => (stopping.value = true)}>
                      <Icon name="stop" filled />
                      {t('rooms.endOperation')}
                    </button>
                  )}
                </>
              ) : (
                <>
                  <MarkForm
                    room={room.room}
                    recorded={recorded}
                    unheard={unheard}
                    note={note}
                    mark={(id, text) => act(() => api.mark(room.room, id, text), t('rooms.marked', { text }))}
                  />
                  <button type="button" class="button" disabled={unheard || !canEnd(room)} onClick={() => (stopping.value = true)}>
                    <Icon name="stop" filled />
                    {t(endsOperation(room) ? 'rooms.endOperation' : 'rooms.stop')}
                  </button>
                </>
              )}
            </div>
          )}
        </div>
      </div>
      {asking.value && (
        <StartDialog
          room={room}
          unheard={unheard}
          onClose={() => (asking.value = false)}
          onSaid={(about, said) =>
            about.begins
              ? act(() => api.start(room.room, said), t('rooms.started', { room: room.room }))
              : act(() => api.say(room.room, about.case, said), t('start.said'))
          }
        />
      )}
      {stopping.value && (
        <StopDialog
          room={room}
          unheard={unheard}
          onClose={() => (stopping.value = false)}
          onStop={(id, ofOperation) => {
            stopping.value = false;
            const said = t(ofOperation ? 'rooms.ended' : 'rooms.stopped', { room: room.room });
            void attempt(() => act(() => api.stop(room.room, id), said));
          }}
        />
      )}
    </section>
  );
}

function Appliance({ status }: { status: ApplianceStatus }) {
  const { disk, clock } = status;
  // One camera of 4 Mbit/s in each room fills so much in eight hours.
  const isShort = disk !== null && (disk.hours_left === null ? disk.free_bytes < 16e9 * Math.max(1, status.rooms.length) : disk.hours_left < 8);
  const scarce = disk === null || isShort;
  const left =
    disk === null ? t('appliance.diskUnknown') : disk.hours_left === null ? formatBytes(disk.free_bytes) : t('appliance.hours', { hours: disk.hours_left });
  return (
    <section class="card appliance" aria-label={t('appliance.title')}>
      <div class="fact">
        <Icon name="disk" />
        <span>
          <small>{t('appliance.disk')}</small>
          <strong class={scarce ? 'state-bad' : undefined}>{left}</strong>
          {disk && <small class="muted">{t('appliance.free', { free: formatBytes(disk.free_bytes), total: formatBytes(disk.total_bytes) })}</small>}
        </span>
      </div>
      <div class="fact">
        <Icon name="clock" />
        <span>
          <small>{t('appliance.clock')}</small>
          <strong class={clock.synchronised ? undefined : 'state-bad'}>
            {clock.synchronised ? t('appliance.synchronised') : t('appliance.notSynchronised')}
          </strong>
          <small class="muted">± {(clock.error_ns / 1e6).toFixed(1)} ms</small>
        </span>
      </div>
      <div class="fact">
        <Icon name="record" />
        <span>
          <small>{t('appliance.recording')}</small>
          <strong>{t('appliance.rooms', { n: status.rooms.filter((one) => one.state === 'recording').length, all: status.rooms.length })}</strong>
          <small class="muted">{t('appliance.up', { time: formatTime(status.uptime_s * kSecond) })}</small>
        </span>
      </div>
      {status.problems.map((problem) => (
        <div key={problem} class="fact">
          <Icon name="alarm" />
          <span>
            <small>{t('appliance.without')}</small>
            <strong class="state-bad" lang="en">
              {problem}
            </strong>
          </span>
        </div>
      ))}
      {status.remarks?.map((remark) => (
        <div key={remark} class="fact">
          <Icon name="help" />
          <span>
            <small>{t('appliance.remark')}</small>
            <span lang="en">{remark}</span>
          </span>
        </div>
      ))}
      {status.hardware_silent && (
        <div class="fact">
          <Icon name="unproven" />
          <span>
            <small>{t('appliance.hardware')}</small>
            <strong class="state-bad">{t('appliance.hardwareSilent')}</strong>
            <small class="muted">{t('appliance.hardwareToDo')}</small>
            <small class="muted" lang="en">
              {status.hardware_silent}
            </small>
          </span>
        </div>
      )}
    </section>
  );
}

export function RoomsView() {
  const status = useSignal<ApplianceStatus | undefined>(undefined);
  const streams = useSignal<readonly LiveStream[] | undefined>(undefined);
  /** Of `status`; and whether nobody says anything now. */
  const heardAt = useRef(new Date());
  const unheardSince = useSignal<Date | undefined>(undefined);
  const problem = useSignal('');
  const noRecorder = useSignal(false);
  const visible = useVisible();
  const bell = useMemo(() => new AlertBell(), []);
  const clocks = useMemo(() => new Map<string, RemoteClock>(), []);
  const clockOf = (room: string) => {
    const known = clocks.get(room) ?? new RemoteClock();
    clocks.set(room, known);
    return known;
  };
  const asked = useRef({ last: 0, heard: 0 });
  const refresh = async () => {
    const mine = ++asked.current.last;
    /** What was asked later may be answered sooner: an older answer is none of now. */
    const isNews = () => {
      if (mine < asked.current.heard) return false;
      asked.current.heard = mine;
      return true;
    };
    try {
      const sent_ms = performance.now();
      const said = await api.status();
      for (const room of said.rooms) clockOf(room.room).add(room.now_ns, sent_ms, performance.now());
      streams.value ??= await live.streams();
      if (!isNews()) return;
      status.value = said;
      heardAt.current = new Date();
      unheardSince.value = undefined;
      if (bell.hear(said.rooms.flatMap(troublesOf), performance.now())) void ring();
      problem.value = '';
    } catch (error) {
      if (!isNews()) return;
      unheardSince.value = heardAt.current;
      noRecorder.value = error instanceof ApiError && error.status === 503;
      problem.value = noRecorder.value ? t('rooms.noRecorder') : textOf(error);
    }
  };
  useEffect(() => {
    addEventListener('pointerdown', wakeAlertSound);
    addEventListener('keydown', wakeAlertSound);
    return () => {
      removeEventListener('pointerdown', wakeAlertSound);
      removeEventListener('keydown', wakeAlertSound);
    };
  }, []);
  // Whoever wishes to hear of it hears it also from behind another window.
  const asks = visible || alertSound.value;
  useEffect(() => {
    if (!asks) return;
    let timer: ReturnType<typeof setTimeout>;
    let ended = false;
    const again = async () => {
      await refresh();
      if (!ended) timer = setTimeout(() => void again(), kEvery_ms);
    };
    void again();
    return () => {
      ended = true;
      clearTimeout(timer);
    };
  }, [asks]);
  useEffect(() => {
    document.title = `${t('nav.rooms')} · Kiroku`;
  });
  const role = session.value?.role;
  const canBeWatched = (streams.value?.length ?? 0) > 0;
  const invitations = useInvitations(visible && canBeWatched && may(role, 'control-rooms'));
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{t('nav.rooms')}</h1>
        <AlertSoundSwitch />
      </div>
      {problem.value !== '' && (
        <StateCard icon="rooms" title={problem.value} {...(noRecorder.value ? { what: t('rooms.noRecorderWhat') } : {})}>
          <button type="button" class="button" onClick={() => void refresh()}>
            {t('state.again')}
          </button>
        </StateCard>
      )}
      {status.value && (
        <>
          {!unheardSince.value && <Appliance status={status.value} />}
          {status.value.rooms.length === 0 && <StateCard icon="rooms" title={t('rooms.none')} what={t('rooms.noneWhat')} />}
          <div class="rooms">
            {status.value.rooms.map((room) => (
              <RoomCard
                key={room.room}
                room={room}
                unheardSince={unheardSince.value}
                seen={visible ? (streams.value ?? []).filter((one) => one.room === room.room).map((one) => one.stream) : []}
                watches={visible && canBeWatched}
                clock={clockOf(room.room)}
                mayControl={may(role, 'control-rooms')}
                refresh={refresh}
                guests={canBeWatched && may(role, 'control-rooms') ? { list: invitations.list.value, refresh: invitations.refresh } : undefined}
              />
            ))}
          </div>
          {streams.value?.length === 0 && <p class="muted">{t('live.none')}</p>}
        </>
      )}
    </main>
  );
}
