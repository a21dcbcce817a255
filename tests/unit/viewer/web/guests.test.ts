import { describe, expect, it } from 'vitest';
import { clockFace, Countdown, passedWarning } from '@/guests/countdown';
import { invitationLink } from '@/guests/guest_api';

describe('The time that an invitation lasts', () => {
  it('is counted down from what the server said', () => {
    const countdown = new Countdown(90, 1000);
    expect([1000, 1001, 61_000, 91_000, 1_000_000].map((now) => countdown.left_s(now))).toEqual([90, 90, 30, 0, 0]);
  });
  it('is shown as people read it', () => {
    expect([0, 9, 60, 3599, 3600, 3661].map(clockFace)).toEqual(['0:00', '0:09', '1:00', '59:59', '1:00:00', '1:01:01']);
  });
  it('is said aloud ten, five and one minute before the end, once each', () => {
    expect(passedWarning(601, 600)).toBe(10);
    expect(passedWarning(600, 599)).toBeUndefined();
    expect(passedWarning(302, 299)).toBe(5);
    expect(passedWarning(61, 60)).toBe(1);
    expect(passedWarning(60, 0)).toBeUndefined();
  });
});

describe('The link of an invitation', () => {
  it('is known by its form', () => {
    expect(invitationLink('#invitation=c2VjcmV0')).toBe('c2VjcmV0');
    for (const other of ['', '#/rooms', '#invitation=', '#sign-in=x']) expect(invitationLink(other)).toBeUndefined();
  });
});
