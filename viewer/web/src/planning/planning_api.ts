// The planner's part of the API (docs/reference/viewer.md, "Planning"): the list of plans, and the WebSocket of one that is open.
import { get } from '@/api/client';
import { PictureSocket } from '@/media/picture_socket';
import type { HandleDeed, ShownCut } from '@/planning/cut_handles';
import type { View } from '@/planning/orbit';
import type { PlanPointer, Place } from '@/planning/plan_pointers';

export interface ListedPlan {
  plan: string;
  name: string;
  steps: number;
  has_volume: boolean;
}

export interface Opened {
  plan: string;
  name: string;
  vertices: number;
  time_step_s: number;
  warnings: string[];
  renderer: string;
}

export interface Step {
  name: string;
  action: 'grasp' | 'close' | 'retract' | 'press' | 'hold' | 'cut' | 'release';
  tools: string[];
  duration_s: number;
}

export interface Steps {
  steps: Step[];
  undo: boolean;
  redo: boolean;
}

export interface ToolState {
  name: string;
  kind: string;
  force_n: number;
  nodes: number;
  x: number;
  y: number;
  /** Of a grasper or a clip: how far apart its jaws are, how hard each presses, what pulls along them, what friction can hold, how far the tissue has slipped; whether the clip's applier has left it. */
  jaws?: { opening_m: number; squeeze_n: number; pull_n: number; most_pull_n: number; slipped_m: number; slips: boolean; left: boolean };
}

/** What goes with a picture. */
export interface PlanMoment {
  picture: number;
  input: number;
  time_s: number;
  moves: boolean;
  tools: ToolState[];
  cuts: ShownCut[];
  largest_von_mises_pa: number;
  largest_displacement_m: number;
  computing_ms: number;
  drawing_ms: number;
}

export type Deed =
  | { view: View }
  | { use: 'grasp' | 'pinch' | 'clip' | 'press'; pointers: readonly PlanPointer[] }
  | { cut: { line: readonly Place[]; depth_m: number } }
  | { handle: HandleDeed }
  | { hold: { duration_s: number } }
  | { release: { tool: string } }
  | { close: { tool: string; share: number } }
  | { undo: true }
  | { redo: true }
  | { stress: { largest_pa: number } | null }
  | { save: { file: string; name: string } };

export const planning = {
  plans: async () => (await get<{ plans: ListedPlan[] }>('planning/plans')).plans,
};

export interface PlanListener {
  opening: (step: string) => void;
  opened: (opened: Opened) => void;
  steps: (steps: Steps) => void;
  moment: (moment: PlanMoment, picture: ImageBitmap) => void;
  told: (sentence: string) => void;
  saved: (plan: string) => void;
  /** The connection ended, with the server's sentence or none. */
  lost: (sentence: string) => void;
}

interface Said {
  opening?: string;
  opened?: Opened;
  steps?: Step[];
  undo?: boolean;
  redo?: boolean;
  told?: string;
  saved?: { plan: string };
  failed?: string;
}

/** One plan over one connection. */
export class PlanConnection {
  private readonly socket: PictureSocket<Said, PlanMoment>;

  constructor(
    open: { plan: string; anew: boolean },
    private readonly listener: PlanListener,
  ) {
    this.socket = new PictureSocket('planning/table', { said: (said) => this.hear(said), moment: listener.moment, lost: listener.lost }, { open });
  }

  /** The number that pictures name once they show it; 0 while nothing can be sent. */
  send(deed: Deed): number {
    return this.socket.send(deed);
  }
  /** Nothing is told any more. */
  leave(): void {
    this.socket.leave();
  }

  private hear(said: Said): void {
    if (said.opening !== undefined) this.listener.opening(said.opening);
    if (said.opened) this.listener.opened(said.opened);
    if (said.steps) this.listener.steps({ steps: said.steps, undo: said.undo === true, redo: said.redo === true });
    if (said.told !== undefined) this.listener.told(said.told);
    if (said.saved) this.listener.saved(said.saved.plan);
  }
}
