import { describe, expect, it } from 'vitest';
import { type About, aboutNow, canEnd, endsOperation, standingOf as standing } from '@/rooms/about_case';

const room = (state: string, id = '', tries_again = false) => ({ state, case: id, tries_again });
const standingOf = (about: About, now: ReturnType<typeof room>) => standing(about, now, false);

describe('What a dialog is about', () => {
  it('is the case that is recorded, or one that is to begin', () => {
    expect(aboutNow(room('recording', 'A'))).toEqual({ begins: false, case: 'A' });
    for (const state of ['idle', 'standby', 'starting', 'closing']) expect(aboutNow(room(state, 'A'))).toEqual({ begins: true, case: 'A' });
  });
  it('is that one as long as it is recorded, and never becomes another by itself', () => {
    const about = aboutNow(room('recording', 'A'));
    expect(standingOf(about, room('recording', 'A'))).toBe('stands');
    expect(standingOf(about, room('closing', 'A'))).toBe('wait');
    expect(standingOf(about, room('idle', 'A'))).toBe('ended');
    expect(standingOf(about, room('starting', 'A'))).toBe('wait');
    expect(standingOf(about, room('recording', 'B'))).toBe('next');
    expect(standingOf(about, room('standby', 'B'))).toBe('ended');
  });
  it('is a beginning only while nothing began meanwhile', () => {
    const about = aboutNow(room('idle', 'A'));
    expect(standingOf(about, room('standby', 'A'))).toBe('stands');
    expect(standingOf(about, room('starting', 'A'))).toBe('wait');
    expect(standingOf(about, room('recording', 'B'))).toBe('began');
    expect(standingOf(about, room('closing', 'B'))).toBe('wait');
    expect(standingOf(about, room('idle', 'B'))).toBe('recorded');
    expect(standingOf(aboutNow(room('idle')), room('recording', 'B'))).toBe('began');
    // What was to be carried on is not any more.
    expect(standingOf(about, room('idle'))).toBe('stands');
  });
});

describe('While nobody says what the room does', () => {
  it('nothing stands, and nothing has changed either', () => {
    for (const about of [aboutNow(room('recording', 'A')), aboutNow(room('idle', 'A'))])
      for (const state of ['idle', 'standby', 'starting', 'recording', 'closing'])
        for (const id of ['A', 'B']) expect(standing(about, room(state, id), true)).toBe('unheard');
  });
});

describe('What can be ended', () => {
  it('is a case, or an operation that goes on by itself', () => {
    expect(['recording', 'closing'].every((state) => canEnd(room(state, 'A')))).toBe(true);
    expect(['idle', 'standby', 'starting'].some((state) => canEnd(room(state, 'A')))).toBe(false);
    expect(['idle', 'standby', 'starting'].every((state) => canEnd(room(state, 'A', true)))).toBe(true);
  });
  it('is the operation only where it goes on by itself and no case runs', () => {
    for (const state of ['idle', 'standby', 'starting']) expect(endsOperation(room(state, 'A', true))).toBe(true);
    for (const state of ['recording', 'closing']) expect(endsOperation(room(state, 'A', true))).toBe(false);
    // The case ended by itself while it was asked about: there is no operation to speak of.
    for (const state of ['idle', 'standby', 'starting', 'recording', 'closing']) expect(endsOperation(room(state, 'A'))).toBe(false);
  });
});
