// What was picked, as lists: points with how well they register the camera, clicks on each tool, and the fluoroscopy that is compared with.
import { useSignal } from '@preact/signals';
import { formatTime } from '@/base/time';
import { fluoroscopies, type Polarity, readGeometry } from '@/compare/fluoroscopy';
import type { MatchingModel } from '@/compare/matching_model';
import { kWorks, type PickingModel } from '@/compare/picking_model';
import { completePairs, leastPairs } from '@/compare/picks';
import { t, word } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { Icon } from '@/shell/icon';
import type { CaseModel } from '@/views/case_model';

interface Props {
  matching: MatchingModel;
  picking: PickingModel;
  model: CaseModel;
  playback: Playback;
}

export function WorkChoice({ picking, model }: Pick<Props, 'picking' | 'model'>) {
  const works = kWorks.filter((one) => one !== 'xray' || fluoroscopies(model).length > 0);
  return (
    <fieldset class="plan-view">
      <legend>{t('pick.work')}</legend>
      <div class="plan-choices">
        {works.map((one) => (
          <label key={one}>
            <input type="radio" name="pick-work" checked={picking.work.value === one} onChange={() => (picking.work.value = one)} />
            <span>{t(`pick.work.${one}`)}</span>
          </label>
        ))}
      </div>
    </fieldset>
  );
}

function Judgement({ matching, picking }: Pick<Props, 'matching' | 'picking'>) {
  const picks = matching.picks.value;
  const complete = completePairs(picks).length;
  const least = leastPairs(picks);
  const judged = picking.judged.value;
  if (complete < least) return <p class="pick-verdict">{t('pick.tooFew', { n: complete, least })}</p>;
  if (!judged) return <p class="pick-verdict">{t('pick.enough', { n: complete })}</p>;
  if ('problem' in judged) {
    return (
      <p class="pick-verdict pick-verdict-bad">
        <Icon name="cross" /> {judged.problem}
      </p>
    );
  }
  return (
    <p class="pick-verdict pick-verdict-good">
      <Icon name="check" /> {t('pick.registered', { px: judged.rms_px.toFixed(2), n: complete, field: judged.field_deg.toFixed(1) })}
    </p>
  );
}

export function PointsPart({ matching, picking, model, playback }: Props) {
  const picks = matching.picks.value;
  const judged = picking.judged.value;
  let complete = 0;
  return (
    <>
      <p class="muted plan-made">{t('pick.pointsWhat')}</p>
      {picks.at && (
        <p class="plan-made">
          {t('pick.pinned')}{' '}
          <button type="button" class="link mono" onClick={() => picks.at && playback.seek(picks.at.time_ns)}>
            {formatTime(picks.at.time_ns - model.whole.start_ns, 3)}
          </button>
        </p>
      )}
      {picking.isOfAnotherMoment.value && <p class="pick-verdict pick-verdict-bad">{t('pick.otherMoment')}</p>}
      <div role="status">
        <Judgement matching={matching} picking={picking} />
      </div>
      <label class="plan-choice">
        <span>{t('pick.field')}</span>
        <input
          type="number"
          min={1}
          max={170}
          step="any"
          value={picks.field_deg ?? ''}
          onChange={(event) => {
            const field = event.currentTarget.value === '' ? null : Number(event.currentTarget.value);
            if (field === null || (field >= 1 && field <= 170)) picking.sayField(field);
          }}
        />
      </label>
      <ol class="pick-list">
        {picks.pairs.map(({ organ, pixel }, pair) => {
          const error = organ && pixel && judged && !('problem' in judged) ? judged.error_px[complete] : undefined;
          if (organ && pixel) ++complete;
          return (
            <li key={pair} class={picking.chosenPair.value === pair ? 'matching-chosen' : ''}>
              <button type="button" class="link" aria-pressed={picking.chosenPair.value === pair} onClick={() => (picking.chosenPair.value = pair)}>
                {t('pick.point', { n: pair + 1 })}
              </button>
              <span class={organ && pixel ? 'mono' : 'muted'}>
                {!pixel ? t('pick.pixelMissing') : !organ ? t('pick.organMissing') : error === undefined ? '' : t('pick.error', { px: error.toFixed(2) })}
              </span>
              <button
                type="button"
                class="button button-quiet button-square"
                aria-label={t('pick.remove', { n: pair + 1 })}
                onClick={() => picking.removePair(pair)}
              >
                <Icon name="cross" />
              </button>
            </li>
          );
        })}
      </ol>
    </>
  );
}

export function ToolsPart({ matching, picking, model, playback }: Props) {
  const picks = matching.picks.value;
  const tools = matching.plan.value?.tools ?? [];
  const tool = picking.tool.value;
  const clicks = picks.clicks.get(tool) ?? [];
  if (tools.length === 0) return <p class="muted plan-made">{t('pick.noTools')}</p>;
  return (
    <>
      <p class="muted plan-made">{t('pick.toolsWhat')}</p>
      <label class="plan-choice">
        <span>{t('pick.tool')}</span>
        <select value={tool} onChange={(event) => (picking.tool.value = event.currentTarget.value)}>
          {tools.map((one) => (
            <option key={one} value={one}>
              {one}
            </option>
          ))}
        </select>
      </label>
      <p role="status" class="plan-made">
        {t('pick.clicks', { n: clicks.length })}
      </p>
      <ol class="pick-list">
        {clicks.map(({ at_ns, pixel }) => {
          const time = formatTime(at_ns - model.whole.start_ns, 3);
          return (
            <li key={at_ns} class={picking.frame.value?.time_ns === at_ns ? 'matching-chosen' : ''}>
              <button type="button" class="link mono" onClick={() => playback.seek(at_ns)}>
                {time}
              </button>
              <span class="mono">{pixel.map((one) => one.toFixed(1)).join(', ')}</span>
              <button
                type="button"
                class="button button-quiet button-square"
                aria-label={t('pick.removeClick', { time })}
                onClick={() => picking.removeClick(tool, at_ns)}
              >
                <Icon name="cross" />
              </button>
            </li>
          );
        })}
      </ol>
    </>
  );
}

export function XrayPart({ matching, model, playback }: Omit<Props, 'picking'>) {
  const said = matching.fluoroscopy.value;
  const problem = useSignal('');
  const streams = fluoroscopies(model);
  const stream = said?.stream ?? streams[0]?.name ?? '';
  const read = async (file: File) => {
    const geometry = readGeometry(await file.text());
    problem.value = geometry ? '' : t('xray.noGeometry', { file: file.name });
    if (geometry)
      matching.fluoroscopy.value = { stream, geometry, file: file.name, alignAt_ns: said?.alignAt_ns ?? null, polarity: said?.polarity ?? 'bone-black' };
  };
  return (
    <>
      <p class="muted plan-made">{t('xray.what')}</p>
      <label class="plan-choice">
        <span>{t('xray.geometry')}</span>
        <input
          type="file"
          accept=".json,application/json"
          onChange={(event) => {
            const file = event.currentTarget.files?.[0];
            if (file) void read(file);
          }}
        />
      </label>
      {problem.value && <p role="alert">{problem.value}</p>}
      {said && (
        <>
          <p class="plan-made">{t('xray.compared', { stream: word('stream', said.stream), file: said.file })}</p>
          {streams.length > 1 && (
            <label class="plan-choice">
              <span>{t('xray.stream')}</span>
              <select value={said.stream} onChange={(event) => (matching.fluoroscopy.value = { ...said, stream: event.currentTarget.value })}>
                {streams.map((one) => (
                  <option key={one.name} value={one.name}>
                    {word('stream', one.name)}
                  </option>
                ))}
              </select>
            </label>
          )}
          <label class="plan-choice">
            <span>{t('xray.polarity')}</span>
            <select value={said.polarity} onChange={(event) => (matching.fluoroscopy.value = { ...said, polarity: event.currentTarget.value as Polarity })}>
              <option value="bone-black">{t('xray.boneBlack')}</option>
              <option value="bone-white">{t('xray.boneWhite')}</option>
            </select>
          </label>
          <div class="matching-tools">
            <button
              type="button"
              class="button"
              onClick={() => (matching.fluoroscopy.value = { ...said, alignAt_ns: Math.round(playback.position_ns.peek()) })}
            >
              {t('xray.alignHere')}
            </button>
            {said.alignAt_ns !== null && (
              <>
                <span class="mono">{formatTime(said.alignAt_ns - model.whole.start_ns, 3)}</span>
                <button type="button" class="button" onClick={() => (matching.fluoroscopy.value = { ...said, alignAt_ns: null })}>
                  {t('xray.alignNot')}
                </button>
              </>
            )}
            <button type="button" class="button" onClick={() => (matching.fluoroscopy.value = undefined)}>
              {t('xray.leaveOut')}
            </button>
          </div>
        </>
      )}
    </>
  );
}
