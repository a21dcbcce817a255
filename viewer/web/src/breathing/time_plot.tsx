// Curves over the moments of the time line, with the moment that is seen.
import { place } from '@/training/chart';

const kWidth = 320;
const kHeight = 120;
const kLeft = 44;
const kBottom = 16;
const kTop = 8;

export interface Curve {
  name: string;
  values: readonly (number | null)[];
  /** Seen, not computed: its values are single points, in the colour of the curve that has this place. */
  pointsOf?: number;
}

/** The polylines of a curve: it is broken where nothing is known. */
function parts(values: readonly (number | null)[], point: (i: number, value: number) => string): string[] {
  const lines: string[] = [];
  let line: string[] = [];
  values.forEach((value, i) => {
    if (value !== null) line.push(point(i, value));
    else if (line.length > 0) {
      lines.push(line.join(' '));
      line = [];
    }
  });
  if (line.length > 0) lines.push(line.join(' '));
  return lines;
}

export function TimePlot({
  title,
  unit,
  digits,
  times_s,
  end_s,
  curves,
  now_s,
  seek,
}: {
  title: string;
  unit: string;
  digits: number;
  times_s: readonly number[];
  end_s: number;
  curves: readonly Curve[];
  now_s: number;
  seek: (time_s: number) => void;
}) {
  const known = curves.flatMap(({ values }) => values.filter((one): one is number => one !== null));
  let least = Math.min(...known);
  let most = Math.max(...known);
  // Numbers at its ends can be told apart.
  const lacking = 10 ** (1 - digits) - (most - least);
  if (known.length === 0) [least, most] = [0, 1];
  else if (lacking > 0) [least, most] = [least - lacking / 2, most + lacking / 2];
  const begin_s = times_s[0] ?? 0;
  const x = (time_s: number) => place(time_s, begin_s, Math.max(end_s, begin_s + 1e-3), kLeft, kWidth - 4);
  const y = (value: number) => place(value, least, most, kHeight - kBottom, kTop);
  const shown = (value: number) => value.toFixed(digits);
  const at = (event: MouseEvent & { currentTarget: SVGSVGElement }) => {
    const box = event.currentTarget.getBoundingClientRect();
    const along = place(((event.clientX - box.left) / box.width) * kWidth, kLeft, kWidth - 4, begin_s, end_s);
    seek(Math.min(end_s, Math.max(begin_s, along)));
  };
  return (
    <figure class="lung-plot">
      <figcaption>
        {title}
        {curves.length > 1 && (
          <span class="lung-plot-names">
            {curves.map(
              ({ name, pointsOf }, i) =>
                pointsOf === undefined && (
                  <span key={name} class={`lung-curve-${i}`}>
                    {name}
                  </span>
                ),
            )}
          </span>
        )}
      </figcaption>
      <svg viewBox={`0 0 ${kWidth} ${kHeight}`} role="img" aria-label={title} onClick={at}>
        {[least, most].map((value) => (
          <g key={value}>
            <line class="lung-plot-line" x1={kLeft} x2={kWidth - 4} y1={y(value)} y2={y(value)} />
            {known.length > 0 && (
              <text x={kLeft - 4} y={y(value) + 4} text-anchor="end">
                {shown(value)}
              </text>
            )}
          </g>
        ))}
        <text x={kLeft} y={kHeight - 2}>
          {begin_s.toFixed(1)}
        </text>
        <text x={kWidth - 4} y={kHeight - 2} text-anchor="end">
          {end_s.toFixed(1)} s
        </text>
        <text x={kLeft - 4} y={kHeight / 2} text-anchor="end">
          {unit}
        </text>
        {curves.map(({ name, values, pointsOf }) =>
          pointsOf === undefined
            ? null
            : values.map((value, at) =>
                value === null ? null : (
                  <circle key={`${name}${at}`} class={`lung-curve-${pointsOf} lung-point`} cx={x(times_s[at] ?? 0)} cy={y(value)} r="2" />
                ),
              ),
        )}
        {curves.map(({ name, values, pointsOf }, i) =>
          pointsOf !== undefined
            ? null
            : parts(values, (at, value) => `${x(times_s[at] ?? 0).toFixed(1)},${y(value).toFixed(1)}`).map((points) =>
                points.includes(' ') ? (
                  <polyline key={name + points} class={`lung-curve-${i}`} points={points} />
                ) : (
                  <circle key={name + points} class={`lung-curve-${i}`} cx={points.split(',')[0]} cy={points.split(',')[1]} r="1.5" />
                ),
              ),
        )}
        <line class="lung-plot-now" x1={x(now_s)} x2={x(now_s)} y1={kTop - 4} y2={kHeight - kBottom} />
      </svg>
    </figure>
  );
}
