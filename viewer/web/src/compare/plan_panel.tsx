// What was planned and what was done: the steps as a table, each leading to its moment; whether the plan was sealed before the first picture, and how that
// is known; how the plan lies beside the pictures.
import type { Check, ComparedStep } from '@/api/types';
import { formatTime, kSecond } from '@/base/time';
import { inOrderDone, stepAt } from '@/compare/plan_map';
import { Making, MatchingPanel } from '@/compare/matching_panel';
import { OrganSummary } from '@/compare/organ_summary';
import { filmsOf, type PlanModel, type ShownComparison, viewsOf } from '@/compare/plan_model';
import { nameWithKind } from '@/verification/authority_kind';
import { formatMoment, language, type MessageKey, t, word } from '@/i18n/i18n';
import { pressureText, vitalName } from '@/i18n/vital_names';
import type { Playback } from '@/media/playback';
import { Icon, type IconName } from '@/shell/icon';
import type { CaseModel } from '@/views/case_model';

const kAnswers: Record<Check['answer'], IconName> = { holds: 'check', differs: 'cross', 'could-not-check': 'unproven' };

const seconds = (value: number) => `${value.toFixed(value < 10 ? 1 : 0)} s`;
const figure = (value: number | null) => (value === null ? '–' : String(Math.round(value)));

/** In the page's language where it holds; else the server's own sentence. */
function sentence(group: 'whole' | 'sealed', check: Check): string {
  if (check.answer !== 'holds') {
    // The server's own sentence says more, in English.
    return language.value === 'en' ? check.text : word('proof', `${group}.${check.about}.${check.answer}`);
  }
  return t(`proof.${group}.${check.about}` as MessageKey, {
    entry: check.entry ?? '',
    size: check.size ?? '',
    time: check.time === null ? '' : formatMoment(check.time),
    by: check.kind === null ? (check.by ?? '') : nameWithKind(check.by ?? '', check.kind),
  });
}

function Proof({ group, title, judged, open }: { group: 'whole' | 'sealed'; title: string; judged: ShownComparison['row']['whole']; open?: boolean }) {
  return (
    <details class={`proof proof-${judged.verdict}`} open={open ?? false}>
      <summary>
        <Icon name={kAnswers[judged.verdict]} />
        {title}
      </summary>
      <ul>
        {judged.checks.map((check, at) => (
          <li key={at} class={`proof-${check.answer}`}>
            <Icon name={kAnswers[check.answer]} />
            <span>
              <span class="only-heard">{t(`answer.${check.answer}`)}: </span>
              {sentence(group, check)}
            </span>
          </li>
        ))}
      </ul>
    </details>
  );
}

function PlanViewChoice({ plan, shown }: { plan: PlanModel; shown: ShownComparison }) {
  const view = plan.view.value;
  const films = filmsOf(shown.row);
  const shares = view === 'overlay' || view === 'wipe';
  return (
    <fieldset class="plan-view">
      <legend>{t('plan.view')}</legend>
      {films.length > 1 && (
        <div class="plan-choices">
          {films.map((one) => (
            <label key={one}>
              <input type="radio" name="plan-film" checked={shown.film === one} onChange={() => plan.chooseFilm(one)} />
              <span>{t(`plan.film.${one}`)}</span>
            </label>
          ))}
        </div>
      )}
      <div class="plan-choices">
        {viewsOf(shown.film).map((one) => (
          <label key={one}>
            <input type="radio" name="plan-view" checked={view === one} onChange={() => (plan.view.value = one)} />
            <span>{t(`plan.${one}`)}</span>
          </label>
        ))}
      </div>
      {shares && (
        <label class="plan-share">
          <span>{t(view === 'wipe' ? 'plan.edge' : 'plan.opacity')}</span>
          <input
            type="range"
            min="0"
            max="1"
            step="0.02"
            value={plan.share.value}
            onInput={(event) => (plan.share.value = Number(event.currentTarget.value))}
          />
        </label>
      )}
    </fieldset>
  );
}

function StepFacts({ step, model, playback }: { step: ComparedStep; model: CaseModel; playback: Playback }) {
  const changes = (step.vitals ?? []).filter((one) => one.during !== null);
  const events = step.pressure_events ?? [];
  return (
    <section class="step-facts" aria-label={t('plan.factsOf', { name: step.name })}>
      <h3>{`${step.step}. ${step.name}`}</h3>
      {events.length > 0 && (
        <ul class="step-events">
          {events.map((event, at) => (
            <li key={at}>
              <button type="button" class="link" onClick={() => playback.seek(event.time_ns)}>
                <Icon name="alarm" />
                <span class="mono">{formatTime(event.time_ns - model.whole.start_ns)}</span> {pressureText(event.text)}
              </button>
            </li>
          ))}
        </ul>
      )}
      {changes.length > 0 && (
        <table class="step-vitals">
          <caption class="only-heard">{t('plan.vitals')}</caption>
          <thead>
            <tr>
              <th scope="col">{t('plan.vitals')}</th>
              <th scope="col">{t('plan.before')}</th>
              <th scope="col">{t('plan.during')}</th>
              <th scope="col">{t('plan.after')}</th>
            </tr>
          </thead>
          <tbody>
            {changes.map((one) => (
              <tr key={one.code}>
                <th scope="row">
                  {vitalName(one.code, one.label)} <small class="muted">{one.unit}</small>
                </th>
                <td>{figure(one.before)}</td>
                <td>{figure(one.during)}</td>
                <td>{figure(one.after)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </section>
  );
}

export function PlanPanel({ plan, model, playback, pause }: { plan: PlanModel; model: CaseModel; playback: Playback; pause: (at_ns: number) => void }) {
  const shown = plan.shown.value;
  const now_ns = playback.position_ns.value;
  const problems = plan.unreadable.value;
  if (plan.matching.plan.value) return <MatchingPanel matching={plan.matching} picking={plan.picking} model={model} playback={playback} pause={pause} />;
  const matchByHand = model.info.plan !== null && (
    <button
      type="button"
      class="button"
      disabled={plan.matching.opening.value}
      onClick={() => void plan.matching.open(plan.list.peek().map((one) => one.name))}
    >
      {t(plan.matching.opening.value ? 'match.opening' : 'match.open')}
    </button>
  );
  if (!shown) {
    return (
      <div class="plan-panel">
        <Making matching={plan.matching} />
        {plan.list.value.length === 0 && problems.length === 0 && <p class="muted">{t('match.none')}</p>}
        {matchByHand}
        {problems.map((one) => (
          <p key={one.name} class="pad" role="alert">
            {one.name}: {one.problem}
          </p>
        ))}
      </div>
    );
  }
  const { row, document } = shown;
  const organ = plan.organ.value;
  const current = stepAt(document.steps, now_ns + 1e6);
  const found = inOrderDone(document.steps).length;
  const tools = document.tools.filter((one) => one.pictures > 0);
  return (
    <div class="plan-panel">
      <Making matching={plan.matching} />
      {plan.list.value.length > 1 && (
        <label class="plan-choice">
          <span>{t('plan.which')}</span>
          <select value={row.name} onChange={(event) => void plan.choose(event.currentTarget.value)}>
            {plan.list.value.map((one) => (
              <option key={one.name} value={one.name}>
                {one.name} · {one.made_by}
              </option>
            ))}
          </select>
        </label>
      )}
      <h2>{row.plan}</h2>
      <p class="muted plan-made">{t('plan.made', { by: row.made_by, moment: formatMoment(row.made_at) })}</p>
      <Proof group="sealed" title={t(`sealed.${row.sealed_before.verdict}`)} judged={row.sealed_before} open={row.sealed_before.verdict !== 'holds'} />
      <Proof group="whole" title={t(`whole.${row.whole.verdict}`)} judged={row.whole} open={row.whole.verdict !== 'holds'} />
      {document.one_patient === false && (
        <p class="pad" role="alert">
          {t('plan.anotherPatient')}
        </p>
      )}
      {document.ct?.of_plan === false && (
        <p class="pad" role="alert">
          {t('plan.anotherCt', { name: document.ct.files[0]?.name ?? '' })}
        </p>
      )}
      {organ && <OrganSummary plan={plan} {...organ} steps={document.steps} model={model} playback={playback} />}
      {shown.player && <PlanViewChoice plan={plan} shown={shown} />}
      {document.registration === null && shown.film === 'replay' && shown.player && plan.view.value !== 'beside' && plan.view.value !== 'none' && (
        <p class="muted plan-note">{t('plan.notRegistered')}</p>
      )}
      {document.registration && (
        <p class="muted plan-note">
          {t('pick.kept', { px: document.registration.rms_px.toFixed(2), n: document.registration.error_px.length })}
          {document.registration.lost_ns !== null && `; ${t('pick.lost', { time: formatTime(document.registration.lost_ns - model.whole.start_ns, 3) })}`}
        </p>
      )}
      {document.fluoroscopy && (
        <p class="muted plan-note">
          {t('plan.similarity', { before: document.fluoroscopy.similarity.toFixed(3) })}
          {document.fluoroscopy.alignment &&
            ` ${t('plan.aligned', {
              after: document.fluoroscopy.alignment.similarity.toFixed(3),
              mm: Math.hypot(...document.fluoroscopy.alignment.translation_mm).toFixed(1),
            })}`}
        </p>
      )}
      <table class="steps">
        <caption>
          {t('plan.found', { n: found, all: document.steps.length })}
          {found > 1 && ` · ${t(document.in_planned_order ? 'plan.inOrder' : 'plan.otherOrder')}`}
        </caption>
        <thead>
          <tr>
            <th scope="col">{t('plan.step')}</th>
            <th scope="col">{t('plan.done')}</th>
            <th scope="col">{t('plan.began')}</th>
            <th scope="col">{t('plan.lasted')}</th>
          </tr>
        </thead>
        <tbody>
          {document.steps.map((step) => (
            <tr key={step.step} aria-current={step === current ? 'step' : undefined}>
              <th scope="row">
                {step.done ? (
                  <button type="button" class="link" onClick={() => step.done && playback.seek(step.done.start_ns)}>
                    {step.step}. {step.name}
                  </button>
                ) : (
                  `${step.step}. ${step.name}`
                )}
              </th>
              {step.done ? (
                <>
                  <td class={step.done.order === step.step ? '' : 'moved'}>{step.done.order}.</td>
                  <td class="mono">{formatTime(step.done.start_ns - model.whole.start_ns)}</td>
                  <td>
                    {seconds((step.done.end_ns - step.done.start_ns) / kSecond)}
                    <small class="muted">
                      {t('plan.planned', { time: seconds(step.planned.duration_s) })}
                      {step.done.pauses.length > 0 &&
                        `, ${t('plan.paused', { time: seconds(step.done.pauses.reduce((sum, one) => sum + one.end_ns - one.start_ns, 0) / kSecond) })}`}
                      {step.done.pause_before_ns !== null &&
                        step.done.pause_before_ns > 0 &&
                        `, ${t('plan.pauseBefore', { time: seconds(step.done.pause_before_ns / kSecond) })}`}
                    </small>
                  </td>
                </>
              ) : (
                <td colSpan={3} class="muted">
                  {t('plan.notFound')}
                </td>
              )}
            </tr>
          ))}
        </tbody>
      </table>
      {tools.length > 0 && (
        <ul class="plan-tools">
          {tools.map((one) => (
            <li key={one.tool}>{t('plan.tool', { tool: one.tool, mean: one.mean_px.toFixed(1), most: one.largest_px.toFixed(1) })}</li>
          ))}
        </ul>
      )}
      {matchByHand}
      {current && <StepFacts step={current} model={model} playback={playback} />}
    </div>
  );
}
