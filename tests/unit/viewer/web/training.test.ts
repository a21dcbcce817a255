import { describe, expect, it } from 'vitest';
import { countTicks, place, scaleTo } from '@/training/chart';
import { Median } from '@/base/median';
import { splitPicture } from '@/media/picture_message';
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
