// Marks, alarms, gaps and time-stamps in one list; each a button to its moment.
import { useSignal } from '@preact/signals';
import type { Alarm, VitalNotice } from '@/api/types';
import { lastAtOrBefore } from '@/base/spans';
import { formatDuration, formatTime } from '@/base/time';
import { formatMoment, t, word } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { Icon, type IconName } from '@/shell/icon';
import type { CaseModel, Moment } from '@/views/case_model';

const kSigns: Record<Moment['kind'], IconName> = { mark: 'mark', alarm: 'alarm', gap: 'dash', token: 'intact', notice: 'document' };
const kKinds: readonly Moment['kind'][] = ['mark', 'alarm', 'gap', 'token', 'notice'];

function momentsOf(model: CaseModel, alarms: readonly Alarm[], notices: readonly VitalNotice[]): Moment[] {
  const moments: Moment[] = [
    ...model.marks.map((one): Moment => ({ kind: 'mark', time_ns: one.time_ns, text: one.text, detail: '' })),
    ...alarms.map((one): Moment => ({
      kind: 'alarm',
      time_ns: one.start_ns,
      text: one.text,
      detail: `${formatDuration(one.end_ns - one.start_ns)}${one.questionable ? `, ${t('vitals.questionable')}` : ''}`,
    })),
    ...notices.map((one): Moment => ({ kind: 'notice', time_ns: one.time_ns, text: one.text, detail: word('stream', one.stream) })),
    ...[...model.gaps.values()].flat().map((one): Moment => ({
      kind: 'gap',
      time_ns: one.start_ns,
      text: `${word('stream', one.stream)}: ${word('cause', one.cause)}`,
      detail: formatDuration(one.end_ns - one.start_ns),
    })),
    ...model.soundGaps.map((one): Moment => ({
      kind: 'gap',
      time_ns: one.start_ns,
      text: t('moment.noSound', { stream: word('stream', one.stream), cause: word('cause', one.cause) }),
      detail: formatDuration(one.end_ns - one.start_ns),
    })),
    ...model.timeline.tokens.map((one): Moment => ({
      kind: 'token',
      time_ns: one.time_ns,
      text: one.authority,
      detail: `${formatMoment(one.gen_time)}, ${t(`time.${one.kind}`)}`,
    })),
  ];
  return moments.sort((a, b) => a.time_ns - b.time_ns);
}

interface Props {
  model: CaseModel;
  playback: Playback;
  alarms: readonly Alarm[];
  /** What the recorder says of the monitors. */
  notices: readonly VitalNotice[];
  sealed: boolean;
}

export function MomentsPanel({ model, playback, alarms, notices, sealed }: Props) {
  const hidden = useSignal<ReadonlySet<Moment['kind']>>(new Set());
  const all = momentsOf(model, alarms, notices);
  const kinds = kKinds.filter((kind) => all.some((one) => one.kind === kind));
  const list = all.filter((one) => !hidden.value.has(one.kind));
  const now = lastAtOrBefore(list, playback.position_ns.value + 1e6, (one) => one.time_ns);
  return (
    <div class="moments">
      {model.timeline.marks_problem && (
        <p class="pad" role="alert">
          {model.timeline.marks_problem}
        </p>
      )}
      {(model.timeline.events_lacking ?? 0) > 0 && (
        <p class="pad" role="status">
          {t('moment.lacking', { n: model.timeline.events_lacking ?? 0 })}
        </p>
      )}
      {sealed && !model.timeline.marks_problem && <p class="muted pad">{t('moment.sealed')}</p>}
      {kinds.length > 1 && (
        <div class="chips" role="group" aria-label={t('moment.show')}>
          {kinds.map((kind) => (
            <button
              key={kind}
              type="button"
              class="chip"
              aria-pressed={!hidden.value.has(kind)}
              onClick={() => {
                const next = new Set(hidden.value);
                if (!next.delete(kind)) next.add(kind);
                hidden.value = next;
              }}
            >
              <Icon name={kSigns[kind]} />
              {t(`moment.${kind}`)}
            </button>
          ))}
        </div>
      )}
      {list.length === 0 && <p class="muted pad">{t('moment.none')}</p>}
      <ol class="moment-list">
        {list.map((one, at) => (
          <li key={`${one.kind}${one.time_ns}${at}`}>
            <button type="button" class={`moment moment-${one.kind}`} aria-current={at === now ? 'time' : undefined} onClick={() => playback.seek(one.time_ns)}>
              <Icon name={kSigns[one.kind]} />
              <span class="moment-text">
                <span class="only-heard">{t(`moment.${one.kind}`)}: </span>
                {one.text}
                {one.detail !== '' && <small class="muted">{one.detail}</small>}
              </span>
              <span class="mono">{formatTime(one.time_ns - model.whole.start_ns)}</span>
            </button>
          </li>
        ))}
      </ol>
    </div>
  );
}
