// Stretches of the case clock, half open. Lists are in order and without overlap where a function says so.

export interface Span {
  start_ns: number;
  end_ns: number;
}

/** Stretches that touch, or lie no further than `tolerance_ns` apart, as one. Takes any order. */
export function merged(spans: readonly Span[], tolerance_ns = 0): Span[] {
  const out: Span[] = [];
  for (const span of [...spans].sort((a, b) => a.start_ns - b.start_ns)) {
    const last = out.at(-1);
    if (last && span.start_ns <= last.end_ns + tolerance_ns) {
      last.end_ns = Math.max(last.end_ns, span.end_ns);
    } else {
      out.push({ start_ns: span.start_ns, end_ns: span.end_ns });
    }
  }
  return out;
}

/** The index of the last element with `key` <= `value` of a list in order, or -1. */
export function lastAtOrBefore<T>(list: readonly T[], value: number, key: (element: T) => number): number {
  let low = 0;
  let high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (key(list[middle] as T) <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** The span of an ordered list that covers `time_ns`. */
export function spanAt<T extends Span>(spans: readonly T[], time_ns: number): T | undefined {
  const span = spans[lastAtOrBefore(spans, time_ns, (one) => one.start_ns)];
  return span && time_ns < span.end_ns ? span : undefined;
}

/** What two ordered lists have in common. */
export function common(a: readonly Span[], b: readonly Span[]): Span[] {
  const out: Span[] = [];
  for (let i = 0, j = 0; i < a.length && j < b.length;) {
    const [one, other] = [a[i] as Span, b[j] as Span];
    const start_ns = Math.max(one.start_ns, other.start_ns);
    const end_ns = Math.min(one.end_ns, other.end_ns);
    if (start_ns < end_ns) out.push({ start_ns, end_ns });
    if (one.end_ns < other.end_ns) ++i;
    else ++j;
  }
  return out;
}
