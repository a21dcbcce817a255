// The sliders of one moved group of the lung, and of the breath's length.
import type { ComponentChildren } from 'preact';
import { useRef } from 'preact/hooks';
import type { LungController } from '@/breathing/lung_controller';
import {
  anglesOf,
  directionOf,
  type Group,
  kFirstDirection,
  kNumbers,
  type Motion,
  type NumberOfGroup,
  type Range,
  rangeOf,
  rangeOfCycle,
  withDirection,
  withNumber,
} from '@/breathing/motion';
import { t } from '@/i18n/i18n';

export const kDigits: Record<NumberOfGroup, number> = { amplitude_mm: 1, phase_s: 2, baseline_mm: 1, drift_mm_per_min: 1 };
export const kUnits: Record<NumberOfGroup, string> = { amplitude_mm: 'mm', phase_s: 's', baseline_mm: 'mm', drift_mm_per_min: 'mm/min' };

function Slider({
  label,
  named,
  value,
  shown,
  range,
  move,
  settle,
}: {
  label: string;
  /** Of all sliders of that label, which this is. */
  named: string;
  value: number;
  shown: string;
  range: Range;
  move: (value: number) => void;
  settle: () => void;
}) {
  return (
    <label class="lung-slider">
      <span>{label}</span>
      <input
        type="range"
        min={range.least}
        max={range.most}
        step={range.step}
        value={value}
        aria-label={`${named}: ${label}`}
        aria-valuetext={shown}
        onInput={(event) => move(Number(event.currentTarget.value))}
        onChange={settle}
      />
      <output class="mono">{shown}</output>
    </label>
  );
}

export function GroupSliders({ lung, motion, group, nodes }: { lung: LungController; motion: Motion; group: Group; nodes: number }) {
  const name = t(`breathing.${group}`);
  const own = motion[group];
  /** At the poles any will do: the person's last one stays. */
  const about = useRef(0);
  const angles = own.direction ? anglesOf(own.direction, about.current) : undefined;
  const turn = (change: Partial<{ up_deg: number; about_deg: number }>) => {
    if (!angles) return;
    const next = { ...angles, ...change };
    about.current = next.about_deg;
    lung.change(withDirection(motion, group, directionOf(next)), `${group}.direction`);
  };
  const settle = () => lung.settle();
  return (
    <fieldset class="card lung-group">
      <legend>
        {name} <small class="muted">{t('breathing.nodes', { n: nodes })}</small>
      </legend>
      {kNumbers.map((number) => (
        <Slider
          key={number}
          label={t(`breathing.${number}`)}
          named={name}
          value={own[number]}
          shown={`${own[number].toFixed(kDigits[number])} ${kUnits[number]}`}
          range={rangeOf(number, own[number])}
          move={(value) => lung.change(withNumber(motion, group, number, value), `${group}.${number}`)}
          settle={settle}
        />
      ))}
      <label class="lung-slider lung-direction">
        <span>{t('breathing.direction')}</span>
        <select
          aria-label={`${name}: ${t('breathing.direction')}`}
          value={own.direction ? 'one' : 'normal'}
          onChange={(event) => {
            const one = event.currentTarget.value === 'one' ? kFirstDirection[group] : null;
            lung.change(withDirection(motion, group, one), `${group}.way`);
            lung.settle();
          }}
        >
          <option value="normal">{t('breathing.direction.normal')}</option>
          <option value="one">{t('breathing.direction.one')}</option>
        </select>
      </label>
      {angles && (
        <>
          <Slider
            label={t('breathing.up')}
            named={name}
            value={angles.up_deg}
            shown={`${angles.up_deg.toFixed(0)}°`}
            range={{ least: -90, most: 90, step: 1 }}
            move={(up_deg) => turn({ up_deg })}
            settle={settle}
          />
          <Slider
            label={t('breathing.about')}
            named={name}
            value={angles.about_deg}
            shown={`${angles.about_deg.toFixed(0)}°`}
            range={{ least: -180, most: 180, step: 1 }}
            move={(about_deg) => turn({ about_deg })}
            settle={settle}
          />
        </>
      )}
    </fieldset>
  );
}

export function WaveformCard({ lung, motion, children }: { lung: LungController; motion: Motion; children?: ComponentChildren }) {
  const { cycle_s } = motion;
  return (
    <fieldset class="card lung-group">
      <legend>{t('breathing.waveform')}</legend>
      {cycle_s === null ? (
        <p class="muted">{t('breathing.measured')}</p>
      ) : (
        <Slider
          label={t('breathing.cycle')}
          named={t('breathing.waveform')}
          value={cycle_s}
          shown={`${cycle_s.toFixed(2)} s`}
          range={rangeOfCycle(cycle_s)}
          move={(next_s) => lung.change({ ...motion, cycle_s: next_s }, 'cycle')}
          settle={() => lung.settle()}
        />
      )}
      {children}
    </fieldset>
  );
}
