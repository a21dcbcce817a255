// Which pieces of viewing copy a pane wants. A piece covers [K * 2 s, (K + 1) * 2 s) of the case clock.
import { type Span, spanAt } from '@/base/spans';

export const kPiece_ns = 2e9;
/** How far behind and ahead of the clock pieces are kept; the rest is given back to the browser. */
export const kKeepBehind_ns = 20e9;
export const kKeepAhead_ns = 60e9;

/** A hole between pictures that is none: a frame of 5 a second. */
export const kHole_ns = 0.2e9;

export const pieceAt = (time_ns: number): number => Math.floor(time_ns / kPiece_ns);
export const pieceSpan = (piece: number): Span => ({ start_ns: piece * kPiece_ns, end_ns: (piece + 1) * kPiece_ns });

const overlaps = (recorded: readonly Span[], span: Span): boolean => recorded.some((one) => one.start_ns < span.end_ns && span.start_ns < one.end_ns);

/**
 * The pieces from `time_ns` on that are wanted, the most urgent first: `ahead` of them that hold something, within what is kept. `recorded` are the
 * stream's recorded stretches; `have` says which pieces are there (or known to be empty).
 */
export function wantedPieces(time_ns: number, recorded: readonly Span[], ahead: number, have: (piece: number) => boolean): number[] {
  const wanted: number[] = [];
  const first = pieceAt(time_ns);
  let seen = 0;
  for (let piece = first; seen < ahead && piece * kPiece_ns < time_ns + kKeepAhead_ns; ++piece) {
    if (!overlaps(recorded, pieceSpan(piece))) continue;
    ++seen;
    if (!have(piece)) wanted.push(piece);
  }
  return wanted;
}

/** How many pieces are asked for ahead of the clock: more at speed. */
export const piecesAhead = (rate: number): number => Math.min(16, Math.ceil(3 * Math.max(1, rate)));

/**
 * Whether a pane can show `time_ns`: yes where nothing was recorded, else only if `buffered` covers it and what follows for `margin_ns`, or as far as
 * was recorded. At borders and joins a hole of kHole_ns may be.
 */
export function canShow(time_ns: number, recorded: readonly Span[], buffered: readonly Span[], margin_ns: number): boolean {
  const stretch = spanAt(recorded, time_ns);
  if (!stretch) return true;
  const until_ns = Math.min(time_ns + margin_ns, stretch.end_ns - kHole_ns);
  const from_ns = Math.max(time_ns, stretch.start_ns);
  return buffered.some((one) => one.start_ns - kHole_ns <= from_ns && (one.end_ns >= until_ns || one.end_ns >= stretch.end_ns - kHole_ns));
}
