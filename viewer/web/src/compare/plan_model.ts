// The comparison that a case's view shows: which there are, the one that was chosen with its document, and how the plan lies beside the pictures.
import { computed, effect, type ReadonlySignal, type Signal, signal } from '@preact/signals';
import { cases } from '@/api/client';
import type { Comparison, ComparisonDocument } from '@/api/types';
import type { Span } from '@/base/spans';
import { MatchingModel } from '@/compare/matching_model';
import { organSummary } from '@/compare/organ_place';
import { PickingModel } from '@/compare/picking_model';
import { type PlanMap, planMap } from '@/compare/plan_map';
import { PlanPlayer } from '@/compare/plan_player';
import type { Playback } from '@/media/playback';

export const kPlanViews = ['beside', 'overlay', 'wipe', 'difference', 'none'] as const;
export type PlanView = (typeof kPlanViews)[number];

export interface ShownComparison {
  row: Comparison;
  document: ComparisonDocument;
  map: PlanMap | undefined;
  /** Where there are a film and a time map; the film is the one that was chosen last. */
  player: PlanPlayer | undefined;
  film: PlanFilm;
}

/** As the endoscope would see it, or as the fluoroscope would. */
export type PlanFilm = 'replay' | 'radiographs';

export const filmsOf = (row: Comparison): PlanFilm[] => (['replay', 'radiographs'] as const).filter((one) => row[one]);
/** A difference is of two radiographs. */
export const viewsOf = (film: PlanFilm): PlanView[] => kPlanViews.filter((one) => one !== 'difference' || film === 'radiographs');
/** The recorded pictures that it belongs to. */
export const streamOf = ({ document, film }: ShownComparison): string =>
  (film === 'radiographs' ? document.fluoroscopy?.stream : undefined) ?? document.case.stream;

export class PlanModel {
  readonly list: Signal<readonly Comparison[]> = signal([]);
  readonly unreadable: Signal<readonly { name: string; problem: string }[]> = signal([]);
  readonly shown: Signal<ShownComparison | undefined> = signal(undefined);
  readonly view: Signal<PlanView> = signal('beside');
  /** Of an overlay: the plan's opacity; of a wipe: where its edge is. */
  readonly share = signal(0.5);
  /** Whether the organ's outline is drawn where it was found. */
  readonly outline = signal(true);
  /** Whether the colours of an organ that is deformed to fit say how far it departs from the plan, instead of from rest. */
  readonly fromPlan = signal(false);
  /** Of the comparison that is shown; nothing where the organ was not looked for. */
  readonly organ = computed(() => {
    const alignment = this.shown.value?.document.organ_alignment;
    return alignment ? { alignment, summary: organSummary(alignment) } : undefined;
  });
  readonly matching: MatchingModel;
  readonly picking: PickingModel;
  private closed = false;
  private chosen = '';
  private readonly unfollow: () => void;

  constructor(
    private readonly caseId: string,
    private readonly playback: Playback,
    private readonly onProblem: (error: Error) => void,
    /** On the time line. */
    selection: ReadonlySignal<Span | undefined>,
    /** The case names a plan, so that a comparison of it may be in the making. */
    isPlanned: boolean,
  ) {
    this.matching = new MatchingModel(caseId, onProblem, (name) => this.open(name), selection);
    this.picking = new PickingModel(caseId, this.matching, playback, onProblem);
    // What is matched by hand is seen at once, where there is a film of that plan.
    this.unfollow = effect(() => {
      const shown = this.shown.value;
      const plan = this.matching.plan.value;
      const map = plan && plan.seal === shown?.document.plan.seal ? this.matching.map.value : shown?.map;
      if (map) shown?.player?.follow(map);
    });
    void this.open();
    if (isPlanned) void this.matching.resume();
  }

  close(): void {
    this.closed = true;
    this.unfollow();
    this.picking.close();
    this.matching.close();
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
      this.showFilm({ row, document, map: planMap(document) }, filmsOf(row)[0] ?? 'replay');
    } catch (error) {
      if (error instanceof Error) this.onProblem(error);
    }
  }

  /** The other film of the comparison that is shown. */
  chooseFilm(film: PlanFilm): void {
    const shown = this.shown.peek();
    if (shown && shown.film !== film) this.showFilm(shown, film);
  }

  private showFilm({ row, document, map }: Pick<ShownComparison, 'row' | 'document' | 'map'>, film: PlanFilm): void {
    if (!viewsOf(film).includes(this.view.peek())) this.view.value = 'overlay';
    this.show({ row, document, map, film, player: row[film] && map ? new PlanPlayer(this.caseId, row.name, film, map, this.onProblem) : undefined });
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

  /** Reads the list; shows the one of that name, else the newest, which says most. */
  private async open(name?: string): Promise<void> {
    try {
      const { comparisons, unreadable } = await cases.comparisons(this.caseId);
      if (this.closed) return;
      this.list.value = comparisons;
      this.unreadable.value = unreadable;
      const newest = [...comparisons].sort((a, b) => (a.made_at < b.made_at ? 1 : -1))[0];
      const wanted = name ?? newest?.name;
      if (wanted !== undefined) await this.choose(wanted);
    } catch (error) {
      if (!this.closed && error instanceof Error) this.onProblem(error);
    }
  }
}
