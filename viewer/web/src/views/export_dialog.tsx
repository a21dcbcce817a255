// What can be taken out of a case: one stream as it was archived, or a part that proves itself.
import { useSignal } from '@preact/signals';
import type { ComponentChildren } from 'preact';
import { useEffect } from 'preact/hooks';
import { cases } from '@/api/client';
import type { CaseConsents } from '@/api/types';
import type { Span } from '@/base/spans';
import { formatDuration, formatTime } from '@/base/time';
import { lastPurpose, obstacleTo, purposeAmong } from '@/consent/consent_model';
import { PurposeChoice } from '@/consent/purpose_choice';
import { t, word } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { Icon, type IconName } from '@/shell/icon';
import { textOf } from '@/shell/state';
import type { CaseModel } from '@/views/case_model';

const kVitalForms = ['csv', 'jsonl'] as const;

/** `href`: undefined as long as nothing may be saved. */
function Save({ href, icon, main, children }: { href: string | undefined; icon: IconName; main?: boolean; children: ComponentChildren }) {
  const look = main ? 'button button-main' : 'button';
  const inner = (
    <>
      <Icon name={icon} />
      {children}
    </>
  );
  return href === undefined ? (
    <button type="button" class={look} disabled>
      {inner}
    </button>
  ) : (
    <a class={look} href={href} download>
      {inner}
    </a>
  );
}

export function ExportDialog({ model, span, unlocked, onClose }: { model: CaseModel; span: Span; unlocked: boolean; onClose: () => void }) {
  const id = model.info.id;
  const consents = useSignal<CaseConsents | undefined>(undefined);
  const failed = useSignal<unknown>(undefined);
  useEffect(() => {
    cases.consents(id).then(
      (stated) => (consents.value = stated),
      (error: unknown) => (failed.value = error),
    );
  }, [id]);
  const known = consents.value;
  const purpose = known ? purposeAmong(known, lastPurpose.value) : '';
  const allowed = (address: string): string | undefined => (known && !obstacleTo(known, purpose) ? address : undefined);
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
      {known && <PurposeChoice consents={known} purpose={purpose} />}
      {failed.value !== undefined && <p role="alert">{textOf(failed.value)}</p>}
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
            <Save href={allowed(cases.exportAddress(id, stream.value, span.start_ns, span.end_ns, 'mkv', purpose))} icon="export" main>
              {t('export.originalDo')}
            </Save>
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
                <Save key={form} href={allowed(cases.exportAddress(id, one.name, span.start_ns, span.end_ns, form, purpose))} icon="export">
                  {t(`export.vitals.${form}`)}
                </Save>
              ))}
            </div>
          ))}
        </section>
      )}
      <section class="choice">
        <h3>{t('export.excerpt')}</h3>
        <p class="muted">{t('export.excerptWhat')}</p>
        <Save href={allowed(cases.excerptAddress(id, span.start_ns, span.end_ns, purpose))} icon="intact">
          {t('export.excerptDo')}
        </Save>
      </section>
      <p class="muted">{t('export.logged')}</p>
    </Dialog>
  );
}
