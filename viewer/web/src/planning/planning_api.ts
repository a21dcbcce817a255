// The planner's part of the API (docs/reference/viewer.md, "Planning"): the list of plans, and the WebSocket of one that is open.
import { get } from '@/api/client';
import { splitPicture } from '@/media/picture_message';
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
  /** Of a grasper: how far apart its jaws are, how hard each presses, what pulls along them, what friction can hold, how far the tissue has slipped. */
  jaws?: { opening_m: number; squeeze_n: number; pull_n: number; most_pull_n: number; slipped_m: number; slips: boolean };
}

/** What goes with a picture. */
export interface PlanMoment {
  picture: number;
  input: number;
  time_s: number;
  moves: boolean;
  tools: ToolState[];
  largest_von_mises_pa: number;
  largest_displacement_m: number;
  computing_ms: number;
  drawing_ms: number;
}

export type Deed =
  | { view: View }
  | { use: 'grasp' | 'pinch' | 'press'; pointers: readonly PlanPointer[] }
  | { cut: { line: readonly Place[]; depth_m: number } }
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

/** One plan over one connection. Of pictures that come while one is being decoded only the newest is shown. */
export class PlanConnection {
  private readonly socket: WebSocket;
  private left = false;
  private decoding = false;
  private next: ArrayBuffer | undefined;
  private failed = '';
  private last = 0;

  constructor(
    open: { plan: string; anew: boolean },
    private readonly listener: PlanListener,
  ) {
    this.socket = new WebSocket(`wss://${location.host}/api/planning/table`);
    this.socket.binaryType = 'arraybuffer';
    this.socket.onopen = () => this.socket.send(JSON.stringify({ open }));
    this.socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (this.left) return;
      if (typeof event.data === 'string') this.hear(JSON.parse(event.data) as Said);
      else void this.show(event.data);
    };
    this.socket.onclose = (event) => {
      if (!this.left) listener.lost(this.failed || event.reason);
      this.left = true;
    };
  }

  /** The number that pictures name once they show it; 0 while nothing can be sent. */
  send(deed: Deed): number {
    if (this.left || this.socket.readyState !== WebSocket.OPEN) return 0;
    this.socket.send(JSON.stringify({ input: ++this.last, ...deed }));
    return this.last;
  }
  /** Nothing is told any more. */
  leave(): void {
    this.left = true;
    this.socket.close();
  }

  private hear(said: Said): void {
    if (said.opening !== undefined) this.listener.opening(said.opening);
    if (said.opened) this.listener.opened(said.opened);
    if (said.steps) this.listener.steps({ steps: said.steps, undo: said.undo === true, redo: said.redo === true });
    if (said.told !== undefined) this.listener.told(said.told);
    if (said.saved) this.listener.saved(said.saved.plan);
    if (said.failed !== undefined) {
      this.failed = said.failed;
      this.socket.close();
    }
  }
  private async show(message: ArrayBuffer): Promise<void> {
    this.next = message;
    if (this.decoding) return;
    this.decoding = true;
    try {
      while (this.next && !this.left) {
        const { about, jpeg } = splitPicture<PlanMoment>(this.next);
        this.next = undefined;
        const picture = await createImageBitmap(jpeg);
        if (!this.left) this.listener.moment(about, picture);
        picture.close();
      }
    } finally {
      this.decoding = false;
    }
  }
}
