// One video of a case, fed with pieces of viewing copy by Media Source Extensions. The media time line is the case clock in seconds. Owned by one
// Playback; closed once.
import { signal } from '@preact/signals';
import { cases } from '@/api/client';
import { common, type Span, spanAt } from '@/base/spans';
import { correction } from '@/clock/sync';
import { mimeTypeOf } from '@/media/mp4';
import { isHeardAt, PaneSound } from '@/media/pane_sound';
import { PieceFeed } from '@/media/piece_feed';
import { canShow, kHole_ns } from '@/media/pieces';

/** What must lie ahead before a picture is taken for there; a piece is not waited for to its end. */
const kMargin_ns = 0.12e9;
/** A frame's own time, as a fraction in binary, may fall just before it. */
const kIntoFrameSeconds = 0.0005;

/** The browser lacks the codec, or could not decode what came. */
export type Failure = 'codec' | 'decoding';

export interface ShownFrame {
  media_ns: number;
  displayed_ms: number;
}

export class PanePlayer {
  readonly video: HTMLVideoElement;
  /** The newest frame that was put on the screen. */
  shown: ShownFrame | undefined;
  readonly sound: PaneSound;
  /** Why the browser shows no picture of this stream at all. */
  readonly failure = signal<Failure | undefined>(undefined);
  private readonly source = new MediaSource();
  private readonly address: string;
  private feeds: PieceFeed[] = [];
  private readonly closing = new AbortController();
  private correcting = false;
  /** Where the video goes as soon as its piece is there: what is there already would be shown in its place. */
  private target_ns: number | undefined;
  /** Until somebody did something on the page, a browser plays nothing that is heard. */
  private mayBeHeard = true;

  constructor(
    readonly caseId: string,
    readonly stream: string,
    readonly recorded: readonly Span[],
    private readonly end_ns: number,
    private readonly onProblem: (error: Error) => void,
  ) {
    this.sound = new PaneSound(stream);
    this.video = document.createElement('video');
    this.video.muted = true;
    this.video.playsInline = true;
    this.video.preload = 'auto';
    this.video.disablePictureInPicture = true;
    this.video.tabIndex = -1;
    this.address = URL.createObjectURL(this.source);
    this.source.addEventListener('sourceopen', () => void this.open(), { once: true });
    this.video.addEventListener('error', () => {
      if (!this.closing.signal.aborted) this.failure.value ??= 'decoding';
    });
    this.video.src = this.address;
    this.watchFrames();
  }

  close(): void {
    this.closing.abort();
    for (const feed of this.feeds) feed.close();
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
    if (this.failure.peek()) return true;
    if (this.target_ns !== undefined || !canShow(time_ns, this.recorded, this.buffered(), kMargin_ns)) return false;
    return !this.isRecorded(time_ns) || (!this.video.seeking && this.video.readyState >= HTMLMediaElement.HAVE_CURRENT_DATA);
  }

  /** Shows `time_ns`, as soon as it is there. */
  seek(time_ns: number): void {
    for (const feed of this.feeds) feed.seek(time_ns);
    this.target_ns = this.isRecorded(time_ns) ? time_ns : undefined;
    this.goToTarget();
    this.correcting = false;
  }

  private goToTarget(): void {
    if (this.target_ns === undefined || this.feeds.some((feed) => feed.isAheadOf(this.target_ns as number))) return;
    this.video.currentTime = this.target_ns / 1e9 + kIntoFrameSeconds;
    this.target_ns = undefined;
  }

  /** Called for each picture of the screen: keeps pieces coming, and the video at `time_ns`. */
  tick(time_ns: number, running: boolean, rate: number, now_ms: number): void {
    if (this.failure.peek()) return;
    for (const feed of this.feeds) feed.pump(time_ns, rate, now_ms);
    this.hear(rate);
    this.goToTarget();
    this.overHole(time_ns);
    const moving = running && this.isRecorded(time_ns);
    if (!moving) {
      if (!this.video.paused) this.video.pause();
      return;
    }
    if (this.video.seeking || this.target_ns !== undefined) return;
    const offset = this.video.currentTime - time_ns / 1e9;
    const what = correction(offset, rate, this.correcting);
    if (what.kind === 'seek') {
      this.video.currentTime = time_ns / 1e9;
      return;
    }
    this.correcting = what.rate !== rate;
    if (this.video.playbackRate !== what.rate) this.video.playbackRate = what.rate;
    if (this.video.paused) {
      // Refused while a seek is under way: asked again with the next picture.
      void this.video.play().catch((error: unknown) => {
        if (error instanceof DOMException && error.name === 'NotAllowedError') this.mayBeHeard = false;
      });
    }
  }

  private hear(rate: number): void {
    if (navigator.userActivation.hasBeenActive) this.mayBeHeard = true;
    const muted = !this.sound.isThere.peek() || this.sound.muted.peek() || !isHeardAt(rate) || !this.mayBeHeard;
    if (this.video.muted !== muted) this.video.muted = muted;
    const volume = this.sound.volume.peek();
    if (this.video.volume !== volume) this.video.volume = volume;
  }

  /** Where the video itself stands, if it runs. */
  runningAt(): number | undefined {
    if (this.failure.peek() || this.video.paused || this.video.seeking || this.video.readyState < HTMLMediaElement.HAVE_FUTURE_DATA) return undefined;
    return this.video.currentTime * 1e9;
  }

  /** Where all tracks are. */
  private buffered(): Span[] {
    return this.feeds.length === 0 ? [] : this.feeds.map((feed) => feed.buffered()).reduce(common);
  }

  /** A video that stands before a hole of up to a few frames, as where a stream begins between two pictures, is helped over it. */
  private overHole(time_ns: number): void {
    if (this.video.readyState >= HTMLMediaElement.HAVE_CURRENT_DATA || !this.isRecorded(time_ns)) return;
    const at_ns = this.video.currentTime * 1e9;
    if (!this.feeds.every((feed) => feed.isThere(at_ns))) return;
    const ranges = this.buffered();
    if (spanAt(ranges, at_ns)) return;
    const next = ranges.find((range) => range.start_ns > at_ns && range.start_ns - at_ns <= kHole_ns);
    if (next) this.video.currentTime = (next.start_ns + 1e6) / 1e9;
  }

  private async open(): Promise<void> {
    try {
      const { signal } = this.closing;
      // A browser takes no track more once it knows of one: whether there is sound must be known before.
      const [init, sound] = await Promise.all([cases.init(this.caseId, this.stream, signal), this.soundInit(signal)]);
      this.source.duration = this.end_ns / 1e9;
      const type = mimeTypeOf(new Uint8Array(init));
      if (!MediaSource.isTypeSupported(type)) {
        this.failure.value = 'codec';
        return;
      }
      const pictures = this.source.addSourceBuffer(type);
      const beside = sound && this.source.addSourceBuffer(sound.type);
      const tell = (error: unknown) => this.tell(error);
      this.feeds = [new PieceFeed(this.source, pictures, init, this.recorded, (piece, aborted) => cases.piece(this.caseId, this.stream, piece, aborted), tell)];
      if (beside) {
        this.feeds.push(
          new PieceFeed(this.source, beside, sound.init, this.recorded, (piece, aborted) => cases.soundPiece(this.caseId, this.stream, piece, aborted), tell),
        );
      }
      this.sound.isThere.value = beside !== undefined;
    } catch (error) {
      this.tell(error);
    }
  }

  /** Nothing for a stream without sound, with one that this browser does not play, or that cannot be had, which is told: the pictures are shown all the same. */
  private async soundInit(signal: AbortSignal): Promise<{ type: string; init: ArrayBuffer } | undefined> {
    try {
      const codecs = await cases.sound(this.caseId, this.stream, signal);
      const type = `audio/mp4; codecs="${codecs}"`;
      if (codecs === null || !MediaSource.isTypeSupported(type)) return undefined;
      return { type, init: await cases.soundInit(this.caseId, this.stream, signal) };
    } catch (error) {
      this.tell(error);
      return undefined;
    }
  }

  private tell(error: unknown): void {
    if (!this.closing.signal.aborted && error instanceof Error) this.onProblem(error);
  }

  private watchFrames(): void {
    this.video.requestVideoFrameCallback((_, frame) => {
      this.shown = { media_ns: Math.round(frame.mediaTime * 1e9), displayed_ms: frame.expectedDisplayTime };
      if (!this.closing.signal.aborted) this.watchFrames();
    });
  }
}
