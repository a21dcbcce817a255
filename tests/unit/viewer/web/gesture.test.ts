import { describe, expect, it } from 'vitest';
import { Gesture } from '@/timeline/gesture';
import { kShortestWindow_ns, pinched, toTime } from '@/timeline/scale';

const press = (id: number, kind: string, x: number, selects = false) => ({ id, kind, x, selects });

describe('A mouse on the time line', () => {
  it('scrubs at once, and a hand that trembles does not', () => {
    const gesture = new Gesture(false);
    expect(gesture.press(press(1, 'mouse', 100))).toEqual({ do: 'point', x: 100 });
    expect(gesture.move(1, 101)).toBeUndefined();
    expect(gesture.move(1, 110)).toEqual({ do: 'scrub', x: 110 });
    expect(gesture.move(1, 100)).toEqual({ do: 'scrub', x: 100 });
    expect(gesture.release(1)).toBeUndefined();
    expect(gesture.move(1, 300)).toBeUndefined();
  });
  it('selects with Shift, either way', () => {
    const gesture = new Gesture(false);
    expect(gesture.press(press(1, 'mouse', 100, true))).toBeUndefined();
    expect(gesture.move(1, 60)).toEqual({ do: 'select', from: 60, to: 100 });
    expect(gesture.move(1, 180)).toEqual({ do: 'select', from: 100, to: 180 });
  });
});

describe('A finger on the lanes', () => {
  it('that taps is taken there when it is lifted', () => {
    const gesture = new Gesture(false);
    expect(gesture.press(press(1, 'touch', 100))).toBeUndefined();
    expect(gesture.move(1, 105)).toBeUndefined();
    expect(gesture.release(1)).toEqual({ do: 'point', x: 100 });
  });
  it('that swipes up asks for nothing: the browser takes it to scroll', () => {
    const gesture = new Gesture(false);
    gesture.press(press(1, 'touch', 100));
    gesture.cancel(1);
    expect(gesture.isHeld).toBe(false);
    expect(gesture.release(1)).toBeUndefined();
  });
  it('that moves sideways scrubs', () => {
    const gesture = new Gesture(false);
    gesture.press(press(1, 'touch', 100));
    expect(gesture.move(1, 109)).toEqual({ do: 'scrub', x: 109 });
    expect(gesture.move(1, 108)).toEqual({ do: 'scrub', x: 108 });
    expect(gesture.release(1)).toBeUndefined();
  });
  it('scrubs at once on the bar over the whole case', () => {
    expect(new Gesture(true).press(press(1, 'touch', 100))).toEqual({ do: 'point', x: 100 });
  });
});

describe('Two fingers', () => {
  it('pinch, and the one that stays behind asks for nothing', () => {
    const gesture = new Gesture(false);
    gesture.press(press(1, 'touch', 100));
    expect(gesture.press(press(2, 'touch', 200))).toBeUndefined();
    expect(gesture.move(2, 260)).toEqual({ do: 'pinch', from: [100, 200], to: [100, 260] });
    expect(gesture.move(1, 80)).toEqual({ do: 'pinch', from: [100, 260], to: [80, 260] });
    expect(gesture.release(2)).toBeUndefined();
    expect(gesture.move(1, 300)).toBeUndefined();
    expect(gesture.release(1)).toBeUndefined();
    expect(gesture.press(press(3, 'touch', 10))).toBeUndefined();
    expect(gesture.release(3)).toEqual({ do: 'point', x: 10 });
  });

  const whole = { start_ns: 0, end_ns: 1000e9 };
  it('that move apart look closer, and what lies between them stays between them', () => {
    const window = pinched(whole, whole, [400, 600], [300, 700], 1000);
    expect(window.end_ns - window.start_ns).toBeCloseTo(500e9, -6);
    expect(toTime(500, window, 1000)).toBeCloseTo(500e9, -7);
    const aside = pinched(whole, whole, [400, 600], [200, 600], 1000);
    expect(toTime(400, aside, 1000)).toBeCloseTo(500e9, -7);
  });
  it('that move together move the window', () => {
    const window = { start_ns: 400e9, end_ns: 500e9 };
    expect(pinched(window, whole, [400, 600], [500, 700], 1000)).toEqual({ start_ns: 390e9, end_ns: 490e9 });
  });
  it('never leave the case, nor look closer than there is anything to see', () => {
    expect(pinched(whole, whole, [100, 900], [450, 550], 1000)).toEqual(whole);
    let window = whole;
    for (let i = 0; i < 60; ++i) window = pinched(window, whole, [490, 510], [0, 1000], 1000);
    expect(window.end_ns - window.start_ns).toBe(kShortestWindow_ns);
  });
});
