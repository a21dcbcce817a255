import { afterEach, describe, expect, it, vi } from 'vitest';
import { Company } from '@/pointing/company';
import { moved, partAt, pictureBox } from '@/pointing/geometry';
import { colorOf, kSeen_ms, opacityAt, seenAt } from '@/pointing/pointers';

describe('A place in a picture', () => {
  it('is found inside its black borders', () => {
    expect(pictureBox(1600, 900, 640, 480)).toEqual({ left: 200, top: 0, width: 1200, height: 900 });
    expect(pictureBox(400, 900, 640, 480)).toEqual({ left: 0, top: 300, width: 400, height: 300 });
    const box = pictureBox(1600, 900, 640, 480);
    expect(partAt(800, 450, box)).toEqual({ x: 0.5, y: 0.5 });
    expect(partAt(200, 0, box)).toEqual({ x: 0, y: 0 });
    expect(partAt(1400, 900, box)).toEqual({ x: 1, y: 1 });
    for (const [left, top] of [
      [199, 10],
      [1401, 10],
      [800, -1],
      [800, 901],
    ] as const)
      expect(partAt(left, top, box)).toBeUndefined();
  });
  it('is the same in a pane of any size', () => {
    for (const [width, height] of [
      [640, 480],
      [1920, 300],
      [333, 777],
    ] as const) {
      const box = pictureBox(width, height, 720, 576);
      const part = partAt(box.left + 0.3 * box.width, box.top + 0.7 * box.height, box);
      expect(part?.x).toBeCloseTo(0.3, 9);
      expect(part?.y).toBeCloseTo(0.7, 9);
    }
  });
  it('stays in the picture when keys move it', () => {
    expect(moved({ x: 0.99, y: 0.01 }, 0.02, -0.02)).toEqual({ x: 1, y: 0 });
  });
});

describe('Arrows', () => {
  const point = (by: string, time_ms: number, x = 0.5) => ({ by, role: 'guest', stream: 'endoscope', x, y: 0.5, time_ms });
  it('stand for a second and fade in half of one', () => {
    expect([0, 1000, 1250, 1500, 5000].map(opacityAt)).toEqual([1, 1, 0.5, 0, 0]);
  });
  it('are the newest of each person, of this stream, of the time behind', () => {
    const points = [point('a', 0, 0.1), point('a', 900, 0.2), point('b', 500), point('a', 1100, 0.9), { ...point('c', 900), stream: 'room' }];
    const seen = seenAt(points, 'endoscope', (one) => 1000 - one.time_ms);
    expect(seen.map(({ by, x }) => [by, x])).toEqual([
      ['a', 0.2],
      ['b', 0.5],
    ]);
    expect(seenAt(points, 'endoscope', (one) => 1100 + kSeen_ms - one.time_ms)).toEqual([]);
  });
  it('have the same colour for the same person, and a guest another than a user of that name', () => {
    expect(colorOf({ by: 'Dr. Sato', role: 'guest' })).toBe(colorOf({ by: 'Dr. Sato', role: 'guest' }));
    expect(colorOf({ by: 'anna', role: 'guest' })).not.toBe(colorOf({ by: 'anna', role: 'surgeon' }));
    for (const by of ['', 'x', '佐藤', 'Dr. Møller']) expect(colorOf({ by, role: 'guest' })).toSatisfy((one: number) => one >= 0 && one < 6);
  });
});

describe('Where a person points', () => {
  afterEach(() => {
    vi.unstubAllGlobals();
  });
  it('is said of the case that they saw when they did, and of a guest’s by the server', () => {
    const sent: unknown[] = [];
    class Socket {
      static readonly OPEN = 1;
      readonly readyState = 1;
      send(message: string) {
        sent.push(JSON.parse(message));
      }
      close() {}
    }
    vi.stubGlobal('WebSocket', Socket);
    vi.stubGlobal('location', { host: 'or' });
    const company = new Company('or-1');
    company.point('20261128T080000Z-0000000a', 'endoscope', 0.5, 0.25, 7);
    company.point(undefined, 'endoscope', 0.5, 0.25, undefined);
    company.close();
    expect(sent).toEqual([
      { stream: 'endoscope', x: 0.5, y: 0.25, picture_ns: 7, case: '20261128T080000Z-0000000a' },
      { stream: 'endoscope', x: 0.5, y: 0.25 },
    ]);
  });
});
