// Text that somebody else wrote, before a person sees it: the browser obeys marks of writing direction and hides characters of no width, so that a file's or a
// person's name reads as another. As base/printable.h of the server. Pure functions.

// Controls other than tab and line feed, soft hyphen, fillers, zero-width characters, marks and overrides of direction, separators, tags, noncharacters.
const kMisleading =
  /[\0-\x08\x0b-\x1f\x7f-\x9f\xad\u034f\u061c\u115f\u1160\u17b4\u17b5\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\u3164\ufdd0-\ufdef\ufeff\uffa0\ufff0-\ufffc\ufffe\uffff\u{1bca0}-\u{1bca3}\u{1d173}-\u{1d17a}\u{e0000}-\u{e00ff}]/gu;

/** Each of them as "\u{202E}"; all else stays. */
export const printable = (text: string): string =>
  text.replace(kMisleading, (one) => `\\u{${(one.codePointAt(0) ?? 0).toString(16).toUpperCase().padStart(4, '0')}}`);

/** For JSON.parse: every text in what a server says. */
export const printableTexts = (_key: string, value: unknown): unknown => (typeof value === 'string' ? printable(value) : value);
