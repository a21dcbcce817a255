// What the whole page knows: who is signed in, light or dark, and what is said aloud.
import { signal } from '@preact/signals';
import { ApiError, kNoAnswer } from '@/api/client';
import type { Session } from '@/api/types';

/** undefined: not asked yet; null: signed out. */
export const session = signal<Session | null | undefined>(undefined);

/** The server ended the session, rather than the person: then signing in leads back to where they were. */
export const sessionEnded = signal(false);

/** With which somebody has just signed in and which they must replace now; in memory alone. */
export const oneTimePassword = signal<string | undefined>(undefined);

export type Theme = 'dark' | 'light';
const kStored = 'kiroku.theme';
export const theme = signal<Theme>('dark');

export function setTheme(chosen: Theme): void {
  theme.value = chosen;
  document.documentElement.dataset['theme'] = chosen;
  localStorage.setItem(kStored, chosen);
}

export function startTheme(): void {
  setTheme(localStorage.getItem(kStored) === 'light' ? 'light' : 'dark');
}

/** What a screen reader shall say next. */
export const announcement = signal('');
export function announce(text: string): void {
  // The same sentence twice in a row is only spoken twice if something about it changes.
  announcement.value = announcement.value === text ? `${text}\u00a0` : text;
}

export interface Notice {
  id: number;
  text: string;
  kind: 'problem' | 'done';
}
export const notices = signal<Notice[]>([]);
let lastNotice = 0;

export function notify(text: string, kind: Notice['kind'] = 'problem'): void {
  if (notices.value.some((one) => one.text === text)) return;
  const notice = { id: ++lastNotice, text, kind };
  notices.value = [...notices.value.slice(-3), notice];
  setTimeout(() => dismiss(notice.id), kind === 'problem' ? 12_000 : 5_000);
}

export function dismiss(id: number): void {
  notices.value = notices.value.filter((one) => one.id !== id);
}

export const textOf = (error: unknown): string => (error instanceof Error ? error.message : String(error));

/** Tells the person of a failure; of one that the frame shows by itself (no answer, no session) it says nothing more. */
export function notifyOf(error: unknown): void {
  if (error instanceof DOMException && error.name === 'AbortError') return;
  if (error instanceof ApiError && (error.status === kNoAnswer || error.status === 401)) return;
  notify(textOf(error));
}

/** Runs `action` and tells the person of its failure. */
export async function attempt<T>(action: () => Promise<T>): Promise<T | undefined> {
  try {
    return await action();
  } catch (error) {
    notifyOf(error);
    return undefined;
  }
}
