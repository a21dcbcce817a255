// The trainer's API and the messages of an attempt (docs/explanation/training.md, "The page").
import { get, post } from '@/api/client';
import { splitPicture } from '@/media/picture_message';

/** 'a', 'b', 'c', or what a patient's organ is called. */
export type ObjectName = string;
export type Ending = 'done' | 'time-over' | 'given-up' | 'broken-off';
/** In trocars, as many as fingers; '': fingertips. */
export type Instrument = '' | 'retractor';
export const kInstruments: readonly Instrument[] = ['', 'retractor'];
export type Measure = 'stress' | 'high-stress' | 'time' | 'path' | 'force' | 'damage';
export const kMeasures: readonly Measure[] = ['stress', 'high-stress', 'time', 'path', 'force', 'damage'];

export interface Trainee {
  name: string;
  group: string;
  /** Who trains so, besides administrators; '': nobody. */
  user: string;
  progress: Record<ObjectName, { session: number; practised_s: number }>;
}

export interface Training {
  objects: ObjectName[];
  /** Those that perhaps nobody can push aside: a simulated trainee could not. */
  doubted: ObjectName[];
  fingers: number;
  groups: string[];
  experts: ObjectName[];
  damage_pa: number;
  /** Of a session, before its test; 0: as one likes. */
  practice_s: number;
  /** By which a questionnaire and a checklist are kept, in their order. */
  questions: string[];
  checklist_items: string[];
  /** Adds trainees for others, trains as everybody, and fills in checklists. */
  supervises: boolean;
  trainees: Trainee[];
}

export interface Score {
  done: boolean;
  time_s: number;
  largest_von_mises_pa: number;
  /** null: of an attempt from before there was this measure. */
  high_von_mises_pa: number | null;
  damaged_ml: number;
  path_m: number;
  peak_force_n: number;
  peak_wrist_force_n: number;
  best_visible_share: number;
}

/** From "no" to "yes". */
export const kAnswers = [-2, -1, 0, 1, 2] as const;
export interface Questionnaire {
  answers: Record<string, number | null>;
  comment: string;
}
export type ItemState = 'done' | 'not-done' | 'not-seen';
export const kItemStates: readonly ItemState[] = ['done', 'not-done', 'not-seen'];
export const kRatings = [1, 2, 3, 4, 5] as const;
export interface Checklist {
  items: Record<string, ItemState>;
  /** One of kRatings. */
  global_rating: number;
  examiner: string;
}

export interface AttemptKept {
  /** By which the server knows it. */
  attempt: number;
  session: number;
  test: boolean;
  stress_shown: boolean;
  fingers: number;
  instrument: Instrument;
  ending: Ending;
  score: Score;
  /** That was made of it, or ''. */
  case: string;
  /** `by`: the user who filled it in. null: nobody did. */
  questionnaire: (Questionnaire & { by: string }) | null;
  checklist: (Checklist & { by: string }) | null;
}

export interface Curve {
  measure: Measure;
  own: { fingers: number; session: number; value: number }[];
  groups: { group: string; fingers: number; points: { session: number; trainees: number; mean: number; low?: number; high?: number }[] }[];
}

export interface Results {
  trainee: string;
  object: ObjectName;
  attempts: AttemptKept[];
  curves: Curve[];
}

export interface Begin {
  trainee: string;
  object: ObjectName;
  fingers: number;
  test: boolean;
  expert: boolean;
  /** Colours what fingers press. */
  press: boolean;
  /** In practice; absent: fingertips. */
  instrument?: Exclude<Instrument, ''>;
}

export interface Began {
  session: number;
  test: boolean;
  stress_shown: boolean;
  object: ObjectName;
  fingers: number;
  vertices: number;
  damage_pa: number;
  visible_share: number;
  hold_s: number;
  most_s: number;
  instrument?: Instrument;
  /** Where what is pressed is coloured: the force of blue and the force of red. */
  press_n?: [number, number];
}

/** What goes with a picture; what tells of stress is there only where it is shown. */
export interface Moment {
  picture: number;
  input: number;
  time_s: number;
  visible_share: number;
  held_s: number;
  forces_n: number[];
  /** On the wall, at the trocar of each instrument. */
  walls_n?: number[];
  wrist_force_n: number;
  input_to_force_ms: number;
  path_m: number;
  largest_von_mises_pa?: number;
  danger?: number;
  tone_hz?: number;
}

export interface Latency {
  median_ms: number;
  of_99_percent_ms: number;
  longest_ms: number;
}

export interface Over {
  attempt: number;
  can_be_sealed: boolean;
  ending: Ending;
  score: Score;
  input_to_force: Latency;
  input_to_picture: Latency;
  force_rate_hz: number;
  picture_rate_hz: number;
}

export interface Pointer {
  /** From 1; 0: all fingers of the hand. */
  finger: number;
  x: number;
  y: number;
  push_m: number;
}

export const training = {
  get: () => get<Training>('training'),
  addTrainee: (name: string, group: string, user: string) => post<Trainee>('training/trainees', user === '' ? { name, group } : { name, group, user }),
  seal: (attempt: number) => post<{ case: string; verdict: string }>(`training/attempts/${attempt}/case`, {}),
  /** Until the attempt is sealed. */
  keepQuestionnaire: (attempt: number, said: Questionnaire) => post<{ kept: boolean }>(`training/attempts/${attempt}/questionnaire`, said),
  keepChecklist: (attempt: number, checklist: Checklist) => post<{ kept: boolean }>(`training/attempts/${attempt}/checklist`, checklist),
  certificate: (attempt: number, language: string) => `/api/training/attempts/${attempt}/certificate.pdf?language=${language}`,
  results: (trainee: string, object: ObjectName) => get<Results>(`training/trainees/${encodeURIComponent(trainee)}/results?object=${object}`),
};

export interface Listener {
  began: (began: Began) => void;
  moment: (moment: Moment, picture: ImageBitmap) => void;
  over: (over: Over) => void;
  /** The connection ended before the attempt did, with the server's sentence or none. */
  lost: (sentence: string) => void;
}

/** One attempt over one connection. Pictures that come while one is being decoded are left out. */
export class AttemptConnection {
  private readonly socket: WebSocket;
  private ended = false;
  private decoding = false;
  private failed = '';
  private last = 0;

  constructor(begin: Begin, listener: Listener) {
    this.socket = new WebSocket(`wss://${location.host}/api/training/attempt`);
    this.socket.binaryType = 'arraybuffer';
    this.socket.onopen = () => this.socket.send(JSON.stringify({ begin }));
    this.socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (typeof event.data !== 'string') {
        void this.show(event.data, listener);
        return;
      }
      const said = JSON.parse(event.data) as { began?: Began; over?: Over; failed?: string };
      if (said.began) listener.began(said.began);
      if (said.failed !== undefined) {
        this.failed = said.failed;
        this.socket.close();
      }
      if (said.over) {
        this.ended = true;
        this.socket.close();
        listener.over(said.over);
      }
    };
    this.socket.onclose = (event) => {
      if (!this.ended) listener.lost(this.failed || event.reason);
      this.ended = true;
    };
  }

  /** The number that pictures name once they show it; 0 while nothing can be sent. */
  point(pointers: readonly Pointer[]): number {
    if (this.ended || this.socket.readyState !== WebSocket.OPEN) return 0;
    this.socket.send(JSON.stringify({ input: ++this.last, pointers }));
    return this.last;
  }
  giveUp(): void {
    if (!this.ended && this.socket.readyState === WebSocket.OPEN) this.socket.send('{"end":true}');
  }
  /** Leaves: an attempt that still runs is broken off, and nothing is told any more. */
  leave(): void {
    this.ended = true;
    this.socket.close();
  }

  private async show(message: ArrayBuffer, listener: Listener): Promise<void> {
    if (this.decoding || this.ended) return;
    this.decoding = true;
    try {
      const { about: moment, jpeg } = splitPicture<Moment>(message);
      const picture = await createImageBitmap(jpeg);
      if (!this.ended) listener.moment(moment, picture);
      picture.close();
    } finally {
      this.decoding = false;
    }
  }
}
