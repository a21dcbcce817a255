// Which case a person's words are about, and whether they still can be: a room may go on to another case while somebody types. Pure functions.
import type { RoomStatus } from '@/api/types';

type Room = Pick<RoomStatus, 'state' | 'case' | 'tries_again'>;

/** Whether a person can begin a case. */
export const isIdle = (room: Room): boolean => room.state === 'idle' || room.state === 'standby';

/** The case that is recorded; '' where none is. */
export const recordedCase = (room: Room): string => (room.state === 'recording' ? room.case : '');

/** A case that is to begin, after the room's last one; or one that is recorded. */
export interface About {
  readonly begins: boolean;
  readonly case: string;
}

/** What a dialog is about that is opened now. */
export const aboutNow = (room: Room): About => ({ begins: recordedCase(room) === '', case: room.case });

/**
 * `began`, `recorded`: another case began, or was also ended, before this one did. `next`, `ended`: it has ended, and another is recorded, or none. `wait`: a
 * case is just beginning or being closed. `unheard`: nobody says what the room does now.
 */
export type Standing = 'stands' | 'began' | 'recorded' | 'next' | 'ended' | 'wait' | 'unheard';

/** `unheard`: `room` is what it last did, and may be over. */
export function standingOf(about: About, room: Room, unheard: boolean): Standing {
  if (unheard) return 'unheard';
  const recorded = recordedCase(room);
  if (about.begins) {
    if (recorded !== '') return 'began';
    if (!isIdle(room)) return 'wait';
    return room.case === about.case || room.case === '' ? 'stands' : 'recorded';
  }
  if (recorded === about.case) return 'stands';
  if (recorded !== '') return 'next';
  return isIdle(room) ? 'ended' : 'wait';
}

/** Whether there is a case to end, or an operation that goes on by itself with another one. A person's own case that is just beginning cannot be ended yet. */
export const canEnd = (room: Room): boolean => room.state === 'recording' || room.state === 'closing' || room.tries_again;

/** Whether ending it now ends such an operation, and no case. */
export const endsOperation = (room: Room): boolean => room.tries_again && room.state !== 'recording' && room.state !== 'closing';
