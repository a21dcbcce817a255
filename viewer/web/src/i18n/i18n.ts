// Texts in the language the person chose. Components that call t() are drawn anew when it changes.
import { signal } from '@preact/signals';
import { type MessageKey, type Language, messages } from '@/i18n/messages';

export type { Language, MessageKey };

const kStored = 'kiroku.language';

function preferred(): Language {
  const stored = localStorage.getItem(kStored);
  if (stored === 'en' || stored === 'ja') return stored;
  return navigator.language.startsWith('ja') ? 'ja' : 'en';
}

export const language = signal<Language>('en');

export function setLanguage(chosen: Language, remember = true): void {
  language.value = chosen;
  document.documentElement.lang = chosen;
  if (remember) localStorage.setItem(kStored, chosen);
}

export function startLanguage(): void {
  setLanguage(preferred(), false);
}

/** Whether the person has chosen a language on this machine; else the session's counts. */
export const hasChosenLanguage = (): boolean => localStorage.getItem(kStored) !== null;

export function t(key: MessageKey, values: Record<string, string | number> = {}): string {
  return messages[language.value][key].replace(/\{(\w+)\}/g, (_, name: string) => String(values[name] ?? ''));
}

/** The text of a key that is made of a word of the API, such as `verdict.intact`; the word itself where there is none. */
export function word(group: string, name: string): string {
  const texts: Record<string, string> = messages[language.value];
  return texts[`${group}.${name}`] ?? name;
}

const locale = () => (language.value === 'ja' ? 'ja-JP' : 'en-GB');

/**
 * "22 Nov 2026, 08:39:35 CET": in this machine's zone, and which that is. Reports have UTC, and when clocks go back an
 * hour has the same times as the one before.
 */
export function formatMoment(utc: string): string {
  return new Intl.DateTimeFormat(locale(), { dateStyle: 'medium', timeStyle: 'long' }).format(new Date(utc));
}

/** "08:39:35 CET". */
export const formatTimeOfDay = (moment: Date): string => new Intl.DateTimeFormat(locale(), { timeStyle: 'long' }).format(moment);
