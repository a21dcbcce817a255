// A stream as it is being recorded, and how old what one sees is.
import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import type { RemoteClock } from '@/clock/remote_clock';
import { t, word } from '@/i18n/i18n';
import { kFresh_ms, LivePlayer } from '@/media/live_player';
import type { Company } from '@/pointing/company';
import { LivePointers } from '@/pointing/live_pointers';
import { Icon } from '@/shell/icon';

const kLook_ms = 500;

type Shown = { state: 'connecting' | 'nothing' | 'noCodec' } | { state: 'live'; delay_s: number | undefined };

function look(player: LivePlayer, clock: RemoteClock): Shown {
  if (player.lacksCodec) return { state: 'noCodec' };
  const { shown } = player;
  const now_ms = performance.now();
  if (!shown || now_ms - shown.displayed_ms > kFresh_ms) return { state: player.connected ? 'nothing' : 'connecting' };
  const clock_ns = clock.at(shown.displayed_ms);
  return { state: 'live', delay_s: clock_ns === undefined ? undefined : Math.max(0, (clock_ns - shown.media_ns) / 1e9) };
}

interface Props {
  room: string;
  stream: string;
  /** The case clock. */
  clock: RemoteClock;
  /** What is said where no picture comes. */
  nothing?: string;
  /** Who else looks on, and points. */
  company: Company | undefined;
  /** Whether a case runs, in which it stands where one points. */
  records: boolean;
  /** Which one, where the page knows. */
  about?: string;
}

export function LivePane({ room, stream, clock, nothing, company, records, about }: Props) {
  const place = useRef<HTMLDivElement>(null);
  const shown = useSignal<Shown>({ state: 'connecting' });
  const shows = useSignal<LivePlayer | undefined>(undefined);
  const name = word('stream', stream);
  useEffect(() => {
    const player = new LivePlayer(room, stream);
    shows.value = player;
    place.current?.prepend(player.video);
    const timer = setInterval(() => (shown.value = look(player, clock)), kLook_ms);
    return () => {
      clearInterval(timer);
      player.close();
      player.video.remove();
      shows.value = undefined;
    };
  }, [room, stream, clock]);
  useEffect(() => {
    place.current?.querySelector('video')?.setAttribute('aria-label', t('live.of', { name }));
  });
  const now = shown.value;
  return (
    <section
      class={records && now.state === 'nothing' ? 'pane live-pane live-pane-lost' : 'pane live-pane'}
      aria-label={t('live.of', { name })}
      data-stream={stream}
      data-live={now.state}
    >
      <div class="pane-picture" ref={place}>
        {now.state !== 'live' && (
          <div class="pane-empty">
            <Icon name={records && now.state === 'nothing' ? 'alarm' : 'dash'} />
            <p>{now.state === 'noCodec' ? t('live.noCodec') : now.state === 'connecting' ? t('live.connecting') : (nothing ?? t('live.nothing'))}</p>
          </div>
        )}
        {company && shows.value && (
          <LivePointers company={company} stream={stream} player={shows.value} about={about} mayPoint={records && now.state === 'live'} />
        )}
      </div>
      <header class="pane-head">
        <h3>{name}</h3>
        {now.state === 'live' && (
          <span class="copy-label live-label" title={t('live.delayWhat')}>
            <Icon name="record" filled />
            {now.delay_s === undefined ? t('live.live') : t('live.delay', { seconds: now.delay_s.toFixed(2) })}
          </span>
        )}
      </header>
    </section>
  );
}
