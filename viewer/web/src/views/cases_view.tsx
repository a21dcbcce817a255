// The list of cases, newest first, with search; more is asked for at its end.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { cases as api } from '@/api/client';
import type { CaseSummary } from '@/api/types';
import { hrefOf } from '@/base/route';
import { formatBytes, formatDuration } from '@/base/time';
import { formatMoment, t, word } from '@/i18n/i18n';
import { Dialog } from '@/shell/dialog';
import { Icon } from '@/shell/icon';
import { returns } from '@/shell/connection';
import { may } from '@/shell/rights';
import { StateCard } from '@/shell/state_card';
import { announce, attempt, session } from '@/shell/state';
import { VerdictChip, VerdictTime } from '@/shell/verdict';
import { ListedSubject } from '@/subject/case_subject';
import { UnlockPanel } from '@/views/unlock_panel';

const kPage = 50;
const kTypingPause_ms = 200;

function Facts({ one }: { one: CaseSummary }) {
  return (
    <>
      <span class="case-when">
        <strong>{formatMoment(one.opened)}</strong>
        <small class="mono muted">{one.id}</small>
      </span>
      <span class="case-fact">
        <small>{t('cases.length')}</small>
        {one.duration_ns === null ? '–' : formatDuration(one.duration_ns)}
      </span>
      <span class="case-fact case-streams">
        <small>{t('cases.streams')}</small>
        {one.streams
          .filter((name) => name !== 'events' && name !== 'pointing')
          .map((name) => word('stream', name))
          .join(' · ')}
      </span>
      <span class="case-fact">
        <small>{t('cases.size')}</small>
        {formatBytes(one.bytes)}
      </span>
      <span class="case-fact">
        <small>{t('cases.tokens')}</small>
        {one.tokens}
      </span>
      <ListedSubject one={one} />
    </>
  );
}

function Row({ one }: { one: CaseSummary }) {
  const recording = one.state === 'open';
  return (
    <li class="case-row">
      {may(session.value?.role, 'read-case') ? (
        <a class="case-link" href={hrefOf({ view: 'case', id: one.id })}>
          <Facts one={one} />
        </a>
      ) : (
        <div class="case-link">
          <Facts one={one} />
        </div>
      )}
      {recording ? (
        <span class="verdict verdict-recording">
          <Icon name="record" filled />
          {t('cases.recording')}
        </span>
      ) : may(session.value?.role, 'verify') ? (
        <a class="case-verdict" href={hrefOf({ view: 'verification', id: one.id })}>
          <VerdictChip verdict={one.verdict} />
          <VerdictTime verified={one.verified} />
        </a>
      ) : (
        <span class="case-verdict">
          <VerdictChip verdict={one.verdict} />
          <VerdictTime verified={one.verified} />
        </span>
      )}
    </li>
  );
}

export function CasesView() {
  const search = useSignal('');
  const list = useSignal<CaseSummary[] | undefined>(undefined);
  const more = useSignal(false);
  const unread = useSignal(0);
  const unlocking = useSignal(false);
  const unlocked = session.value?.unlocked ?? false;
  const mayWatch = may(session.value?.role, 'watch');

  useEffect(() => {
    document.title = `${t('nav.cases')} · Kiroku`;
  });

  const text = search.value;
  useEffect(() => {
    const request = new AbortController();
    const timer = setTimeout(
      () =>
        void attempt(async () => {
          unread.value = 0;
          let before: number;
          do {
            before = unread.value === 0 ? Infinity : unread.value;
            const found = await api.list(text, kPage, undefined, request.signal);
            list.value = found.cases;
            more.value = found.cases.length === kPage;
            unread.value = found.unread;
          } while (unread.value > 0 && unread.value < before && !request.signal.aborted);
          if (text !== '') announce(t('cases.found', { n: list.value.length }));
        }),
      list.value ? kTypingPause_ms : 0,
    );
    return () => {
      clearTimeout(timer);
      request.abort();
    };
  }, [text, returns.value, unlocked]);

  const loadMore = () =>
    attempt(async () => {
      const known = list.value ?? [];
      const found = await api.list(text, kPage, known.at(-1)?.id);
      list.value = [...known, ...found.cases];
      more.value = found.cases.length === kPage;
    });

  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{t('nav.cases')}</h1>
        <label class="search">
          <Icon name="search" />
          <span class="only-heard">{t(unlocked && mayWatch ? 'cases.searchPeople' : 'cases.search')}</span>
          <input
            type="search"
            placeholder={t(unlocked && mayWatch ? 'cases.searchPeople' : 'cases.search')}
            value={text}
            onInput={(event) => {
              search.value = event.currentTarget.value;
            }}
          />
        </label>
      </div>
      {mayWatch && !unlocked && (
        <p class="cases-sealed">
          <span class="muted">{t('cases.sealed')}</span>
          <button type="button" class="button" onClick={() => (unlocking.value = true)}>
            <Icon name="lock" />
            {t('cases.unlock')}
          </button>
        </p>
      )}
      {unread.value > 0 && (
        <p class="muted" role="status">
          {t('cases.unread', { n: unread.value })}
        </p>
      )}
      {list.value?.length === 0 && unread.value === 0 && (
        <StateCard
          icon="cases"
          title={text === '' ? t('cases.none') : t('cases.noneFound', { text })}
          what={text === '' ? t('cases.noneWhat') : t('cases.noneFoundWhat')}
        >
          {text !== '' && (
            <button type="button" class="button" onClick={() => (search.value = '')}>
              {t('state.clearSearch')}
            </button>
          )}
          {text === '' && may(session.value?.role, 'control-rooms') && (
            <a class="button" href={hrefOf({ view: 'rooms' })}>
              {t('state.toRooms')}
            </a>
          )}
        </StateCard>
      )}
      <ul class="case-list" aria-label={t('nav.cases')} aria-busy={list.value === undefined}>
        {list.value?.map((one) => (
          <Row key={one.id} one={one} />
        ))}
      </ul>
      {more.value && (
        <button type="button" class="button" onClick={() => void loadMore()}>
          {t('cases.more')}
        </button>
      )}
      {unlocking.value && !unlocked && (
        <Dialog title={t('cases.unlock')} onClose={() => (unlocking.value = false)}>
          <UnlockPanel inList />
        </Dialog>
      )}
    </main>
  );
}
