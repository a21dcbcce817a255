// Parts of the attempt's view: forces, what a trainee may know, and where keys and gamepads point.
import { t } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import type { Began, Moment } from '@/training/training_api';

/** Of the bars: what a fingertip rarely exceeds. */
const kMostForce_n = 20;

/** `walls_n`: of instruments, in whose place fingers are then. */
export function Forces({ forces_n, walls_n, wrist_n }: { forces_n: readonly number[]; walls_n?: readonly number[] | undefined; wrist_n: number }) {
  const nameOf = (i: number) => t(walls_n ? 'attempt.instrument' : 'attempt.finger', { n: i + 1 });
  return (
    <section class="force-list" aria-label={t('attempt.forces')}>
      <h2>{t('attempt.forces')}</h2>
      {forces_n.map((force, i) => (
        <div class="force" key={i}>
          <span>{nameOf(i)}</span>
          <progress class="force-bar" max={kMostForce_n} value={Math.min(force, kMostForce_n)} aria-label={nameOf(i)} />
          <span class="mono">{force.toFixed(1)}</span>
        </div>
      ))}
      {walls_n && (
        <div class="force force-all">
          <span>{t('attempt.wall')}</span>
          <span />
          <span class="mono">{Math.max(0, ...walls_n).toFixed(1)}</span>
        </div>
      )}
      <div class="force force-all">
        <span>{t(walls_n ? 'attempt.handles' : 'attempt.all')}</span>
        <span />
        <span class="mono">{wrist_n.toFixed(1)}</span>
      </div>
    </section>
  );
}

/** What the colours of pressed tissue stand for: blue to red, as the server paints them. */
export function PressScale({ least_n, most_n }: { least_n: number; most_n: number }) {
  const label = t('attempt.press', { least: least_n.toFixed(1), most: most_n.toFixed(1) });
  return (
    <figure class="press-scale" aria-label={label}>
      <div class="press-scale-bar" aria-hidden="true" />
      <figcaption>{label}</figcaption>
    </figure>
  );
}

/** Time, line, path, and stress where this attempt shows it. */
export function AttemptFacts({ told, now }: { told: Began | undefined; now: Moment | undefined }) {
  const stress_kPa = now?.largest_von_mises_pa === undefined ? undefined : now.largest_von_mises_pa / 1000;
  const inDanger = (now?.danger ?? 0) > 0;
  return (
    <dl class="attempt-facts card">
      <div>
        <dt>{t('attempt.time')}</dt>
        <dd class="mono">{(now?.time_s ?? 0).toFixed(1)} s</dd>
      </div>
      <div>
        <dt>{t('attempt.seen')}</dt>
        <dd class="mono">{Math.round(100 * (now?.visible_share ?? 0))} %</dd>
      </div>
      <div>
        <dt>{t('attempt.held')}</dt>
        <dd class="mono">
          {(now?.held_s ?? 0).toFixed(1)} / {(told?.hold_s ?? 1).toFixed(1)} s
        </dd>
      </div>
      <div>
        <dt>{t(told?.instrument ? 'attempt.pathOfTips' : 'attempt.path')}</dt>
        <dd class="mono">{(100 * (now?.path_m ?? 0)).toFixed(0)} cm</dd>
      </div>
      {told && !told.stress_shown && <p class="muted">{t('attempt.stressHidden')}</p>}
      {stress_kPa !== undefined && (
        <div class={inDanger ? 'attempt-danger' : ''}>
          <dt>{t('attempt.stress')}</dt>
          <dd class="mono">
            {inDanger && <Icon name="alarm" />} {stress_kPa.toFixed(0)} kPa
          </dd>
        </div>
      )}
    </dl>
  );
}

/** Where keys or a gamepad point; with the finger's number, where one is chosen. */
export function PointMark({ at, down, pad = false }: { at: { x: number; y: number; finger: number }; down: boolean; pad?: boolean }) {
  return (
    <span
      class={`key-mark${pad ? ' pad-mark' : ''}${down ? ' key-mark-down' : ''}`}
      style={{ left: `${at.x * 100}%`, top: `${at.y * 100}%` }}
      aria-hidden="true"
    >
      {at.finger === 0 ? '' : at.finger}
    </span>
  );
}
