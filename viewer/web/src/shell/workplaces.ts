// Where one can work by this address: at cases here, at planning, a breathing lung and training by programs behind the viewer. Which of them are there is asked after signing in
// and whenever somebody goes where none is.
import { signal } from '@preact/signals';
import { ApiError, get } from '@/api/client';
import { session } from '@/shell/state';

export type WorkplaceName = 'cases' | 'planning' | 'breathing' | 'training';
export type WorkplaceState = 'open' | 'no-right' | 'not-running' | 'not-installed';

/** Empty: not known yet. */
export const workplaces = signal<Partial<Record<WorkplaceName, WorkplaceState>>>({});

/** At an address that serves one of them alone there is nothing to ask. */
export async function lookForWorkplaces(): Promise<void> {
  const asker = session.value;
  if (asker?.serves !== 'cases' || asker.role === 'guest' || asker.must_change_password) return;
  try {
    const found = await get<{ workplaces: { name: WorkplaceName; state: WorkplaceState }[] }>('workplaces');
    workplaces.value = Object.fromEntries(found.workplaces.map(({ name, state }) => [name, state]));
  } catch (error) {
    // The frame tells of a server that is away; what is known stays.
    if (!(error instanceof ApiError)) throw error;
  }
}
