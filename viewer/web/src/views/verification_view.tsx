// The verdict of a case in words, what it rests on, and every finding with its moment.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { cases as api } from '@/api/client';
import type { CaseInfo, Finding, Timeline, Verification, VerificationReport, VerifiedExcerpt } from '@/api/types';
import { hrefOf } from '@/base/route';
import { formatBytes, formatDuration, formatTime } from '@/base/time';
import { isFleet } from '@/fleet/fleet_api';
import { shownCase } from '@/fleet/question';
import { formatMoment, language, t, word } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import { may } from '@/shell/rights';
import { announce, attempt, session } from '@/shell/state';
import { verdictSign } from '@/shell/verdict';
import { nameWithKind } from '@/verification/authority_kind';
import { byGravity, chainOf, isThereByThen, linkOf, type LinkName, momentOf, severityText, wordsOfChain, wordsOfTime } from '@/verification/chain';
import { ChainDrawing } from '@/verification/chain_drawing';
import { FindingText } from '@/verification/finding_text';

const kEvery_ms = 400;

function FindingRow({ finding, timeline, about }: { finding: Finding; timeline: Timeline | undefined; about: CaseInfo | undefined }) {
  const moment = momentOf(finding, timeline);
  const place = [
    finding.file,
    finding.entry !== null && t('finding.entry', { n: finding.entry }),
    finding.offset !== null && t('finding.offset', { n: finding.offset }),
  ].filter((one): one is string => typeof one === 'string');
  return (
    <li class={`finding finding-${finding.severity}`}>
      <span class="finding-severity">{t(severityText(finding.severity))}</span>
      <div class="finding-what">
        <p>
          <FindingText finding={finding} />
        </p>
        <p class="muted mono finding-place">
          {[finding.code, ...place].map((one) => (
            <span key={one}>{one}</span>
          ))}
        </p>
      </div>
      {moment !== undefined && about && (
        <a class="button" href={hrefOf({ view: 'case', id: about.id, at_ns: moment })}>
          <Icon name="play" filled />
          <span class="only-heard">{t('finding.go')} </span>
          {formatTime(moment - about.begins_ns)}
        </a>
      )}
    </li>
  );
}

function Brackets({ report }: { report: VerificationReport }) {
  const said = (utc: string | null, authority: string | null, kind: VerificationReport['brackets'][number]['time']) =>
    utc ? `${formatMoment(utc)}${authority ? ` (${nameWithKind(authority, kind)})` : ''}` : t('bracket.unknown');
  return (
    <section class="card table-card" aria-labelledby="brackets">
      <h2 id="brackets">{t(isThereByThen(report) ? 'bracket.titleUntil' : 'bracket.title')}</h2>
      <p class="muted">{t('bracket.what')}</p>
      <div class="table-scroll" tabIndex={0} role="region" aria-labelledby="brackets">
        <table class="table">
          <thead>
            <tr>
              <th scope="col">{t('bracket.entries')}</th>
              <th scope="col">{t('bracket.after')}</th>
              <th scope="col">{t('bracket.before')}</th>
            </tr>
          </thead>
          <tbody>
            {report.brackets.map((one) => (
              <tr key={one.first_entry}>
                <th scope="row" class="mono">
                  {one.first_entry} – {one.last_entry}
                </th>
                <td>{said(one.not_before, one.authority_before, one.time)}</td>
                <td>{said(one.not_after, one.authority_after, one.time)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

function Witnesses({ of }: { of: NonNullable<VerificationReport['witnesses']> }) {
  const n = of.entries;
  const told = of.asks_for_none
    ? t('witness.noneNeeded')
    : !of.note
      ? t('witness.none')
      : of.quorum
        ? t('witness.met', { n })
        : of.holds === 'end' || of.witnesses.every((one) => !one.cosigned)
          ? t('witness.notMet', { n })
          : t('witness.beginning', { n });
  return (
    <section class="card" aria-labelledby="witnesses">
      <h2 id="witnesses">{t('witness.title')}</h2>
      <p>{told}</p>
      <dl class="small-facts">
        {of.witnesses.map((one) => (
          <div key={one.witness}>
            <dt class="mono">{one.witness}</dt>
            <dd>
              {one.cosigned && one.time_s !== undefined
                ? t('witness.cosigned', { moment: formatMoment(new Date(one.time_s * 1000).toISOString()) })
                : t(one.invalid ? 'witness.invalid' : 'witness.absent')}
            </dd>
          </div>
        ))}
      </dl>
      {of.unused.map((why) => (
        <p class="muted" key={why}>
          {why}
        </p>
      ))}
    </section>
  );
}

function Streams({ report }: { report: VerificationReport }) {
  return (
    <section class="card table-card" aria-labelledby="streams">
      <h2 id="streams">{t('verify.streams')}</h2>
      <table class="table">
        <thead>
          <tr>
            <th scope="col">{t('rooms.stream')}</th>
            <th scope="col" class="number">
              {t('verify.segments')}
            </th>
            <th scope="col" class="number">
              {t('verify.frames')}
            </th>
            <th scope="col" class="number">
              {t('rooms.lost')}
            </th>
            <th scope="col" class="number">
              {t('cases.size')}
            </th>
            <th scope="col" class="number">
              {t('verify.gaps')}
            </th>
          </tr>
        </thead>
        <tbody>
          {report.streams.map((one) => (
            <tr key={one.name}>
              <th scope="row">{word('stream', one.name)}</th>
              <td class="number">
                {one.segments}
                {one.erased_segments > 0 && ` (${t('verify.erased', { n: one.erased_segments })})`}
              </td>
              <td class="number">{one.frames}</td>
              <td class="number">{one.dropped}</td>
              <td class="number">{formatBytes(one.bytes)}</td>
              <td class="number">{one.gap_ns === 0 ? t('verify.noGap') : formatDuration(one.gap_ns)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

function Part({ excerpt }: { excerpt: VerifiedExcerpt }) {
  const held = excerpt.streams.filter((one) => one.selected);
  const leftOut = excerpt.streams.filter((one) => !one.selected).map((one) => word('stream', one.name));
  const { made_utc, made_by } = excerpt.stated;
  return (
    <section aria-labelledby="part">
      <h2 id="part">{t('excerpt.title')}</h2>
      <dl class="card small-facts">
        <div>
          <dt>{t('excerpt.time')}</dt>
          <dd>{t('excerpt.span', { from: formatTime(excerpt.from_ns - excerpt.begins_ns), to: formatTime(excerpt.to_ns - excerpt.begins_ns) })}</dd>
        </div>
        <div>
          <dt>{t('excerpt.held')}</dt>
          {held.map((one) => (
            <dd key={one.name}>
              {t(one.case_segments === null ? 'excerpt.ofAtLeast' : 'excerpt.of', {
                stream: word('stream', one.name),
                held: one.held_segments,
                all: one.case_segments ?? one.known_segments,
              })}
            </dd>
          ))}
        </div>
        <div>
          <dt>{t('excerpt.leftOut')}</dt>
          <dd>{[...leftOut, t('excerpt.rest')].join(', ')}</dd>
        </div>
        {(made_utc ?? made_by) && (
          <div>
            <dt>{t('excerpt.made')}</dt>
            <dd>
              {t(made_utc && made_by ? 'excerpt.claim' : made_utc ? 'excerpt.claimAt' : 'excerpt.claimBy', {
                moment: made_utc ? formatMoment(made_utc) : '',
                by: made_by ?? '',
              })}
            </dd>
          </div>
        )}
      </dl>
    </section>
  );
}

function Report({ id, report, timeline, about }: { id: string; report: VerificationReport; timeline: Timeline | undefined; about: CaseInfo | undefined }) {
  const selected = useSignal<LinkName | undefined>(undefined);
  const findings = byGravity(report.findings).filter((one) => !selected.value || linkOf(one) === selected.value);
  return (
    <>
      <section class={`banner banner-${report.verdict}`} aria-labelledby="verdict">
        <Icon name={verdictSign(report.verdict)} />
        <div>
          <h2 id="verdict">{t(`verdict.${report.verdict}`)}</h2>
          <p>{t(`verdictWhat.${report.verdict}`)}</p>
          <p class="muted">{t('verify.when', { moment: formatMoment(report.verified) })}</p>
          <p class="muted">
            {wordsOfTime(report)
              .map((key) => t(key))
              .join(' ')}
          </p>
        </div>
        {!isFleet() && (
          <div class="banner-end">
            <a class="button button-main" href={api.reportAddress(id, language.value)} target="_blank" rel="noopener">
              <Icon name="document" />
              {t('verify.report')}
            </a>
            <a class="button" href={api.receiptAddress(id, language.value)} target="_blank" rel="noopener">
              <Icon name="document" />
              {t('verify.receipt')}
            </a>
          </div>
        )}
      </section>
      {report.excerpt && <Part excerpt={report.excerpt} />}
      <section aria-labelledby="chain">
        <h2 id="chain">{t('chain.title')}</h2>
        <p class="muted">
          {wordsOfChain(report)
            .map((key) => t(key))
            .join(' ')}
        </p>
        <ChainDrawing chain={chainOf(report)} report={report} selected={selected.value} onSelect={(name) => (selected.value = name)} />
      </section>
      <section aria-labelledby="findings">
        <h2 id="findings">
          {selected.value ? t('finding.titleOf', { link: t(`link.${selected.value}`) }) : t('finding.title')} <span class="count">{findings.length}</span>
        </h2>
        {findings.length === 0 ? (
          <p class="muted">{t('finding.none')}</p>
        ) : (
          <ul class="findings">
            {findings.map((one, at) => (
              <FindingRow key={`${selected.value ?? ''}${at}`} finding={one} timeline={timeline} about={about} />
            ))}
          </ul>
        )}
      </section>
      <Brackets report={report} />
      {report.witnesses && <Witnesses of={report.witnesses} />}
      <Streams report={report} />
      <dl class="card small-facts">
        <div>
          <dt>{t('verify.device')}</dt>
          <dd class="mono">{report.device}</dd>
        </div>
        <div>
          <dt>{t('verify.signatures')}</dt>
          <dd>{t(`signatures.${report.signatures}`)}</dd>
        </div>
        <div>
          <dt>{t('verify.opened')}</dt>
          <dd>{report.opened ? formatMoment(report.opened) : '–'}</dd>
        </div>
        <div>
          <dt>{t('verify.closed')}</dt>
          <dd>{report.closed ? formatMoment(report.closed) : '–'}</dd>
        </div>
      </dl>
    </>
  );
}

export function VerificationView({ id }: { id: string }) {
  const state = useSignal<Verification | undefined>(undefined);
  const known = useSignal(false);
  const timeline = useSignal<Timeline | undefined>(undefined);
  const about = useSignal<CaseInfo | undefined>(undefined);
  const watching = useSignal(0);

  const mayVerify = may(session.value?.role, 'verify');

  useEffect(() => {
    document.title = `${t('verify.title')} · ${id} · Kiroku`;
  });
  useEffect(() => {
    void attempt(async () => {
      about.value = await api.get(id);
    });
    void attempt(async () => {
      timeline.value = await api.timeline(id);
    });
  }, [id]);
  useEffect(() => {
    let ended = false;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const look = async () => {
      const before = state.value;
      const now = await attempt(() => api.verification(id));
      if (ended) return;
      state.value = now;
      known.value = true;
      if (now?.state === 'running') timer = setTimeout(() => void look(), kEvery_ms);
      if (now?.state === 'done' && before?.state === 'running') announce(t('verify.done', { verdict: t(`verdict.${now.verdict}`) }));
    };
    void look();
    return () => {
      ended = true;
      clearTimeout(timer);
    };
  }, [id, watching.value]);

  const start = () =>
    attempt(async () => {
      await api.verify(id);
      announce(t('verify.running'));
      watching.value += 1;
    });

  const now = state.value;
  return (
    <main id="main" class="main narrow verification" tabIndex={-1}>
      <div class="view-head">
        <div>
          <p class="crumbs">
            <a href={hrefOf({ view: 'cases' })}>{t('nav.cases')}</a>
            <span aria-hidden="true">/</span>
            <a class="mono" href={hrefOf({ view: 'case', id })}>
              {shownCase(id)}
            </a>
          </p>
          <h1>{t('verify.title')}</h1>
        </div>
        {mayVerify && (
          <button
            type="button"
            class={now?.state === 'done' ? 'button' : 'button button-main'}
            disabled={now?.state === 'running'}
            onClick={() => void start()}
          >
            <Icon name="intact" />
            {now?.state === 'done' ? t('verify.again') : t('verify.do')}
          </button>
        )}
      </div>
      {known.value && now === undefined && (
        <div class="empty card">
          <Icon name="notVerified" />
          <p>{t('verify.notYet')}</p>
        </div>
      )}
      {now?.state === 'running' && (
        <div class="card progress-card" role="status">
          <p>{t('verify.running')}</p>
          <progress aria-label={t('verify.running')} max={Math.max(1, now.total_bytes)} value={now.total_bytes === 0 ? undefined : now.done_bytes} />
          {now.total_bytes > 0 && <p class="muted">{t('verify.progress', { done: formatBytes(now.done_bytes), total: formatBytes(now.total_bytes) })}</p>}
        </div>
      )}
      {now?.state === 'done' && <Report id={id} report={now} timeline={timeline.value} about={about.value} />}
    </main>
  );
}
