// Where a picture lies in its pane, and where one points in it, as parts of its width and height. Pure.

export interface Box {
  left: number;
  top: number;
  width: number;
  height: number;
}

/** A picture as large as fits into `width` by `height`, in its middle (object-fit: contain). */
export function pictureBox(width: number, height: number, pictureWidth: number, pictureHeight: number): Box {
  if (pictureWidth <= 0 || pictureHeight <= 0) return { left: 0, top: 0, width, height };
  const scale = Math.min(width / pictureWidth, height / pictureHeight);
  const [wide, high] = [pictureWidth * scale, pictureHeight * scale];
  return { left: (width - wide) / 2, top: (height - high) / 2, width: wide, height: high };
}

export interface Part {
  x: number;
  y: number;
}

/** Nothing beside the picture. */
export function partAt(left: number, top: number, box: Box): Part | undefined {
  const x = (left - box.left) / box.width;
  const y = (top - box.top) / box.height;
  return x >= 0 && x <= 1 && y >= 0 && y <= 1 ? { x, y } : undefined;
}

const clamped = (value: number) => Math.max(0, Math.min(1, value));
export const moved = (part: Part, dx: number, dy: number): Part => ({ x: clamped(part.x + dx), y: clamped(part.y + dy) });
