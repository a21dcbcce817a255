import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import type { CaseInfo } from '@/api/types';
import { formatMoment, formatTimeOfDay } from '@/i18n/i18n';
import { wallClock } from '@/views/case_model';

describe('The wall clock of a case', () => {
  const zone = process.env.TZ;
  beforeEach(() => {
    process.env.TZ = 'Europe/Berlin';
  });
  afterEach(() => {
    if (zone === undefined) delete process.env.TZ;
    else process.env.TZ = zone;
  });

  it('goes by the moment at which the case was opened, also where it was recorded ahead', () => {
    const info: CaseInfo = {
      id: '20260805T091502Z-3f9c21ab',
      opened: '2026-08-05T09:15:02.000000Z',
      opened_ns: 400e9, // three minutes of it are older
      clock_steps: [],
      begins_ns: 220e9,
      state: 'closed',
      duration_ns: 600e9,
      device: 'or3',
      streams: [],
      plan: null,
    };
    expect(wallClock(info, info.opened_ns).toISOString()).toBe('2026-08-05T09:15:02.000Z');
    expect(wallClock(info, info.begins_ns).toISOString()).toBe('2026-08-05T09:12:02.000Z');
    const set = { ...info, clock_steps: [{ time_ns: 410e9, step_ns: 3600e9 }] };
    expect(wallClock(set, 409e9).toISOString()).toBe('2026-08-05T09:15:11.000Z');
    expect(wallClock(set, 410e9).toISOString()).toBe('2026-08-05T10:15:12.000Z');
  });

  it('names its zone, since an hour comes twice when clocks go back', () => {
    expect(formatMoment('2026-10-25T00:30:00Z')).toBe('25 Oct 2026, 02:30:00 CEST');
    expect(formatMoment('2026-10-25T01:30:00Z')).toBe('25 Oct 2026, 02:30:00 CET');
    expect(formatTimeOfDay(new Date('2026-10-25T01:30:00Z'))).toBe('02:30:00 CET');
  });
});
