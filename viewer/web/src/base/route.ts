// Where the person is: #/cases, #/cases?appliance=NAME, #/appliances, #/cases/ID?t=SECONDS, #/cases/ID/verification, #/rooms, #/log, #/users,
// #/training, #/planning, #/breathing, #/breathing?case=ID&stream=NAME.
import { signal } from '@preact/signals';
import { kSecond } from '@/base/time';

export type Route =
  | { view: 'cases'; appliance?: string }
  | { view: 'appliances' }
  | { view: 'case'; id: string; at_ns?: number }
  | { view: 'verification'; id: string }
  | { view: 'rooms' }
  | { view: 'log' }
  | { view: 'users' }
  | { view: 'training' }
  | { view: 'planning' }
  /** With a recording: for its fluoroscopy, whatever lung is open there. */
  | { view: 'breathing'; recording?: { id: string; stream: string } };

export function parseRoute(hash: string): Route {
  const [path = '', query = ''] = hash.replace(/^#\/?/, '').split('?');
  const [first, id, third] = path.split('/').map(decodeURIComponent);
  if (first === 'appliances') return { view: 'appliances' };
  if (first === 'rooms') return { view: 'rooms' };
  if (first === 'log') return { view: 'log' };
  if (first === 'users') return { view: 'users' };
  if (first === 'training' || first === 'planning') return { view: first };
  if (first === 'breathing') {
    const asked = new URLSearchParams(query);
    const of = asked.get('case');
    const stream = asked.get('stream');
    // Their texts come to stand in a command that somebody is to type: what could not be a case or a stream is no such address.
    return of && stream && /^\d{8}T\d{6}Z-[0-9a-f]{8}$/.test(of) && /^[a-z0-9-]{1,32}$/.test(stream)
      ? { view: 'breathing', recording: { id: of, stream } }
      : { view: 'breathing' };
  }
  if (first === 'cases' && id) {
    if (third === 'verification') return { view: 'verification', id };
    const at = new URLSearchParams(query).get('t');
    return at !== null && at !== '' && Number.isFinite(Number(at)) ? { view: 'case', id, at_ns: Math.round(Number(at) * kSecond) } : { view: 'case', id };
  }
  const appliance = new URLSearchParams(query).get('appliance');
  return appliance ? { view: 'cases', appliance } : { view: 'cases' };
}

export function hrefOf(route: Route): string {
  switch (route.view) {
    case 'case':
      return `#/cases/${encodeURIComponent(route.id)}${route.at_ns === undefined ? '' : `?t=${route.at_ns / kSecond}`}`;
    case 'cases':
      return route.appliance === undefined ? '#/cases' : `#/cases?${new URLSearchParams({ appliance: route.appliance })}`;
    case 'breathing':
      return route.recording === undefined ? '#/breathing' : `#/breathing?${new URLSearchParams({ case: route.recording.id, stream: route.recording.stream })}`;
    case 'verification':
      return `#/cases/${encodeURIComponent(route.id)}/verification`;
    default:
      return `#/${route.view}`;
  }
}

/** The secret of an address that signs in once, #sign-in=SECRET. */
export function signInLink(hash: string): string | undefined {
  return /^#sign-in=(.+)$/.exec(hash)?.[1];
}

export const route = signal<Route>({ view: 'cases' });

/** Asked before the person goes elsewhere: false, and they stay. Of a view with something that would be lost. */
let mayLeave: (() => boolean) | undefined;
export function askBeforeLeaving(ask: () => boolean): () => void {
  mayLeave = ask;
  return () => {
    if (mayLeave === ask) mayLeave = undefined;
  };
}

export function startRouting(): void {
  let here = location.hash;
  const read = () => {
    if (location.hash !== here && mayLeave && !mayLeave()) {
      history.replaceState(null, '', here || '#');
      return;
    }
    here = location.hash;
    route.value = parseRoute(location.hash);
  };
  addEventListener('hashchange', read);
  read();
}
