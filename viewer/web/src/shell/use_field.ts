// A field that pointers, the wheel and keys work on: a picture that a person turns, presses or points at.
import type { RefObject } from 'preact';
import { useEffect } from 'preact/hooks';

/** Where a pointer is on the field, 0 to 1 from its left upper corner; outside of it less or more. */
export function placeOn(field: HTMLElement, event: PointerEvent): { x: number; y: number } {
  const box = field.getBoundingClientRect();
  return { x: (event.clientX - box.left) / box.width, y: (event.clientY - box.top) / box.height };
}

export interface FieldEvents {
  wheel: (event: WheelEvent) => void;
  /** The page was hidden or shown again: what was held down is let go, since no pointer tells of its end. */
  hidden: () => void;
}

/** Listens until `of` changes or the field is gone. */
export function useField(field: RefObject<HTMLElement>, events: FieldEvents, of: unknown): void {
  useEffect(() => {
    const element = field.current as HTMLElement;
    // Preact's own listeners are passive, and the page would scroll.
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      events.wheel(event);
    };
    element.addEventListener('wheel', wheel, { passive: false });
    document.addEventListener('visibilitychange', events.hidden);
    return () => {
      element.removeEventListener('wheel', wheel);
      document.removeEventListener('visibilitychange', events.hidden);
    };
  }, [of]);
}
