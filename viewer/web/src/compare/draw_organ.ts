// The lane of the time line that says where the plan's organ was found in the pictures, and where it was sought and not found. Where nobody looked it is empty.
import type { OrganEpisode } from '@/compare/organ_place';
import type { Span } from '@/base/spans';
import type { Colors } from '@/timeline/colors';
import { toPixel } from '@/timeline/scale';

type Hatch = (context: CanvasRenderingContext2D, x: number, y: number, width: number, height: number, color: string) => void;

export function drawOrgan(
  context: CanvasRenderingContext2D,
  episodes: readonly OrganEpisode[],
  window: Span,
  width: number,
  top: number,
  height: number,
  colors: Colors,
  hatch: Hatch,
): void {
  // A lost picture is never hidden by found ones beside it, however far one looks at them from.
  const order = [...episodes.filter((one) => one.whys.length === 0), ...episodes.filter((one) => one.whys.length > 0)];
  for (const { start_ns, end_ns, whys } of order) {
    const from = Math.max(-10, toPixel(start_ns, window, width));
    const to = Math.min(width + 10, toPixel(end_ns, window, width));
    if (to <= 0 || from >= width) continue;
    if (whys.length === 0) {
      context.fillStyle = colors('lane-organ');
      context.fillRect(from, top, Math.max(1, to - from), height);
    } else {
      hatch(context, from, top, Math.max(2, to - from), height, colors('gap'));
    }
  }
}
