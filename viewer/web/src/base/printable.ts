// Text that somebody else wrote, before a person sees it: the browser obeys marks of writing direction and hides characters of no width, so that a file's or a
// person's name reads as another. As base/printable.h of the server. Pure functions.

// A sign or an ideograph with the selector of its variant, which is seen; else controls other than tab and line feed, soft hyphen, fillers, zero-width characters,
// marks and overrides of direction, separators, tags, noncharacters, selectors behind what has no variants.
const kMisleading =
  /[\xa9\xae\u203c\u2049\u2100-\u27ff\u2801-\u2bff\u3005-\u3007\u3030\u303d\u3297-\u3299\u3400-\u9fff\uf900-\ufaff\u{1f000}-\u{1faff}\u{20000}-\u{3fffd}][\ufe00-\ufe0f]|[\u3005-\u3007\u3400-\u9fff\uf900-\ufaff\u{20000}-\u{3fffd}][\u{e0100}-\u{e01ef}]|[\0-\x08\x0b-\x1f\x7f-\x9f\xad\u034f\u061c\u115f\u1160\u17b4\u17b5\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\u2800\u3164\ufdd0-\ufdef\ufe00-\ufe0f\ufeff\uffa0\ufff0-\ufffc\ufffe\uffff\u{1bca0}-\u{1bca3}\u{1d173}-\u{1d17a}\u{e0000}-\u{e00ff}\u{e0100}-\u{e01ef}]/gu;

/** Each of them as "\u{202E}"; all else stays. */
export const printable = (text: string): string =>
  text.replace(kMisleading, (one) => ([...one].length > 1 ? one : `\\u{${(one.codePointAt(0) ?? 0).toString(16).toUpperCase().padStart(4, '0')}}`));

/** For JSON.parse: every text in what a server says. */
export const printableTexts = (_key: string, value: unknown): unknown => (typeof value === 'string' ? printable(value) : value);
