// Whether the server answers. While it does not, the page asks again by itself, ever more seldom, and views load what they lack once it is back.
import { signal } from '@preact/signals';
import { reachable, whenUnreachable } from '@/api/client';

export const isGone = signal(false);
/** How often the server came back: views that could not load something load it when this changes. */
export const returns = signal(0);

const kFirstRetry_ms = 1000;
const kLongestRetry_ms = 15_000;

let retry_ms = kFirstRetry_ms;
let timer: ReturnType<typeof setTimeout> | undefined;

async function ask(): Promise<void> {
  clearTimeout(timer);
  if (await reachable()) {
    isGone.value = false;
    returns.value += 1;
    retry_ms = kFirstRetry_ms;
    return;
  }
  timer = setTimeout(() => void ask(), retry_ms);
  retry_ms = Math.min(kLongestRetry_ms, 2 * retry_ms);
}

/** At once, because somebody asked for it or the network came back. */
export function tryNow(): void {
  if (!isGone.peek()) return;
  retry_ms = kFirstRetry_ms;
  void ask();
}

export function startConnection(): void {
  whenUnreachable(() => {
    if (isGone.peek()) return;
    isGone.value = true;
    timer = setTimeout(() => void ask(), retry_ms);
  });
  addEventListener('online', tryNow);
}
