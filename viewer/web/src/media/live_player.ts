// One stream while it is recorded: fragments over a WebSocket, shown by Media Source Extensions (docs/reference/viewer.md, "Live"). Connects anew by itself until it is
// closed. Its media time line is the case clock in seconds.
import { live } from '@/api/client';
import { LivePace } from '@/media/live_pace';

const kFirstRetry_ms = 500;
const kLongestRetry_ms = 8000;
/** Pictures behind the one that is shown are given back. */
const kKeepBehindSeconds = 4;
/** So much not taken by the decoder, and it is begun anew. */
const kMostWaiting = 250;
/** A picture older than this is not called live. */
export const kFresh_ms = 2000;

export class LivePlayer {
  readonly video: HTMLVideoElement;
  /** The newest picture on the screen: its time on the case clock and when it was shown, by performance.now(). */
  shown: { media_ns: number; displayed_ms: number } | undefined;
  connected = false;
  /** This browser has no decoder for what comes. */
  lacksCodec = false;
  private readonly address: string;
  private socket: WebSocket | undefined;
  private source: MediaSource | undefined;
  private buffer: SourceBuffer | undefined;
  private objectUrl = '';
  private queue: ArrayBuffer[] = [];
  private pace = new LivePace();
  private retry_ms = kFirstRetry_ms;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private closed = false;

  constructor(room: string, stream: string) {
    this.address = live.address(room, stream);
    this.video = document.createElement('video');
    this.video.muted = true;
    this.video.playsInline = true;
    this.video.disablePictureInPicture = true;
    this.video.tabIndex = -1;
    this.video.addEventListener('waiting', () => {
      if (!this.video.seeking && this.shown) this.pace.stalled(performance.now() / 1000);
    });
    this.video.addEventListener('error', () => this.reconnect());
    this.watchFrames();
    this.connect();
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
    this.disconnect();
    this.video.removeAttribute('src');
    this.video.load();
  }

  private connect(): void {
    const socket = new WebSocket(this.address);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => (this.connected = true);
    socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      if (typeof data === 'string') this.begin((JSON.parse(data) as { codecs: string }).codecs);
      else this.take(data);
    };
    socket.onclose = ({ code }) => {
      live.closed(code);
      this.reconnect();
    };
    this.socket = socket;
  }

  private disconnect(): void {
    this.connected = false;
    if (this.socket) {
      this.socket.onclose = this.socket.onmessage = this.socket.onopen = null;
      this.socket.close();
      this.socket = undefined;
    }
    this.end();
  }

  private reconnect(): void {
    if (this.closed) return;
    this.disconnect();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.connect(), this.retry_ms);
    this.retry_ms = Math.min(kLongestRetry_ms, 2 * this.retry_ms);
  }

  private end(): void {
    this.buffer = undefined;
    this.source = undefined;
    this.queue = [];
    if (this.objectUrl !== '') URL.revokeObjectURL(this.objectUrl);
    this.objectUrl = '';
  }

  /** A new case, or another form of picture: nothing of before is of use. */
  private begin(codecs: string): void {
    this.end();
    const type = `video/mp4; codecs="${codecs}"`;
    this.lacksCodec = !MediaSource.isTypeSupported(type);
    if (this.lacksCodec) return;
    const source = new MediaSource();
    this.source = source;
    this.pace = new LivePace();
    source.addEventListener(
      'sourceopen',
      () => {
        if (source !== this.source) return;
        source.duration = Infinity;
        const buffer = source.addSourceBuffer(type);
        buffer.addEventListener('updateend', () => this.follow(buffer));
        this.buffer = buffer;
        this.append();
      },
      { once: true },
    );
    this.objectUrl = URL.createObjectURL(source);
    this.video.src = this.objectUrl;
  }

  private take(bytes: ArrayBuffer): void {
    if (!this.source) return;
    this.queue.push(bytes);
    if (this.queue.length > kMostWaiting) this.reconnect();
    else this.append();
  }

  private append(): void {
    const { buffer, source } = this;
    if (!buffer || buffer.updating || source?.readyState !== 'open' || this.queue.length === 0) return;
    const bytes = new Uint8Array(this.queue.reduce((sum, one) => sum + one.byteLength, 0));
    let at = 0;
    for (const one of this.queue) {
      bytes.set(new Uint8Array(one), at);
      at += one.byteLength;
    }
    this.queue = [];
    try {
      buffer.appendBuffer(bytes);
    } catch {
      this.reconnect();
    }
  }

  /** After each picture that was added: the video stays close to the newest. */
  private follow(buffer: SourceBuffer): void {
    if (buffer !== this.buffer || this.closed) return;
    const { video } = this;
    const ranges = buffer.buffered;
    if (ranges.length > 0) {
      const newest = ranges.length - 1;
      const move = this.pace.step(video.currentTime, ranges.start(newest), ranges.end(newest), performance.now() / 1000);
      if (move.kind === 'seek') {
        if (!video.seeking) video.currentTime = move.to;
      } else if (video.playbackRate !== move.rate) {
        video.playbackRate = move.rate;
      }
      if (video.paused) void video.play().catch(() => {}); // refused while a seek is under way: asked again with the next picture
      const old = video.currentTime - kKeepBehindSeconds;
      // The event comes as a task of its own: a picture that came before it may be on its way already.
      if (!buffer.updating && this.queue.length === 0 && ranges.start(0) < old - kKeepBehindSeconds) {
        buffer.remove(0, old);
        return;
      }
    }
    this.append();
  }

  private watchFrames(): void {
    this.video.requestVideoFrameCallback((_, frame) => {
      this.shown = { media_ns: Math.round(frame.mediaTime * 1e9), displayed_ms: frame.expectedDisplayTime };
      this.retry_ms = kFirstRetry_ms;
      if (!this.closed) this.watchFrames();
    });
  }
}
