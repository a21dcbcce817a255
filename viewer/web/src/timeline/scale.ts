// The window of the case clock that the time line shows, and where its parts fall on the screen. Pure functions.
import type { Span } from '@/base/spans';
import { kHour, kMinute, kSecond } from '@/base/time';

export const kShortestWindow_ns = 0.5 * kSecond;

export const toPixel = (time_ns: number, window: Span, width: number): number => ((time_ns - window.start_ns) / (window.end_ns - window.start_ns)) * width;

export const toTime = (pixel: number, window: Span, width: number): number => Math.round(window.start_ns + (pixel / width) * (window.end_ns - window.start_ns));

/** `window` moved, and shortened where it must be, so that it lies within `whole`. */
export function within(window: Span, whole: Span): Span {
  const length = Math.min(window.end_ns - window.start_ns, whole.end_ns - whole.start_ns);
  const start_ns = Math.round(Math.max(whole.start_ns, Math.min(whole.end_ns - length, window.start_ns)));
  return { start_ns, end_ns: Math.round(start_ns + length) };
}

/** `factor` < 1 looks closer; the time `about_ns` stays where it is on the screen. */
export function zoomed(window: Span, whole: Span, factor: number, about_ns: number): Span {
  const length = window.end_ns - window.start_ns;
  const most = whole.end_ns - whole.start_ns;
  const wanted = Math.max(Math.min(kShortestWindow_ns, most), Math.min(most, length * factor));
  const part = (about_ns - window.start_ns) / length;
  return within({ start_ns: about_ns - part * wanted, end_ns: about_ns + (1 - part) * wanted }, whole);
}

export const panned = (window: Span, whole: Span, by_ns: number): Span => within({ start_ns: window.start_ns + by_ns, end_ns: window.end_ns + by_ns }, whole);

/** Fingers that lie closer than this would zoom without end. */
const kLeastApart = 24;

/** What lay under the middle of two fingers stays there, and the window is as much closer as they are further apart. */
export function pinched(window: Span, whole: Span, from: readonly [number, number], to: readonly [number, number], width: number): Span {
  const apart = ([a, b]: readonly [number, number]) => Math.max(kLeastApart, Math.abs(b - a));
  const middle = ([a, b]: readonly [number, number]) => (a + b) / 2;
  const closer = zoomed(window, whole, apart(from) / apart(to), toTime(middle(from), window, width));
  return panned(closer, whole, ((middle(from) - middle(to)) / width) * (closer.end_ns - closer.start_ns));
}

/** The window that shows `time_ns` again once it has left it: turned over like a page, so that it stands still while one watches. */
export function following(window: Span, whole: Span, time_ns: number): Span {
  if (time_ns >= window.start_ns && time_ns <= window.end_ns) return window;
  const length = window.end_ns - window.start_ns;
  return within({ start_ns: time_ns - 0.1 * length, end_ns: time_ns + 0.9 * length }, whole);
}

const kLongestStep = 24 * kHour;
const kSteps = [
  0.1 * kSecond,
  0.2 * kSecond,
  0.5 * kSecond,
  kSecond,
  2 * kSecond,
  5 * kSecond,
  10 * kSecond,
  15 * kSecond,
  30 * kSecond,
  kMinute,
  2 * kMinute,
  5 * kMinute,
  10 * kMinute,
  15 * kMinute,
  30 * kMinute,
  kHour,
  2 * kHour,
  3 * kHour,
  6 * kHour,
  12 * kHour,
  kLongestStep,
];

/** Where the ruler has a number: times counted from `begin_ns`, at least `least_pixels` apart. */
export function ticks(window: Span, begin_ns: number, width: number, least_pixels: number): { times: number[]; step_ns: number } {
  const length = window.end_ns - window.start_ns;
  const step_ns = kSteps.find((step) => (step / length) * width >= least_pixels) ?? kLongestStep;
  const times: number[] = [];
  for (let time = begin_ns + Math.ceil((window.start_ns - begin_ns) / step_ns) * step_ns; time <= window.end_ns; time += step_ns) times.push(time);
  return { times, step_ns };
}

/** The times of `moments` (in order) next to `now_ns` on either side; a moment within half a second behind counts as the one that one stands at. */
export function neighbours(moments: readonly number[], now_ns: number): { previous: number | undefined; next: number | undefined } {
  const next = moments.find((time) => time > now_ns + 1e6);
  const previous = moments.findLast((time) => time < now_ns - 0.5 * kSecond);
  return { previous, next };
}
