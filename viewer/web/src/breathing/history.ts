// What can be undone and done again. A slider that is dragged is one step, however many values it went through. Pure but for its own state.

const kMost = 500;

export class History<T> {
  private before: T[] = [];
  private after: T[] = [];
  private control: string | undefined;

  constructor(
    private value: T,
    private readonly same: (one: T, other: T) => boolean,
  ) {}

  get now(): T {
    return this.value;
  }
  get canUndo(): boolean {
    return this.before.length > 0;
  }
  get canRedo(): boolean {
    return this.after.length > 0;
  }

  /** Changes by the same control are one step until settle(). */
  change(next: T, control: string): void {
    if (this.same(next, this.value)) return;
    if (this.control !== control) this.before = [...this.before, this.value].slice(-kMost);
    this.control = control;
    this.after = [];
    this.value = next;
  }
  /** The slider was let go. */
  settle(): void {
    this.control = undefined;
  }
  undo(): boolean {
    const last = this.before.pop();
    if (last === undefined) return false;
    this.after.push(this.value);
    this.value = last;
    this.settle();
    return true;
  }
  redo(): boolean {
    const next = this.after.pop();
    if (next === undefined) return false;
    this.before.push(this.value);
    this.value = next;
    this.settle();
    return true;
  }
}
