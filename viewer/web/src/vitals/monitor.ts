// How vital signs stand on the page: which codes make one number, in what order and colour, as on the monitors of an operating room. Pure.
import type { VitalSeries } from '@/api/types';

export interface Group {
  key: string;
  label: string;
  /** The number itself, or what stands before and after the stroke ("120/80"). */
  codes: readonly string[];
  mean?: string;
  wave?: string;
  color: string;
  /** Measured now and then, so that an old value still counts. */
  spot?: boolean;
}

const kGroups: readonly Group[] = [
  { key: 'hr', label: 'HR', codes: ['MDC_ECG_HEART_RATE'], wave: 'MDC_ECG_ELEC_POTL_II', color: 'green' },
  { key: 'spo2', label: 'SpO₂', codes: ['MDC_PULS_OXIM_SAT_O2'], wave: 'MDC_PULS_OXIM_PLETH', color: 'cyan' },
  {
    key: 'abp',
    label: 'ABP',
    codes: ['MDC_PRESS_BLD_ART_ABP_SYS', 'MDC_PRESS_BLD_ART_ABP_DIA'],
    mean: 'MDC_PRESS_BLD_ART_ABP_MEAN',
    wave: 'MDC_PRESS_BLD_ART_ABP',
    color: 'red',
  },
  {
    key: 'nibp',
    label: 'NIBP',
    codes: ['MDC_PRESS_BLD_NONINV_SYS', 'MDC_PRESS_BLD_NONINV_DIA'],
    mean: 'MDC_PRESS_BLD_NONINV_MEAN',
    color: 'magenta',
    spot: true,
  },
  { key: 'rr', label: 'RR', codes: ['MDC_RESP_RATE'], color: 'yellow' },
  { key: 'co2', label: 'etCO₂', codes: ['MDC_AWAY_CO2_ET'], wave: 'MDC_AWAY_CO2', color: 'yellow' },
  { key: 'temp', label: 'T', codes: ['MDC_TEMP_BODY'], color: 'orange', spot: true },
  { key: 'pr', label: 'PR', codes: ['MDC_PULS_OXIM_PULS_RATE'], color: 'cyan' },
];

/** The groups that `series` can fill, in the monitors' order; what belongs to none stands behind them by itself. */
export function groupsOf(series: readonly Pick<VitalSeries, 'code' | 'kind' | 'label'>[]): Group[] {
  const there = new Set(series.map((one) => one.code));
  const known = kGroups.filter((group) => group.codes.some((code) => there.has(code)));
  const used = new Set(kGroups.flatMap((group) => [...group.codes, group.mean, group.wave]));
  const others = series
    .filter((one) => one.kind === 'numeric' && !used.has(one.code))
    .map((one): Group => ({ key: one.code, label: one.label, codes: [one.code], color: 'white' }));
  return [...known, ...others];
}

type Told = Pick<VitalSeries, 'stream' | 'source'>;

/** A bedside: what one source says on one stream. Several patients' monitors may share a stream, and each says for itself whose its values are. */
export interface Bedside<S extends Told> extends Told {
  key: string;
  series: S[];
}

export const keyOfBedside = ({ stream, source }: Told): string => `${stream}\n${source}`;
export const keyOfSeries = (one: Told & Pick<VitalSeries, 'code'>): string => `${one.code}\n${keyOfBedside(one)}`;

/** No number is ever put together of two of them. In the order in which they first stand in `series`. */
export function bedsidesOf<S extends Told>(series: readonly S[]): Bedside<S>[] {
  const found = new Map<string, Bedside<S>>();
  for (const one of series) {
    const key = keyOfBedside(one);
    const known = found.get(key);
    if (known) known.series.push(one);
    else found.set(key, { key, stream: one.stream, source: one.source, series: [one] });
  }
  return [...found.values()];
}

/** How one of `all` is told from the others; '' where there is no other. */
export function nameOfBedside(one: Told, all: readonly Told[], nameOfStream: (stream: string) => string): string {
  if (new Set(all.map(keyOfBedside)).size < 2) return '';
  if (one.source === '') return nameOfStream(one.stream);
  return all.some(({ stream }) => stream !== one.stream) ? `${nameOfStream(one.stream)} · ${one.source}` : one.source;
}

/** What the trends show, and in which colour. */
const kTrends: readonly { code: string; label: string; color: string }[] = [
  { code: 'MDC_ECG_HEART_RATE', label: 'HR', color: 'green' },
  { code: 'MDC_PULS_OXIM_SAT_O2', label: 'SpO₂', color: 'cyan' },
  { code: 'MDC_PRESS_BLD_ART_ABP_SYS', label: 'ABP', color: 'red' },
  { code: 'MDC_PRESS_BLD_ART_ABP_DIA', label: '', color: 'red' },
  { code: 'MDC_AWAY_CO2_ET', label: 'etCO₂', color: 'yellow' },
];

/** Those of the one bedside that has most of them, the first of several: lines of two patients in the same colours would be taken for one's. */
export function trendsOf<S extends Told & Pick<VitalSeries, 'code'>>(bedsides: readonly Bedside<S>[]) {
  const each = bedsides.map((bedside) => ({
    bedside,
    trends: kTrends.flatMap((trend) => {
      const one = bedside.series.find(({ code }) => code === trend.code);
      return one ? [{ ...trend, key: keyOfSeries(one) }] : [];
    }),
  }));
  const most = Math.max(0, ...each.map(({ trends }) => trends.length));
  return each.find(({ trends }) => most > 0 && trends.length === most) ?? { bedside: undefined, trends: [] };
}

/** A value as monitors print it: no decimals from 20 up, one below where there is one. */
export function formatValue(value: number): string {
  return Math.abs(value) >= 20 && Math.abs(value - Math.round(value)) < 0.05 ? String(Math.round(value)) : value.toFixed(Number.isInteger(value) ? 0 : 1);
}

/** UCUM as it is written at the bedside. */
export function formatUnit(unit: string): string {
  const written: Record<string, string> = { '/min': '/min', '{beat}/min': '/min', '{beats}/min': '/min', 'mm[Hg]': 'mmHg', Cel: '°C', '1': '', '%': '%' };
  return written[unit] ?? unit;
}
