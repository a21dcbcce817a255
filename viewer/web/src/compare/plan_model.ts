// The comparison that a case's view shows: which there are, the one that was chosen with its document, and how the plan lies beside the pictures.
import { type Signal, signal } from '@preact/signals';
import { cases } from '@/api/client';
import type { Comparison, ComparisonDocument } from '@/api/types';
import { type PlanMap, planMap } from '@/compare/plan_map';
import { PlanPlayer } from '@/compare/plan_player';
import type { Playback } from '@/media/playback';

export const kPlanViews = ['beside', 'overlay', 'wipe', 'none'] as const;
export type PlanView = (typeof kPlanViews)[number];

export interface ShownComparison {
  row: Comparison;
  document: ComparisonDocument;
  map: PlanMap | undefined;
  /** Where there are a film and a time map. */
  player: PlanPlayer | undefined;
}

export class PlanModel {
  readonly list: Signal<readonly Comparison[]> = signal([]);
  readonly unreadable: Signal<readonly { name: string; problem: string }[]> = signal([]);
  readonly shown: Signal<ShownComparison | undefined> = signal(undefined);
  readonly view: Signal<PlanView> = signal('beside');
  /** Of an overlay: the plan's opacity; of a wipe: where its edge is. */
  readonly share = signal(0.5);
  private closed = false;
  private chosen = '';

  constructor(
    private readonly caseId: string,
    private readonly playback: Playback,
    private readonly onProblem: (error: Error) => void,
  ) {
    void this.open();
  }

  close(): void {
    this.closed = true;
    this.show(undefined);
  }

  /** Shows another of the list. */
  async choose(name: string): Promise<void> {
    const row = this.list.peek().find((one) => one.name === name);
    if (!row) return;
    this.chosen = name;
    try {
      const document = await cases.comparison(this.caseId, name);
      if (this.closed || this.chosen !== name) return;
      const map = planMap(document);
      this.show({ row, document, map, player: row.replay && map ? new PlanPlayer(this.caseId, name, map, this.onProblem) : undefined });
    } catch (error) {
      if (error instanceof Error) this.onProblem(error);
    }
  }

  private show(next: ShownComparison | undefined): void {
    const before = this.shown.peek()?.player;
    if (before) {
      this.playback.followers.delete(before);
      before.close();
    }
    if (next?.player) this.playback.followers.add(next.player);
    this.shown.value = next;
  }

  private async open(): Promise<void> {
    try {
      const { comparisons, unreadable } = await cases.comparisons(this.caseId);
      if (this.closed) return;
      this.list.value = comparisons;
      this.unreadable.value = unreadable;
      // The newest says most.
      const newest = [...comparisons].sort((a, b) => (a.made_at < b.made_at ? 1 : -1))[0];
      if (newest) await this.choose(newest.name);
    } catch (error) {
      if (!this.closed && error instanceof Error) this.onProblem(error);
    }
  }
}
