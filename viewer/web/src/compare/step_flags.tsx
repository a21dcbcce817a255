// Flags on the time line where steps begin that are matched by hand: dragged, or moved by the arrow keys.
import { useRef } from 'preact/hooks';
import type { Span } from '@/base/spans';
import { formatTime, kSecond } from '@/base/time';
import type { MatchingModel } from '@/compare/matching_model';
import type { Playback } from '@/media/playback';
import { toPixel, toTime } from '@/timeline/scale';

const kByKey: Record<string, number> = { ArrowLeft: -0.1 * kSecond, ArrowRight: 0.1 * kSecond };

interface Props {
  matching: MatchingModel;
  playback: Playback;
  window: Span;
  whole: Span;
  width: number;
  top: number;
  height: number;
}

export function StepFlags({ matching, playback, window, whole, width, top, height }: Props) {
  const dragging = useRef<number | undefined>(undefined);
  const timeOf = (event: PointerEvent) => {
    const box = ((event.currentTarget as HTMLElement).parentElement as HTMLElement).getBoundingClientRect();
    return toTime(Math.max(0, Math.min(width, event.clientX - box.left)), window, width);
  };
  return (
    <>
      {matching.steps.value.map(({ step, name, done }) => {
        if (!done) return null;
        const x = toPixel(done.start_ns, window, width);
        if (x < -12 || x > width + 12) return null;
        return (
          <button
            key={step}
            type="button"
            role="slider"
            class={step === matching.chosen.value ? 'step-flag step-flag-chosen' : 'step-flag'}
            style={{ left: `${x}px`, top: `${top}px`, height: `${height}px` }}
            aria-label={`${step}. ${name}`}
            aria-valuemin={0}
            aria-valuemax={Math.round((whole.end_ns - whole.start_ns) / 1e6)}
            aria-valuenow={Math.round((done.start_ns - whole.start_ns) / 1e6)}
            aria-valuetext={formatTime(done.start_ns - whole.start_ns, 3)}
            onPointerDown={(event: PointerEvent) => {
              if (event.button !== 0) return;
              event.stopPropagation();
              dragging.current = step;
              matching.choose(step);
              (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
            }}
            onPointerMove={(event: PointerEvent) => {
              if (dragging.current !== step) return;
              event.stopPropagation();
              const at_ns = timeOf(event);
              matching.hold(step, at_ns);
              playback.scrub(at_ns);
            }}
            onPointerUp={(event: PointerEvent) => {
              event.stopPropagation();
              dragging.current = undefined;
              matching.drop();
            }}
            onPointerCancel={() => {
              dragging.current = undefined;
              matching.drop();
            }}
            onKeyDown={(event: KeyboardEvent) => {
              const by_ns = kByKey[event.key];
              if (by_ns === undefined) return;
              event.preventDefault();
              event.stopPropagation();
              matching.hold(step, done.start_ns + by_ns);
              matching.drop();
              playback.seek(done.start_ns + by_ns);
            }}
          >
            {step}
          </button>
        );
      })}
    </>
  );
}
