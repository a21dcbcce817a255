// One track of a video, pictures or sound: asks for its pieces and keeps them in a SourceBuffer around the clock. Owned by one PanePlayer.
import { ApiError } from '@/api/client';
import type { Span } from '@/base/spans';
import { kHole_ns, kKeepAhead_ns, kKeepBehind_ns, kPiece_ns, pieceAt, pieceSpan, piecesAhead, wantedPieces } from '@/media/pieces';

const kParallelRequests = 2;

export class PieceFeed {
  private readonly have = new Set<number>();
  private readonly queue: { piece: number; bytes: ArrayBuffer }[] = [];
  private readonly requests = new Map<number, AbortController>();
  private position_ns = 0;
  private retryAt_ms = 0;
  private closed = false;

  constructor(
    private readonly source: MediaSource,
    private readonly buffer: SourceBuffer,
    init: ArrayBuffer,
    private readonly recorded: readonly Span[],
    private readonly get: (piece: number, signal: AbortSignal) => Promise<ArrayBuffer>,
    private readonly onProblem: (error: Error) => void,
  ) {
    buffer.mode = 'segments';
    buffer.addEventListener('updateend', () => this.append());
    buffer.appendBuffer(init);
  }

  close(): void {
    this.closed = true;
    for (const request of this.requests.values()) request.abort();
  }

  /** Whether all that there is of the piece at `time_ns` is in the buffer. */
  isThere(time_ns: number): boolean {
    const piece = pieceAt(time_ns);
    if (this.buffer.updating || this.queue.some((one) => one.piece === piece)) return false;
    return wantedPieces(time_ns, this.recorded, 1, (one) => one !== piece || this.have.has(one)).length === 0;
  }

  /**
   * Whether a browser would show something later at `time_ns`: a picture that begins a little after it is there before its own, and browsers take a hole of
   * some pictures for none.
   */
  isAheadOf(time_ns: number): boolean {
    return !this.isThere(time_ns) && this.buffered().some((one) => one.start_ns > time_ns && one.start_ns <= time_ns + kHole_ns);
  }

  /** Lets go of requests that are of no use at `time_ns`. */
  seek(time_ns: number): void {
    this.position_ns = time_ns;
    for (const [piece, request] of this.requests) {
      const span = pieceSpan(piece);
      if (span.end_ns <= time_ns || span.start_ns > time_ns + 3 * kPiece_ns) request.abort();
    }
  }

  /** Keeps pieces coming. */
  pump(position_ns: number, rate: number, now_ms: number): void {
    this.position_ns = position_ns;
    if (this.queue.length > 0) this.append();
    if (now_ms < this.retryAt_ms) return;
    const wanted = wantedPieces(position_ns, this.recorded, piecesAhead(rate), (piece) => this.have.has(piece));
    for (const piece of wanted) {
      if (this.requests.size >= kParallelRequests) break;
      if (!this.requests.has(piece)) void this.fetch(piece);
    }
  }

  buffered(): Span[] {
    const ranges = this.buffer.buffered;
    return Array.from({ length: ranges.length }, (_, i) => ({ start_ns: ranges.start(i) * 1e9, end_ns: ranges.end(i) * 1e9 }));
  }

  private async fetch(piece: number): Promise<void> {
    const request = new AbortController();
    this.requests.set(piece, request);
    try {
      const bytes = await this.get(piece, request.signal);
      this.queue.push({ piece, bytes });
      this.have.add(piece);
      this.append();
    } catch (error) {
      if (error instanceof ApiError && error.status === 404) {
        this.have.add(piece);
      } else if (!request.signal.aborted) {
        this.retryAt_ms = performance.now() + 2000;
        this.tell(error);
      }
    } finally {
      this.requests.delete(piece);
    }
  }

  private tell(error: unknown): void {
    if (!this.closed && error instanceof Error) this.onProblem(error);
  }

  private append(): void {
    if (this.closed || this.buffer.updating || this.source.readyState !== 'open') return;
    if (this.evict()) return;
    const next = this.next();
    if (!next) return;
    try {
      this.buffer.appendBuffer(next.bytes);
    } catch (error) {
      this.have.delete(next.piece);
      if (!(error instanceof DOMException && error.name === 'QuotaExceededError')) this.tell(error);
    }
  }

  /** The piece in which the clock stands goes in before all others: without it, what begins a little later would be shown in its place. */
  private next(): { piece: number; bytes: ArrayBuffer } | undefined {
    const stands = pieceAt(this.position_ns);
    const at = this.queue.findIndex((one) => one.piece === stands);
    if (at >= 0) return this.queue.splice(at, 1)[0];
    const [urgent] = wantedPieces(this.position_ns, this.recorded, 1, (piece) => this.have.has(piece));
    return urgent === stands ? undefined : this.queue.shift();
  }

  /** Gives back what lies far from the clock. True if that is under way. */
  private evict(): boolean {
    for (const range of this.buffered()) {
      const from_ns = Math.floor((this.position_ns - kKeepBehind_ns) / kPiece_ns) * kPiece_ns;
      const to_ns = Math.ceil((this.position_ns + kKeepAhead_ns) / kPiece_ns + 1) * kPiece_ns;
      if (range.start_ns < from_ns - kPiece_ns) return this.remove(range.start_ns, Math.min(from_ns, range.end_ns));
      if (range.end_ns > to_ns + kPiece_ns) return this.remove(Math.max(to_ns, range.start_ns), range.end_ns);
    }
    return false;
  }

  private remove(from_ns: number, to_ns: number): boolean {
    for (const piece of this.have) {
      const span = pieceSpan(piece);
      if (span.end_ns > from_ns && span.start_ns < to_ns) this.have.delete(piece);
    }
    this.buffer.remove(Math.max(0, from_ns / 1e9), to_ns / 1e9);
    return true;
  }
}
