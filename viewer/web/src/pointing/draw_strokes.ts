// The lane of the time line in which it stands who pointed when.
import type { Stroke } from '@/api/types';
import type { Span } from '@/base/spans';
import type { Colors } from '@/timeline/colors';
import { toPixel } from '@/timeline/scale';

const kLeast = 4;

export function drawStrokes(
  context: CanvasRenderingContext2D,
  strokes: readonly Stroke[],
  window: Span,
  width: number,
  top: number,
  height: number,
  colors: Colors,
): void {
  context.font = '12px system-ui, "IPAGothic", sans-serif';
  context.textBaseline = 'middle';
  const shown = strokes
    .map((stroke) => ({ stroke, from: toPixel(stroke.start_ns, window, width), to: toPixel(stroke.end_ns, window, width) }))
    .filter(({ from, to }) => to >= 0 && from <= width);
  for (const { from, to } of shown) {
    context.fillStyle = colors('token');
    context.beginPath();
    context.roundRect(from, top, Math.max(kLeast, to - from), height, 3);
    context.fill();
  }
  // A name behind each, as far as the next leaves room.
  shown.forEach(({ stroke, from, to }, at) => {
    const left = Math.max(0, Math.max(from + kLeast, to)) + 5;
    const room = (shown[at + 1]?.from ?? width) - left - 5;
    let text = stroke.by;
    while (text.length > 1 && context.measureText(text).width > room) text = `${text.slice(0, -2)}…`;
    if (room < 16) return;
    context.fillStyle = colors('text');
    context.fillText(text, left, top + height / 2 + 0.5);
  });
}
