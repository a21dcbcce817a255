// Over the recorded pictures: the outline of the plan's organ where it was found in the picture that is shown, and in words how well, or that it was not.
import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import type { OrganAlignment } from '@/api/types';
import { displaced, drawColours } from '@/compare/organ_colours';
import { departureAt, type OrganDeparture } from '@/compare/organ_departure';
import { OutlineDrawing, outlineMesh } from '@/compare/organ_outline';
import { organAt, type OrganPlace, pictureSizeAt } from '@/compare/organ_place';
import { organShapeAt, type OrganShape, whyRigid } from '@/compare/organ_shape';
import { t, word } from '@/i18n/i18n';
import type { PanePlayer } from '@/media/pane_player';
import type { Follower, Playback } from '@/media/playback';
import { pictureBox } from '@/pointing/geometry';
import { StressScale } from '@/shell/stress_scale';
import { prepared } from '@/timeline/colors';

const kLook = { line: '#4df0ff', halo: 'rgb(0 0 0 / 75%)', wide: 2.5 };

/** A mesh's nodes where they are at rest, before that camera: on which a departure of a rigid organ is drawn. */
const atRest = (camera: OrganShape['camera'], nodes: number, error_mm: number): OrganShape => ({
  camera,
  displacement: new Float64Array(3 * nodes),
  told: new Uint8Array(nodes).fill(1),
  error_mm,
  largest_mm: 0,
});

interface Props {
  alignment: OrganAlignment;
  /** Whether colours say how far the organ departs from the plan, instead of from rest. */
  fromPlan: boolean;
  player: PanePlayer;
  playback: Playback;
  /** When the archived frame was taken that lies over the viewing copy. */
  original_ns: number | undefined;
}

export function organText(place: OrganPlace | undefined): string {
  if (!place) return t('organ.notLooked');
  return place.is === 'placed' ? t('organ.placed', { mm: place.error_mm.toFixed(1) }) : t('organ.lost', { why: word('organ.why', place.why) });
}

export function shapeText(shape: OrganShape): string {
  return t('organ.deformed', { most: shape.largest_mm.toFixed(0), mm: shape.error_mm.toFixed(1) });
}

/** What colours say of a picture that was compared with the plan, or why none is. */
export function departureText(departure: OrganDeparture | string): string {
  if (typeof departure === 'string') return t('organ.notCompared', { why: word('organ.departure', departure) });
  return departure.departed
    ? t('organ.departs', { most: departure.largest_mm.toFixed(0), mm: departure.largest_error_mm.toFixed(1) })
    : t('organ.asPlanned', { mm: departure.error_mm.toFixed(1) });
}

export function OrganOver({ alignment, fromPlan, player, playback, original_ns }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const place = useSignal<OrganPlace | undefined>(undefined);
  const shape = useSignal<OrganShape | undefined>(undefined);
  const why = useSignal<string | undefined>(undefined);
  const departure = useSignal<OrganDeparture | string | undefined>(undefined);
  const drawing = useMemo(() => {
    const mesh = outlineMesh(alignment.surface);
    return mesh && { mesh, outline: new OutlineDrawing(mesh) };
  }, [alignment]);
  useEffect(() => {
    let drawn = '';
    const follower: Follower = {
      tick: (time_ns) => {
        const one = canvas.current;
        if (!one) return;
        // The picture that is seen counts, not the clock: it may be older by the time that a picture lasts, or while one is sought.
        const at_ns = player.isRecorded(time_ns) ? (original_ns ?? player.shown?.media_ns) : undefined;
        const [wide, high] = [one.clientWidth, one.clientHeight];
        const { videoWidth, videoHeight } = player.video;
        const now = [at_ns, wide, high, videoWidth, videoHeight].join();
        if (now === drawn) return;
        drawn = now;
        const found = at_ns === undefined ? undefined : organAt(alignment, at_ns);
        const laid = at_ns === undefined ? undefined : organShapeAt(alignment, at_ns);
        place.value = found;
        shape.value = laid;
        const departs = !fromPlan || at_ns === undefined ? undefined : departureAt(alignment, at_ns);
        departure.value = departs;
        why.value = at_ns === undefined || found?.is !== 'placed' ? undefined : whyRigid(alignment, at_ns);
        one.dataset['organ'] = laid ? 'deformed' : (found?.is ?? 'unknown');
        const context = prepared(one, wide, high);
        const size = at_ns === undefined ? undefined : pictureSizeAt(alignment, at_ns);
        if ((!laid && found?.is !== 'placed') || !drawing || !size) return;
        // A smaller picture stands in the middle of the viewing copy, which is as large as the stream's largest; an archived frame has the pane to itself.
        const outer = original_ns === undefined ? pictureBox(wide, high, videoWidth, videoHeight) : { left: 0, top: 0, width: wide, height: high };
        const inner = pictureBox(outer.width, outer.height, size.width, size.height);
        context.save();
        context.translate(outer.left + inner.left, outer.top + inner.top);
        context.beginPath();
        context.rect(0, 0, inner.width, inner.height);
        context.clip();
        const placed = laid ?? (found?.is === 'placed' ? atRest(found.camera, drawing.mesh.nodes.length / 3, found.error_mm) : undefined);
        if (typeof departs === 'object' && placed) {
          const mesh = displaced(drawing.mesh, placed);
          new OutlineDrawing(mesh).draw(context, placed.camera, alignment.field_deg, inner.width, inner.height, kLook, alignment.lens);
          drawColours(context, mesh, placed, alignment.field_deg, inner.width, inner.height, 1, alignment.lens, departs.shares);
        } else if (laid && fromPlan) {
          // Nothing can be said of a departure: the outline alone.
          new OutlineDrawing(displaced(drawing.mesh, laid)).draw(context, laid.camera, alignment.field_deg, inner.width, inner.height, kLook, alignment.lens);
        } else if (laid) {
          const mesh = displaced(drawing.mesh, laid);
          const top_mm = alignment.deformed?.scale_mm ?? laid.largest_mm;
          new OutlineDrawing(mesh).draw(context, laid.camera, alignment.field_deg, inner.width, inner.height, kLook, alignment.lens);
          drawColours(context, mesh, laid, alignment.field_deg, inner.width, inner.height, top_mm, alignment.lens);
        } else if (found?.is === 'placed') {
          drawing.outline.draw(context, found.camera, alignment.field_deg, inner.width, inner.height, kLook, alignment.lens);
        }
        context.restore();
      },
    };
    playback.followers.add(follower);
    return () => {
      playback.followers.delete(follower);
    };
  }, [alignment, fromPlan, drawing, player, playback, original_ns]);
  const found = place.value;
  const is = shape.value ? 'placed' : (found?.is ?? 'unknown');
  const departs = departure.value;
  const scale_mm = fromPlan
    ? typeof departs === 'object' && drawing && found?.is === 'placed' && alignment.departure?.scale_mm
    : shape.value && drawing && alignment.deformed?.scale_mm;
  // Here, so that they follow the language.
  const words =
    departs !== undefined
      ? departureText(departs)
      : shape.value
        ? shapeText(shape.value)
        : organText(found) + (why.value === undefined ? '' : ` · ${t('organ.stays', { why: word('organ.rigid', why.value) })}`);
  return (
    <div class="organ-over">
      <canvas ref={canvas} aria-hidden="true" />
      {typeof scale_mm === 'number' && <StressScale most={scale_mm} label={t(fromPlan ? 'organ.scalePlan' : 'organ.scale')} />}
      <p class={`organ-state organ-state-${is}`}>{words}</p>
    </div>
  );
}
