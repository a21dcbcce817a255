// What came of an attempt, and how the trainee has learnt so far.
import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { language, t, word } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';
import { announce, attempt } from '@/shell/state';
import { Assessment, assessmentText } from '@/training/assessment_view';
import { objectLabel } from '@/training/object_label';
import { countTicks, place, scaleTo } from '@/training/chart';
import {
  type AttemptKept,
  type Began,
  type Begin,
  type Instrument,
  kMeasures,
  type Measure,
  type Over,
  type Results,
  type Score,
  type Training,
  training as api,
} from '@/training/training_api';

/** null where it was not measured. */
export function valueOf(measure: Measure, score: Score): number | null {
  switch (measure) {
    case 'stress':
      return score.largest_von_mises_pa / 1000;
    case 'high-stress':
      return score.high_von_mises_pa === null ? null : score.high_von_mises_pa / 1000;
    case 'time':
      return score.time_s;
    case 'path':
      return 100 * score.path_m;
    case 'force':
      return score.peak_force_n;
    case 'damage':
      return score.damaged_ml;
  }
}

const short = (value: number | null) => (value === null ? '–' : value >= 100 ? value.toFixed(0) : value >= 10 ? value.toFixed(1) : value.toFixed(2));

interface Point {
  x: number;
  y: number;
  low?: number;
  high?: number;
  hollow?: boolean;
}
/** None where it was not measured. */
const pointsOf = (x: number, y: number | null, hollow: boolean): Point[] => (y === null ? [] : [{ x, y, hollow }]);

interface Series {
  name: string;
  points: Point[];
  /** 0: the trainee; others are groups. */
  style: 0 | 1 | 2;
}

const kWidth = 560;
const kHeight = 240;
const kLeft = 52;
const kRight = 12;
const kTop = 12;
const kBottom = 42;

/** A drawing for the eye; the numbers stand beside it as a table. */
function Chart({ series, across, up, label }: { series: Series[]; across: string; up: string; label: string }) {
  const all = series.flatMap((one) => one.points);
  const last = Math.max(1, ...all.map((one) => one.x));
  const scale = scaleTo(Math.max(0, ...all.map((one) => one.high ?? one.y), ...all.map((one) => one.y)));
  const x = (value: number) => place(value, 0.5, last + 0.5, kLeft, kWidth - kRight);
  const y = (value: number) => place(value, scale.least, scale.most, kHeight - kBottom, kTop);
  return (
    <svg class="train-chart" viewBox={`0 0 ${kWidth} ${kHeight}`} role="img" aria-label={label}>
      {scale.ticks.map((tick) => (
        <g key={tick}>
          <line class="chart-grid" x1={kLeft} x2={kWidth - kRight} y1={y(tick)} y2={y(tick)} />
          <text class="chart-text" x={kLeft - 6} y={y(tick) + 4} text-anchor="end">
            {tick}
          </text>
        </g>
      ))}
      {countTicks(last).map((tick) => (
        <text key={tick} class="chart-text" x={x(tick)} y={kHeight - kBottom + 18} text-anchor="middle">
          {tick}
        </text>
      ))}
      <text class="chart-text" x={(kLeft + kWidth - kRight) / 2} y={kHeight - 6} text-anchor="middle">
        {across}
      </text>
      <text class="chart-text" x={14} y={(kHeight - kBottom + kTop) / 2} text-anchor="middle" transform={`rotate(-90 14 ${(kHeight - kBottom + kTop) / 2})`}>
        {up}
      </text>
      {series.map((one) => (
        <g key={one.name} class={`chart-series chart-series-${one.style}`}>
          <polyline points={one.points.map((point) => `${x(point.x)},${y(point.y)}`).join(' ')} />
          {one.points.map((point) => (
            <g key={point.x}>
              {point.low !== undefined && point.high !== undefined && (
                <line x1={x(point.x)} x2={x(point.x)} y1={y(Math.max(0, point.low))} y2={y(point.high)} />
              )}
              {one.style === 0 ? (
                <circle cx={x(point.x)} cy={y(point.y)} r={4.5} class={point.hollow ? 'chart-hollow' : ''} />
              ) : (
                <rect x={x(point.x) - 3.5} y={y(point.y) - 3.5} width={7} height={7} />
              )}
            </g>
          ))}
        </g>
      ))}
    </svg>
  );
}

function Legend({ series }: { series: Series[] }) {
  return (
    <ul class="chart-legend">
      {series.map((one) => (
        <li key={one.name} class={`chart-legend-${one.style}`}>
          {one.name}
        </li>
      ))}
    </ul>
  );
}

const isResult = (one: AttemptKept) => one.ending === 'done' || one.ending === 'time-over';

function Curves({ results, measure, fingers, instrument }: { results: Results; measure: Measure; fingers: number; instrument: Instrument }) {
  const name = t('result.you', { name: results.trainee });
  // What is done with one finger is not what is done with five, or with an instrument.
  const own = results.attempts.filter((one) => isResult(one) && one.fingers === fingers && one.instrument === instrument);
  const all = results.curves.find((one) => one.measure === measure);
  const curve = all && { own: all.own.filter((one) => one.fingers === fingers), groups: all.groups.filter((one) => one.fingers === fingers) };
  const attempts: Series[] = [{ name, style: 0, points: own.flatMap((one, i) => pointsOf(i + 1, valueOf(measure, one.score), !one.test)) }];
  const tests: Series[] =
    curve && curve.own.length > 0
      ? [
          ...curve.groups.map((one, i): Series => ({
            name: word('group', one.group),
            style: i === 0 ? 1 : 2,
            points: one.points.map((point) => ({
              x: point.session,
              y: point.mean,
              ...(point.low !== undefined && point.high !== undefined ? { low: point.low, high: point.high } : {}),
            })),
          })),
          { name, style: 0, points: curve.own.map((one) => ({ x: one.session, y: one.value })) },
        ]
      : [];
  const label = t(`measure.${measure}`);
  return (
    <div class="train-charts">
      <figure class="card">
        <h2>{t('result.attempts', { name: results.trainee })}</h2>
        {own.length > 0 ? (
          <>
            <Chart series={attempts} across={t('result.attempt')} up={label} label={`${t('result.attempts', { name: results.trainee })}: ${label}`} />
            <ul class="chart-legend">
              <li class="chart-legend-hollow">{t('result.practice')}</li>
              <li class="chart-legend-0">{t('result.testOne')}</li>
            </ul>
            <figcaption class="muted">{t('result.attemptsWhat')}</figcaption>
          </>
        ) : (
          <p class="muted">{t('result.noAttempt')}</p>
        )}
      </figure>
      <figure class="card">
        <h2>{t('result.tests')}</h2>
        {tests.length > 0 ? (
          <>
            <Chart series={tests} across={t('result.session')} up={label} label={`${t('result.tests')}: ${label}`} />
            <Legend series={tests} />
            <figcaption class="muted">{t('result.testsWhat')}</figcaption>
          </>
        ) : (
          <p class="muted">{t('result.noTest')}</p>
        )}
      </figure>
    </div>
  );
}

function AttemptTable({ attempts }: { attempts: AttemptKept[] }) {
  return (
    <details class="card train-numbers">
      <summary>{t('result.numbers')}</summary>
      <div class="table-scroll" tabIndex={0} role="region" aria-label={t('result.numbers')}>
        <table class="table">
          <thead>
            <tr>
              <th scope="col">{t('result.session')}</th>
              <th scope="col">{t('result.kind')}</th>
              <th scope="col" class="number">
                {t('train.fingers')}
              </th>
              {attempts.some((one) => one.instrument !== '') && <th scope="col">{t('train.instrument')}</th>}
              <th scope="col">{t('result.ending')}</th>
              {kMeasures.map((measure) => (
                <th scope="col" class="number" key={measure}>
                  {t(`measure.${measure}`)}
                </th>
              ))}
              {attempts.some((one) => assessmentText(one) !== '') && <th scope="col">{t('assess.title')}</th>}
              {attempts.some((one) => one.case !== '') && <th scope="col">{t('seal.case')}</th>}
            </tr>
          </thead>
          <tbody>
            {attempts.map((one, i) => (
              <tr key={i}>
                <td>{one.session}</td>
                <td>{one.test ? t('result.testOne') : t('result.practice')}</td>
                <td class="number">{one.fingers}</td>
                {attempts.some((other) => other.instrument !== '') && <td>{word('instrument', one.instrument || 'fingertips')}</td>}
                <td>{t(`ending.${one.ending}`)}</td>
                {kMeasures.map((measure) => (
                  <td class="number" key={measure}>
                    {short(valueOf(measure, one.score))}
                  </td>
                ))}
                {attempts.some((other) => assessmentText(other) !== '') && <td>{assessmentText(one)}</td>}
                {attempts.some((other) => other.case !== '') && (
                  <td>
                    {one.case !== '' && (
                      <a href={api.certificate(one.attempt, language.value)} target="_blank" rel="noopener">
                        {one.case}
                      </a>
                    )}
                  </td>
                )}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}

/** Makes a case of the attempt: signed, time-stamped, verified at once. */
function Seal({ number, sealed }: { number: number; sealed: () => Promise<unknown> }) {
  const busy = useSignal(false);
  const came = useSignal<{ case: string; verdict: string } | undefined>(undefined);
  const seal = async () => {
    busy.value = true;
    await attempt(async () => {
      came.value = await api.seal(number);
      announce(t('seal.done', { case: came.value.case }));
      await sealed();
    });
    busy.value = false;
  };
  if (came.value) {
    return (
      <p class="train-sealed">
        {t('seal.done', { case: came.value.case })} {t('seal.verdict', { verdict: came.value.verdict })}{' '}
        <a href={api.certificate(number, language.value)} target="_blank" rel="noopener">
          {t('seal.certificate')}
        </a>
      </p>
    );
  }
  return (
    <p class="train-sealed">
      <button type="button" class="button" disabled={busy.value} aria-busy={busy.value} onClick={() => void seal()}>
        {busy.value ? t('seal.busy') : t('seal.do')}
      </button>{' '}
      <span class="muted">{t('seal.what')}</span>
    </p>
  );
}

function Came({
  began,
  over,
  kept,
  training,
  changed,
}: {
  began: Began;
  over: Over;
  /** Once it was loaded. */
  kept: AttemptKept | undefined;
  training: Training | undefined;
  changed: () => Promise<unknown>;
}) {
  const done = over.ending === 'done';
  return (
    <section class="card train-came" aria-label={t('result.title')}>
      <p class={done ? 'verdict verdict-intact' : 'verdict verdict-incomplete'}>
        <Icon name={done ? 'check' : 'clock'} />
        {t(`ending.${over.ending}`)}
      </p>
      <p class="muted">{t(began.test ? 'attempt.test' : 'attempt.practice', { session: began.session })}</p>
      {kept && training && <Assessment key={over.attempt} kept={kept} training={training} saved={changed} />}
      {over.can_be_sealed && <Seal key={over.attempt} number={over.attempt} sealed={changed} />}
      <table class="table">
        <thead>
          <tr>
            <th scope="col">{t('result.measure')}</th>
            <th scope="col" class="number">
              {t('result.value')}
            </th>
          </tr>
        </thead>
        <tbody>
          {kMeasures.map((measure) => (
            <tr key={measure}>
              <th scope="row">{t(`measure.${measure}`)}</th>
              <td class="number mono">{short(valueOf(measure, over.score))}</td>
            </tr>
          ))}
          <tr>
            <th scope="row">{t('result.wrist')}</th>
            <td class="number mono">{short(over.score.peak_wrist_force_n)} N</td>
          </tr>
          <tr>
            <th scope="row">{t('result.share')}</th>
            <td class="number mono">{Math.round(100 * over.score.best_visible_share)} %</td>
          </tr>
        </tbody>
      </table>
      <p class="muted">
        {t('result.machine', {
          forces: over.force_rate_hz.toFixed(0),
          pictures: over.picture_rate_hz.toFixed(0),
          force: over.input_to_force.median_ms.toFixed(1),
          picture: over.input_to_picture.median_ms.toFixed(0),
        })}
      </p>
    </section>
  );
}

export function ResultView({
  begin,
  came,
  training,
  again,
  other,
}: {
  begin: Begin;
  came?: { began: Began; over: Over };
  training: Training | undefined;
  again: (test: boolean) => void;
  other: () => void;
}) {
  const results = useSignal<Results | undefined>(undefined);
  const measure = useSignal<Measure>('stress');
  const load = () =>
    attempt(async () => {
      results.value = await api.results(begin.trainee, begin.object);
    });
  useEffect(() => {
    void load();
    document.getElementById('main')?.focus();
  }, [begin]);
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <div class="view-head">
        <h1>
          {t('result.title')} · {begin.trainee}
        </h1>
        <div class="attempt-do">
          <button type="button" class="button button-main" onClick={() => again(false)}>
            {came ? t('result.again') : t('train.practise')}
          </button>
          <button type="button" class="button" onClick={() => again(true)}>
            {t('train.test')}
          </button>
          <button type="button" class="button button-quiet" onClick={other}>
            {t('result.other')}
          </button>
        </div>
      </div>
      <p class="muted">
        {objectLabel(begin.object)} · {t('result.fingers', { n: begin.fingers })}
        {begin.instrument && ` · ${word('instrument', begin.instrument)}`}
      </p>
      {came && <Came {...came} kept={results.value?.attempts.find((one) => one.attempt === came.over.attempt)} training={training} changed={load} />}
      <label class="field train-measure">
        <span>{t('result.measure')}</span>
        <select value={measure.value} onChange={(event) => (measure.value = event.currentTarget.value as Measure)}>
          {kMeasures.map((one) => (
            <option key={one} value={one}>
              {t(`measure.${one}`)}
            </option>
          ))}
        </select>
      </label>
      {results.value && <Curves results={results.value} measure={measure.value} fingers={begin.fingers} instrument={begin.instrument ?? ''} />}
      {results.value && <AttemptTable attempts={results.value.attempts} />}
    </main>
  );
}
