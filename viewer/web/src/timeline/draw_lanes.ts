// The lanes of the time line on a canvas: a ruler, what was recorded of each stream and what lacks, marks, alarms, and the proof of time.
import type { Alarm, ComparedStep, Stroke } from '@/api/types';
import type { Span } from '@/base/spans';
import { formatTime, kSecond } from '@/base/time';
import { drawOrgan } from '@/compare/draw_organ';
import type { OrganEpisode } from '@/compare/organ_place';
import { inOrderDone } from '@/compare/plan_map';
import { drawStrokes } from '@/pointing/draw_strokes';
import type { Colors } from '@/timeline/colors';
import { ticks, toPixel } from '@/timeline/scale';
import type { CaseModel } from '@/views/case_model';

export const kRuler = 24;
export const kLane = 20;
export const kMarkLane = 24;

export interface Lane {
  kind: 'ruler' | 'stream' | 'marks' | 'plan' | 'organ' | 'pointing' | 'alarms' | 'proof';
  stream?: string;
  top: number;
  height: number;
}

export function lanesOf(model: CaseModel, hasAlarms: boolean, hasPlan = false, hasPointing = false, hasOrgan = false): Lane[] {
  const lanes: Lane[] = [];
  let top = 0;
  const add = (kind: Lane['kind'], height: number, stream?: string) => {
    lanes.push(stream === undefined ? { kind, top, height } : { kind, top, height, stream });
    top += height;
  };
  add('ruler', kRuler);
  if (model.timeline.marks) add('marks', kMarkLane);
  if (hasPlan) add('plan', kMarkLane);
  if (hasOrgan) add('organ', kLane);
  if (hasPointing) add('pointing', kLane);
  for (const { name } of model.lanes) add('stream', kLane, name);
  if (hasAlarms) add('alarms', kLane);
  add('proof', kLane);
  return lanes;
}

function drawRuler(context: CanvasRenderingContext2D, model: CaseModel, window: Span, width: number, height: number, colors: Colors): void {
  const begin = model.whole.start_ns;
  const { times, step_ns } = ticks(window, begin, width, 92);
  context.font = '11px ui-monospace, "DejaVu Sans Mono", monospace';
  context.textBaseline = 'middle';
  for (const time of times) {
    const x = Math.round(toPixel(time, window, width)) + 0.5;
    context.strokeStyle = colors('line');
    context.beginPath();
    context.moveTo(x, kRuler - 6);
    context.lineTo(x, height);
    context.stroke();
    context.fillStyle = colors('muted');
    const text = formatTime(time - begin, step_ns < kSecond ? 1 : 0);
    const wide = context.measureText(text).width;
    context.fillText(text, Math.max(0, Math.min(width - wide, x - wide / 2)), 10);
  }
}

function hatch(context: CanvasRenderingContext2D, x: number, y: number, width: number, height: number, color: string): void {
  context.save();
  context.beginPath();
  context.rect(x, y, width, height);
  context.clip();
  context.strokeStyle = color;
  context.lineWidth = 1.5;
  for (let at = x - height - ((x - height) % 7); at < x + width; at += 7) {
    context.beginPath();
    context.moveTo(at, y + height);
    context.lineTo(at + height, y);
    context.stroke();
  }
  context.strokeRect(x + 0.5, y + 0.5, width - 1, height - 1);
  context.restore();
}

export function drawRuns(
  context: CanvasRenderingContext2D,
  model: CaseModel,
  stream: string,
  window: Span,
  width: number,
  top: number,
  height: number,
  colors: Colors,
): void {
  for (const run of model.recorded.get(stream) ?? []) {
    const from = Math.max(0, toPixel(run.start_ns, window, width));
    const to = Math.min(width, toPixel(run.end_ns, window, width));
    if (to <= 0 || from >= width) continue;
    context.fillStyle = colors(model.videos.some((one) => one.name === stream) ? 'lane-video' : 'lane-vitals');
    context.beginPath();
    context.roundRect(from, top, Math.max(1, to - from), height, 3);
    context.fill();
  }
  for (const gap of model.gaps.get(stream) ?? []) {
    const from = Math.max(-10, toPixel(gap.start_ns, window, width));
    const to = Math.min(width + 10, toPixel(gap.end_ns, window, width));
    if (to <= 0 || from >= width) continue;
    hatch(context, from, top, Math.max(2, to - from), height, colors('gap'));
  }
}

/** The joins of a stream's sealed segments, once they are wide enough to be told apart. */
function drawJoins(
  context: CanvasRenderingContext2D,
  model: CaseModel,
  stream: string,
  window: Span,
  width: number,
  top: number,
  height: number,
  colors: Colors,
): void {
  const pixels = (2 * kSecond * width) / (window.end_ns - window.start_ns);
  if (pixels < 10) return;
  context.fillStyle = colors('ground');
  for (const segment of model.timeline.segments) {
    if (segment.stream !== stream || segment.start_ns < window.start_ns || segment.start_ns > window.end_ns) continue;
    context.fillRect(Math.round(toPixel(segment.start_ns, window, width)), top, 1, height);
  }
}

function drawMarks(context: CanvasRenderingContext2D, model: CaseModel, window: Span, width: number, top: number, colors: Colors): void {
  context.font = '12px system-ui, "IPAGothic", sans-serif';
  context.textBaseline = 'middle';
  model.marks.forEach((mark, at) => {
    const x = toPixel(mark.time_ns, window, width);
    if (x < -200 || x > width + 8) return;
    context.fillStyle = colors('mark');
    context.beginPath();
    context.moveTo(x, top + 3);
    context.lineTo(x + 7, top + 3);
    context.lineTo(x + 4.5, top + 8);
    context.lineTo(x + 7, top + 13);
    context.lineTo(x + 1.5, top + 13);
    context.lineTo(x + 1.5, top + kMarkLane);
    context.lineTo(x, top + kMarkLane);
    context.fill();
    const next = model.marks[at + 1];
    const room = (next ? toPixel(next.time_ns, window, width) : width) - x - 16;
    if (room < 24) return;
    let text = mark.text;
    while (text.length > 1 && context.measureText(text).width > room) text = `${text.slice(0, -2)}…`;
    context.fillStyle = colors('text');
    context.fillText(text, x + 11, top + 9);
  });
}

/** The plan's steps where they were done, with their pauses. */
function drawSteps(
  context: CanvasRenderingContext2D,
  steps: readonly ComparedStep[],
  window: Span,
  width: number,
  top: number,
  height: number,
  colors: Colors,
): void {
  context.font = '12px system-ui, "IPAGothic", sans-serif';
  context.textBaseline = 'middle';
  for (const step of inOrderDone(steps)) {
    const from = Math.max(-10, toPixel(step.done.start_ns, window, width));
    const to = Math.min(width + 10, toPixel(step.done.end_ns, window, width));
    if (to <= 0 || from >= width) continue;
    context.fillStyle = colors('lane-plan');
    context.beginPath();
    context.roundRect(from + 1, top, Math.max(2, to - from - 2), height, 3);
    context.fill();
    for (const pause of step.done.pauses) {
      const begin = toPixel(pause.start_ns, window, width);
      hatch(context, begin, top, Math.max(2, toPixel(pause.end_ns, window, width) - begin), height, colors('text'));
    }
    const left = Math.max(0, from) + 7;
    const room = Math.min(width, to) - left - 5;
    let text = `${step.step}. ${step.name}`;
    while (text.length > 1 && context.measureText(text).width > room) text = `${text.slice(0, -2)}…`;
    if (room < 12) continue;
    context.fillStyle = colors('lane-plan-text');
    context.fillText(text, left, top + height / 2 + 0.5);
  }
}

function drawAlarms(
  context: CanvasRenderingContext2D,
  alarms: readonly Alarm[],
  window: Span,
  width: number,
  top: number,
  height: number,
  colors: Colors,
): void {
  for (const alarm of alarms) {
    const from = toPixel(alarm.start_ns, window, width);
    const to = toPixel(alarm.end_ns, window, width);
    if (to <= 0 || from >= width) continue;
    context.fillStyle = colors('alarm');
    // What may be of an earlier patient stands back.
    context.globalAlpha = alarm.questionable ? 0.35 : 1;
    context.beginPath();
    context.roundRect(from, top, Math.max(3, to - from), height, 3);
    context.fill();
    context.globalAlpha = 1;
  }
}

function drawProof(context: CanvasRenderingContext2D, model: CaseModel, window: Span, width: number, top: number, height: number, colors: Colors): void {
  model.timeline.brackets.forEach((bracket, at) => {
    const from = Math.max(0, toPixel(bracket.start_ns, window, width));
    const to = Math.min(width, toPixel(bracket.end_ns, window, width));
    if (to <= 0 || from >= width) return;
    context.fillStyle = colors(at % 2 === 0 ? 'bracket-a' : 'bracket-b');
    context.fillRect(from, top, Math.max(1, to - from), height);
  });
  for (const token of model.timeline.tokens) {
    const x = toPixel(token.time_ns, window, width);
    if (x < -6 || x > width + 6) continue;
    context.fillStyle = colors('token');
    context.beginPath();
    context.moveTo(x, top + 1);
    context.lineTo(x + 5, top + height / 2);
    context.lineTo(x, top + height - 1);
    context.lineTo(x - 5, top + height / 2);
    context.fill();
  }
}

export function drawLanes(
  context: CanvasRenderingContext2D,
  lanes: readonly Lane[],
  model: CaseModel,
  alarms: readonly Alarm[],
  steps: readonly ComparedStep[],
  organ: readonly OrganEpisode[],
  strokes: readonly Stroke[],
  window: Span,
  width: number,
  height: number,
  colors: Colors,
): void {
  drawRuler(context, model, window, width, height, colors);
  for (const lane of lanes) {
    const top = lane.top + 3;
    const high = lane.height - 6;
    switch (lane.kind) {
      case 'stream':
        drawRuns(context, model, lane.stream as string, window, width, top, high, colors);
        drawJoins(context, model, lane.stream as string, window, width, top, high, colors);
        break;
      case 'marks':
        drawMarks(context, model, window, width, lane.top, colors);
        break;
      case 'plan':
        drawSteps(context, steps, window, width, top, high, colors);
        break;
      case 'organ':
        drawOrgan(context, organ, window, width, top, high, colors, hatch);
        break;
      case 'pointing':
        drawStrokes(context, strokes, window, width, top, high, colors);
        break;
      case 'alarms':
        drawAlarms(context, alarms, window, width, top, high, colors);
        break;
      case 'proof':
        drawProof(context, model, window, width, top, high, colors);
        break;
      case 'ruler':
        break;
    }
  }
}
