// Whether the person at this page came by an invitation.
import { signal } from '@preact/signals';

/** The token of a link that was opened and not used yet. */
export const invited = signal<string | undefined>(undefined);
/** They were a guest, and are no more. */
export const guestIsOver = signal(false);
