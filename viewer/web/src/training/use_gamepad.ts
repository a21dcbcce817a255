// A gamepad as a hand of the attempt, looked at with each picture of the screen.
import { type ReadonlySignal, useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { firstPad, GamepadHand } from '@/training/gamepad';
import type { Pointers } from '@/training/pointers';

/** Where the pad's pointers are, while there is one. `changed` is called after it moved, pressed or let go. */
export function useGamepad(pointers: Pointers, fingers: number, changed: () => void): ReadonlySignal<GamepadHand['marks']> {
  const marks = useSignal<GamepadHand['marks']>([]);
  useEffect(() => {
    const hand = new GamepadHand(pointers, fingers);
    let frame = 0;
    let before_ms = performance.now();
    let there = false;
    const look = (now_ms: number) => {
      frame = requestAnimationFrame(look);
      const pad = firstPad(navigator.getGamepads());
      const hasChanged = pad ? hand.step(pad, (now_ms - before_ms) / 1000) : there && hand.release();
      before_ms = now_ms;
      if (pad || there) marks.value = pad ? hand.marks : [];
      there = pad !== undefined;
      if (hasChanged) changed();
    };
    frame = requestAnimationFrame(look);
    return () => cancelAnimationFrame(frame);
  }, [pointers]);
  return marks;
}
