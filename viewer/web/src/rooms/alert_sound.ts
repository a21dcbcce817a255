// The sound of loss and silence, for whoever wishes it on this machine: off until then, and remembered.
import { signal } from '@preact/signals';

const kStored = 'kiroku.alertSound';
const kTones_hz = [880, 660] as const;
const kTone_s = 0.16;
const kLoudness = 0.2;

export const alertSound = signal(localStorage.getItem(kStored) === 'on');
/** It is wished for, and the browser plays nothing before somebody has pressed something on the page. */
export const alertSoundWaits = signal(false);

let context: AudioContext | undefined;

async function ready(): Promise<AudioContext | undefined> {
  context ??= new AudioContext();
  // In a browser that waits for a deed this is answered only then.
  void context.resume();
  await new Promise((resolve) => setTimeout(resolve, 0));
  alertSoundWaits.value = context.state !== 'running';
  return context.state === 'running' ? context : undefined;
}

export async function ring(): Promise<void> {
  if (!alertSound.value) return;
  const plays = await ready();
  if (!plays) return;
  kTones_hz.forEach((hz, i) => {
    const tone = plays.createOscillator();
    const gain = plays.createGain();
    const start = plays.currentTime + i * kTone_s;
    tone.frequency.value = hz;
    gain.gain.setValueAtTime(kLoudness, start);
    gain.gain.setTargetAtTime(0, start + 0.8 * kTone_s, 0.01);
    tone.connect(gain).connect(plays.destination);
    tone.start(start);
    tone.stop(start + kTone_s);
  });
}

/** By a press; rings once, so that one hears what it is like. */
export function setAlertSound(on: boolean): void {
  alertSound.value = on;
  localStorage.setItem(kStored, on ? 'on' : 'off');
  alertSoundWaits.value = false;
  if (on) void ring();
}

/** Any press lets what waits sound from then on. */
export function wakeAlertSound(): void {
  if (alertSound.value && alertSoundWaits.value) void ready();
}
