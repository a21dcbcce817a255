// Which motion is saved. The server answers in numbers that have gone through its units, and may differ in their last digit: what counts is what was
// sent. Pure but for its own state.
import { type Motion, sameMotion } from '@/breathing/motion';

export class KeptMotion {
  private kept: Motion | undefined;
  private newest = 0;
  private readonly sent = new Map<number, Motion>();

  /** As the model has it that was opened. */
  open(motion: Motion): void {
    this.kept = motion;
  }
  /** In the message of that number, from 1. */
  send(input: number, motion: Motion): void {
    if (input > 0) this.sent.set(input, motion);
  }
  /** What that message asked for is saved; a model that is sealed may be told of after one that was sent later. */
  save(input: number): void {
    const motion = this.sent.get(input);
    this.sent.delete(input);
    if (motion === undefined || input < this.newest) return;
    this.newest = input;
    this.kept = motion;
  }
  has(motion: Motion): boolean {
    return this.kept === undefined || sameMotion(motion, this.kept);
  }
}
