// What goes wrong while a room records, or records ahead: a stream that is silent, pictures that were lost. And when that shall be heard. Pure but for what it keeps.
import type { RoomStatus, StreamStatus } from '@/api/types';

/** A camera whose newest picture is older than this is silent. */
const kSilentVideo_ms = 3000;
/** Monitors speak once a few seconds. */
const kSilentVitals_ms = 10_000;

export type Trouble = { kind: 'silent'; room: string; stream: string; for_ms: number } | { kind: 'lost'; room: string; stream: string; pictures: number };

export const isSilent = (stream: StreamStatus): boolean => !stream.live || stream.age_ms >= (stream.kind === 'vitals' ? kSilentVitals_ms : kSilentVideo_ms);

/** Of a room that records, or records ahead: a case begins without what is silent there. In every other state nothing is missed. */
export function troublesOf(room: RoomStatus): Trouble[] {
  if (room.state !== 'recording' && room.state !== 'standby') return [];
  return room.streams.flatMap((stream): Trouble[] => [
    // In the first seconds of a case a source is still being opened.
    ...(isSilent(stream) && stream.age_ms >= kSilentVideo_ms ? [{ kind: 'silent' as const, room: room.room, stream: stream.name, for_ms: stream.age_ms }] : []),
    ...(stream.dropped > 0 ? [{ kind: 'lost' as const, room: room.room, stream: stream.name, pictures: stream.dropped }] : []),
  ]);
}

/** Silence that lasts is heard again so often. */
export const kAgain_ms = 10_000;

/** Decides when a sound is due: at once for what is new (a stream that falls silent, one more lost picture), now and then while silence lasts. */
export class AlertBell {
  private known = new Map<string, number>();
  private rang_ms = -Infinity;

  /** Whether to ring now. */
  hear(troubles: readonly Trouble[], now_ms: number): boolean {
    const measureOf = (one: Trouble) => (one.kind === 'lost' ? one.pictures : 1);
    const keyOf = (one: Trouble) => `${one.kind} ${one.room} ${one.stream}`;
    const isNew = troubles.some((one) => measureOf(one) > (this.known.get(keyOf(one)) ?? 0));
    const lasts = troubles.some((one) => one.kind === 'silent') && now_ms - this.rang_ms >= kAgain_ms;
    this.known = new Map(troubles.map((one) => [keyOf(one), measureOf(one)]));
    if (!isNew && !lasts) return false;
    this.rang_ms = now_ms;
    return true;
  }
}
