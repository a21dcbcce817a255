import { describe, expect, it } from 'vitest';
import { rowOf } from '@/log/log_entry';

describe('An entry of the appliance log', () => {
  const head = { seq: 7, utc: '2026-08-05T09:15:02.000000Z', mono_ns: 0 };
  it('says who looked at what', () => {
    expect(rowOf({ ...head, type: 'access', case: '20260805T091502Z-3f9c21ab', what: 'exported endoscope', who: 'anna (kiroku view, 192.0.2.7)' })).toEqual({
      seq: 7,
      utc: head.utc,
      type: 'access',
      case: '20260805T091502Z-3f9c21ab',
      who: 'anna (kiroku view, 192.0.2.7)',
      deed: 'exported endoscope',
      carries: [],
    });
  });
  it('says whatever else it carries', () => {
    expect(rowOf({ ...head, type: 'case-checkpoint', case: '20260805T091502Z-3f9c21ab', size: 412, root: 'ab' }).carries).toEqual([
      ['size', '412'],
      ['root', 'ab'],
    ]);
    expect(rowOf({ ...head, type: 'pre-roll-discarded', segments: 30, duration_ns: 90e9 }).carries).toEqual([
      ['segments', '30'],
      ['duration_ns', '1 min 30 s'],
    ]);
    expect(rowOf({ ...head, type: 'case-released', case: '20260805T091502Z-3f9c21ab', hold: 12, reason: 'settled', who: 'ben' })).toMatchObject({
      case: '20260805T091502Z-3f9c21ab',
      who: 'ben',
      carries: [
        ['hold', '12'],
        ['reason', 'settled'],
      ],
    });
    expect(rowOf({ ...head, type: 'shutdown' })).toMatchObject({ case: '', who: '', deed: '', carries: [] });
  });
  it('shows of a quote of the boot enough to tell it from others', () => {
    const quote = { quote: '/1RDR4AYACIAC0JPjRixuxL0', quote_signature: 'MEUCIQ==', pcrs: ['4:ab'] };
    expect(rowOf({ ...head, type: 'boot', boot_id: 'b', ...quote }).carries).toEqual([
      ['boot_id', 'b'],
      ['quote', '/1RDR4AYACIAC0JP…'],
    ]);
    expect(rowOf({ ...head, type: 'boot', boot_id: 'b', no_quote: 'it did not answer' }).carries).toContainEqual(['no_quote', 'it did not answer']);
  });
  it('of no single case leads to none', () => {
    expect(rowOf({ ...head, type: 'access', case: '*', what: 'adds user anna', who: 'root' }).case).toBe('');
  });
});
