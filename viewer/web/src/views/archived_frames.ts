// Frames of the archive over the panes' viewing copies, until the clock goes on or elsewhere. Owned by the case view; closed once.
import { signal } from '@preact/signals';
import { cases as api } from '@/api/client';
import { formatTime } from '@/base/time';
import { t } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';
import { announce, attempt } from '@/shell/state';
import type { ArchivedFrame } from '@/views/pane';

export class ArchivedFrames {
  /** By stream. */
  readonly shown = signal<ReadonlyMap<string, ArchivedFrame>>(new Map());
  private shownAt_ns: number | undefined;
  private request: AbortController | undefined;
  private readonly stopWatching: () => void;

  constructor(
    private readonly id: string,
    private readonly playback: Playback,
  ) {
    this.stopWatching = playback.position_ns.subscribe((at_ns) => {
      if (this.shownAt_ns !== undefined && at_ns !== this.shownAt_ns) this.hide();
    });
  }

  close(): void {
    this.request?.abort();
    this.stopWatching();
  }

  /** In every pane: of the pane `leads` the frame at, before or after now, of the others what they showed then. */
  async show(leads: number, step: -1 | 0 | 1): Promise<void> {
    await attempt(async () => {
      const { playback } = this;
      playback.pause();
      this.request?.abort();
      const request = new AbortController();
      this.request = request;
      const leader = playback.panes[leads];
      if (!leader) return;
      const stands = this.shown.peek().get(leader.stream);
      const first = await this.frameOf(leader.stream, stands?.time_ns ?? playback.position_ns.peek(), step, request.signal);
      if (request.signal.aborted) return;
      this.shownAt_ns = undefined;
      playback.seek(first.time_ns);
      const frames = new Map([[leader.stream, first]]);
      for (const pane of playback.panes) {
        if (pane !== leader && pane.isRecorded(first.time_ns)) frames.set(pane.stream, await this.frameOf(pane.stream, first.time_ns, 0, request.signal));
      }
      if (request.signal.aborted) return;
      this.shownAt_ns = playback.position_ns.peek();
      this.shown.value = frames;
      announce(t('pane.original', { time: formatTime(first.time_ns - playback.clock.begin_ns, 3) }));
    });
  }

  toggle(leads: number): void {
    if (this.shown.peek().size > 0) this.hide();
    else void this.show(leads, 0);
  }

  private hide(): void {
    this.shownAt_ns = undefined;
    this.shown.value = new Map();
  }

  private async frameOf(stream: string, at_ns: number, step: -1 | 0 | 1, aborted: AbortSignal): Promise<ArchivedFrame> {
    const { time_ns, picture } = await api.frame(this.id, stream, at_ns, step, aborted);
    return { time_ns, picture: await createImageBitmap(picture) };
  }
}
