// The page's pictograms: strokes on a 24-pixel grid, in the colour of the text beside them. Never the only carrier of a meaning.
const kPaths = {
  play: 'M7 4.5v15l12-7.5z',
  pause: 'M8 5v14M16 5v14',
  back: 'M11 6 5 12l6 6M5 12h14',
  stepBack: 'M7 6v12M18 6l-8 6 8 6z',
  stepForward: 'M17 6v12M6 6l8 6-8 6z',
  markBack: 'M13 4H6v16l3.5-3 3.5 3zM20 8l-4 4 4 4',
  markForward: 'M18 4h-7v16l3.5-3 3.5 3zM4 8l4 4-4 4',
  mark: 'M7 4h10v16l-5-4-5 4z',
  fullScreen: 'M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5',
  help: 'M9.2 9a3 3 0 1 1 4.3 3c-1 .6-1.5 1.1-1.5 2.2M12 17.6v.2M12 2.8a9.2 9.2 0 1 0 0 18.4 9.2 9.2 0 0 0 0-18.4z',
  search: 'M10.5 4a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM15.5 15.5 21 21',
  lock: 'M6 11h12v9H6zM8.5 11V8a3.5 3.5 0 0 1 7 0v3',
  unlocked: 'M6 11h12v9H6zM8.5 11V8a3.5 3.5 0 0 1 6.7-1.4',
  intact: 'M12 3 4.5 6v5.5c0 4.6 3.1 8 7.5 9.5 4.4-1.5 7.5-4.9 7.5-9.5V6zM8.5 12l2.5 2.5 4.5-5',
  gaps: 'M12 3 4.5 6v5.5c0 4.6 3.1 8 7.5 9.5 4.4-1.5 7.5-4.9 7.5-9.5V6zM8 12h2.5M13.5 12H16',
  unproven: 'M12 3 4.5 6v5.5c0 4.6 3.1 8 7.5 9.5 4.4-1.5 7.5-4.9 7.5-9.5V6zM10 9.8a2 2 0 1 1 2.8 2c-.6.3-.8.7-.8 1.3M12 15.6v.1',
  incomplete: 'M12 3a9 9 0 1 0 9 9M12 7v5l3.5 2M16 3.9l.1.1M19.9 8l.1.1',
  tampered: 'M12 3 4.5 6v5.5c0 4.6 3.1 8 7.5 9.5 4.4-1.5 7.5-4.9 7.5-9.5V6zM9.2 9.2l5.6 5.6M14.8 9.2l-5.6 5.6',
  notVerified: 'M12 3 4.5 6v5.5c0 4.6 3.1 8 7.5 9.5 4.4-1.5 7.5-4.9 7.5-9.5V6z',
  check: 'M5 12.5 10 17.5 19.5 7',
  cross: 'M6 6l12 12M18 6 6 18',
  dash: 'M5 12h14',
  original: 'M5 4h14v16H5zM5 9h14M9 4v5M15 4v5M5 15h14M9 15v5M15 15v5',
  export: 'M12 4v11M7.5 10.5 12 15l4.5-4.5M4.5 19.5h15',
  document: 'M6 3h8l4 4v14H6zM14 3v4h4M9 12h6M9 16h6',
  users: 'M9 11a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7zM2.5 20c.5-4 3-6 6.5-6s6 2 6.5 6M16 4.4a3.5 3.5 0 0 1 0 6.3M18 14.4c2 .8 3.2 2.7 3.5 5.6',
  rooms: 'M3 7h11v10H3zM14 10.500l6-3.500v10l-6-3.5',
  cases: 'M4 5h16v14H4zM4 9.500h16M9 9.500V19',
  sun: 'M12 7.500a4.5 4.5 0 1 0 0 9 4.5 4.5 0 0 0 0-9zM12 2v2.500M12 19.500V22M2 12h2.500M19.5 12H22M5 5l1.7 1.700M17.3 17.3 19 19M19 5l-1.7 1.700M6.7 17.3 5 19',
  moon: 'M19.5 14.500A8 8 0 0 1 9.5 4.500a8 8 0 1 0 10 10z',
  signOut: 'M14 4H5v16h9M10 12h11M17 8l4 4-4 4',
  zoomIn: 'M10.5 4a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM15.5 15.5 21 21M10.5 7.500v6M7.5 10.500h6',
  zoomOut: 'M10.5 4a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM15.5 15.5 21 21M7.5 10.500h6',
  fit: 'M4 6v12M20 6v12M7 12h10M9.5 9.5 7 12l2.5 2.500M14.5 9.5 17 12l-2.5 2.5',
  record: 'M12 5.500a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13z',
  stop: 'M6.5 6.500h11v11h-11z',
  alarm: 'M12 3.5 2.5 20h19zM12 10v4.500M12 17.300v.2',
  clock: 'M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18zM12 7v5l3.5 2',
  training: 'M7 11V6.500a1.500 1.500 0 0 1 3 0V11M10 10V4.500a1.500 1.500 0 0 1 3 0V10M13 10.500v-4a1.500 1.500 0 0 1 3 0V12M16 11a1.500 1.500 0 0 1 3 0v3.500c0 4-2.500 6.500-6 6.500-3 0-4.500-1.500-6-4l-2.300-3.800c-.8-1.400 1-2.700 2.100-1.500L7 13.500',
  sound: 'M4 9.500h4L13 5v14l-5-4.500H4zM16 9a4 4 0 0 1 0 6M18.500 6.500a8 8 0 0 1 0 11',
  soundOff: 'M4 9.500h4L13 5v14l-5-4.500H4zM16.500 9.500l5 5M21.500 9.500l-5 5',
  disk: 'M4 14h16v5H4zM4 14l2.5-8h11L20 14M16.5 16.500v.1',
} as const;

export type IconName = keyof typeof kPaths;

export function Icon({ name, filled = false }: { name: IconName; filled?: boolean }) {
  return (
    <svg class={filled ? 'icon icon-filled' : 'icon'} viewBox="0 0 24 24" aria-hidden="true" focusable="false">
      <path d={kPaths[name]} />
    </svg>
  );
}
