// The API as functions. Every failure is an ApiError with the server's sentence, in the language of the page.
import type {
  ApplianceStatus,
  CaseConsents,
  CaseInfo,
  CaseList,
  Comparison,
  ComparisonDocument,
  ComparisonMaking,
  JudgedPoints,
  LiveStream,
  LiveVitals,
  Matching,
  PickingCamera,
  PickingView,
  Preparing,
  Profile,
  ProfileChanged,
  Role,
  SaidOfCase,
  Session,
  StartChoices,
  Subject,
  Timeline,
  User,
  Verification,
  Vitals,
} from '@/api/types';
import { printable, printableTexts } from '@/base/printable';
import { inOwnWords } from '@/i18n/server_words';
import { t } from '@/i18n/i18n';

export class ApiError extends Error {
  constructor(
    readonly status: number,
    sentence: string,
  ) {
    super(sentence);
  }
}

/** The status of an error where no server answered. */
export const kNoAnswer = 0;

let onUnreachable: () => void = () => {};
/** Called whenever the server does not answer at all. */
export function whenUnreachable(action: () => void): void {
  onUnreachable = action;
}

/** Whether a server answers, whatever it says. */
export async function reachable(): Promise<boolean> {
  try {
    const { status } = await fetch('/api/session', { cache: 'no-store' });
    return status < 500;
  } catch {
    return false;
  }
}

let onSignedOut: () => void = () => {};
/** Called whenever the server no longer knows the session. */
export function whenSignedOut(action: () => void): void {
  onSignedOut = action;
}

async function failure(response: Response): Promise<ApiError> {
  const text = await response.text();
  try {
    const body = JSON.parse(text) as { error?: unknown };
    if (typeof body.error === 'string') return new ApiError(response.status, inOwnWords(printable(body.error), response.status));
  } catch {
    // A proxy in between answers in its own words.
  }
  return new ApiError(response.status, `${response.status} ${response.statusText}`);
}

async function ask(method: string, path: string, body?: unknown, signal?: AbortSignal): Promise<Response> {
  const options: RequestInit = { method, credentials: 'same-origin', cache: 'no-store', signal: signal ?? null };
  if (method !== 'GET') {
    options.headers = { 'Content-Type': 'application/json', 'X-Kiroku-Request': '1' };
    options.body = JSON.stringify(body ?? {});
  }
  const response = await fetch(`/api/${path}`, options).catch((error: unknown) => {
    if (signal?.aborted) throw error;
    onUnreachable();
    throw new ApiError(kNoAnswer, t('gone.title'));
  });
  if (response.ok) return response;
  const error = await failure(response);
  if (response.status === 401 && path !== 'session') onSignedOut();
  throw error;
}

async function json<T>(method: string, path: string, body?: unknown, signal?: AbortSignal): Promise<T> {
  const response = await ask(method, path, body, signal);
  const text = await response.text();
  return (text === '' ? undefined : JSON.parse(text, printableTexts)) as T;
}

async function bytes(path: string, signal?: AbortSignal): Promise<ArrayBuffer> {
  return (await ask('GET', path, undefined, signal)).arrayBuffer();
}

/** For a part of the API that has its functions beside its views. */
export const get = <T>(path: string): Promise<T> => json<T>('GET', path);
/** The same; after so long without an answer there is none. */
export async function getWithin<T>(path: string, most_ms: number): Promise<T> {
  const signal = AbortSignal.timeout(most_ms);
  try {
    return await json<T>('GET', path, undefined, signal);
  } catch (error) {
    throw signal.aborted ? new ApiError(kNoAnswer, t('gone.title')) : error;
  }
}
export const post = <T>(path: string, body: unknown): Promise<T> => json<T>('POST', path, body);
export const del = (path: string): Promise<void> => json<void>('DELETE', path);

const part = encodeURIComponent;
const caseOf = (id: string) => `cases/${part(id)}`;
const forPurpose = (purpose: string) => (purpose === '' ? '' : `&purpose=${part(purpose)}`);
const streamOf = (id: string, stream: string) => `${caseOf(id)}/streams/${part(stream)}`;

export const session = {
  get: () => json<Session>('GET', 'session'),
  signIn: (user: string, password: string) => json<Session>('POST', 'session', { user, password }),
  /** With the address that `kiroku view` printed for a demonstration. */
  signInByLink: (link: string) => json<Session>('POST', 'session', { link }),
  /** With the password of now; the user's other sessions end. */
  choosePassword: (password: string, new_password: string) => json<Session>('POST', 'session/password', { password, new_password }),
  signOut: () => json<void>('DELETE', 'session'),
  unlock: (identity: string, passphrase: string) => json<void>('POST', 'session/unlock', passphrase === '' ? { identity } : { identity, passphrase }),
  lock: () => json<void>('DELETE', 'session/unlock'),
};

export const cases = {
  /** Names are searched for, so that nothing of it may stand in an address, which logs keep. */
  list: (search: string, limit: number, before: string | undefined, signal?: AbortSignal) =>
    json<CaseList>('POST', 'cases/search', { search, limit, ...(before === undefined ? {} : { before }) }, signal),
  /** One of the list, by what is no secret: without its subject. */
  row: async (id: string) => (await json<CaseList>('GET', `cases?${new URLSearchParams({ search: id, limit: '1' })}`)).cases.find((one) => one.id === id),
  subject: (id: string) => json<{ state: 'none' | 'shown' | 'not-yours'; subjects: Subject[] }>('GET', `${caseOf(id)}/subject`),
  consents: (id: string) => json<CaseConsents>('GET', `${caseOf(id)}/consents`),
  get: (id: string) => json<CaseInfo>('GET', caseOf(id)),
  timeline: (id: string) => json<Timeline>('GET', `${caseOf(id)}/timeline`),
  vitals: (id: string, from_ns: number, to_ns: number, bins: number, signal?: AbortSignal) =>
    json<Vitals>('GET', `${caseOf(id)}/vitals?from_ns=${from_ns}&to_ns=${to_ns}&bins=${bins}`, undefined, signal),
  init: (id: string, stream: string, signal?: AbortSignal) => bytes(`${streamOf(id, stream)}/init.mp4`, signal),
  piece: (id: string, stream: string, piece: number, signal?: AbortSignal) => bytes(`${streamOf(id, stream)}/pieces/${piece}.mp4`, signal),
  /** What Media Source Extensions call the stream's sound; null for one without. */
  sound: async (id: string, stream: string, signal?: AbortSignal) =>
    (await json<{ codecs: string | null }>('GET', `${streamOf(id, stream)}/sound`, undefined, signal)).codecs,
  soundInit: (id: string, stream: string, signal?: AbortSignal) => bytes(`${streamOf(id, stream)}/sound/init.mp4`, signal),
  soundPiece: (id: string, stream: string, piece: number, signal?: AbortSignal) => bytes(`${streamOf(id, stream)}/sound/pieces/${piece}.mp4`, signal),
  thumbnailAddress: (id: string, stream: string, piece: number) => `/api/${streamOf(id, stream)}/thumbnails/${piece}.jpg`,
  /** The archived frame at `at_ns` (step 0), or the one before or after it. */
  frame: async (id: string, stream: string, at_ns: number, step: -1 | 0 | 1, signal?: AbortSignal) => {
    const response = await ask('GET', `${streamOf(id, stream)}/frame.png?at_ns=${at_ns}&step=${step}`, undefined, signal);
    return { time_ns: Number(response.headers.get('X-Kiroku-Frame-Time-Ns')), picture: await response.blob() };
  },
  comparisons: (id: string) => json<{ comparisons: Comparison[]; unreadable: { name: string; problem: string }[] }>('GET', `${caseOf(id)}/comparisons`),
  comparison: (id: string, name: string) => json<ComparisonDocument>('GET', `${caseOf(id)}/comparisons/${part(name)}`),
  /** A film of the plan: as the endoscope would see it, or as the fluoroscope would. */
  planFilm: async (id: string, name: string, film: 'replay' | 'radiographs', signal?: AbortSignal) =>
    (await ask('GET', `${caseOf(id)}/comparisons/${part(name)}/${film}.mp4`, undefined, signal)).blob(),
  /** What of the case's sealed plan can be matched by hand; takes as long as reading the plan does. */
  matching: (id: string) => json<Matching>('GET', `${caseOf(id)}/matching`),
  /** Has a comparison made, which takes minutes. */
  compare: (id: string, name: string, by_hand: unknown, more: { fluoroscopy: unknown; alignment: unknown }) =>
    json<ComparisonMaking>('POST', `${caseOf(id)}/comparisons`, { name, by_hand, ...more }),
  /** The plan's picture with its camera; which point of the organ is at a place of it; how well points register a camera. */
  planPicture: (id: string, view: PickingView) => json<{ jpeg: string; camera: PickingCamera } | Preparing>('POST', `${caseOf(id)}/picking/picture`, view),
  organPoint: (id: string, view: PickingView, x: number, y: number) =>
    json<{ organ: [number, number, number] | null } | Preparing>('POST', `${caseOf(id)}/picking/point`, { ...view, x, y }),
  judgePoints: (id: string, points: unknown) => json<JudgedPoints | Preparing>('POST', `${caseOf(id)}/picking/registration`, points),
  making: (id: string) => json<ComparisonMaking>('GET', `${caseOf(id)}/making`),
  stopMaking: (id: string) => json<void>('DELETE', `${caseOf(id)}/making`),
  verify: (id: string) => json<void>('POST', `${caseOf(id)}/verification`),
  verification: async (id: string): Promise<Verification | undefined> => {
    try {
      return await json<Verification>('GET', `${caseOf(id)}/verification`);
    } catch (error) {
      if (error instanceof ApiError && error.status === 404) return undefined; // not asked for yet
      throw error;
    }
  },
  reportAddress: (id: string, language: string) => `/api/${caseOf(id)}/report.pdf?language=${language}`,
  receiptAddress: (id: string, language: string) => `/api/${caseOf(id)}/receipt.pdf?language=${language}`,
  /** `purpose`: '' where none is named. */
  exportAddress: (id: string, stream: string, from_ns: number, to_ns: number, form: 'mkv' | 'csv' | 'jsonl', purpose: string) =>
    `/api/${caseOf(id)}/export?stream=${part(stream)}&from_ns=${from_ns}&to_ns=${to_ns}&form=${form}${forPurpose(purpose)}`,
  excerptAddress: (id: string, from_ns: number, to_ns: number, purpose: string) =>
    `/api/${caseOf(id)}/excerpt.tar?from_ns=${from_ns}&to_ns=${to_ns}${forPurpose(purpose)}`,
};

export const appliance = {
  status: () => json<ApplianceStatus>('GET', 'status'),
  choices: (room: string) => json<StartChoices>('GET', `rooms/${part(room)}/procedures`),
  start: (room: string, said: SaidOfCase) => json<void>('POST', `rooms/${part(room)}/start`, said),
  /** Waves after `after_ns` of the case clock. */
  vitals: (room: string, after_ns: number, signal?: AbortSignal) =>
    json<LiveVitals>('GET', `rooms/${part(room)}/vitals?after_ns=${Math.max(0, Math.round(after_ns))}`, undefined, signal),
  /** What acts on a case names it: the server refuses it where the room has gone on to another one by now. */
  say: (room: string, id: string, said: SaidOfCase) => json<void>('POST', `rooms/${part(room)}/subject`, { ...said, case: id }),
  stop: (room: string, id: string) => json<void>('POST', `rooms/${part(room)}/stop`, { case: id }),
  mark: (room: string, id: string, text: string) => json<void>('POST', `rooms/${part(room)}/mark`, { text, case: id }),
  archiveAs: (room: string, id: string, stream: string, profile: Profile) =>
    json<ProfileChanged>('POST', `rooms/${part(room)}/profile`, { profile, stream, case: id }),
};

/** RFC 6455, section 7.4.1, policy violation: how a socket ends whose session has ended. */
const kRefused = 1008;

export const live = {
  /** Whose pictures can be seen while they are recorded; none where the page is not kirokud's own. */
  streams: async () => (await json<{ streams: LiveStream[] }>('GET', 'live')).streams,
  /** After a socket was closed with `code`: where the session has ended, the page shall know at once. */
  closed: (code: number) => {
    if (code === kRefused) void live.streams().catch(() => {});
  },
  companyAddress: (room: string) => `wss://${location.host}/api/live/${part(room)}`,
  address: (room: string, stream: string) => `wss://${location.host}/api/live/${part(room)}/${part(stream)}`,
};

export const users = {
  list: async () => (await json<{ users: User[] }>('GET', 'users')).users,
  add: (user: string, password: string, role: Role) => json<void>('POST', 'users', { user, password, role }),
  remove: (user: string) => json<void>('DELETE', `users/${part(user)}`),
  changeRole: (user: string, role: Role) => json<User>('POST', `users/${part(user)}/role`, { role }),
  /** The one-time password, which is told this once. */
  resetPassword: (user: string) => json<{ password: string; until: string }>('POST', `users/${part(user)}/password`),
};
