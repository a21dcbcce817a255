// A case as its view needs it: what the server told, in order and by stream. Pure.
import type { CaseInfo, Gap, Mark, StreamInfo, Timeline } from '@/api/types';
import { merged, type Span } from '@/base/spans';

/** Segments of one stream that lie no further apart than this are one stretch: a hole is stated as a gap. */
const kJoin_ns = 0.1e9;

export interface CaseModel {
  info: CaseInfo;
  timeline: Timeline;
  whole: Span;
  videos: StreamInfo[];
  /** Streams with a lane of their own. */
  lanes: StreamInfo[];
  recorded: ReadonlyMap<string, Span[]>;
  gaps: ReadonlyMap<string, Gap[]>;
  /** Of all streams: the sound beside their pictures is missing. */
  soundGaps: Gap[];
  marks: Mark[];
}

export function caseModel(info: CaseInfo, timeline: Timeline): CaseModel {
  const recorded = new Map<string, Span[]>();
  const gaps = new Map<string, Gap[]>();
  for (const { name } of info.streams) {
    const segments = timeline.segments.filter((one) => one.stream === name);
    recorded.set(
      name,
      merged(
        segments.filter((one) => !one.erased),
        kJoin_ns,
      ),
    );
    const erased = merged(
      segments.filter((one) => one.erased),
      kJoin_ns,
    ).map((span) => ({ ...span, stream: name, cause: 'erased', of_sound: false }));
    gaps.set(
      name,
      [...timeline.gaps.filter((one) => one.stream === name && !one.of_sound), ...erased].sort((a, b) => a.start_ns - b.start_ns),
    );
  }
  // One by one: a call takes no more than some 120,000 arguments, and a case of days has more segments.
  const lastEnd = timeline.segments.reduce((last, one) => Math.max(last, one.end_ns), Math.max(info.begins_ns + info.duration_ns, info.begins_ns + 1e9));
  return {
    info,
    timeline,
    whole: { start_ns: info.begins_ns, end_ns: lastEnd },
    videos: info.streams.filter((one) => one.kind === 'video'),
    lanes: info.streams.filter((one) => one.kind !== 'events'),
    recorded,
    gaps,
    soundGaps: timeline.gaps.filter((one) => one.of_sound),
    marks: [...(timeline.marks ?? [])].sort((a, b) => a.time_ns - b.time_ns),
  };
}

/** One line of the list of moments. */
export interface Moment {
  kind: 'mark' | 'alarm' | 'gap' | 'token' | 'notice';
  time_ns: number;
  text: string;
  detail: string;
}

/** What the machine's wall clock showed at `time_ns`: by the case's opening, and each time that it was set since. */
export function wallClock(info: CaseInfo, time_ns: number): Date {
  const set_ns = info.clock_steps.filter((step) => step.time_ns <= time_ns).reduce((sum, step) => sum + step.step_ns, 0);
  return new Date(Date.parse(info.opened) + (time_ns - info.opened_ns + set_ns) / 1e6);
}
