// What can be taken out of a case: one stream as it was archived, or a part that proves itself.
import { useSignal } from '@preact/signals';
import { cases } from '@/api/client';
import type { Span } from '@/base/spans';
import { formatDuration, formatTime } from '@/base/time';
import { t, word } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import type { CaseModel } from '@/views/case_model';

const kVitalForms = ['csv', 'jsonl'] as const;

export function ExportDialog({ model, span, unlocked, onClose }: { model: CaseModel; span: Span; unlocked: boolean; onClose: () => void }) {
  const stream = useSignal(model.videos[0]?.name ?? '');
  const vitals = model.info.streams.filter((one) => one.kind === 'vitals');
  const from = formatTime(span.start_ns - model.whole.start_ns, 3);
  const to = formatTime(span.end_ns - model.whole.start_ns, 3);
  return (
    <Dialog title={t('export.title')} onClose={onClose}>
      <p>
        <span class="mono">
          {from} – {to}
        </span>{' '}
        <span class="muted">({formatDuration(span.end_ns - span.start_ns)})</span>
      </p>
      {unlocked && model.videos.length > 0 && (
        <section class="choice">
          <h3>{t('export.original')}</h3>
          <p class="muted">{t('export.originalWhat')}</p>
          <div class="choice-row">
            <label class="field">
              <span>{t('rooms.stream')}</span>
              <select value={stream.value} onChange={(event) => (stream.value = event.currentTarget.value)}>
                {model.videos.map((one) => (
                  <option key={one.name} value={one.name}>
                    {word('stream', one.name)}
                  </option>
                ))}
              </select>
            </label>
            <a class="button button-main" href={cases.exportAddress(model.info.id, stream.value, span.start_ns, span.end_ns, 'mkv')} download>
              <Icon name="export" />
              {t('export.originalDo')}
            </a>
          </div>
        </section>
      )}
      {unlocked && vitals.length > 0 && (
        <section class="choice">
          <h3>{t('export.vitals')}</h3>
          <p class="muted">{t('export.vitalsWhat')}</p>
          {vitals.map((one) => (
            <div key={one.name} class="choice-row">
              {vitals.length > 1 && <span>{word('stream', one.name)}</span>}
              {kVitalForms.map((form) => (
                <a key={form} class="button" href={cases.exportAddress(model.info.id, one.name, span.start_ns, span.end_ns, form)} download>
                  <Icon name="export" />
                  {t(`export.vitals.${form}`)}
                </a>
              ))}
            </div>
          ))}
        </section>
      )}
      <section class="choice">
        <h3>{t('export.excerpt')}</h3>
        <p class="muted">{t('export.excerptWhat')}</p>
        <a class="button" href={cases.excerptAddress(model.info.id, span.start_ns, span.end_ns)} download>
          <Icon name="intact" />
          {t('export.excerptDo')}
        </a>
      </section>
      <p class="muted">{t('export.logged')}</p>
    </Dialog>
  );
}
