// Play, step, jump, speed; the time of the case clock and of the wall.
import { formatTime, parseTime } from '@/base/time';
import { kSpeeds } from '@/clock/sync';
import { formatTimeOfDay, t } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { Dialog } from '@/shell/dialog';
import { Icon, type IconName } from '@/shell/icon';
import { useSignal } from '@preact/signals';
import { type CaseModel, wallClock } from '@/views/case_model';
import type { Action } from '@/views/keyboard';

function Clock({ model, playback, onGoTo }: { model: CaseModel; playback: Playback; onGoTo: () => void }) {
  const at_ns = playback.position_ns.value;
  const wall = wallClock(model.info, at_ns);
  return (
    <button type="button" class="clock" title={t('transport.goTo')} onClick={onGoTo}>
      <span class="clock-now mono">{formatTime(at_ns - model.whole.start_ns, 3)}</span>
      <span class="clock-of muted mono">
        / {formatTime(model.whole.end_ns - model.whole.start_ns)} · {formatTimeOfDay(wall)}
      </span>
      <span class="only-heard">{t('transport.goTo')}</span>
    </button>
  );
}

export function Transport({
  model,
  playback,
  withPictures,
  act,
}: {
  model: CaseModel;
  playback: Playback;
  withPictures: boolean;
  act: (action: Action) => void;
}) {
  const playing = playback.playing.value;
  const Button = ({ action, icon, label, keys, touchOnly }: { action: Action; icon: IconName; label: string; keys: string; touchOnly?: boolean }) => (
    <button
      type="button"
      class={`button button-quiet button-square${touchOnly ? ' touch-only' : ''}`}
      aria-label={label}
      title={`${label} (${keys})`}
      aria-keyshortcuts={keys}
      onClick={() => act(action)}
    >
      <Icon name={icon} />
    </button>
  );
  return (
    <div class="transport" role="toolbar" aria-label={t('transport.label')}>
      <div class="transport-group">
        <Button action="previousMark" icon="markBack" label={t('transport.previousMark')} keys="PageUp" />
        {withPictures && <Button action="frameBack" icon="stepBack" label={t('transport.frameBack')} keys="," />}
        <button
          type="button"
          class="button button-play"
          aria-label={playing ? t('transport.pause') : t('transport.play')}
          title={`${playing ? t('transport.pause') : t('transport.play')} (${t('key.space')})`}
          aria-keyshortcuts="Space"
          onClick={() => act('toggle')}
        >
          <Icon name={playing ? 'pause' : 'play'} filled={!playing} />
        </button>
        {withPictures && <Button action="frameForward" icon="stepForward" label={t('transport.frameForward')} keys="." />}
        <Button action="nextMark" icon="markForward" label={t('transport.nextMark')} keys="PageDown" />
      </div>
      <Clock model={model} playback={playback} onGoTo={() => act('goTo')} />
      <div class="transport-group transport-end">
        <Button action="selectFrom" icon="selectFrom" label={t('transport.selectFrom')} keys="I" touchOnly />
        <Button action="selectTo" icon="selectTo" label={t('transport.selectTo')} keys="O" touchOnly />
        <label class="speed">
          <span class="only-heard">{t('transport.speed')}</span>
          <select
            title={`${t('transport.speed')} ([ ])`}
            value={String(playback.rate.value)}
            onChange={(event) => playback.setRate(Number(event.currentTarget.value))}
          >
            {kSpeeds.map((speed) => (
              <option key={speed} value={String(speed)}>
                {speed}×
              </option>
            ))}
          </select>
        </label>
        <Button action="fullScreen" icon="fullScreen" label={t('transport.fullScreen')} keys="F" />
        <Button action="help" icon="help" label={t('help.title')} keys="?" />
      </div>
    </div>
  );
}

export function GoToDialog({ model, playback, onClose }: { model: CaseModel; playback: Playback; onClose: () => void }) {
  const text = useSignal('');
  const problem = useSignal('');
  const begin = model.whole.start_ns;
  return (
    <Dialog title={t('goTo.title')} onClose={onClose}>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          const time = parseTime(text.value, playback.position_ns.value - begin);
          if (time === undefined || time < 0 || time > model.whole.end_ns - begin) {
            problem.value = t('goTo.refused', { end: formatTime(model.whole.end_ns - begin) });
            return;
          }
          playback.seek(begin + time);
          onClose();
        }}
      >
        <label class="field">
          <span>{t('goTo.what')}</span>
          <input
            autofocus
            class="mono"
            value={text.value}
            onInput={(event) => (text.value = event.currentTarget.value)}
            placeholder={formatTime(playback.position_ns.peek() - begin)}
          />
        </label>
        <p class="problem" role="alert">
          {problem.value}
        </p>
        <div class="dialog-end">
          <button type="submit" class="button button-main">
            {t('goTo.do')}
          </button>
        </div>
      </form>
    </Dialog>
  );
}
