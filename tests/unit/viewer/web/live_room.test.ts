import { describe, expect, it } from 'vitest';
import type { LiveSeries, RoomStatus, StreamStatus } from '@/api/types';
import { AlertBell, kAgain_ms, troublesOf } from '@/rooms/trouble';
import { LiveWaves, readingsOf } from '@/vitals/live_readings';

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
    ...more,
  });
  it('are the newest numbers, in the monitors’ order', () => {
    const readings = readingsOf(
      [
        series('MDC_PRESS_BLD_ART_ABP_DIA', 9e9, 80),
        series('MDC_PRESS_BLD_ART_ABP_SYS', 9e9, 120),
        series('MDC_PRESS_BLD_ART_ABP_MEAN', 9e9, 93),
        series('MDC_ECG_HEART_RATE', 8e9, 59),
        series('MDC_ECG_HEART_RATE', 9e9, 60, { source: 'bed-2' }),
      ],
      10e9,
    );
    expect(readings.map(({ text, mean, silent_s }) => [text, mean, silent_s])).toEqual([
      ['60', '', undefined],
      ['120/80', '(93)', undefined],
    ]);
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
    const block = (end_ns: number, values: (number | null)[]) => [
      { ...series('W', end_ns, null), kind: 'wave' as const, blocks: [{ end_ns, rate_hz: 2, values }] },
    ];
    waves.add(block(1e9, [1, 2]));
    waves.add(block(1e9, [1, 2]));
    waves.add(block(2e9, [3, null]));
    expect(waves.of('W', 0, 9e9).map(({ time_ns, value }) => [time_ns / 1e9, value])).toEqual([
      [0, 1],
      [0.5, 2],
      [1, 3],
      [1.5, null],
    ]);
    expect(waves.last_ns).toBe(2e9);
    waves.add(block(60e9, [5, 6]));
    expect(waves.of('W', 0, 9e9), 'twelve seconds are kept').toEqual([]);
    waves.add(block(1e9, [7, 8]));
    expect(waves.of('W', 0, 90e9).map(({ value }) => value)).toEqual([7, 8]);
  });
});
