// Who looks on in a room and where they point: WS /api/live/ROOM (docs/reference/viewer.md, "Pointing"). Connects anew by itself until it is closed.
import { signal } from '@preact/signals';
import { live } from '@/api/client';
import { printableTexts } from '@/base/printable';
import { kSeen_ms, keyOf, type Pointer } from '@/pointing/pointers';

const kFirstRetry_ms = 500;
const kLongestRetry_ms = 8000;

export interface Watcher {
  name: string;
  role: string;
}

export interface LivePointer extends Pointer {
  /** By performance.now(). */
  came_ms: number;
}

export class Company {
  readonly watchers = signal<readonly Watcher[]>([]);
  /** The newest of each person and stream; changes with each that comes and when the last has faded. */
  readonly pointers = signal<readonly LivePointer[]>([]);
  private socket: WebSocket | undefined;
  private retry_ms = kFirstRetry_ms;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private sweep: ReturnType<typeof setTimeout> | undefined;
  private closed = false;

  constructor(private readonly room: string) {
    this.connect();
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
    clearTimeout(this.sweep);
    if (this.socket) {
      this.socket.onclose = this.socket.onmessage = this.socket.onopen = null;
      this.socket.close();
    }
  }

  /** Says where this person points, in case `about`; lost while there is no connection, and where another case runs by then. */
  point(about: string | undefined, stream: string, x: number, y: number, picture_ns: number | undefined): void {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    this.socket.send(JSON.stringify({ stream, x: Math.round(x * 1e4) / 1e4, y: Math.round(y * 1e4) / 1e4, picture_ns, case: about }));
  }

  private connect(): void {
    const socket = new WebSocket(live.companyAddress(this.room));
    socket.onopen = () => (this.retry_ms = kFirstRetry_ms);
    socket.onmessage = ({ data }: MessageEvent<string>) => {
      const said = JSON.parse(data, printableTexts) as { watchers?: Watcher[]; pointer?: Pointer };
      if (said.watchers) this.watchers.value = said.watchers;
      if (said.pointer) this.take(said.pointer);
    };
    socket.onclose = ({ code }) => {
      this.watchers.value = [];
      if (this.closed) return;
      live.closed(code);
      this.timer = setTimeout(() => this.connect(), this.retry_ms);
      this.retry_ms = Math.min(kLongestRetry_ms, 2 * this.retry_ms);
    };
    this.socket = socket;
  }

  private take(pointer: Pointer): void {
    const others = this.pointers.value.filter((one) => keyOf(one) !== keyOf(pointer));
    this.pointers.value = [...others, { ...pointer, came_ms: performance.now() }];
    this.sweepLater();
  }

  private sweepLater(): void {
    clearTimeout(this.sweep);
    this.sweep = setTimeout(() => {
      const now_ms = performance.now();
      this.pointers.value = this.pointers.value.filter((one) => now_ms - one.came_ms < kSeen_ms);
      if (this.pointers.value.length > 0) this.sweepLater();
    }, kSeen_ms);
  }
}
