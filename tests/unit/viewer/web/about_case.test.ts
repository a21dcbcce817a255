import { describe, expect, it } from 'vitest';
import { aboutNow, canEnd, standingOf } from '@/rooms/about_case';

const room = (state: string, id = '', tries_again = false) => ({ state, case: id, tries_again });

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

describe('What can be ended', () => {
  it('is a case, or an operation that goes on by itself', () => {
    expect(['recording', 'closing'].every((state) => canEnd(room(state, 'A')))).toBe(true);
    expect(['idle', 'standby', 'starting'].some((state) => canEnd(room(state, 'A')))).toBe(false);
    expect(['idle', 'standby', 'starting'].every((state) => canEnd(room(state, 'A', true)))).toBe(true);
  });
});
