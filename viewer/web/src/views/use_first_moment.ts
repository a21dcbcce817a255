// The moment of a case at which its view begins: the one that the address names, or where somebody was before recordings were locked or unlocked, or whose
// session ended meanwhile.
import type { RefObject } from 'preact';
import { useEffect } from 'preact/hooks';
import type { Playback } from '@/media/playback';
import { session } from '@/shell/state';

let leftAt: { id: string; at_ns: number } | undefined;

/** `kept`: of the case's view, which outlives what plays it while recordings are locked or unlocked. */
export function useFirstMoment(id: string, playback: Playback, asked_ns: number | undefined, kept: RefObject<number>): void {
  useEffect(() => {
    if (session.peek() === null) return; // about to be replaced by signing in
    const left_ns = leftAt?.id === id ? leftAt.at_ns : (kept.current ?? undefined);
    leftAt = undefined;
    kept.current = null;
    if (asked_ns !== undefined || left_ns !== undefined) playback.seek(left_ns ?? asked_ns ?? 0);
  }, [playback, asked_ns]);
  useEffect(
    () => () => {
      const at_ns = playback.position_ns.peek();
      kept.current = at_ns;
      if (session.peek() === null) leftAt ??= { id, at_ns };
    },
    [playback],
  );
}
