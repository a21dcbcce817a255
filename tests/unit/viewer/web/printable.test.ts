import { describe, expect, it } from 'vitest';
import { printable, printableTexts } from '@/base/printable';

describe('Texts of others', () => {
  it('show what a browser would obey or hide', () => {
    expect(printable('x\u202egpj.exe')).toBe('x\\u{202E}gpj.exe');
    expect(printable('an\u200bna')).toBe('an\\u{200B}na');
    expect(printable('\x1b[2J\x9b\x7f')).toBe('\\u{001B}[2J\\u{009B}\\u{007F}');
    expect(printable('\u2066\u061c\u2028\ufeff')).toBe('\\u{2066}\\u{061C}\\u{2028}\\u{FEFF}');
    expect(printable('\u{e0041}')).toBe('\\u{E0041}');
    expect(printable('an\ufe00na\u2800')).toBe('an\\u{FE00}na\\u{2800}');
    expect(printable('葛\u{e0100}\u{e0101}城')).toBe('葛\u{e0100}\\u{E0101}城');
    expect(printable('❤\u{e0100}')).toBe('❤\\u{E0100}');
  });

  it('stay as they are in every script', () => {
    for (const text of ['佐藤 恵子', '葛\u{e0100}城', 'A\u030angstro\u0308m', 'אורתופדיה', 'جراحة', '❤\ufe0f 😀', 'a\n\tb', '']) {
      expect(printable(text)).toBe(text);
    }
  });

  it('are found wherever they stand in an answer', () => {
    expect(JSON.parse('{"a":[{"file":"x\\u202ey"}],"n":3}', printableTexts)).toEqual({ a: [{ file: 'x\\u{202E}y' }], n: 3 });
  });
});
