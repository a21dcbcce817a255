import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { identityText } from '@/base/identity_file';
import { hrefOf, parseRoute, type Route, signInLink } from '@/base/route';
import { messages } from '@/i18n/messages';
import { kRights, may } from '@/shell/rights';
import { actionOf, kHelp } from '@/views/keyboard';

const places = (text: string) => [...text.matchAll(/\{(\w+)\}/g)].map((one) => one[1]).sort();

describe('Texts', () => {
  it('have the same keys in every language', () => {
    expect(Object.keys(messages.ja).sort()).toEqual(Object.keys(messages.en).sort());
  });
  it('have the same places for values', () => {
    for (const [key, text] of Object.entries(messages.en)) expect([key, places(messages.ja[key as keyof typeof messages.ja])]).toEqual([key, places(text)]);
  });
  it('are there, and are translated', () => {
    for (const [key, text] of Object.entries(messages.ja)) {
      expect(text.trim(), key).not.toBe('');
      if (key !== 'language.other') expect(text, key).toMatch(/[\u3040-\u30ff\u4e00-\u9fff]/);
    }
  });
  it('of the page of keys are there', () => {
    for (const { does } of kHelp) expect(messages.en).toHaveProperty([does]);
  });
});

describe('Addresses', () => {
  it.each<Route>([
    { view: 'cases' },
    { view: 'rooms' },
    { view: 'log' },
    { view: 'users' },
    { view: 'training' },
    { view: 'breathing' },
    { view: 'breathing', recording: { id: '20260805T091502Z-3f9c21ab', stream: 'fluoroscopy' } },
    { view: 'case', id: '20260805T091502Z-3f9c21ab' },
    { view: 'case', id: '20260805T091502Z-3f9c21ab', at_ns: 12.5e9 },
    { view: 'verification', id: '20260805T091502Z-3f9c21ab' },
  ])('lead where they were made for: $view', (route) => {
    expect(parseRoute(hrefOf(route))).toEqual(route);
  });
  it('that sign in once are known by their form', () => {
    expect(signInLink('#sign-in=c2VjcmV0')).toBe('c2VjcmV0');
    expect(signInLink('#/cases')).toBeUndefined();
    expect(signInLink('#sign-in=')).toBeUndefined();
  });
  it('that lead nowhere lead to the list', () => {
    expect(parseRoute('#/breathing?case=x')).toEqual({ view: 'breathing' });
    for (const hash of ['', '#', '#/nothing', '#/cases/']) expect(parseRoute(hash)).toEqual({ view: 'cases' });
    expect(parseRoute('#/cases/x?t=soon')).toEqual({ view: 'case', id: 'x' });
  });
});

describe('Keys', () => {
  const press = (key: string, more = {}) => actionOf({ key, shiftKey: false, ctrlKey: false, altKey: false, metaKey: false, ...more });
  it('do what the page of keys says', () => {
    expect([' ', ',', '.', '[', ']', 'PageUp', 'PageDown', 'f', '?', 'g'].map((key) => press(key))).toEqual([
      'toggle',
      'frameBack',
      'frameForward',
      'slower',
      'faster',
      'previousMark',
      'nextMark',
      'fullScreen',
      'help',
      'goTo',
    ]);
    expect([press('ArrowLeft'), press('ArrowLeft', { shiftKey: true }), press('ArrowUp'), press('ArrowDown')]).toEqual([
      'back5',
      'back1',
      'forward60',
      'back60',
    ]);
    expect([press('?', { shiftKey: true }), press('F', { shiftKey: true })]).toEqual(['help', 'fullScreen']);
  });
  it('leave the browser its own', () => {
    for (const more of [{ ctrlKey: true }, { altKey: true }, { metaKey: true }]) expect(press('f', more)).toBeUndefined();
    expect(press('x')).toBeUndefined();
  });
});

describe('An identity file', () => {
  it('goes as it is where it is text', () => {
    expect(identityText(new TextEncoder().encode('# key\nAGE-SECRET-KEY-1ABC\n'))).toBe('# key\nAGE-SECRET-KEY-1ABC');
  });
  it('goes in base64 where it is sealed with a passphrase', () => {
    const sealed = Uint8Array.from([...new TextEncoder().encode('age-encryption.org/v1\n-> scrypt'), 0xff, 0x00, 0x80]);
    expect(Uint8Array.from(atob(identityText(sealed)), (one) => one.charCodeAt(0))).toEqual(sealed);
    expect(identityText(sealed)).toMatch(/^YWdlLWVuY3J5cHRpb24ub3Jn/);
  });
});

describe('Who is offered what', () => {
  it('is what the server allows', () => {
    const folder = process.env['KIROKU_SOURCE_DIR'];
    if (!folder) throw new Error('KIROKU_SOURCE_DIR names the checkout');
    const table = readFileSync(`${folder}/viewer/http/role.cpp`, 'utf8');
    for (const right of kRights) {
      const row = new RegExp(`"${right}", (true|false), (true|false), (true|false), (true|false)`).exec(table);
      const offered = (['operator', 'surgeon', 'auditor', 'administrator'] as const).map((role) => String(may(role, right)));
      expect([right, row?.slice(1)]).toEqual([right, offered]);
    }
  });
});
