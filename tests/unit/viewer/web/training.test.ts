import { describe, expect, it } from 'vitest';
import { countTicks, place, scaleTo } from '@/training/chart';
import { Median } from '@/base/median';
import { splitPicture } from '@/media/picture_message';
import { beyondDeadZone, firstPad, GamepadHand, kDeadZone, type Pad } from '@/training/gamepad';
import { type BrowserPointer, kMostPush_m, Pointers } from '@/training/pointers';

const at = (id: number, kind: BrowserPointer['kind'], x = 0.5, y = 0.5, pressure = 0): BrowserPointer => ({ id, kind, x, y, pressure });
const fingersOf = (pointers: Pointers) => pointers.pointers.map((one) => one.finger);

describe('Pointers', () => {
  it('of a mouse move the whole hand, or the one finger there is', () => {
    const hand = new Pointers(3);
    expect(hand.press(at(1, 'mouse'))).toBe(true);
    expect(fingersOf(hand)).toEqual([0]);
    expect(hand.press(at(2, 'touch'))).toBe(false);
    const one = new Pointers(1);
    one.press(at(1, 'mouse'));
    expect(fingersOf(one)).toEqual([1]);
  });
  it('of touches are fingers, as many as there are, and those that were lifted are free again', () => {
    const hand = new Pointers(3);
    for (const id of [10, 11, 12]) expect(hand.press(at(id, 'touch'))).toBe(true);
    expect(hand.press(at(13, 'touch'))).toBe(false);
    expect(fingersOf(hand)).toEqual([1, 2, 3]);
    hand.release(11);
    expect(hand.press(at(14, 'touch', 0.2, 0.3))).toBe(true);
    expect(fingersOf(hand).sort()).toEqual([1, 2, 3]);
    hand.releaseAll();
    expect(hand.pointers).toEqual([]);
  });
  it('follow what they belong to, and stay near the picture', () => {
    const hand = new Pointers(2);
    hand.press(at(1, 'mouse', 0.5, 0.6));
    expect(hand.move(at(9, 'mouse', 0, 0))).toBe(false);
    hand.move(at(1, 'mouse', 40, -40));
    expect(hand.pointers).toEqual([{ finger: 0, x: 1.5, y: -0.5, push_m: 0 }]);
  });
  it('are pushed by the wheel and by a pen, never beyond what the trainer takes', () => {
    const hand = new Pointers(2);
    expect(hand.wheel(-100)).toBe(false);
    hand.press(at(1, 'mouse'));
    hand.wheel(-100);
    expect(hand.pointers[0]?.push_m).toBeCloseTo(0.005);
    hand.wheel(-1e9);
    expect(hand.pointers[0]?.push_m).toBe(kMostPush_m);
    hand.release(1);
    hand.press(at(2, 'pen', 0.5, 0.5, 1));
    expect(hand.pointers[0]?.push_m).toBeCloseTo(0.03);
  });
  it('of keys take hold, move, push and let go', () => {
    const hand = new Pointers(3);
    for (const key of [' ', 'ArrowUp', 'ArrowUp', 'ArrowRight', 'PageUp']) expect(hand.key(key, false)).toBe(true);
    expect(hand.pointers).toEqual([{ finger: 0, x: 0.505, y: 0.65, push_m: 0.002 }]);
    hand.key('2', false);
    expect(fingersOf(hand)).toEqual([2]);
    expect(hand.key('4', false)).toBe(false);
    expect(hand.key('a', false)).toBe(false);
    hand.key(' ', false);
    expect(hand.pointers).toEqual([]);
    hand.key(' ', false);
    expect(hand.pointers[0]?.push_m).toBe(0);
  });
});

describe('A moment', () => {
  it('is its numbers and its picture', async () => {
    const head = new TextEncoder().encode('{"picture":3,"input":2}');
    const message = new Uint8Array([head.length, 0, 0, 0, ...head, 0xff, 0xd8, 0xff]);
    const { about: moment, jpeg } = splitPicture(message.buffer);
    expect(moment).toEqual({ picture: 3, input: 2 });
    expect([...new Uint8Array(await jpeg.arrayBuffer())]).toEqual([0xff, 0xd8, 0xff]);
  });
});

describe('A chart', () => {
  it('goes from nought to a round number in few steps', () => {
    expect(scaleTo(87).ticks).toEqual([0, 50, 100]);
    expect(scaleTo(40).ticks).toEqual([0, 10, 20, 30, 40]);
    expect(scaleTo(0.9).ticks).toEqual([0, 0.5, 1]);
    expect(scaleTo(0).most).toBe(1);
    expect(scaleTo(Number.NaN).most).toBe(1);
  });
  it('names eight sessions at most', () => {
    expect(countTicks(3)).toEqual([1, 2, 3]);
    expect(countTicks(20)).toEqual([1, 4, 7, 10, 13, 16, 19]);
  });
  it('puts numbers in their places', () => {
    expect(place(5, 0, 10, 100, 0)).toBe(50);
    expect(place(3, 3, 3, 10, 20)).toBe(10);
  });
});

describe('The median', () => {
  it('is of the newest', () => {
    const median = new Median(3);
    expect(median.value).toBeUndefined();
    for (const time of [100, 1, 2, 3]) median.add(time);
    expect(median.value).toBe(2);
  });
});

describe('A gamepad', () => {
  const pad = (axes: number[], pressed: Record<number, number> = {}): Pad => ({
    axes,
    buttons: Array.from({ length: 17 }, (_, i) => ({ pressed: (pressed[i] ?? 0) > 0.5, value: pressed[i] ?? 0 })),
  });
  const kLT = 6;
  const kRT = 7;

  it('does nothing within its dead zone, and all from its border to its end', () => {
    expect(beyondDeadZone(0.1, -0.1)).toEqual({ x: 0, y: 0 });
    expect(beyondDeadZone(kDeadZone, 0)).toEqual({ x: 0, y: 0 });
    expect(beyondDeadZone(kDeadZone + 1e-6, 0).x).toBeLessThan(1e-5);
    expect(beyondDeadZone(0, -1)).toEqual({ x: 0, y: -1 });
    const corner = beyondDeadZone(1, 1);
    expect(Math.hypot(corner.x, corner.y)).toBeCloseTo(1);
    expect(beyondDeadZone(Number.NaN, undefined)).toEqual({ x: 0, y: 0 });
  });
  it('presses by a trigger, as deep as it is pressed, and lets go with it', () => {
    const pointers = new Pointers(3);
    const hand = new GamepadHand(pointers, 3);
    expect(hand.step(pad([0, 0, 0, 0]), 0.016)).toBe(false);
    expect(hand.step(pad([0, 0, 0, 0], { [kLT]: 0.05 }), 0.016)).toBe(false);
    expect(hand.step(pad([0, 0, 0, 0], { [kLT]: 1 }), 0.016)).toBe(true);
    expect(pointers.pointers).toEqual([{ finger: 0, x: 0.5, y: 0.66, push_m: 0.03 }]);
    expect(hand.step(pad([0, 0, 0, 0], { [kLT]: 1 }), 0.016)).toBe(false);
    expect(hand.step(pad([0, -1, 0, 0], { [kLT]: 1 }), 0.05)).toBe(true);
    expect(pointers.pointers[0]?.y).toBeCloseTo(0.64);
    expect(hand.step(pad([0, 0, 0, 0]), 0.016)).toBe(true);
    expect(pointers.pointers).toEqual([]);
  });
  it('moves two fingers with two sticks; the buttons above the triggers choose them, one a press', () => {
    const pointers = new Pointers(3);
    const hand = new GamepadHand(pointers, 3);
    // The whole hand on the left leaves no finger to the right.
    hand.step(pad([0, 0, 0, 0], { [kLT]: 0.6, [kRT]: 0.6 }), 0.016);
    expect(fingersOf(pointers)).toEqual([0]);
    hand.step(pad([0, 0, 0, 0]), 0.016);
    for (let i = 0; i < 3; ++i) hand.step(pad([0, 0, 0, 0], { 4: 1 }), 0.016);
    expect(hand.marks.map((one) => one.finger)).toEqual([1, 3]);
    hand.step(pad([0, 0, 1, 0], { [kLT]: 0.6, [kRT]: 0.6 }), 0.05);
    expect(fingersOf(pointers)).toEqual([1, 3]);
    expect(pointers.pointers[1]?.x).toBeCloseTo(0.62);
    // Finger 3 is the right one's: the left one's finger comes back where it would take it.
    hand.step(pad([0, 0, 0, 0], { 4: 1, [kLT]: 0.6, [kRT]: 0.6 }), 0.016);
    hand.step(pad([0, 0, 0, 0], { [kLT]: 0.6, [kRT]: 0.6 }), 0.016);
    hand.step(pad([0, 0, 0, 0], { 4: 1, [kLT]: 0.6, [kRT]: 0.6 }), 0.016);
    expect(fingersOf(pointers)).toEqual([3]);
    expect(hand.release()).toBe(true);
    expect(pointers.pointers).toEqual([]);
  });
  it('takes no finger from a touch point, and keys none from it', () => {
    const pointers = new Pointers(2);
    pointers.press(at(10, 'touch'));
    const hand = new GamepadHand(pointers, 2);
    hand.step(pad([0, 0, 0, 0], { [kLT]: 1, [kRT]: 1 }), 0.016);
    expect(fingersOf(pointers)).toEqual([1, 2]);
    pointers.key('2', false);
    expect(pointers.keysAt.finger).toBe(0);
  });
  it('stands still over a pause, and is the first one that is there', () => {
    const hand = new GamepadHand(new Pointers(1), 1);
    hand.step(pad([1, 0, 0, 0]), 60);
    expect(hand.marks[0]?.x).toBeCloseTo(0.54);
    expect(firstPad([null])).toBeUndefined();
    expect(firstPad([null, { connected: true } as Gamepad])).toBeDefined();
  });
});
