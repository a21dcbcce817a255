// The breathing workbench's part of the API (docs/reference/viewer.md, "Breathing"): the WebSocket of the lung that is served.
import type { Surface } from '@/breathing/lung_surface';
import type { Group, Motion, NumberOfGroup, Vector } from '@/breathing/motion';
import { PictureSocket } from '@/media/picture_socket';

/** Of which case's fluoroscopy the radiographs are; the first was taken so long after the case began. */
export interface FluoroscopyOfCase {
  case: string;
  stream: string;
  first_s: number;
}
export interface OpenedLung {
  file: string;
  vertices: number;
  groups: Record<string, number>;
  columns: number;
  rows: number;
  /** So many; 0: the lung is seen alone. */
  radiographs: number;
  /** null: they are of no case. */
  recording: FluoroscopyOfCase | null;
  /** Whether there are enough of them for a fit. */
  can_fit: boolean;
  /** Whether models can be sealed here as plans. */
  may_seal: boolean;
  warnings: string[];
  motion: Motion;
}
/** Where the tumour goes: from its place at rest, at the moments of the time line. */
export interface Path {
  revision: number;
  duration_s: number;
  times_s: number[];
  mm: Vector[];
}
export interface Similarity {
  revision: number;
  /** By radiograph; null: not measured yet. */
  values: (number | null)[];
}
export interface LungMoment {
  picture: number;
  input: number;
  revision: number;
  time_s: number;
  radiograph: number | null;
  tumour_mm: Vector;
  drawing_ms: number;
}

/** What a fit does now. */
export interface Fitting {
  doing: string;
  done: number;
  all: number;
}
export type GroupErrors = Record<NumberOfGroup | 'explained', number>;
export interface SeenTumour {
  mm: Vector;
  error_mm: Vector;
}
/** What was found; motion and errors are null where it was refused, with the sentence that says why. */
export interface Fitted {
  refusal: string | null;
  motion: Motion | null;
  /** Standard errors; of the cycle null where it was not sought. */
  errors: (Record<Group, GroupErrors> & { cycle_s: number | null }) | null;
  similarity: { before: number; after: number };
  findings: string[];
  took_s: number;
  /** By radiograph: where the tumour was seen, from its place at rest. */
  tumour: (SeenTumour | null)[];
}

/** What froze a model: its hash is in the appliance log. Of a stamp time and kind, or problem, are empty. */
export interface ModelSeal {
  file: string;
  sha256: string;
  time_stamps: { authority: string; time: string; kind: 'external' | 'self-issued' | ''; problem: string }[];
}
interface Saved {
  /** Of the message that asked for it. */
  input: number;
  file: string;
  seal: ModelSeal | null;
}

/** A motion that is not shown, and the one that is. */
export interface RefusedMotion {
  /** Of the newest message that had come by then. */
  input: number;
  why: string;
  motion: Motion;
}

export const kModes = ['beside', 'opacity', 'wipe', 'difference', 'contour'] as const;
export type Mode = (typeof kModes)[number];
export interface Look {
  mode: Mode;
  part: number;
  outlined: boolean;
}

export type LungDeed =
  | { motion: Motion }
  | { moment: { time_s: number } }
  | { look: Look }
  | { save: { file: string; motion: Motion; seal: boolean } }
  | { fit: { motion: Motion; direction: boolean } }
  | { cancel: true };

export interface LungListener {
  opened: (opened: OpenedLung) => void;
  path: (path: Path) => void;
  similarity: (similarity: Similarity) => void;
  moment: (moment: LungMoment, picture: ImageBitmap) => void;
  fitting: (fitting: Fitting) => void;
  fitted: (fitted: Fitted) => void;
  fitEnded: (sentence: string) => void;
  told: (sentence: string) => void;
  saved: (saved: Saved) => void;
  surface: (surface: Surface | null) => void;
  refused: (refused: RefusedMotion) => void;
  lost: (sentence: string) => void;
}

interface Said {
  opened?: OpenedLung;
  path?: Path;
  similarity?: Similarity;
  fitting?: Fitting;
  fitted?: Fitted;
  fit_ended?: string;
  told?: string;
  saved?: Saved;
  surface?: Surface | null;
  refused?: RefusedMotion;
  failed?: string;
}

export class LungConnection {
  private readonly socket: PictureSocket<Said, LungMoment>;

  constructor(listener: LungListener) {
    this.socket = new PictureSocket<Said, LungMoment>('breathing/table', {
      said: (said) => {
        if (said.opened) listener.opened(said.opened);
        if (said.surface !== undefined) listener.surface(said.surface);
        if (said.refused) listener.refused(said.refused);
        if (said.path) listener.path(said.path);
        if (said.similarity) listener.similarity(said.similarity);
        if (said.fitting) listener.fitting(said.fitting);
        if (said.fitted) listener.fitted(said.fitted);
        if (said.fit_ended !== undefined) listener.fitEnded(said.fit_ended);
        if (said.told !== undefined) listener.told(said.told);
        if (said.saved) listener.saved(said.saved);
      },
      moment: listener.moment,
      lost: listener.lost,
    });
  }
  /** The number that pictures name once they show it; 0 while nothing can be sent. */
  send(deed: LungDeed): number {
    return this.socket.send(deed);
  }
  leave(): void {
    this.socket.leave();
  }
}
