// The list of all appliances' cases that was asked for, and what follows it. A list stands under its own question alone.
import { signal } from '@preact/signals';
import type { FleetCase } from '@/api/types';
import { type FleetQuestion, isSearch } from '@/fleet/question';
import { notifyOf, textOf } from '@/shell/state';

/** What a search by patient or procedure looked at. */
export interface LookedAt {
  looked_at: number;
  without_note: number;
  not_by_this_key: number;
}
export interface CasesPage extends Partial<LookedAt> {
  cases: readonly FleetCase[];
  next: string | null;
}
export type AskForCases = (question: FleetQuestion, after?: string) => Promise<CasesPage>;

export class FoundCases {
  /** Undefined while there is no answer to the newest question. */
  readonly list = signal<readonly FleetCase[] | undefined>(undefined);
  readonly next = signal<string | null>(null);
  /** Of a search whose answer is the list. */
  readonly lookedAt = signal<LookedAt | undefined>(undefined);
  /** Why there is none. */
  readonly problem = signal<string | undefined>(undefined);
  private question: FleetQuestion | undefined;

  constructor(private readonly ask: AskForCases) {}

  /** True once its answer is the list. What was found stays while the same is asked for again. */
  async find(question: FleetQuestion): Promise<boolean> {
    if (question !== this.question) {
      this.list.value = undefined;
      this.next.value = null;
      this.lookedAt.value = undefined;
    }
    this.question = question;
    this.problem.value = undefined;
    try {
      const found = await this.ask(question);
      if (this.question !== question) return false; // another was asked meanwhile
      this.list.value = found.cases;
      this.next.value = found.next;
      const { looked_at, without_note = 0, not_by_this_key = 0 } = found;
      this.lookedAt.value = looked_at === undefined ? undefined : { looked_at, without_note, not_by_this_key };
      return true;
    } catch (error) {
      if (this.question !== question) return false;
      if (this.list.peek() === undefined) this.problem.value = textOf(error);
      else notifyOf(error);
      return false;
    }
  }
  /** The server is back. A search is asked for by a person alone, since each is entered in the server's log. */
  async again(): Promise<boolean> {
    return this.question !== undefined && !isSearch(this.question) && (await this.find(this.question));
  }
  async more(): Promise<void> {
    const { question } = this;
    const after = this.next.peek();
    if (question === undefined || after === null) return;
    try {
      const found = await this.ask(question, after);
      if (this.question !== question || this.next.peek() !== after) return;
      this.list.value = [...(this.list.peek() ?? []), ...found.cases];
      this.next.value = found.next;
    } catch (error) {
      notifyOf(error);
    }
  }
}
