// The list of all appliances' cases, newest first; more is asked for at its end.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import type { FleetAppliance, FleetCase, Verdict } from '@/api/types';
import { hrefOf } from '@/base/route';
import { formatBytes, formatDuration } from '@/base/time';
import { fleet } from '@/fleet/fleet_api';
import { FoundCases, type LookedAt } from '@/fleet/found_cases';
import { type FleetQuestion, isSearch, kAnything } from '@/fleet/question';
import { formatMoment, t, word } from '@/i18n/i18n';
import { returns } from '@/shell/connection';
import { Icon } from '@/shell/icon';
import { may } from '@/shell/rights';
import { StateCard } from '@/shell/state_card';
import { announce, attempt, session } from '@/shell/state';
import { VerdictChip, VerdictTime } from '@/shell/verdict';

const kPage = 50;
const kVerdicts: readonly Verdict[] = ['intact', 'intact-with-gaps', 'unproven', 'incomplete', 'tampered'];

function Facts({ one }: { one: FleetCase }) {
  return (
    <>
      <span class="case-when">
        <strong>{formatMoment(one.opened)}</strong>
        <small class="mono muted">{one.case}</small>
      </span>
      <span class="case-fact">
        <small>{t('fleet.appliance')}</small>
        {one.appliance}
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
    </>
  );
}

/** What a person must know beside the verdict. */
function Concern({ one }: { one: FleetCase }) {
  const told =
    one.state === 'missing'
      ? t('fleet.missing')
      : one.state === 'unreadable'
        ? t('fleet.unreadable')
        : one.alarm && one.verdict === null
          ? t('fleet.alarm')
          : undefined;
  return (
    <>
      {told !== undefined && <small class="fleet-concern">{told}</small>}
      {one.unchecked !== null && (
        <small class="fleet-concern" title={one.unchecked}>
          {t('fleet.unchecked')}
        </small>
      )}
    </>
  );
}

function Found({ one }: { one: FleetCase }) {
  return (
    <>
      <VerdictChip verdict={one.verdict} />
      <VerdictTime verified={one.verified} />
      <Concern one={one} />
    </>
  );
}

function Row({ one }: { one: FleetCase }) {
  const isThere = one.state === 'open' || one.state === 'closed';
  return (
    <li class="case-row">
      {isThere && may(session.value?.role, 'read-case') ? (
        <a class="case-link" href={hrefOf({ view: 'case', id: one.id })}>
          <Facts one={one} />
        </a>
      ) : (
        <div class="case-link">
          <Facts one={one} />
        </div>
      )}
      {one.state !== 'missing' && may(session.value?.role, 'verify') ? (
        <a class="case-verdict fleet-verdict" href={hrefOf({ view: 'verification', id: one.id })}>
          <Found one={one} />
        </a>
      ) : (
        <span class="case-verdict fleet-verdict">
          <Found one={one} />
        </span>
      )}
    </li>
  );
}

function Questions({ asked, appliances, ask }: { asked: FleetQuestion; appliances: readonly FleetAppliance[]; ask: (more: Partial<FleetQuestion>) => void }) {
  return (
    <fieldset class="card fleet-questions">
      <legend class="only-heard">{t('fleet.narrow')}</legend>
      <label class="field">
        <span>{t('fleet.appliance')}</span>
        <select value={asked.appliance} onChange={(event) => ask({ appliance: event.currentTarget.value })}>
          <option value="">{t('fleet.all')}</option>
          {appliances.map(({ name }) => (
            <option key={name} value={name}>
              {name}
            </option>
          ))}
        </select>
      </label>
      <label class="field">
        <span>{t('fleet.verdict')}</span>
        <select value={asked.verdict} onChange={(event) => ask({ verdict: event.currentTarget.value as FleetQuestion['verdict'] })}>
          <option value="">{t('fleet.all')}</option>
          <option value="none">{t('verdict.none')}</option>
          {kVerdicts.map((verdict) => (
            <option key={verdict} value={verdict}>
              {t(`verdict.${verdict}`)}
            </option>
          ))}
        </select>
      </label>
      <label class="field">
        <span>{t('fleet.from')}</span>
        <input type="date" value={asked.from} onChange={(event) => ask({ from: event.currentTarget.value })} />
      </label>
      <label class="field">
        <span>{t('fleet.to')}</span>
        <input type="date" value={asked.to} onChange={(event) => ask({ to: event.currentTarget.value })} />
      </label>
      <label class="train-check">
        <input type="checkbox" checked={asked.attention} onChange={(event) => ask({ attention: event.currentTarget.checked })} />
        <span>{t('fleet.attention')}</span>
      </label>
    </fieldset>
  );
}

/** By patient or procedure: asked for as a whole, since each search is entered in the log. */
function Search({ asked, ask }: { asked: FleetQuestion; ask: (more: Partial<FleetQuestion>) => void }) {
  const patient = useSignal(asked.patient);
  const procedure = useSignal(asked.procedure);
  // Whoever asks for all cases elsewhere asks for nobody here.
  useEffect(() => {
    patient.value = asked.patient;
    procedure.value = asked.procedure;
  }, [asked.patient, asked.procedure]);
  return (
    <form
      role="search"
      class="card fleet-questions"
      aria-label={t('fleet.search')}
      autocomplete="off"
      onSubmit={(event) => {
        event.preventDefault();
        ask({ patient: patient.value.trim(), procedure: procedure.value.trim() });
      }}
    >
      <label class="field">
        <span>{t('fleet.patient')}</span>
        <input type="text" value={patient.value} maxLength={256} onInput={(event) => (patient.value = event.currentTarget.value)} />
      </label>
      <label class="field">
        <span>{t('fleet.procedure')}</span>
        <input type="text" value={procedure.value} maxLength={256} onInput={(event) => (procedure.value = event.currentTarget.value)} />
      </label>
      <button type="submit" class="button">
        <Icon name="search" />
        {t('fleet.find')}
      </button>
      {isSearch(asked) && (
        <button type="button" class="button" onClick={() => ask({ patient: '', procedure: '' })}>
          {t('fleet.clear')}
        </button>
      )}
      <small class="muted fleet-search-what">{t('fleet.searchWhat')}</small>
    </form>
  );
}

/** Absence proves nothing: how many cases could not be found is said beside what was. */
function Looked({ at }: { at: LookedAt }) {
  return (
    <p class="muted" role="status">
      {t('fleet.lookedAt', { n: at.looked_at, without: at.without_note })}
      {at.not_by_this_key > 0 && ` ${t('fleet.otherKey', { n: at.not_by_this_key })}`}
    </p>
  );
}

/** `first`: what is asked for when the list opens, as from an appliance's row. */
export function FleetCasesView({ first }: { first?: string | undefined }) {
  const asked = useSignal<FleetQuestion>({ ...kAnything, appliance: first ?? '' });
  const appliances = useSignal<readonly FleetAppliance[]>([]);
  const cases = useMemo(() => new FoundCases((question, after) => fleet.list(question, kPage, after)), []);

  useEffect(() => {
    document.title = `${t('nav.cases')} · Kiroku`;
  });
  useEffect(() => {
    void attempt(async () => {
      appliances.value = await fleet.appliances();
    });
  }, [returns.value]);
  const question = asked.value;
  const find = async () => {
    if ((await cases.find(question)) && question !== kAnything) announce(t('cases.found', { n: cases.list.peek()?.length ?? 0 }));
  };
  useEffect(() => {
    void find();
  }, [question]);
  const returned = useRef(returns.peek());
  useEffect(() => {
    if (returned.current === returns.value) return;
    returned.current = returns.value;
    void cases.again();
  }, [returns.value]);

  const list = cases.list.value;
  const problem = cases.problem.value;
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>{t('nav.cases')}</h1>
      </div>
      <Questions
        asked={question}
        appliances={appliances.value}
        ask={(more) => {
          asked.value = { ...asked.peek(), ...more };
        }}
      />
      {session.value?.searches && (
        <Search
          asked={question}
          ask={(more) => {
            asked.value = { ...asked.peek(), ...more };
          }}
        />
      )}
      {cases.lookedAt.value && <Looked at={cases.lookedAt.value} />}
      {problem !== undefined && (
        <StateCard icon="alarm" title={t('state.noAnswer')} what={t('state.noAnswerWhat')} why={problem}>
          <button type="button" class="button button-main" onClick={() => void find()}>
            {t('state.again')}
          </button>
        </StateCard>
      )}
      {list?.length === 0 && (
        <StateCard icon="cases" title={t('fleet.none')} what={t(isSearch(question) ? 'fleet.noneFoundWhat' : 'fleet.noneWhat')}>
          <button
            type="button"
            class="button"
            onClick={() => {
              asked.value = { ...kAnything };
            }}
          >
            {t('fleet.askForAll')}
          </button>
        </StateCard>
      )}
      <ul class="case-list" aria-label={t('nav.cases')} aria-busy={list === undefined && problem === undefined}>
        {list?.map((one) => (
          <Row key={one.id} one={one} />
        ))}
      </ul>
      {cases.next.value !== null && (
        <button type="button" class="button" onClick={() => void cases.more()}>
          <Icon name="cases" />
          {t('cases.more')}
        </button>
      )}
    </main>
  );
}
