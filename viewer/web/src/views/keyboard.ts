// The keys of the case view. Pure: which action a key asks for.

export type Action =
  | 'toggle'
  | 'frameBack'
  | 'frameForward'
  | 'back5'
  | 'forward5'
  | 'back1'
  | 'forward1'
  | 'back60'
  | 'forward60'
  | 'slower'
  | 'faster'
  | 'previousMark'
  | 'nextMark'
  | 'fullScreen'
  | 'help'
  | 'goTo'
  | 'selectFrom'
  | 'selectTo'
  | 'clearSelection'
  | 'begin'
  | 'end'
  | 'original'
  | 'previousStep'
  | 'nextStep'
  | 'planView'
  | 'soundOrMatch'
  | 'matchEnd'
  | 'matchPause'
  | 'matchRemove'
  | 'undo'
  | 'redo';

export interface Key {
  key: string;
  shiftKey: boolean;
  ctrlKey: boolean;
  altKey: boolean;
  metaKey: boolean;
}

const kKeys: Record<string, Action> = {
  ' ': 'toggle',
  ',': 'frameBack',
  '.': 'frameForward',
  ArrowLeft: 'back5',
  ArrowRight: 'forward5',
  ArrowUp: 'forward60',
  ArrowDown: 'back60',
  '[': 'slower',
  ']': 'faster',
  PageUp: 'previousMark',
  PageDown: 'nextMark',
  f: 'fullScreen',
  F: 'fullScreen',
  '?': 'help',
  g: 'goTo',
  G: 'goTo',
  i: 'selectFrom',
  I: 'selectFrom',
  o: 'selectTo',
  O: 'selectTo',
  Escape: 'clearSelection',
  Home: 'begin',
  End: 'end',
  a: 'original',
  A: 'original',
  p: 'previousStep',
  P: 'previousStep',
  n: 'nextStep',
  N: 'nextStep',
  c: 'planView',
  C: 'planView',
  m: 'soundOrMatch',
  M: 'soundOrMatch',
  e: 'matchEnd',
  E: 'matchEnd',
  b: 'matchPause',
  B: 'matchPause',
  Delete: 'matchRemove',
};
const kShifted: Record<string, Action> = { ArrowLeft: 'back1', ArrowRight: 'forward1' };

export function actionOf(key: Key): Action | undefined {
  if (key.ctrlKey !== key.metaKey && !key.altKey && key.key.toLowerCase() === 'z') return key.shiftKey ? 'redo' : 'undo';
  if (key.ctrlKey || key.altKey || key.metaKey) return undefined;
  return (key.shiftKey ? kShifted[key.key] : undefined) ?? kKeys[key.key];
}

/** Keys and what they do, for the page of help: message keys of what they do. */
export const kHelp: readonly { keys: readonly string[]; does: `key.${string}` }[] = [
  { keys: ['Space'], does: 'key.toggle' },
  { keys: [',', '.'], does: 'key.frame' },
  { keys: ['←', '→'], does: 'key.five' },
  { keys: ['Shift ←', 'Shift →'], does: 'key.one' },
  { keys: ['↓', '↑'], does: 'key.minute' },
  { keys: ['[', ']'], does: 'key.speed' },
  { keys: ['Page Up', 'Page Down'], does: 'key.marks' },
  { keys: ['M'], does: 'key.sound' },
  { keys: ['P', 'N'], does: 'key.steps' },
  { keys: ['C'], does: 'key.planView' },
  { keys: ['M'], does: 'key.matchBegin' },
  { keys: ['E'], does: 'key.matchEnd' },
  { keys: ['B'], does: 'key.matchPause' },
  { keys: ['Delete'], does: 'key.matchRemove' },
  { keys: ['Ctrl Z', 'Ctrl Shift Z'], does: 'key.undo' },
  { keys: ['Home', 'End'], does: 'key.ends' },
  { keys: ['A'], does: 'key.original' },
  { keys: ['G'], does: 'key.goTo' },
  { keys: ['I', 'O'], does: 'key.select' },
  { keys: ['Esc'], does: 'key.clear' },
  { keys: ['F'], does: 'key.fullScreen' },
  { keys: ['?'], does: 'key.help' },
];
