// The moment of a case at which its view begins: the one that the address names, or where somebody was whose session ended meanwhile.
import { useEffect } from 'preact/hooks';
import type { Playback } from '@/media/playback';
import { session } from '@/shell/state';

let leftAt: { id: string; at_ns: number } | undefined;

export function useFirstMoment(id: string, playback: Playback, asked_ns: number | undefined): void {
  useEffect(() => {
    if (session.peek() === null) return; // about to be replaced by signing in
    const left_ns = leftAt?.id === id ? leftAt.at_ns : undefined;
    leftAt = undefined;
    if (asked_ns !== undefined || left_ns !== undefined) playback.seek(left_ns ?? asked_ns ?? 0);
  }, [playback, asked_ns]);
  useEffect(
    () => () => {
      if (session.peek() === null) leftAt ??= { id, at_ns: playback.position_ns.peek() };
    },
    [playback],
  );
}
