// The sentences that C++ sources put together: reads calls such as Refusal(404, "there is no case " + id) and tells each sentence that can come of them, with
// kValue in place of what is not a literal. Knows string literals, +, parentheses and ?:, which is what such calls are made of.
import { readdirSync, readFileSync, statSync } from 'node:fs';
import { join } from 'node:path';

export const kValue = '§';

export interface Sentence {
  file: string;
  text: string;
}

const kPairs: Record<string, string> = { '(': ')', '{': '}', '[': ']' };

/** Where the literal or group that begins at `at` ends: the index behind it. */
function skip(source: string, at: number): number {
  const one = source[at] as string;
  if (one === '"' || one === "'") {
    for (let i = at + 1; i < source.length; ++i) {
      if (source[i] === '\\') ++i;
      else if (source[i] === one) return i + 1;
    }
    return source.length;
  }
  if (one === '(' || one === '{' || one === '[') {
    let i = at + 1;
    while (i < source.length && source[i] !== kPairs[one]) i = skip(source, i);
    return i + 1;
  }
  return at + 1;
}

/** Splits at `sign` where it stands outside of literals and groups. */
function split(source: string, sign: string): string[] {
  const parts = [''];
  for (let i = 0; i < source.length;) {
    const end = skip(source, i);
    if (source[i] === sign) parts.push('');
    else parts[parts.length - 1] += source.slice(i, end);
    i = end;
  }
  return parts;
}

/** Its choices, of `a ? b : c`; scopes (::) are none. */
function choices(expression: string): string[] {
  const [, ...rest] = split(expression.replaceAll('::', '\u0001'), '?');
  if (rest.length === 0) return [expression];
  return split(rest.join('?'), ':').flatMap((one) => choices(one));
}

const literal = (text: string): string => JSON.parse(text) as string;

/** Every text an expression can become. */
function textsOf(expression: string): string[] {
  return choices(expression.trim()).flatMap((choice) =>
    split(choice, '+').reduce<string[]>(
      (texts, part) => {
        const trimmed = part.trim();
        const literals = /^(?:"(?:[^"\\]|\\.)*"\s*)+$/.test(trimmed);
        const wrapped = /^(?:std::string\s*)?\((.*)\)$/s.exec(trimmed);
        const own = literals
          ? [[...trimmed.matchAll(/"(?:[^"\\]|\\.)*"/g)].map(([one]) => literal(one)).join('')]
          : wrapped?.[1] !== undefined && wrapped[1].includes('"')
            ? textsOf(wrapped[1])
            : [kValue];
        return texts.flatMap((before) => own.map((after) => before + after));
      },
      [''],
    ),
  );
}

function sourcesBelow(folder: string): string[] {
  return readdirSync(folder).flatMap((name) => {
    const path = join(folder, name);
    if (statSync(path).isDirectory()) return name === 'node_modules' ? [] : sourcesBelow(path);
    return name.endsWith('.cpp') ? [path] : [];
  });
}

/** What the calls of `name` in the folders say in their argument `which`, counted from 0, or from the end where it is negative. */
export function sentencesOf(root: string, folders: readonly string[], name: string, which: number | ((given: readonly string[]) => number)): Sentence[] {
  const found: Sentence[] = [];
  for (const file of folders.flatMap((folder) => sourcesBelow(join(root, folder)))) {
    const source = readFileSync(file, 'utf8').replace(/^\s*\/\/.*$/gm, '');
    for (const call of source.matchAll(new RegExp(`\\b${name}\\(`, 'g'))) {
      const open = call.index + call[0].length - 1;
      const given = split(source.slice(open + 1, skip(source, open) - 1), ',');
      const argument = given.at(typeof which === 'number' ? which : which(given));
      for (const text of textsOf(argument ?? '')) found.push({ file: file.slice(root.length + 1), text });
    }
  }
  return found;
}
