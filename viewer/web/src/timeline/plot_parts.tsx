// What the overview and the lanes of the time line have in common: the playhead, the selection, the card beside the pointer, and pointers themselves.
import { type ReadonlySignal, useSignal, useSignalEffect } from '@preact/signals';
import { useMemo, useRef } from 'preact/hooks';
import { cases } from '@/api/client';
import { spanAt, type Span } from '@/base/spans';
import { formatTime, kMinute } from '@/base/time';
import { pieceAt } from '@/media/pieces';
import type { Playback } from '@/media/playback';
import { type Deed, Gesture } from '@/timeline/gesture';
import { toPixel, toTime } from '@/timeline/scale';
import type { CaseModel } from '@/views/case_model';

/** Half the card's width: it does not leave the plot. */
const kHalfCard = 84;

export function Playhead({ playback, span, width }: { playback: Playback; span: ReadonlySignal<Span>; width: ReadonlySignal<number> }) {
  const head = useRef<HTMLDivElement>(null);
  useSignalEffect(() => {
    const x = toPixel(playback.position_ns.value, span.value, width.value);
    const isOut = x < -1 || x > width.value + 1;
    if (!head.current) return;
    head.current.style.transform = `translateX(${x}px)`;
    head.current.style.visibility = isOut ? 'hidden' : 'visible';
  });
  return <div class="playhead" ref={head} />;
}

export function SelectionBand({ selection, span, width }: { selection: Span | undefined; span: Span; width: number }) {
  if (!selection || selection.end_ns < span.start_ns || selection.start_ns > span.end_ns) return null;
  const from = toPixel(Math.max(span.start_ns, selection.start_ns), span, width);
  const to = toPixel(Math.min(span.end_ns, selection.end_ns), span, width);
  return <div class="selection-band" style={{ left: `${from}px`, width: `${Math.max(1, to - from)}px` }} />;
}

export interface Hovered {
  time_ns: number;
  /** From the left of the plot. */
  x: number;
}

interface HoverProps {
  model: CaseModel;
  hovered: Hovered;
  /** How wide the window is: hundredths of a second are shown where they can be told apart. */
  length_ns: number;
  /** Where the plot begins in the row, and its width. */
  left: number;
  width: number;
  withPictures: boolean;
}

export function HoverCard({ model, hovered, length_ns, left, width, withPictures }: HoverProps) {
  const pictured = model.videos[0];
  const thumbnail =
    withPictures && pictured && spanAt(model.recorded.get(pictured.name) ?? [], hovered.time_ns)
      ? cases.thumbnailAddress(model.info.id, pictured.name, pieceAt(hovered.time_ns))
      : undefined;
  return (
    <div class="hover-card" style={{ left: `${left + Math.max(kHalfCard, Math.min(width - kHalfCard, hovered.x))}px` }} aria-hidden="true">
      {thumbnail && <img src={thumbnail} width="160" height="90" alt="" onError={(event) => event.currentTarget.remove()} key={thumbnail} />}
      <span class="mono">{formatTime(hovered.time_ns - model.whole.start_ns, length_ns < 10 * kMinute ? 2 : 0)}</span>
    </div>
  );
}

interface PointerOptions {
  span: () => Span;
  width: () => number;
  /** A finger scrubs at once, and two do not pinch. */
  atOnce: boolean;
  act: (deed: Deed) => void;
  onHeld: (held: boolean) => void;
}

/** Listeners for the element that is pointed at, and what is pointed at now. */
export function usePointers({ span, width, atOnce, act, onHeld }: PointerOptions) {
  const gesture = useMemo(() => new Gesture(atOnce), [atOnce]);
  const hovered = useSignal<Hovered | undefined>(undefined);
  const xOf = (event: PointerEvent) => {
    const box = (event.currentTarget as HTMLElement).getBoundingClientRect();
    return Math.max(0, Math.min(width(), event.clientX - box.left));
  };
  const tell = (deed: Deed | undefined) => {
    if (deed) act(deed);
  };
  const over = (event: PointerEvent) => {
    onHeld(gesture.isHeld);
    if (event.pointerType !== 'mouse') hovered.value = undefined;
  };
  const listeners = {
    onPointerDown: (event: PointerEvent) => {
      if (event.button !== 0) return;
      (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
      tell(gesture.press({ id: event.pointerId, kind: event.pointerType, x: xOf(event), selects: event.shiftKey }));
      onHeld(true);
    },
    onPointerMove: (event: PointerEvent) => {
      const x = xOf(event);
      const deed = gesture.move(event.pointerId, x);
      if (event.pointerType === 'mouse' || deed?.do === 'scrub') hovered.value = { time_ns: toTime(x, span(), width()), x };
      tell(deed);
    },
    onPointerUp: (event: PointerEvent) => {
      tell(gesture.release(event.pointerId));
      over(event);
    },
    onPointerCancel: (event: PointerEvent) => {
      gesture.cancel(event.pointerId);
      over(event);
    },
    onPointerLeave: () => {
      hovered.value = undefined;
    },
  };
  return { listeners, hovered };
}
