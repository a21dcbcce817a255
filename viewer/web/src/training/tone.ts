// The danger tone: silent below half of the damage limit, then rising with the stress.
const kLoudness = 0.12;
const kLag_s = 0.03;

export class Tone {
  private context: AudioContext | undefined;
  private oscillator: OscillatorNode | undefined;
  private gain: GainNode | undefined;
  muted = false;

  /** To be called in answer to a deed of the person: browsers play nothing before. */
  start(): void {
    this.context = new AudioContext();
    this.oscillator = this.context.createOscillator();
    this.gain = this.context.createGain();
    this.gain.gain.value = 0;
    this.oscillator.connect(this.gain).connect(this.context.destination);
    this.oscillator.start();
  }
  play(hz: number): void {
    if (!this.context || !this.oscillator || !this.gain) return;
    const now = this.context.currentTime;
    if (hz > 0) this.oscillator.frequency.setTargetAtTime(hz, now, kLag_s);
    this.gain.gain.setTargetAtTime(hz > 0 && !this.muted ? kLoudness : 0, now, kLag_s);
  }
  stop(): void {
    void this.context?.close();
    this.context = undefined;
  }
}
