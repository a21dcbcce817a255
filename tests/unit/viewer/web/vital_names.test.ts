import { readFileSync } from 'node:fs';
import { afterEach, describe, expect, it } from 'vitest';
import { language } from '@/i18n/i18n';
import { kJapaneseVitals, pressureText, vitalName } from '@/i18n/vital_names';

describe('Names of vital signs', () => {
  afterEach(() => {
    language.value = 'en';
  });

  it('are there in Japanese for every code that the recorder knows', () => {
    const folder = process.env['KIROKU_SOURCE_DIR'];
    if (!folder) throw new Error('KIROKU_SOURCE_DIR names the checkout');
    const codes = [...readFileSync(`${folder}/media/vital_codes.cpp`, 'utf8').matchAll(/\{"(MDC_\w+)"/g)].map((one) => one[1] as string);
    expect(codes.length).toBeGreaterThan(50);
    expect(Object.keys(kJapaneseVitals).sort()).toEqual(codes.sort());
  });

  it('are the server’s own in English, and for what is not known', () => {
    expect(vitalName('MDC_ECG_HEART_RATE', 'heart rate')).toBe('heart rate');
    language.value = 'ja';
    expect(vitalName('MDC_ECG_HEART_RATE', 'heart rate')).toBe('心拍数');
    expect(vitalName('X_OWN', 'own')).toBe('own');
  });

  it('of a pressure that passed its limit are told in Japanese, alarms as the monitor says', () => {
    expect(pressureText('mean pressure 62 mmHg, below 65')).toBe('mean pressure 62 mmHg, below 65');
    language.value = 'ja';
    expect(pressureText('mean pressure 61.8 mmHg, below 65')).toBe('平均血圧 61.8 mmHg（65 未満）');
    expect(pressureText('systolic pressure 170 mmHg, above 160')).toBe('収縮期血圧 170 mmHg（160 超）');
    expect(pressureText('systolic pressure 55.0 mmHg, already below 90')).toBe('収縮期血圧 55.0 mmHg（90 未満、開始時から）');
    expect(pressureText('** ABP LOW')).toBe('** ABP LOW');
  });
});
