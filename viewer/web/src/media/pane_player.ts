// One video of a case, fed with pieces of viewing copy by Media Source Extensions. The media time line is the case clock in seconds. Owned by one
// Playback; closed once.
import { ApiError, cases } from '@/api/client';
import { type Span, spanAt } from '@/base/spans';
import { correction } from '@/clock/sync';
import { mimeTypeOf } from '@/media/mp4';
import { canShow, kHole_ns, kKeepAhead_ns, kKeepBehind_ns, kPiece_ns, pieceSpan, piecesAhead, wantedPieces } from '@/media/pieces';

/** What must lie ahead before a picture is taken for there; a piece is not waited for to its end. */
const kMargin_ns = 0.12e9;
const kParallelRequests = 2;
/** A frame's own time, as a fraction in binary, may fall just before it. */
const kIntoFrameSeconds = 0.0005;

export interface ShownFrame {
  media_ns: number;
  displayed_ms: number;
}

export class PanePlayer {
  readonly video: HTMLVideoElement;
  /** The newest frame that was put on the screen. */
  shown: ShownFrame | undefined;
  private readonly source = new MediaSource();
  private readonly address: string;
  private buffer: SourceBuffer | undefined;
  private readonly have = new Set<number>();
  private readonly queue: { piece: number; bytes: ArrayBuffer }[] = [];
  private readonly requests = new Map<number, AbortController>();
  private readonly closing = new AbortController();
  private position_ns: number;
  private rate = 1;
  private correcting = false;
  private retryAt_ms = 0;

  constructor(
    readonly caseId: string,
    readonly stream: string,
    readonly recorded: readonly Span[],
    begin_ns: number,
    private readonly end_ns: number,
    private readonly onProblem: (error: Error) => void,
  ) {
    this.position_ns = begin_ns;
    this.video = document.createElement('video');
    this.video.muted = true;
    this.video.playsInline = true;
    this.video.preload = 'auto';
    this.video.disablePictureInPicture = true;
    this.video.tabIndex = -1;
    this.address = URL.createObjectURL(this.source);
    this.source.addEventListener('sourceopen', () => void this.open(), { once: true });
    this.video.src = this.address;
    this.watchFrames();
  }

  close(): void {
    this.closing.abort();
    for (const request of this.requests.values()) request.abort();
    this.video.pause();
    this.video.removeAttribute('src');
    this.video.load();
    URL.revokeObjectURL(this.address);
  }

  /** Whether this stream has a picture at `time_ns`. */
  isRecorded(time_ns: number): boolean {
    return spanAt(this.recorded, time_ns) !== undefined;
  }

  /** Whether the picture of `time_ns` can be shown without waiting, or there is none. */
  isReady(time_ns: number): boolean {
    if (!canShow(time_ns, this.recorded, this.buffered(), kMargin_ns)) return false;
    return !this.isRecorded(time_ns) || (!this.video.seeking && this.video.readyState >= HTMLMediaElement.HAVE_CURRENT_DATA);
  }

  /** Shows `time_ns`, as soon as it is there. */
  seek(time_ns: number): void {
    this.position_ns = time_ns;
    for (const [piece, request] of this.requests) {
      const span = pieceSpan(piece);
      if (span.end_ns <= time_ns || span.start_ns > time_ns + 3 * kPiece_ns) request.abort();
    }
    if (this.isRecorded(time_ns)) this.video.currentTime = time_ns / 1e9 + kIntoFrameSeconds;
    this.correcting = false;
  }

  /** Called for each picture of the screen: keeps pieces coming, and the video at `time_ns`. */
  tick(time_ns: number, running: boolean, rate: number, now_ms: number): void {
    this.position_ns = time_ns;
    this.rate = rate;
    this.pump(now_ms);
    this.overHole(time_ns);
    const moving = running && this.isRecorded(time_ns);
    if (!moving) {
      if (!this.video.paused) this.video.pause();
      return;
    }
    if (this.video.seeking) return;
    const offset = this.video.currentTime - time_ns / 1e9;
    const what = correction(offset, rate, this.correcting);
    if (what.kind === 'seek') {
      this.video.currentTime = time_ns / 1e9;
      return;
    }
    this.correcting = what.rate !== rate;
    if (this.video.playbackRate !== what.rate) this.video.playbackRate = what.rate;
    if (this.video.paused) void this.video.play().catch(() => {}); // refused while a seek is under way: asked again with the next picture
  }

  /** Where the video itself stands, if it runs. */
  runningAt(): number | undefined {
    if (this.video.paused || this.video.seeking || this.video.readyState < HTMLMediaElement.HAVE_FUTURE_DATA) return undefined;
    return this.video.currentTime * 1e9;
  }

  private buffered(): Span[] {
    if (!this.buffer) return [];
    const ranges = this.buffer.buffered;
    return Array.from({ length: ranges.length }, (_, i) => ({ start_ns: ranges.start(i) * 1e9, end_ns: ranges.end(i) * 1e9 }));
  }

  /** A video that stands before a hole of up to a few frames, as where a stream begins between two pictures, is helped over it. */
  private overHole(time_ns: number): void {
    if (this.video.readyState >= HTMLMediaElement.HAVE_CURRENT_DATA || !this.isRecorded(time_ns)) return;
    const at_ns = this.video.currentTime * 1e9;
    const ranges = this.buffered();
    if (spanAt(ranges, at_ns)) return;
    const next = ranges.find((range) => range.start_ns > at_ns && range.start_ns - at_ns <= kHole_ns);
    if (next) this.video.currentTime = (next.start_ns + 1e6) / 1e9;
  }

  private async open(): Promise<void> {
    try {
      const init = await cases.init(this.caseId, this.stream, this.closing.signal);
      this.source.duration = this.end_ns / 1e9;
      this.buffer = this.source.addSourceBuffer(mimeTypeOf(new Uint8Array(init)));
      this.buffer.mode = 'segments';
      this.buffer.addEventListener('updateend', () => this.append());
      this.buffer.appendBuffer(init);
    } catch (error) {
      this.tell(error);
    }
  }

  private tell(error: unknown): void {
    if (!this.closing.signal.aborted && error instanceof Error) this.onProblem(error);
  }

  private pump(now_ms: number): void {
    if (!this.buffer || now_ms < this.retryAt_ms) return;
    const wanted = wantedPieces(this.position_ns, this.recorded, piecesAhead(this.rate), (piece) => this.have.has(piece));
    for (const piece of wanted) {
      if (this.requests.size >= kParallelRequests) break;
      if (!this.requests.has(piece)) void this.fetch(piece);
    }
  }

  private async fetch(piece: number): Promise<void> {
    const request = new AbortController();
    this.requests.set(piece, request);
    try {
      const bytes = await cases.piece(this.caseId, this.stream, piece, request.signal);
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

  private append(): void {
    if (!this.buffer || this.buffer.updating || this.source.readyState !== 'open' || this.closing.signal.aborted) return;
    if (this.evict()) return;
    const next = this.queue.shift();
    if (!next) return;
    try {
      this.buffer.appendBuffer(next.bytes);
    } catch (error) {
      this.have.delete(next.piece);
      if (!(error instanceof DOMException && error.name === 'QuotaExceededError')) this.tell(error);
    }
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
    this.buffer?.remove(Math.max(0, from_ns / 1e9), to_ns / 1e9);
    return true;
  }

  private watchFrames(): void {
    this.video.requestVideoFrameCallback((_, frame) => {
      this.shown = { media_ns: Math.round(frame.mediaTime * 1e9), displayed_ms: frame.expectedDisplayTime };
      if (!this.closing.signal.aborted) this.watchFrames();
    });
  }
}
