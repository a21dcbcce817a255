// The appliance log: its entries, newest first, and whether it is whole.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { get } from '@/api/client';
import type { LogEntry, Report } from '@/api/types';
import { hrefOf } from '@/base/route';
import { formatMoment, type MessageKey, t, word } from '@/i18n/i18n';
import { deedInWords, fieldInWords } from '@/i18n/log_words';
import { kLogTypes, type LogRow, rowOf } from '@/log/log_entry';
import { returns } from '@/shell/connection';
import { announce, attempt } from '@/shell/state';
import { StateCard } from '@/shell/state_card';
import { VerdictChip } from '@/shell/verdict';
import { byGravity, severityText } from '@/verification/chain';
import { FindingText } from '@/verification/finding_text';

const kPage = 100;

function State() {
  const report = useSignal<Report | undefined>(undefined);
  const verify = () =>
    attempt(async () => {
      report.value = undefined;
      const found = await get<Report>('log/verification');
      report.value = found;
      announce(word('logVerdict', found.verdict));
    });
  useEffect(() => {
    void verify();
  }, []);
  const found = report.value;
  return (
    <section class="card log-state" aria-busy={found === undefined}>
      {found === undefined ? (
        <p class="muted">{t('log.verifying')}</p>
      ) : (
        <>
          <div class="log-verdict">
            <VerdictChip verdict={found.verdict} />
            <p>{word('logVerdict', found.verdict)}</p>
            <button type="button" class="button" onClick={() => void verify()}>
              {t('log.again')}
            </button>
          </div>
          <p class="muted">{t('log.found', { entries: found.entries, checkpoints: found.checkpoints, moment: formatMoment(found.verified) })}</p>
          {found.findings.length > 0 && (
            <ul class="log-findings">
              {byGravity(found.findings).map((one, at) => (
                <li key={at}>
                  <strong>{t(severityText(one.severity))}</strong> <FindingText finding={one} />
                </li>
              ))}
            </ul>
          )}
        </>
      )}
    </section>
  );
}

/** In the page's language; an access in its own words too, since those are what was signed. */
function What({ row }: { row: LogRow }) {
  const told = [...(row.deed === '' ? [] : [deedInWords(row.deed)]), ...row.carries.map(([field, value]) => fieldInWords(field, value))].join(', ');
  const differs = row.deed !== '' && deedInWords(row.deed) !== row.deed;
  return (
    <>
      <small class="muted log-what">{told}</small>
      {differs && (
        <small class="muted log-what" lang="en">
          {row.deed}
        </small>
      )}
    </>
  );
}

export function LogView() {
  const rows = useSignal<readonly LogRow[]>([]);
  const kind = useSignal('');
  const isWhole = useSignal(false);
  const load = (before: number | undefined) =>
    attempt(async () => {
      const query = new URLSearchParams({ limit: String(kPage) });
      if (kind.value !== '') query.set('type', kind.value);
      if (before !== undefined) query.set('before', String(before));
      const asked = kind.value;
      const { entries } = await get<{ entries: LogEntry[] }>(`log?${query}`);
      if (asked !== kind.value) return; // another kind was chosen meanwhile
      rows.value = [...(before === undefined ? [] : rows.value), ...entries.map(rowOf)];
      isWhole.value = entries.length < kPage;
    });
  useEffect(() => {
    void load(undefined);
  }, [kind.value, returns.value]);
  useEffect(() => {
    document.title = `${t('log.title')} · Kiroku`;
  });
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{t('log.title')}</h1>
      </div>
      <p class="muted">{t('log.what')}</p>
      <State />
      <section class="card table-card">
        <label class="field log-kind">
          <span>{t('log.kind')}</span>
          <select value={kind.value} onChange={(event) => (kind.value = event.currentTarget.value)}>
            <option value="">{t('log.all')}</option>
            {kLogTypes.map((type) => (
              <option key={type} value={type}>
                {t(`logType.${type}` as MessageKey)}
              </option>
            ))}
          </select>
        </label>
        {rows.value.length === 0 ? (
          isWhole.value && (
            <StateCard icon="document" title={t('log.none')} what={t('log.noneWhat')}>
              <button type="button" class="button" onClick={() => (kind.value = '')}>
                {t('log.all')}
              </button>
            </StateCard>
          )
        ) : (
          <div class="log-scroll" tabIndex={0} role="region" aria-label={t('log.title')}>
            <table class="table log-table">
              <thead>
                <tr>
                  <th scope="col" class="number">
                    {t('log.entry')}
                  </th>
                  <th scope="col">{t('log.when')}</th>
                  <th scope="col">{t('log.happened')}</th>
                  <th scope="col">{t('log.who')}</th>
                  <th scope="col">{t('log.case')}</th>
                </tr>
              </thead>
              <tbody>
                {rows.value.map((row) => (
                  <tr key={row.seq}>
                    <th scope="row" class="number mono">
                      {row.seq}
                    </th>
                    <td class="log-when">{formatMoment(row.utc)}</td>
                    <td>
                      <strong>{word('logType', row.type)}</strong>
                      <What row={row} />
                    </td>
                    <td lang="en">{row.who}</td>
                    <td>
                      {row.case !== '' && (
                        <a class="mono" href={hrefOf({ view: 'case', id: row.case })}>
                          {row.case}
                        </a>
                      )}
                    </td>
                  </tr>
                ))}
              </tbody>
            </table>
          </div>
        )}
        {!isWhole.value && rows.value.length > 0 && (
          <button type="button" class="button" onClick={() => void load(rows.value.at(-1)?.seq)}>
            {t('log.more')}
          </button>
        )}
      </section>
    </main>
  );
}
