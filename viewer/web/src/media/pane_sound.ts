// Which panes are heard, and how loud. What a person chose is remembered while the browser's tab is open.
import { computed, type ReadonlySignal, type Signal, signal } from '@preact/signals';

/** At other speeds speech is not understood, and nothing is heard. */
export const kSlowestHeard = 0.5;
export const kFastestHeard = 2;

export const isHeardAt = (rate: number): boolean => rate >= kSlowestHeard && rate <= kFastestHeard;

/** What was chosen for a stream; what is not there was not chosen. */
export interface SoundChoice {
  muted?: boolean;
  /** From 0 to 1. */
  volume?: number;
}

/** Without a choice the master, the first of the panes that have sound, is heard, and no other. */
export const isMuted = (choice: SoundChoice, isMaster: boolean): boolean => choice.muted ?? !isMaster;

/** What `kept` says, as text of this module; nothing where it is none. */
export function readChoices(kept: string | null): Record<string, SoundChoice> {
  const choices: Record<string, SoundChoice> = {};
  try {
    for (const [stream, one] of Object.entries(JSON.parse(kept ?? '{}') as Record<string, SoundChoice | null>)) {
      const choice: SoundChoice = {};
      if (typeof one?.muted === 'boolean') choice.muted = one.muted;
      if (typeof one?.volume === 'number' && one.volume >= 0 && one.volume <= 1) choice.volume = one.volume;
      choices[stream] = choice;
    }
  } catch {
    // someone else's text
  }
  return choices;
}

const kKey = 'kiroku.sound';

const choices = signal<Record<string, SoundChoice>>(readChoices(sessionStorage.getItem(kKey)));

function choose(stream: string, choice: SoundChoice): void {
  choices.value = { ...choices.peek(), [stream]: { ...choices.peek()[stream], ...choice } };
  sessionStorage.setItem(kKey, JSON.stringify(choices.peek()));
}

/** The sound of one pane. */
export class PaneSound {
  /** Nothing until it is known whether there is any. */
  readonly isThere: Signal<boolean | undefined> = signal(undefined);
  readonly isMaster = signal(false);
  readonly muted: ReadonlySignal<boolean> = computed(() => isMuted(choices.value[this.stream] ?? {}, this.isMaster.value));
  readonly volume: ReadonlySignal<number> = computed(() => choices.value[this.stream]?.volume ?? 1);

  constructor(private readonly stream: string) {}

  /** What is to be heard again and was turned down to nothing is heard in full. */
  mute(muted: boolean): void {
    choose(this.stream, !muted && this.volume.peek() === 0 ? { muted, volume: 1 } : { muted });
  }

  setVolume(volume: number): void {
    choose(this.stream, { volume, muted: volume === 0 });
  }
}

/** All panes of a case: what the key M does. */
export function toggleSound(panes: readonly PaneSound[]): 'off' | 'on' | 'none' {
  const withSound = panes.filter((one) => one.isThere.peek());
  if (withSound.length === 0) return 'none';
  const heard = withSound.filter((one) => !one.muted.peek());
  if (heard.length > 0) {
    for (const one of heard) one.mute(true);
    return 'off';
  }
  (withSound[0] as PaneSound).mute(false);
  return 'on';
}
