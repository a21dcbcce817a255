// Planning by hand: views, pointers and drawn lines, as the server gets them.
import { afterEach, describe, expect, it, vi } from 'vitest';
import { CutHandles, curveThrough, type ShownCut } from '@/planning/cut_handles';
import { kFirstView, OrbitDrag, panned, turned, viewByKey, zoomed, zoomedByWheel } from '@/planning/orbit';
import { DrawnLine, type Place, PlanPointers } from '@/planning/plan_pointers';
import { TableController } from '@/planning/table_controller';

const kUpright = { twist_deg: 0, pressure: 0, tilt_x_deg: 0, tilt_y_deg: 0 };

describe('A view', () => {
  it('turns with a drag, round and round, and up to the poles', () => {
    expect(turned(kFirstView, 0.25, 0.1)).toEqual({ ...kFirstView, azimuth_deg: -45, elevation_deg: 18 });
    expect(turned({ ...kFirstView, azimuth_deg: 170 }, -0.5, 0).azimuth_deg).toBe(-100);
    expect(turned(kFirstView, 0, 3).elevation_deg).toBe(90);
    expect(turned(kFirstView, 0, -3).elevation_deg).toBe(-90);
  });
  it('zooms about the middle of the picture, within limits', () => {
    expect(zoomed({ ...kFirstView, pan_x: 0.2 }, 2)).toEqual({ ...kFirstView, zoom: 2, pan_x: 0.4 });
    expect(zoomed(kFirstView, 1000).zoom).toBe(10);
    expect(zoomed(kFirstView, 1e-9).zoom).toBe(0.25);
    expect(zoomedByWheel(kFirstView, -100).zoom).toBeGreaterThan(1);
  });
  it('is moved by keys, and others do nothing', () => {
    expect(viewByKey(kFirstView, 'ArrowRight', false)?.azimuth_deg).toBeCloseTo(-5);
    expect(viewByKey(kFirstView, 'ArrowRight', true)?.pan_x).toBeGreaterThan(0);
    expect(viewByKey(panned(kFirstView, 1, 1), 'Home', false)).toEqual(kFirstView);
    expect(viewByKey(kFirstView, 'x', false)).toBeUndefined();
  });
  it('is dragged by one pointer, zoomed and moved by two, and a third does nothing', () => {
    const drag = new OrbitDrag();
    expect(drag.move(kFirstView, 1, 0.5, 0.5, false)).toBeUndefined();
    drag.press(1, 0.5, 0.5);
    expect(drag.move(kFirstView, 1, 0.6, 0.5, false)?.azimuth_deg).toBeCloseTo(-18);
    expect(drag.move(kFirstView, 1, 0.7, 0.5, true)?.pan_x).toBeCloseTo(0.1);
    drag.press(2, 0.5, 0.5);
    expect(drag.press(3, 0, 0)).toBe(false);
    const two = drag.move(kFirstView, 2, 0.3, 0.5, false);
    expect(two?.zoom).toBeCloseTo(2);
    expect(two?.azimuth_deg).toBe(0);
    drag.release(1);
    drag.release(2);
    expect(drag.isDown).toBe(false);
  });
});

describe('Pointers on the organ', () => {
  it('are up to five, each with a number of its own as long as it is down', () => {
    const pointers = new PlanPointers();
    pointers.depth_m = 0.01;
    for (let id = 10; id < 15; ++id) expect(pointers.press(id, 0.1 * (id - 9), 0.5)).toBe(true);
    expect(pointers.press(15, 0.5, 0.5)).toBe(false);
    expect(pointers.press(10, 0.5, 0.5)).toBe(false);
    pointers.release(12);
    pointers.press(12, 0.9, 0.9);
    expect(pointers.pointers.map(({ id }) => id)).toEqual([1, 2, 4, 5, 6]);
    expect(pointers.move(12, 3, -3)).toBe(true);
    expect(pointers.pointers[4]).toEqual({ id: 6, x: 1.5, y: -0.5, push_m: 0.01, turn_deg: 0, lean_x_deg: 0, lean_y_deg: 0 });
    expect(pointers.releaseAll()).toBe(true);
    expect(pointers.releaseAll()).toBe(false);
  });
  it('push by depth and wheel, no further than the server takes', () => {
    const pointers = new PlanPointers();
    pointers.depth_m = 0.02;
    expect(pointers.wheel(-100, false)).toBe(false);
    pointers.press(1, 0.5, 0.5);
    pointers.wheel(-100, false);
    expect(pointers.pointers[0]?.push_m).toBeCloseTo(0.025);
    pointers.wheel(-100_000, false);
    expect(pointers.pointers[0]?.push_m).toBe(0.2);
  });
  it('turn by wheel and Shift, by keys, and with a pen over its border of 360 degrees', () => {
    const pointers = new PlanPointers();
    pointers.press(1, 0.5, 0.5, { ...kUpright, twist_deg: 350, pressure: 0.5 });
    pointers.wheel(100, true);
    expect(pointers.pointers[0]).toMatchObject({ push_m: 0, turn_deg: 5 });
    pointers.key(',', false);
    pointers.key(',', false);
    pointers.key('.', false);
    expect(pointers.pointers[0]?.turn_deg).toBe(0);
    pointers.move(1, 0.5, 0.5, { ...kUpright, twist_deg: 10, pressure: 0.5 });
    expect(pointers.pointers[0]?.turn_deg).toBe(20);
    pointers.move(1, 0.5, 0.5, { ...kUpright, twist_deg: 340, pressure: 0.5 });
    expect(pointers.pointers[0]?.turn_deg).toBe(-10);
    pointers.wheel(10_000_000, true);
    expect(pointers.pointers[0]?.turn_deg).toBe(36_000);
  });
  it('of a pen push as hard as it presses, where pens push', () => {
    const pointers = new PlanPointers();
    pointers.depth_m = 0.01;
    pointers.press(1, 0.5, 0.5, { ...kUpright, twist_deg: 0, pressure: 0.5 });
    expect(pointers.pointers[0]?.push_m).toBeCloseTo(0.01);
    pointers.pensPush = true;
    expect(pointers.pointers[0]?.push_m).toBeCloseTo(0.02);
    pointers.move(1, 0.5, 0.5, { ...kUpright, twist_deg: 0, pressure: 1 });
    expect(pointers.pointers[0]?.push_m).toBeCloseTo(0.03);
  });
  it('lean as a pen is tilted from where it came down, which is never held quite still', () => {
    const pointers = new PlanPointers();
    pointers.press(1, 0.5, 0.5, { ...kUpright, tilt_x_deg: 20, tilt_y_deg: -10 });
    expect(pointers.pointers[0]).toMatchObject({ lean_x_deg: 0, lean_y_deg: 0 });
    pointers.move(1, 0.6, 0.5, { ...kUpright, tilt_x_deg: 24, tilt_y_deg: -14 });
    expect(pointers.pointers[0]).toMatchObject({ lean_x_deg: 0, turn_deg: 0 });
    expect(pointers.pointers[0]?.lean_y_deg).toBeCloseTo(0);
    pointers.move(1, 0.6, 0.5, { ...kUpright, tilt_x_deg: 55, tilt_y_deg: -40 });
    expect(pointers.pointers[0]).toMatchObject({ lean_x_deg: 30, lean_y_deg: -25 });
    pointers.release(1);
    pointers.press(1, 0.6, 0.5, { ...kUpright, tilt_x_deg: 55, tilt_y_deg: -40 });
    expect(pointers.pointers[0]).toMatchObject({ lean_x_deg: 0, lean_y_deg: 0 });
  });
  it('are moved by keys', () => {
    const pointers = new PlanPointers();
    pointers.key('ArrowUp', true);
    pointers.key(' ', false);
    pointers.key('ArrowLeft', false);
    pointers.key('PageUp', false);
    expect(pointers.pointers).toHaveLength(1);
    expect(pointers.pointers[0]?.x).toBeCloseTo(0.49);
    expect(pointers.pointers[0]?.y).toBeCloseTo(0.46);
    expect(pointers.pointers[0]?.push_m).toBeCloseTo(0.002);
    pointers.key(' ', false);
    expect(pointers.pointers).toEqual([]);
    expect(pointers.key('q', false)).toBe(false);
  });
});

describe('A drawn line', () => {
  it('leaves out places that are too near, and is nothing where it goes nowhere', () => {
    const line = new DrawnLine();
    line.begin(0.2, 0.2);
    expect(line.add(0.2001, 0.2)).toBe(false);
    expect(line.take()).toBeUndefined();
    line.begin(0.2, 0.2);
    expect(line.add(0.3, 0.2)).toBe(true);
    expect(line.take()).toEqual([
      { x: 0.2, y: 0.2 },
      { x: 0.3, y: 0.2 },
    ]);
    expect(line.places).toEqual([]);
  });
});

describe('Handles of a cut', () => {
  const cut: ShownCut = {
    step: 2,
    smooth: true,
    handles: [
      { x: 0.3, y: 0.4, depth_m: 0.01, hidden: false },
      { x: 0.5, y: 0.5, depth_m: 0.02, hidden: false },
      { x: 0.7, y: 0.4, depth_m: 0.01, hidden: true },
    ],
  };
  const shown = () => {
    const handles = new CutHandles();
    handles.show([cut], 0);
    return handles;
  };
  it('are dragged by where they were taken, and a press alone chooses', () => {
    const handles = shown();
    expect(handles.press(7, 0.51, 0.49, { step: 2, handle: 1 })).toBe(true);
    expect(handles.move(7, 0.511, 0.49)).toBe(false);
    expect(handles.release(7)).toBe(false);
    expect(handles.deed).toBeUndefined();
    handles.press(7, 0.51, 0.49, { step: 2, handle: 1 });
    expect(handles.press(8, 0.3, 0.4, { step: 2, handle: 0 })).toBe(false);
    expect(handles.move(8, 0.9, 0.9)).toBe(false);
    expect(handles.move(7, 0.61, 0.54)).toBe(true);
    expect(handles.held?.x).toBeCloseTo(0.6);
    expect(handles.held?.y).toBeCloseTo(0.55);
    expect(handles.release(7)).toBe(true);
    expect(handles.deed).toMatchObject({ step: 2, handle: 1 });
    expect(handles.deed).not.toHaveProperty('depth_m');
  });
  it('stay where they were dragged to until a picture shows it, and then as the server has them', () => {
    const handles = shown();
    handles.press(1, 0.3, 0.4, { step: 2, handle: 0 });
    handles.move(1, 0.2, 0.4);
    handles.release(1);
    handles.wasSent(9);
    handles.show([cut], 8);
    expect(handles.asHeld[0]?.handles[0]?.x).toBeCloseTo(0.2);
    expect(handles.deed, 'nothing is sent twice').toBeUndefined();
    handles.show([cut], 9);
    expect(handles.asHeld[0]?.handles[0]?.x).toBe(0.3);
    expect(handles.deed).toBeUndefined();
    expect(handles.chosen).toEqual({ step: 2, handle: 0 });
    handles.setDepth(0.01);
    expect(handles.deed, 'it is as deep already').toBeUndefined();
    // What could not be sent is put back at once.
    handles.key('ArrowLeft', false);
    handles.wasSent(0);
    expect(handles.asHeld[0]?.handles[0]?.x).toBe(0.3);
  });
  it('are moved and made deeper by keys, and put back', () => {
    const handles = shown();
    expect(handles.key('ArrowLeft', false)).toBe(false);
    handles.choose({ step: 2, handle: 1 });
    expect(handles.key('ArrowLeft', true)).toBe(true);
    handles.key('ArrowDown', false);
    handles.key('PageUp', false);
    handles.key('PageUp', true);
    handles.key('PageDown', false);
    expect(handles.key('q', false)).toBe(false);
    expect(handles.deed?.x).toBeCloseTo(0.46);
    expect(handles.deed?.y).toBeCloseTo(0.51);
    expect(handles.deed?.depth_m).toBeCloseTo(0.024);
    for (let i = 0; i < 60; ++i) handles.key('PageDown', true);
    expect(handles.deed?.depth_m).toBe(0.001);
    handles.putBack();
    expect(handles.deed).toBeUndefined();
  });
  it('send nothing where the cut has them so', () => {
    const handles = shown();
    handles.choose({ step: 2, handle: 1 });
    handles.key('ArrowLeft', false);
    handles.key('ArrowRight', false);
    handles.setDepth(0.03);
    expect(handles.deed, 'the depth alone').toEqual({ step: 2, handle: 1, depth_m: 0.03 });
    handles.setDepth(0.02);
    expect(handles.deed).toBeUndefined();
    // Back again before a picture shows what was sent: the server has the other depth.
    handles.setDepth(0.03);
    handles.wasSent(4);
    handles.setDepth(0.02);
    expect(handles.deed?.depth_m).toBe(0.02);
    handles.show([cut], 4);
    expect(handles.deed, 'it was refused').toBeUndefined();
  });
  it('behind the organ are not moved, only made deeper', () => {
    const handles = shown();
    expect(handles.press(1, 0.7, 0.4, { step: 2, handle: 2 })).toBe(false);
    handles.key('ArrowLeft', false);
    expect(handles.deed).toBeUndefined();
    handles.key('PageUp', false);
    expect(handles.deed).toEqual({ step: 2, handle: 2, depth_m: 0.011 });
  });
  it('are put back when the browser takes the pointer away', () => {
    const handles = shown();
    handles.press(7, 0.5, 0.5, { step: 2, handle: 1 });
    handles.move(7, 0.6, 0.6);
    expect(handles.cancel(8), 'another pointer').toBe(false);
    expect(handles.held?.x).toBeCloseTo(0.6);
    expect(handles.cancel(7)).toBe(true);
    expect(handles.held?.x).toBe(0.5);
    expect(handles.release(7)).toBe(false);
    expect(handles.deed).toBeUndefined();
    expect(handles.isDragged).toBe(false);
  });
  it('go on being dragged while a picture of the change before comes', () => {
    const handles = shown();
    handles.press(1, 0.3, 0.4, { step: 2, handle: 0 });
    handles.move(1, 0.2, 0.4);
    handles.release(1);
    handles.wasSent(9);
    handles.press(1, 0.2, 0.4, { step: 2, handle: 0 });
    handles.show([cut], 9);
    expect(handles.isDragged).toBe(true);
    expect(handles.move(1, 0.1, 0.4)).toBe(true);
    expect(handles.release(1)).toBe(true);
    expect(handles.deed?.x).toBeCloseTo(0.1);
    // Its cut is gone: nothing is left to drag.
    handles.press(1, 0.1, 0.4, { step: 2, handle: 0 });
    handles.show([], 10);
    expect(handles.isDragged).toBe(false);
    expect(handles.move(1, 0.5, 0.5)).toBe(false);
  });
  it('are chosen no longer once their cut is gone', () => {
    const handles = shown();
    handles.choose({ step: 2, handle: 1 });
    handles.show([], 1);
    expect(handles.chosen).toBeUndefined();
    expect(handles.held).toBeUndefined();
  });
});

describe('The curve between handles', () => {
  const corners = [
    { x: 0, y: 0 },
    { x: 0.1, y: 0.2 },
    { x: 0.4, y: 0.2 },
  ];
  it('goes through each of them, and is straight where the cut is', () => {
    const curve = curveThrough(corners, true);
    for (const { x, y } of corners) expect(Math.min(...curve.map((one) => Math.hypot(one.x - x, one.y - y)))).toBeLessThan(1e-12);
    expect(curve.length).toBe(25);
    // As if it came along the line on which it ends.
    const line = curveThrough([corners[0], corners[2]] as Place[], true);
    for (const { x, y } of line) expect(y).toBeCloseTo(x / 2, 12);
    expect(curveThrough(corners, false)).toEqual(corners);
  });
});

describe('The table', () => {
  /** The browser's WebSocket, whose server is the test. */
  class Socket {
    static readonly OPEN = 1;
    static newest: Socket;
    readonly readyState = Socket.OPEN;
    onmessage: ((event: { data: ArrayBuffer }) => void) | undefined;
    sent: Record<string, unknown>[] = [];
    constructor() {
      Socket.newest = this;
    }
    send(text: string): void {
      this.sent.push(JSON.parse(text) as Record<string, unknown>);
    }
    close(): void {}
  }
  const cut: ShownCut = {
    step: 0,
    smooth: true,
    handles: [
      { x: 0.3, y: 0.4, depth_m: 0.01, hidden: false },
      { x: 0.5, y: 0.5, depth_m: 0.02, hidden: false },
    ],
  };
  const silent = () => undefined;
  /** A picture that shows the cut, and the deeds up to `input`. */
  const shows = async (table: TableController, cuts: ShownCut[], input: number) => {
    const about = new TextEncoder().encode(JSON.stringify({ input, tools: [], cuts }));
    const message = new Uint8Array(4 + about.length);
    new DataView(message.buffer).setUint32(0, about.length, true);
    message.set(about, 4);
    Socket.newest.onmessage?.({ data: message.buffer });
    await vi.waitFor(() => expect(table.handles.value.cuts).toHaveLength(cuts.length));
  };
  const opened = async () => {
    vi.stubGlobal('WebSocket', Socket);
    vi.stubGlobal('location', { host: 'here' });
    vi.stubGlobal('createImageBitmap', () => Promise.resolve({ close: silent }));
    const listener = { opening: silent, opened: silent, steps: silent, moment: silent, told: silent, saved: silent, lost: silent };
    const table = new TableController({ plan: 'plan.json', anew: true }, listener);
    table.choose('cut');
    await shows(table, [cut], 0);
    return { table, sent: Socket.newest.sent };
  };
  const at = (id: number, x: number, y: number) => ({ id, x, y, at_ms: 0, pan: false });
  afterEach(() => vi.unstubAllGlobals());

  it('cuts nothing where the browser takes a pointer away', async () => {
    const { table, sent } = await opened();
    expect(table.pressHandle(at(1, 0.3, 0.4), { step: 0, handle: 0 })).toBe(true);
    table.move(at(1, 0.2, 0.4));
    table.cancel(1, 0);
    expect(table.handles.value.held?.x).toBe(0.3);
    table.release(at(1, 0.2, 0.4));
    expect(table.press(at(2, 0.1, 0.1))).toBe(true);
    table.move(at(2, 0.6, 0.6));
    table.cancel(2, 0);
    expect(table.line.value).toEqual([]);
    table.release(at(2, 0.6, 0.6));
    expect(sent).toEqual([]);
    // The next line begins anew.
    expect(table.press(at(3, 0.4, 0.4))).toBe(true);
    table.move(at(3, 0.5, 0.4));
    table.release(at(3, 0.5, 0.4));
    expect(sent).toMatchObject([
      {
        cut: {
          line: [
            { x: 0.4, y: 0.4 },
            { x: 0.5, y: 0.4 },
          ],
        },
      },
    ]);
  });
  it('takes no second finger while a handle is dragged', async () => {
    const { table, sent } = await opened();
    table.pressHandle(at(1, 0.3, 0.4), { step: 0, handle: 0 });
    table.move(at(1, 0.2, 0.4));
    expect(table.press(at(2, 0.8, 0.8)), 'for a line').toBe(false);
    expect(table.pressHandle(at(2, 0.5, 0.5), { step: 0, handle: 1 })).toBe(false);
    table.chooseHandle({ step: 0, handle: 1 });
    table.move(at(2, 0.9, 0.9));
    table.release(at(2, 0.9, 0.9));
    expect(sent).toEqual([]);
    table.release(at(1, 0.2, 0.4));
    expect(sent).toMatchObject([{ handle: { step: 0, handle: 0 } }]);
  });
  it('keeps the handle chosen that has the focus while all pointers go up', async () => {
    const { table, sent } = await opened();
    table.chooseHandle({ step: 0, handle: 1 });
    expect(table.keyOfHandle('ArrowLeft', false, 0)).toBe(true);
    table.letGo();
    expect(table.handles.value.held?.x).toBe(0.5);
    expect(table.keyOfHandle('ArrowLeft', false, 0)).toBe(true);
    table.keyOfHandle('Enter', false, 0);
    expect(sent).toMatchObject([{ handle: { step: 0, handle: 1 } }]);
    table.choose('cut');
    expect(table.handles.value.chosen).toBeUndefined();
  });
  it('makes one cut of what the slider goes through', async () => {
    const { table, sent } = await opened();
    table.chooseHandle({ step: 0, handle: 1 });
    for (const depth_m of [0.021, 0.022, 0.023]) table.setHandleDepth(depth_m);
    expect(sent).toEqual([]);
    table.finishDepth();
    table.finishDepth();
    expect(sent).toMatchObject([{ handle: { step: 0, handle: 1, depth_m: 0.023 } }]);
    await shows(table, [cut], 1);
    // Back where it was, or put back: nothing is cut.
    table.setHandleDepth(0.03);
    table.setHandleDepth(0.02);
    table.finishDepth();
    table.setHandleDepth(0.03);
    table.putHandleBack();
    table.finishDepth();
    expect(sent).toHaveLength(1);
    // What goes on to another handle is done with this one.
    table.setHandleDepth(0.03);
    table.chooseHandle({ step: 0, handle: 0 });
    expect(sent.slice(1)).toMatchObject([{ handle: { step: 0, handle: 1, depth_m: 0.03 } }]);
  });
});
