// Invitations, as the server tells them (docs/reference/viewer.md, "Invitations").
import { del, get, post } from '@/api/client';
import type { Invitation, Session } from '@/api/types';

export const invitations = {
  list: async () => (await get<{ invitations: Invitation[] }>('invitations')).invitations,
  /** `id`: the case that is recorded; '' where none is, and the guest is to see the next one. */
  make: (guest: string, room: string, id: string, minutes: number) => post<Invitation & { token: string }>('invitations', { guest, room, minutes, case: id }),
  end: (id: string) => del(`invitations/${encodeURIComponent(id)}`),
  join: (token: string) => post<Session>('session', { invitation: token }),
};

/** What a guest opens. The token stands in the fragment, which browsers never send. */
export const linkOf = (token: string): string => `${location.origin}/#invitation=${token}`;

/** The token of such an address. */
export function invitationLink(hash: string): string | undefined {
  return /^#invitation=(.+)$/.exec(hash)?.[1];
}
