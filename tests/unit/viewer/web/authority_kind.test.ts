// That an authority's name is never shown for more than it is: whoever sets a recorder up chooses that of its own.
import { afterEach, describe, expect, it } from 'vitest';
import { language } from '@/i18n/i18n';
import { messages } from '@/i18n/messages';
import { nameWithKind } from '@/verification/authority_kind';

describe('The name of an authority', () => {
  const before = language.value;
  afterEach(() => {
    language.value = before;
  });
  it('has its kind beside it where it is the recorder’s own', () => {
    const name = 'national-metrology-institute';
    language.value = 'en';
    expect(nameWithKind(name, 'self-issued')).toBe(`${name}, self-issued`);
    expect(nameWithKind(name, 'external')).toBe(name);
    language.value = 'ja';
    expect(nameWithKind(name, 'self-issued')).toBe(`${name}・自己発行`);
  });
});

describe('What an authority says of a plan', () => {
  it('is proved in no language', () => {
    for (const key of ['proof.sealed.time', 'proof.whole.time'] as const) {
      expect(messages.en[key]).toContain('says the authority');
      expect(messages.ja[key]).toContain('述べています');
      expect(messages.ja[key]).not.toContain('証明');
    }
  });
});
