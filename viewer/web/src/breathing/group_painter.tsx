// The lung's surface, turned and painted: which part of it rib cage and diaphragm move, and what holds it.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import type { LungController } from '@/breathing/lung_controller';
import {
  countOf,
  groupAt,
  kSurfaceGroups,
  kViews,
  lacking,
  neighboursOf,
  nodesUnder,
  painted,
  SeenLung,
  type Surface,
  type SurfaceGroup,
  turned,
  type View,
} from '@/breathing/lung_surface';
import type { Motion } from '@/breathing/motion';
import { t } from '@/i18n/i18n';
import { announce, notify } from '@/shell/state';
import { colorsOf, prepared } from '@/timeline/colors';

/** `turn` moves nothing but the view; `opened` gives back what the model had. */
const kBrushes = ['turn', ...kSurfaceGroups.filter((group) => group !== 'free'), 'free', 'opened'] as const;
type Brush = (typeof kBrushes)[number];
const groupOf = (brush: Exclude<Brush, 'turn'>): SurfaceGroup | null => (brush === 'opened' ? null : brush);
const kTurnedBy_deg = 10;

/** Of a canvas: `rgb()` with so much of the colour. */
function shaded(color: string, light: number): string {
  const parts = /^#(..)(..)(..)$/.exec(color)?.slice(1) ?? ['80', '80', '80'];
  return `rgb(${parts.map((part) => Math.round(parseInt(part, 16) * (0.35 + 0.65 * light))).join(' ')})`;
}

function draw(canvas: HTMLCanvasElement, seen: SeenLung, groups: string, cross: boolean): void {
  const context = prepared(canvas, seen.side, seen.side);
  const color = colorsOf(canvas);
  const colors = Object.fromEntries(kSurfaceGroups.map((group) => [group, color(`lung-${group}`)])) as Record<SurfaceGroup, string>;
  for (const face of seen.faces) {
    const [a, b, c] = seen.corners(face);
    // What two corners are of; else the first one's.
    const of = groups[b] === groups[c] ? b : a;
    context.fillStyle = context.strokeStyle = shaded(colors[groupAt(groups, of)], seen.facing[face] as number);
    context.beginPath();
    context.moveTo(seen.x[a] as number, seen.y[a] as number);
    context.lineTo(seen.x[b] as number, seen.y[b] as number);
    context.lineTo(seen.x[c] as number, seen.y[c] as number);
    context.closePath();
    context.fill();
    // Without it the ground shows between two faces.
    context.lineWidth = 0.6;
    context.stroke();
  }
  if (!cross) return;
  context.strokeStyle = color('text');
  context.lineWidth = 1;
  const middle = seen.side / 2;
  context.beginPath();
  for (const [dx, dy] of [
    [1, 0],
    [0, 1],
  ] as const) {
    context.moveTo(middle - 8 * dx, middle - 8 * dy);
    context.lineTo(middle + 8 * dx, middle + 8 * dy);
  }
  context.stroke();
}

export function GroupPainter({ lung, surface, motion }: { lung: LungController; surface: Surface; motion: Motion }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const brush = useSignal<Brush>('turn');
  const radius_mm = useSignal(12);
  const view = useSignal<View>(kViews.front);
  const side = useSignal(320);
  /** What is painted and not let go of yet. */
  const stroke = useSignal<string | undefined>(undefined);
  const under = useSignal<SurfaceGroup | undefined>(undefined);
  const focused = useSignal(false);
  const open = useSignal(false);
  const last = useRef<{ x: number; y: number; paints: boolean } | undefined>(undefined);
  const neighbours = useMemo(() => neighboursOf(surface), [surface]);
  const seen = useMemo(() => new SeenLung(surface, view.value, side.value), [surface, view.value, side.value]);
  const groups = stroke.value ?? motion.groups ?? surface.groups;
  useEffect(() => {
    if (open.value && canvas.current) draw(canvas.current, seen, groups, focused.value);
  }, [seen, groups, focused.value, open.value]);
  useEffect(() => {
    const watcher = new ResizeObserver(([entry]) => (side.value = Math.max(160, Math.round(entry?.contentRect.width ?? side.peek()))));
    if (canvas.current?.parentElement) watcher.observe(canvas.current.parentElement);
    return () => watcher.disconnect();
  }, []);

  /** Paints where that pixel is; whether the lung lies there. */
  const paint = (x: number, y: number): boolean => {
    if (brush.value === 'turn') return false;
    const hit = seen.under(x, y);
    if (!hit) return false;
    const nodes = nodesUnder(surface, neighbours, hit, radius_mm.value);
    stroke.value = painted(stroke.value ?? motion.groups ?? surface.groups, nodes, groupOf(brush.value), surface.groups);
    return true;
  };
  /** One step, unless nothing would move by it. */
  const settle = () => {
    const next = stroke.value;
    stroke.value = undefined;
    if (next === undefined) return;
    const gone = lacking(next);
    if (gone) {
      const sentence = t('breathing.groups.lacking', { group: t(`breathing.group.${gone}`) });
      notify(sentence);
      return announce(sentence);
    }
    lung.settle();
    lung.change({ ...motion, groups: next === surface.groups ? null : next }, 'groups');
    lung.settle();
  };
  const placeOf = (event: PointerEvent & { currentTarget: HTMLCanvasElement }) => {
    const box = event.currentTarget.getBoundingClientRect();
    return { x: ((event.clientX - box.left) / box.width) * side.value, y: ((event.clientY - box.top) / box.height) * side.value };
  };
  const press = (event: PointerEvent & { currentTarget: HTMLCanvasElement }) => {
    if (event.button > 2) return;
    event.currentTarget.setPointerCapture(event.pointerId);
    const at = placeOf(event);
    const paints = brush.value !== 'turn' && event.button === 0 && !event.shiftKey;
    last.current = { ...at, paints };
    if (paints) paint(at.x, at.y);
  };
  const move = (event: PointerEvent & { currentTarget: HTMLCanvasElement }) => {
    const at = placeOf(event);
    const from = last.current;
    if (!from) {
      const hit = seen.under(at.x, at.y);
      under.value = hit && groupAt(groups, hit.node);
      return;
    }
    last.current = { ...at, paints: from.paints };
    const [dx, dy] = [at.x - from.x, at.y - from.y];
    if (!from.paints) {
      view.value = turned(view.value, (-180 * dx) / side.value, (180 * dy) / side.value);
      return;
    }
    // A fast stroke leaves no gaps.
    const steps = Math.ceil(Math.hypot(dx, dy) / Math.max(2, (radius_mm.value * seen.pixelsPerMm) / 2));
    for (let i = 1; i <= steps; ++i) paint(from.x + (dx * i) / steps, from.y + (dy * i) / steps);
  };
  const release = () => {
    last.current = undefined;
    settle();
  };
  const keys = (event: KeyboardEvent) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const by: Record<string, [number, number]> = {
      ArrowLeft: [kTurnedBy_deg, 0],
      ArrowRight: [-kTurnedBy_deg, 0],
      ArrowUp: [0, -kTurnedBy_deg],
      ArrowDown: [0, kTurnedBy_deg],
    };
    const turn = by[event.key];
    if (turn) {
      view.value = turned(view.value, ...turn);
    } else if (event.key === 'Enter' || event.key === ' ') {
      const middle = side.value / 2;
      if (brush.value === 'turn') announce(t('breathing.groups.noBrush'));
      else if (paint(middle, middle)) settle();
      else announce(t('breathing.groups.beside'));
    } else {
      return;
    }
    // The page has these keys for its pictures.
    event.stopPropagation();
    event.preventDefault();
  };
  return (
    <details class="card lung-group lung-painter" onToggle={(event) => (open.value = event.currentTarget.open)}>
      <summary>{t('breathing.groups.title')}</summary>
      <div class="lung-turned">
        <canvas
          ref={canvas}
          class={brush.value === 'turn' ? 'lung-surface' : 'lung-surface lung-surface-brush'}
          role="application"
          tabIndex={0}
          aria-label={t('breathing.groups.picture')}
          onPointerDown={press}
          onPointerMove={move}
          onPointerUp={release}
          onPointerCancel={release}
          onPointerLeave={() => (under.value = undefined)}
          onContextMenu={(event) => event.preventDefault()}
          onKeyDown={keys}
          onFocus={() => (focused.value = true)}
          onBlur={() => (focused.value = false)}
        />
        <p class="lung-under muted">{under.value ? t(`breathing.group.${under.value}`) : t('breathing.groups.how')}</p>
      </div>
      <div class="lung-modes" role="toolbar" aria-label={t('breathing.groups.views')}>
        {(Object.keys(kViews) as (keyof typeof kViews)[]).map((name) => (
          <button key={name} type="button" class="button" onClick={() => (view.value = kViews[name])}>
            {t(`breathing.groups.view.${name}`)}
          </button>
        ))}
      </div>
      <fieldset class="lung-brushes">
        <legend>{t('breathing.groups.brush')}</legend>
        {kBrushes.map((name) => (
          <label key={name} class="train-check">
            <input type="radio" name="lung-brush" value={name} checked={brush.value === name} onChange={() => (brush.value = name)} />
            {name !== 'turn' && name !== 'opened' && <span class={`lung-swatch lung-swatch-${name}`} aria-hidden="true" />}
            <span>
              {name === 'turn' || name === 'opened' ? t(`breathing.groups.${name}`) : t(`breathing.group.${name}`)}
              {name !== 'turn' && name !== 'opened' && <small class="muted"> {t('breathing.nodes', { n: countOf(groups, name) })}</small>}
            </span>
          </label>
        ))}
      </fieldset>
      <label class="lung-slider">
        <span>{t('breathing.groups.size')}</span>
        <input
          type="range"
          min={2}
          max={50}
          step={1}
          value={radius_mm.value}
          aria-valuetext={`${radius_mm.value} mm`}
          onInput={(event) => (radius_mm.value = Number(event.currentTarget.value))}
        />
        <output class="mono">{radius_mm.value} mm</output>
      </label>
    </details>
  );
}
