import { describe, expect, it } from 'vitest';
import { formatBytes, formatDuration, formatTime, parseTime } from '@/base/time';

describe('Times', () => {
  it('are shown by the case clock without rounding up', () => {
    expect(formatTime(0)).toBe('00:00:00');
    expect(formatTime(59.9996e9)).toBe('00:00:59');
    expect(formatTime(3723.4567e9, 3)).toBe('01:02:03.456');
    expect(formatTime(1.2e9, 1)).toBe('00:00:01.2');
    expect(formatTime(-5e9)).toBe('-00:00:05');
  });

  it('do not lose a millisecond to binary fractions', () => {
    for (let ms = 0; ms < 5000; ++ms) expect(formatTime(ms * 1e6, 3)).toBe(`00:00:0${Math.floor(ms / 1000)}.${String(ms % 1000).padStart(3, '0')}`);
  });

  it.each([
    ['90', 90],
    ['1:30', 90],
    ['01:02:03', 3723],
    ['12.5', 12.5],
    ['1h2m3s', 3723],
    ['5 min', 300],
    ['２', undefined],
    ['1：30', 90],
    [' 7 ', 7],
    ['1:75', undefined],
    ['1:60:00', undefined],
    ['', undefined],
    ['soon', undefined],
    ['--5', undefined],
  ])('are read as people type them: %s', (text, seconds) => {
    expect(parseTime(text)).toBe(seconds === undefined ? undefined : seconds * 1e9);
  });

  it('count from now with a sign', () => {
    expect(parseTime('+5', 60e9)).toBe(65e9);
    expect(parseTime('-1:00', 90e9)).toBe(30e9);
  });

  it('that a person gets back from the page are read as the same', () => {
    for (const ns of [0, 1.5e9, 61.25e9, 36_000e9 + 0.001e9]) expect(parseTime(formatTime(ns, 3))).toBe(ns);
  });

  it('of lengths and sizes are told in their largest units', () => {
    expect([20e9, 60e9, 90e9, 3600e9, 12_000e9].map(formatDuration)).toEqual(['20 s', '1 min', '1 min 30 s', '1 h', '3 h 20 min']);
    expect([0, 999, 1000, 16_383_330, 8.24e9, 99.96e9, 999.6e6].map(formatBytes)).toEqual(['0 B', '999 B', '1.0 kB', '16.4 MB', '8.2 GB', '100 GB', '1.0 GB']);
  });
});
