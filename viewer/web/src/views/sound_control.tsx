// Whether a pane is heard, and how loud.
import { t } from '@/i18n/i18n';
import { isHeardAt } from '@/media/pane_sound';
import type { PanePlayer } from '@/media/pane_player';
import type { Playback } from '@/media/playback';
import { Icon } from '@/shell/icon';

export function SoundControl({ name, player, playback }: { name: string; player: PanePlayer; playback: Playback }) {
  const { sound } = player;
  const muted = sound.muted.value;
  const tooFast = !isHeardAt(playback.rate.value);
  const what = tooFast ? t('sound.notAtThisSpeed') : t(muted ? 'sound.unmute' : 'sound.mute', { name });
  return (
    <span class="pane-sound">
      <button
        type="button"
        class="button button-quiet button-square"
        aria-pressed={!muted}
        aria-label={t('sound.of', { name })}
        title={what}
        onClick={() => sound.mute(!muted)}
      >
        <Icon name={muted || tooFast ? 'soundOff' : 'sound'} />
      </button>
      <input
        type="range"
        class="pane-volume"
        min={0}
        max={1}
        step={0.05}
        value={muted ? 0 : sound.volume.value}
        aria-label={t('sound.volume', { name })}
        title={t('sound.volume', { name })}
        onInput={(event) => sound.setVolume(Number(event.currentTarget.value))}
      />
    </span>
  );
}
