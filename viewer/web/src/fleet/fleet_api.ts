// The hospital's page: cases of all appliances, which lie in a store. At the address of kiroku-fleet serve alone.
import { cases, get, getWithin, post } from '@/api/client';
import type { FleetAppliance, FleetCase, FleetRooms } from '@/api/types';
import type { CasesPage } from '@/fleet/found_cases';
import { type FleetQuestion, isSearch, queryOf, searchOf } from '@/fleet/question';
import { session } from '@/shell/state';

export const fleet = {
  list: (question: FleetQuestion, limit: number, after?: string) =>
    isSearch(question)
      ? post<CasesPage>('fleet/cases/search', searchOf(question, limit, after))
      : get<CasesPage>(`fleet/cases?${queryOf(question, limit, after)}`),
  row: (id: string) => get<FleetCase>(`fleet/cases/${encodeURIComponent(id)}`),
  /** A server that hangs must not leave what it said before standing as if it were so now. */
  rooms: () => getWithin<FleetRooms>('fleet/rooms', 8000),
  enrol: (code: string) => post<{ appliance: string; fingerprint: string }>('fleet/enrolments', { code }),
  appliances: async () => (await get<{ appliances: FleetAppliance[] }>('fleet/appliances')).appliances,
};

export const isFleet = (): boolean => session.value?.serves === 'fleet';

/** What the list says of one case, whichever list this address has. */
export const rowOf = (id: string) => (isFleet() ? fleet.row(id) : cases.row(id));
