import { describe, expect, it } from 'vitest';
import { merged, spanAt } from '@/base/spans';
import { mimeTypeOf } from '@/media/mp4';
import { canShow, pieceAt, piecesAhead, pieceSpan, wantedPieces } from '@/media/pieces';

const span = (start: number, end: number) => ({ start_ns: start * 1e9, end_ns: end * 1e9 });
const none = () => false;

describe('Pieces of viewing copy', () => {
  it('cover two seconds each', () => {
    expect(pieceAt(3.999e9)).toBe(1);
    expect(pieceAt(4e9)).toBe(2);
    expect(pieceSpan(2)).toEqual(span(4, 6));
  });

  it('are asked for from the clock on, those that are there left out', () => {
    expect(wantedPieces(3e9, [span(0, 60)], 3, none)).toEqual([1, 2, 3]);
    expect(wantedPieces(3e9, [span(0, 60)], 3, (piece) => piece === 2)).toEqual([1, 3]);
  });

  it('are not asked for where nothing was recorded', () => {
    expect(wantedPieces(1e9, [span(0, 2.5), span(9, 20)], 4, none)).toEqual([0, 1, 4, 5]);
    expect(wantedPieces(30e9, [span(0, 20)], 3, none)).toEqual([]);
  });

  it('are not asked for further ahead than is kept', () => {
    expect(wantedPieces(0, [span(100, 200)], 3, none)).toEqual([]);
  });

  it('come in larger numbers at speed', () => {
    expect(piecesAhead(0.25)).toBe(3);
    expect(piecesAhead(4)).toBe(12);
    expect(piecesAhead(100)).toBe(16);
  });
});

describe('A pane', () => {
  const recorded = [span(0, 20), span(30, 40)];
  it('can show what is buffered, and what follows', () => {
    expect(canShow(5e9, recorded, [span(4, 6)], 0.1e9)).toBe(true);
    expect(canShow(5.95e9, recorded, [span(4, 6)], 0.1e9)).toBe(false);
    expect(canShow(5e9, recorded, [], 0.1e9)).toBe(false);
  });
  it('needs nothing where nothing was recorded', () => {
    expect(canShow(25e9, recorded, [], 0.1e9)).toBe(true);
  });
  it('does not wait for pictures behind the last one', () => {
    expect(canShow(19.98e9, recorded, [span(18, 19.96)], 0.1e9)).toBe(true);
  });
  it('does not wait for pictures before the first one', () => {
    expect(canShow(30e9, recorded, [span(30.02, 32)], 0.1e9)).toBe(true);
  });
});

describe('Spans', () => {
  it('that touch are one', () => {
    expect(merged([span(2, 4), span(0, 2), span(5, 6)])).toEqual([span(0, 4), span(5, 6)]);
    expect(merged([span(0, 2), span(2.05, 4)], 0.1e9)).toEqual([span(0, 4)]);
    expect(merged([span(0, 9), span(1, 2)])).toEqual([span(0, 9)]);
  });
  it('are half open', () => {
    expect(spanAt([span(0, 2), span(3, 4)], 2e9)).toBeUndefined();
    expect(spanAt([span(0, 2), span(3, 4)], 3e9)).toEqual(span(3, 4));
    expect(spanAt([], 3e9)).toBeUndefined();
  });
});

describe('The codec of an initialisation segment', () => {
  it('is that of its avcC box', () => {
    const bytes = [0, 0, 0, 20, 0x61, 0x76, 0x63, 0x43, 1, 0x64, 0x00, 0x1f, 0xff];
    expect(mimeTypeOf(Uint8Array.from([9, 9, ...bytes]))).toBe('video/mp4; codecs="avc1.64001f"');
  });
  it('is refused where there is none', () => {
    expect(() => mimeTypeOf(new Uint8Array(64))).toThrow('no H.264');
  });
});
