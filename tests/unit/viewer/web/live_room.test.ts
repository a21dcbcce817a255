import { describe, expect, it } from 'vitest';
import type { LiveSeries, RoomStatus, StreamStatus } from '@/api/types';
import { AlertBell, kAgain_ms, troublesOf } from '@/rooms/trouble';
import { liveBedsidesOf, LiveWaves } from '@/vitals/live_readings';
import { bedsidesOf, keyOfSeries, nameOfBedside, trendsOf } from '@/vitals/monitor';

const stream = (more: Partial<StreamStatus>): StreamStatus => ({
  name: 'endoscope',
  kind: 'video',
  live: true,
  frames: 9,
  dropped: 0,
  refused: 0,
  elsewhere: 0,
  segments: 1,
  bytes: 9,
  age_ms: 40,
  durable_age_ms: 900,
  input: '',
  unboxed: false,
  stuck: 0,
  profile: 'mpeg2',
  profile_to_come: '',
  given_up: 0,
  ...more,
});
const room = (state: string, ...streams: StreamStatus[]): RoomStatus => ({
  room: 'or-1',
  state,
  case: 'c',
  reason: '',
  carries_on: '',
  resumed: 0,
  not_resumed: false,
  ended_by_error: false,
  tries_again: false,
  subject: 'none',
  profile_rule: '',
  procedure: [],
  elapsed_ns: 0,
  now_ns: 0,
  streams,
  tokens: 0,
  missed: 0,
  authorities: [],
  bytes_per_second: 0,
  cases: 1,
  problem: '',
  footswitches: [],
});

describe('Trouble of a room', () => {
  it('is silence and loss while it records, and nothing else', () => {
    expect(troublesOf(room('recording', stream({})))).toEqual([]);
    expect(troublesOf(room('recording', stream({ age_ms: 3000 }), stream({ name: 'room', dropped: 2 })))).toEqual([
      { kind: 'silent', room: 'or-1', stream: 'endoscope', for_ms: 3000 },
      { kind: 'lost', room: 'or-1', stream: 'room', pictures: 2 },
    ]);
    expect(troublesOf(room('recording', stream({ kind: 'vitals', live: false, age_ms: 3000 }))).map((one) => one.kind)).toEqual(['silent']);
    expect(troublesOf(room('recording', stream({ live: false, age_ms: 2999 }))), 'is being opened').toEqual([]);
    expect(
      troublesOf(room('standby', stream({ live: false, age_ms: 3000 }))).map((one) => one.kind),
      'ahead of a case',
    ).toEqual(['silent']);
    expect(troublesOf(room('closing', stream({ live: false, dropped: 3 })))).toEqual([]);
  });
  it('leaves a monitor more time than a camera', () => {
    expect(troublesOf(room('recording', stream({ kind: 'vitals', age_ms: 9999 })))).toEqual([]);
    expect(troublesOf(room('recording', stream({ kind: 'vitals', age_ms: 10_000 })))).toHaveLength(1);
  });
});

describe('The bell', () => {
  const silent = { kind: 'silent', room: 'or-1', stream: 'endoscope', for_ms: 4000 } as const;
  const lost = (pictures: number) => ({ kind: 'lost', room: 'or-1', stream: 'room', pictures }) as const;
  it('rings for what is new, and again while silence lasts', () => {
    const bell = new AlertBell();
    expect(bell.hear([], 0)).toBe(false);
    expect(bell.hear([silent], 1000)).toBe(true);
    expect(bell.hear([silent], 2000)).toBe(false);
    expect(bell.hear([silent], 1000 + kAgain_ms)).toBe(true);
    expect(bell.hear([], 13_000)).toBe(false);
    expect(bell.hear([silent], 14_000), 'silent anew').toBe(true);
  });
  it('rings for each loss once', () => {
    const bell = new AlertBell();
    expect(bell.hear([lost(1)], 0)).toBe(true);
    expect(bell.hear([lost(1)], kAgain_ms + 1)).toBe(false);
    expect(bell.hear([lost(2)], kAgain_ms + 2)).toBe(true);
  });
});

describe('Live vital signs', () => {
  const series = (code: string, time_ns: number, value: number | null, more: Partial<LiveSeries> = {}): LiveSeries => ({
    code,
    label: code,
    unit: '/min',
    kind: 'numeric',
    stream: 'vitals',
    source: '',
    time_ns,
    value,
    questionable: false,
    ...more,
  });
  const readingsOf = (all: LiveSeries[], now_ns: number) => liveBedsidesOf(all, now_ns).flatMap((one) => one.readings);
  it('are the newest numbers, in the monitors’ order', () => {
    const readings = readingsOf(
      [
        series('MDC_PRESS_BLD_ART_ABP_DIA', 9e9, 80),
        series('MDC_PRESS_BLD_ART_ABP_SYS', 9e9, 120),
        series('MDC_PRESS_BLD_ART_ABP_MEAN', 9e9, 93),
        series('MDC_ECG_HEART_RATE', 9e9, 60),
      ],
      10e9,
    );
    expect(readings.map(({ text, mean, silent_s }) => [text, mean, silent_s])).toEqual([
      ['60', '', undefined],
      ['120/80', '(93)', undefined],
    ]);
  });
  it('say which may be of an earlier patient', () => {
    const doubts = readingsOf([series('MDC_ECG_HEART_RATE', 9e9, 18, { questionable: true }), series('MDC_PULS_OXIM_SAT_O2', 9e9, 97)], 10e9).map(
      (one) => one.isQuestionable,
    );
    expect(doubts).toEqual([true, false]);
  });
  it('of several beds stay apart, whoever spoke last', () => {
    const of = (source: string, rate: number, high: number | null, low: number | null, time_ns: number, stream = 'vitals') => [
      series('MDC_ECG_HEART_RATE', time_ns, rate, { source, stream }),
      series('MDC_PRESS_BLD_ART_ABP_SYS', time_ns, high, { source, stream }),
      series('MDC_PRESS_BLD_ART_ABP_DIA', time_ns, low, { source, stream }),
    ];
    const textsOf = (all: LiveSeries[]) => liveBedsidesOf(all, 10e9).map((one) => [one.stream, one.source, ...one.readings.map(({ text }) => text)]);
    const [first, second] = [of('bed-1', 60, 120, 80, 9e9), of('bed-2', 90, 100, 50, 9.5e9)];
    const interleaved = first.flatMap((one, at) => [second[at] as LiveSeries, one]);
    expect(textsOf(interleaved)).toEqual([
      ['vitals', 'bed-2', '90', '100/50'],
      ['vitals', 'bed-1', '60', '120/80'],
    ]);
    // What one bed lacks is not taken from the other.
    expect(textsOf([...of('bed-1', 60, 120, null, 9e9), ...of('bed-2', 90, null, 50, 9e9)])).toEqual([
      ['vitals', 'bed-1', '60', '120/–'],
      ['vitals', 'bed-2', '90', '–/50'],
    ]);
    // Nor does one that speaks hide that the other has fallen silent.
    const [silent] = liveBedsidesOf([...of('bed-1', 60, 120, 80, 1e9), ...of('bed-2', 90, 100, 50, 9e9)], 13e9);
    expect(silent?.readings.map(({ text, silent_s }) => [text, silent_s])).toEqual([
      ['– –', 12],
      ['– –', 12],
    ]);
    expect(textsOf([...of('', 60, 120, 80, 9e9, 'a'), ...of('', 90, 100, 50, 9e9, 'b')])).toEqual([
      ['a', '', '60', '120/80'],
      ['b', '', '90', '100/50'],
    ]);
  });
  it('of several beds are named, and of one alone are not', () => {
    const name = (stream: string, source: string, ...others: [string, string][]) =>
      nameOfBedside(
        { stream, source },
        [[stream, source] as [string, string], ...others].map(([stream, source]) => ({ stream, source })),
        (stream) => stream,
      );
    expect(name('vitals', 'bed-1')).toBe('');
    expect(name('vitals', 'bed-1', ['vitals', 'bed-1'])).toBe('');
    expect(name('vitals', 'bed-1', ['vitals', 'bed-2'])).toBe('bed-1');
    expect(name('vitals', '', ['vitals', 'bed-2'])).toBe('vitals');
    expect(name('a', 'bed-1', ['b', 'bed-1'])).toBe('a · bed-1');
  });
  it('are drawn as lines of one bed alone, of which there are most', () => {
    const of = (source: string, ...codes: string[]) => codes.map((code) => series(code, 0, 1, { source }));
    const all = [...of('pump', 'MDC_PUMP'), ...of('bed-1', 'MDC_ECG_HEART_RATE'), ...of('bed-2', 'MDC_ECG_HEART_RATE', 'MDC_PULS_OXIM_SAT_O2')];
    const { bedside, trends } = trendsOf(bedsidesOf(all));
    expect(bedside?.source).toBe('bed-2');
    expect(trends.map(({ key }) => key)).toEqual(all.slice(2).map(keyOfSeries));
    expect(trendsOf(bedsidesOf(all.slice(0, 2))).bedside?.source).toBe('bed-1');
    expect(trendsOf(bedsidesOf(all.slice(0, 1)))).toEqual({ bedside: undefined, trends: [] });
  });
  it('do not show a number that fell silent, and say for how long', () => {
    expect(readingsOf([series('MDC_ECG_HEART_RATE', 1e9, 60)], 13e9)[0]).toMatchObject({ text: '– –', silent_s: 12 });
    // A blood pressure of the cuff is measured now and then.
    expect(readingsOf([series('MDC_PRESS_BLD_NONINV_SYS', 1e9, 120)], 301e9)[0]).toMatchObject({ text: '120/–', silent_s: undefined });
  });
  it('have no number where the device has none', () => {
    expect(readingsOf([series('MDC_ECG_HEART_RATE', 9e9, null)], 10e9)[0]).toMatchObject({ text: '– –', silent_s: undefined });
  });
  it('join blocks of a wave, whatever comes twice, and begin anew with the next case', () => {
    const waves = new LiveWaves();
    const w = keyOfSeries(series('W', 0, null));
    const block = (end_ns: number, values: (number | null)[]) => [
      { ...series('W', end_ns, null), kind: 'wave' as const, blocks: [{ end_ns, rate_hz: 2, values }] },
    ];
    waves.add(block(1e9, [1, 2]));
    waves.add(block(1e9, [1, 2]));
    waves.add(block(2e9, [3, null]));
    expect(waves.of(w, 0, 9e9).map(({ time_ns, value }) => [time_ns / 1e9, value])).toEqual([
      [0, 1],
      [0.5, 2],
      [1, 3],
      [1.5, null],
    ]);
    expect(waves.last_ns).toBe(2e9);
    waves.add(block(60e9, [5, 6]));
    expect(waves.of(w, 0, 9e9), 'twelve seconds are kept').toEqual([]);
    waves.add(block(1e9, [7, 8]));
    expect(waves.of(w, 0, 90e9).map(({ value }) => value)).toEqual([7, 8]);
  });
  it('keep waves of two beds apart, also where one bed’s come later', () => {
    const waves = new LiveWaves();
    const block = (source: string, end_ns: number, values: number[]): LiveSeries => ({
      ...series('W', end_ns, null, { source }),
      kind: 'wave',
      blocks: [{ end_ns, rate_hz: 2, values }],
    });
    waves.add([block('bed-1', 4e9, [1, 2]), block('bed-2', 3e9, [-1, -2])]);
    expect(waves.after_ns, 'what bed 2 sent until then is still asked for').toBeLessThanOrEqual(3e9);
    waves.add([block('bed-2', 4e9, [-3, -4]), block('bed-1', 5e9, [3, 4])]);
    const of = (source: string) => waves.of(keyOfSeries({ code: 'W', stream: 'vitals', source }), 0, 9e9).map(({ value }) => value);
    expect(of('bed-1')).toEqual([1, 2, 3, 4]);
    expect(of('bed-2')).toEqual([-1, -2, -3, -4]);
    const [bedside] = liveBedsidesOf([block('bed-1', 4e9, [1]), series('MDC_ECG_HEART_RATE', 4e9, 60, { source: 'bed-1' })], 5e9);
    expect(bedside?.waves.get('W')).toBe(keyOfSeries({ code: 'W', stream: 'vitals', source: 'bed-1' }));
  });
});
