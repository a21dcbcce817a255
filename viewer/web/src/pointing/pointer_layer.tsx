// Arrows with names over a picture; and where one may point, the surface that is pointed on.
import { useSignal } from '@preact/signals';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import { t } from '@/i18n/i18n';
import { type Box, moved, type Part, partAt, pictureBox } from '@/pointing/geometry';
import { colorOf, type Seen } from '@/pointing/pointers';

/** A page points at most so often, and as long as a hand holds still again so that the arrow stays. */
const kLeast_ms = 50;
const kAgain_ms = 400;
const kStep = 0.02;
const kKeys: Record<string, readonly [number, number]> = { ArrowLeft: [-kStep, 0], ArrowRight: [kStep, 0], ArrowUp: [0, -kStep], ArrowDown: [0, kStep] };

function Arrow({ pointer, box }: { pointer: Seen; box: Box }) {
  const name = pointer.role === 'guest' ? t('point.guest', { name: pointer.by }) : pointer.by;
  // The name stays inside the picture.
  const left = pointer.x > 0.75;
  return (
    <div
      class={`pointer pointer-${colorOf(pointer)}${left ? ' pointer-left' : ''}`}
      data-by={pointer.by}
      style={{ left: `${box.left + pointer.x * box.width}px`, top: `${box.top + pointer.y * box.height}px`, opacity: pointer.opacity }}
    >
      <svg viewBox="0 0 24 24" aria-hidden="true">
        <path d="M1 1l6.500 19 3.500-7.500L18.500 9z" />
      </svg>
      <span>{name}</span>
    </div>
  );
}

interface Props {
  seen: readonly Seen[];
  /** Whose picture lies below; the arrows lie where it does, whatever its borders. */
  video: () => HTMLVideoElement | null | undefined;
  /** Called while this person points; absent: they cannot. */
  onPoint?: ((part: Part) => void) | undefined;
  /** Of what: a hand that is still held down when that changes points at nothing more. */
  about?: string | undefined;
  /** Of the stream, as people read it. */
  name: string;
}

export function PointerLayer({ seen, video, onPoint, about, name }: Props) {
  const layer = useRef<HTMLDivElement>(null);
  const box = useSignal<Box>({ left: 0, top: 0, width: 0, height: 0 });
  useLayoutEffect(() => {
    const place = layer.current as HTMLDivElement;
    const measure = () => {
      const shown = video();
      box.value = pictureBox(place.clientWidth, place.clientHeight, shown?.videoWidth ?? 0, shown?.videoHeight ?? 0);
    };
    const observer = new ResizeObserver(measure);
    observer.observe(place);
    const shown = video();
    shown?.addEventListener('resize', measure);
    shown?.addEventListener('loadedmetadata', measure);
    measure();
    return () => {
      observer.disconnect();
      shown?.removeEventListener('resize', measure);
      shown?.removeEventListener('loadedmetadata', measure);
    };
  }, [video]);

  const held = useRef<Part | undefined>(undefined);
  const told_ms = useRef(0);
  const timer = useRef<ReturnType<typeof setInterval> | undefined>(undefined);
  const tell = (part: Part, least_ms = kLeast_ms) => {
    held.current = part;
    const now_ms = performance.now();
    if (now_ms - told_ms.current < least_ms) return;
    told_ms.current = now_ms;
    onPoint?.(part);
  };
  const letGo = () => {
    clearInterval(timer.current);
    held.current = undefined;
  };
  const points = onPoint !== undefined;
  useEffect(() => letGo, [about, points]);
  const at = (event: PointerEvent): Part | undefined => {
    const area = (event.currentTarget as HTMLElement).getBoundingClientRect();
    return partAt(event.clientX - area.left, event.clientY - area.top, box.value);
  };
  const keyed = useRef<Part>({ x: 0.5, y: 0.5 });
  const surface = onPoint && {
    tabIndex: 0,
    role: 'application' as const,
    'aria-label': t('point.surface', { name }),
    title: t('point.how'),
    onPointerDown: (event: PointerEvent) => {
      const part = at(event);
      if (event.button !== 0 || !part) return;
      (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
      keyed.current = part;
      tell(part, 0);
      clearInterval(timer.current);
      timer.current = setInterval(() => {
        if (held.current) tell(held.current, kAgain_ms);
      }, kLeast_ms);
    },
    onPointerMove: (event: PointerEvent) => {
      const part = held.current && at(event);
      if (part) tell((keyed.current = part));
    },
    onPointerUp: letGo,
    onPointerCancel: letGo,
    onKeyDown: (event: KeyboardEvent) => {
      const step = kKeys[event.key];
      if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      keyed.current = moved(keyed.current, step[0], step[1]);
      tell(keyed.current);
    },
  };
  return (
    <div class={onPoint ? 'pointer-layer pointer-surface' : 'pointer-layer'} ref={layer} {...surface}>
      {seen.map((one) => (
        <Arrow key={`${one.role} ${one.by}`} pointer={one} box={box.value} />
      ))}
    </div>
  );
}
