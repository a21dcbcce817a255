// One video: its viewing copy, or over it a frame of the archived original; where nothing was recorded it says why.
import { computed, useSignal } from '@preact/signals';
import type { ComponentChildren } from 'preact';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { spanAt } from '@/base/spans';
import { formatTime } from '@/base/time';
import { t, word } from '@/i18n/i18n';
import type { PanePlayer } from '@/media/pane_player';
import type { Playback } from '@/media/playback';
import { Icon } from '@/shell/icon';
import { SoundControl } from '@/views/sound_control';
import type { CaseModel } from '@/views/case_model';

/** A frame of the archive as it is shown over a pane. */
export interface ArchivedFrame {
  time_ns: number;
  picture: ImageBitmap;
}

function FrameOver({ frame }: { frame: ArchivedFrame }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const one = canvas.current as HTMLCanvasElement;
    one.width = frame.picture.width;
    one.height = frame.picture.height;
    one.getContext('2d')?.drawImage(frame.picture, 0, 0);
  }, [frame]);
  return <canvas class="pane-original" ref={canvas} />;
}

interface Props {
  model: CaseModel;
  player: PanePlayer;
  playback: Playback;
  large: boolean;
  original: ArchivedFrame | undefined;
  onEnlarge: (() => void) | undefined;
  onOriginal: () => void;
  /** Where the breathing of a lung is fitted to these pictures, if they are a fluoroscope's. */
  fitHref?: string | undefined;
  /** Over the picture. */
  children?: ComponentChildren;
}

export function Pane({ model, player, playback, large, original, onEnlarge, onOriginal, fitHref, children }: Props) {
  const place = useRef<HTMLDivElement>(null);
  const waits = useSignal(false);
  useEffect(() => {
    place.current?.prepend(player.video);
    player.video.setAttribute('aria-label', word('stream', player.stream));
    // A case that is unlocked is loaded anew, with a player of its own.
    return () => player.video.remove();
  }, [player]);
  const recorded = useMemo(() => computed(() => player.isRecorded(playback.position_ns.value)), [player, playback]);
  const cause = useMemo(() => computed(() => spanAt(model.gaps.get(player.stream) ?? [], playback.position_ns.value)?.cause), [model, player, playback]);
  // A short wait is not worth a sign.
  const waiting = playback.waiting.value;
  useEffect(() => {
    if (!waiting) {
      waits.value = false;
      return;
    }
    const timer = setTimeout(() => (waits.value = true), 250);
    return () => clearTimeout(timer);
  }, [waiting]);

  const failure = player.failure.value;
  const name = word('stream', player.stream);
  const hasSound = player.sound.isThere.value === true;
  return (
    <section
      class={`pane${large ? ' pane-large' : ''}${original ? ' pane-with-original' : ''}`}
      aria-label={hasSound ? t('sound.with', { name }) : name}
      data-stream={player.stream}
    >
      <div class="pane-picture" ref={place} onDblClick={onEnlarge}>
        {original && recorded.value && <FrameOver frame={original} />}
        {children}
        {failure !== undefined && recorded.value && !original && (
          <div class="pane-empty pane-failed" role="alert">
            <Icon name="alarm" />
            <p>{t(failure === 'codec' ? 'pane.noCodec' : 'pane.broken')}</p>
            <p class="muted">{t(failure === 'codec' ? 'pane.noCodecWhat' : 'pane.brokenWhat')}</p>
          </div>
        )}
        {!recorded.value && (
          <div class="pane-empty">
            <Icon name="dash" />
            <p>{t('pane.nothing')}</p>
            {cause.value && <p class="muted">{word('cause', cause.value)}</p>}
          </div>
        )}
        {waits.value && recorded.value && <div class="pane-wait" aria-hidden="true" />}
      </div>
      <header class="pane-head">
        <h2>{name}</h2>
        <button
          type="button"
          class={original ? 'copy-label copy-label-original' : 'copy-label'}
          aria-pressed={original !== undefined}
          title={original ? t('pane.originalWhat') : t('pane.copyWhat')}
          onClick={onOriginal}
        >
          <Icon name="original" />
          {original
            ? t('pane.original', { time: formatTime(original.time_ns - model.whole.start_ns, 3) })
            : hasSound
              ? t('pane.copyWithSound')
              : t('pane.copy')}
        </button>
        {fitHref !== undefined && (
          <a class="button button-quiet" href={fitHref}>
            <Icon name="lung" />
            {t('breathing.fitCase')}
          </a>
        )}
        {hasSound && <SoundControl name={name} player={player} playback={playback} />}
        {onEnlarge && (
          <button
            type="button"
            class="button button-quiet button-square"
            aria-label={t('pane.enlarge', { name })}
            title={t('pane.enlarge', { name })}
            onClick={onEnlarge}
          >
            <Icon name="fullScreen" />
          </button>
        )}
      </header>
    </section>
  );
}
