// English sentences that a program put together, told in Japanese: patterns with {places}, whose values stay as they are. Pure.

/** English and Japanese, with the same {places}. */
export type SentencePair = readonly [english: string, japanese: string];

interface Pattern {
  form: RegExp;
  names: readonly string[];
  japanese: string;
}

const kEscaped = /[.*+?^$()|[\]\\]/g;

function patternOf([english, japanese]: SentencePair): Pattern {
  const names = [...english.matchAll(/\{(\w+)\}/g)].map((one) => one[1] as string);
  const form = new RegExp(`^${english.replace(kEscaped, '\\$&').replace(/\{\w+\}/g, '(.+?)')}$`, 's');
  return { form, names, japanese };
}

export class SentencePatterns {
  private readonly patterns: readonly Pattern[];

  /** Of several that fit, the first counts. */
  constructor(pairs: readonly SentencePair[]) {
    this.patterns = pairs.map(patternOf);
  }

  /** The sentence in Japanese; undefined for one that is not known. `told` puts a value into words of its own. */
  inJapanese(sentence: string, told: (name: string, value: string) => string = (_, value) => value): string | undefined {
    for (const { form, names, japanese } of this.patterns) {
      const found = form.exec(sentence);
      if (!found) continue;
      const values = new Map(names.map((name, at) => [name, found[at + 1] as string]));
      return japanese.replace(/\{(\w+)\}/g, (_, name: string) => told(name, values.get(name) ?? ''));
    }
    return undefined;
  }
}
