// What the server answers (docs/reference/viewer.md; /api/openapi.json).

export type Role = 'operator' | 'surgeon' | 'auditor' | 'administrator';
export type Verdict = 'intact' | 'intact-with-gaps' | 'intact-excerpt' | 'unproven' | 'incomplete' | 'tampered';
export type Severity = 'tampered' | 'incomplete' | 'unproven' | 'gap' | 'note';
export type TimeProof = 'external' | 'external-in-part' | 'self-issued' | 'none';
export type TokenKind = 'external' | 'self-issued' | 'not-judged';

export interface Session {
  user: string;
  /** A guest came by an invitation, and is no user. */
  role: Role | 'guest';
  unlocked: boolean;
  /** Came by a one-time password: nothing else is answered before another is chosen. */
  must_change_password: boolean;
  expires_s: number;
  language?: string | null;
  /** What this server is for; by `kiroku train serve`: training; by `kiroku plan serve`: planning. */
  serves: 'cases' | 'training' | 'planning';
  /** A guest's. */
  invitation?: { guest: string; room: string };
}

export interface CaseSummary {
  id: string;
  opened: string;
  duration_ns: number | null;
  state: string;
  streams: string[];
  segments: number;
  bytes: number;
  tokens: number;
  verdict: Verdict | null;
  verified: string | null;
  /** Of an unlocked session alone. */
  subject_state?: SubjectState;
  /** As it stood at the end. */
  subject?: Subject;
}

/** 'not-yours': the identity opens none of it; 'problem': it cannot be read; 'not-read': there was no time for it. */
export type SubjectState = 'none' | 'shown' | 'not-yours' | 'problem' | 'not-read';

/** Patient, procedure and staff, which were sealed; what is not known lacks. */
export interface Subject {
  /** When it became known while the case ran. */
  time_ns?: number;
  patient?: string;
  patient_id?: string;
  birth_date?: string;
  sex?: string;
  procedure?: string;
  procedure_code?: string;
  procedure_id?: string;
  planned?: string;
  staff: { role?: string; name?: string; id?: string }[];
  /** Who said so, and why these data. */
  origin?: string;
  chosen?: string;
}

export interface CaseList {
  cases: CaseSummary[];
  subjects: 'unlocked' | 'locked' | 'no-right';
  /** Cases whose subject there was no time to read: asking again gets further. */
  unread: number;
}

/** What a case that begins can be about, and which plan it can follow. */
export interface StartChoices {
  procedures: { key: string; subject: Subject }[];
  /** Where the hospital tells of procedures; none where nothing is configured. */
  ways: ProcedureWay[];
  plans: { seal: string; name: string; sealed: string }[];
}

export interface ProcedureWay {
  name: string;
  well: boolean;
  state: string;
}

/** What is said of a case when it begins, or of the patient while it runs: typed in, or one of the choices. */
export interface SaidOfCase {
  subject?: object;
  procedure?: string;
  plan?: string;
}

export interface StreamInfo {
  name: string;
  kind: string;
  media: string;
  purpose: string;
  profile: string;
  start_ns: number | null;
  end_ns: number | null;
}

export interface CaseInfo {
  id: string;
  opened: string;
  state: string;
  duration_ns: number;
  begins_ns: number;
  device: string;
  streams: StreamInfo[];
  plan: string | null;
}

export interface Segment {
  stream: string;
  index: number;
  start_ns: number;
  end_ns: number;
  complete: boolean;
  /** Removed by retention; its hash stays. */
  erased: boolean;
}

export interface Gap {
  stream: string;
  start_ns: number;
  end_ns: number;
  cause: string;
}

export interface Token {
  time_ns: number;
  gen_time: string;
  authority: string;
  kind: TokenKind;
  checkpoint: number;
}

export interface Checkpoint {
  time_ns: number;
  size: number;
}

export interface TimelineBracket {
  start_ns: number;
  end_ns: number;
  not_before: string | null;
  not_after: string | null;
  authority_before: string | null;
  authority_after: string | null;
}

export interface Mark {
  time_ns: number;
  text: string;
}

export interface Timeline {
  segments: Segment[];
  gaps: Gap[];
  tokens: Token[];
  checkpoints: Checkpoint[];
  brackets: TimelineBracket[];
  marks?: Mark[];
  /** Why marks that could be unlocked cannot be read. */
  marks_problem?: string;
}

/** start_ns, end_ns, lowest, highest, last */
export type VitalBin = [number, number, number, number, number];

export interface VitalSeries {
  code: string;
  label: string;
  unit: string;
  kind: 'numeric' | 'wave';
  stream: string;
  source: string;
  /** How far apart two values usually lie. */
  every_ns: number;
  bins: VitalBin[];
}

/** A quantity as its monitor shows it while it is recorded. */
export interface LiveSeries {
  code: string;
  label: string;
  unit: string;
  kind: 'numeric' | 'wave';
  stream: string;
  source: string;
  /** Of the newest value or block, on the case clock. */
  time_ns: number;
  /** Of a number; null where its device has none. */
  value?: number | null;
  /** Of a wave: those that end after what was asked. */
  blocks?: { end_ns: number; rate_hz: number; values: (number | null)[] }[];
}

export interface LiveVitals {
  /** Null while no case runs. */
  now_ns: number | null;
  series: LiveSeries[];
  alarms: { text: string; priority: string; stream: string; source: string; since_ns: number }[];
}

export interface Alarm {
  start_ns: number;
  end_ns: number;
  text: string;
  priority: string;
}

export interface VitalWords {
  time_ns: number;
  code: string;
  text: string;
}

export interface Vitals {
  series: VitalSeries[];
  alarms: Alarm[];
  texts: VitalWords[];
  /** What was recorded and could not be read. */
  unreadable: { start_ns: number; end_ns: number; problem: string }[];
}

export interface Finding {
  code: string;
  severity: Severity;
  file: string | null;
  entry: number | null;
  offset: number | null;
  /** The verifier's own sentence, in English. */
  text: string;
  /** What the code means. */
  meaning: Readonly<Record<'en' | 'ja', string>>;
  time_ns?: number | null;
}

export interface VerifiedBracket {
  first_entry: number;
  last_entry: number;
  not_before: string | null;
  not_after: string | null;
  authority_before: string | null;
  authority_after: string | null;
}

export interface VerifiedStream {
  name: string;
  kind: string;
  segments: number;
  /** Of `segments`: removed since by retention. */
  erased_segments: number;
  frames: number;
  dropped: number;
  bytes: number;
  gap_ns: number;
}

/** What part of a case an excerpt is. What stands in `stated` it says of itself: nothing proves it. */
export interface VerifiedExcerpt {
  from_ns: number;
  to_ns: number;
  begins_ns: number;
  with_gaps: boolean;
  streams: { name: string; selected: boolean; held_segments: number; held_frames: number; case_segments: number | null; case_frames: number | null; known_segments: number }[];
  stated: { made_utc: string | null; made_by: string | null };
}

export interface VerificationReport {
  state: 'done';
  verified: string;
  verdict: Verdict;
  time: TimeProof;
  device: string;
  opened: string | null;
  closed: string | null;
  entries: number;
  files: number;
  bytes: number;
  checkpoints: number;
  tokens: number;
  /** Null of a case. */
  excerpt: VerifiedExcerpt | null;
  streams: VerifiedStream[];
  brackets: VerifiedBracket[];
  findings: Finding[];
}

export type Verification = { state: 'running'; done_bytes: number; total_bytes: number } | VerificationReport;

export interface StreamStatus {
  name: string;
  kind: 'video' | 'vitals';
  live: boolean;
  frames: number;
  dropped: number;
  /** Lines of a device that are not among the samples. */
  refused: number;
  /** Decoded in the recorder itself, beside the device key. */
  unboxed: boolean;
  age_ms: number;
  durable_age_ms: number;
}

export interface AuthorityStatus {
  name: string;
  failures: number;
  last_error: string;
  last_token: string | null;
  left_alone_ms: number;
}

export interface RoomStatus {
  room: string;
  state: string;
  case: string;
  reason: string;
  /** Whether the running case has a patient and a procedure: said at the beginning, found by the recorder, said later. */
  subject: 'none' | 'given' | 'found' | 'late';
  procedure: ProcedureWay[];
  elapsed_ns: number;
  /** The case clock. */
  now_ns: number;
  streams: StreamStatus[];
  tokens: number;
  missed: number;
  authorities: AuthorityStatus[];
  problem: string;
  /** The case that was cut off and that this one carries on; '': none. */
  carries_on: string;
}

export interface ApplianceStatus {
  rooms: RoomStatus[];
  disk: { folder: string; free_bytes: number; total_bytes: number; hours_left: number | null };
  clock: { synchronised: boolean; offset_ns: number; error_ns: number };
  uptime_s: number;
}

export type Answer = 'holds' | 'differs' | 'could-not-check';

export interface Check {
  about: string;
  answer: Answer;
  text: string;
  entry: number | null;
  size: number | null;
  time: string | null;
  by: string | null;
}

export interface Judged {
  verdict: Answer;
  checks: Check[];
}

/** A plan beside this case's recording. */
export interface Comparison {
  name: string;
  plan: string;
  made_by: string;
  entered_by: string | null;
  made_at: string;
  program: string;
  /** Whether there is a film of the plan. */
  replay: boolean;
  /** Whether there is a film of its radiographs. */
  radiographs: boolean;
  whole: Judged;
  sealed_before: Judged;
}

export interface ComparedStep {
  /** From 1, as planned. */
  step: number;
  name: string;
  planned: { start_s: number; duration_s: number };
  done: {
    start_ns: number;
    end_ns: number;
    order: number;
    pauses: { start_ns: number; end_ns: number }[];
    pause_before_ns: number | null;
  } | null;
  vitals?: { code: string; label: string; unit: string; before: number | null; during: number | null; after: number | null }[];
  pressure_events?: { time_ns: number; text: string }[];
}

/** A step of a plan that waits to be matched. */
export interface PlannedStep {
  /** From 1. */
  step: number;
  name: string;
  start_s: number;
  duration_s: number;
}

/** A step that was marked while recording. */
export interface FoundStep {
  step: number;
  start_ns: number;
  end_ns: number | null;
  pauses: { start_ns: number; end_ns: number }[];
}

/** The plan that a case was recorded by, and between which moments its steps may lie. */
export interface Matching {
  plan: string;
  seal: string;
  stream: string;
  begins_ns: number;
  end_ns: number;
  steps: PlannedStep[];
  found: FoundStep[];
  /** The plan's tools, by their names. */
  tools: string[];
}

/** From where and when the plan is seen while points are picked on it: a view of planning, and the plan's moment. */
export interface PickingView {
  /** The plan's step, from 1. */
  step: number;
  plan_s: number;
  azimuth_deg: number;
  elevation_deg: number;
  zoom: number;
  pan_x: number;
  pan_y: number;
  width: number;
  height: number;
}

/** In the plan's unit; `view_axes` to the right, up, and towards who looks. */
export interface PickingCamera {
  eye: [number, number, number];
  view_axes: number[];
  half_extent: [number, number];
  centre: [number, number];
}

/** While the plan is still carried out. */
export interface Preparing {
  doing: string;
  share: number | null;
}

export type JudgedPoints = { rms_px: number; error_px: number[]; field_deg: number; field_estimated: boolean } | { problem: string };

export type ComparisonMaking =
  | { name: string; made_by: string; state: 'running'; doing: string; share: number | null }
  | { name: string; made_by: string; state: 'done' }
  | { name: string; made_by: string; state: 'failed'; problem: string };

/** docs/reference/format.md, "Comparisons": what of it the page shows. */
export interface ComparisonDocument {
  case: { stream: string };
  plan: { seal: string };
  in_planned_order: boolean;
  steps: ComparedStep[];
  time_map: { monotone: boolean; pieces: { step: number; knots: [number, number][] }[] } | null;
  registration: { rms_px: number; error_px: number[]; field_deg: number; field_estimated: boolean; lost_ns: number | null } | null;
  /** The plan's radiographs beside the case's fluoroscopy. */
  fluoroscopy: { stream: string; similarity: number; alignment: { similarity: number; translation_mm: [number, number, number] } | null } | null;
  tools: { tool: string; pictures: number; mean_px: number; largest_px: number }[];
}

export interface User {
  user: string;
  role: Role;
  locked: boolean;
  /** Until when a one-time password may be used that nobody has replaced yet. */
  one_time_until: string | null;
}
