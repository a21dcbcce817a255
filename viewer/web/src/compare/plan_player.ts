// The plan's film on the case clock, by the comparison's time map. Owned by one view; closed once.
import { cases } from '@/api/client';
import { correction } from '@/clock/sync';
import { planAt, type PlanMap } from '@/compare/plan_map';
import type { Follower } from '@/media/playback';

/** Browsers play no slower and no faster. */
const kSlowest = 0.0625;
const kFastest = 16;
/** Into the picture that begins at a time, as a fraction of a second; a picture of a plan lasts far longer. */
const kIntoPictureSeconds = 0.002;

export class PlanPlayer implements Follower {
  readonly video: HTMLVideoElement;
  private address: string | undefined;
  private readonly closing = new AbortController();
  private correcting = false;

  constructor(
    caseId: string,
    name: string,
    film: 'replay' | 'radiographs',
    private map: PlanMap,
    private readonly onProblem: (error: Error) => void,
  ) {
    this.video = document.createElement('video');
    this.video.muted = true;
    this.video.playsInline = true;
    this.video.preload = 'auto';
    this.video.disablePictureInPicture = true;
    this.video.tabIndex = -1;
    void this.open(caseId, name, film);
  }

  close(): void {
    this.closing.abort();
    this.video.pause();
    this.video.removeAttribute('src');
    this.video.load();
    if (this.address !== undefined) URL.revokeObjectURL(this.address);
  }

  /** Goes by another map of the same plan from now on. */
  follow(map: PlanMap): void {
    this.map = map;
  }

  /** Called for each picture of the screen. */
  tick(time_ns: number, running: boolean, rate: number): void {
    const { video } = this;
    if (video.readyState < HTMLMediaElement.HAVE_METADATA || video.seeking) return;
    const { plan_s, speed } = planAt(this.map, time_ns);
    const wanted_s = Math.min(plan_s + kIntoPictureSeconds, video.duration);
    const its_rate = rate * speed;
    const offset = video.currentTime - wanted_s;
    if (!running || its_rate < kSlowest || its_rate > kFastest) {
      if (!video.paused) video.pause();
      if (Math.abs(offset) > kIntoPictureSeconds) video.currentTime = wanted_s;
      return;
    }
    const what = correction(offset / Math.max(1, speed), its_rate, this.correcting);
    if (what.kind === 'seek') {
      video.currentTime = wanted_s;
      return;
    }
    this.correcting = what.rate !== its_rate;
    const its = Math.max(kSlowest, Math.min(kFastest, what.rate));
    if (video.playbackRate !== its) video.playbackRate = its;
    if (video.paused) void video.play().catch(() => {}); // refused while a seek is under way: asked again with the next picture
  }

  private async open(caseId: string, name: string, film: 'replay' | 'radiographs'): Promise<void> {
    try {
      // Whole: it is small, and then goes back and forth without asking.
      const bytes = await cases.planFilm(caseId, name, film, this.closing.signal);
      if (this.closing.signal.aborted) return;
      this.address = URL.createObjectURL(bytes);
      this.video.src = this.address;
    } catch (error) {
      if (!this.closing.signal.aborted && error instanceof Error) this.onProblem(error);
    }
  }
}
