// The lane of the time line that says where the plan's organ was found in the pictures, and where it was sought and not found. Where nobody looked it is empty.
import type { OrganStretch } from '@/compare/organ_place';
import type { Span } from '@/base/spans';
import type { Colors } from '@/timeline/colors';
import { toPixel } from '@/timeline/scale';

type Hatch = (context: CanvasRenderingContext2D, x: number, y: number, width: number, height: number, color: string) => void;

export function drawOrgan(
  context: CanvasRenderingContext2D,
  stretches: readonly OrganStretch[],
  window: Span,
  width: number,
  top: number,
  height: number,
  colors: Colors,
  hatch: Hatch,
): void {
  // A lost picture is never hidden by found ones beside it, however far one looks at them from.
  const order = [...stretches.filter((one) => one.lost === undefined), ...stretches.filter((one) => one.lost !== undefined)];
  for (const { start_ns, end_ns, lost } of order) {
    const from = Math.max(-10, toPixel(start_ns, window, width));
    const to = Math.min(width + 10, toPixel(end_ns, window, width));
    if (to <= 0 || from >= width) continue;
    if (lost === undefined) {
      context.fillStyle = colors('lane-organ');
      context.fillRect(from, top, Math.max(1, to - from), height);
    } else {
      hatch(context, from, top, Math.max(2, to - from), height, colors('gap'));
    }
  }
}
