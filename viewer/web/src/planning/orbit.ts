// From where the organ is seen, and how drags, wheel and keys change it. Pure.

/** As the server takes it: degrees from the patient's front and up; pan in parts of the picture, to the right and down. */
export interface View {
  azimuth_deg: number;
  elevation_deg: number;
  zoom: number;
  pan_x: number;
  pan_y: number;
}
export const kFirstView: View = { azimuth_deg: 0, elevation_deg: 0, zoom: 1, pan_x: 0, pan_y: 0 };

const kTurn_deg = 180;
const kZoomOfWheel = 0.0015;
const kLeastZoom = 0.25;
const kMostZoom = 10;
const kMostPan = 5;
const kKeyTurn = 5 / kTurn_deg;
const kKeyZoom = 1.15;

const within = (value: number, least: number, most: number) => Math.min(most, Math.max(least, value));
/** From -180 to 180. */
const wrapped = (degrees: number) => degrees - 360 * Math.round(degrees / 360);

/** The organ follows a drag by these parts of the picture, as if it were turned by hand. */
export function turned(view: View, dx: number, dy: number): View {
  return {
    ...view,
    azimuth_deg: wrapped(view.azimuth_deg - kTurn_deg * dx),
    elevation_deg: within(view.elevation_deg + kTurn_deg * dy, -90, 90),
  };
}
export function panned(view: View, dx: number, dy: number): View {
  return { ...view, pan_x: within(view.pan_x + dx, -kMostPan, kMostPan), pan_y: within(view.pan_y + dy, -kMostPan, kMostPan) };
}
/** What is in the middle of the picture stays there. */
export function zoomed(view: View, factor: number): View {
  const zoom = within(view.zoom * factor, kLeastZoom, kMostZoom);
  const by = zoom / view.zoom;
  return panned({ ...view, zoom }, view.pan_x * (by - 1), view.pan_y * (by - 1));
}
export const zoomedByWheel = (view: View, delta: number): View => zoomed(view, Math.exp(-kZoomOfWheel * delta));

/** Undefined for a key that does nothing here. */
export function viewByKey(view: View, key: string, pan: boolean): View | undefined {
  const move = pan ? panned : turned;
  switch (key) {
    case 'ArrowLeft':
      return move(view, -kKeyTurn, 0);
    case 'ArrowRight':
      return move(view, kKeyTurn, 0);
    case 'ArrowUp':
      return move(view, 0, -kKeyTurn);
    case 'ArrowDown':
      return move(view, 0, kKeyTurn);
    case '+':
    case '=':
      return zoomed(view, kKeyZoom);
    case '-':
      return zoomed(view, 1 / kKeyZoom);
    case 'Home':
      return kFirstView;
    default:
      return undefined;
  }
}

/** Places of one or two pointers in the picture: one turns (or pans), two zoom and pan. */
export class OrbitDrag {
  private readonly at = new Map<number, { x: number; y: number }>();

  get isDown(): boolean {
    return this.at.size > 0;
  }
  press(id: number, x: number, y: number): boolean {
    if (this.at.size === 2) return false;
    this.at.set(id, { x, y });
    return true;
  }
  release(id: number): void {
    this.at.delete(id);
  }
  releaseAll(): void {
    this.at.clear();
  }
  /** Undefined where the pointer is not down. */
  move(view: View, id: number, x: number, y: number, pan: boolean): View | undefined {
    const before = this.at.get(id);
    if (!before) return undefined;
    this.at.set(id, { x, y });
    const [dx, dy] = [x - before.x, y - before.y];
    const other = [...this.at].find(([one]) => one !== id)?.[1];
    if (!other) return pan ? panned(view, dx, dy) : turned(view, dx, dy);
    const apart = (one: { x: number; y: number }) => Math.max(Math.hypot(one.x - other.x, one.y - other.y), 0.01);
    return panned(zoomed(view, apart({ x, y }) / apart(before)), dx / 2, dy / 2);
  }
}
